//! Plausibility checks of a recording: units, signs and assignment of columns, by correlation of its
//! channels.
//!
//! The limits are wide enough for an approximate machine file, a differently tuned axis and noisy signals.

mod current;

use super::filtered_section::FilteredSection;
use super::regression::{LeastSquares, correlation};
use super::spans::{CURRENT, POSITION, PSEC, VELOCITY};
use super::{ConditioningError, StatedValues};
use virtual_axes_core::config::{AxisConfig, AxisKind, AxisUnits};
use virtual_axes_core::statistics::{median, quantile};
use virtual_axes_core::units::{DEGREE, MILLIMETER, MINUTE, RPM, Rounded};

/// Largest permitted travel relative to the travel limits; the machine file can describe a smaller machine.
const MAX_TRAVEL: f64 = 3.0;
/// Largest permitted speed relative to Vmax.
const SPEEDS: f64 = 10.0;
/// Largest travel of linear axes, m, and speed of linear and rotary axes, m/s and rad/s, of machine tools: limits where the
/// user has stated none.
const LONGEST: f64 = 20.0;
const FASTEST_LINEAR: f64 = 4.0;
const FASTEST_ROTARY: f64 = 25.0;
/// Smallest gain of a position loop, s⁻¹.
const LEAST_GAIN: f64 = 5.0;
/// Smallest travel of a moving axis, in standard deviations of the filter times its top speed; noise stays
/// below.
const MOTION: f64 = 20.0;
/// Speed, relative to the top speed, above which a sample is moving.
const MOVING: f64 = 0.1;
/// Smallest correlation of related signals.
const TOGETHER: f64 = 0.7;
/// Correlation above which two columns contain the same signal.
const SAME: f64 = 0.9995;
/// Change of a velocity in motion, relative to its value, up to which it is constant.
const CONSTANT: f64 = 1e-6;
/// Scale factors treated as 1; filters and following error change amplitudes.
const UNITY: std::ops::Range<f64> = 0.75..1.35;
/// Relative tolerance of a scale factor between two units.
const NEAR: f64 = 0.04;
/// Lag of PSEC, s, above which PSEC and position are swapped; at least two samples.
const BEHIND: f64 = 5e-3;

/// Rejects a recording that is not plausible for an axis with its stated values. `deviation` is the standard deviation of the filter,
/// s. Returns the reason if the sign of the current is inverted.
pub(super) fn check(
    name: &str,
    parts: &[FilteredSection],
    axis: (&AxisConfig, StatedValues),
    period: f64,
    deviation: f64,
) -> Result<Option<String>, ConditioningError> {
    let look = PlausibilityCheck::new(name, parts, axis, deviation);
    if look.is_moving {
        look.check_velocity_correlation()?;
    }
    look.check_travel()?;
    look.check_speed()?;
    if look.is_moving {
        look.check_velocity_scale()?;
        look.check_psec_scale()?;
    }
    look.check_psec_offset()?;
    if look.is_moving {
        look.check_psec_lead(period)?;
    }
    look.check_current_magnitude()?;
    if look.is_moving {
        look.check_current_column()?;
    }
    Ok(look.inverted_current(parts))
}

/// Concatenated signals of all sections and the checks on them.
struct PlausibilityCheck<'a> {
    name: &'a str,
    axis: &'a AxisConfig,
    stated: StatedValues,
    columns: [Option<Vec<f64>>; 4],
    velocity: Vec<f64>,
    /// Filtered recorded velocity and its derivative.
    recorded: Option<(Vec<f64>, Vec<f64>)>,
    smooth_current: Option<Vec<f64>>,
    top_speed: f64,
    is_moving: bool,
}

