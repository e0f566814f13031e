//! Checks the invariants of one axis over a whole trajectory.

use super::check::Check;
use super::drive_checker::{DriveChecker, FailedCheck};
use super::response::{ORDERS, ResponseInputs};
use super::test_machines::{MAX_TICKS, ReferenceModel};
use virtual_axes_core::config::{AxisConfig, LimitsConfig, Periods};
use virtual_axes_core::machine::{Activity, AxisSample, FALLBACK_DELAY};
use virtual_axes_core::trajectory::limits::SPEED_TOLERANCE;
use virtual_axes_core::units::seconds;

/// Allowed rounding error of thousands of ticks, relative to the error bound and to the largest position.
const ROUNDING: (f64, f64) = (1e-9, 1e-12);

/// Observed figures of one axis over a trajectory.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisObservation {
    /// Ticks at a limit.
    pub limited_ticks: u64,
    /// Largest |i|, A.
    pub peak_current: f64,
    /// Largest delay-compensated following error at a position cycle, m or rad.
    pub error: f64,
    /// Bound of the error, m or rad; `None` if a limit or the fallback controller acted, so that the loop was not linear.
    pub bound: Option<f64>,
    /// Difference of the error from the superposition of the impulse responses, relative to the allowed rounding error.
    pub mismatch: f64,
    /// Supplied energy, J.
    pub supplied: f64,
    /// Energy dissipated by friction, J.
    pub dissipated: f64,
    /// Energy returned by friction over ticks with a standstill, J.
    pub returned: f64,
    /// Largest energy imbalance of a tick relative to the allowed rounding error.
    pub imbalance: f64,
    /// Final position (m or rad), velocity (m/s or rad/s), current (A), voltage (V) and current setpoint (A).
    pub end: [f64; 5],
}

/// Checker of the invariants of one axis.
#[derive(Debug, Clone)]
pub struct InvariantChecker {
    pub drive: DriveChecker,
    limits: LimitsConfig,
    period: f64,
    /// [`FALLBACK_DELAY`] in position cycles, during which the loop is linear.
    rest_after: usize,
    velocity_ticks: usize,
    gravity: f64,
    psec: f64,
    farthest: f64,
    steps: Vec<f64>,
    errors: Vec<f64>,
    torque: Vec<f64>,
    feedforward: Vec<f64>,
    ticks: usize,
    limited_ticks: u64,
    peak_current: f64,
    period_figures: (u64, f64),
    last: AxisSample,
}

impl InvariantChecker {
    /// Creates a checker for `axis` with its reference model.
    pub fn new(axis: &AxisConfig, periods: &Periods, model: &ReferenceModel) -> Self {
        InvariantChecker {
            drive: DriveChecker::new(axis, seconds(periods.current), &model.energy),
            limits: axis.limits,
            period: seconds(periods.position),
            rest_after: (FALLBACK_DELAY / periods.position) as usize,
            velocity_ticks: periods.ticks_per_velocity() as usize,
            gravity: 0.0,
            psec: 0.0,
            farthest: 0.0,
            steps: Vec::new(),
            errors: Vec::new(),
            torque: Vec::with_capacity(MAX_TICKS),
            feedforward: Vec::new(),
            ticks: 0,
            limited_ticks: 0,
            peak_current: 0.0,
            period_figures: (0, 0.0),
            last: AxisSample::default(),
        }
    }

    /// Resets the checker for the next trajectory, which starts at `position`, m or rad.
    pub fn begin(&mut self, position: f64) {
        self.drive.begin();
        for list in [&mut self.steps, &mut self.errors, &mut self.torque, &mut self.feedforward] {
            list.clear();
        }
        (self.psec, self.farthest, self.gravity) = (position, position.abs(), 0.0);
        (self.ticks, self.limited_ticks, self.peak_current) = (0, 0, 0.0);
        self.period_figures = (0, 0.0);
        self.last = AxisSample { position, ..AxisSample::default() };
    }

    /// Returns the number of checked ticks.
    pub fn ticks(&self) -> usize {
        self.ticks
    }

