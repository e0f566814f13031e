//! ROS names: validation, and expansion of relative and private names (`~/x`) to fully qualified names.

use std::fmt;

/// Largest length of a fully qualified name (255 minus the prefixes added by the middleware).
const MAX_NAME_LENGTH: usize = 247;
/// Largest length of a node name.
const MAX_NODE_NAME_LENGTH: usize = 255;

/// Invalid ROS name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{name}' is not a valid {kind}: {reason}")]
pub struct NameError {
    /// Name as given.
    pub name: String,
    /// Kind of name.
    pub kind: &'static str,
    /// Violated rule.
    pub reason: &'static str,
}

impl NameError {
    fn new(name: &str, kind: &'static str, reason: &'static str) -> Self {
        Self { name: name.to_owned(), kind, reason }
    }
}

/// Fully qualified node name: namespace and base name, both valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeFqn {
    namespace: String,
    name: String,
}

impl NodeFqn {
    /// Creates the name from an absolute `namespace` (`/` or `/cell/mill`) and `name`, a single token.
    ///
    /// # Errors
    /// [`NameError`] if either of them is invalid.
    pub fn new(namespace: &str, name: &str) -> Result<Self, NameError> {
        check_namespace(namespace)?;
        check_node_name(name)?;
        Ok(Self { namespace: namespace.to_owned(), name: name.to_owned() })
    }

    /// Returns the namespace, with a leading slash.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// Returns the base name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Expands a topic or service name of this node to its fully qualified name.
    ///
    /// `/x` is absolute, `x` is relative to the namespace of the node, `~/x` and `~` are private to the node;
    /// `{node}`, `{ns}` and `{namespace}` are substituted.
    ///
    /// # Errors
    /// [`NameError`] if the name is invalid.
    ///
    /// ```
    /// use virtual_axes::validation::names::NodeFqn;
    ///
    /// let node = NodeFqn::new("/cell", "mill").unwrap();
    /// assert_eq!(node.expand("psec").unwrap(), "/cell/psec");
    /// assert_eq!(node.expand("~/reset").unwrap(), "/cell/mill/reset");
    /// assert_eq!(node.expand("/clock").unwrap(), "/clock");
    /// ```
    pub fn expand(&self, name: &str) -> Result<String, NameError> {
        let bad = |reason| Err(NameError::new(name, "topic or service name", reason));
        let namespace = self.namespace.trim_end_matches('/');
        let replaced =
            name.replace("{node}", &self.name).replace("{ns}", namespace).replace("{namespace}", namespace);
        let absolute = if replaced == "~" {
            self.to_string()
        } else if let Some(rest) = replaced.strip_prefix("~/") {
            format!("{self}/{rest}")
        } else if replaced.starts_with('/') {
            replaced
        } else {
            format!("{namespace}/{replaced}")
        };
        if name.is_empty() {
            return bad("it is empty");
        }
        if absolute.len() > MAX_NAME_LENGTH {
            return bad("it is longer than 247 characters");
        }
        match check_tokens(&absolute[1..]) {
            Ok(()) => Ok(absolute),
            Err(reason) => bad(reason),
        }
    }

    /// Returns true if `pattern`, the prefix of a parameter or remapping rule, matches this node by its base
    /// name or its fully qualified name.
    #[must_use]
    pub fn matches(&self, pattern: &str) -> bool {
        pattern == self.name || pattern == self.to_string()
    }
}

impl fmt::Display for NodeFqn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let namespace = self.namespace.trim_end_matches('/');
        write!(f, "{namespace}/{}", self.name)
    }
}

/// Checks the base name of a node: letters, digits and underscores, no leading digit.
pub(super) fn check_node_name(name: &str) -> Result<(), NameError> {
    let bad = |reason| Err(NameError::new(name, "node name", reason));
    if name.is_empty() {
        bad("it is empty")
    } else if name.len() > MAX_NODE_NAME_LENGTH {
        bad("it is longer than 255 characters")
    } else if name.starts_with(|c: char| c.is_ascii_digit()) {
        bad("it begins with a digit")
    } else if !name.chars().all(is_token_character) {
        bad("allowed are letters, digits and underscores")
    } else {
        Ok(())
    }
}

