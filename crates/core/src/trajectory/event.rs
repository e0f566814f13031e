//! What the timeline tells about the trajectories that it was given.

/// Names a trajectory; the caller gives it, and gets it back in events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MotionId(pub u64);

/// A set of joints, by their index in the machine.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct JointSet(u64);

impl JointSet {
    /// Most joints that a machine can have.
    pub const CAPACITY: usize = u64::BITS as usize;

    /// Adds a joint.
    pub(super) fn insert(&mut self, joint: usize) {
        self.0 |= 1 << joint;
    }

    /// Whether `joint` is in it.
    pub fn contains(self, joint: usize) -> bool {
        joint < Self::CAPACITY && self.0 & (1 << joint) != 0
    }

    /// Whether no joint is in it.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its joints, in the machine's order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..Self::CAPACITY).filter(move |&joint| self.contains(joint))
    }
}

/// Something that happened to a trajectory at a position instant.
///
/// Each accepted trajectory gets [`Event::Started`] at most once and exactly one of the others,
/// after which nothing more is told about it, even if some of its joints go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// Its first setpoint was commanded.
    Started(MotionId),
    /// Its last setpoint was commanded, or its successor took over at the end.
    Ended(MotionId),
    /// Another trajectory took joints from it before its end.
    Displaced {
        /// The one that was displaced.
        id: MotionId,
        /// The one that took its place.
        by: MotionId,
        /// The joints that were taken at this instant.
        joints: JointSet,
    },
    /// A stop or a reset ended it, or removed it while it waited.
    Stopped {
        /// The one that was stopped.
        id: MotionId,
        /// The stop request, or nothing for a reset.
        by: Option<MotionId>,
    },
}
