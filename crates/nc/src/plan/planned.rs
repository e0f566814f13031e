//! Planned motion ahead of the present.

use std::collections::VecDeque;

use virtual_axes_core::trajectory::feed_override::PlannedMotion;

use super::machine_model::MachineModel;
use super::planned_interval::PlannedInterval;
use super::vector::{JointVector, MAX_JOINTS};

/// Returns a point without coordinates.
pub(super) const ORIGIN: JointVector = [0.0; MAX_JOINTS];

/// Planned motion from `local` seconds after the start of the first interval.
pub(super) struct Ahead<'a> {
    pub model: &'a MachineModel,
    pub entries: &'a VecDeque<PlannedInterval>,
    pub local: f64,
    /// Position period, s.
    pub period: f64,
}

impl PlannedMotion for Ahead<'_> {
    fn positions_after(&self, steps: f64, joints: &mut [f64]) {
        let planned = self.joints_after(steps * self.period);
        joints.iter_mut().zip(planned).for_each(|(joint, planned)| *joint = planned);
    }
}

impl Ahead<'_> {
    fn joints_after(&self, time: f64) -> JointVector {
        let mut local = self.local + time;
        let last = self.entries.len().saturating_sub(1);
        for (i, entry) in self.entries.iter().enumerate() {
            let (Some(motion), Some(piece)) = (&entry.motion, &entry.piece) else { break };
            let is_end = i == last || self.entries[i + 1].motion.is_none();
            if local < motion.duration || is_end {
                let state = motion.at(local.min(motion.duration));
                return self.model.joints(piece, (entry.from + state.u).min(piece.length))[0];
            }
            local -= motion.duration;
        }
        ORIGIN
    }
}