/// Checks a namespace: absolute, and without a trailing slash unless it is the root.
pub(crate) fn check_namespace(namespace: &str) -> Result<(), NameError> {
    let bad = |reason| Err(NameError::new(namespace, "namespace", reason));
    match namespace.strip_prefix('/') {
        None => bad("it does not begin with a slash"),
        Some("") => Ok(()),
        Some(_) if namespace.len() > MAX_NAME_LENGTH => bad("it is longer than 247 characters"),
        Some(rest) => check_tokens(rest).or_else(bad),
    }
}

/// Checks one side of a remapping rule: absolute, relative, or private (`~/x`).
pub(super) fn check_rule_side(name: &str) -> Result<(), NameError> {
    let tokens = name.strip_prefix("~/").or_else(|| name.strip_prefix('/')).unwrap_or(name);
    check_tokens(tokens).map_err(|reason| NameError::new(name, "topic or service name", reason))
}

fn is_token_character(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Checks the tokens between slashes, without the leading slash; returns the violated rule.
fn check_tokens(tokens: &str) -> Result<(), &'static str> {
    if tokens.is_empty() {
        return Err("it is empty");
    }
    for token in tokens.split('/') {
        if token.is_empty() {
            return Err("it has a trailing slash or two adjacent slashes");
        }
        if token.starts_with(|c: char| c.is_ascii_digit()) {
            return Err("a part of it begins with a digit");
        }
        if !token.chars().all(is_token_character) {
            return Err("allowed are letters, digits, underscores, slashes, and a leading ~/");
        }
        if token.contains("__") {
            return Err("it has two adjacent underscores");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_expand_as_in_rcl() {
        for (namespace, written, absolute) in [
            ("/", "psec", "/psec"),
            ("/", "/psec", "/psec"),
            ("/", "~/psec", "/mill/psec"),
            ("/", "~", "/mill"),
            ("/", "{node}/u", "/mill/u"),
            ("/", "{ns}/u", "/u"),
            ("/cell/a", "psec", "/cell/a/psec"),
            ("/cell/a", "/psec", "/psec"),
            ("/cell/a", "~/psec", "/cell/a/mill/psec"),
            ("/cell/a", "{namespace}/u", "/cell/a/u"),
            ("/cell/a", "b/c", "/cell/a/b/c"),
        ] {
            let node = NodeFqn::new(namespace, "mill").unwrap();
            assert_eq!(node.expand(written).as_deref(), Ok(absolute), "{written} in {namespace}");
        }
    }

    #[test]
    fn invalid_names_are_rejected() {
        let node = NodeFqn::new("/", "mill").unwrap();
        for name in [
            "",
            "/",
            "a/",
            "a//b",
            "//a",
            "1a",
            "a/1",
            "a__b",
            "a b",
            "a-b",
            "~a",
            "a~",
            "a/~/b",
            "ä",
            "{other}/a",
            "{",
            "{node",
            "{ns}{ns}",
        ] {
            assert!(node.expand(name).is_err(), "{name}");
        }
        assert!(node.expand(&"a".repeat(246)).is_ok());
        assert!(node.expand(&"a".repeat(247)).is_err());
    }

    #[test]
    fn node_names_and_namespaces_are_checked() {
        for name in ["", "1a", "a/b", "a-b", "a.b", "ä"] {
            assert!(NodeFqn::new("/", name).is_err(), "{name}");
        }
        for namespace in ["", "a", "/a/", "//", "/1", "/a b", "~/a"] {
            assert!(NodeFqn::new(namespace, "a").is_err(), "{namespace}");
        }
        assert_eq!(NodeFqn::new("/", "_a").unwrap().to_string(), "/_a");
        assert_eq!(NodeFqn::new("/a/b", "c").unwrap().to_string(), "/a/b/c");
    }
}
