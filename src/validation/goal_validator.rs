//! Validation of action goals (`FollowJointTrajectory`): trajectory, path tolerance, goal tolerance, goal time
//! tolerance.

use std::sync::Arc;

use super::trajectory_validator::TrajectoryValidator;
use virtual_axes_core::config::GoalDefaults;
use virtual_axes_core::simulation::{Tolerance, Tolerances};
use virtual_axes_core::trajectory::{JointLimits, Rejection, RejectionCode, Trajectory};
use virtual_axes_core::units::{Nanoseconds, Rounded, SECOND_NS};
use virtual_axes_io::messages::builtin_interfaces::msg::Duration;
use virtual_axes_io::messages::{FollowJointTrajectoryGoal, JointTolerance};

/// Value of a disabled tolerance in a goal.
const DISABLED: f64 = -1.0;

/// Validator of action goals, independent of the state of the axes.
pub struct GoalValidator {
    /// Validator of their trajectories, shared with the topic `psec`.
    pub trajectories: Arc<TrajectoryValidator>,
}

impl GoalValidator {
    /// Validates a goal and returns its trajectory and its path and goal tolerances.
    ///
    /// # Errors
    /// [`Rejection`] for the causes of [`TrajectoryValidator::validate`],
    /// [`RejectionCode::MultiDof`] for multi-DOF entries, [`RejectionCode::InvalidTolerance`] for a tolerance
    /// that is NaN, infinite or negative, or of a joint that the trajectory does not contain.
    pub fn validate(&self, goal: &FollowJointTrajectoryGoal) -> Result<(Trajectory, Tolerances), Rejection> {
        reject_multi_dof(goal)?;
        let trajectory = self.trajectories.validate(&goal.trajectory)?;
        let defaults = self.trajectories.live.goal_defaults();
        let tolerances = tolerances(goal, trajectory.joints(), &self.trajectories.joints, &defaults)?;
        Ok((trajectory, tolerances))
    }
}

fn reject_multi_dof(goal: &FollowJointTrajectoryGoal) -> Result<(), Rejection> {
    let multi = &goal.multi_dof_trajectory;
    let found = [
        ("multi_dof_trajectory", multi.joint_names.len().max(multi.points.len())),
        ("component_path_tolerance", goal.component_path_tolerance.len()),
        ("component_goal_tolerance", goal.component_goal_tolerance.len()),
    ];
    match found.into_iter().find(|&(_, length)| length > 0) {
        Some((field, length)) => {
            let text = format!(
                "{field} has {length} entries; it must be empty, every axis has one degree of freedom"
            );
            Err(Rejection::new(RejectionCode::MultiDof, text).numbers(length as f64, 0.0))
        }
        None => Ok(()),
    }
}

/// Returns the tolerances of a goal for a trajectory of the joints with the machine indices
/// `joint_indices`.
fn tolerances(
    goal: &FollowJointTrajectoryGoal,
    joint_indices: &[usize],
    joints: &[JointLimits],
    defaults: &GoalDefaults,
) -> Result<Tolerances, Rejection> {
    let list = |field: &str, requested: &[JointTolerance], default: &dyn Fn(usize) -> Tolerance| {
        joint_tolerances((field, requested), joint_indices, joints, default)
    };
    let path = |joint: usize| Tolerance {
        position: defaults.path.get(joint).copied().flatten(),
        ..Tolerance::default()
    };
    let at_goal = |joint: usize| Tolerance {
        position: defaults.goal.get(joint).copied().flatten(),
        velocity: defaults.stopped_velocity,
        ..Tolerance::default()
    };
    Ok(Tolerances {
        path: list("path_tolerance", &goal.path_tolerance, &path)?,
        goal: list("goal_tolerance", &goal.goal_tolerance, &at_goal)?,
        goal_time: goal_time(&goal.goal_time_tolerance, defaults.goal_time)?.or(defaults.timeout),
    })
}

