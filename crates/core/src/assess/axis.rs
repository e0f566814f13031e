//! Tracking errors, currents and saturation of one axis, gathered while it runs.

use crate::machine::{Activity, AxisSample};

/// Figures of one axis over a motion.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisReport {
    /// Largest |PSEC − SP| at position instants, m or rad; contains the pure delay.
    pub max_tracking_error: f64,
    /// RMS of PSEC − SP at position instants, m or rad.
    pub rms_tracking_error: f64,
    /// Largest |PSEC delayed by α − SP| at position instants, m or rad.
    pub max_synchronized_tracking_error: f64,
    /// RMS of PSEC delayed by α − SP at position instants, m or rad.
    pub rms_synchronized_tracking_error: f64,
    /// Largest |i| at any tick, A.
    pub peak_current: f64,
    /// Time with speed, current or voltage setpoint at its limit, s.
    pub saturation_time: f64,
    /// Control activity: RMS of the change of the current setpoint from one position instant to the
    /// next, A.
    pub control_activity: f64,
}

/// Gathers the figures of one axis, position period by position period.
#[derive(Debug, Clone, Copy, Default)]
pub struct AxisAssessor {
    maxima: AxisReport,
    square_tracking: f64,
    square_synchronized: f64,
    square_activity: f64,
    /// Setpoint of the current at the last position instant, A.
    current_setpoint: f64,
    instants: u64,
    saturated_ticks: u64,
}

impl AxisAssessor {
    /// Takes a position period into account: the sample of its position instant, and what happened at its
    /// ticks.
    pub fn observe(&mut self, instant: &AxisSample, activity: &Activity) {
        let report = &mut self.maxima;
        report.peak_current = report.peak_current.max(activity.peak_current);
        self.saturated_ticks += activity.saturated_ticks;
        let (tracking, synchronized) = (instant.tracking_error(), instant.synchronized_tracking_error());
        report.max_tracking_error = report.max_tracking_error.max(tracking.abs());
        report.max_synchronized_tracking_error =
            report.max_synchronized_tracking_error.max(synchronized.abs());
        self.square_tracking += tracking * tracking;
        self.square_synchronized += synchronized * synchronized;
        if self.instants > 0 {
            let change = instant.current_setpoint - self.current_setpoint;
            self.square_activity += change * change;
        }
        self.current_setpoint = instant.current_setpoint;
        self.instants += 1;
    }

    /// The figures so far, for ticks of `tick` seconds.
    pub fn report(&self, tick: f64) -> AxisReport {
        AxisReport {
            rms_tracking_error: root_mean(self.square_tracking, self.instants),
            rms_synchronized_tracking_error: root_mean(self.square_synchronized, self.instants),
            control_activity: root_mean(self.square_activity, self.instants.saturating_sub(1)),
            saturation_time: self.saturated_ticks as f64 * tick,
            ..self.maxima
        }
    }
}

/// Root of the mean of `count` squares with the sum `squares`; 0 for none.
pub(crate) fn root_mean(squares: f64, count: u64) -> f64 {
    if count == 0 { 0.0 } else { (squares / count as f64).sqrt() }
}
