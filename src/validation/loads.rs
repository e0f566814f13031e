//! Axis loads from `JointState` messages: effort as external force or torque.

use virtual_axes_core::machine::check_input;
use virtual_axes_core::text::shortened;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// Returns the loads of a message: index of the axis in `joints` and load, N or N·m.
///
/// # Errors
/// Text with the first invalid entry (unknown or duplicate joint, NaN, too large); the message is rejected as
/// a whole.
pub fn loads(message: &JointState, joints: &[String]) -> Result<Vec<(usize, f64)>, String> {
    if message.name.len() != message.effort.len() {
        return Err(format!(
            "{} efforts for {} joints; give one effort for each name",
            message.effort.len(),
            message.name.len()
        ));
    }
    message
        .name
        .iter()
        .zip(&message.effort)
        .map(|(name, &load)| {
            let Some(index) = joints.iter().position(|j| j == name) else {
                return Err(format!(
                    "unknown joint {}; the machine has {}",
                    shortened(name),
                    joints.join(", ")
                ));
            };
            if message.name.iter().filter(|n| *n == name).count() > 1 {
                return Err(format!("joint {name} is given twice"));
            }
            check_input(load).map_err(|error| format!("joint {name}: effort is {error}"))?;
            Ok((index, load))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_of_nan_rejects_the_whole_message() {
        let message = JointState {
            name: vec!["x".into(), "y".into()],
            effort: vec![1.0, f64::NAN],
            ..JointState::default()
        };
        let joints = ["x".to_owned(), "y".to_owned()];
        let error = loads(&message, &joints).expect_err("must be rejected");
        assert!(error.contains('y') && error.contains("NaN"), "{error}");
    }

    #[test]
    fn a_long_name_is_truncated_in_the_rejection() {
        let message =
            JointState { name: vec!["q\n".repeat(100_000)], effort: vec![1.0], ..JointState::default() };
        let error = loads(&message, &["x".to_owned()]).expect_err("must be rejected");
        assert!(error.len() < 600 && !error.contains('\n'), "{} bytes", error.len());
    }
}
