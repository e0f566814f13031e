//! Section of a recording after the zero-phase filter.

use super::SignalSpan;
use super::filter::{FilteredSignal, GaussianFilter};
use super::spans::{
    CURRENT, MOTOR_POSITION, POSITION, PSEC, RecordingSection, TORQUE_FEEDFORWARD, VELOCITY,
    VELOCITY_FEEDFORWARD,
};

/// Section of a recording after filtering.
pub(super) struct FilteredSection<'a> {
    pub filter: &'a GaussianFilter,
    pub section: RecordingSection,
    /// Filtered position and its derivatives.
    pub motion: FilteredSignal,
    pub smooth_current: Option<Vec<f64>>,
}

impl<'a> FilteredSection<'a> {
    pub fn new(section: RecordingSection, filter: &'a GaussianFilter) -> Self {
        let apply = |channel: usize| section.columns[channel].as_ref().map(|values| filter.apply(values));
        let motion = apply(POSITION).unwrap_or_default();
        let smooth_current = apply(CURRENT).map(|current| current.value);
        FilteredSection { filter, section, motion, smooth_current }
    }

    /// Inverts the sign of the current.
    pub fn invert_current(&mut self) {
        let raw = self.section.columns[CURRENT].iter_mut().flatten();
        raw.chain(self.smooth_current.iter_mut().flatten()).for_each(|current| *current = -*current);
    }

    /// Keeps the samples of `range`.
    pub fn cut(&mut self, range: std::ops::Range<usize>, period: f64) {
        let motion = &mut self.motion;
        for signal in [&mut motion.value, &mut motion.first, &mut motion.second]
            .into_iter()
            .chain(self.smooth_current.as_mut())
        {
            signal.truncate(range.end);
            signal.drain(..range.start.min(signal.len()));
        }
        self.section.cut(range, period);
    }

    pub fn into_span(self) -> SignalSpan {
        let mut columns = self.section.columns;
        SignalSpan {
            start: self.section.start,
            psec: columns[PSEC].take(),
            position: columns[POSITION].take().unwrap_or_default(),
            velocity: self.motion.first,
            acceleration: self.motion.second,
            recorded_velocity: columns[VELOCITY].take(),
            current: columns[CURRENT].take(),
            smooth_current: self.smooth_current,
            velocity_feedforward: columns[VELOCITY_FEEDFORWARD].take(),
            torque_feedforward: columns[TORQUE_FEEDFORWARD].take(),
            motor_position: columns[MOTOR_POSITION].take(),
        }
    }
}
