//! Friction law: double exponential of velocity with breakaway at standstill.

use super::elementary::Exponential;
use super::friction_expansion::{FrictionExpansion, SumOfExponentials};
use crate::config::{AxisConfig, AxisKind, FrictionConfig, StribeckConfig};
use crate::simd::{SimdReal, soa_struct};
use crate::units::{METER_PER_MINUTE, RPM};

/// Motor speed up to which the Stribeck and viscous terms are evaluated, rad/s.
const MAX_SPEED: f64 = 1e9;
/// Velocity up to which the friction law was fitted, m/min or rev/min (Prévost eq. 3).
const FITTED_RANGE: f64 = 20.0;

soa_struct! {
    /// Double-exponential friction law of one axis as a function of motor speed (Prévost eq. 3).
    ///
    /// ```text
    /// i_f(V) = a e^{bV} + c e^{dV}  for V > 0, odd in V          |i_f(0)| ≤ i0          torque = Kt i_f
    /// ```
    ///
    /// V is in m/min (linear axis) or rev/min (rotary axis). `s e^{−(V/Vs)²} + v V` is added, if the axis has it.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Friction {
        moving: SumOfExponentials<N>,
        /// Kt i0, N·m.
        breakaway: N,
        /// Largest speed of expansion, rad/s.
        max_expanded_speed: N,
        /// Speed from which on the law is constant, at the end of the last expansion, rad/s.
        constant_from_speed: N,
        /// Speed up to which the law was fitted, rad/s.
        fitted_range: N,
        /// Kt s e^{−x}, with x = (ω/ωs)², N·m.
        stribeck: Exponential<N>,
        /// 1/ωs, s/rad.
        per_stribeck_speed: N,
        /// Kt v per speed of the motor, N·m·s/rad.
        viscosity: N,
    }
}

/// Returns the unit of V, m/s or rad/s of the axis.
fn velocity_unit(kind: AxisKind) -> f64 {
    match kind {
        AxisKind::Linear => METER_PER_MINUTE,
        AxisKind::Rotary => RPM,
    }
}

impl Friction {
    /// Creates the friction law of an axis of `kind` with a transmission ratio r (m or rad per rad of the motor).
    ///
    /// With `torque_constant` Kt in N·m/A the friction is in N·m; another factor gives it in another unit per ampere.
    pub fn new(law: FrictionConfig, kind: AxisKind, transmission_ratio: f64, torque_constant: f64) -> Self {
        let unit = velocity_unit(kind);
        // V per ω of the motor.
        let velocity = transmission_ratio / unit;
        let none = Exponential::new(0.0, 0.0);
        let exponential = |size: f64, rate: f64| Exponential::new(torque_constant * size, rate * velocity);
        let moving = SumOfExponentials::new(exponential(law.a, law.b), exponential(law.c, law.d));
        Friction {
            moving,
            breakaway: torque_constant * law.i0,
            max_expanded_speed: moving.max_expanded_speed(),
            constant_from_speed: moving.constant_from_speed(),
            fitted_range: FITTED_RANGE / velocity,
            stribeck: none,
            per_stribeck_speed: 0.0,
            viscosity: 0.0,
        }
    }

    /// Creates the friction law of an axis with its Stribeck and viscous terms; see [`new`](Self::new).
    pub fn of_axis(axis: &AxisConfig, torque_constant: f64) -> Self {
        let (r, StribeckConfig { current, velocity, viscous }) = (axis.transmission_ratio, axis.stribeck);
        let unit = velocity_unit(axis.kind);
        Friction {
            stribeck: Exponential::new(torque_constant * current, -1.0),
            per_stribeck_speed: r / (velocity * unit),
            viscosity: torque_constant * viscous * r / unit,
            ..Friction::new(axis.friction, axis.kind, r, torque_constant)
        }
    }

    /// Returns the law of presliding, without viscous term and breakaway, and the coefficient of that term, N·m·s/rad.
    pub fn of_presliding(self) -> (Self, f64) {
        let at_rest = self.moving.at(0.0) + self.stribeck.at(0.0);
        (Friction { viscosity: 0.0, breakaway: at_rest.max(0.0), ..self }, self.viscosity)
    }

    /// Returns true if the law has a Stribeck or viscous term.
    pub fn has_stribeck_terms(&self) -> bool {
        self.viscosity > 0.0 || self.stribeck.at(0.0) > 0.0
    }

    /// Returns the largest friction torque at motor speed ω (rad/s), N·m; it is not negative.
    #[inline(always)]
    pub fn bound(&self, speed: f64) -> f64 {
        let moving = self.moving.at(speed.abs().min(self.constant_from_speed));
        self.limit_to_resisting(speed, moving + self.stribeck_terms(speed))
    }

