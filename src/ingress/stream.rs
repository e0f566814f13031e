//! Setpoints of a stream from messages, and which messages come too late.

use std::collections::VecDeque;

use virtual_axes_core::trajectory::{Code, Rejection};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_io::messages::nanoseconds;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// A message whose stamp is older than the one before by more than this comes from a clock that was
/// set back; by less, it was overtaken on its way.
const CLOCK_SET_BACK: Nanoseconds = SECOND_NS;
/// Refusals of one message that are kept; a message can name more joints than there are, and more than there
/// is memory for.
const MOST_REFUSED: usize = 16;
/// Publishers whose last stamp is remembered.
const MOST_PUBLISHERS: usize = 64;

/// The setpoints of one message.
#[derive(Debug, Default)]
pub struct Setpoints {
    /// Place of the axis in `joints`, and position, m or rad.
    pub positions: Vec<(usize, f64)>,
    /// What is refused without asking the axes.
    pub refused: Vec<Rejection>,
    /// How many more were refused.
    pub refused_beside: u64,
    /// When it was sent by the sender's clock, ns; none if it does not say.
    pub sent: Option<Nanoseconds>,
    /// Whether a younger message of its publisher came before it.
    pub overtaken: bool,
}

/// The youngest stamp of each publisher.
#[derive(Debug, Default)]
pub struct Order {
    /// The publisher's id, and its youngest stamp, ns.
    youngest: VecDeque<([u8; 16], Nanoseconds)>,
}

impl Order {
    /// Whether a message of `publisher` that was sent at `sent` comes after a younger one.
    pub fn is_overtaken(&mut self, publisher: [u8; 16], sent: Option<Nanoseconds>) -> bool {
        let Some(sent) = sent else { return false };
        let Some((_, youngest)) = self.youngest.iter_mut().find(|(known, _)| *known == publisher) else {
            if self.youngest.len() == MOST_PUBLISHERS {
                self.youngest.pop_front();
            }
            self.youngest.push_back((publisher, sent));
            return false;
        };
        let is_overtaken = sent < *youngest && *youngest - sent <= CLOCK_SET_BACK;
        if !is_overtaken {
            *youngest = sent;
        }
        is_overtaken
    }
}

impl Setpoints {
    /// The setpoints of a message, joint by joint: what is wrong with one leaves the others.
    ///
    /// As ros2_control's topic-based hardware means it: NaN and a `position` shorter than `name` leave
    /// the joint alone.
    pub fn of(message: &JointState, joints: &[String]) -> Self {
        let sent = Some(nanoseconds(&message.header.stamp)).filter(|&stamp| stamp != 0);
        let mut setpoints = Self { sent, ..Self::default() };
        let (names, positions) = (&message.name, &message.position);
        if positions.len() > names.len() {
            let (found, wanted) = (positions.len(), names.len());
            let text = format!("{found} positions for {wanted} joints; position has no more than name");
            let rejection = Rejection::new(Code::WrongSize, text).numbers(found as f64, wanted as f64);
            setpoints.refused.push(rejection);
            return setpoints;
        }
        let mut refused = 0;
        for (name, &position) in names.iter().zip(positions).filter(|(_, position)| !position.is_nan()) {
            let place = joints.iter().position(|joint| joint == name);
            match place.filter(|&place| setpoints.positions.iter().all(|&(taken, _)| taken != place)) {
                Some(place) => setpoints.positions.push((place, position)),
                None => {
                    refused += 1;
                    if refused <= MOST_REFUSED {
                        setpoints.refused.push(refusal(name, place.is_some(), joints));
                    }
                }
            }
        }
        setpoints.refused_beside = refused.saturating_sub(MOST_REFUSED) as u64;
        setpoints
    }

    /// Likewise, of a message of `publisher`; one that was overtaken has none.
    pub fn in_order(message: &JointState, joints: &[String], publisher: [u8; 16], order: &mut Order) -> Self {
        let setpoints = Self::of(message, joints);
        if order.is_overtaken(publisher, setpoints.sent) {
            return Self { overtaken: true, ..Self::default() };
        }
        setpoints
    }
}

/// Why a joint's setpoint is not taken: it has one already, or it is none of `joints`.
fn refusal(name: &str, is_known: bool, joints: &[String]) -> Rejection {
    let (code, text) = if is_known {
        (Code::DuplicateJoint, format!("joint {name} is named twice; the first counts"))
    } else {
        (Code::UnknownJoint, format!("unknown joint {name}; there are {}", joints.join(", ")))
    };
    Rejection::new(code, text).joint(name)
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
    fn a_message_of_many_unknown_joints_takes_no_memory_for_each() {
        let found = setpoints(&["q"; 10_000], &[0.1; 10_000]);
        assert_eq!((found.refused.len(), found.refused_beside), (MOST_REFUSED, 10_000 - 16));
        let found = setpoints(&["x"; 10_000], &[0.1; 10_000]);
        assert_eq!((found.positions.len(), found.refused.len()), (1, MOST_REFUSED));
        assert_eq!(found.refused_beside, 10_000 - 1 - 16);
    }

    #[test]
    fn more_positions_than_names_belong_to_nobody_knows_which() {
        let found = setpoints(&["x"], &[0.1, 0.2]);
        assert!(found.positions.is_empty());
        assert_eq!(found.refused[0].code, Code::WrongSize);
    }

    #[test]
    fn of_each_publisher_what_was_overtaken_is_left_out() {
        let mut order = Order::default();
        let (one, other) = ([1; 16], [2; 16]);
        let mut is_overtaken = |publisher, sent| order.is_overtaken(publisher, sent);
        assert!(!is_overtaken(one, Some(10 * SECOND_NS)));
        assert!(!is_overtaken(one, Some(10 * SECOND_NS)), "twice the same");
        assert!(is_overtaken(one, Some(10 * SECOND_NS - 1)));
        assert!(!is_overtaken(one, None), "no stamp");
        assert!(!is_overtaken(other, Some(9 * SECOND_NS)));
        assert!(!is_overtaken(one, Some(8 * SECOND_NS)), "its clock was set back");
        assert!(!is_overtaken(one, Some(8 * SECOND_NS + 1)));
    }
}