/// Returns one tolerance per joint of a trajectory from the entries `requested` of `field`; `default` returns that of a
/// joint without an entry.
fn joint_tolerances(
    (field, requested): (&str, &[JointTolerance]),
    joint_indices: &[usize],
    joints: &[JointLimits],
    default: &dyn Fn(usize) -> Tolerance,
) -> Result<Vec<Tolerance>, Rejection> {
    let mut list: Vec<Tolerance> = joint_indices.iter().map(|&joint| default(joint)).collect();
    for (index, tolerance) in requested.iter().enumerate() {
        let rejection = |text: String| {
            let text = format!("{field}[{index}], joint {}: {text}", tolerance.name);
            Rejection::new(RejectionCode::InvalidTolerance, text).joint(&tolerance.name)
        };
        let Some(joint) = joints.iter().position(|joint| joint.name == tolerance.name) else {
            let names: Vec<_> = joints.iter().map(|joint| joint.name.as_str()).collect();
            return Err(rejection(format!("there is no such joint; joints = [{}]", names.join(", "))));
        };
        // As joint_trajectory_controller: a joint that the trajectory does not name rests, within any tolerance.
        let column = joint_indices.iter().position(|&index| index == joint);
        let Some(entry) = column.and_then(|column| list.get_mut(column)) else { continue };
        if requested.iter().take(index).any(|earlier| earlier.name == tolerance.name) {
            return Err(rejection("the joint is given twice".to_owned()));
        }
        let limit = |quantity: &str, value: f64, default: Option<f64>| match value {
            0.0 => Ok(default),
            DISABLED | f64::INFINITY => Ok(None),
            value if value > 0.0 && value.is_finite() => Ok(Some(value)),
            value => {
                let text = format!(
                    "{quantity} is {}; it must be positive, 0 (default) or -1 (none)",
                    Rounded(value)
                );
                Err(rejection(text).numbers(value, 0.0))
            }
        };
        *entry = Tolerance {
            position: limit("position", tolerance.position, entry.position)?,
            velocity: limit("velocity", tolerance.velocity, entry.velocity)?,
            acceleration: limit("acceleration", tolerance.acceleration, None)?,
        };
    }
    Ok(list)
}

