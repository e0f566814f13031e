//! Writer for machine files.

use std::fmt::Write;

use super::definition::Scope;
use super::parameters::Parameters;
use super::value::Value;
use crate::text::is_control;

/// Indentation level of the first key, below `/**:` and `ros__parameters:`.
const DEPTH: usize = 2;
/// Plain words that YAML 1.1 readers do not read as text.
const NON_TEXT_WORDS: [&str; 11] =
    ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"];

/// Mapping in the order of its keys.
#[derive(Default)]
struct Mapping(Vec<(String, MappingEntry)>);

enum MappingEntry {
    Mapping(Mapping),
    Value { text: String, comment: Option<String> },
}

impl Parameters {
    /// Writes the parameters as a machine file, without those at their defaults. Loading the file yields bit-identical
    /// values.
    ///
    /// `head` becomes a comment at the top of the file, `comment` returns the comment for a full key.
    pub fn to_yaml(&self, head: &str, comment: impl Fn(&str) -> Option<String>) -> String {
        let mut machine = Mapping::default();
        let mut joints = Mapping::default();
        let mut node = Mapping::default();
        for (key, definition) in self.definitions() {
            if self.source(&key).is_none() {
                continue;
            }
            let Some(value) = self.get(&key) else { continue };
            let mapping = match definition.scope {
                Scope::Machine => &mut machine,
                Scope::Axis => &mut joints,
                Scope::Node => &mut node,
            };
            mapping.insert(&key, MappingEntry::Value { text: value_text(&value), comment: comment(&key) });
        }
        let mut out = String::new();
        for line in head.lines() {
            let _ = writeln!(out, "{}", format!("# {}", one_line(line)).trim_end());
        }
        out.push_str("/**:\n  ros__parameters:\n");
        machine.write(&mut out, DEPTH);
        for joint in joints.0 {
            out.push('\n');
            Mapping(vec![joint]).write(&mut out, DEPTH);
        }
        if !node.0.is_empty() {
            out.push('\n');
            node.write(&mut out, DEPTH);
        }
        out
    }
}

impl Mapping {
    fn insert(&mut self, key: &str, node: MappingEntry) {
        let Some((name, rest)) = key.split_once('.') else {
            self.0.push((key.to_owned(), node));
            return;
        };
        let index = self.0.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.0.push((name.to_owned(), MappingEntry::Mapping(Mapping::default())));
            self.0.len() - 1
        });
        // No key of the schema is a prefix of another key.
        if let Some((_, MappingEntry::Mapping(mapping))) = self.0.get_mut(index) {
            mapping.insert(rest, node);
        }
    }

    fn write(&self, out: &mut String, depth: usize) {
        let indent = "  ".repeat(depth);
        for (name, node) in &self.0 {
            let _ = write!(out, "{indent}{}:", text(name));
            match node {
                MappingEntry::Mapping(mapping) => {
                    out.push('\n');
                    mapping.write(out, depth + 1);
                }
                MappingEntry::Value { text, comment } => {
                    let _ = write!(out, " {text}");
                    if let Some(comment) = comment {
                        let _ = write!(out, "  # {}", one_line(comment));
                    }
                    out.push('\n');
                }
            }
        }
    }
}

fn value_text(value: &Value) -> String {
    match value {
        Value::Bool(flag) => flag.to_string(),
        Value::Integer(integer) => integer.to_string(),
        Value::Double(value) => number(*value),
        Value::Text(value) => text(value),
        Value::BoolList(flags) => list(flags.iter().map(bool::to_string)),
        Value::IntegerList(integers) => list(integers.iter().map(i64::to_string)),
        Value::DoubleList(numbers) => list(numbers.iter().map(|value| number(*value))),
        Value::TextList(texts) => list(texts.iter().map(|text| quoted(text))),
    }
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

/// Returns the shortest text that reads back as the same bits, with a decimal point and a signed exponent, since YAML 1.1
/// requires both in numbers.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        None => text,
        Some((mantissa, exponent)) => {
            let point = if mantissa.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with('-') { "" } else { "+" };
            format!("{mantissa}{point}e{sign}{exponent}")
        }
    }
}

/// Returns names unchanged and any other text in quotation marks.
fn text(value: &str) -> String {
    let plain = value.starts_with(|c: char| c.is_ascii_alphabetic())
        && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !NON_TEXT_WORDS.contains(&value.to_ascii_lowercase().as_str());
    if plain { value.to_owned() } else { quoted(value) }
}

fn quoted(value: &str) -> String {
    let mut out = String::from('"');
    for c in value.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            // Line breaks and characters that YAML does not permit.
            c if is_control(c) || is_unprintable(c) => {
                let _ = write!(out, "\\U{:08x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Returns true for characters outside the printable set of YAML.
fn is_unprintable(c: char) -> bool {
    matches!(c, '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

fn one_line(text: &str) -> String {
    text.replace(is_control, " ")
}
