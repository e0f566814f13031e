//! Expressions: operators with the priorities of the control, variables and functions; angles in degrees.

use super::super::error::Outcome;
use super::super::limits::MAX_NESTING;
use super::functions::function;
use super::scanner::BlockScanner;
use super::value::{ProgramValue, axis_of};

/// Relative difference below which two REAL values are equal, as on the control.
const EQUAL: f64 = 1e-12;
/// Most values of a call.
const MAX_ARGUMENTS: usize = 127;

/// Names that an expression refers to.
pub(super) trait Names {
    /// Returns the value of a variable: R parameter, user variable or system variable; `indices` are in its brackets.
    fn variable(&self, name: &str, indices: &[ProgramValue]) -> Outcome<ProgramValue>;
    /// Returns true if the program has defined a variable of this name.
    fn is_defined(&self, name: &str) -> bool;
}

/// Operation on two numbers.
type Operation = fn(f64, f64) -> f64;
/// Priority of comparisons, the lowest.
const COMPARISON: u8 = 1;
/// Priority of `<<`.
const CONCATENATION: u8 = 2;
/// Priority of `:` of frames and of multiplication, the highest of two values.
const PRODUCT: u8 = 10;
/// Symbols with their priorities; longer ones first.
const SYMBOLS: [(&str, u8, Operation); 12] = [
    ("==", COMPARISON, |left, right| f64::from(is_equal(left, right))),
    ("<>", COMPARISON, |left, right| f64::from(!is_equal(left, right))),
    (">=", COMPARISON, |left, right| f64::from(left >= right)),
    ("<=", COMPARISON, |left, right| f64::from(left <= right)),
    ("<<", CONCATENATION, |_, _| f64::NAN),
    (">", COMPARISON, |left, right| f64::from(left > right)),
    ("<", COMPARISON, |left, right| f64::from(left < right)),
    ("+", 9, |left, right| left + right),
    ("-", 9, |left, right| left - right),
    ("*", PRODUCT, |left, right| left * right),
    ("/", PRODUCT, |left, right| left / right),
    (":", PRODUCT, |_, _| f64::NAN),
];
/// Operators that are names, with their priorities.
const WORDS: [(&str, u8, Operation); 8] = [
    ("OR", 3, |left, right| f64::from(left != 0.0 || right != 0.0)),
    ("XOR", 4, |left, right| f64::from((left != 0.0) != (right != 0.0))),
    ("AND", 5, |left, right| f64::from(left != 0.0 && right != 0.0)),
    ("B_OR", 6, |left, right| f64::from(bits(left) | bits(right))),
    ("B_XOR", 7, |left, right| f64::from(bits(left) ^ bits(right))),
    ("B_AND", 8, |left, right| f64::from(bits(left) & bits(right))),
    ("DIV", PRODUCT, |left, right| (left / right).trunc()),
    ("MOD", PRODUCT, |left, right| left % right),
];

fn is_equal(left: f64, right: f64) -> bool {
    (left - right).abs() <= EQUAL * left.abs().max(right.abs())
}

fn bits(value: f64) -> i32 {
    value.round() as i32
}

