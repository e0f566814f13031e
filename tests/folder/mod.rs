//! A folder for one test.

use std::path::PathBuf;

/// A folder for one test, gone when the test is over.
pub struct Folder(pub PathBuf);

impl Folder {
    /// One that no other test uses.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("virtual_axes_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Folder(path)
    }

    /// A file in it.
    #[allow(dead_code, reason = "not every test writes files")]
    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("a file can be written");
        path
    }

    /// Names of all that is in it.
    #[allow(dead_code, reason = "not every test looks")]
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).expect("readable");
        let mut names: Vec<String> =
            entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
