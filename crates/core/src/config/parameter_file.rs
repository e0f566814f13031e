//! Parser of ROS 2 parameter files: sections by node name, flattened to dotted keys.

use std::collections::{HashMap, HashSet};

use serde_saphyr::Spanned;

use super::error::{ConfigError, ValueSource};
use super::value::Value;
use super::yaml_tree::{YamlNode, parse, parse_documents};
use crate::text::shortened;

/// Key above the parameters of a node.
const PARAMETERS_KEY: &str = "ros__parameters";
/// Expected structure of a parameter file, for messages.
const EXPECTED: &str = "expected `/**:`, nested in it `ros__parameters:`, nested in that the parameters";

/// Parameter to set, with the origin of its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Assignment {
    /// Full dotted key.
    pub key: String,
    /// Unchecked value.
    pub value: Value,
    /// Origin of the value.
    pub source: ValueSource,
}

/// Parameters of a file for one node.
#[derive(Default)]
pub(super) struct ParameterFile {
    /// Parameters in the order of the file. A later section can set a key again and takes precedence.
    pub assignments: Vec<Assignment>,
    /// Names of the sections for other nodes.
    pub skipped: Vec<String>,
    /// Number of sections for this node.
    pub matched: usize,
    /// Keys that only sections for several nodes set.
    pub shared: HashSet<String>,
    /// Error about the first key without value (`null`, as `ros2 param dump` writes a parameter that is not set).
    pub unset: Option<ConfigError>,
    /// Keys set twice in one section, of which the last value applies, and the errors about them.
    pub repeated: Vec<(String, ConfigError)>,
    /// Keys with values of no ROS parameter type, and the errors about them.
    pub unusable: Vec<(String, ConfigError)>,
}

/// Reads the parameters of `text` for the node `node` (fully qualified, `/ns/name`). With `None`, reads the only section, or
/// the sections that match a node `/virtual_axes`.
pub(super) fn read(
    text: &str,
    source: &ValueSource,
    node: Option<&str>,
) -> Result<ParameterFile, ConfigError> {
    // As rcl reads them; a machine file is one document.
    let documents = match node {
        Some(_) => parse_documents(text, source)?,
        None => vec![parse(text, source)?],
    };
    let is_empty = |document: &Spanned<YamlNode>| match &document.value {
        YamlNode::Null => true,
        YamlNode::Map(entries) => entries.is_empty(),
        _ => false,
    };
    // All sections are commented out.
    if node.is_some() && documents.iter().all(is_empty) {
        return Ok(ParameterFile::default());
    }
    let mut sections = Vec::new();
    for document in documents {
        let YamlNode::Map(entries) = document.value else {
            return Err(not_a_parameter_file(
                &source.at_line(document.referenced.line()),
                format!("not a mapping; {EXPECTED}"),
            ));
        };
        collect_sections(entries, "", source, &mut sections)?;
    }
    if sections.is_empty() {
        return Err(not_a_parameter_file(source, format!("empty mapping; {EXPECTED}")));
    }

    let only = sections.len() == 1 && node.is_none();
    let mut file = ParameterFile::default();
    let mut own = HashSet::new();
    for section in sections {
        if only || matches(&section.path, node.unwrap_or(ANY_NODE)) {
            file.matched += 1;
            let is_shared = section.path.contains('*');
            let (first, first_unusable) = (file.assignments.len(), file.unusable.len());
            section.flatten(source, &mut file)?;
            let unusable = file.unusable[first_unusable..].iter().map(|(key, _)| key);
            let found = file.assignments[first..].iter().map(|one| &one.key).chain(unusable).cloned();
            if is_shared { file.shared.extend(found) } else { own.extend(found) }
        } else {
            file.skipped.push(shortened(&section.path));
        }
    }
    file.shared.retain(|key| !own.contains(key));
    Ok(file)
}

/// Node name for reading a file without a given node.
const ANY_NODE: &str = "/virtual_axes";

