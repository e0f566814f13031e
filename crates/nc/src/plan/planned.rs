//! Planned motion ahead of the present.

use std::collections::VecDeque;

use virtual_axes_core::trajectory::feed_override::PlannedMotion;

use super::look_ahead::Entry;
use super::segment::PathSegment;
use super::stations::MachineModel;
use super::vector::{JointVector, MAX_JOINTS};
use super::window::{Interval, Stations, WindowStart};

/// Returns a point without coordinates.
pub(super) const ORIGIN: JointVector = [0.0; MAX_JOINTS];

/// Returns the motion through `stations`.
pub(super) fn segments(intervals: &[Interval], start: WindowStart, stations: &Stations) -> Vec<PathSegment> {
    let mut segments = Vec::with_capacity(intervals.len());
    if start == WindowStart::Rest {
        segments.push(PathSegment::start(intervals[0].length, stations[0].0));
    }
    let offset = segments.len();
    for (interval, pair) in intervals[offset..].iter().zip(stations.windows(2)) {
        segments.push(PathSegment::between(interval.length, pair[0], pair[1]));
    }
    segments.push(PathSegment::stop(intervals[intervals.len() - 1].length, stations[stations.len() - 1].0));
    segments
}

/// Planned motion from `local` seconds after the start of the first interval.
pub(super) struct Ahead<'a> {
    pub model: &'a MachineModel,
    pub entries: &'a VecDeque<Entry>,
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
            let (Some(segment), Some(piece)) = (&entry.segment, &entry.piece) else { break };
            let is_end = i == last || self.entries[i + 1].segment.is_none();
            if local < segment.duration || is_end {
                let state = segment.at(local.min(segment.duration));
                return self.model.joints(piece, (entry.from + state.u).min(piece.length))[0];
            }
            local -= segment.duration;
        }
        ORIGIN
    }
}
