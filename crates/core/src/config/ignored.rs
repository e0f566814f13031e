//! Parameters of a file that the node ignores with a warning: those of other nodes, and those of a controller whose value it
//! cannot follow.

use std::collections::HashSet;

use super::aliases;
use super::controller;
use super::declaration::Entries;
use super::error::ConfigError;
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
}

impl FileFilter<'_> {
    /// Removes the ignored parameters from `assignments` and returns the reasons, one for each parameter or group of them.
    ///
    /// A file with a parameter that only controllers have is the file of a controller. Its unknown parameters are ignored in
    /// every section, since controllers ignore them, and so are its joints if this machine does not have all of them.
    pub fn remove_ignored(&self, assignments: &mut Vec<Assignment>) -> Vec<ConfigError> {
        let is_controller =
            !self.is_machine && assignments.iter().any(|one| controller::find(&one.key).is_some());
        let has_joints = assignments.iter().any(|one| one.key == "joints");
        let mut ignored = Vec::new();
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
        let mut groups = HashSet::new();
        assignments.retain(|one| {
            let Assignment { key, value, source } = one;
            let reason = if let Some(parameter) = controller::find(key) {
                parameter.check(key, value, source).err()
            } else if aliases::is_alias(key) {
                is_controller.then(|| self.constraint(one, &joints, &prefix).err()).flatten()
            } else {
                let is_for_others = !self.is_machine && !has_joints && self.shared.contains(key);
                let unknown = self.layout.check_name(key, source).err();
                match unknown {
                    Some(reason) => {
                        (is_controller || is_for_others || is_rclcpp_parameter(key)).then_some(reason)
                    }
                    None if is_controller => self.layout.check_value(key, value, source).err(),
                    None => None,
                }
            };
            let Some(reason) = reason else { return true };
            if controller::find(key).is_none_or(|found| !found.is_group() || groups.insert(found.key)) {
                ignored.push(reason);
            }
            false
        });
        ignored
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
                "be joints of this machine, {}; a machine file describes other joints with their drives",
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
