//! Places of the crate and of its static library.

use std::path::{Path, PathBuf};

/// Returns the folder of this crate.
pub fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the static library that cargo builds with this test.
pub fn library() -> PathBuf {
    let exe = std::env::current_exe().expect("the path of the test");
    let deps = exe.parent().expect("a folder");
    let named = |path: &PathBuf| {
        path.file_name().is_some_and(|name| {
            let name = name.to_string_lossy();
            name.starts_with("libvirtual_axes_c") && name.ends_with(".a")
        })
    };
    let files = deps.read_dir().expect("readable").filter_map(|entry| Some(entry.ok()?.path()));
    let changed = |path: &PathBuf| path.metadata().and_then(|data| data.modified()).ok();
    files.filter(named).max_by_key(changed).expect("cargo has built the static library")
}
