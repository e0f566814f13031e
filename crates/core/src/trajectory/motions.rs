//! Which trajectories are under way, and what is told about them.

use super::event::{Event, JointSet, MotionId};
use super::plan::Plan;

/// How a joint leaves a motion.
#[derive(Debug, Clone, Copy)]
pub(super) enum Release {
    Completed,
    Displaced(MotionId),
    Stopped(Option<MotionId>),
}

/// The accepted trajectories that still have joints.
#[derive(Debug)]
pub(super) struct Motions {
    slots: Vec<Option<Motion>>,
    free: Vec<usize>,
    /// Motions that lost a joint since they were last settled.
    touched: Vec<usize>,
}

#[derive(Debug)]
struct Motion {
    id: MotionId,
    /// Joints that have not left it.
    remaining: usize,
    started: bool,
    /// What ended it, told when the instant is complete.
    outcome: Option<Event>,
    /// Its last event has been told.
    closed: bool,
}

impl Motions {
    pub fn new(joints: usize) -> Self {
        Self {
            slots: Vec::new(),
            free: Vec::new(),
            // A joint can leave one motion for the next and complete that at the same instant.
            touched: Vec::with_capacity(2 * joints),
        }
    }

    /// Number of slots: no more motions than that can have something to tell.
    pub fn capacity(&self) -> usize {
        self.slots.len()
    }

    pub fn open(&mut self, id: MotionId, joints: usize) -> usize {
        let motion = Some(Motion { id, remaining: joints, started: false, outcome: None, closed: false });
        match self.free.pop() {
            Some(slot) => {
                self.slots[slot] = motion;
                slot
            }
            None => {
                self.slots.push(motion);
                // So that freeing it allocates nothing.
                self.free.reserve(self.slots.len());
                self.slots.len() - 1
            }
        }
    }

    /// The slot of a motion that is not over.
    pub fn find(&self, id: MotionId) -> Option<usize> {
        self.slots.iter().position(|motion| motion.as_ref().is_some_and(|m| m.id == id && !m.closed))
    }

    pub fn start(&mut self, slot: Option<usize>, events: &mut Vec<Event>) {
        if let Some(motion) = slot.and_then(|slot| self.slots[slot].as_mut())
            && !motion.started
            && !motion.closed
        {
            motion.started = true;
            events.push(Event::Started(motion.id));
        }
    }

    /// `new` takes `joint` over from `old`, which had reached its end or not.
    pub fn hand_over(&mut self, old: &Plan, new: &Plan, joint: usize) {
        let Some(slot) = old.slot else { return };
        let by = new.slot.and_then(|slot| self.slots[slot].as_ref());
        let release = match by {
            Some(by) if old.nominal_end > new.nominal_start => Release::Displaced(by.id),
            _ => Release::Completed,
        };
        self.release(slot, joint, release);
    }

    /// Takes `joint` away from a motion. [`Motions::settle`] tells.
    pub fn release(&mut self, slot: usize, joint: usize, release: Release) {
        let Some(motion) = self.slots[slot].as_mut() else {
            return;
        };
        motion.remaining -= 1;
        let id = motion.id;
        match (release, &mut motion.outcome) {
            (Release::Completed, _) => {}
            (Release::Displaced(_), Some(Event::Displaced { joints, .. })) => joints.insert(joint),
            (_, Some(_)) => {}
            (Release::Displaced(by), outcome) => {
                let mut joints = JointSet::default();
                joints.insert(joint);
                *outcome = Some(Event::Displaced { id, by, joints });
            }
            (Release::Stopped(by), outcome) => *outcome = Some(Event::Stopped { id, by }),
        }
        self.touched.push(slot);
    }

    /// Tells what became of the motions that lost joints, and forgets those that have none left.
    pub fn settle(&mut self, events: &mut Vec<Event>) {
        for slot in self.touched.drain(..) {
            let Some(motion) = self.slots[slot].as_mut() else {
                continue;
            };
            let ended = (motion.remaining == 0).then_some(Event::Ended(motion.id));
            if !motion.closed
                && let Some(event) = motion.outcome.or(ended)
            {
                motion.closed = true;
                events.push(event);
            }
            if motion.remaining == 0 {
                self.slots[slot] = None;
                self.free.push(slot);
            }
        }
    }
}