impl<'a> PlausibilityCheck<'a> {
    fn new(
        name: &'a str,
        parts: &[FilteredSection],
        (axis, stated): (&'a AxisConfig, StatedValues),
        deviation: f64,
    ) -> Self {
        let joined = |of: &dyn Fn(&FilteredSection) -> Option<Vec<f64>>| -> Option<Vec<f64>> {
            parts.iter().map(of).collect::<Option<Vec<_>>>().map(|all| all.concat())
        };
        let columns = [POSITION, PSEC, VELOCITY, CURRENT]
            .map(|channel| joined(&|part| part.section.columns[channel].clone()));
        let velocity: Vec<f64> = parts.iter().flat_map(|part| part.motion.first.iter().copied()).collect();
        let top_speed =
            quantile(&mut velocity.iter().map(|v| v.abs()).collect::<Vec<_>>(), 0.99).unwrap_or(0.0);
        let range = columns[POSITION].as_ref().map_or(0.0, |position| travel(position));
        let filtered =
            |part: &FilteredSection| Some(part.filter.apply(part.section.columns[VELOCITY].as_ref()?));
        let recorded =
            joined(&|part| Some(filtered(part)?.value)).zip(joined(&|part| Some(filtered(part)?.first)));
        PlausibilityCheck {
            name,
            axis,
            stated,
            columns,
            velocity,
            recorded,
            smooth_current: joined(&|part| part.smooth_current.clone()),
            top_speed,
            is_moving: range > MOTION * deviation * top_speed && top_speed > 0.0,
        }
    }

    fn error(&self, reason: String, cause: &str) -> Result<(), ConditioningError> {
        Err(ConditioningError::new(self.name, reason).with_cause(cause))
    }

    fn unit(&self) -> &'static str {
        self.axis.units().si_name
    }

    /// Returns the unit whose numbers are too large if they are read in the SI unit.
    fn large_unit(&self) -> (&'static str, f64) {
        let AxisUnits { length, length_key, .. } = self.axis.units();
        (length_key, length)
    }

    fn column(&self, channel: usize) -> &[f64] {
        self.columns[channel].as_deref().unwrap_or_default()
    }

    /// Returns the samples at which the axis moves.
    fn moving_samples(&self) -> impl Iterator<Item = usize> {
        let threshold = MOVING * self.top_speed;
        (0..self.velocity.len()).filter(move |&n| self.velocity[n].abs() > threshold)
    }

    /// Returns factor and uncentered correlation between the recorded velocity and the derivative of the
    /// position.
    fn velocity_relation(&self) -> Option<(f64, f64)> {
        let (recorded, _) = self.recorded.as_ref()?;
        let (mut cross, mut own, mut other) = (0.0, 0.0, 0.0);
        for n in self.moving_samples() {
            cross += recorded[n] * self.velocity[n];
            own += self.velocity[n] * self.velocity[n];
            other += recorded[n] * recorded[n];
        }
        let scale = (own * other).sqrt();
        Some((cross / own, if scale > 0.0 { cross / scale } else { 0.0 }))
    }

    fn check_velocity_correlation(&self) -> Result<(), ConditioningError> {
        let Some((_, together)) = self.velocity_relation() else { return Ok(()) };
        let Some((recorded, derivative)) = self.recorded.as_ref() else { return Ok(()) };
        // From the lowest to the highest tenth, without the ends of the motion.
        let range = |values: &[f64]| -> Option<[f64; 2]> {
            let mut moving: Vec<f64> = self.moving_samples().map(|n| values[n]).collect();
            Some([quantile(&mut moving, 0.1)?, quantile(&mut moving, 0.9)?])
        };
        if let (Some([low, high]), Some([slow, fast])) = (range(recorded), range(&self.velocity))
            && high - low <= CONSTANT * high.abs().max(low.abs())
            && fast - slow > MOVING * self.top_speed
        {
            let reason = format!("the velocity is constant at {} {}/s in motion", Rounded(low), self.unit());
            return self.error(reason, "the column is likely a setpoint: name another one, or rename it");
        }
        let position = self.column(POSITION);
        let looks_like = if correlation(recorded, position).abs() > SAME {
            "the velocity column contains a position"
        } else if correlation(derivative, position).abs() > TOGETHER.max(together.abs()) {
            "position and velocity are swapped: the position is the derivative of the velocity"
        } else {
            "check the velocity column"
        };
        if together.abs() >= TOGETHER {
            return Ok(());
        }
        let reason = format!(
            "the velocity does not correlate with the derivative of the position (correlation {together:.2})"
        );
        self.error(reason, looks_like)
    }

    /// Returns travel limits, m or rad, and the travel from which a recording is rejected.
    fn travel_limit(&self) -> (f64, f64) {
        let limits = &self.axis.limits;
        let range = limits.travel_max - limits.travel_min;
        match (self.stated.travel, self.axis.kind) {
            (true, _) => (range, MAX_TRAVEL * range),
            (false, AxisKind::Linear) => (LONGEST, LONGEST),
            (false, AxisKind::Rotary) => (f64::INFINITY, f64::MAX),
        }
    }

