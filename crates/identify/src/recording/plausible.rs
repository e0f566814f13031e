//! Whether a recording can be that of the axis: units, signs and columns by what goes with what.
//!
//! The bounds are wide: a machine file to begin with, an axis tuned in another way and a noisy recording pass.

use super::RecordingFault;
use super::condition::Part;
use super::lag::Moving;
use super::order::{median, quantile};
use super::regression::{Regression, correlation};
use super::spans::{CURRENT, POSITION, PSEC, VELOCITY};
use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_core::units::{DEGREE, MILLIMETER, MINUTE, RPM};

/// Strokes that a recording may cover: a machine file to begin with can be of a smaller machine.
const STROKES: f64 = 3.0;
/// Vmax that a recording may reach.
const SPEEDS: f64 = 10.0;
/// Largest currents of the motor that a recording may reach: peak values are not rms values.
const CURRENTS: f64 = 5.0;
/// The range of an axis that moves is worth its speed over this many standard deviations of the filter, noise not.
const MOTION: f64 = 20.0;
/// Part of the largest speed from which on a sample moves.
const MOVING: f64 = 0.1;
/// Correlation of what should go together.
const TOGETHER: f64 = 0.7;
/// Correlation from which on two columns are the same signal.
const SAME: f64 = 0.9995;
/// A factor within these is 1: filters and following errors change amplitudes.
const UNITY: std::ops::Range<f64> = 0.75..1.35;
/// How near a factor must be to that between two units.
const NEAR: f64 = 0.04;
/// Explained part of the variance that makes an effect worth believing.
const EFFECT: f64 = 0.05;
/// Explained part of the variance below which the current does not go with the motion.
const EXPLAINED: f64 = 0.5;
/// Part of the moving samples that each direction must have to tell friction from gravity.
const BOTH_WAYS: f64 = 0.05;
/// PSEC must come later than this, s, and than two samples, to count as swapped with the position.
const BEHIND: f64 = 5e-3;

/// Refuses what cannot be the `axis`. `deviation` is that of the filter, s.
pub(super) fn check(
    name: &str,
    parts: &[Part],
    axis: &AxisConfig,
    period: f64,
    deviation: f64,
) -> Result<(), RecordingFault> {
    let look = Look::new(name, parts, axis, deviation);
    if look.moves {
        look.velocity_goes_with_position()?;
    }
    look.within_stroke()?;
    look.within_speed()?;
    if look.moves {
        look.velocity_scale()?;
        look.psec_scale()?;
    }
    look.psec_near()?;
    if look.moves {
        look.psec_leads(period)?;
    }
    look.current_size()?;
    if look.moves {
        look.current_is_current()?;
        look.current_sign(parts)?;
    }
    Ok(())
}

/// All parts one behind the other.
struct Look<'a> {
    name: &'a str,
    axis: &'a AxisConfig,
    columns: [Option<Vec<f64>>; 4],
    velocity: Vec<f64>,
    /// Recorded velocity behind the filter, and its derivative.
    recorded: Option<(Vec<f64>, Vec<f64>)>,
    smooth_current: Option<Vec<f64>>,
    top_speed: f64,
    moves: bool,
}

