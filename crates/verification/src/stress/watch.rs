//! An axis under observation over a whole trajectory.

use super::drive::{Broken, DriveWatch};
use super::fault::Check;
use super::fleet::{MOST_TICKS, Theory};
use super::response::{Inputs, ORDERS};
use virtual_axes_core::config::{AxisConfig, LimitsConfig, Periods};
use virtual_axes_core::machine::{Activity, AxisSample, REST_AFTER};
use virtual_axes_core::trajectory::limits::SPEED_TOLERANCE;
use virtual_axes_core::units::seconds;

/// Rounding of an error, relative to its bound, and to the position: that of thousands of ticks.
const ROUNDING: (f64, f64) = (1e-9, 1e-12);

/// What an axis came to.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisFigures {
    /// Ticks at a limit.
    pub limited_ticks: u64,
    /// Largest |i|, A.
    pub peak_current: f64,
    /// Largest synchronized tracking error at a position instant, m or rad.
    pub error: f64,
    /// Its bound, m or rad; none where the loop was not linear: a limit acted, or the guard.
    pub bound: Option<f64>,
    /// How far the error is from what the impulse responses make, relative to what rounding is allowed.
    pub mismatch: f64,
    /// Energy that came in, J.
    pub supplied: f64,
    /// Energy that friction took, J.
    pub dissipated: f64,
    /// Energy that friction gave back over ticks of a standstill, J.
    pub returned: f64,
    /// Largest imbalance of energy in a tick, relative to what rounding is allowed.
    pub imbalance: f64,
    /// Where it ended: m or rad, m/s or rad/s, A, V, A.
    pub end: [f64; 5],
}

/// One axis.
#[derive(Debug, Clone)]
pub struct AxisWatch {
    pub drive: DriveWatch,
    limits: LimitsConfig,
    period: f64,
    /// [`REST_AFTER`], position periods: the loop is linear until then.
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
    of_period: (u64, f64),
    last: AxisSample,
}

impl AxisWatch {
    /// An axis of which `theory` is known.
    pub fn new(axis: &AxisConfig, periods: &Periods, theory: &Theory) -> Self {
        AxisWatch {
            drive: DriveWatch::new(axis, seconds(periods.current), &theory.energy),
            limits: axis.limits,
            period: seconds(periods.position),
            rest_after: (REST_AFTER / periods.position) as usize,
            velocity_ticks: periods.ticks_per_velocity() as usize,
            gravity: 0.0,
            psec: 0.0,
            farthest: 0.0,
            steps: Vec::new(),
            errors: Vec::new(),
            torque: Vec::with_capacity(MOST_TICKS),
            feedforward: Vec::new(),
            ticks: 0,
            limited_ticks: 0,
            peak_current: 0.0,
            of_period: (0, 0.0),
            last: AxisSample::default(),
        }
    }

    /// Another trajectory begins, at `position`, m or rad.
    pub fn begin(&mut self, position: f64) {
        self.drive.begin();
        for list in [&mut self.steps, &mut self.errors, &mut self.torque, &mut self.feedforward] {
            list.clear();
        }
        (self.psec, self.farthest, self.gravity) = (position, position.abs(), 0.0);
        (self.ticks, self.limited_ticks, self.peak_current) = (0, 0, 0.0);
        self.of_period = (0, 0.0);
        self.last = AxisSample { position, ..AxisSample::default() };
    }

    /// Ticks that were seen.
    pub fn ticks(&self) -> usize {
        self.ticks
    }

    /// A tick; `instant` tells the first of a position period, `second` the one behind it.
    pub fn see(&mut self, s: &AxisSample, [instant, second]: [bool; 2], broken: &mut impl FnMut(Broken)) {
        let [friction, against] = self.drive.see(s, second, broken);
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
                broken((Check::SetpointSpeed, step, most));
            }
            self.psec = s.psec;
            self.steps.push(step);
            self.errors.push(s.synchronized_tracking_error());
            self.of_period = (0, 0.0);
        }
        if self.ticks.is_multiple_of(self.velocity_ticks) {
            self.feedforward.push(s.torque_feedforward);
        }
        self.of_period.0 += u64::from(self.drive.is_at_limit(s));
        self.of_period.1 = self.of_period.1.max(s.current.abs());
        self.farthest = self.farthest.max(s.position.abs());
        self.ticks += 1;
        self.last = *s;
    }

    /// The end of a position period, of which the machine says this.
    pub fn end_period(&mut self, activity: &Activity, broken: &mut impl FnMut(Broken)) {
        let (limited, peak) = self.of_period;
        if activity.saturated_ticks != limited {
            broken((Check::Counted, activity.saturated_ticks as f64, limited as f64));
        }
        if activity.peak_current != peak {
            broken((Check::Counted, activity.peak_current, peak));
        }
        self.limited_ticks += limited;
        self.peak_current = self.peak_current.max(peak);
    }

    /// Ticks at a limit in the position period that ended last.
    pub fn limited_in_period(&self) -> u64 {
        self.of_period.0
    }

    /// The end of the trajectory. `foreseen`: the setpoints came as they could be foreseen; `loaded`: the axis met a
    /// load.
    pub fn finish(
        &self,
        theory: &Theory,
        foreseen: bool,
        loaded: bool,
        broken: &mut impl FnMut(Broken),
    ) -> AxisFigures {
        let instants = self.linear_instants(theory, foreseen, loaded);
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let s = &self.last;
        let mut figures = AxisFigures {
            limited_ticks: self.limited_ticks,
            peak_current: self.peak_current,
            error: largest(&self.errors),
            bound: None,
            mismatch: 0.0,
            supplied: self.drive.supplied,
            dissipated: self.drive.dissipated,
            returned: self.drive.returned,
            imbalance: self.drive.imbalance,
            end: [s.position, s.velocity, s.current, s.voltage, s.current_setpoint],
        };
        let Some(last) = instants.checked_sub(1) else { return figures };
        let feedforward: &[f64] = if theory.compensated { &self.feedforward } else { &[] };
        let mut differences = [0.0; ORDERS];
        let mut before = [0.0; ORDERS];
        for &step in &self.steps {
            let mut value = step;
            for (most, before) in differences.iter_mut().zip(&mut before) {
                *most = f64::max(*most, value.abs());
                value -= std::mem::replace(before, value);
            }
        }
        let bound = theory.response.bound(last, differences, largest(&self.torque), largest(feedforward));
        let rounding = ROUNDING.0 * bound + ROUNDING.1 * self.farthest;
        let errors = &self.errors[..instants];
        figures.error = largest(errors);
        figures.bound = Some(bound);
        if figures.error.is_nan() || figures.error > bound + rounding {
            broken((Check::Bound, figures.error, bound));
        }
        let inputs = Inputs { steps: &self.steps, torque: &self.torque, feedforward };
        let worst =
            (0..instants).max_by(|&i, &j| errors[i].abs().total_cmp(&errors[j].abs())).unwrap_or(last);
        for k in [worst, last] {
            let off = (theory.response.error(k, &inputs) - errors[k]).abs();
            if off.is_nan() || off > rounding {
                broken((Check::Superposition, off, rounding));
            }
            figures.mismatch = figures.mismatch.max(off / rounding);
        }
        figures
    }

    /// How many of the first position instants are those of the linear loop.
    fn linear_instants(&self, theory: &Theory, foreseen: bool, loaded: bool) -> usize {
        let known = self.errors.len().min(theory.response.periods());
        if self.limited_ticks > 0 || (!foreseen && theory.ahead > 0) || (theory.guarded && loaded) {
            return 0;
        }
        if !theory.guarded {
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
