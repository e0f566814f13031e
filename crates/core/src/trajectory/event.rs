//! Events of motions at position cycles: started, completed, preempted, stopped.

/// Identifier of a motion, i.e. of an accepted trajectory; chosen by the caller and returned in events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MotionId(pub u64);

/// Set of joints, by their index in the machine.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct JointSet(u64);

impl JointSet {
    /// Largest number of joints of a machine.
    pub const CAPACITY: usize = u64::BITS as usize;

    /// Adds a joint.
    pub(super) fn insert(&mut self, joint: usize) {
        self.0 |= 1 << joint;
    }

    /// Returns true if the set contains `joint`.
    pub fn contains(self, joint: usize) -> bool {
        joint < Self::CAPACITY && self.0 & (1 << joint) != 0
    }

    /// Returns true if the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns the joint indices in ascending order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..Self::CAPACITY).filter(move |&joint| self.contains(joint))
    }
}

/// Event of a motion at a position cycle.
///
/// Each accepted trajectory gets [`TimelineEvent::Started`] at most once and exactly one of the other
/// events. The latter is its last event, even if some of its joints continue to move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimelineEvent {
    /// First setpoint commanded.
    Started(MotionId),
    /// Last setpoint commanded, or a successor took over at the end.
    Completed(MotionId),
    /// Preemption: another trajectory took joints over before the end.
    Preempted {
        /// Preempted motion.
        id: MotionId,
        /// Preempting motion.
        by: MotionId,
        /// Joints taken over at this instant.
        joints: JointSet,
    },
    /// End by a stop or a reset, or removal from the queue by one.
    Stopped {
        /// Stopped motion.
        id: MotionId,
        /// Stop request; `None` for a reset.
        by: Option<MotionId>,
    },
}
