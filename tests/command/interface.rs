//! Output of `virtual_axes interface` and `virtual_axes parameters`.

use std::collections::BTreeSet;

use crate::command_common::{assert_rejected, json, printed};
use virtual_axes::ros_interface::{SERVICES, TOPICS};
use virtual_axes_core::config::{ControllerName, DEFINITIONS, listing};
use virtual_axes_core::trajectory::RejectionCode;

#[test]
fn lists_fit_in_80_columns() {
    for command in ["interface", "parameters"] {
        for line in printed(&[command]).lines() {
            assert!(line.chars().count() <= 80, "{command}: {line}");
        }
    }
}

#[test]
fn the_text_of_the_interface_has_every_name_of_the_json() {
    let text = printed(&["interface"]);
    let object = json(&["interface", "--json"]);
    let keys = [
        ("topics", "name"),
        ("services", "name"),
        ("actions", "name"),
        ("action_error_codes", "name"),
        ("rejection_codes", "name"),
    ];
    for (list, key) in keys {
        let entries = object[list].as_array().expect("a list");
        assert!(!entries.is_empty(), "{list}");
        for entry in entries {
            let name = entry[key].as_str().expect("a name");
            assert!(
                text.lines().any(|line| line.split_whitespace().any(|word| word == name)),
                "{list}: {name}"
            );
        }
    }
    assert_eq!(object["topics"].as_array().map(Vec::len), Some(TOPICS.len()));
    assert_eq!(object["services"].as_array().map(Vec::len), Some(SERVICES.len()));
}

#[test]
fn rejection_codes_are_numbered_from_one_without_gap() {
    let numbers: Vec<u8> = RejectionCode::ALL.iter().map(|&code| code as u8).collect();
    assert_eq!(numbers, (1..=18).collect::<Vec<u8>>());
}

#[test]
fn the_launch_files_offer_every_controller() {
    let names: Vec<String> = ControllerName::ALL.iter().map(|name| format!("\"{name}\"")).collect();
    let choices = format!("[\"as_machine\", {}]", names.join(", "));
    for file in ["virtual_axes", "two_machines", "ros2_control"] {
        let path = format!("{}/launch/{file}.launch.py", env!("CARGO_MANIFEST_DIR"));
        assert!(std::fs::read_to_string(&path).expect(&path).contains(&choices), "{path}: {choices}");
    }
}

#[test]
fn the_json_of_the_parameters_has_every_definition() {
    let list = json(&["parameters", "--json"]);
    let list = list.as_array().expect("a list");
    assert_eq!(list.len(), DEFINITIONS.len());
    for (entry, definition) in list.iter().zip(DEFINITIONS.iter()) {
        assert_eq!(entry["key"], listing::key(definition));
        assert_eq!(entry["default"].is_null(), definition.default_value().is_none(), "{}", entry["key"]);
    }
    let groups: BTreeSet<&str> = DEFINITIONS.iter().map(listing::group).collect();
    assert!(groups.len() > 5, "{groups:?}");
    assert_rejected(&["parameters", "--json", "--markdown"], &["cannot be used with"]);
}