impl BlockScanner<'_> {
    /// Skips an expression, and returns its value.
    pub(super) fn value(&mut self, names: &dyn Names) -> Outcome<ProgramValue> {
        self.operation(names, COMPARISON)
    }

    /// Skips an expression, and returns its number.
    pub(super) fn number_value(&mut self, names: &dyn Names) -> Outcome<f64> {
        self.value(names)?.number()
    }

    /// Skips operators from a priority on.
    fn operation(&mut self, names: &dyn Names, lowest: u8) -> Outcome<ProgramValue> {
        self.nest()?;
        let mut left = self.unary(names)?;
        let mut has_comparison = false;
        while let Some((operator, priority, operation)) = self.peek_operator() {
            if priority < lowest {
                break;
            }
            if priority == COMPARISON && has_comparison {
                return Err(format!(
                    "two comparisons without parentheses, at {}: AND and OR have the higher priority, write (R1>2) AND (R2<3)",
                    self.rest()
                ));
            }
            has_comparison |= priority == COMPARISON;
            self.peek();
            self.advance(operator.len());
            let right = self.operation(names, priority + 1)?;
            left = combine(left, operator, operation, right)?;
        }
        self.depth -= 1;
        Ok(left)
    }

    fn nest(&mut self) -> Outcome<()> {
        self.depth += 1;
        match self.depth <= 8 * MAX_NESTING {
            true => Ok(()),
            false => Err(format!("values are nested more than {} levels deep", 8 * MAX_NESTING)),
        }
    }

    fn peek_operator(&mut self) -> Option<(&'static str, u8, Operation)> {
        let name = self.peek_name();
        if !name.is_empty() {
            return WORDS.into_iter().find(|(word, ..)| *word == name);
        }
        SYMBOLS.into_iter().find(|(symbol, ..)| {
            let mut ahead = self.clone();
            ahead.skip(symbol)
        })
    }

    fn unary(&mut self, names: &dyn Names) -> Outcome<ProgramValue> {
        if self.skip("-") {
            return self.nested_unary(names, |value| -value);
        }
        if self.skip("+") {
            return self.nested_unary(names, |value| value);
        }
        if self.skip_name("NOT") {
            return self.nested_unary(names, |value| f64::from(value == 0.0));
        }
        if self.skip_name("B_NOT") {
            return self.nested_unary(names, |value| f64::from(!bits(value)));
        }
        self.primary(names)
    }

    fn nested_unary(&mut self, names: &dyn Names, operation: fn(f64) -> f64) -> Outcome<ProgramValue> {
        self.nest()?;
        let value = self.unary(names)?.number()?;
        self.depth -= 1;
        Ok(ProgramValue::Number(operation(value)))
    }

    fn primary(&mut self, names: &dyn Names) -> Outcome<ProgramValue> {
        match self.peek() {
            Some(b'0'..=b'9' | b'.' | b'\'') => self.number().map(ProgramValue::Number),
            Some(b'"') => self.string().map(ProgramValue::Text),
            Some(b'(') => {
                self.advance(1);
                let value = self.value(names)?;
                self.require(")")?;
                Ok(value)
            }
            Some(b'A'..=b'Z' | b'_' | b'$') => self.named(names),
            _ => Err(format!("{}: a value is required", self.rest())),
        }
    }

    fn named(&mut self, names: &dyn Names) -> Outcome<ProgramValue> {
        let name = self.name()?;
        match name {
            "TRUE" => return Ok(ProgramValue::Number(1.0)),
            "FALSE" => return Ok(ProgramValue::Number(0.0)),
            "PI" | "$PI" => return Ok(ProgramValue::Number(std::f64::consts::PI)),
            "ISVAR" => return self.is_variable(names),
            _ => {}
        }
        // Behind an R parameter a parenthesis begins a remark.
        let is_parameter =
            name.strip_prefix('R').is_some_and(|digits| digits.bytes().all(|byte| byte.is_ascii_digit()));
        if self.peek() == Some(b'(') && !is_parameter && !names.is_defined(name) {
            let arguments = self.arguments(names)?;
            return function(name, arguments);
        }
        let indices = self.indices(names)?;
        if indices.is_empty()
            && !names.is_defined(name)
            && let Some(axis) = axis_of(name)
        {
            return Ok(ProgramValue::Axis(axis));
        }
        names.variable(name, &indices)
    }

    /// Skips the name in `ISVAR("NAME")`, and returns 1 if the variable is defined.
    fn is_variable(&mut self, names: &dyn Names) -> Outcome<ProgramValue> {
        self.require("(")?;
        let name = self.string()?.to_ascii_uppercase();
        self.require(")")?;
        let name = name.split('[').next().unwrap_or_default();
        let is_known = names.is_defined(name) || names.variable(name, &[]).is_ok();
        Ok(ProgramValue::boolean(is_known))
    }

    /// Skips `[1,X]` if it follows, and returns the values.
    pub(super) fn indices(&mut self, names: &dyn Names) -> Outcome<Vec<ProgramValue>> {
        let mut indices = Vec::new();
        if !self.skip("[") {
            return Ok(indices);
        }
        loop {
            if indices.len() >= 3 {
                return Err("more than three indices".to_owned());
            }
            // TR, FI, RT, SC and MI are the components of a frame.
            let component = ["TR", "FI", "RT", "SC", "MI"].into_iter().find(|name| self.skip_name(name));
            let index = match component {
                Some(component) => ProgramValue::Text(component.to_owned()),
                None => self.value(names)?,
            };
            indices.push(index);
            if !self.skip(",") {
                break;
            }
        }
        self.require("]")?;
        Ok(indices)
    }

    /// Skips `(1, ,X)` if it follows, and returns the values; a missing one is `None`.
    pub(super) fn arguments(&mut self, names: &dyn Names) -> Outcome<Vec<Option<ProgramValue>>> {
        let mut arguments = Vec::new();
        if !self.skip("(") || self.skip(")") {
            return Ok(arguments);
        }
        loop {
            let is_missing = matches!(self.peek(), Some(b',' | b')'));
            if arguments.len() >= MAX_ARGUMENTS {
                return Err(format!("more than {MAX_ARGUMENTS} values in parentheses"));
            }
            arguments.push(if is_missing { None } else { Some(self.value(names)?) });
            if !self.skip(",") {
                break;
            }
        }
        self.require(")")?;
        Ok(arguments)
    }
}

