//! Random programs: limits of the axes, deviation from the programmed path, end points.

use proptest::prelude::*;
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::PlanOptions;

use crate::deviation::to_program;
use crate::limits::{linear_motor_machine, machine, plan_on};
use crate::programs::{Program, blend};

/// A motion: kind, direction, length, curvature, angle.
pub type Draw = (u8, f64, f64, f64, f64);

pub fn draws(count: usize) -> impl Strategy<Value = Vec<Draw>> {
    prop::collection::vec((0u8..6, -3.2..3.2f64, -5.0..-1.5f64, -1.0..1.0f64, 0.05..6.2f64), 1..count)
}

pub fn program(draws: &[Draw], feed: f64, control: PathControl) -> Program {
    let mut program = Program::new(feed, control);
    for &(kind, direction, exponent, tilt, sweep) in draws {
        let length = 10f64.powf(exponent);
        let (s, c) = direction.sin_cos();
        let [x, y, z] = [program.at[0], program.at[1], program.at[2]];
        match kind {
            0..=2 => {
                program.line(x + length * c, y + length * s, z + if kind == 2 { tilt * length } else { 0.0 })
            }
            3 | 4 => {
                let radius = length.max(1e-4);
                let sweep = if tilt > 0.0 { sweep } else { -sweep };
                program.arc(
                    [x + radius * c, y + radius * s],
                    sweep,
                    if kind == 4 { tilt * radius } else { 0.0 },
                )
            }
            _ => {
                let mut end = program.at;
                for value in &mut end[..3] {
                    *value *= 0.5;
                }
                program.rapid(end)
            }
        };
    }
    program
}

pub fn controls() -> impl Strategy<Value = PathControl> {
    prop_oneof![
        Just(PathControl::ExactStop),
        Just(PathControl::ExactPath),
        (-5.5..-3.5f64).prop_map(|exponent| blend(10f64.powf(exponent))),
    ]
}

pub fn tolerance(control: PathControl) -> f64 {
    match control {
        PathControl::Blend(blend) => blend.tolerance.unwrap_or(0.0),
        _ => 1e-9,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn limits_and_tolerance_are_kept(
        draws in draws(30), feed in -2.5..-0.5f64, control in controls(), is_linear in any::<bool>(),
    ) {
        let program = program(&draws, 10f64.powf(feed), control);
        let machine = if is_linear { linear_motor_machine() } else { machine() };
        let outcome = plan_on(&machine, &program, PlanOptions::default(), |_| 1.0).unwrap();
        outcome.audit.assert_kept();
        let motions: Vec<_> = program.motions().collect();
        let mut worst = 0.0_f64;
        for setpoint in &outcome.setpoints {
            worst = worst.max(to_program(&motions, setpoint.place.line, setpoint.psec()));
        }
        prop_assert!(worst <= tolerance(control) + 1e-12, "deviation {worst}");
        let Some(last) = outcome.setpoints.last() else {
            // Only motions of length 0.
            prop_assert!(program.at == [0.0; 9]);
            return Ok(());
        };
        let last = last.psec();
        for (found, expected) in last.iter().zip(&program.at) {
            prop_assert!(found == expected, "end {found} {expected}");
        }
    }
}
