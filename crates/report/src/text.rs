//! Text of a page: HTML escaping, and formatting of numbers and lists.

use std::fmt::{self, Display, Write as _};

/// Untrusted text that is escaped for HTML content and quoted attributes when displayed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Text<'a>(pub &'a str);

impl Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                '\n' | '\t' => f.write_char(' ')?,
                // Control characters are not allowed in HTML.
                c if c.is_control() => f.write_char(char::REPLACEMENT_CHARACTER)?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

/// Returns untrusted text as HTML content, with pairs of backticks as code.
pub(super) fn prose(text: &str) -> String {
    let pieces: Vec<&str> = text.split('`').collect();
    let mut out = String::new();
    for (index, piece) in pieces.iter().enumerate() {
        out += match index % 2 {
            1 if index + 1 < pieces.len() => "<code>",
            1 => "`",
            _ if index > 0 => "</code>",
            _ => "",
        };
        out += &with_words(piece);
    }
    out
}

/// Number of characters of an option or a word of G code that no line ends within.
const LONGEST_WORD: usize = 24;

/// Returns untrusted text as HTML content in which no line ends at the minus sign of a number or an option.
fn with_words(text: &str) -> String {
    let word = |word: &str| {
        let is_signed = word.trim_start_matches('(').starts_with('-')
            || word.split('-').skip(1).any(|rest| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.'));
        match is_signed && word.chars().count() <= LONGEST_WORD {
            true => format!("<span class=\"word\">{}</span>", Text(word)),
            false => Text(word).to_string(),
        }
    };
    text.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Separator between groups of three digits.
const THIN_SPACE: char = '\u{202f}';
/// Minus sign (U+2212), as wide as the plus sign.
const MINUS: char = '−';

/// Formats a finite number with a minus sign and thin spaces between groups of three digits.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let plain = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = plain.split_once('.').map_or((plain.as_str(), None), |(w, f)| (w, Some(f)));
    let mut text = String::with_capacity(plain.len() + 4);
    // Zero after rounding has no sign.
    if value < 0.0 && plain.bytes().any(|b| (b'1'..=b'9').contains(&b)) {
        text.push(MINUS);
    }
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push(THIN_SPACE);
        }
        text.push(digit);
    }
    if let Some(fraction) = fraction {
        text.push('.');
        text.push_str(fraction);
    }
    text
}

/// Text of a number that is missing.
pub(super) const NONE: &str = "–";

/// Formats a number with `count` significant digits; a dash if it is not finite.
pub(super) fn digits(value: f64, count: i32) -> String {
    /// Decimal exponents of numbers that are written without an exponent.
    const PLAIN: std::ops::Range<i32> = -5..7;
    if !value.is_finite() {
        return NONE.to_owned();
    }
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    if !PLAIN.contains(&magnitude) {
        return format!("{value:.*e}", usize::try_from(count - 1).unwrap_or(0));
    }
    format!("{value:.*}", usize::try_from(count - 1 - magnitude).unwrap_or(0))
}

/// Formats a number with about three significant digits.
pub(super) fn rounded(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        _ => 2,
    };
    number(value, decimals)
}

/// Returns true if a table cell is a number, which is aligned to the right.
pub(super) fn is_number(cell: &str) -> bool {
    let digits: String = cell.chars().filter(|c| !c.is_whitespace()).collect();
    digits.replacen(MINUS, "-", 1).parse::<f64>().is_ok()
}

/// Formats a table cell, with a minus sign (U+2212) in front of a negative number.
pub(super) fn cell(text: &str) -> String {
    match text.trim().strip_prefix('-') {
        Some(rest) if is_number(rest) => format!("{MINUS}{rest}"),
        _ => text.trim().to_owned(),
    }
}

/// Joins items as "a", "a and b", "a, b and c".
pub(super) fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [before @ .., last] => format!("{} and {last}", before.join(", ")),
    }
}

/// Capitalizes the first letter.
pub(super) fn capital(text: &str) -> String {
    let mut rest = text.chars();
    rest.next().map_or(String::new(), |first| first.to_uppercase().chain(rest).collect())
}

/// Returns a joint name in the notation of machine axes: a single letter becomes a capital.
pub(super) fn axis_name(name: &str) -> String {
    if name.chars().count() == 1 { capital(name) } else { name.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn untrusted_text_is_escaped() {
        let text = Text("</title><script>alert('1')</script> \"&\"\u{0}").to_string();
        assert_eq!(
            text,
            "&lt;/title&gt;&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt; &quot;&amp;&quot;\u{fffd}"
        );
    }

    #[test]
    fn backticks_enclose_code() {
        let text = prose("record (`psec --part <both>`), or 5` long");
        assert_eq!(
            text,
            "record (<code>psec <span class=\"word\">--part</span> &lt;both&gt;</code>), or 5` long"
        );
    }

    #[test]
    fn no_line_ends_at_a_minus_sign() {
        let text = prose("G1 X-.5 Z-2 after-run (-2)");
        assert_eq!(
            text,
            "G1 <span class=\"word\">X-.5</span> <span class=\"word\">Z-2</span> after-run <span class=\"word\">(-2)</span>"
        );
    }

    #[test]
    fn numbers_have_a_minus_sign_and_thin_spaces() {
        assert_eq!(number(-1234567.0, 0), "−1\u{202f}234\u{202f}567");
        assert_eq!(number(-0.25, 2), "−0.25");
        assert_eq!(number(-0.04, 1), "0.0");
        assert_eq!(number(999.0, 0), "999");
        assert_eq!(cell("-12.5"), "−12.5");
        assert_eq!(cell("-Z"), "-Z");
        assert!(is_number("−1\u{202f}000.5") && !is_number("X") && !is_number(""));
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(digits(0.028_04, 4), "0.02804");
        assert_eq!(digits(-95.113, 4), "-95.11");
        assert_eq!(digits(12_345.6, 3), "12346");
        assert_eq!(digits(1.234e-6, 3), "1.23e-6");
        assert_eq!(digits(f64::NAN, 3), NONE);
        assert_eq!(digits(0.0, 3), "0.00");
    }

    #[test]
    fn lists_are_joined_with_commas_and_and() {
        let names = ["Z".to_owned(), "A".to_owned(), "C".to_owned()];
        assert_eq!(listed(&names), "Z, A and C");
        assert_eq!(listed(&names[..1]), "Z");
        assert_eq!(listed(&[]), "");
    }
}
