//! Ends that come from outside: a motion that is called off, and a halt of everything.

use super::event::MotionId;
use super::motions::Release;
use super::plan::{Kind, Plan};
use super::stream::StreamEnd;
use super::timeline::Timeline;
use crate::units::seconds;

/// What calling a motion off does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CallOff {
    /// Nothing: it commands no joint any more.
    Over,
    /// It had not begun, and will not.
    Discarded,
    /// Its joints come to rest.
    Stopping,
}

impl Timeline {
    /// Calls a motion off: the joints that it commands come to rest by a controlled stop, which belongs
    /// to it, so that [`Event::Ended`](super::Event::Ended) tells when the last one is at rest. Joints
    /// for which it waits are left to what moves them now. What waits behind it for one of its joints
    /// is told to have been stopped by it: it was to begin where this one would have ended.
    ///
    /// It is over already if there is no such motion, or its last setpoint has been commanded.
    pub fn cancel(&mut self, id: MotionId) -> CallOff {
        let Some(slot) = self.motions.find(id) else { return CallOff::Over };
        let mut effect = CallOff::Discarded;
        for joint in 0..self.tracks.len() {
            let queue = &mut self.tracks[joint].queue;
            let Some(place) = queue.iter().position(|plan| plan.slot == Some(slot)) else { continue };
            for behind in queue.drain(place + 1..) {
                if let Some(waiting) = behind.slot {
                    self.motions.release(waiting, joint, Release::Stopped(Some(id)));
                }
            }
            if place == 0 {
                // Its slot goes on with the stop.
                queue[0].slot = None;
                self.brake(joint, Some(slot));
                effect = CallOff::Stopping;
            } else {
                queue.truncate(place);
                self.motions.release(slot, joint, Release::Completed);
            }
        }
        self.motions.settle(&mut self.pending);
        self.reserve_events();
        effect
    }

    /// Brings every joint to rest by a controlled stop; all that moved or waited, the stream too, is
    /// told to have been stopped.
    pub fn halt(&mut self) {
        self.end_stream(0..self.tracks.len(), StreamEnd::ClockJump);
        for joint in 0..self.tracks.len() {
            self.stop_all(joint, None);
            self.brake(joint, None);
        }
        self.forget_stream();
        self.motions.settle(&mut self.pending);
        self.reserve_events();
    }

    /// A controlled stop of a joint from the next instant on, in place of all that waits for it; gives
    /// the first instant at rest.
    pub(super) fn brake(&mut self, joint: usize, slot: Option<usize>) -> i64 {
        let join_k = self.next_k;
        let track = &mut self.tracks[joint];
        let stop = self.planner.plan(track.state, &self.joints[joint].limits);
        let periods = (stop.duration() / seconds(self.period)).ceil() as i64;
        let end_k = (join_k - 1).saturating_add(periods).max(join_k);
        track.queue.truncate(1);
        track.queue.push_back(Plan {
            slot,
            join_k,
            end_k,
            nominal_start: i128::from(join_k) * i128::from(self.period),
            nominal_end: i128::from(end_k) * i128::from(self.period),
            kind: Kind::Stop { from_k: join_k - 1, stop },
        });
        end_k
    }
}