    /// Returns the speed limit, m/s or rad/s, and the speed from which a recording is rejected.
    fn speed_limit(&self) -> (f64, f64) {
        let limit = self.axis.limits.velocity;
        match (self.stated.velocity, self.axis.kind) {
            (true, _) => (limit, SPEEDS * limit),
            (false, AxisKind::Linear) => (FASTEST_LINEAR, FASTEST_LINEAR),
            (false, AxisKind::Rotary) => (FASTEST_ROTARY, FASTEST_ROTARY),
        }
    }

    fn check_travel(&self) -> Result<(), ConditioningError> {
        let (range, allowed) = self.travel_limit();
        for (channel, what) in [(POSITION, "position"), (PSEC, "PSEC")] {
            let Some(values) = self.columns[channel].as_deref() else { continue };
            let travel = travel(values);
            // A NaN fails this comparison and is rejected.
            if travel <= allowed {
                continue;
            }
            let (large, size) = self.large_unit();
            let fits = travel * size <= allowed;
            let key = if channel == POSITION { "position" } else { "psec" };
            let looks_like = if fits {
                format!("it is likely in {large}; give --column {key}=COLUMN[{large}]")
            } else {
                format!(
                    "check its unit; give it by --column '{key}=COLUMN[UNIT]', for example with a factor: [0.001 {large}]"
                )
            };
            let (unit, travel, range) = (self.unit(), Rounded(travel), Rounded(range));
            let limit = if self.stated.travel {
                "the travel limits of the axis"
            } else {
                "that of a machine tool at most"
            };
            let reason = format!("the {what} covers {travel} {unit}, {limit} {range} {unit}");
            return self.error(reason, &looks_like);
        }
        Ok(())
    }

    fn check_speed(&self) -> Result<(), ConditioningError> {
        let (limit, allowed) = self.speed_limit();
        if self.top_speed <= allowed {
            return Ok(());
        }
        let (large, size) = self.large_unit();
        let looks_like = if self.top_speed * size > allowed {
            String::new()
        } else if self.velocity_relation().is_some_and(|(factor, _)| UNITY.contains(&factor)) {
            format!(
                "position and velocity are likely in {large} and {large}/s; give --column position=COLUMN[{large}]"
            )
        } else {
            format!(
                "the position is likely in {large}; give --column position=COLUMN[{large}], or time=COLUMN[s] if the time is in s"
            )
        };
        let (unit, speed, limit) = (self.unit(), Rounded(self.top_speed), Rounded(limit));
        let of = if self.stated.velocity {
            "the limit of the axis is"
        } else {
            "that of a machine tool at most at"
        };
        let reason = format!("the position changes at {speed} {unit}/s, {of} {limit} {unit}/s");
        self.error(reason, &looks_like)
    }

    fn check_velocity_scale(&self) -> Result<(), ConditioningError> {
        let Some((factor, _)) = self.velocity_relation() else { return Ok(()) };
        if UNITY.contains(&factor) {
            return Ok(());
        }
        let motor = 1.0 / self.axis.transmission_ratio.abs();
        let mut known = vec![
            (1.0, "only the sign of the velocity is wrong".to_owned()),
            (motor, "the velocity is likely that of the motor in rad/s; record that of the axis".to_owned()),
            (
                motor / RPM,
                "the velocity is likely that of the motor in rpm; record that of the axis".to_owned(),
            ),
        ];
        let velocity =
            |unit: &str| format!("the velocity is likely in {unit}; give --column velocity=COLUMN[{unit}]");
        match self.axis.kind {
            AxisKind::Linear => known.extend([
                (1.0 / MILLIMETER, velocity("mm/s")),
                (MINUTE, velocity("m/min")),
                (MINUTE / MILLIMETER, velocity("mm/min")),
                (MILLIMETER, "the position is likely in mm; give --column position=COLUMN[mm]".to_owned()),
                (MILLIMETER * MINUTE, "the position is likely in mm, the velocity in m/min".to_owned()),
            ]),
            AxisKind::Rotary => known.extend([
                (1.0 / DEGREE, velocity("deg/s")),
                (1.0 / RPM, velocity("rpm")),
                (MINUTE / DEGREE, velocity("deg/min")),
                (DEGREE, "the position is likely in deg; give --column position=COLUMN[deg]".to_owned()),
                (DEGREE / RPM, "the position is likely in deg, the velocity in rpm".to_owned()),
            ]),
        }
        let mut looks_like = closest_cause(factor, known);
        if factor < 0.0 {
            looks_like += if looks_like.is_empty() { "" } else { "; " };
            looks_like += "its sign is inverted; give the unit with -1";
        }
        let reason = format!("the velocity is {} times the derivative of the position", Rounded(factor));
        self.error(reason, &looks_like)
    }

