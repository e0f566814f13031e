//! Limit audit: position, velocity, acceleration and jerk of setpoints against the limits of the
//! axes.

use crate::config::{AxisKind, LimitsConfig, MachineConfig};
use crate::path::LimitUse;
use crate::trajectory::limits::TRAVEL_TOLERANCE;
use crate::units::{Nanoseconds, seconds};

/// Setpoints of an axis that are kept for differences.
const WINDOW: usize = LimitUse::WINDOW;
/// Value of the last digit above which a number is taken as exact, m, rad or s: a recording has more digits.
const COARSEST_DIGIT: f64 = 1.001e-4;

/// Place of a setpoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetpointPlace {
    /// Time, s.
    pub time: f64,
    /// Source line, from 1.
    pub line: Option<usize>,
}

/// Largest value of a derivative, and number of setpoints beyond its limit.
#[derive(Debug, Clone, Copy)]
pub struct LargestUse {
    /// Value and limit.
    pub value: LimitUse,
    /// Last setpoint of the difference.
    pub place: SetpointPlace,
    /// Number of setpoints beyond the limit.
    pub beyond: u64,
    /// Smallest share of rounding errors in a difference, m or rad per power of second.
    pub least_rounding: f64,
}

/// Extreme position of an axis, m or rad.
#[derive(Debug, Clone, Copy)]
pub struct ExtremePosition {
    /// Position.
    pub position: f64,
    /// Setpoint with this position.
    pub place: SetpointPlace,
    /// Number of setpoints beyond the travel limit on this side.
    pub beyond: u64,
}

/// Setpoints of an axis.
#[derive(Debug, Clone)]
pub struct AuditedAxis {
    /// Name of the axis.
    pub name: String,
    /// Kind of the axis.
    pub kind: AxisKind,
    /// Limits of the axis; the jerk is unlimited if the control does not limit it.
    pub limits: LimitsConfig,
    /// Value of the last digit of the positions, m or rad; 0 for exact numbers.
    resolution: f64,
    /// Last positions, m or rad.
    window: [f64; WINDOW],
    /// Lowest and highest position; `None` before the first setpoint.
    pub extremes: Option<[ExtremePosition; 2]>,
    /// Largest velocity, acceleration and jerk; `None` before the second setpoint.
    pub largest: Option<[LargestUse; 3]>,
}

impl AuditedAxis {
    /// Adds a position, m or rad; `times` are those of the window, ns.
    fn add(
        &mut self,
        position: f64,
        times: &[Nanoseconds; WINDOW],
        place: SetpointPlace,
        time_resolution: f64,
    ) {
        self.window.rotate_left(1);
        self.window[WINDOW - 1] = position;
        let first = ExtremePosition { position, place, beyond: 0 };
        let Some([lowest, highest]) = &mut self.extremes else {
            self.window = [position; WINDOW];
            self.extremes = Some([first; 2]);
            self.count_outside(position);
            return;
        };
        if position < lowest.position {
            *lowest = ExtremePosition { beyond: lowest.beyond, ..first };
        }
        if position > highest.position {
            *highest = ExtremePosition { beyond: highest.beyond, ..first };
        }
        self.count_outside(position);
        let points = std::array::from_fn(|i| (seconds(times[i]), self.window[i]));
        let rounding = 0.5 * self.resolution + time_rounding(&points, times, time_resolution);
        let found = LimitUse::of_points(&points, rounding, &self.limits);
        let first = found.map(|value| LargestUse { value, place, beyond: 0, least_rounding: value.rounding });
        for (largest, value) in self.largest.get_or_insert(first).iter_mut().zip(found) {
            largest.beyond += u64::from(value.is_exceeded());
            largest.least_rounding = largest.least_rounding.min(value.rounding);
            if value.found > largest.value.found {
                (largest.value, largest.place) = (value, place);
            }
        }
    }

    fn count_outside(&mut self, position: f64) {
        let tolerance = TRAVEL_TOLERANCE + 0.5 * self.resolution;
        if let Some([lowest, highest]) = &mut self.extremes {
            lowest.beyond += u64::from(position < self.limits.travel_min - tolerance);
            highest.beyond += u64::from(position > self.limits.travel_max + tolerance);
        }
    }

