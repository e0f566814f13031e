//! Checks of a drive at every tick: finite signals, limits, friction, energy balance.

use super::check::Check;
use super::energy::{DriveEnergy, HeldInputs};
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig};
use virtual_axes_core::drive::Plant;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{METER_PER_MINUTE, RPM};

/// Rounding error of a balance relative to the sum of the magnitudes of its terms: some hundred operations, and the
/// entries of matrix exponentials.
const ROUNDING: f64 = 1e-13;
/// Allowed difference of the friction law from the standard library's exponential: relative, and absolute in A.
const LAW_TOLERANCE: (f64, f64) = (1e-11, 1e-11);

/// Violated check, value found and value allowed.
pub type FailedCheck = (Check, f64, f64);

/// Checker of one drive.
#[derive(Debug, Clone)]
pub struct DriveChecker {
    energy: DriveEnergy,
    friction: FrictionConfig,
    /// Speed of the axis in the unit of the friction law per ω.
    law_speed: f64,
    /// Torque per A of the friction law, N·m/A.
    law_torque: f64,
    torque_constant: f64,
    ratio: f64,
    tick: f64,
    max_current: f64,
    max_voltage: f64,
    max_speed: f64,
    before: Option<AxisSample>,
    /// Energy dissipated by friction, J.
    pub dissipated: f64,
    /// Energy returned by friction over ticks with a standstill, J.
    pub returned: f64,
    /// Energy supplied by voltage minus copper losses, by gravity and by load, J.
    pub supplied: f64,
    /// Largest energy imbalance of a tick relative to the allowed rounding error.
    pub imbalance: f64,
}

/// Returns the sign of the product: −1, 0 or 1; 0 if a factor is 0.
fn product_sign(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a.signum() * b.signum() }
}

impl DriveChecker {
    /// Creates a checker for the drive of `axis` with ticks of `tick` s and its `energy`.
    pub fn new(axis: &AxisConfig, tick: f64, energy: &DriveEnergy) -> Self {
        let unit = match axis.kind {
            AxisKind::Linear => METER_PER_MINUTE,
            AxisKind::Rotary => RPM,
        };
        DriveChecker {
            energy: energy.clone(),
            friction: axis.friction,
            law_speed: axis.transmission_ratio / unit,
            law_torque: axis.motor.torque_constant * axis.deviation.friction,
            torque_constant: Plant::deviating_motor(axis).torque_constant,
            ratio: axis.transmission_ratio,
            tick,
            max_current: axis.motor.max_current,
            max_voltage: axis.motor.max_voltage,
            max_speed: axis.motor.max_speed,
            before: None,
            dissipated: 0.0,
            returned: 0.0,
            supplied: 0.0,
            imbalance: 0.0,
        }
    }

    /// Resets the checker for the next trajectory.
    pub fn begin(&mut self) {
        self.before = None;
        (self.dissipated, self.returned, self.supplied, self.imbalance) = (0.0, 0.0, 0.0, 0.0);
    }

    /// Returns true if a setpoint is at its limit.
    pub fn is_at_limit(&self, s: &AxisSample) -> bool {
        s.velocity_setpoint.abs() == self.max_speed
            || s.current_setpoint.abs() == self.max_current
            || s.voltage.abs() == self.max_voltage
    }

    /// Checks one tick and passes violations to `report`. `law` also checks the friction law over the previous tick, which
    /// costs two exponentials.
    ///
    /// Returns the torques of the previous tick, N·m: friction, and gravity minus load.
    pub fn check_tick(
        &mut self,
        s: &AxisSample,
        law: bool,
        report: &mut impl FnMut(FailedCheck),
    ) -> [f64; 2] {
        let sum = s.position
            + s.velocity
            + s.current
            + s.current_setpoint
            + s.voltage
            + s.velocity_setpoint
            + s.velocity_feedforward
            + s.torque_feedforward
            + s.friction_current
            + s.gravity_current
            + s.load_current
            + s.effort
            + s.psec
            + s.delayed_psec;
        if !sum.is_finite() {
            report((Check::Finite, sum, f64::MAX));
        }
        for (value, limit) in [
            (s.velocity_setpoint, self.max_speed),
            (s.current_setpoint, self.max_current),
            (s.voltage, self.max_voltage),
        ] {
            if value.abs() > limit {
                report((Check::Limits, value, limit));
            }
        }
        let at_limit = self.is_at_limit(s);
        if s.saturated != at_limit {
            report((Check::Reported, f64::from(u8::from(s.saturated)), f64::from(u8::from(at_limit))));
        }
        let friction = s.friction_current * self.torque_constant;
        let against = (s.gravity_current + s.load_current) * self.torque_constant;
        if let Some(before) = self.before.replace(*s) {
            self.tick(&before, s, [friction, against], law, report);
        }
        [friction, against]
    }

