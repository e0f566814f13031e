//! DDS Security settings from the environment, by the rules of rcl: `ROS_SECURITY_ENABLE`,
//! `ROS_SECURITY_STRATEGY`, `ROS_SECURITY_KEYSTORE`, `ROS_SECURITY_ENCLAVE_OVERRIDE` and `--enclave`.
//!
//! A node does not start if security is to be enforced and is not available.

use std::path::{Path, PathBuf};

/// Files of an enclave, named as in SROS2 (`get_security_files` of rmw_dds_common).
const ENCLAVE_FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];

/// True if this build has DDS Security.
const AVAILABLE: bool = cfg!(feature = "security");

/// Reason why DDS Security is not available.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SecurityError {
    /// The program is built without DDS Security.
    #[error(
        "ROS_SECURITY_ENABLE is true, but this program is built without DDS Security; build it with \
         `--features security`, or set ROS_SECURITY_ENABLE to false"
    )]
    NotBuilt,
    /// `ROS_SECURITY_KEYSTORE` is not set.
    #[error(
        "ROS_SECURITY_ENABLE is true, but ROS_SECURITY_KEYSTORE is not set; set it to the folder of the keystore"
    )]
    NoKeystore,
    /// The name of the enclave is invalid.
    #[error("'{found}' is not a valid enclave name: {reason}")]
    Name {
        /// Given name.
        found: String,
        /// Violated rule.
        reason: &'static str,
    },
    /// A file of the enclave is missing.
    #[error("enclave {enclave}: file {path} not found; an enclave consists of {files}", files = ENCLAVE_FILES.join(", "))]
    Missing {
        /// Name of the enclave.
        enclave: String,
        /// Path of the missing file.
        path: String,
    },
}

/// Security mode of the participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Security {
    /// Security is not enabled.
    Off,
    /// Security is enabled but not available, and need not be enforced: communication is not protected.
    Unprotected(SecurityError),
    /// Security is enabled, with the folder of the enclave.
    Enclave(PathBuf),
}

impl Security {
    /// Determines the mode from the variables, read through `lookup`; `argument` is the value of `--enclave`.
    ///
    /// # Errors
    /// [`SecurityError`] if `ROS_SECURITY_STRATEGY` is `Enforce` and security is not available.
    pub fn from_lookup(
        lookup: impl Fn(&str) -> Option<String>,
        argument: Option<&str>,
    ) -> Result<Self, SecurityError> {
        let get = |name| lookup(name).filter(|value| !value.is_empty());
        if get("ROS_SECURITY_ENABLE").as_deref() != Some("true") {
            return Ok(Security::Off);
        }
        let name = get("ROS_SECURITY_ENCLAVE_OVERRIDE");
        let name = name.as_deref().or(argument).unwrap_or("/");
        match enclave(get("ROS_SECURITY_KEYSTORE"), name) {
            Ok(folder) => Ok(Security::Enclave(folder)),
            Err(error) if get("ROS_SECURITY_STRATEGY").as_deref() == Some("Enforce") => Err(error),
            Err(error) => Ok(Security::Unprotected(error)),
        }
    }
}

/// Checks the name of an enclave, a fully qualified name; returns the violated rule.
fn check_name(name: &str) -> Result<(), &'static str> {
    let tokens = name.strip_prefix('/').ok_or("it does not begin with a slash")?;
    let is_valid = |token: &str| {
        let is_allowed = |c: char| c.is_ascii_alphanumeric() || c == '_';
        token.starts_with(|c: char| !c.is_ascii_digit()) && token.chars().all(is_allowed)
    };
    match tokens.is_empty() || tokens.split('/').all(is_valid) {
        true => Ok(()),
        false => Err("allowed are letters, digits and underscores between slashes, without a leading digit"),
    }
}

