//! Friction as a function of velocity, and how it acts over one tick.

use super::elementary::Exponential;
use super::expansion::{Expansion, Pair};
use crate::config::{AxisKind, FrictionConfig};
use crate::simd::{Number, numbers};
use crate::units::{METER_PER_MINUTE, RPM};

/// Velocity up to which the law was fitted, m/min or rev/min (Prévost eq. 3).
const FITTED_RANGE: f64 = 20.0;

numbers! {
    /// Double-exponential friction law of one axis, seen from its motor.
    ///
    /// (Prévost eq. 3) `i_f(V) = a e^{bV} + c e^{dV}` for V > 0, odd in V; at standstill any value within
    /// ±i0. V is in m/min (linear axis) or rev/min (rotary axis). The torque is `Kt i_f`.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Friction {
        moving: Pair<N>,
        /// Kt i0, N·m.
        breakaway: N,
        /// Speed beyond which it is not expanded, rad/s.
        capped_from: N,
        /// Speed from which on the law stays as it is: as far as the last expansion holds, rad/s.
        level_from: N,
        /// Speed up to which the law was fitted, rad/s.
        fitted_to: N,
    }
}

impl Friction {
    /// Friction of an axis of `kind` behind a transmission of ratio r (m or rad per rad of the motor),
    /// whose motor has `torque_constant` Kt in N·m/A. (With another constant the bound is in its unit.)
    pub fn new(law: FrictionConfig, kind: AxisKind, transmission_ratio: f64, torque_constant: f64) -> Self {
        let unit = match kind {
            AxisKind::Linear => METER_PER_MINUTE,
            AxisKind::Rotary => RPM,
        };
        // V per ω of the motor.
        let velocity = transmission_ratio / unit;
        let exponential = |size: f64, rate: f64| Exponential::new(torque_constant * size, rate * velocity);
        let moving = Pair::new(exponential(law.a, law.b), exponential(law.c, law.d));
        Friction {
            moving,
            breakaway: torque_constant * law.i0,
            capped_from: moving.capped_from(),
            level_from: moving.level_from(),
            fitted_to: FITTED_RANGE / velocity,
        }
    }

    /// Largest friction torque at motor speed ω (rad/s), N·m; never negative.
    pub fn bound(&self, speed: f64) -> f64 {
        self.resisting(speed, self.moving.at(speed.abs().min(self.level_from)))
    }

    /// Whether the law is extrapolated at motor speed ω (rad/s).
    #[inline(always)]
    pub fn is_extrapolated(&self, speed: f64) -> bool {
        speed.abs() > self.fitted_to
    }
}

impl<N: Number> Friction<N> {
    /// The law near motor speed ω, rad/s.
    #[inline(always)]
    pub(crate) fn near(&self, speed: N) -> Expansion<N> {
        self.moving.near(self.capped_from.min(speed.abs()))
    }

    /// Largest friction torque at motor speed ω (rad/s), N·m. Where the expansion at hand does not hold it is
    /// renewed, and nowhere else.
    #[inline(always)]
    pub(crate) fn bound_near(&self, near: &mut Expansion<N>, speed: N) -> N {
        let size = speed.abs();
        let mut distance = self.moving.distance(near, size);
        if Expansion::is_left(distance) {
            let next = self.near(self.moving.ahead(size, distance));
            *near = near.or(next, Expansion::left(distance));
            distance = Expansion::within(self.moving.distance(near, size));
        }
        self.resisting(speed, near.at(distance))
    }

