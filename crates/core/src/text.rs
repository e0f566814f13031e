//! Text from files and peers in messages: truncation, control characters and similar names.

use strsim::{damerau_levenshtein, jaro_winkler};

/// Maximum length of quoted text, characters.
const MAX_QUOTED_LENGTH: usize = 120;
/// Minimum Jaro-Winkler similarity of a suggested name.
const MIN_SIMILARITY: f64 = 0.7;

/// Built-in files: name and text.
pub type BuiltinFiles = [(&'static str, &'static str)];

/// Returns the names of built-in files.
pub fn builtin_names(files: &BuiltinFiles) -> impl Iterator<Item = &'static str> {
    files.iter().map(|(name, _)| *name)
}

/// Returns the text of the built-in file `name`.
pub fn builtin_text(files: &BuiltinFiles, name: &str) -> Option<&'static str> {
    files.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Returns `text` on one line, truncated to 120 characters.
pub fn shortened(text: &str) -> String {
    cut(text, MAX_QUOTED_LENGTH).replace(is_control, " ")
}

/// Returns the first `most` characters of `text`, with an ellipsis if it is longer.
pub fn cut(text: &str, most: usize) -> String {
    let mut out: String = text.chars().take(most).collect();
    if out.len() < text.len() {
        out.push('…');
    }
    out
}

/// Returns `text` with escape sequences instead of control characters: `\u{1b}`, `\n`.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match is_control(c) {
            true => out.extend(c.escape_default()),
            false => out.push(c),
        }
    }
    out
}

/// Returns `text` with escape sequences instead of all control characters except line feeds.
pub fn escaped_lines(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// Returns true for characters that change the layout of a line: control characters, line and paragraph separators,
/// and bidirectional formatting characters.
pub fn is_control(c: char) -> bool {
    let marks = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}');
    marks || c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns the name in `known` with the smallest edit distance to `found`, if it is similar enough to suggest.
///
/// Names are shortened before the comparison, which takes time proportional to the product of their lengths.
pub fn nearest_name<T: AsRef<str>>(found: &str, known: impl IntoIterator<Item = T>) -> Option<String> {
    let found = shortened(found);
    let names = known.into_iter().map(|name| shortened(name.as_ref()));
    let similar = names.filter(|name| jaro_winkler(&found, name) >= MIN_SIMILARITY);
    similar.min_by_key(|name| damerau_levenshtein(&found, name))
}

/// Returns true if `found` differs from `name` in at most a third of its characters, or in one.
pub fn is_slip(found: &str, name: &str) -> bool {
    let found = shortened(found);
    damerau_levenshtein(&found, name) <= (found.chars().count() / 3).max(1)
}

/// Returns the end of a message about an unknown name: `; the nearest is NAME`, or an empty text.
pub fn nearest_hint(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |name| format!("; the nearest is {name}"))
}

/// Returns a message about an unknown name: `unknown "NAME"; known are …; the nearest is NAME`.
pub fn unknown_name(found: &str, known: &[&str]) -> String {
    let (name, hint) = (shortened(found), nearest_hint(&nearest_name(found, known)));
    format!("unknown \"{name}\"; known are {}{hint}", known.join(", "))
}

/// Returns the words of `text` in lines of at most `width` characters; a longer word has a line of its own.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped() {
        assert_eq!(escaped("a\u{1b}[31m\n\u{202e}µ\\"), "a\\u{1b}[31m\\n\\u{202e}µ\\");
        assert_eq!(escaped_lines("a\n\u{7f}b\n"), "a\n\\u{7f}b\n");
    }

    #[test]
    fn a_slip_changes_few_characters() {
        for (found, name) in [("jonts", "joints"), ("tiem", "time"), ("publsh_rat", "publish_rate")] {
            assert!(is_slip(found, name), "{found}");
        }
        for (found, name) in [("cell", "c.delays.alpha_ms"), ("true", "time"), ("arr", "part_program.tools")]
        {
            assert!(!is_slip(found, name), "{found}");
        }
    }

    #[test]
    fn suggests_a_misspelt_name_and_no_unrelated_one() {
        let known = ["x.motor.inertia_kg_m2", "x.motor.mass_kg", "y.motor.inertia_kg_m2"];
        let nearest = nearest_name("x.motor.inertia_kgm2", known);
        assert_eq!(nearest_hint(&nearest), "; the nearest is x.motor.inertia_kg_m2");
        assert_eq!(nearest_hint(&nearest_name("color", known)), "");
    }
}
