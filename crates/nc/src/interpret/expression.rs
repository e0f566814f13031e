//! Values of words: numbers, parameters, expressions and functions, in degrees and the units of the program.

use super::error::Outcome;
use super::limits::{MAX_NAME, MAX_NESTING};
use super::parameters::{Variables, parameter_number};

/// Difference below which EQ and NE regard two values as equal, as LinuxCNC does.
const EQUAL: f64 = 1e-4;
/// Names of functions of one value in brackets.
const FUNCTIONS: [&str; 12] =
    ["abs", "acos", "asin", "cos", "exp", "fix", "fup", "ln", "round", "sin", "sqrt", "tan"];

/// Operators with their precedence; longer names first.
const OPERATORS: [(&str, u8); 15] = [
    ("**", 5),
    ("mod", 4),
    ("and", 1),
    ("xor", 1),
    ("or", 1),
    ("eq", 2),
    ("ne", 2),
    ("gt", 2),
    ("ge", 2),
    ("lt", 2),
    ("le", 2),
    ("*", 4),
    ("/", 4),
    ("+", 3),
    ("-", 3),
];

/// Scanner of a compact line.
pub(super) struct Scanner<'a, V> {
    text: &'a [u8],
    at: usize,
    depth: usize,
    variables: &'a V,
}

impl<'a, V: Variables> Scanner<'a, V> {
    pub(super) fn new(text: &'a [u8], variables: &'a V) -> Self {
        Self { text, at: 0, depth: 0, variables }
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

    /// Skips `word` if the text continues with it.
    pub(super) fn skip(&mut self, word: &str) -> bool {
        let found = self.text.get(self.at..).is_some_and(|rest| rest.starts_with(word.as_bytes()));
        self.at += if found { word.len() } else { 0 };
        found
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
        match value.is_finite() {
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
        while let Some((operator, binding)) = self.operator()
            && binding >= precedence
        {
            self.at += operator.len();
            let right = self.operations(binding + 1)?;
            left = apply(operator, left, right)?;
        }
        Ok(left)
    }

    fn operator(&self) -> Option<(&'static str, u8)> {
        let rest = self.text.get(self.at..)?;
        OPERATORS.into_iter().find(|(name, _)| rest.starts_with(name.as_bytes()))
    }

    /// Reads a parameter `#5`, `#[…]` or `#<name>`.
    fn parameter(&mut self) -> Outcome<f64> {
        match self.target()? {
            Target::Number(number) => self.variables.numbered(number),
            Target::Name(name) => self.variables.named(name),
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
        parameter_number(value).map(Target::Number)
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
            let y = self.bracket()?;
            if !self.skip("/") {
                return Err("ATAN: a second value is required, ATAN[y]/[x]".to_owned());
            }
            return Ok(y.atan2(self.bracket()?).to_degrees());
        }
        let name = FUNCTIONS.into_iter().find(|name| self.skip(name));
        let name = name.ok_or_else(|| {
            let rest = self.rest();
            let argument = rest.trim_start_matches(|letter: char| letter.is_ascii_alphabetic());
            if argument.starts_with('[') {
                let known = FUNCTIONS.map(str::to_uppercase).join(" ");
                return format!("{rest}: not a function; supported: ATAN EXISTS {known}");
            }
            let hint = if rest.starts_with('O') { "; is the letter O meant as zero?" } else { "" };
            format!("{rest}: not a number{hint}")
        })?;
        call(name, self.bracket()?)
    }

    fn exists(&mut self) -> Outcome<f64> {
        let is_valid = self.skip("[") && self.skip("#") && self.peek() == Some(b'<');
        let name = if is_valid { Some(self.name()?) } else { None };
        match name {
            Some(name) if self.skip("]") => Ok(f64::from(self.variables.is_defined(name))),
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

/// Applies an operator.
fn apply(operator: &str, left: f64, right: f64) -> Outcome<f64> {
    let truth = |value: f64| value != 0.0;
    let value = match operator {
        "**" if left < 0.0 && right.fract() != 0.0 => {
            return Err("power of a negative value with a fractional exponent".to_owned());
        }
        "**" => left.powf(right),
        "/" | "mod" if right == 0.0 => return Err("division by zero".to_owned()),
        "*" => left * right,
        "/" => left / right,
        "mod" => left.rem_euclid(right),
        "+" => left + right,
        "-" => left - right,
        "eq" => f64::from((left - right).abs() < EQUAL),
        "ne" => f64::from((left - right).abs() >= EQUAL),
        "gt" => f64::from(left > right),
        "ge" => f64::from(left >= right),
        "lt" => f64::from(left < right),
        "le" => f64::from(left <= right),
        "and" => f64::from(truth(left) && truth(right)),
        "or" => f64::from(truth(left) || truth(right)),
        _ => f64::from(truth(left) != truth(right)),
    };
    match value.is_finite() {
        true => Ok(value),
        false => Err(format!("{}: result is not finite", operator.to_uppercase())),
    }
}

/// Applies a function of one value.
fn call(name: &str, value: f64) -> Outcome<f64> {
    let outside = |range: &str| Err(format!("{}[{value}]: must be {range}", name.to_uppercase()));
    Ok(match name {
        "acos" | "asin" if value.abs() > 1.0 => return outside("between -1 and 1"),
        "ln" if value <= 0.0 => return outside("positive"),
        "sqrt" if value < 0.0 => return outside("0 or positive"),
        "abs" => value.abs(),
        "acos" => value.acos().to_degrees(),
        "asin" => value.asin().to_degrees(),
        "cos" => value.to_radians().cos(),
        "exp" => value.exp(),
        "fix" => value.floor(),
        "fup" => value.ceil(),
        "ln" => value.ln(),
        "round" => value.round(),
        "sin" => value.to_radians().sin(),
        "sqrt" => value.sqrt(),
        _ => value.to_radians().tan(),
    })
}
