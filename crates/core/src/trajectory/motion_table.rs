//! Table of accepted motions and the generation of their events.

use super::event::{JointSet, MotionId, TimelineEvent};
use super::plan::JointPlan;

/// Cause for which a motion releases a joint.
#[derive(Debug, Clone, Copy)]
pub(super) enum Release {
    Completed,
    Preempted(MotionId),
    Stopped(Option<MotionId>),
}

/// Accepted motions that still have joints, in slots that are reused.
#[derive(Debug, Clone)]
pub(super) struct MotionTable {
    slots: Vec<Option<MotionEntry>>,
    free: Vec<usize>,
    /// Slots of motions that released a joint since the last call of [`MotionTable::settle`].
    touched: Vec<usize>,
}

#[derive(Debug, Clone)]
struct MotionEntry {
    id: MotionId,
    /// Number of joints not released yet.
    remaining: usize,
    is_started: bool,
    /// Event for the cause of the end, pushed at the end of the instant.
    outcome: Option<TimelineEvent>,
    /// The last event has been pushed.
    is_closed: bool,
}

impl MotionTable {
    /// Creates an empty table for a machine with `joints` joints.
    pub fn new(joints: usize) -> Self {
        Self {
            slots: Vec::new(),
            free: Vec::new(),
            // At one instant a joint can leave two motions for the next, at a feed override of 200 %, and complete that one.
            touched: Vec::with_capacity(3 * joints),
        }
    }

    /// Returns the number of slots: upper bound of the number of motions with events.
    pub fn capacity(&self) -> usize {
        self.slots.len()
    }

    /// Adds a motion with `joints` joints and returns its slot.
    pub fn open(&mut self, id: MotionId, joints: usize) -> usize {
        let motion =
            Some(MotionEntry { id, remaining: joints, is_started: false, outcome: None, is_closed: false });
        match self.free.pop() {
            Some(slot) => {
                self.slots[slot] = motion;
                slot
            }
            None => {
                self.slots.push(motion);
                // Allocates here, so that freeing the slot does not allocate.
                self.free.reserve(self.slots.len());
                self.slots.len() - 1
            }
        }
    }

    /// Returns the slot of a motion without a last event.
    pub fn find(&self, id: MotionId) -> Option<usize> {
        self.slots.iter().position(|motion| motion.as_ref().is_some_and(|m| m.id == id && !m.is_closed))
    }

    /// Pushes the start event of a motion when its first joint starts.
    pub fn start(&mut self, slot: Option<usize>, events: &mut Vec<TimelineEvent>) {
        if let Some(motion) = slot.and_then(|slot| self.slots[slot].as_mut())
            && !motion.is_started
            && !motion.is_closed
        {
            motion.is_started = true;
            events.push(TimelineEvent::Started(motion.id));
        }
    }

    /// Releases `joint` from the plan `old`: preempted by `new` before its end, completed otherwise.
    pub fn hand_over(&mut self, old: &JointPlan, new: &JointPlan, joint: usize) {
        let Some(slot) = old.slot.filter(|slot| new.slot != Some(*slot)) else { return };
        let by = new.slot.and_then(|slot| self.slots[slot].as_ref());
        let release = match by {
            Some(by) if old.nominal_end > new.nominal_start => Release::Preempted(by.id),
            _ => Release::Completed,
        };
        self.release(slot, joint, release);
    }

    /// Releases `joint` from the motions in `slots`, each once; the plans of a motion are successive. The motion in
    /// `kept` remains.
    pub fn release_each(
        &mut self,
        slots: impl Iterator<Item = usize>,
        kept: Option<usize>,
        joint: usize,
        release: Release,
    ) {
        let mut last = kept;
        for slot in slots {
            if last.replace(slot) != Some(slot) {
                self.release(slot, joint, release);
            }
        }
    }

    /// Releases `joint` from a motion; [`MotionTable::settle`] pushes the event.
    pub fn release(&mut self, slot: usize, joint: usize, release: Release) {
        let Some(motion) = self.slots[slot].as_mut() else {
            return;
        };
        motion.remaining -= 1;
        let id = motion.id;
        match (release, &mut motion.outcome) {
            (Release::Completed, _) => {}
            (Release::Preempted(_), Some(TimelineEvent::Preempted { joints, .. })) => joints.insert(joint),
            (_, Some(_)) => {}
            (Release::Preempted(by), outcome) => {
                let mut joints = JointSet::default();
                joints.insert(joint);
                *outcome = Some(TimelineEvent::Preempted { id, by, joints });
            }
            (Release::Stopped(by), outcome) => *outcome = Some(TimelineEvent::Stopped { id, by }),
        }
        self.touched.push(slot);
    }

    /// Pushes the last events of motions that released joints, and frees motions without joints.
    pub fn settle(&mut self, events: &mut Vec<TimelineEvent>) {
        for slot in self.touched.drain(..) {
            let Some(motion) = self.slots[slot].as_mut() else {
                continue;
            };
            let completed = (motion.remaining == 0).then_some(TimelineEvent::Completed(motion.id));
            if !motion.is_closed
                && let Some(event) = motion.outcome.or(completed)
            {
                motion.is_closed = true;
                events.push(event);
            }
            if motion.remaining == 0 {
                self.slots[slot] = None;
                self.free.push(slot);
            }
        }
    }
}
