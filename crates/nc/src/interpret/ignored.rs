//! Codes that a program may contain without effect: single codes, ranges and patterns.

use std::str::FromStr;

use super::codes::{g_name, m_name};

/// Codes that are accepted without effect.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct IgnoredCodes {
    patterns: Vec<CodePattern>,
}

impl IgnoredCodes {
    /// Creates the list of patterns.
    pub fn new(patterns: Vec<CodePattern>) -> Self {
        Self { patterns }
    }

    /// Returns true for a G code in tenths.
    pub(super) fn has_g(&self, code: u16) -> bool {
        self.patterns.iter().any(|pattern| pattern.matches('G', u32::from(code), &g_name(code)))
    }

    /// Returns true for the name of a subprogram of Sinumerik.
    pub(super) fn has_name(&self, name: &str) -> bool {
        self.patterns
            .iter()
            .any(|pattern| matches!(pattern, CodePattern::Name(_)) && pattern.matches(' ', 0, name))
    }

    /// Returns true for an M code.
    pub(super) fn has_m(&self, code: u32) -> bool {
        let name = || u16::try_from(code).map_or_else(|_| format!("M{code}"), m_name);
        let tenths = code.saturating_mul(10);
        !self.patterns.is_empty() && self.patterns.iter().any(|pattern| pattern.matches('M', tenths, &name()))
    }
}

/// Code, range or pattern of `--ignore`: `M100`, `G187`, `M100-M199`, `M1xx`, `G5*`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CodePattern {
    /// Codes between two numbers, in tenths, both included.
    Range {
        /// G or M.
        letter: char,
        /// First number, in tenths.
        first: u32,
        /// Last number, in tenths.
        last: u32,
    },
    /// Name in which `x` stands for a digit and `*` for any end.
    Name(String),
}

impl CodePattern {
    fn matches(&self, letter: char, tenths: u32, name: &str) -> bool {
        match self {
            Self::Range { letter: known, first, last } => {
                *known == letter && (*first..=*last).contains(&tenths)
            }
            Self::Name(pattern) => {
                let (start, is_open) = match pattern.split_once('*') {
                    Some((start, _)) => (start, true),
                    None => (pattern.as_str(), false),
                };
                let is_like = |(pattern, found): (u8, u8)| {
                    pattern == found || (pattern == b'X' && found.is_ascii_digit())
                };
                (name.len() == start.len() || (is_open && name.len() > start.len()))
                    && start.bytes().zip(name.bytes()).all(is_like)
            }
        }
    }
}

impl FromStr for CodePattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let invalid = || {
            format!("{text}: must be a G or M code, a range or a pattern: M100, G187, M100-M199, M1xx, G5*")
        };
        let upper = text.trim().to_ascii_uppercase();
        // A number alone is an M code.
        let name =
            if upper.starts_with(|first: char| first.is_ascii_digit()) { format!("M{upper}") } else { upper };
        // Subprograms of Sinumerik: L9010, TOOLCHECK.
        let mut letters = name.bytes();
        let is_subprogram = match (letters.next(), letters.next()) {
            (Some(b'L'), Some(b'0'..=b'9')) => true,
            (Some(first @ b'A'..=b'Z'), Some(b'A'..=b'Z' | b'_')) => !matches!(first, b'G' | b'M'),
            _ => false,
        };
        if is_subprogram && letters.all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'*')) {
            return Ok(Self::Name(name));
        }
        let letter = name.chars().next().filter(|letter| matches!(letter, 'G' | 'M')).ok_or_else(invalid)?;
        if name.contains(['X', '*']) {
            let is_valid =
                name[1..].bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'X' | b'*' | b'.'));
            return if is_valid { Ok(Self::Name(name)) } else { Err(invalid()) };
        }
        let number = |text: &str| {
            let value = text.trim_start_matches(letter).parse::<f64>().ok()?;
            let tenths = (value * 10.0).round();
            ((0.0..1e6).contains(&value) && (tenths - value * 10.0).abs() < 1e-6).then_some(tenths as u32)
        };
        let (first, last) = name.split_once('-').unwrap_or((&name, &name));
        let (first, last) = number(first).zip(number(last)).ok_or_else(invalid)?;
        if first > last { Err(invalid()) } else { Ok(Self::Range { letter, first, last }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_ranges_and_patterns_match_their_codes() {
        let ignored =
            |text: &str| IgnoredCodes::new(text.split(',').map(|pattern| pattern.parse().unwrap()).collect());
        let codes = ignored("7,M110,g187,M200-M299,G5*,M3xx");
        for (code, is_ignored) in
            [(7, true), (8, false), (110, true), (200, true), (299, true), (300, true), (31, false)]
        {
            assert_eq!(codes.has_m(code), is_ignored, "M{code}");
        }
        for (code, is_ignored) in
            [(1870, true), (1871, false), (50, true), (51, true), (540, true), (40, false)]
        {
            assert_eq!(codes.has_g(code), is_ignored, "G{code}/10");
        }
        for text in ["", "X5", "M", "M5-", "M9-M1", "G1e9", "M-5", "Gyx"] {
            assert!(text.parse::<CodePattern>().is_err(), "{text}");
        }
    }
}