/// Parses `KEY=VALUE` or `KEY:=VALUE`, with the value in YAML.
///
/// # Errors
///
/// [`ConfigError`] without key or `=`, for invalid YAML, and for a value that is not of a ROS parameter type.
pub fn parse_assignment(text: &str, source: &ValueSource) -> Result<Assignment, ConfigError> {
    let not_an_assignment = || ConfigError::not_an_assignment(source, text);
    let (key, value) = text.split_once('=').ok_or_else(not_an_assignment)?;
    let key = key.strip_suffix(':').unwrap_or(key).trim();
    if key.is_empty() {
        return Err(not_an_assignment());
    }
    let value = if value.trim().is_empty() {
        // An empty text needs quotation marks in YAML, but not on a command line.
        Value::Text(String::new())
    } else {
        match parse(value, source)?.value {
            YamlNode::Scalar(value) => value,
            other => return Err(no_value(source, key, &other)),
        }
    };
    Ok(Assignment { key: key.to_owned(), value, source: source.clone() })
}

fn not_a_parameter_file(at: &ValueSource, reason: String) -> ConfigError {
    ConfigError::at(at, format_args!("not a ROS 2 parameter file: {reason}"))
}

fn no_value(at: &ValueSource, key: &str, found: &YamlNode) -> ConfigError {
    ConfigError::wrong_type(at, key, found.described(), "a value")
}

/// Parameters of the nodes whose names match `path`.
struct Section {
    path: String,
    line: u64,
    parameters: Spanned<YamlNode>,
}

impl Section {
    fn flatten(self, source: &ValueSource, file: &mut ParameterFile) -> Result<(), ConfigError> {
        match self.parameters.value {
            YamlNode::Map(entries) => {
                flatten(entries, "", source, &mut HashMap::new(), file);
                Ok(())
            }
            // All parameters of the section are commented out.
            YamlNode::Null => Ok(()),
            other => Err(not_a_parameter_file(
                &source.at_line(self.line),
                format!("`{PARAMETERS_KEY}` contains {}, not a mapping", other.described()),
            )),
        }
    }
}

fn flatten(
    entries: Vec<(Spanned<String>, Spanned<YamlNode>)>,
    prefix: &str,
    source: &ValueSource,
    lines: &mut HashMap<String, u64>,
    file: &mut ParameterFile,
) {
    for (name, node) in entries {
        let line = name.referenced.line();
        let at = source.at_line(line);
        let key = if prefix.is_empty() { name.value } else { format!("{prefix}.{}", name.value) };
        match node.value {
            YamlNode::Map(entries) => flatten(entries, &key, source, lines, file),
            YamlNode::Scalar(value) => {
                if let Some(first) = lines.insert(key.clone(), line) {
                    let (name, first) = (shortened(&key), source.at_line(first));
                    let reason = format_args!("duplicate parameter {name}, first set at {first}");
                    file.repeated.push((key.clone(), ConfigError::at(&at, reason)));
                }
                file.assignments.push(Assignment { key, value, source: at });
            }
            YamlNode::Null => {
                file.unset.get_or_insert(no_value(&at, &key, &YamlNode::Null));
            }
            other => {
                let error = no_value(&at, &key, &other);
                file.unusable.push((key, error));
            }
        }
    }
}

fn collect_sections(
    entries: Vec<(Spanned<String>, Spanned<YamlNode>)>,
    namespace: &str,
    source: &ValueSource,
    out: &mut Vec<Section>,
) -> Result<(), ConfigError> {
    for (name, node) in entries {
        let line = name.referenced.line();
        if name.value == PARAMETERS_KEY {
            if namespace.is_empty() {
                return Err(not_a_parameter_file(
                    &source.at_line(line),
                    format!("no node name above `{PARAMETERS_KEY}`; {EXPECTED}"),
                ));
            }
            out.push(Section { path: namespace.to_owned(), line, parameters: node });
            continue;
        }
        let YamlNode::Map(entries) = node.value else {
            return Err(not_a_parameter_file(
                &source.at_line(line),
                match namespace {
                    "" => format!("no `{PARAMETERS_KEY}` in `{}`; {EXPECTED}", shortened(&name.value)),
                    _ => format!(
                        "`{}` is in `{}`, not in `{PARAMETERS_KEY}`; {EXPECTED}",
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

/// Returns true if `pattern` matches `node` by the rules of ROS 2: `*` matches one name, `**` any number of names.
fn matches(pattern: &str, node: &str) -> bool {
    let parts = |text: &'_ str| -> Vec<String> {
        text.split('/').filter(|part| !part.is_empty()).map(str::to_owned).collect()
    };
    let names = parts(node);
    // reached[i]: the parts of the pattern so far can match the first i names.
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
    fn node_patterns_match_by_the_rules_of_ros() {
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