fn combine(
    left: ProgramValue,
    operator: &str,
    operation: Operation,
    right: ProgramValue,
) -> Outcome<ProgramValue> {
    match (left, operator, right) {
        (left, "<<", right) => Ok(ProgramValue::Text(left.text() + &right.text())),
        (ProgramValue::CoordinateFrame(left), ":", ProgramValue::CoordinateFrame(right)) => {
            Ok(ProgramValue::CoordinateFrame(Box::new(left.then(&right))))
        }
        (ProgramValue::Text(left), "==", ProgramValue::Text(right)) => {
            Ok(ProgramValue::boolean(left == right))
        }
        (ProgramValue::Text(left), "<>", ProgramValue::Text(right)) => {
            Ok(ProgramValue::boolean(left != right))
        }
        (ProgramValue::Axis(left), "==", ProgramValue::Axis(right)) => {
            Ok(ProgramValue::boolean(left == right))
        }
        (ProgramValue::Axis(left), "<>", ProgramValue::Axis(right)) => {
            Ok(ProgramValue::boolean(left != right))
        }
        (left, operator, right) => {
            let (left, right) = (left.number()?, right.number()?);
            let value = operation(left, right);
            match value.is_finite() {
                true => Ok(ProgramValue::Number(value)),
                false => Err(format!("{left} {operator} {right}: the value is not finite")),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpret::sinumerik::scanner::BlockText;

    struct TestNames;

    impl Names for TestNames {
        fn variable(&self, name: &str, indices: &[ProgramValue]) -> Outcome<ProgramValue> {
            match (name, indices) {
                ("R1", []) => Ok(ProgramValue::Number(7.0)),
                ("FIELD", [ProgramValue::Number(index), ProgramValue::Axis(axis)]) => {
                    Ok(ProgramValue::Number(10.0 * index + *axis as f64))
                }
                ("NAME", []) => Ok(ProgramValue::Text("Bore".into())),
                _ => Err(format!("{name} is not declared")),
            }
        }

        fn is_defined(&self, name: &str) -> bool {
            matches!(name, "FIELD" | "NAME")
        }
    }

    fn value(text: &str) -> Outcome<ProgramValue> {
        // A parenthesis that begins a block is a remark.
        let mut block = BlockText { raw: format!("V={text}").into_bytes(), ..BlockText::default() };
        block.read()?;
        let mut scanner = BlockScanner::new(&block.text);
        scanner.advance(2);
        scanner.value(&TestNames)
    }

    fn number(text: &str) -> f64 {
        value(text).and_then(ProgramValue::number).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn priorities_are_those_of_the_control() {
        // Section "Priority of the operations" of the programming guide: comparisons are the lowest.
        let cases = [
            ("2+3*4", 14.0),
            ("(2+3)*4", 20.0),
            ("2*-3", -6.0),
            ("-2+5", 3.0),
            ("7 DIV 2", 3.0),
            ("-7 DIV 2", -3.0),
            ("7 MOD 4*2", 6.0),
            ("3/4", 0.75),
            ("1+2==3", 1.0),
            ("5 B_AND 3 B_OR 8", 9.0),
            ("1 OR 0 AND 0", 1.0),
            ("(1 OR 0) AND 0", 0.0),
            ("1 XOR 1 OR 1", 1.0),
            ("NOT 0 AND 1", 1.0),
            ("(R1>2) AND (R1<8)", 1.0),
            ("R1==7", 1.0),
            ("R1<>7", 0.0),
            ("0.1+0.2==0.3", 1.0),
            ("NAME==\"Bore\"", 1.0),
            ("'HFF'+'B101'", 260.0),
            ("1.5EX2", 150.0),
            ("FIELD[2,Z]", 22.0),
            ("ISVAR(\"FIELD[1]\")+ISVAR(\"OTHER\")", 1.0),
        ];
        for (text, expected) in cases {
            assert!((number(text) - expected).abs() < 1e-12, "{text}: {}", number(text));
        }
    }

    #[test]
    fn functions_take_degrees() {
        let cases = [
            ("SIN(30)", 0.5),
            ("COS(60)", 0.5),
            ("TAN(45)", 1.0),
            ("ASIN(0.5)", 30.0),
            ("ACOS(0.5)", 60.0),
            ("ATAN2(1,-1)", 135.0),
            ("SQRT(POT(3)+16)", 5.0),
            ("ABS(-3)", 3.0),
            ("TRUNC(-2.7)", -2.0),
            ("ROUND(2.5)", 3.0),
            ("ROUNDUP(2.1)", 3.0),
            ("LN(EXP(2))", 2.0),
            ("MINVAL(3,2)+MAXVAL(3,2)", 5.0),
            ("BOUND(1,5,9)", 5.0),
            ("STRLEN(\"DRILL\")", 5.0),
            ("NUMBER(\"12.5\")", 12.5),
            ("INDEX(\"DRILL_8\",\"_\")", 5.0),
        ];
        for (text, expected) in cases {
            assert!((number(text) - expected).abs() < 1e-12, "{text}: {}", number(text));
        }
        assert_eq!(value("\"Hole \"<<3<<\" of \"<<2.5").unwrap(), ProgramValue::Text("Hole 3 of 2.5".into()));
    }

    #[test]
    fn errors_say_what_is_required() {
        let cases = [
            ("R1>2 AND R1<8", "two comparisons without parentheses"),
            ("1/0", "not finite"),
            ("SQRT(-1)", "SQRT(-1): the value is not finite"),
            ("SIN(1", ") is required"),
            ("FOO(2)", "FOO(): no such function"),
            ("OTHER", "OTHER is not declared"),
            ("*2", "a value is required"),
            ("\"A", "without closing quote"),
            ("\"A\"*2", "a number is required"),
        ];
        for (text, expected) in cases {
            let error = value(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
        assert!(value(&"(".repeat(5000)).unwrap_err().contains("nested"));
        assert!(value(&"-".repeat(5000)).unwrap_err().contains("nested"));
    }
}
