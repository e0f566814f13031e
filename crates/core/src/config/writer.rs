//! Parameters as a machine file.

use std::fmt::Write;

use super::definition::Scope;
use super::error::breaks_line;
use super::parameters::Parameters;
use super::value::Value;

/// Indentation of the first key, below `/**:` and `ros__parameters:`.
const DEPTH: usize = 2;
/// Plain words that some reader of YAML takes for something else than a text.
const WORDS: [&str; 11] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"];

/// A mapping in the order of its keys.
#[derive(Default)]
struct Section(Vec<(String, Node)>);

enum Node {
    Section(Section),
    Value { text: String, comment: Option<String> },
}

impl Parameters {
    /// The parameters that are set, as a machine file: what has only its default is left out, and
    /// loading the file gives the same values, bit for bit.
    ///
    /// `head` stands as a comment above the file, `comment` gives the one behind a full key.
    pub fn to_yaml(&self, head: &str, comment: impl Fn(&str) -> Option<String>) -> String {
        let mut machine = Section::default();
        let mut joints = Section::default();
        let mut node = Section::default();
        for (key, definition) in self.definitions() {
            if self.source(&key).is_none() {
                continue;
            }
            let Some(value) = self.get(&key) else { continue };
            let section = match definition.scope {
                Scope::Machine => &mut machine,
                Scope::Axis => &mut joints,
                Scope::Node => &mut node,
            };
            section.insert(&key, Node::Value { text: value_text(&value), comment: comment(&key) });
        }
        let mut out = String::new();
        for line in head.lines() {
            let _ = writeln!(out, "{}", format!("# {}", one_line(line)).trim_end());
        }
        out.push_str("/**:\n  ros__parameters:\n");
        machine.write(&mut out, DEPTH);
        for joint in joints.0 {
            out.push('\n');
            Section(vec![joint]).write(&mut out, DEPTH);
        }
        if !node.0.is_empty() {
            out.push('\n');
            node.write(&mut out, DEPTH);
        }
        out
    }
}

impl Section {
    fn insert(&mut self, key: &str, node: Node) {
        let Some((name, rest)) = key.split_once('.') else {
            self.0.push((key.to_owned(), node));
            return;
        };
        let place = self.0.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.0.push((name.to_owned(), Node::Section(Section::default())));
            self.0.len() - 1
        });
        // No key of the schema is another one's section.
        if let Some((_, Node::Section(section))) = self.0.get_mut(place) {
            section.insert(rest, node);
        }
    }

    fn write(&self, out: &mut String, depth: usize) {
        let indent = "  ".repeat(depth);
        for (name, node) in &self.0 {
            let _ = write!(out, "{indent}{}:", text(name));
            match node {
                Node::Section(section) => {
                    out.push('\n');
                    section.write(out, depth + 1);
                }
                Node::Value { text, comment } => {
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

/// The shortest text that reads as the same bits; with a point and a signed exponent, without which
/// YAML 1.1 takes it for a text.
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

/// A name as it is, anything else in quotation marks.
fn text(value: &str) -> String {
    let plain = value.starts_with(|c: char| c.is_ascii_alphabetic())
        && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !WORDS.contains(&value.to_ascii_lowercase().as_str());
    if plain { value.to_owned() } else { quoted(value) }
}

fn quoted(value: &str) -> String {
    let mut out = String::from('"');
    for c in value.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            // What YAML takes for the end of a line, or does not let stand as it is.
            c if breaks_line(c) || is_unprintable(c) => {
                let _ = write!(out, "\\U{:08x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// Characters outside the printable set of YAML.
fn is_unprintable(c: char) -> bool {
    matches!(c, '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

fn one_line(text: &str) -> String {
    text.replace(breaks_line, " ")
}
