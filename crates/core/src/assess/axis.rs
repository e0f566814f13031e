//! Following errors, currents and saturation of one axis.

use crate::machine::{Activity, AxisSample};
use crate::statistics::rms_of_sum;

/// Figures of one axis over a motion.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisReport {
    /// Largest following error |PSEC − SP| at position cycles, m or rad; contains the pure delay.
    pub max_following_error: f64,
    /// RMS of the following error PSEC − SP at position cycles, m or rad.
    pub rms_following_error: f64,
    /// Largest delay-compensated following error |PSEC delayed by α − SP| at position cycles, m or rad.
    pub max_delay_compensated_following_error: f64,
    /// RMS of the delay-compensated following error at position cycles, m or rad.
    pub rms_delay_compensated_following_error: f64,
    /// Largest |i| at any tick, A.
    pub peak_current: f64,
    /// Time with speed, current or voltage setpoint at its limit, s.
    pub saturation_time: f64,
    /// Control activity: RMS of the change of the current setpoint between consecutive position cycles,
    /// A.
    pub control_activity: f64,
}

/// Accumulator of the figures of one axis, updated once per position cycle.
#[derive(Debug, Clone, Copy, Default)]
pub struct AxisAssessor {
    maxima: AxisReport,
    sum_following_squared: f64,
    sum_compensated_squared: f64,
    sum_activity_squared: f64,
    /// Current setpoint at the last position cycle, A.
    current_setpoint: f64,
    instants: u64,
    saturated_ticks: u64,
}

impl AxisAssessor {
    /// Adds a position cycle: the sample at its position cycle and the activity of its ticks.
    pub fn observe(&mut self, instant: &AxisSample, activity: &Activity) {
        let report = &mut self.maxima;
        report.peak_current = report.peak_current.max(activity.peak_current);
        self.saturated_ticks += activity.saturated_ticks;
        let (following, compensated) =
            (instant.following_error(), instant.delay_compensated_following_error());
        report.max_following_error = report.max_following_error.max(following.abs());
        report.max_delay_compensated_following_error =
            report.max_delay_compensated_following_error.max(compensated.abs());
        self.sum_following_squared += following * following;
        self.sum_compensated_squared += compensated * compensated;
        if self.instants > 0 {
            let change = instant.current_setpoint - self.current_setpoint;
            self.sum_activity_squared += change * change;
        }
        self.current_setpoint = instant.current_setpoint;
        self.instants += 1;
    }

    /// Returns the figures so far, for ticks of `tick` seconds.
    pub fn report(&self, tick: f64) -> AxisReport {
        let rms = |sum: f64, count: u64| rms_of_sum(sum, count).unwrap_or(0.0);
        AxisReport {
            rms_following_error: rms(self.sum_following_squared, self.instants),
            rms_delay_compensated_following_error: rms(self.sum_compensated_squared, self.instants),
            control_activity: rms(self.sum_activity_squared, self.instants.saturating_sub(1)),
            saturation_time: self.saturated_ticks as f64 * tick,
            ..self.maxima
        }
    }
}