    /// Returns true if the law is extrapolated at motor speed ω (rad/s).
    #[inline(always)]
    pub fn is_extrapolated(&self, speed: f64) -> bool {
        speed.abs() > self.fitted_range
    }
}

impl<N: SimdReal> Friction<N> {
    /// Expands the law near motor speed ω, rad/s.
    #[inline(always)]
    pub(crate) fn expand(&self, speed: N) -> FrictionExpansion<N> {
        self.moving.expand(self.max_expanded_speed.min(speed.abs()))
    }

    /// Returns the largest friction torque at motor speed ω (rad/s), N·m, from `expansion`.
    ///
    /// Renews the expansion in the lanes whose speed is out of its range, and only there.
    #[inline(always)]
    pub(crate) fn bound_with_expansion(&self, expansion: &mut FrictionExpansion<N>, speed: N) -> N {
        let moving = self.expanded(expansion, speed);
        self.limit_to_resisting(speed, moving)
    }

    /// Returns the largest friction torque with the Stribeck and viscous terms; see
    /// [`bound_with_expansion`](Self::bound_with_expansion).
    #[inline(always)]
    pub(crate) fn bound_with_stribeck_terms(&self, expansion: &mut FrictionExpansion<N>, speed: N) -> N {
        let moving = self.expanded(expansion, speed);
        self.limit_to_resisting(speed, moving + self.stribeck_terms(speed))
    }

    /// Returns the Stribeck and viscous terms at motor speed ω (rad/s), N·m.
    #[inline(always)]
    fn stribeck_terms(&self, speed: N) -> N {
        let size = speed.abs().min(speed.splat(MAX_SPEED));
        let ratio = size * self.per_stribeck_speed;
        self.viscosity.mul_add(size, self.stribeck.at(ratio * ratio))
    }

    /// Returns the two exponentials at motor speed ω (rad/s) from `expansion`, N·m.
    #[inline(always)]
    fn expanded(&self, expansion: &mut FrictionExpansion<N>, speed: N) -> N {
        let size = speed.abs();
        let mut distance = self.moving.distance(expansion, size);
        if FrictionExpansion::any_out_of_range(distance) {
            let next = self.expand(self.moving.next_center(size, distance));
            *expansion = next.select(FrictionExpansion::out_of_range(distance), *expansion);
            distance = FrictionExpansion::clamp_to_range(self.moving.distance(expansion, size));
        }
        expansion.at(distance)
    }

