//! The stored pages of docs/reference have every parameter of the schema once, and every key of the JSON outputs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;
use virtual_axes_core::config::listing;

use crate::command_common::json;

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

/// Commands whose output is documented in json.md, by section.
const DOCUMENTED: [(&str, &[&[&str]]); 11] = [
    (
        "run",
        &[
            &["run", "ballbar-both", "--compare", "x.velocity_loop.gain=4.5"],
            &["run", "corner-90"],
            &["run", "five-axis"],
            &["run", "config/programs/finishing-raster.nc"],
        ],
    ),
    (
        "design",
        &[
            &["design", "gpc"],
            &["design", "gpc", "--lambda", "1"],
            &["design", "pid", "--derivative-time-ms", "1", "--integral-time-ms", "400"],
            &["design", "poles", "--bandwidth", "50", "--damping", "0.9"],
        ],
    ),
    (
        "tune",
        &[
            &["tune", "corner-90", "--controller", "gpc", "--also", "ballbar"],
            &["tune", "x-there-and-back", "--controller", "cascade"],
        ],
    ),
    ("bode", &[&["bode", "--set", "contour_control.gain=1"]]),
    ("learn", &[&["learn", "ballbar", "--iterations", "1", "--on", "x.position_loop.gain=2"]]),
    ("robustness", &[&["robustness", "corner-90"]]),
    ("pose", &[&["pose", "--joints", "x=0.1"]]),
    ("machines", &[&["machines"]]),
    ("scenarios", &[&["scenarios"]]),
    ("parameters", &[&["parameters"]]),
    ("interface", &[&["interface"]]),
];

/// Adds all keys of an output, without those of the figures of a run inside it and without joints.
fn collect_keys(value: &Value, keys: &mut BTreeSet<String>) {
    match value {
        Value::Array(values) => values.iter().for_each(|value| collect_keys(value, keys)),
        Value::Object(object) => {
            for (key, value) in object {
                if !["x", "y", "z", "a", "c"].contains(&key.as_str()) || !value.is_object() {
                    keys.insert(key.clone());
                }
                if key != "figures" {
                    collect_keys(value, keys);
                }
            }
        }
        _ => {}
    }
}

/// Returns the words in the code spans of a text.
fn code_words(text: &str) -> BTreeSet<String> {
    let spans = text.split('`').skip(1).step_by(2);
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let words = spans.flat_map(|span| span.split(move |c| !is_word(c)));
    words.filter(|word| !word.is_empty()).map(str::to_owned).collect()
}

#[test]
fn the_page_of_json_has_every_printed_key_and_no_other() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/json.md");
    let page = std::fs::read_to_string(page).expect("the page");
    for (name, commands) in DOCUMENTED {
        let (_, section) = page.split_once(&format!("\n## {name}\n")).expect("a section");
        let section = section.split("\n## ").next().unwrap_or_default();
        let mut printed = BTreeSet::new();
        for command in commands {
            let arguments: Vec<&str> = command.iter().copied().chain(["--json"]).collect();
            collect_keys(&json(&arguments), &mut printed);
        }
        let documented = code_words(section);
        let missing: Vec<&String> = printed.difference(&documented).collect();
        assert!(missing.is_empty(), "json.md, {name}: not documented: {missing:?}");
        let first_column: String = rows(section).map(|row| row[0].to_owned()).collect();
        let surplus = code_words(&first_column);
        let surplus: Vec<&String> = surplus.difference(&printed).filter(|&word| word != "joint").collect();
        assert!(surplus.is_empty(), "json.md, {name}: not printed: {surplus:?}");
    }
}
