//! ROS names: which are valid, and what a name written in a program stands for in the graph.

use std::fmt;

/// Longest fully qualified name that the middlewares take (255 less the prefixes that they add).
const MAX_NAME_LENGTH: usize = 247;
/// Longest node name.
const MAX_NODE_NAME_LENGTH: usize = 255;

/// A name that ROS does not allow.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{name}' is not a valid {kind}: {reason}")]
pub struct NameError {
    /// The name as it was given.
    pub name: String,
    /// What it was meant to be.
    pub kind: &'static str,
    /// Which rule it breaks.
    pub reason: &'static str,
}

impl NameError {
    fn new(name: &str, kind: &'static str, reason: &'static str) -> Self {
        Self { name: name.to_owned(), kind, reason }
    }
}

/// A node's name in the graph: namespace and base name, both valid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeFqn {
    namespace: String,
    name: String,
}

impl NodeFqn {
    /// `namespace` is absolute (`/` or `/cell/mill`), `name` a single token.
    ///
    /// # Errors
    /// Either of them breaks a rule.
    pub fn new(namespace: &str, name: &str) -> Result<Self, NameError> {
        check_namespace(namespace)?;
        check_node_name(name)?;
        Ok(Self { namespace: namespace.to_owned(), name: name.to_owned() })
    }

    /// The namespace, beginning with a slash.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// The base name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The absolute name that a topic or service name in this node stands for: `/x` is itself,
    /// `x` is in the node's namespace, `~/x` (and `~`) under the node's own name; `{node}`, `{ns}`
    /// and `{namespace}` are replaced.
    ///
    /// # Errors
    /// The name breaks a rule of ROS names.
    ///
    /// ```
    /// use virtual_axes::ingress::names::NodeFqn;
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

    /// Whether `pattern` before a parameter or a remapping rule means this node: its base name, or
    /// its full name.
    #[must_use]
    pub fn is_meant_by(&self, pattern: &str) -> bool {
        pattern == self.name || pattern == self.to_string()
    }
}

impl fmt::Display for NodeFqn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let namespace = self.namespace.trim_end_matches('/');
        write!(f, "{namespace}/{}", self.name)
    }
}

/// Checks a node's base name: letters, digits and underscores, not beginning with a digit.
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

/// Checks a namespace: absolute, and without a slash at its end unless it is the root.
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

/// Tokens between slashes, without the leading one. On failure, the rule that is broken.
fn check_tokens(tokens: &str) -> Result<(), &'static str> {
    if tokens.is_empty() {
        return Err("it is empty");
    }
    for token in tokens.split('/') {
        if token.is_empty() {
            return Err("a slash stands at its end or beside another slash");
        }
        if token.starts_with(|c: char| c.is_ascii_digit()) {
            return Err("a part of it begins with a digit");
        }
        if !token.chars().all(is_token_character) {
            return Err("allowed are letters, digits, underscores and slashes, and ~/ at its beginning");
        }
        if token.contains("__") {
            return Err("two underscores stand side by side");
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
    fn names_that_would_break_the_middleware_are_refused() {
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
