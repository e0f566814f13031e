//! What the environment says about DDS Security, by the rules of rcl: `ROS_SECURITY_ENABLE`,
//! `ROS_SECURITY_STRATEGY`, `ROS_SECURITY_KEYSTORE`, `ROS_SECURITY_ENCLAVE_OVERRIDE` and `--enclave`.
//!
//! A node that is told to enforce security and cannot have it does not start.

use std::path::{Path, PathBuf};

/// What an enclave consists of, by the names of SROS2 (rmw_dds_common's `get_security_files`).
pub const FILES: [&str; 6] = [
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
];

/// Whether this build can do it.
pub const AVAILABLE: bool = cfg!(feature = "security");

/// Why a node that is to be secured cannot be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SecurityError {
    /// The node is built without it.
    #[error(
        "ROS_SECURITY_ENABLE is true, and this program is built without DDS Security; build it with \
         `--features security`, or set ROS_SECURITY_ENABLE to false"
    )]
    NotBuilt,
    /// Nobody says where the enclaves are.
    #[error(
        "ROS_SECURITY_ENABLE is true, and ROS_SECURITY_KEYSTORE is not set; it must be the keystore's folder"
    )]
    NoKeystore,
    /// A name that is none.
    #[error("the enclave '{found}' is not a name of one: {reason}")]
    Name {
        /// The name.
        found: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The enclave is not there, or not all of it.
    #[error("the enclave {enclave} cannot be used: {path} is not there; an enclave has {files}", files = FILES.join(", "))]
    Missing {
        /// Its name.
        enclave: String,
        /// The file that is not there.
        path: String,
    },
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Security {
    /// Nothing is protected, and nobody asked for it.
    Off,
    /// It is wanted and cannot be had, but need not be enforced: nothing is protected.
    Open(SecurityError),
    /// The folder of the enclave, with all of its files.
    Enclave(PathBuf),
}

impl Security {
    /// What the variables ask for, read through `lookup`; `argument` is that of `--enclave`.
    ///
    /// # Errors
    /// [`SecurityError`] if `ROS_SECURITY_STRATEGY` is `Enforce` and it cannot be had.
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
            Err(error) => Ok(Security::Open(error)),
        }
    }
}

/// The folder of an enclave.
fn enclave(keystore: Option<String>, name: &str) -> Result<PathBuf, SecurityError> {
    if !AVAILABLE {
        return Err(SecurityError::NotBuilt);
    }
    let keystore = keystore.ok_or(SecurityError::NoKeystore)?;
    super::names::check_namespace(name)
        .map_err(|error| SecurityError::Name { found: name.to_owned(), reason: error.to_string() })?;
    let folder = Path::new(&keystore).join("enclaves").join(name.trim_start_matches('/'));
    match FILES.map(|file| folder.join(file)).into_iter().find(|path| !path.is_file()) {
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
    fn only_the_word_true_asks_for_it() {
        for value in ["false", "True", "1", "on", ""] {
            let variables = [("ROS_SECURITY_ENABLE", value), ENFORCE];
            assert_eq!(read(&variables, None), Ok(Security::Off), "{value}");
        }
        assert_eq!(read(&[ENFORCE], None), Ok(Security::Off));
    }

    #[test]
    fn what_is_to_be_enforced_and_cannot_be_had_is_refused() {
        let nowhere = ("ROS_SECURITY_KEYSTORE", "/nowhere");
        let refused = read(&[ON, ENFORCE, nowhere], Some("/mill")).expect_err("must be refused");
        let open = read(&[ON, ("ROS_SECURITY_STRATEGY", "enforce"), nowhere], Some("/mill"));
        assert_eq!(open, Ok(Security::Open(refused.clone())));
        if AVAILABLE {
            let text = refused.to_string();
            assert!(text.contains("/nowhere/enclaves/mill/identity_ca.cert.pem"), "{text}");
            assert_eq!(read(&[ON, ENFORCE], None), Err(SecurityError::NoKeystore));
            let named = read(&[ON, ENFORCE, nowhere], Some("/../mill"));
            assert!(matches!(named, Err(SecurityError::Name { .. })), "{named:?}");
        } else {
            assert_eq!(refused, SecurityError::NotBuilt);
        }
    }

    #[cfg(feature = "security")]
    #[test]
    fn an_enclave_is_the_folder_of_its_name_unless_the_environment_has_another() {
        let keystore = std::env::temp_dir().join(format!("virtual_axes_keystore_{}", std::process::id()));
        let folders = ["cell/mill", "other", ""].map(|name| keystore.join("enclaves").join(name));
        for folder in &folders {
            std::fs::create_dir_all(folder).expect("a folder");
            FILES.iter().for_each(|file| std::fs::write(folder.join(file), "").expect("a file"));
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
        assert!(missing.is_err_and(|error| error.to_string().contains("mill/key.pem is not there")));
    }
}
