//! Values of words: numbers, parameters, expressions and functions, in degrees and the units of the program.

use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::{MAX_NAME, MAX_NESTING};
use super::parameters::parameter_number;
use super::state::State;

/// Difference below which EQ and NE regard two values as equal, as LinuxCNC does.
const EQUAL: f64 = 1e-4;
/// Function of one value in brackets.
type Function = fn(f64) -> f64;
/// Functions, with what a value outside of their range must be.
const FUNCTIONS: [(&str, Function, &str); 12] = [
    ("abs", f64::abs, ""),
    ("acos", |x| x.acos().to_degrees(), "between -1 and 1"),
    ("asin", |x| x.asin().to_degrees(), "between -1 and 1"),
    ("cos", |x| x.to_radians().cos(), ""),
    ("exp", f64::exp, ""),
    ("fix", f64::floor, ""),
    ("fup", f64::ceil, ""),
    ("ln", |x| if x > 0.0 { x.ln() } else { f64::NAN }, "positive"),
    ("round", f64::round, ""),
    ("sin", |x| x.to_radians().sin(), ""),
    ("sqrt", f64::sqrt, "0 or positive"),
    ("tan", |x| x.to_radians().tan(), ""),
];
/// Further functions of macro B: numbers with four bits for each decimal digit, and the decimal point of an argument,
/// which arguments here need not have.
const MACRO_B: [(&str, Function, &str); 3] = [
    ("adp", |x| x, ""),
    ("bcd", |x| from_digits(x, 10, 16), "an integer from 0 to 99999999"),
    ("bin", |x| from_digits(x, 16, 10), "decimal digits of four bits"),
];

/// Returns the value with the digits in the base `of` as digits in the base `to`; NaN if there is none.
fn from_digits(value: f64, of: u64, to: u64) -> f64 {
    let (mut rest, mut scale, mut result) = (value as u64, 1, 0);
    let is_valid = value >= 0.0 && value.fract() == 0.0 && value < (of as f64).powi(8);
    while rest > 0 && is_valid {
        if rest % of > 9 {
            return f64::NAN;
        }
        result += rest % of * scale;
        (rest, scale) = (rest / of, scale * to);
    }
    if is_valid { result as f64 } else { f64::NAN }
}

/// Operation on two values.
type Operation = fn(f64, f64) -> f64;
/// Operators with their precedence; longer names first.
const OPERATORS: [(&str, u8, Operation); 15] = [
    ("**", 5, f64::powf),
    ("mod", 4, f64::rem_euclid),
    ("and", 1, |left, right| f64::from(left != 0.0 && right != 0.0)),
    ("xor", 1, |left, right| f64::from((left != 0.0) != (right != 0.0))),
    ("or", 1, |left, right| f64::from(left != 0.0 || right != 0.0)),
    ("eq", 2, |left, right| f64::from((left - right).abs() < EQUAL)),
    ("ne", 2, |left, right| f64::from((left - right).abs() >= EQUAL)),
    ("gt", 2, |left, right| f64::from(left > right)),
    ("ge", 2, |left, right| f64::from(left >= right)),
    ("lt", 2, |left, right| f64::from(left < right)),
    ("le", 2, |left, right| f64::from(left <= right)),
    ("*", 4, |left, right| left * right),
    ("/", 4, |left, right| left / right),
    ("+", 3, |left, right| left + right),
    ("-", 3, |left, right| left - right),
];

