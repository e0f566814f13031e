//! A goal as it came, to a trajectory that can be offered and the tolerances that it is held to.

use std::sync::Arc;

use super::Checks;
use virtual_axes_core::config::GoalDefaults;
use virtual_axes_core::simulation::{Tolerance, Tolerances};
use virtual_axes_core::trajectory::{Code, JointLimits, Rejection, Trajectory};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS, Rounded};
use virtual_axes_io::messages::builtin_interfaces::msg::Duration;
use virtual_axes_io::messages::{FollowJointTrajectoryGoal, JointTolerance};

/// "No tolerance" in a goal.
const NONE: f64 = -1.0;

/// Checks goals as far as it can be done without the state of the axes.
pub struct GoalChecks {
    /// Of their trajectories, as on `psec`.
    pub checks: Arc<Checks>,
}

impl GoalChecks {
    /// The trajectory of a goal, and its tolerances.
    ///
    /// # Errors
    /// [`Rejection`] as for a trajectory on `psec`; [`Code::MultiDof`] and [`Code::InvalidTolerance`].
    pub fn check(&self, goal: &FollowJointTrajectoryGoal) -> Result<(Trajectory, Tolerances), Rejection> {
        refuse_multi_dof(goal)?;
        let trajectory = self.checks.check(&goal.trajectory)?;
        let defaults = self.checks.live.goal_defaults();
        let tolerances = tolerances(goal, trajectory.joints(), &self.checks.joints, &defaults)?;
        Ok((trajectory, tolerances))
    }
}

fn refuse_multi_dof(goal: &FollowJointTrajectoryGoal) -> Result<(), Rejection> {
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
            Err(Rejection::new(Code::MultiDof, text).numbers(length as f64, 0.0))
        }
        None => Ok(()),
    }
}

/// The tolerances of a goal for a trajectory of the joints `places` of the machine.
fn tolerances(
    goal: &FollowJointTrajectoryGoal,
    places: &[usize],
    joints: &[JointLimits],
    defaults: &GoalDefaults,
) -> Result<Tolerances, Rejection> {
    let column = |field: &str, asked: &[JointTolerance], defaults: &[Option<f64>]| {
        let mut list: Vec<Tolerance> = places
            .iter()
            .map(|&place| Tolerance {
                position: defaults.get(place).copied().flatten(),
                ..Tolerance::default()
            })
            .collect();
        for (index, tolerance) in asked.iter().enumerate() {
            let wrong = |text: String| {
                let text = format!("{field}[{index}], joint {}: {text}", tolerance.name);
                Rejection::new(Code::InvalidTolerance, text).joint(&tolerance.name)
            };
            let column =
                places.iter().position(|&place| joints.get(place).is_some_and(|j| j.name == tolerance.name));
            let Some(entry) = column.and_then(|column| list.get_mut(column)) else {
                return Err(wrong("the trajectory does not have this joint".to_owned()));
            };
            if asked.iter().take(index).any(|earlier| earlier.name == tolerance.name) {
                return Err(wrong("the joint is there twice".to_owned()));
            }
            let number = |what: &str, value: f64, default: Option<f64>| match value {
                0.0 => Ok(default),
                NONE => Ok(None),
                value if value > 0.0 && value.is_finite() => Ok(Some(value)),
                value => {
                    let told = Rounded(value);
                    let text = format!("{what} is {told}; it must be positive, 0 (default) or -1 (none)");
                    Err(wrong(text).numbers(value, 0.0))
                }
            };
            *entry = Tolerance {
                position: number("position", tolerance.position, entry.position)?,
                velocity: number("velocity", tolerance.velocity, None)?,
                acceleration: number("acceleration", tolerance.acceleration, None)?,
            };
        }
        Ok(list)
    };
    Ok(Tolerances {
        path: column("path_tolerance", &goal.path_tolerance, &defaults.path)?,
        goal: column("goal_tolerance", &goal.goal_tolerance, &defaults.goal)?,
        goal_time: goal_time(&goal.goal_time_tolerance, defaults.goal_time)?,
    })
}