    /// Checks one tick. `instant` is true at the first tick of a position cycle, `second` at the second.
    pub fn check_tick(
        &mut self,
        s: &AxisSample,
        [instant, second]: [bool; 2],
        report: &mut impl FnMut(FailedCheck),
    ) {
        let [friction, against] = self.drive.check_tick(s, second, report);
        if self.ticks == 0 {
            self.gravity = against;
        } else {
            self.torque.push(self.gravity - against - friction);
        }
        if instant {
            let step = s.psec - self.psec;
            let most = self.limits.velocity * self.period * (1.0 + 2.0 * SPEED_TOLERANCE)
                + 2.0 * f64::EPSILON * s.psec.abs();
            if step.abs() > most {
                report((Check::SetpointSpeed, step, most));
            }
            self.psec = s.psec;
            self.steps.push(step);
            self.errors.push(s.delay_compensated_following_error());
            self.period_figures = (0, 0.0);
        }
        if self.ticks.is_multiple_of(self.velocity_ticks) {
            self.feedforward.push(s.torque_feedforward);
        }
        self.period_figures.0 += u64::from(self.drive.is_at_limit(s));
        self.period_figures.1 = self.period_figures.1.max(s.current.abs());
        self.farthest = self.farthest.max(s.position.abs());
        self.ticks += 1;
        self.last = *s;
    }

    /// Compares the figures of the ended position cycle with the machine's `activity`.
    pub fn end_period(&mut self, activity: &Activity, report: &mut impl FnMut(FailedCheck)) {
        let (limited, peak) = self.period_figures;
        if activity.saturated_ticks != limited {
            report((Check::Counted, activity.saturated_ticks as f64, limited as f64));
        }
        if activity.peak_current != peak {
            report((Check::Counted, activity.peak_current, peak));
        }
        self.limited_ticks += limited;
        self.peak_current = self.peak_current.max(peak);
    }

    /// Returns the ticks at a limit in the last position cycle.
    pub fn limited_in_period(&self) -> u64 {
        self.period_figures.0
    }

    /// Checks the following error at the end of the trajectory and returns the figures of the axis.
    ///
    /// `is_preview_exact` is true if the preview of the setpoints was correct, `loaded` if a load acted on the axis.
    pub fn finish(
        &self,
        model: &ReferenceModel,
        is_preview_exact: bool,
        loaded: bool,
        report: &mut impl FnMut(FailedCheck),
    ) -> AxisObservation {
        let instants = self.linear_instants(model, is_preview_exact, loaded);
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let s = &self.last;
        let mut figures = AxisObservation {
            limited_ticks: self.limited_ticks,
            peak_current: self.peak_current,
            error: largest(&self.errors),
            supplied: self.drive.supplied,
            dissipated: self.drive.dissipated,
            returned: self.drive.returned,
            imbalance: self.drive.imbalance,
            end: [s.position, s.velocity, s.current, s.voltage, s.current_setpoint],
            ..AxisObservation::default()
        };
        let Some(last) = instants.checked_sub(1) else { return figures };
        let feedforward: &[f64] = if model.is_compensated { &self.feedforward } else { &[] };
        let mut differences = [0.0; ORDERS];
        let mut before = [0.0; ORDERS];
        for &step in &self.steps {
            let mut value = step;
            for (most, before) in differences.iter_mut().zip(&mut before) {
                *most = f64::max(*most, value.abs());
                value -= std::mem::replace(before, value);
            }
        }
        let bound = model.response.bound(last, differences, largest(&self.torque), largest(feedforward));
        let rounding = ROUNDING.0 * bound + ROUNDING.1 * self.farthest;
        let errors = &self.errors[..instants];
        figures.error = largest(errors);
        figures.bound = Some(bound);
        if figures.error.is_nan() || figures.error > bound + rounding {
            report((Check::Bound, figures.error, bound));
        }
        let inputs = ResponseInputs { steps: &self.steps, torque: &self.torque, feedforward };
        let worst =
            (0..instants).max_by(|&i, &j| errors[i].abs().total_cmp(&errors[j].abs())).unwrap_or(last);
        for k in [worst, last] {
            let off = (model.response.error(k, &inputs) - errors[k]).abs();
            if off.is_nan() || off > rounding {
                report((Check::Superposition, off, rounding));
            }
            figures.mismatch = figures.mismatch.max(off / rounding);
        }
        figures
    }

    /// Returns the number of leading position cycles in which the loop is linear.
    fn linear_instants(&self, model: &ReferenceModel, is_preview_exact: bool, loaded: bool) -> usize {
        let known = self.errors.len().min(model.response.periods());
        if self.limited_ticks > 0
            || (!is_preview_exact && model.preview > 0)
            || (model.has_fallback && loaded)
        {
            return 0;
        }
        if !model.has_fallback {
            return known;
        }
        let mut moved = None;
        for (k, step) in self.steps.iter().enumerate().take(known) {
            if *step != 0.0 {
                moved = Some(k);
            } else if moved.is_some_and(|moved| k - moved >= self.rest_after) {
                return k;
            }
        }
        known
    }
}