    fn check_psec_scale(&self) -> Result<(), ConditioningError> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let position = self.column(POSITION);
        let together = correlation(psec, position);
        // A NaN is rejected.
        if together.is_nan() || together.abs() < TOGETHER {
            let reason = format!("the position does not correlate with PSEC (correlation {together:.2})");
            return self.error(reason, "the columns are likely swapped or of another axis");
        }
        let factor = spread(psec) / spread(position) * together.signum();
        if UNITY.contains(&factor) {
            return Ok(());
        }
        let (large, size) = self.large_unit();
        let motor = 1.0 / self.axis.transmission_ratio.abs();
        let known = vec![
            (
                1.0,
                "only the sign of PSEC is wrong; give --column psec=COLUMN with -1 before the unit"
                    .to_owned(),
            ),
            (1.0 / size, format!("PSEC is likely in {large}; give --column psec=COLUMN[{large}]")),
            (size, format!("the position is likely in {large}; give --column position=COLUMN[{large}]")),
            (motor, "PSEC is likely the angle of the motor; record that of the axis".to_owned()),
            (
                1.0 / motor,
                "the position is likely the angle of the motor; record that of the axis".to_owned(),
            ),
        ];
        let reason = format!("PSEC is {} times the position", Rounded(factor));
        self.error(reason, &closest_cause(factor, known))
    }

    fn check_psec_offset(&self) -> Result<(), ConditioningError> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let position = self.column(POSITION);
        let rests = |n: &usize| !self.is_moving || self.velocity[*n].abs() <= MOVING * self.top_speed;
        let mut distances: Vec<f64> =
            (0..position.len()).filter(rests).map(|n| (psec[n] - position[n]).abs()).collect();
        let distance = median(&mut distances).unwrap_or(0.0);
        let gain = if self.stated.gain { self.axis.position_loop.gain } else { LEAST_GAIN };
        let allowed = self.speed_limit().0 / gain;
        if distance <= allowed {
            return Ok(());
        }
        let (unit, distance, allowed) = (self.unit(), Rounded(distance), Rounded(allowed));
        let reason = format!(
            "at rest PSEC and position differ by {distance} {unit}, more than the largest following error {allowed} {unit}"
        );
        self.error(reason, "record both with the same zero")
    }

    /// Rejects a PSEC that lags behind the position: the following error divided by the velocity must not be
    /// negative.
    fn check_psec_lead(&self, period: f64) -> Result<(), ConditioningError> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let lead = lead(psec, self.column(POSITION), &self.velocity);
        if lead >= -BEHIND.max(2.0 * period) {
            return Ok(());
        }
        let reason = format!(
            "PSEC lags behind the position by {} ms: the recording delays the setpoint, or the two columns are swapped",
            Rounded(-lead * 1e3)
        );
        self.error(reason, "--psec-shift auto moves PSEC by this lag, --psec-shift MS by a known one")
    }
}

/// Returns the time, s, by which PSEC leads the position, from all sections; 0 without PSEC.
pub(super) fn psec_lead(parts: &[FilteredSection]) -> f64 {
    let of = |channel: usize| -> Vec<f64> {
        parts.iter().flat_map(|part| part.section.columns[channel].iter().flatten().copied()).collect()
    };
    let velocity: Vec<f64> = parts.iter().flat_map(|part| part.motion.first.iter().copied()).collect();
    let (psec, position) = (of(PSEC), of(POSITION));
    if psec.len() == position.len() { lead(&psec, &position, &velocity) } else { 0.0 }
}

/// Returns the regression of the following error on the velocity, s.
fn lead(psec: &[f64], position: &[f64], velocity: &[f64]) -> f64 {
    let distances: Vec<f64> = psec.iter().zip(position).map(|(psec, position)| psec - position).collect();
    LeastSquares::new(vec![velocity.to_vec()]).fit(&distances).coefficients.first().copied().unwrap_or(0.0)
}

/// Returns the likely cause of a scale factor; empty if no known factor is close.
fn closest_cause(factor: f64, known: Vec<(f64, String)>) -> String {
    let distance = |of: f64| (factor.abs() / of - 1.0).abs();
    let best = known.into_iter().min_by(|a, b| distance(a.0).total_cmp(&distance(b.0)));
    best.filter(|best| distance(best.0) <= NEAR).map_or(String::new(), |best| best.1)
}

fn travel(values: &[f64]) -> f64 {
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    high - low
}

fn spread(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>().sqrt()
}
