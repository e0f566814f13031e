//! The stored pages of docs/reference have every parameter of the schema once.

use std::path::{Path, PathBuf};

use virtual_axes_core::config::listing;

fn pages() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/parameters");
    let entries = std::fs::read_dir(folder).expect("the folder of the pages");
    entries.map(|entry| entry.expect("a page").path()).collect()
}

/// Returns the cells of the rows of a table.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    let lines = text.lines().filter(|line| line.starts_with("| "));
    lines.map(|line| line.trim_matches('|').split(" | ").map(str::trim).collect())
}

/// Returns a number in its shortest decimal form, and any other text unchanged.
fn normalized(default: &str) -> String {
    default.parse::<f64>().map_or_else(|_| default.to_owned(), |number| number.to_string())
}

#[test]
fn the_pages_have_every_parameter_of_the_schema_once_and_no_other() {
    let mut stored = Vec::new();
    let mut stored_qos = Vec::new();
    for page in pages() {
        let text = std::fs::read_to_string(&page).expect("a page");
        for section in text.split("\n## `").skip(1) {
            let (key, text) = section.split_once('`').expect("a key");
            for row in rows(text).skip(1) {
                let &[owner, _, range, default, live] = row.as_slice() else { panic!("{key}: {row:?}") };
                stored.push((
                    [key, range, &normalized(default), live, owner].map(str::to_owned),
                    text.to_owned(),
                ));
            }
        }
        for row in rows(&text).filter(|row| row[0].starts_with("`qos.")) {
            let [prefix, policies @ ..] = row.as_slice() else { panic!("{row:?}") };
            assert_eq!(policies.len(), 3, "{row:?}");
            let prefix = prefix.trim_matches('`').trim_end_matches('*');
            for (policy, default) in ["reliability", "durability", "depth"].iter().zip(policies) {
                stored_qos.push((format!("{prefix}{policy}"), (*default).to_owned()));
            }
        }
    }
    let (mut qos, mut expected): (Vec<_>, Vec<_>) =
        listing::rows().into_iter().partition(|row| row[0].starts_with("qos."));
    expected.iter_mut().for_each(|row| row[2] = normalized(&row[2]));
    expected.sort();
    stored.sort();
    for ((row, text), [key, range, default, live, owner, description]) in stored.iter().zip(&expected) {
        assert_eq!(row, &[key, range, default, live, owner].map(Clone::clone));
        assert!(text.contains(description), "{key}: {description}");
    }
    assert_eq!(stored.len(), expected.len());
    qos.sort();
    stored_qos.sort();
    let qos: Vec<(String, String)> = qos.into_iter().map(|[key, _, default, ..]| (key, default)).collect();
    assert_eq!(stored_qos, qos, "run tools/reference.py --write");
}
