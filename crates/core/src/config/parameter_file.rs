//! ROS 2 parameter files: sections by node name, flattened to dotted keys.

use std::collections::HashMap;

use serde_saphyr::Spanned;

use super::error::{ConfigError, Source, shortened};
use super::value::Value;
use super::yaml::{Node, parse};

/// The key under which a node's parameters stand.
const PARAMETERS_KEY: &str = "ros__parameters";
/// How a parameter file begins, for messages.
const BEGINNING: &str = "a file begins with `/**:`, below it `ros__parameters:`, below that the keys";

/// One parameter to set, and where that was asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Full dotted key.
    pub key: String,
    /// Value, not yet checked.
    pub value: Value,
    /// Where it comes from.
    pub source: Source,
}

/// What a parameter file holds for one node.
pub(super) struct ParameterFile {
    /// In the order of the file; a key can come again from a later section, which wins.
    pub assignments: Vec<Assignment>,
    /// Names of the sections that are for other nodes.
    pub skipped: Vec<String>,
    /// Number of sections that are for this node.
    pub matched: usize,
}

/// Reads the parameters that `text` holds for the node `node` (fully qualified, `/ns/name`).
/// `None` stands for no node in particular: the only section, or those for any node.
pub(super) fn read(text: &str, source: &Source, node: Option<&str>) -> Result<ParameterFile, ConfigError> {
    let root = parse(text, source)?;
    let Node::Map(entries) = root.value else {
        return Err(not_a_parameter_file(
            &source.at_line(root.referenced.line()),
            format!("it holds no mapping; {BEGINNING}"),
        ));
    };
    let mut sections = Vec::new();
    collect_sections(entries, "", source, &mut sections)?;
    if sections.is_empty() {
        return Err(not_a_parameter_file(source, format!("it is empty; {BEGINNING}")));
    }

    let only = sections.len() == 1 && node.is_none();
    let mut file = ParameterFile { assignments: Vec::new(), skipped: Vec::new(), matched: 0 };
    for section in sections {
        if only || matches(&section.path, node.unwrap_or(ANY_NODE)) {
            file.matched += 1;
            section.flatten(source, &mut file.assignments)?;
        } else {
            file.skipped.push(shortened(&section.path));
        }
    }
    Ok(file)
}

/// The name under which a file is read that is for no node in particular.
const ANY_NODE: &str = "/virtual_axes";

/// Reads `KEY=VALUE` (`KEY:=VALUE`), the value by the rules of YAML.
///
/// # Errors
///
/// [`ConfigError::NotAnAssignment`] and [`ConfigError::WrongKind`].
pub fn parse_assignment(text: &str, source: &Source) -> Result<Assignment, ConfigError> {
    let not_an_assignment = || ConfigError::NotAnAssignment { at: source.clone(), text: shortened(text) };
    let (key, value) = text.split_once('=').ok_or_else(not_an_assignment)?;
    let key = key.strip_suffix(':').unwrap_or(key).trim();
    if key.is_empty() {
        return Err(not_an_assignment());
    }
    let value = if value.trim().is_empty() {
        // YAML knows no empty text without quotation marks; on a command line it is plain.
        Value::Text(String::new())
    } else {
        match parse(value, source)?.value {
            Node::Scalar(value) => value,
            other => return Err(no_value(source, key, &other)),
        }
    };
    Ok(Assignment { key: key.to_owned(), value, source: source.clone() })
}

fn not_a_parameter_file(at: &Source, reason: String) -> ConfigError {
    ConfigError::NotAParameterFile { at: at.clone(), reason }
}

fn no_value(at: &Source, key: &str, found: &Node) -> ConfigError {
    ConfigError::WrongKind {
        at: at.clone(),
        key: shortened(key),
        found: found.described().to_owned(),
        wanted: "a value".to_owned(),
    }
}

/// The parameters of one node, or of all whose name matches `path`.
struct Section {
    path: String,
    line: u64,
    parameters: Spanned<Node>,
}

