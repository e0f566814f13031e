//! Unit in a header: in brackets, or after ` / ` or ` in `.

use super::unit::Unit;
use super::vocabulary::{announces_axis, axis_name, compound, meaning};

/// Maximum number of characters of an unknown unit.
const MAX_UNIT: usize = 8;
/// Sign of a ratio, which is no unit of a channel.
const PERCENT: &str = "%";

/// Unit in a header.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum HeaderUnit {
    Missing,
    Known(Unit),
    /// Text in brackets that is neither a known unit nor made of known words.
    Unknown(String),
}

/// Splits the unit off: text in brackets, or after ` / ` or ` in `. Other text in brackets stays.
pub(super) fn split_brackets(header: &str) -> (String, HeaderUnit) {
    // A comment sign marks the header of some programs: `%time`.
    let mut rest = header.trim().trim_start_matches(['%', '#']).to_owned();
    let mut unit = HeaderUnit::Missing;
    for (open, close) in [('[', ']'), ('(', ')')] {
        let Some((before, inside)) = rest.split_once(open) else { continue };
        let Some((inside, after)) = inside.split_once(close) else { continue };
        if let Some(found) = Unit::from_header(inside) {
            unit = HeaderUnit::Known(found);
        } else if is_unknown_unit(inside) {
            if unit == HeaderUnit::Missing {
                unit = HeaderUnit::Unknown(inside.trim().to_owned());
            }
        } else {
            rest = format!("{before} {inside} {after}");
            continue;
        }
        rest = format!("{before} {after}");
    }
    for separator in [" / ", " in ", "/"] {
        if unit == HeaderUnit::Missing
            && let Some((before, after)) = rest.split_once(separator)
            && let Some(found) = Unit::from_header(after)
        {
            return (before.to_owned(), HeaderUnit::Known(found));
        }
    }
    if unit == HeaderUnit::Missing && rest.contains(PERCENT) {
        return (rest.replace(PERCENT, " "), HeaderUnit::Unknown(PERCENT.to_owned()));
    }
    (rest, unit)
}

/// Returns true for a text in brackets that can only be a unit: one short word or sign that is no axis, number or known
/// word, or a known unit or sign with other words, as in `A rms` and `% of max`.
fn is_unknown_unit(text: &str) -> bool {
    let words: Vec<&str> = text.split_whitespace().collect();
    match words.as_slice() {
        [] => false,
        [word] => is_sign(word) || word.chars().any(char::is_alphabetic) && is_short_unknown(word),
        // "X in mm" ends in a known unit.
        [.., "in", last] if Unit::from_header(last).is_some() => false,
        words => {
            let is_unit = |word: &&str| is_sign(word) || Unit::from_header(word.trim_matches(',')).is_some();
            words.iter().any(is_unit) && !words.iter().all(|word| is_known(&word.to_lowercase()))
        }
    }
}

/// Returns true for a word without letters and digits, such as `%`.
fn is_sign(word: &str) -> bool {
    !word.chars().any(char::is_alphanumeric)
}

fn is_short_unknown(word: &str) -> bool {
    word.chars().count() <= MAX_UNIT && !is_known(&word.to_lowercase())
}

/// Returns true for a known word, or the name or number of an axis.
fn is_known(word: &str) -> bool {
    let is_number = word.bytes().all(|byte| byte.is_ascii_digit());
    is_number
        || meaning(word).is_some()
        || axis_name(word).is_some()
        || announces_axis(word)
        || compound(word).is_some()
}
