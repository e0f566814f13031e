//! Properties of friction for any motor state and load: opposes motion, never reverses the axis, sticks below i0.

use proptest::prelude::*;
use virtual_axes_core::drive::{MotorState, Plant};
use virtual_axes_verification::fixtures::machines::{friction_of_x, parameters};

const TICK: f64 = 125e-6;
const X: usize = 0;

fn plant(friction: [f64; 5]) -> Plant {
    let config = parameters(&friction_of_x(friction)).machine_config().expect("valid");
    Plant::new(&config.axes()[X], TICK).expect("can be discretized")
}

/// Friction of the default X axis ([P] Appendix 2).
const LAW: [f64; 5] = [1.576, 0.01965, -0.5332, -0.2801, 1.043];
/// Kt of the default X axis, N·m/A, and its r, m/rad.
const KT: f64 = 2.64;
const RATIO: f64 = 0.020 / std::f64::consts::TAU;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn friction_opposes_motion_and_never_accelerates(
        current in -60.0..60.0f64,
        speed in prop_oneof![-200.0..200.0f64, -0.1..0.1f64, -1e-9..1e-9f64, Just(0.0)],
        voltage in -245.0..245.0f64,
        load in -20e3..20e3f64,
        scale in 0.1..10.0f64,
    ) {
        let law = [LAW[0] * scale, LAW[1], LAW[2] * scale, LAW[3], LAW[4] * scale];
        let start = MotorState { current, speed, angle: 0.3 };
        let (mut with, mut without) = (start, start);
        let torques = plant(law).step(&mut with, voltage, load);
        plant([0.0; 5]).step(&mut without, voltage, load);
        prop_assert!(torques.friction * with.speed >= 0.0, "friction drives: {torques:?} {with:?}");
        prop_assert!(with.speed.abs() <= without.speed.abs(), "{with:?} faster than {without:?}");
        prop_assert!(with.speed * without.speed >= 0.0, "friction reverses the axis");
    }

    #[test]
    fn axis_sticks_below_i0_and_breaks_away_above(fraction in -0.999_999..0.999_999f64) {
        let plant = plant(LAW);
        let breakaway = KT * LAW[4] / RATIO;
        let mut s = MotorState::default();
        for _ in 0..100 {
            plant.step(&mut s, 0.0, fraction * breakaway);
            prop_assert_eq!(s.speed, 0.0);
        }
        prop_assert!(s.angle.abs() < 1e-9, "creeps by {} rad", s.angle);

        let load = breakaway * (1.000_001 + fraction.abs()).copysign(fraction);
        plant.step(&mut s, 0.0, load);
        prop_assert!(s.speed * load > 0.0, "stays at {} under {load} N", s.speed);
    }
}

#[test]
fn friction_beyond_the_fitted_range_is_reported_as_extrapolated() {
    let plant = plant(LAW);
    let at = |meters_per_minute: f64| meters_per_minute / 60.0 / RATIO;
    assert!(!plant.is_friction_extrapolated(at(19.99)));
    assert!(plant.is_friction_extrapolated(at(-20.01)));
}