impl Section {
    fn flatten(self, source: &Source, out: &mut Vec<Assignment>) -> Result<(), ConfigError> {
        let mut lines = HashMap::new();
        match self.parameters.value {
            Node::Map(entries) => flatten(entries, "", source, &mut lines, out),
            // A section whose parameters are all commented out.
            Node::Null => Ok(()),
            other => Err(not_a_parameter_file(
                &source.at_line(self.line),
                format!("`{PARAMETERS_KEY}` holds {}, not a mapping", other.described()),
            )),
        }
    }
}

fn flatten(
    entries: Vec<(Spanned<String>, Spanned<Node>)>,
    prefix: &str,
    source: &Source,
    lines: &mut HashMap<String, u64>,
    out: &mut Vec<Assignment>,
) -> Result<(), ConfigError> {
    for (name, node) in entries {
        let line = name.referenced.line();
        let at = source.at_line(line);
        let key = if prefix.is_empty() { name.value } else { format!("{prefix}.{}", name.value) };
        match node.value {
            Node::Map(entries) => flatten(entries, &key, source, lines, out)?,
            Node::Scalar(value) => {
                if let Some(first) = lines.insert(key.clone(), line) {
                    return Err(ConfigError::Duplicate {
                        at,
                        key: shortened(&key),
                        first: source.at_line(first),
                    });
                }
                out.push(Assignment { key, value, source: at });
            }
            other => return Err(no_value(&at, &key, &other)),
        }
    }
    Ok(())
}

fn collect_sections(
    entries: Vec<(Spanned<String>, Spanned<Node>)>,
    namespace: &str,
    source: &Source,
    out: &mut Vec<Section>,
) -> Result<(), ConfigError> {
    for (name, node) in entries {
        let line = name.referenced.line();
        if name.value == PARAMETERS_KEY {
            if namespace.is_empty() {
                return Err(not_a_parameter_file(
                    &source.at_line(line),
                    format!("`{PARAMETERS_KEY}` stands below no node; {BEGINNING}"),
                ));
            }
            out.push(Section { path: namespace.to_owned(), line, parameters: node });
            continue;
        }
        let Node::Map(entries) = node.value else {
            return Err(not_a_parameter_file(
                &source.at_line(line),
                match namespace {
                    "" => format!("no `{PARAMETERS_KEY}` below `{}`; {BEGINNING}", shortened(&name.value)),
                    _ => format!(
                        "`{}` stands below `{}`, not below `{PARAMETERS_KEY}`; {BEGINNING}",
                        shortened(&name.value),
                        shortened(namespace)
                    ),
                },
            ));
        };
        let path = format!("{namespace}/{}", name.value.trim_matches('/'));
        collect_sections(entries, &path, source, out)?;
    }
    Ok(())
}

/// Whether `pattern` names `node` by the rules of ROS 2: `*` is one name, `**` any number of them.
fn matches(pattern: &str, node: &str) -> bool {
    let parts = |text: &'_ str| -> Vec<String> {
        text.split('/').filter(|part| !part.is_empty()).map(str::to_owned).collect()
    };
    let names = parts(node);
    // reached[i]: the pattern so far can have used up the first i names.
    let mut reached = vec![false; names.len() + 1];
    reached[0] = true;
    for part in parts(pattern) {
        let mut next = vec![false; names.len() + 1];
        for used in 0..=names.len() {
            next[used] = match part.as_str() {
                "**" => reached[..=used].contains(&true),
                "*" => used > 0 && reached[used - 1],
                name => used > 0 && reached[used - 1] && names[used - 1] == name,
            };
        }
        reached = next;
    }
    reached[names.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn node_patterns_match_as_in_ros() {
        for (pattern, node, expected) in [
            ("/**", "/virtual_axes", true),
            ("/**", "/cell/mill/virtual_axes", true),
            ("/*", "/virtual_axes", true),
            ("/*", "/cell/virtual_axes", false),
            ("/virtual_axes", "/virtual_axes", true),
            ("/virtual_axes", "/cell/virtual_axes", false),
            ("/cell/virtual_axes", "/cell/virtual_axes", true),
            ("/*/virtual_axes", "/cell/virtual_axes", true),
            ("/**/virtual_axes", "/cell/mill/virtual_axes", true),
            ("/**/virtual_axes", "/virtual_axes", true),
            ("/**/other", "/cell/virtual_axes", false),
        ] {
            assert_eq!(matches(pattern, node), expected, "{pattern} for {node}");
        }
    }
}