/// `goal_time_tolerance` in ns: 0 is the default, negative any time.
fn goal_time(asked: &Duration, default: Option<Nanoseconds>) -> Result<Option<Nanoseconds>, Rejection> {
    if i64::from(asked.nanosec) >= SECOND_NS {
        let text = format!("goal_time_tolerance: nanosec is {}, must be below {SECOND_NS}", asked.nanosec);
        return Err(
            Rejection::new(Code::InvalidTime, text).numbers(f64::from(asked.nanosec), SECOND_NS as f64 - 1.0)
        );
    }
    Ok(match i64::from(asked.sec) * SECOND_NS + i64::from(asked.nanosec) {
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
        let parameters = Parameters::embedded_default().expect("the default machine");
        simulation::joints(&parameters.machine_config().expect("the default machine"), "")
    }

    fn asked(name: &str, position: f64, velocity: f64) -> JointTolerance {
        JointTolerance { name: name.into(), position, velocity, acceleration: 0.0 }
    }

    fn found(goal: &FollowJointTrajectoryGoal) -> Result<Tolerances, Rejection> {
        let defaults = GoalDefaults {
            path: vec![Some(1.0), Some(2.0), Some(3.0), None, None],
            goal: vec![None; 5],
            goal_time: Some(7),
        };
        // Of a trajectory of z and x, in this order.
        tolerances(goal, &[2, 0], &joints(), &defaults)
    }

    #[test]
    fn zero_is_the_default_minus_one_none_and_the_order_is_the_trajectorys() {
        let goal = FollowJointTrajectoryGoal {
            path_tolerance: vec![asked("x", 0.0, 0.5), asked("z", -1.0, 0.0)],
            goal_tolerance: vec![asked("x", 0.25, -1.0)],
            ..FollowJointTrajectoryGoal::default()
        };
        let found = found(&goal).expect("good tolerances");
        let tolerance = |position, velocity| Tolerance { position, velocity, acceleration: None };
        assert_eq!(found.path, [tolerance(None, None), tolerance(Some(1.0), Some(0.5))]);
        assert_eq!(found.goal, [tolerance(None, None), tolerance(Some(0.25), None)]);
        assert_eq!(found.goal_time, Some(7));
    }

    #[test]
    fn joints_without_an_entry_have_the_defaults() {
        let found = found(&FollowJointTrajectoryGoal::default()).expect("good tolerances");
        assert_eq!((found.path[0].position, found.path[1].position), (Some(3.0), Some(1.0)));
    }

    #[test]
    fn what_cannot_be_kept_to_is_named() {
        for (list, words) in [
            (vec![asked("y", 0.1, 0.0)], "joint y: the trajectory does not have"),
            (
                vec![asked("x", 0.1, 0.0), asked("x", 0.1, 0.0)],
                "path_tolerance[1], joint x: the joint is there twice",
            ),
            (vec![asked("x", f64::NAN, 0.0)], "position is NaN"),
            (vec![asked("x", 0.0, -0.5)], "velocity is -0.5"),
            (vec![asked("x", f64::INFINITY, 0.0)], "position is inf"),
        ] {
            let goal = FollowJointTrajectoryGoal { path_tolerance: list, ..Default::default() };
            let rejection = found(&goal).expect_err("must be refused");
            assert_eq!(rejection.code, Code::InvalidTolerance);
            assert!(rejection.text.contains(words), "{rejection}");
        }
    }

    #[test]
    fn the_time_that_a_goal_may_take_is_default_none_or_said() {
        let time = |sec, nanosec| goal_time(&Duration { sec, nanosec }, Some(7));
        assert_eq!(time(0, 0), Ok(Some(7)));
        assert_eq!(time(-1, 0), Ok(None));
        assert_eq!(time(1, 5), Ok(Some(SECOND_NS + 5)));
        assert_eq!(time(0, 1_000_000_000).expect_err("must be refused").code, Code::InvalidTime);
    }

    #[test]
    fn joints_with_several_degrees_of_freedom_are_refused() {
        let goal = FollowJointTrajectoryGoal {
            component_goal_tolerance: vec![JointComponentTolerance::default()],
            ..Default::default()
        };
        let rejection = refuse_multi_dof(&goal).expect_err("must be refused");
        assert!(rejection.code == Code::MultiDof && rejection.text.contains("component_goal_tolerance"));
    }
}