/// Scanner of a compact line.
pub(super) struct Scanner<'a> {
    text: &'a [u8],
    at: usize,
    depth: usize,
    /// True after a number with a decimal point.
    has_point: bool,
    state: &'a State,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(text: &'a [u8], state: &'a State) -> Self {
        Self { text, at: 0, depth: 0, has_point: false, state }
    }

    /// Returns the next byte.
    pub(super) fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    /// Returns the next byte and skips it.
    pub(super) fn take(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.at += 1;
        Some(byte)
    }

    /// Returns the text that is left, in upper case for a message.
    pub(super) fn rest(&self) -> String {
        let rest = self.text.get(self.at..).unwrap_or_default();
        String::from_utf8_lossy(&rest[..rest.len().min(40)]).to_uppercase()
    }

    /// Returns the number of bytes that were read.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// Returns true if the text continues with `word`.
    pub(super) fn starts_with(&self, word: &str) -> bool {
        self.text.get(self.at..).is_some_and(|rest| rest.starts_with(word.as_bytes()))
    }

    /// Returns true if no value follows: the line ends, or another word begins, which is no function with brackets.
    pub(super) fn has_no_value(&self) -> bool {
        let rest = self.text.get(self.at..).unwrap_or_default();
        let letters = rest.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
        rest.is_empty() || (letters > 0 && rest.get(letters) != Some(&b'['))
    }

    /// Skips `word` if the text continues with it.
    pub(super) fn skip(&mut self, word: &str) -> bool {
        let found = self.starts_with(word);
        self.at += if found { word.len() } else { 0 };
        found
    }

    /// Returns true if the last value of a word has a decimal point.
    pub(super) fn has_point(&self) -> bool {
        self.has_point
    }

    /// Reads the value of a word; `None` for a variable of macro B without value.
    pub(super) fn word_value(&mut self) -> Outcome<Option<f64>> {
        self.has_point = false;
        let value = self.value()?;
        // `F[#1*2].`: a decimal point after an expression.
        if self.has_macro_b() && self.text[..self.at].ends_with(b"]") {
            self.has_point |= self.skip(".");
        }
        Ok(Some(value).filter(|value| !value.is_nan()))
    }

    /// Reads the value of a setting; of macro B an expression without brackets.
    pub(super) fn setting_value(&mut self) -> Outcome<f64> {
        if self.has_macro_b() { self.operations(1) } else { self.value() }
    }

    /// Returns true for translated lines of Okuma.
    pub(super) fn is_okuma(&self) -> bool {
        self.state.dialect == Dialect::Okuma
    }

    fn has_macro_b(&self) -> bool {
        self.state.dialect.has_macro_b()
    }

    /// Reads a value: number, parameter, expression in brackets or function, with an optional sign.
    pub(super) fn value(&mut self) -> Outcome<f64> {
        self.depth += 1;
        if self.depth > MAX_NESTING {
            return Err(format!("expression nested more than {MAX_NESTING} levels deep"));
        }
        let value = match self.peek() {
            Some(b'[') => self.bracket()?,
            Some(b'#') => self.parameter()?,
            Some(b'0'..=b'9' | b'.') => self.number()?,
            Some(b'-') => {
                self.at += 1;
                -self.value()?
            }
            Some(b'+') => {
                self.at += 1;
                self.value()?
            }
            Some(b'a'..=b'z') => self.function()?,
            _ => return Err(format!("{}: a number, parameter or expression is required", self.found())),
        };
        self.depth -= 1;
        // A variable of macro B without value is NaN.
        match value.is_finite() || (value.is_nan() && self.has_macro_b()) {
            true => Ok(value),
            false => Err("expression without finite value: check divisors and powers".to_owned()),
        }
    }

    /// Returns the text that is left for a message, or that the line ends.
    pub(super) fn found(&self) -> String {
        let rest = self.rest();
        if rest.is_empty() { "end of the line".to_owned() } else { rest }
    }

    /// Reads digits with an optional decimal point.
    fn number(&mut self) -> Outcome<f64> {
        let rest = &self.text[self.at..];
        let mut points = 0;
        let end = rest.iter().position(|byte| {
            points += u32::from(*byte == b'.');
            !(byte.is_ascii_digit() || (*byte == b'.' && points == 1))
        });
        let digits = &rest[..end.unwrap_or(rest.len())];
        let number = str::from_utf8(digits).ok().and_then(|digits| digits.parse().ok());
        let number = number.ok_or_else(|| format!("{}: not a number", self.found()))?;
        self.at += digits.len();
        self.has_point |= points > 0;
        Ok(number)
    }

    /// Reads an expression in brackets.
    pub(super) fn bracket(&mut self) -> Outcome<f64> {
        if !self.skip("[") {
            return Err(format!("{}: an expression in brackets is required", self.found()));
        }
        let value = self.operations(1)?;
        match self.take() {
            Some(b']') => Ok(value),
            Some(_) => {
                self.at -= 1;
                Err(format!("{}: an operator or closing bracket is required", self.rest()))
            }
            None => Err("expression without closing bracket".to_owned()),
        }
    }

    /// Reads values joined by operators of at least the given precedence, grouped from left to right.
    fn operations(&mut self, precedence: u8) -> Outcome<f64> {
        let mut left = self.value()?;
        while let Some((name, binding, operation)) = self.operator()
            && binding >= precedence
        {
            self.at += name.len();
            let right = self.operations(binding + 1)?;
            left = match self.has_macro_b() {
                true => apply_macro_b(name, operation, left, right)?,
                false => apply(name, operation, left, right)?,
            };
        }
        Ok(left)
    }

    fn operator(&self) -> Option<(&'static str, u8, Operation)> {
        let rest = self.text.get(self.at..)?;
        OPERATORS.into_iter().find(|(name, ..)| rest.starts_with(name.as_bytes()))
    }

    /// Reads a parameter `#5`, `#[…]` or `#<name>`.
    fn parameter(&mut self) -> Outcome<f64> {
        match self.target()? {
            Target::Number(number) => self.state.numbered(number),
            Target::Name(name) => {
                // Okuma compares with EMPTY.
                let may_be_empty = self.state.dialect == Dialect::Okuma
                    && ["eq#0", "ne#0"].into_iter().any(|text| self.starts_with(text));
                self.state.named(name).or_else(|error| if may_be_empty { Ok(f64::NAN) } else { Err(error) })
            }
        }
    }

    /// Reads the name of a parameter, with its `#`.
    pub(super) fn target(&mut self) -> Outcome<Target<'a>> {
        if !self.skip("#") {
            return Err(format!("{}: a parameter is required", self.found()));
        }
        if self.peek() == Some(b'<') {
            return self.name().map(Target::Name);
        }
        let value = self.value()?;
        parameter_number(value, self.state.dialect).map(Target::Number)
    }

    /// Reads a name in angle brackets.
    pub(super) fn name(&mut self) -> Outcome<&'a str> {
        let rest = &self.text[self.at + 1..];
        let end = rest.iter().position(|byte| *byte == b'>');
        let name = end.and_then(|end| str::from_utf8(&rest[..end]).ok()).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| format!("{}: a name in angle brackets is required", self.found()))?;
        if name.len() > MAX_NAME {
            return Err(format!("<{}…>: a name has at most {MAX_NAME} characters", &name[..MAX_NAME]));
        }
        self.at += name.len() + 2;
        Ok(name)
    }

    fn function(&mut self) -> Outcome<f64> {
        if self.skip("exists") {
            return self.exists();
        }
        if self.skip("atan") {
            return self.arc_tangent();
        }
        if self.has_macro_b() && self.skip("pow") {
            let [base, exponent] = self.two_values("POW")?;
            return apply("**", f64::powf, base, exponent);
        }
        if self.has_macro_b() && self.starts_with("prm[") {
            return Err(
                "PRM: a parameter of the control, which a simulation lacks: write a number in its place"
                    .to_owned(),
            );
        }
        let macro_b: &[_] = if self.has_macro_b() { &MACRO_B } else { &[] };
        let found = FUNCTIONS.iter().chain(macro_b).copied().find(|(name, ..)| self.skip(name));
        let (name, function, range) = found.ok_or_else(|| {
            let rest = self.rest();
            let argument = rest.trim_start_matches(|letter: char| letter.is_ascii_alphabetic());
            if argument.starts_with('[') {
                let known =
                    FUNCTIONS.iter().map(|(name, ..)| name.to_uppercase()).collect::<Vec<_>>().join(" ");
                return format!("{rest}: not a function; supported: ATAN EXISTS {known}");
            }
            let hint = if rest.starts_with('O') { "; is the letter O meant as zero?" } else { "" };
            format!("{rest}: not a number{hint}")
        })?;
        let value = self.bracket()?;
        let function = match name {
            "fix" if self.has_macro_b() => f64::trunc,
            "fup" if self.has_macro_b() => |value: f64| value.abs().ceil().copysign(value),
            _ => function,
        };
        match function(if value.is_nan() { 0.0 } else { value }) {
            result if result.is_nan() => Err(format!("{}[{value}]: must be {range}", name.to_uppercase())),
            result if name == "asin" => Ok(self.whole_turn(result)),
            result => Ok(result),
        }
    }

    /// Reads `[y]/[x]`; of macro B also `[y,x]` and `[y/x]` alone.
    fn arc_tangent(&mut self) -> Outcome<f64> {
        let start = self.at;
        let y = self.bracket();
        if self.has_macro_b() && (y.is_err() || self.peek() != Some(b'/')) {
            if let Ok(y) = y {
                return Ok(y.atan().to_degrees());
            }
            self.at = start;
            let [y, x] = self.two_values("ATAN")?;
            return Ok(self.whole_turn(y.atan2(x).to_degrees()));
        }
        let y = y?;
        if !self.skip("/") {
            return Err("ATAN: a second value is required, ATAN[y]/[x]".to_owned());
        }
        let x = self.bracket()?;
        Ok(self.whole_turn(y.atan2(x).to_degrees()))
    }

    /// Returns an angle in degrees: 0 to 360 of Fanuc (parameter 6004#0 is 0), −180 to 180 of others.
    fn whole_turn(&self, degrees: f64) -> f64 {
        if self.state.dialect == Dialect::Fanuc && degrees < 0.0 { degrees + 360.0 } else { degrees }
    }

    /// Reads two values in brackets with a comma.
    fn two_values(&mut self, name: &str) -> Outcome<[f64; 2]> {
        let required = || format!("{name}: two values in brackets are required, {name}[a,b]");
        if !self.skip("[") {
            return Err(required());
        }
        let first = self.operations(1)?;
        if !self.skip(",") {
            return Err(required());
        }
        let second = self.operations(1)?;
        if self.skip("]") { Ok([first, second]) } else { Err(required()) }
    }

    fn exists(&mut self) -> Outcome<f64> {
        let is_valid = self.skip("[") && self.skip("#") && self.peek() == Some(b'<');
        let name = if is_valid { Some(self.name()?) } else { None };
        match name {
            Some(name) if self.skip("]") => Ok(f64::from(self.state.is_defined(name))),
            _ => Err("EXISTS: a named parameter in brackets is required, EXISTS[#<name>]".to_owned()),
        }
    }
}

