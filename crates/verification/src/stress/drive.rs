//! The checks of a drive tick by tick: numbers, limits, friction, energy.

use super::energy::{DriveEnergy, Held};
use super::fault::Check;
use virtual_axes_core::config::{AxisConfig, AxisKind, FrictionConfig};
use virtual_axes_core::drive::Plant;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::{METER_PER_MINUTE, RPM};

/// Rounding of a balance, relative to the sum of its terms by their sizes: some hundred operations, and entries of
/// matrix exponentials.
const ROUNDING: f64 = 1e-13;
/// How far the library's exponential may be from that of the standard library, relative, and A.
const LAW: (f64, f64) = (1e-11, 1e-11);

/// What a check found, and what it allows.
pub type Broken = (Check, f64, f64);

/// One drive, under observation.
#[derive(Debug, Clone)]
pub struct DriveWatch {
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
    /// Energy that friction took, J.
    pub dissipated: f64,
    /// Energy that friction gave back over ticks of a standstill, J.
    pub returned: f64,
    /// Energy that came in: by voltage less copper, by gravity and load, J.
    pub supplied: f64,
    /// Largest imbalance of a tick, relative to what rounding is allowed.
    pub imbalance: f64,
}

/// ∓1 … ±1, and 0 of 0 as of NaN.
fn product_sign(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a.signum() * b.signum() }
}

impl DriveWatch {
    /// The drive of `axis` over ticks of `tick` s, with its `energy`.
    pub fn new(axis: &AxisConfig, tick: f64, energy: &DriveEnergy) -> Self {
        let unit = match axis.kind {
            AxisKind::Linear => METER_PER_MINUTE,
            AxisKind::Rotary => RPM,
        };
        DriveWatch {
            energy: energy.clone(),
            friction: axis.friction,
            law_speed: axis.transmission_ratio / unit,
            law_torque: axis.motor.torque_constant * axis.deviation.friction,
            torque_constant: Plant::motor(axis).torque_constant,
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

    /// Another trajectory begins.
    pub fn begin(&mut self) {
        self.before = None;
        (self.dissipated, self.returned, self.supplied, self.imbalance) = (0.0, 0.0, 0.0, 0.0);
    }

    /// Whether a setpoint is at its limit.
    pub fn is_at_limit(&self, s: &AxisSample) -> bool {
        s.velocity_setpoint.abs() == self.max_speed
            || s.current_setpoint.abs() == self.max_current
            || s.voltage.abs() == self.max_voltage
    }

    /// Looks at a tick, and tells what is wrong. Whether the friction law is looked at over the tick before is for
    /// the caller to say, since it costs two exponentials.
    ///
    /// What acted over the tick before comes back, N·m: friction, and gravity less load.
    pub fn see(&mut self, s: &AxisSample, law: bool, broken: &mut impl FnMut(Broken)) -> [f64; 2] {
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
            broken((Check::Finite, sum, f64::MAX));
        }
        for (value, limit) in [
            (s.velocity_setpoint, self.max_speed),
            (s.current_setpoint, self.max_current),
            (s.voltage, self.max_voltage),
        ] {
            if value.abs() > limit {
                broken((Check::Limits, value, limit));
            }
        }
        let at_limit = self.is_at_limit(s);
        if s.saturated != at_limit {
            broken((Check::Reported, f64::from(u8::from(s.saturated)), f64::from(u8::from(at_limit))));
        }
        let friction = s.friction_current * self.torque_constant;
        let against = (s.gravity_current + s.load_current) * self.torque_constant;
        if let Some(before) = self.before.replace(*s) {
            self.tick(&before, s, [friction, against], law, broken);
        }
        [friction, against]
    }

    /// The tick between two samples, over which `friction` and `against` (gravity less load) acted.
    fn tick(
        &mut self,
        before: &AxisSample,
        s: &AxisSample,
        [friction, against]: [f64; 2],
        law: bool,
        broken: &mut impl FnMut(Broken),
    ) {
        let (speed, end) = (before.velocity / self.ratio, s.velocity / self.ratio);
        if product_sign(friction, end) < 0.0 {
            broken((Check::FrictionSign, friction, 0.0));
        }
        if law {
            self.friction_law(speed, end, friction, broken);
        }
        let held =
            Held { current: before.current, speed, voltage: before.voltage, torque: -friction - against };
        let work = self.energy.work(&held);
        let (was, is) = (self.energy.stored(before.current, speed), self.energy.stored(s.current, end));
        let torques = [s.friction_current, s.gravity_current, s.load_current].map(f64::abs);
        let rounded = self.energy.torque_rounding(&held, self.torque_constant * torques.iter().sum::<f64>());
        let (blur, blurred) = (self.energy.speed_of(rounded), self.energy.work_of(rounded, &held));
        let allowed = ROUNDING * (was + is + work.size) + blurred;
        let imbalance = (is - was - work.done).abs();
        if imbalance.is_nan() || imbalance > allowed {
            broken((Check::Energy, imbalance, allowed));
        }
        self.imbalance = self.imbalance.max(if allowed > 0.0 { imbalance / allowed } else { 0.0 });
        let (even, uneven) = (0.5 * self.tick * speed.abs(), self.energy.uneven(&held));
        let taken = friction * work.turned;
        let standing = if product_sign(speed, end) > 0.0 { 0.0 } else { even };
        let lent = friction.abs() * (standing + uneven + self.tick * blur);
        if taken < -lent {
            broken((Check::FrictionWork, -taken, lent));
        }
        self.dissipated += taken.max(0.0);
        self.returned -= taken.min(0.0);
        self.supplied += work.done + taken;
        let way = s.position - before.position;
        let rounding = ROUNDING * self.ratio * (even + 0.5 * self.tick * end.abs() + uneven)
            + self.ratio * self.tick * blur
            + 4.0 * f64::EPSILON * (s.position.abs() + before.position.abs());
        let off = (way - self.ratio * work.turned).abs();
        if off.is_nan() || off > rounding {
            broken((Check::Position, off, rounding));
        }
    }

    /// Friction is i_f(V) at the start of the tick as long as the axis moves at its end, and no more otherwise.
    fn friction_law(&self, speed: f64, end: f64, friction: f64, broken: &mut impl FnMut(Broken)) {
        let FrictionConfig { a, b, c, d, i0 } = self.friction;
        let v = speed.abs() * self.law_speed;
        let current = if speed == 0.0 { i0 } else { a * (b * v).exp() + c * (d * v).exp() };
        let bound = current.max(0.0) * self.law_torque;
        let close = LAW.0 * bound + LAW.1 * self.law_torque;
        let (over, under) = (friction.abs() - bound, bound - friction.abs());
        if over > close || (end != 0.0 && under > close) {
            broken((Check::FrictionLaw, friction.abs(), bound));
        }
    }
}
