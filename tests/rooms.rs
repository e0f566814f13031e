//! The rooms stand in one order, and each imports only from those before it.

use std::fs;
use std::path::{Path, PathBuf};

/// As in ARCHITECTURE.md.
const ORDER: [&str; 24] = [
    "units",
    "lanes",
    "config",
    "kinematics",
    "drive",
    "control",
    "design",
    "machine",
    "trajectory",
    "path",
    "assess",
    "simulation",
    "scenario",
    "trial",
    "recording",
    "identify",
    "tune",
    "stress",
    "messages",
    "files",
    "report",
    "urdf",
    "door",
    "ros",
];

/// Rooms before a room that it still must not know.
const APART: [(&str, &str); 18] = [
    ("control", "drive"),
    ("design", "drive"),
    ("door", "files"),
    ("door", "report"),
    ("door", "trial"),
    ("door", "urdf"),
    ("report", "files"),
    ("report", "messages"),
    ("ros", "report"),
    ("ros", "trial"),
    ("ros", "urdf"),
    ("stress", "identify"),
    ("stress", "tune"),
    ("tune", "identify"),
    ("tune", "recording"),
    ("urdf", "files"),
    ("urdf", "messages"),
    ("urdf", "report"),
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the sources are there");
    let paths = entries.map(|entry| entry.expect("readable").path());
    paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
}

fn place(room: &str) -> usize {
    ORDER.iter().position(|r| *r == room).unwrap_or_else(|| panic!("{room} is not in the order"))
}

#[test]
fn a_room_imports_only_from_rooms_before_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut imports = 0;
    for file in sources(&root) {
        let inside = file.strip_prefix(&root).expect("below src");
        let room = inside.components().next().expect("a name").as_os_str().to_string_lossy();
        let room = room.trim_end_matches(".rs");
        if ["lib", "bin"].contains(&room) {
            continue;
        }
        let text = fs::read_to_string(&file).expect("readable");
        for used in text.split("crate::").skip(1) {
            let used: String = used.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect();
            if used.is_empty() {
                continue;
            }
            imports += 1;
            let allowed = place(&used) <= place(room) && !APART.contains(&(room, used.as_str()));
            assert!(allowed, "{} imports from {used}", inside.display());
        }
    }
    assert!(imports > 30, "the search found only {imports} imports");
}