    /// Returns the friction torque bound at motor speed ω (rad/s): breakaway at ω = 0; a negative bound is set to 0.
    #[inline(always)]
    fn limit_to_resisting(&self, speed: N, moving: N) -> N {
        let zero = speed.splat(0.0);
        let moves = zero.simd_lt(speed.abs());
        // An extrapolated law can change its sign; friction that drives is set to 0.
        moving.select(moves, zero).max(zero.select(moves, self.breakaway))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{AxisConfig, Parameters};

    /// Evaluates the published law with the exponential of the standard library, A.
    fn published(law: &FrictionConfig, v: f64) -> f64 {
        law.a * (law.b * v).exp() + law.c * (law.d * v).exp()
    }

    /// Five times the fitted range, above the largest speed of every axis, m/min or rev/min.
    const FASTEST: f64 = 5.0 * FITTED_RANGE;

    /// Returns the axes of the default machine with their friction in A (Kt = 1) over m/min or rev/min.
    fn shipped() -> Vec<(AxisConfig, Friction)> {
        let config = Parameters::embedded_default()
            .and_then(|p| p.machine_config())
            .expect("the embedded machine is valid");
        let with_friction = |axis: &AxisConfig| {
            let unit = if axis.kind == AxisKind::Linear { METER_PER_MINUTE } else { RPM };
            (axis.clone(), Friction::new(axis.friction, axis.kind, unit, 1.0))
        };
        config.axes().iter().map(with_friction).collect()
    }

    #[test]
    fn friction_law_is_within_1e_12_a_of_the_published_one() {
        for (axis, friction) in shipped() {
            for k in 1..=1_000_000 {
                let v = FASTEST * f64::from(k) * 1e-6;
                let (found, exact) = (friction.bound(v), published(&axis.friction, v));
                assert!((found - exact).abs() <= 1e-12, "{}: {found} A at {v}, not {exact} A", axis.name);
                assert_eq!(found.to_bits(), friction.bound(-v).to_bits());
            }
            assert_eq!(friction.bound(0.0), axis.friction.i0);
        }
    }

    /// Returns the friction bounds at successive `speeds`, from one expansion that follows them.
    fn bounds_with_expansion(
        friction: &Friction,
        speeds: impl Iterator<Item = f64>,
    ) -> impl Iterator<Item = (f64, f64)> {
        let mut expansion = friction.expand(0.0);
        speeds.map(move |speed| (speed, friction.bound_with_expansion(&mut expansion, speed)))
    }

    #[test]
    fn expanded_friction_law_is_within_1e_12_a_of_the_published_one() {
        for (axis, friction) in shipped() {
            // Oscillating speeds with small and large steps: within one expansion, and over several.
            let slow = (0..2_000_000).map(|k| FASTEST * (1e-5 * f64::from(k)).sin());
            let jumping = (0..100_000).map(|k| FASTEST * (0.37 * f64::from(k)).sin());
            for (v, found) in bounds_with_expansion(&friction, slow.chain(jumping)) {
                let exact = if v == 0.0 { axis.friction.i0 } else { published(&axis.friction, v.abs()) };
                assert!((found - exact).abs() <= 1e-12, "{}: {found} A at {v}, not {exact} A", axis.name);
            }
        }
    }

    #[test]
    fn steep_fall_after_breakaway_keeps_the_other_exponential_accurate() {
        // The steepest allowed exponents, at the sizes that result from short ticks.
        for d in [-100.0, -35.0, -1e-9] {
            for b in [0.02, 1.0, 0.0, -100.0] {
                let law = FrictionConfig { a: 1.5, b, c: -0.5, d, i0: 1.0 };
                for constant in [1e9, 1.0, 1e-9, 1e-25] {
                    let friction = Friction::new(law, AxisKind::Linear, METER_PER_MINUTE, constant);
                    let fast =
                        (0..40_000).map(|k| 1e-3 * f64::from(k)).chain((0..200).map(|k| 2.9 * f64::from(k)));
                    for (v, found) in bounds_with_expansion(&friction, fast) {
                        let exact = if v == 0.0 { law.i0 } else { published(&law, v).max(0.0) };
                        let off = (found / constant - exact).abs();
                        assert!(
                            off <= 1e-12 * exact.max(1.0),
                            "{law:?}: {} A at {v}, not {exact}",
                            found / constant
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn strong_friction_at_extreme_speeds_is_finite_and_not_negative() {
        for (a, c) in [(1e4, -1e4), (1e4, 1e4), (1e-300, 1e4)] {
            for (b, d) in [(1.0, 0.99), (1.0, -100.0), (-100.0, -100.0), (1e-300, -100.0)] {
                let law = FrictionConfig { a, b, c, d, i0: 1.0 };
                // Kt 10⁵ and a torque that changes the speed by 10⁹ in a tick.
                let friction = Friction::new(law, AxisKind::Linear, METER_PER_MINUTE, 1e14);
                for speed in [1.0, 6.0, 7.1, 650.0, 1e5, 1e12, 1e300, f64::MAX] {
                    let whole = friction.bound(speed);
                    let (_, expansion) =
                        bounds_with_expansion(&friction, [speed].into_iter()).next().expect("there is one");
                    assert!(whole.is_finite() && whole >= 0.0, "{law:?}: {whole} at {speed}");
                    let size = 1e14 * (a.abs() + c.abs()) * (b.max(d).max(0.0) * speed.min(600.0)).exp();
                    assert!(
                        (expansion - whole).abs() <= 1e-12 * size,
                        "{law:?}: {expansion:e} and {whole:e} at {speed}"
                    );
                }
            }
        }
    }

    #[test]
    fn friction_law_that_overflows_is_finite_and_never_drives() {
        let law = |a, c| FrictionConfig { a, b: 0.5, c, d: 0.7, i0: 1.0 };
        for speed in [1.0, 1e3, 1e9, f64::MAX, f64::INFINITY] {
            let strong = Friction::new(law(1.0, 1.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert!(strong.is_finite() && strong > 0.0, "{strong} at {speed}");
            let friction = Friction::new(law(1.0, 1.0), AxisKind::Linear, 1.0, 1.0);
            let (_, expanded) =
                bounds_with_expansion(&friction, [speed].into_iter()).next().expect("there is one");
            assert!((expanded / strong - 1.0).abs() <= 1e-12, "{expanded}, not {strong} at {speed}");
            let turned = Friction::new(law(1.0, -2.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert_eq!(turned, 0.0, "at {speed}");
        }
        let constant = FrictionConfig { b: 0.0, d: 0.0, ..law(2.0, -0.5) };
        let bound = Friction::new(constant, AxisKind::Linear, 1.0, 1.0).bound(1e300);
        assert!((bound - 1.5).abs() <= 1e-12, "{bound} A");
    }
}
