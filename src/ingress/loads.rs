//! Loads at the axes from messages.

use virtual_axes_core::config::shortened;
use virtual_axes_core::simulation::MAX_LOAD;
use virtual_axes_core::units::Rounded;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// The loads of a message: place of the axis in `joints` and load, N or N·m.
///
/// # Errors
/// A sentence that names the first thing that is wrong; no load of the message is taken then.
pub fn loads(message: &JointState, joints: &[String]) -> Result<Vec<(usize, f64)>, String> {
    if message.name.len() != message.effort.len() {
        return Err(format!(
            "{} efforts for {} joints; effort needs one value for each name",
            message.effort.len(),
            message.name.len()
        ));
    }
    message
        .name
        .iter()
        .zip(&message.effort)
        .map(|(name, &load)| {
            let Some(place) = joints.iter().position(|j| j == name) else {
                return Err(format!("unknown joint {}; there are {}", shortened(name), joints.join(", ")));
            };
            if message.name.iter().filter(|n| *n == name).count() > 1 {
                return Err(format!("joint {name} is named twice"));
            }
            if load.is_nan() || load.abs() > MAX_LOAD {
                return Err(format!("joint {name}: effort is {}, must lie in ±{MAX_LOAD}", Rounded(load)));
            }
            Ok((place, load))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_of_nan_takes_the_whole_message_down() {
        let message = JointState {
            name: vec!["x".into(), "y".into()],
            effort: vec![1.0, f64::NAN],
            ..JointState::default()
        };
        let joints = ["x".to_owned(), "y".to_owned()];
        let error = loads(&message, &joints).expect_err("must be refused");
        assert!(error.contains('y') && error.contains("NaN"), "{error}");
    }

    #[test]
    fn a_name_without_end_does_not_come_back_in_the_refusal() {
        let message =
            JointState { name: vec!["q\n".repeat(100_000)], effort: vec![1.0], ..JointState::default() };
        let error = loads(&message, &["x".to_owned()]).expect_err("must be refused");
        assert!(error.len() < 600 && !error.contains('\n'), "{} bytes", error.len());
    }
}