    fn is_outside(&self) -> bool {
        self.extremes.is_some_and(|extremes| extremes.iter().any(|extreme| extreme.beyond > 0))
    }

    /// Returns the largest values of limited derivatives.
    pub fn limited(&self) -> impl Iterator<Item = &LargestUse> {
        self.largest.iter().flatten().filter(|largest| largest.value.allowed.is_finite())
    }

    /// Returns true if the setpoints of the axis move.
    pub fn moves(&self) -> bool {
        self.extremes.is_some_and(|[lowest, highest]| highest.position > lowest.position)
    }
}

/// Returns the largest error of positions by the rounding of times, m or rad: of times whose steps differ by at most
/// one digit, as those of a sampling period that the digits cannot express.
fn time_rounding(points: &[(f64, f64); WINDOW], times: &[Nanoseconds; WINDOW], resolution: f64) -> f64 {
    let steps = times.windows(2).map(|pair| pair[1] - pair[0]);
    let (least, most) =
        steps.fold((Nanoseconds::MAX, 0), |(least, most), step| (least.min(step), most.max(step)));
    if least == most || seconds(most - least) > 1.001 * resolution {
        return 0.0;
    }
    let speeds = points.windows(2).map(|pair| ((pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).abs());
    0.5 * resolution * speeds.fold(0.0, f64::max)
}

/// Audit of setpoints in constant memory. The axes rest before the first setpoint and after the last one.
#[derive(Debug, Clone)]
pub struct LimitAudit {
    axes: Vec<AuditedAxis>,
    /// Times of the last setpoints, ns.
    times: [Nanoseconds; WINDOW],
    /// Number of setpoints.
    count: u64,
    /// Place of the last setpoint.
    place: SetpointPlace,
    /// Value of the last digit of the times, s; 0 for exact numbers.
    time_resolution: f64,
}

impl LimitAudit {
    /// Creates the audit for the limits of a machine.
    pub fn new(machine: &MachineConfig) -> Self {
        let limits = |mut limits: LimitsConfig| {
            if !machine.control().has_jerk_limits() {
                limits.jerk = f64::INFINITY;
            }
            limits
        };
        let axes = machine.axes().iter().map(|axis| AuditedAxis {
            name: axis.name().to_owned(),
            kind: axis.kind(),
            limits: limits(*axis.limits()),
            resolution: 0.0,
            window: [0.0; WINDOW],
            extremes: None,
            largest: None,
        });
        Self {
            axes: axes.collect(),
            times: [0; WINDOW],
            count: 0,
            place: SetpointPlace { time: 0.0, line: None },
            time_resolution: 0.0,
        }
    }

    /// Sets the values of the last digits of the times, s, and of the positions of each axis, m or rad. Numbers whose
    /// last digit is worth more than 10⁻⁴ are exact.
    pub fn set_resolutions(&mut self, time: f64, positions: impl IntoIterator<Item = f64>) {
        self.time_resolution = if time.is_finite() { time } else { 0.0 };
        for (axis, resolution) in self.axes.iter_mut().zip(positions) {
            axis.resolution = if resolution <= COARSEST_DIGIT { resolution } else { 0.0 };
        }
    }

    /// Adds setpoints, m or rad per axis, with their time and source line. Times increase; one before 0 is that of the
    /// positions in which the axes start.
    pub fn add(&mut self, time: Nanoseconds, line: Option<usize>, psec: impl IntoIterator<Item = f64>) {
        self.place = SetpointPlace { time: seconds(time.max(0)), line };
        self.add_at(time, psec);
    }

    fn add_at(&mut self, time: Nanoseconds, psec: impl IntoIterator<Item = f64>) {
        if self.count == 1 {
            // At rest before the first setpoint.
            let (first, step) = (self.times[WINDOW - 1], time - self.times[WINDOW - 1]);
            self.times = [first - 3 * step, first - 2 * step, first - step, first];
        }
        self.times.rotate_left(1);
        self.times[WINDOW - 1] = time;
        self.count += 1;
        for (axis, position) in self.axes.iter_mut().zip(psec) {
            axis.add(position, &self.times, self.place, self.time_resolution);
        }
    }

    /// Adds the rest after the last setpoint.
    pub fn finish(&mut self) {
        if self.count < 2 {
            return;
        }
        let step = self.times[WINDOW - 1] - self.times[WINDOW - 2];
        let positions: Vec<f64> = self.axes.iter().map(|axis| axis.window[WINDOW - 1]).collect();
        for _ in 1..WINDOW {
            self.add_at(self.times[WINDOW - 1] + step, positions.iter().copied());
        }
    }

    /// Returns the axes that move or stand outside of their travel.
    pub fn moving(&self) -> impl Iterator<Item = &AuditedAxis> {
        self.axes.iter().filter(|axis| axis.moves() || axis.is_outside())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Parameters;

    const PERIOD: Nanoseconds = 6_000_000;

    /// Returns the audit of the positions of the first axis.
    fn audited(positions: impl IntoIterator<Item = (Nanoseconds, f64)>, digits: [f64; 2]) -> AuditedAxis {
        let machine = Parameters::embedded_default().unwrap().machine_config().unwrap();
        let mut audit = LimitAudit::new(&machine);
        audit.set_resolutions(digits[0], [digits[1]]);
        for (k, (time, position)) in positions.into_iter().enumerate() {
            audit.add(time, Some(100 + k), [position]);
        }
        audit.finish();
        audit.axes[0].clone()
    }

    #[test]
    fn a_step_has_the_line_time_and_size_of_its_differences() {
        let positions = (0..20).map(|k| (k * PERIOD, if k == 7 { 1e-4 } else { 0.0 }));
        let [velocity, acceleration, jerk] = audited(positions, [0.0; 2]).largest.unwrap();
        let period = seconds(PERIOD);
        for (largest, factor, order) in [(velocity, 1.0, 1), (acceleration, 2.0, 2), (jerk, 3.0, 3)] {
            let expected = factor * 1e-4 / period.powi(order);
            assert!((largest.value.found / expected - 1.0).abs() < 1e-9, "{largest:?}");
        }
        // 0.0167 m/s, 5.6 m/s², 1389 m/s³ with limits of 0.5, 2.5, 50: two, three and four differences contain the step.
        assert_eq!([velocity.beyond, acceleration.beyond, jerk.beyond], [0, 3, 4]);
        assert_eq!(acceleration.place.line, Some(108));
        assert_eq!(acceleration.place.time, 0.048);
    }

    #[test]
    fn the_axes_rest_before_the_first_and_after_the_last_setpoint() {
        let axis = audited((0..30).map(|k| (k * PERIOD, 1e-3 * k as f64)), [0.0; 2]);
        let [_, acceleration, _] = axis.largest.unwrap();
        let expected = 1e-3 / seconds(PERIOD).powi(2);
        assert!((acceleration.value.found / expected - 1.0).abs() < 1e-9);
        assert_eq!((acceleration.beyond, acceleration.place.time), (2, 0.006));
    }

    #[test]
    fn times_with_few_digits_do_not_prove_an_acceleration() {
        // Constant acceleration at 300 Hz; four decimals of the time alternate between 3.3 and 3.4 ms.
        let rows = |digits: f64| {
            (0..300).map(move |k| {
                let time = k as f64 / 300.0;
                let ramp = time.min(0.4);
                ((((time / digits).round() * digits) * 1e9).round() as Nanoseconds, 0.5 * ramp * ramp)
            })
        };
        let [_, rounded, _] = audited(rows(1e-4), [1e-4, 1e-9]).largest.unwrap();
        let [_, exact, _] = audited(rows(1e-4), [0.0, 1e-9]).largest.unwrap();
        assert!(exact.beyond > 0, "{exact:?}");
        // The stop at 0.4 s from 0.4 m/s within 3.3 ms is beyond the limit in any case.
        assert!(rounded.beyond < exact.beyond && rounded.beyond <= 2, "{rounded:?}");
    }
}