/// Name of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target<'a> {
    /// Number.
    Number(usize),
    /// Name; global names begin with an underscore.
    Name(&'a str),
}

/// Applies an operator of macro B: variables without value differ from 0 for EQ and NE only, and AND, OR and XOR act on
/// the bits of integers.
fn apply_macro_b(name: &str, operation: Operation, left: f64, right: f64) -> Outcome<f64> {
    if left.is_nan() || right.is_nan() {
        match name {
            "eq" => return Ok(f64::from(left.is_nan() && right.is_nan())),
            "ne" => return Ok(f64::from(left.is_nan() != right.is_nan())),
            _ => {}
        }
    }
    let [left, right] = [left, right].map(|value| if value.is_nan() { 0.0 } else { value });
    let are_integers = left.fract() == 0.0 && right.fract() == 0.0 && left.abs().max(right.abs()) < 1e15;
    let bits = (left as i64, right as i64);
    match name {
        "and" if are_integers => Ok((bits.0 & bits.1) as f64),
        "or" if are_integers => Ok((bits.0 | bits.1) as f64),
        "xor" if are_integers => Ok((bits.0 ^ bits.1) as f64),
        "mod" if right != 0.0 => Ok(left % right),
        _ => apply(name, operation, left, right),
    }
}

/// Applies an operator.
fn apply(name: &str, operation: Operation, left: f64, right: f64) -> Outcome<f64> {
    match name {
        "**" if left < 0.0 && right.fract() != 0.0 => {
            return Err("power of a negative value with a fractional exponent".to_owned());
        }
        "/" | "mod" if right == 0.0 => return Err("division by zero".to_owned()),
        _ => {}
    }
    let value = operation(left, right);
    match value.is_finite() {
        true => Ok(value),
        false => Err(format!("{}: result is not finite", name.to_uppercase())),
    }
}
