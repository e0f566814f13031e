//! Streamed setpoints from `JointState` messages, and a filter of reordered (late) messages.

use std::collections::VecDeque;

use virtual_axes_core::trajectory::{Rejection, RejectionCode};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_io::messages::nanoseconds;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// Decrease of the stamp above which the clock of the publisher was set back, ns; below it, the message was
/// reordered in the network.
const CLOCK_SET_BACK: Nanoseconds = SECOND_NS;
/// Largest number of stored rejections of one message, which can contain any number of unknown joints.
const MAX_REJECTIONS: usize = 16;
/// Largest number of publishers with a stored stamp.
const MAX_PUBLISHERS: usize = 64;

/// Setpoints of one message.
#[derive(Debug, Default)]
pub struct StreamSetpoints {
    /// Index of the axis in `joints`, and position setpoint, m or rad.
    pub positions: Vec<(usize, f64)>,
    /// Rejections that do not depend on the state of the axes.
    pub rejected: Vec<Rejection>,
    /// Number of further rejections, which are not stored.
    pub unlisted_rejections: u64,
    /// Source time stamp, ns; `None` if the stamp is 0.
    pub sent: Option<Nanoseconds>,
    /// A later message of the same publisher arrived before this one, so it is ignored.
    pub is_reordered: bool,
}

/// Filter of reordered messages by the latest stamp of each publisher.
#[derive(Debug, Default)]
pub struct ReorderFilter {
    /// Publisher id and its latest stamp, ns.
    latest: VecDeque<([u8; 16], Nanoseconds)>,
}

impl ReorderFilter {
    /// Returns true if a later message of `publisher` arrived before the message with the stamp `sent`, ns.
    pub fn is_reordered(&mut self, publisher: [u8; 16], sent: Option<Nanoseconds>) -> bool {
        let Some(sent) = sent else { return false };
        let Some((_, latest)) = self.latest.iter_mut().find(|(known, _)| *known == publisher) else {
            if self.latest.len() == MAX_PUBLISHERS {
                self.latest.pop_front();
            }
            self.latest.push_back((publisher, sent));
            return false;
        };
        let is_reordered = sent < *latest && *latest - sent <= CLOCK_SET_BACK;
        if !is_reordered {
            *latest = sent;
        }
        is_reordered
    }
}

impl StreamSetpoints {
    /// Creates the setpoints of a message; a rejection of one joint does not affect the others.
    ///
    /// NaN and a `position` shorter than `name` mean no setpoint for the joint, as in ros2_control's
    /// topic-based hardware. Infinite setpoints are rejected by the simulation.
    pub fn from_message(message: &JointState, joints: &[String]) -> Self {
        let sent = Some(nanoseconds(&message.header.stamp)).filter(|&stamp| stamp != 0);
        let mut setpoints = Self { sent, ..Self::default() };
        let (names, positions) = (&message.name, &message.position);
        if positions.len() > names.len() {
            let (found, wanted) = (positions.len(), names.len());
            let text =
                format!("{found} positions for {wanted} joints; give at most one position for each name");
            let rejection =
                Rejection::new(RejectionCode::WrongSize, text).numbers(found as f64, wanted as f64);
            setpoints.rejected.push(rejection);
            return setpoints;
        }
        let mut count = 0;
        for (name, &position) in names.iter().zip(positions).filter(|(_, position)| !position.is_nan()) {
            let index = joints.iter().position(|joint| joint == name);
            match index.filter(|&index| setpoints.positions.iter().all(|&(given, _)| given != index)) {
                Some(index) => setpoints.positions.push((index, position)),
                None => {
                    count += 1;
                    if count <= MAX_REJECTIONS {
                        setpoints.rejected.push(rejection(name, index.is_some(), joints));
                    }
                }
            }
        }
        setpoints.unlisted_rejections = count.saturating_sub(MAX_REJECTIONS) as u64;
        setpoints
    }

    /// Creates the setpoints of a message of `publisher`; a reordered message has none.
    pub fn from_message_in_order(
        message: &JointState,
        joints: &[String],
        publisher: [u8; 16],
        filter: &mut ReorderFilter,
    ) -> Self {
        let setpoints = Self::from_message(message, joints);
        if filter.is_reordered(publisher, setpoints.sent) {
            return Self { is_reordered: true, ..Self::default() };
        }
        setpoints
    }
}

/// Returns the rejection of a setpoint of an unknown or repeated joint.
fn rejection(name: &str, is_known: bool, joints: &[String]) -> Rejection {
    let (code, text) = if is_known {
        (RejectionCode::DuplicateJoint, format!("joint {name} is given twice; the first setpoint is used"))
    } else {
        (RejectionCode::UnknownJoint, format!("unknown joint {name}; the machine has {}", joints.join(", ")))
    };
    Rejection::new(code, text).joint(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setpoints(name: &[&str], position: &[f64]) -> StreamSetpoints {
        let joints = ["x", "y", "z"].map(str::to_owned);
        let name = name.iter().map(|&n| n.to_owned()).collect();
        StreamSetpoints::from_message(
            &JointState { name, position: position.to_vec(), ..JointState::default() },
            &joints,
        )
    }

    #[test]
    fn nan_and_missing_positions_are_no_setpoint() {
        let found = setpoints(&["z", "x", "y"], &[f64::NAN, 0.1]);
        assert_eq!(found.positions, [(0, 0.1)]);
        assert!(found.rejected.is_empty());
        assert!(setpoints(&["x"], &[]).positions.is_empty());
    }

    #[test]
    fn a_rejected_joint_does_not_affect_the_others() {
        let found = setpoints(&["q", "x", "x", "y"], &[0.1, 0.2, 0.3, f64::INFINITY]);
        assert_eq!(found.positions, [(0, 0.2), (1, f64::INFINITY)]);
        let codes: Vec<_> = found.rejected.iter().map(|r| r.code).collect();
        assert_eq!(codes, [RejectionCode::UnknownJoint, RejectionCode::DuplicateJoint]);
    }

    #[test]
    fn a_message_of_many_unknown_joints_takes_no_memory_for_each() {
        let found = setpoints(&["q"; 10_000], &[0.1; 10_000]);
        assert_eq!((found.rejected.len(), found.unlisted_rejections), (MAX_REJECTIONS, 10_000 - 16));
        let found = setpoints(&["x"; 10_000], &[0.1; 10_000]);
        assert_eq!((found.positions.len(), found.rejected.len()), (1, MAX_REJECTIONS));
        assert_eq!(found.unlisted_rejections, 10_000 - 1 - 16);
    }

    #[test]
    fn more_positions_than_names_are_rejected() {
        let found = setpoints(&["x"], &[0.1, 0.2]);
        assert!(found.positions.is_empty());
        assert_eq!(found.rejected[0].code, RejectionCode::WrongSize);
    }

    #[test]
    fn reordered_messages_of_each_publisher_are_detected() {
        let mut filter = ReorderFilter::default();
        let (one, other) = ([1; 16], [2; 16]);
        let mut is_reordered = |publisher, sent| filter.is_reordered(publisher, sent);
        assert!(!is_reordered(one, Some(10 * SECOND_NS)));
        assert!(!is_reordered(one, Some(10 * SECOND_NS)), "same stamp");
        assert!(is_reordered(one, Some(10 * SECOND_NS - 1)));
        assert!(!is_reordered(one, None), "no stamp");
        assert!(!is_reordered(other, Some(9 * SECOND_NS)));
        assert!(!is_reordered(one, Some(8 * SECOND_NS)), "clock set back");
        assert!(!is_reordered(one, Some(8 * SECOND_NS + 1)));
    }
}