    /// Checks the tick between two samples with `friction` and `against` (gravity minus load), N·m.
    fn tick(
        &mut self,
        before: &AxisSample,
        s: &AxisSample,
        [friction, against]: [f64; 2],
        law: bool,
        report: &mut impl FnMut(FailedCheck),
    ) {
        let (speed, end) = (before.velocity / self.ratio, s.velocity / self.ratio);
        if product_sign(friction, end) < 0.0 {
            report((Check::FrictionSign, friction, 0.0));
        }
        if law {
            self.friction_law(speed, end, friction, report);
        }
        let held = HeldInputs {
            current: before.current,
            speed,
            voltage: before.voltage,
            torque: -friction - against,
        };
        let work = self.energy.work(&held);
        let (was, is) = (self.energy.stored(before.current, speed), self.energy.stored(s.current, end));
        let torques = [s.friction_current, s.gravity_current, s.load_current].map(f64::abs);
        let rounded = self.energy.torque_rounding(&held, self.torque_constant * torques.iter().sum::<f64>());
        let (blur, blurred) = (self.energy.speed_of(rounded), self.energy.work_of(rounded, &held));
        let allowed = ROUNDING * (was + is + work.size) + blurred;
        let imbalance = (is - was - work.done).abs();
        if imbalance.is_nan() || imbalance > allowed {
            report((Check::Energy, imbalance, allowed));
        }
        self.imbalance = self.imbalance.max(if allowed > 0.0 { imbalance / allowed } else { 0.0 });
        let (even, uneven) = (0.5 * self.tick * speed.abs(), self.energy.uneven(&held));
        let dissipated = friction * work.turned;
        let standing = if product_sign(speed, end) > 0.0 { 0.0 } else { even };
        let allowed_return = friction.abs() * (standing + uneven + self.tick * blur);
        if dissipated < -allowed_return {
            report((Check::FrictionWork, -dissipated, allowed_return));
        }
        self.dissipated += dissipated.max(0.0);
        self.returned -= dissipated.min(0.0);
        self.supplied += work.done + dissipated;
        let moved = s.position - before.position;
        let rounding = ROUNDING * self.ratio * (even + 0.5 * self.tick * end.abs() + uneven)
            + self.ratio * self.tick * blur
            + 4.0 * f64::EPSILON * (s.position.abs() + before.position.abs());
        let difference = (moved - self.ratio * work.turned).abs();
        if difference.is_nan() || difference > rounding {
            report((Check::Position, difference, rounding));
        }
    }

    /// Checks that friction equals i_f(V) at the start of the tick if the axis moves at its end, and is at most that
    /// otherwise.
    fn friction_law(&self, speed: f64, end: f64, friction: f64, report: &mut impl FnMut(FailedCheck)) {
        let FrictionConfig { a, b, c, d, i0 } = self.friction;
        let v = speed.abs() * self.law_speed;
        let current = if speed == 0.0 { i0 } else { a * (b * v).exp() + c * (d * v).exp() };
        let bound = current.max(0.0) * self.law_torque;
        let close = LAW_TOLERANCE.0 * bound + LAW_TOLERANCE.1 * self.law_torque;
        let (over, under) = (friction.abs() - bound, bound - friction.abs());
        if over > close || (end != 0.0 && under > close) {
            report((Check::FrictionLaw, friction.abs(), bound));
        }
    }
}
