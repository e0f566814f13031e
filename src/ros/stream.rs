//! `psec_stream`: set-points one at a time, and what becomes of them.

use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use tracing::warn;

use crate::simulation::Simulation;
use crate::trajectory::{Code, Rejection};
use crate::units::{Nanoseconds, SECOND_NS};

/// How often the log tells of refusals for the same reason at most.
const LOG_PERIOD: Nanoseconds = SECOND_NS;

/// The set-points of one message.
#[derive(Debug, Default)]
pub struct Setpoints {
    /// Place of the axis in `joints`, and position, m or rad.
    positions: Vec<(usize, f64)>,
    /// What is refused without asking the axes.
    refused: Vec<Rejection>,
}

/// What the diagnostics say about the stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct StreamHealth {
    /// Whether a stream drives, moving or not.
    pub drives: bool,
    /// Its delay, ns.
    pub delay: Nanoseconds,
    /// Set-points refused since the start.
    pub refused: u64,
    /// Set-points since the start that came while a trajectory or a stop had the joint.
    pub ignored: u64,
}

/// Hands set-points to the simulation, counts those that are not taken, and tells of them now and then.
#[derive(Debug, Default)]
pub struct StreamLog {
    refused: u64,
    ignored: u64,
    /// When the log last told of a reason, ns of the node's time.
    told: Vec<(Code, Nanoseconds)>,
}

impl Setpoints {
    /// The set-points of a message, joint by joint: what is wrong with one leaves the others.
    ///
    /// As ros2_control's topic-based hardware means it: NaN and a `position` shorter than `name` leave
    /// the joint alone.
    pub fn of(message: &JointState, joints: &[String]) -> Self {
        let mut setpoints = Self::default();
        let (names, positions) = (&message.name, &message.position);
        if positions.len() > names.len() {
            let (found, wanted) = (positions.len(), names.len());
            let text = format!("{found} positions for {wanted} joints; position has no more than name");
            let rejection = Rejection::new(Code::WrongSize, text).numbers(found as f64, wanted as f64);
            setpoints.refused.push(rejection);
            return setpoints;
        }
        for (name, &position) in names.iter().zip(positions) {
            if position.is_nan() {
                continue;
            }
            let Some(place) = joints.iter().position(|joint| joint == name) else {
                let text = format!("unknown joint {name}; there are {}", joints.join(", "));
                setpoints.refused.push(Rejection::new(Code::UnknownJoint, text).joint(name));
                continue;
            };
            if setpoints.positions.iter().any(|&(taken, _)| taken == place) {
                let text = format!("joint {name} is named twice; the first counts");
                setpoints.refused.push(Rejection::new(Code::DuplicateJoint, text).joint(name));
                continue;
            }
            setpoints.positions.push((place, position));
        }
        setpoints
    }
}

impl StreamLog {
    /// Gives `setpoints` to the axes for the next position instant.
    pub fn take(&mut self, simulation: &mut Simulation, setpoints: Setpoints) {
        let now = simulation.time_of(simulation.next_instant());
        for rejection in &setpoints.refused {
            self.refuse(rejection, now);
        }
        for (place, position) in setpoints.positions {
            match simulation.stream(place, position) {
                Ok(true) => {}
                Ok(false) => self.ignored += 1,
                Err(rejection) => self.refuse(&rejection, now),
            }
        }
    }

    fn refuse(&mut self, rejection: &Rejection, now: Nanoseconds) {
        self.refused += 1;
        if self.is_due(rejection.code, now) {
            warn!("set-point of the stream refused: {rejection}");
        }
    }

    /// Whether a reason has not been told for [`LOG_PERIOD`]; it counts as told then.
    fn is_due(&mut self, code: Code, now: Nanoseconds) -> bool {
        let Some((_, told)) = self.told.iter_mut().find(|(known, _)| *known == code) else {
            self.told.push((code, now));
            return true;
        };
        // A clock that is followed can go back.
        let is_due = (now - *told).abs() >= LOG_PERIOD;
        if is_due {
            *told = now;
        }
        is_due
    }

    /// What the diagnostics say.
    pub fn health(&self, simulation: &Simulation) -> StreamHealth {
        StreamHealth {
            drives: simulation.is_streaming(),
            delay: simulation.stream_delay(),
            refused: self.refused,
            ignored: self.ignored,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setpoints(name: &[&str], position: &[f64]) -> Setpoints {
        let joints = ["x", "y", "z"].map(str::to_owned);
        let name = name.iter().map(|&n| n.to_owned()).collect();
        Setpoints::of(&JointState { name, position: position.to_vec(), ..JointState::default() }, &joints)
    }

    #[test]
    fn nan_and_missing_positions_leave_a_joint_alone() {
        let found = setpoints(&["z", "x", "y"], &[f64::NAN, 0.1]);
        assert_eq!(found.positions, [(0, 0.1)]);
        assert!(found.refused.is_empty());
        assert!(setpoints(&["x"], &[]).positions.is_empty());
    }

    #[test]
    fn what_is_wrong_with_one_joint_leaves_the_others() {
        let found = setpoints(&["q", "x", "x", "y"], &[0.1, 0.2, 0.3, f64::INFINITY]);
        assert_eq!(found.positions, [(0, 0.2), (1, f64::INFINITY)]);
        let codes: Vec<_> = found.refused.iter().map(|r| r.code).collect();
        assert_eq!(codes, [Code::UnknownJoint, Code::DuplicateJoint]);
    }

    #[test]
    fn more_positions_than_names_belong_to_nobody_knows_which() {
        let found = setpoints(&["x"], &[0.1, 0.2]);
        assert!(found.positions.is_empty());
        assert_eq!(found.refused[0].code, Code::WrongSize);
    }

    #[test]
    fn the_log_tells_of_each_reason_once_a_second() {
        let mut log = StreamLog::default();
        assert!(log.is_due(Code::Jump, 0));
        assert!(!log.is_due(Code::Jump, SECOND_NS - 1));
        assert!(log.is_due(Code::OutsideStroke, SECOND_NS - 1));
        assert!(log.is_due(Code::Jump, SECOND_NS));
        assert!(!log.is_due(Code::Jump, 2 * SECOND_NS - 1));
    }
}
