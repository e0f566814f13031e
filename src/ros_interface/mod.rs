//! Interface of the node as data: topics, services, the action and the keys of `/diagnostics`.
//!
//! `src/ros` creates its endpoints from these constants, `virtual_axes interface` prints them, and `tools/reference.py`
//! writes the pages in docs/reference from that output.

mod action;
mod description;
pub mod diagnostics;
mod services;
mod topics;

pub use action::*;
pub use description::*;
pub use services::*;
pub use topics::*;

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::DEFINITIONS;

    #[test]
    fn every_qos_parameter_belongs_to_one_topic_and_every_topic_has_its_parameters() {
        let mut expected: Vec<String> = TOPICS
            .iter()
            .filter_map(|topic| topic.qos_prefix())
            .flat_map(|prefix| {
                ["reliability", "durability", "depth"].map(|policy| format!("{prefix}.{policy}"))
            })
            .collect();
        let keys = DEFINITIONS.iter().map(|definition| definition.key);
        let mut found: Vec<String> = keys.filter(|key| key.starts_with("qos.")).map(str::to_owned).collect();
        expected.sort();
        found.sort();
        assert_eq!(found, expected);
        for topic in TOPICS {
            assert!(topic.default_qos().is_some(), "{}", topic.name);
        }
    }
}