/// Returns the goal time tolerance in ns: `default` for 0, unlimited (`None`) for a negative duration.
fn goal_time(requested: &Duration, default: Option<Nanoseconds>) -> Result<Option<Nanoseconds>, Rejection> {
    if i64::from(requested.nanosec) >= SECOND_NS {
        let text =
            format!("goal_time_tolerance: nanosec is {}; it must be below {SECOND_NS}", requested.nanosec);
        return Err(Rejection::new(RejectionCode::InvalidTime, text)
            .numbers(f64::from(requested.nanosec), SECOND_NS as f64 - 1.0));
    }
    Ok(match i64::from(requested.sec) * SECOND_NS + i64::from(requested.nanosec) {
        0 => default,
        time if time < 0 => None,
        time => Some(time),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::config::Parameters;
    use virtual_axes_core::simulation;
    use virtual_axes_io::messages::JointComponentTolerance;

    fn joints() -> Vec<JointLimits> {
        let parameters = Parameters::embedded_default().expect("default machine");
        simulation::joint_limits(&parameters.machine_config().expect("default machine"), "")
    }

    fn entry(name: &str, position: f64, velocity: f64) -> JointTolerance {
        JointTolerance { name: name.into(), position, velocity, acceleration: 0.0 }
    }

    fn found(goal: &FollowJointTrajectoryGoal) -> Result<Tolerances, Rejection> {
        let defaults = GoalDefaults {
            path: vec![Some(1.0), Some(2.0), Some(3.0), None, None],
            goal: vec![None; 5],
            stopped_velocity: Some(0.02),
            goal_time: Some(7),
            timeout: Some(9),
        };
        // Trajectory of z and x, in this order.
        tolerances(goal, &[2, 0], &joints(), &defaults)
    }

    #[test]
    fn zero_is_the_default_minus_one_disables_and_the_order_is_that_of_the_trajectory() {
        let goal = FollowJointTrajectoryGoal {
            path_tolerance: vec![entry("x", 0.0, 0.5), entry("z", -1.0, 0.0)],
            goal_tolerance: vec![entry("x", 0.25, -1.0)],
            ..FollowJointTrajectoryGoal::default()
        };
        let found = found(&goal).expect("valid tolerances");
        let tolerance = |position, velocity| Tolerance { position, velocity, acceleration: None };
        assert_eq!(found.path, [tolerance(None, None), tolerance(Some(1.0), Some(0.5))]);
        assert_eq!(found.goal, [tolerance(None, Some(0.02)), tolerance(Some(0.25), None)]);
        assert_eq!(found.goal_time, Some(7));
    }

    #[test]
    fn an_unlimited_goal_time_ends_at_the_timeout() {
        let goal = FollowJointTrajectoryGoal {
            goal_time_tolerance: Duration { sec: -1, nanosec: 0 },
            ..FollowJointTrajectoryGoal::default()
        };
        assert_eq!(
            super::tolerances(&goal, &[0], &joints(), &GoalDefaults::default()).map(|t| t.goal_time),
            Ok(None)
        );
        assert_eq!(found(&goal).map(|t| t.goal_time), Ok(Some(9)));
    }

    #[test]
    fn joints_without_an_entry_get_the_defaults() {
        let found = found(&FollowJointTrajectoryGoal::default()).expect("valid tolerances");
        assert_eq!((found.path[0].position, found.path[1].position), (Some(3.0), Some(1.0)));
    }

    #[test]
    fn invalid_tolerances_are_rejected_with_joint_and_value() {
        for (list, words) in [
            (vec![entry("q", 0.1, 0.0)], "joint q: there is no such joint; joints = [x, "),
            (
                vec![entry("x", 0.1, 0.0), entry("x", 0.1, 0.0)],
                "path_tolerance[1], joint x: the joint is given twice",
            ),
            (vec![entry("x", f64::NAN, 0.0)], "position is NaN"),
            (vec![entry("x", 0.0, -0.5)], "velocity is -0.5"),
            (vec![entry("x", f64::NEG_INFINITY, 0.0)], "position is -inf"),
        ] {
            let goal = FollowJointTrajectoryGoal { path_tolerance: list, ..Default::default() };
            let rejection = found(&goal).expect_err("must be rejected");
            assert_eq!(rejection.code, RejectionCode::InvalidTolerance);
            assert!(rejection.text.contains(words), "{rejection}");
        }
    }

    #[test]
    fn an_infinite_tolerance_is_none_and_one_of_another_joint_has_no_effect() {
        let path_tolerance = vec![entry("y", 0.1, 0.0), entry("x", f64::INFINITY, 0.0)];
        let other = FollowJointTrajectoryGoal { path_tolerance, ..Default::default() };
        let goal =
            FollowJointTrajectoryGoal { path_tolerance: vec![entry("x", -1.0, 0.0)], ..Default::default() };
        assert_eq!(found(&other).expect("valid tolerances"), found(&goal).expect("valid tolerances"));
    }

    #[test]
    fn the_goal_time_tolerance_is_default_unlimited_or_given() {
        let time = |sec, nanosec| goal_time(&Duration { sec, nanosec }, Some(7));
        assert_eq!(time(0, 0), Ok(Some(7)));
        assert_eq!(time(-1, 0), Ok(None));
        assert_eq!(time(1, 5), Ok(Some(SECOND_NS + 5)));
        assert_eq!(time(0, 1_000_000_000).expect_err("must be rejected").code, RejectionCode::InvalidTime);
    }

    #[test]
    fn multi_dof_goals_are_rejected() {
        let goal = FollowJointTrajectoryGoal {
            component_goal_tolerance: vec![JointComponentTolerance::default()],
            ..Default::default()
        };
        let rejection = reject_multi_dof(&goal).expect_err("must be rejected");
        assert!(
            rejection.code == RejectionCode::MultiDof && rejection.text.contains("component_goal_tolerance")
        );
    }
}