/// Returns the folder of an enclave after a check of its files.
fn enclave(keystore: Option<String>, name: &str) -> Result<PathBuf, SecurityError> {
    if !AVAILABLE {
        return Err(SecurityError::NotBuilt);
    }
    let keystore = keystore.ok_or(SecurityError::NoKeystore)?;
    check_name(name).map_err(|reason| SecurityError::Name { found: name.to_owned(), reason })?;
    let folder = Path::new(&keystore).join("enclaves").join(name.trim_start_matches('/'));
    match ENCLAVE_FILES.map(|file| folder.join(file)).into_iter().find(|path| !path.is_file()) {
        None => Ok(folder),
        Some(path) => {
            Err(SecurityError::Missing { enclave: name.to_owned(), path: path.display().to_string() })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)], argument: Option<&str>) -> Result<Security, SecurityError> {
        let lookup =
            |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        Security::from_lookup(lookup, argument)
    }

    const ON: (&str, &str) = ("ROS_SECURITY_ENABLE", "true");
    const ENFORCE: (&str, &str) = ("ROS_SECURITY_STRATEGY", "Enforce");

    #[test]
    fn only_the_value_true_enables_security() {
        for value in ["false", "True", "1", "on", ""] {
            let variables = [("ROS_SECURITY_ENABLE", value), ENFORCE];
            assert_eq!(read(&variables, None), Ok(Security::Off), "{value}");
        }
        assert_eq!(read(&[ENFORCE], None), Ok(Security::Off));
    }

    #[test]
    fn enforced_security_that_is_not_available_is_an_error() {
        let nowhere = ("ROS_SECURITY_KEYSTORE", "/nowhere");
        let error = read(&[ON, ENFORCE, nowhere], Some("/mill")).expect_err("must fail");
        let open = read(&[ON, ("ROS_SECURITY_STRATEGY", "enforce"), nowhere], Some("/mill"));
        assert_eq!(open, Ok(Security::Unprotected(error.clone())));
        if AVAILABLE {
            let text = error.to_string();
            assert!(text.contains("/nowhere/enclaves/mill/identity_ca.cert.pem"), "{text}");
            assert_eq!(read(&[ON, ENFORCE], None), Err(SecurityError::NoKeystore));
            let named = read(&[ON, ENFORCE, nowhere], Some("/../mill"));
            assert!(matches!(named, Err(SecurityError::Name { .. })), "{named:?}");
        } else {
            assert_eq!(error, SecurityError::NotBuilt);
        }
    }

    #[cfg(feature = "security")]
    #[test]
    fn the_environment_overrides_the_enclave_of_the_arguments() {
        let keystore = std::env::temp_dir().join(format!("virtual_axes_keystore_{}", std::process::id()));
        let folders = ["cell/mill", "other", ""].map(|name| keystore.join("enclaves").join(name));
        for folder in &folders {
            std::fs::create_dir_all(folder).expect("a folder");
            ENCLAVE_FILES.iter().for_each(|file| std::fs::write(folder.join(file), "").expect("a file"));
        }
        let path = keystore.display().to_string();
        let store = ("ROS_SECURITY_KEYSTORE", path.as_str());
        let found = |variables: &[_], argument| read(variables, argument);
        let [mill, other, root] = folders.clone().map(|folder| Ok(Security::Enclave(folder)));
        assert_eq!(found(&[ON, store], Some("/cell/mill")), mill);
        assert_eq!(
            found(&[ON, store, ("ROS_SECURITY_ENCLAVE_OVERRIDE", "/other")], Some("/cell/mill")),
            other
        );
        assert_eq!(found(&[ON, store], None), root);
        std::fs::remove_file(folders[0].join("key.pem")).expect("it was there");
        let missing = found(&[ON, ENFORCE, store], Some("/cell/mill"));
        std::fs::remove_dir_all(&keystore).expect("its own folder");
        assert!(missing.is_err_and(|error| error.to_string().contains("mill/key.pem not found")));
    }
}
