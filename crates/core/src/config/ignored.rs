//! Parameters of a file that the node ignores with a warning: those of other nodes, and those of a controller whose value it
//! cannot follow.

use std::collections::HashSet;

use super::aliases;
use super::controller;
use super::declaration::Entries;
use super::error::{ConfigError, ValueSource};
use super::layout::{ParameterLayout, is_rclcpp_parameter};
use super::parameter_file::Assignment;
use super::value::Value;

/// Parameters of a file, compared with the parameters of the node before.
pub(super) struct FileFilter<'a> {
    /// Present values.
    pub entries: &'a Entries,
    /// Present joints.
    pub layout: &'a ParameterLayout,
    /// Keys that only sections for several nodes set.
    pub shared: &'a HashSet<String>,
    /// True if the file is a complete machine.
    pub is_machine: bool,
    /// True if the file has a section for a controller manager.
    pub has_manager: bool,
}

impl FileFilter<'_> {
    /// Returns true for the file of a controller: one with a parameter that only controllers have, or for a controller
    /// manager. In a section for several nodes, `update_rate` may be that of another node.
    pub fn is_of_controller(&self, assignments: &[Assignment]) -> bool {
        let is_of_others = |key: &str| self.shared.contains(key) && controller::is_common(key);
        let is_controllers = |key: &str| controller::find(key).is_some() && !is_of_others(key);
        let has_parameter = || assignments.iter().any(|one| is_controllers(&one.key));
        !self.is_machine && (self.has_manager || has_parameter())
    }

    /// Removes the ignored parameters from `assignments` and returns the reasons, one for each parameter or group of them.
    ///
    /// Unknown parameters of a controller's file are ignored in every section, since controllers ignore them, and so are its
    /// joints if this machine does not have all of them. In a section for several nodes, `joints` without one of this machine, and `machine` without
    /// parameters of a machine, are those of another node.
    ///
    /// # Errors
    /// That about the first key of `unusable` that is not ignored.
    pub fn remove_ignored(
        &self,
        assignments: &mut Vec<Assignment>,
        unusable: Vec<(String, ConfigError)>,
    ) -> Result<Vec<ConfigError>, ConfigError> {
        let is_controller = self.is_of_controller(assignments);
        let mut ignored = Vec::new();
        if !self.is_machine && !is_controller {
            assignments.retain(|one| {
                let reason = self.foreign_machine(one);
                let is_kept = reason.is_none();
                ignored.extend(reason);
                is_kept
            });
        }
        let has_joints = assignments.iter().any(|one| one.key == "joints");
        let unknown = |key: &str, source: &ValueSource| {
            let is_for_others = !self.is_machine && !has_joints && self.shared.contains(key);
            self.layout
                .check_name(key, source)
                .err()
                .filter(|_| is_controller || is_for_others || is_rclcpp_parameter(key))
        };
        for (key, error) in unusable {
            match unknown(&key, &ValueSource::named("")) {
                Some(_) => ignored.push(error),
                None => return Err(error),
            }
        }
        let mut joints: Vec<String> = self.layout.joints.iter().map(|joint| joint.name.clone()).collect();
        let prefix = assignments.iter().rev().find_map(|one| match &one.value {
            Value::Text(prefix) if one.key == "joint_prefix" => Some(prefix.clone()),
            _ => None,
        });
        let prefix = prefix.unwrap_or_else(|| aliases::joint_prefix(self.entries).to_owned());
        if is_controller {
            assignments.retain_mut(|one| {
                let found = (one.key == "joints").then(|| self.joints_of_controller(one, &prefix));
                match found {
                    Some(Ok(found)) => joints = found,
                    Some(Err(reason)) => {
                        ignored.push(reason);
                        return false;
                    }
                    None => {}
                }
                true
            });
        }
        let present = self.entries.get("time").map(|entry| &entry.value);
        let time = assignments.iter().rev().find(|one| one.key == "time").map(|one| &one.value);
        let is_fast = time.or(present) == Some(&Value::Text("fast".to_owned()));
        let mut named = HashSet::new();
        assignments.retain(|one| {
            let Assignment { key, value, source } = one;
            let follows_clock = key == "use_sim_time" && value.flag() == Some(true);
            let reason = if follows_clock && is_fast && self.shared.contains(key) {
                let allowed = "be false for this node: time = fast publishes /clock";
                Some(ConfigError::not_allowed(source, key, &value.rounded(), allowed))
            } else if let Some(parameter) = controller::find(key) {
                parameter.check(key, value, source).err()
            } else if aliases::is_alias(key) {
                is_controller.then(|| self.constraint(one, &joints, &prefix).err()).flatten()
            } else {
                unknown(key, source).or_else(|| {
                    let is_known = is_controller && self.layout.check_name(key, source).is_ok();
                    is_known.then(|| self.layout.check_value(key, value, source).err()).flatten()
                })
            };
            let Some(reason) = reason else { return true };
            let group = controller::find(key).filter(|found| found.is_group()).map(|found| found.key);
            if named.insert(group.unwrap_or(key).to_owned()) {
                ignored.push(reason);
            }
            false
        });
        Ok(ignored)
    }

    /// Returns the reason why `machine` or `joints` of a section for several nodes are those of another node, if they are.
    fn foreign_machine(&self, one: &Assignment) -> Option<ConfigError> {
        let is_joint = |name: &String| self.layout.joints.iter().any(|joint| joint.name == *name);
        let is_foreign = match (one.key.as_str(), &one.value) {
            ("machine", _) => true,
            ("joints", Value::TextList(names)) => !names.iter().any(is_joint),
            ("joints", _) => true,
            _ => false,
        };
        let allowed = "be part of a complete machine, which a machine file describes";
        (is_foreign && self.shared.contains(&one.key))
            .then(|| ConfigError::not_allowed(&one.source, &one.key, &one.value.rounded(), allowed))
    }

    /// Returns the joints of a controller without their prefix, which also becomes the value.
    fn joints_of_controller(&self, one: &mut Assignment, prefix: &str) -> Result<Vec<String>, ConfigError> {
        let own = |name: &String| {
            let plain = name.strip_prefix(prefix).unwrap_or(name);
            self.layout.joints.iter().find(|joint| joint.name == plain).map(|joint| joint.name.clone())
        };
        let found: Option<Vec<String>> = match &one.value {
            Value::TextList(names) => names.iter().map(own).collect(),
            _ => None,
        };
        let is_unique = |names: &Vec<String>| names.iter().collect::<HashSet<_>>().len() == names.len();
        let found = found.filter(|names| !names.is_empty() && is_unique(names)).ok_or_else(|| {
            let allowed = format!(
                "be different joints of this machine, {}; a machine file describes other joints with their drives",
                self.layout.names()
            );
            ConfigError::not_allowed(&one.source, &one.key, &one.value.rounded(), &allowed)
        })?;
        one.value = Value::TextList(found.clone());
        Ok(found)
    }

    /// Checks a constraint of a controller with the joints `joints`.
    fn constraint(&self, one: &Assignment, joints: &[String], prefix: &str) -> Result<(), ConfigError> {
        let plain = aliases::without_prefix(&one.key, prefix);
        let (key, _) = aliases::resolve(&plain, &one.value, &one.source, self.entries)?;
        match key.split_once('.') {
            Some((joint, _)) if !joints.iter().any(|name| name == joint) => {
                let reason = format!("the controller has the joints [{}]", joints.join(", "));
                Err(ConfigError::not_applicable(&one.source, &one.key, &reason))
            }
            _ => Ok(()),
        }
    }
}
