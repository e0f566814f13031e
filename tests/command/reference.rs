//! The stored pages of docs/reference have every parameter of the schema once.

use std::path::{Path, PathBuf};

use virtual_axes_core::config::listing;

fn pages() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/parameters");
    let entries = std::fs::read_dir(folder).expect("the folder of the pages");
    entries.map(|entry| entry.expect("a page").path()).collect()
}

/// Returns the cells of the rows whose first cell is a key.
fn rows(page: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(page).expect("a page");
    text.lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.trim_matches('|').split(" | ").map(|cell| cell.trim().to_owned()).collect())
        .collect()
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
        for row in rows(&page) {
            let key = row[0].trim_matches('`').to_owned();
            match (key.strip_suffix(".*"), row.as_slice()) {
                (Some(prefix), [_, policies @ ..]) => {
                    assert_eq!(policies.len(), 3, "{row:?}");
                    for (policy, default) in ["reliability", "durability", "depth"].iter().zip(policies) {
                        stored_qos.push((format!("{prefix}.{policy}"), default.clone()));
                    }
                }
                (None, [_, _, range, default, live, owner, description]) => {
                    stored.push(
                        [&key, range, &normalized(default), live, owner, description].map(Clone::clone),
                    );
                }
                _ => panic!("{}: {row:?}", page.display()),
            }
        }
    }
    let (mut qos, mut expected): (Vec<_>, Vec<_>) =
        listing::rows().into_iter().partition(|row| row[0].starts_with("qos."));
    expected.iter_mut().for_each(|row| row[2] = normalized(&row[2]));
    expected.sort();
    stored.sort();
    assert_eq!(stored, expected, "run tools/reference.py --write");
    qos.sort();
    stored_qos.sort();
    let qos: Vec<(String, String)> = qos.into_iter().map(|[key, _, default, ..]| (key, default)).collect();
    assert_eq!(stored_qos, qos, "run tools/reference.py --write");
}