    #[inline(always)]
    fn resisting(&self, speed: N, moving: N) -> N {
        let nothing = speed.constant(0.0);
        let moves = nothing.less(speed.abs());
        // Extrapolated, the law may change its sign.
        moving.select(moves, nothing).max(nothing.select(moves, self.breakaway))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{AxisConfig, Parameters};

    /// The law as it is printed, with the exponential of the standard library, A.
    fn printed(law: &FrictionConfig, v: f64) -> f64 {
        law.a * (law.b * v).exp() + law.c * (law.d * v).exp()
    }

    /// Five times the range that the law was fitted for: as fast as any of the axes goes, m/min or rev/min.
    const FASTEST: f64 = 5.0 * FITTED_RANGE;

    /// The axes of the default machine with their friction in A, Kt being 1, over m/min or rev/min.
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
    fn the_law_is_within_1e_12_a_of_what_is_printed() {
        for (axis, friction) in shipped() {
            for k in 1..=1_000_000 {
                let v = FASTEST * f64::from(k) * 1e-6;
                let (found, exact) = (friction.bound(v), printed(&axis.friction, v));
                assert!((found - exact).abs() <= 1e-12, "{}: {found} A at {v}, not {exact} A", axis.name);
                assert_eq!(found.to_bits(), friction.bound(-v).to_bits());
            }
            assert_eq!(friction.bound(0.0), axis.friction.i0);
        }
    }

    /// The bound at each of `speeds`, one after the other, as an axis finds it on its way.
    fn on_the_way(
        friction: &Friction,
        speeds: impl Iterator<Item = f64>,
    ) -> impl Iterator<Item = (f64, f64)> {
        let mut near = friction.near(0.0);
        speeds.map(move |speed| (speed, friction.bound_near(&mut near, speed)))
    }

    #[test]
    fn the_law_is_as_near_to_what_is_printed_where_it_is_expanded() {
        for (axis, friction) in shipped() {
            // To and fro with steps of every size: many within an expansion, some over several of them.
            let slow = (0..2_000_000).map(|k| FASTEST * (1e-5 * f64::from(k)).sin());
            let jumping = (0..100_000).map(|k| FASTEST * (0.37 * f64::from(k)).sin());
            for (v, found) in on_the_way(&friction, slow.chain(jumping)) {
                let exact = if v == 0.0 { axis.friction.i0 } else { printed(&axis.friction, v.abs()) };
                assert!((found - exact).abs() <= 1e-12, "{}: {found} A at {v}, not {exact} A", axis.name);
            }
        }
    }

    #[test]
    fn a_steep_fall_after_breakaway_does_not_freeze_the_rest_of_the_law() {
        // The steepest fall and rise that a machine may have, over the sizes that short ticks make of them.
        for d in [-100.0, -35.0, -1e-9] {
            for b in [0.02, 1.0, 0.0, -100.0] {
                let law = FrictionConfig { a: 1.5, b, c: -0.5, d, i0: 1.0 };
                for constant in [1e9, 1.0, 1e-9, 1e-25] {
                    let friction = Friction::new(law, AxisKind::Linear, METER_PER_MINUTE, constant);
                    let fast =
                        (0..40_000).map(|k| 1e-3 * f64::from(k)).chain((0..200).map(|k| 2.9 * f64::from(k)));
                    for (v, found) in on_the_way(&friction, fast) {
                        let exact = if v == 0.0 { law.i0 } else { printed(&law, v).max(0.0) };
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
    fn a_strong_law_at_speeds_beyond_sense_is_a_number_that_resists() {
        for (a, c) in [(1e4, -1e4), (1e4, 1e4), (1e-300, 1e4)] {
            for (b, d) in [(1.0, 0.99), (1.0, -100.0), (-100.0, -100.0), (1e-300, -100.0)] {
                let law = FrictionConfig { a, b, c, d, i0: 1.0 };
                // Kt 10⁵ and a torque that changes the speed by 10⁹ in a tick.
                let friction = Friction::new(law, AxisKind::Linear, METER_PER_MINUTE, 1e14);
                for speed in [1.0, 6.0, 7.1, 650.0, 1e5, 1e12, 1e300, f64::MAX] {
                    let whole = friction.bound(speed);
                    let (_, near) = on_the_way(&friction, [speed].into_iter()).next().expect("there is one");
                    assert!(whole.is_finite() && whole >= 0.0, "{law:?}: {whole} at {speed}");
                    let size = 1e14 * (a.abs() + c.abs()) * (b.max(d).max(0.0) * speed.min(600.0)).exp();
                    assert!(
                        (near - whole).abs() <= 1e-12 * size,
                        "{law:?}: {near:e} and {whole:e} at {speed}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_law_that_leaves_the_range_of_numbers_is_finite_and_never_drives() {
        let law = |a, c| FrictionConfig { a, b: 0.5, c, d: 0.7, i0: 1.0 };
        for speed in [1.0, 1e3, 1e9, f64::MAX, f64::INFINITY] {
            let strong = Friction::new(law(1.0, 1.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert!(strong.is_finite() && strong > 0.0, "{strong} at {speed}");
            let friction = Friction::new(law(1.0, 1.0), AxisKind::Linear, 1.0, 1.0);
            let (_, expanded) = on_the_way(&friction, [speed].into_iter()).next().expect("there is one");
            assert!((expanded / strong - 1.0).abs() <= 1e-12, "{expanded}, not {strong} at {speed}");
            let turned = Friction::new(law(1.0, -2.0), AxisKind::Linear, 1.0, 1.0).bound(speed);
            assert_eq!(turned, 0.0, "at {speed}");
        }
        let constant = FrictionConfig { b: 0.0, d: 0.0, ..law(2.0, -0.5) };
        let bound = Friction::new(constant, AxisKind::Linear, 1.0, 1.0).bound(1e300);
        assert!((bound - 1.5).abs() <= 1e-12, "{bound} A");
    }
}