impl<'a> Look<'a> {
    fn new(name: &'a str, parts: &[Part], axis: &'a AxisConfig, deviation: f64) -> Self {
        let joined = |of: &dyn Fn(&Part) -> Option<Vec<f64>>| -> Option<Vec<f64>> {
            parts.iter().map(of).collect::<Option<Vec<_>>>().map(|all| all.concat())
        };
        let columns = [POSITION, PSEC, VELOCITY, CURRENT]
            .map(|channel| joined(&|part| part.piece.columns[channel].clone()));
        let velocity: Vec<f64> = parts.iter().flat_map(|part| part.motion.first.iter().copied()).collect();
        let top_speed = quantile(&mut velocity.iter().map(|v| v.abs()).collect::<Vec<_>>(), 0.99);
        let range = columns[POSITION].as_ref().map_or(0.0, |position| travel(position));
        let filtered = |part: &Part| Some(part.filter.apply(part.piece.columns[VELOCITY].as_ref()?));
        let recorded =
            joined(&|part| Some(filtered(part)?.value)).zip(joined(&|part| Some(filtered(part)?.first)));
        Look {
            name,
            axis,
            columns,
            velocity,
            recorded,
            smooth_current: joined(&|part| part.smooth_current.clone()),
            top_speed,
            moves: range > MOTION * deviation * top_speed && top_speed > 0.0,
        }
    }

    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn unit(&self) -> &'static str {
        match self.axis.kind {
            AxisKind::Linear => "m",
            AxisKind::Rotary => "rad",
        }
    }

    /// The unit that makes numbers too large when it is taken for the SI unit.
    fn large_unit(&self) -> (&'static str, f64) {
        match self.axis.kind {
            AxisKind::Linear => ("mm", MILLIMETER),
            AxisKind::Rotary => ("deg", DEGREE),
        }
    }

    fn column(&self, channel: usize) -> &[f64] {
        self.columns[channel].as_deref().unwrap_or_default()
    }

    /// Samples at which the axis moves.
    fn moving(&self) -> impl Iterator<Item = usize> {
        let threshold = MOVING * self.top_speed;
        (0..self.velocity.len()).filter(move |&n| self.velocity[n].abs() > threshold)
    }

    /// Factor and correlation (not centerd) of the recorded velocity with the position's derivative.
    fn velocity_relation(&self) -> Option<(f64, f64)> {
        let (recorded, _) = self.recorded.as_ref()?;
        let (mut cross, mut own, mut other) = (0.0, 0.0, 0.0);
        for n in self.moving() {
            cross += recorded[n] * self.velocity[n];
            own += self.velocity[n] * self.velocity[n];
            other += recorded[n] * recorded[n];
        }
        let scale = (own * other).sqrt();
        Some((cross / own, if scale > 0.0 { cross / scale } else { 0.0 }))
    }

    fn velocity_goes_with_position(&self) -> Result<(), RecordingFault> {
        let Some((_, together)) = self.velocity_relation() else { return Ok(()) };
        let Some((recorded, derivative)) = self.recorded.as_ref() else { return Ok(()) };
        let position = self.column(POSITION);
        let looks_like = if correlation(recorded, position).abs() > SAME {
            "the column of the velocity is a position"
        } else if correlation(derivative, position).abs() > TOGETHER.max(together.abs()) {
            "position and velocity are swapped: the position is the derivative of the velocity"
        } else {
            "is its column the right one?"
        };
        if together.abs() >= TOGETHER {
            return Ok(());
        }
        let looks_like = looks_like.to_owned();
        Err(RecordingFault::VelocityUnrelated { name: self.name(), correlation: together, looks_like })
    }

    fn within_stroke(&self) -> Result<(), RecordingFault> {
        let limits = &self.axis.limits;
        let stroke = limits.stroke_max - limits.stroke_min;
        for (channel, what) in [(POSITION, "position"), (PSEC, "PSEC")] {
            let Some(values) = self.columns[channel].as_deref() else { continue };
            let travel = travel(values);
            // A NaN must not pass.
            if travel <= STROKES * stroke {
                continue;
            }
            let (large, size) = self.large_unit();
            let fits = travel * size <= STROKES * stroke;
            let key = if channel == POSITION { "position" } else { "psec" };
            let looks_like =
                if fits { format!("it looks like {large}: {key}=COLUMN[{large}]") } else { String::new() };
            return Err(RecordingFault::BeyondStroke {
                name: self.name(),
                channel: what,
                travel,
                stroke,
                unit: self.unit(),
                looks_like,
            });
        }
        Ok(())
    }

    fn within_speed(&self) -> Result<(), RecordingFault> {
        let limit = self.axis.limits.velocity;
        if self.top_speed <= SPEEDS * limit {
            return Ok(());
        }
        let (large, size) = self.large_unit();
        let looks_like = if self.top_speed * size > SPEEDS * limit {
            String::new()
        } else if self.velocity_relation().is_some_and(|(factor, _)| UNITY.contains(&factor)) {
            format!("position and velocity look like {large} and {large}/s: position=COLUMN[{large}]")
        } else {
            format!("the position looks like {large}: position=COLUMN[{large}], or the time is s read as ms")
        };
        Err(RecordingFault::TooFast {
            name: self.name(),
            velocity: self.top_speed,
            limit,
            unit: self.unit(),
            looks_like,
        })
    }

    fn velocity_scale(&self) -> Result<(), RecordingFault> {
        let Some((factor, _)) = self.velocity_relation() else { return Ok(()) };
        if UNITY.contains(&factor) {
            return Ok(());
        }
        let motor = 1.0 / self.axis.transmission_ratio.abs();
        let mut known = vec![
            (1.0, "the velocity is right but for its sign".to_owned()),
            (motor, "the velocity looks like that of the motor in rad/s; give that of the axis".to_owned()),
            (
                motor / RPM,
                "the velocity looks like that of the motor in rpm; give that of the axis".to_owned(),
            ),
        ];
        let velocity = |unit: &str| format!("the velocity looks like {unit}: velocity=COLUMN[{unit}]");
        match self.axis.kind {
            AxisKind::Linear => known.extend([
                (1.0 / MILLIMETER, velocity("mm/s")),
                (MINUTE, velocity("m/min")),
                (MINUTE / MILLIMETER, velocity("mm/min")),
                (MILLIMETER, "the position looks like mm: position=COLUMN[mm]".to_owned()),
                (MILLIMETER * MINUTE, "the position looks like mm, the velocity like m/min".to_owned()),
            ]),
            AxisKind::Rotary => known.extend([
                (1.0 / DEGREE, velocity("deg/s")),
                (1.0 / RPM, velocity("rpm")),
                (MINUTE / DEGREE, velocity("deg/min")),
                (DEGREE, "the position looks like deg: position=COLUMN[deg]".to_owned()),
                (DEGREE / RPM, "the position looks like deg, the velocity like rpm".to_owned()),
            ]),
        }
        let mut looks_like = nearest(factor, known);
        if factor < 0.0 {
            looks_like += if looks_like.is_empty() { "" } else { "; " };
            looks_like += "its sign is counted the other way: give the unit with -1";
        }
        Err(RecordingFault::VelocityScale { name: self.name(), factor, looks_like })
    }

    fn psec_scale(&self) -> Result<(), RecordingFault> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let position = self.column(POSITION);
        let together = correlation(psec, position);
        // A NaN must not pass.
        if together.is_nan() || together.abs() < TOGETHER {
            return Err(RecordingFault::PsecUnrelated { name: self.name(), correlation: together });
        }
        let factor = spread(psec) / spread(position) * together.signum();
        if UNITY.contains(&factor) {
            return Ok(());
        }
        let (large, size) = self.large_unit();
        let motor = 1.0 / self.axis.transmission_ratio.abs();
        let known = vec![
            (1.0, "PSEC is right but for its sign: psec=COLUMN with -1 before the unit".to_owned()),
            (1.0 / size, format!("PSEC looks like {large}: psec=COLUMN[{large}]")),
            (size, format!("the position looks like {large}: position=COLUMN[{large}]")),
            (motor, "PSEC looks like the angle of the motor; give that of the axis".to_owned()),
            (1.0 / motor, "the position looks like the angle of the motor; give that of the axis".to_owned()),
        ];
        Err(RecordingFault::PsecScale { name: self.name(), factor, looks_like: nearest(factor, known) })
    }

    fn psec_near(&self) -> Result<(), RecordingFault> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let position = self.column(POSITION);
        let rests = |n: &usize| !self.moves || self.velocity[*n].abs() <= MOVING * self.top_speed;
        let mut distances: Vec<f64> =
            (0..position.len()).filter(rests).map(|n| (psec[n] - position[n]).abs()).collect();
        let distance = median(&mut distances);
        let allowed = self.axis.limits.velocity / self.axis.position_loop.gain;
        if distance <= allowed {
            return Ok(());
        }
        Err(RecordingFault::PsecApart { name: self.name(), distance, allowed, unit: self.unit() })
    }

    /// The position runs after PSEC: their distance, as time, must not be negative.
    fn psec_leads(&self, period: f64) -> Result<(), RecordingFault> {
        let Some(psec) = self.columns[PSEC].as_deref() else { return Ok(()) };
        let position = self.column(POSITION);
        let columns = vec![self.velocity.clone()];
        let distances: Vec<f64> = psec.iter().zip(position).map(|(psec, position)| psec - position).collect();
        let lead = Regression::new(columns).fit(&distances).coefficients[0];
        if lead >= -BEHIND.max(2.0 * period) {
            return Ok(());
        }
        Err(RecordingFault::PsecBehind { name: self.name(), lag: -lead })
    }

    fn current_size(&self) -> Result<(), RecordingFault> {
        let Some(current) = self.columns[CURRENT].as_deref() else { return Ok(()) };
        let largest = quantile(&mut current.iter().map(|i| i.abs()).collect::<Vec<_>>(), 0.99);
        let limit = self.axis.motor.max_current;
        if largest <= CURRENTS * limit {
            return Ok(());
        }
        let looks_like =
            if largest * 1e-3 <= CURRENTS * limit { "it looks like mA: current=COLUMN[mA]" } else { "" };
        let looks_like = looks_like.to_owned();
        Err(RecordingFault::CurrentTooLarge { name: self.name(), current: largest, limit, looks_like })
    }

    fn current_is_current(&self) -> Result<(), RecordingFault> {
        let (Some(current), Some(smooth)) = (self.columns[CURRENT].as_deref(), &self.smooth_current) else {
            return Ok(());
        };
        let recorded = self.columns[VELOCITY].as_deref().map(|v| ("velocity", correlation(current, v)));
        let candidates = [
            ("position", correlation(current, self.column(POSITION))),
            ("velocity", correlation(smooth, &self.velocity)),
        ];
        for (signal, correlation) in candidates.into_iter().chain(recorded) {
            if correlation.abs() > SAME {
                return Err(RecordingFault::CurrentIsMotion { name: self.name(), signal, correlation });
            }
        }
        Ok(())
    }

    /// Friction goes with the direction of motion and inertia with the acceleration, whatever gravity does.
    fn current_sign(&self, parts: &[Part]) -> Result<(), RecordingFault> {
        if self.smooth_current.is_none() {
            return Ok(());
        }
        let moving = Moving::new(parts, self.axis.kind, 0, 0);
        let currents: Option<Vec<f64>> =
            moving.places.iter().map(|&(p, n)| Some(parts[p].smooth_current.as_ref()?[n])).collect();
        let currents = currents.unwrap_or_default();
        let whole = Regression::new(moving.columns.clone()).fit(&currents);
        let without = |left_out: &[usize]| {
            let kept = (0..moving.columns.len()).filter(|n| !left_out.contains(n));
            Regression::new(kept.map(|n| moving.columns[n].clone()).collect()).fit(&currents).r2
        };
        let speeds = &moving.columns[1];
        let forward = speeds.iter().filter(|v| **v > 0.0).count() as f64 / speeds.len().max(1) as f64;
        let common = median(&mut speeds.iter().map(|v| v.abs()).collect::<Vec<_>>());
        let friction = whole.coefficients[1] * common + whole.coefficients[2];
        let believed = |left_out: &[usize]| whole.r2 - without(left_out) > EFFECT;
        let friction_sign = if (BOTH_WAYS..=1.0 - BOTH_WAYS).contains(&forward) && believed(&[1, 2]) {
            friction.signum()
        } else {
            0.0
        };
        let inertia_sign = if believed(&[0]) { whole.coefficients[0].signum() } else { 0.0 };
        let turned = friction_sign + inertia_sign < 0.0;
        if turned && whole.r2 > EXPLAINED {
            return Err(RecordingFault::CurrentSign { name: self.name(), friction });
        }
        Ok(())
    }
}

/// What the factor looks like; empty where nothing is near.
fn nearest(factor: f64, known: Vec<(f64, String)>) -> String {
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
