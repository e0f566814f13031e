//! Tool center point control: random programs of five axes.

use proptest::prelude::*;
use virtual_axes_core::kinematics::Kinematics;

use crate::deviation::to_program;
use crate::limits::{machine, plan_on};
use crate::programs::Program;
use crate::random::{controls, tolerance};
use virtual_axes_nc::plan::PlanOptions;

/// Steps of X, Y, Z (m), A and C (rad).
fn steps() -> impl Strategy<Value = Vec<[f64; 5]>> {
    let step = (-0.02..0.02f64, -0.02..0.02f64, -0.01..0.01f64, -0.3..0.3f64, -0.6..0.6f64);
    prop::collection::vec(step.prop_map(|(x, y, z, a, c)| [x, y, z, a, c]), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, max_shrink_iters: 100, ..ProptestConfig::default() })]

    #[test]
    fn limits_and_tool_path_are_kept(
        steps in steps(), scale in -2.0..0.0f64, feed in -2.5..-0.7f64, control in controls(),
    ) {
        let machine = machine();
        let kinematics = Kinematics::new(&machine);
        let geometry = machine.kinematics();
        let mut program = Program::new(10f64.powf(feed), control);
        program.tcp_length = Some(geometry.tool_length);
        program.at[2] = -geometry.tool_length;
        let scale = 10f64.powf(scale);
        for step in &steps {
            let mut end = program.at;
            for (axis, value) in [0, 1, 2, 3, 5].into_iter().zip(step) {
                end[axis] += scale * value;
            }
            end[3] = end[3].clamp(-0.3, 0.9);
            program.line_to(end);
        }
        let outcome = plan_on(&machine, &program, PlanOptions::default(), |_| 1.0).unwrap();
        outcome.audit.assert_kept();
        let motions: Vec<_> = program.motions().collect();
        // Coordinates of the program are those of the machine frame with the tables at 0.
        let tip = |joints: &[f64]| {
            let tip = kinematics.forward(joints).tip;
            [0, 1, 2].map(|i| tip[i] + geometry.workpiece[i])
        };
        for setpoint in &outcome.setpoints {
            let distance = to_program(&motions, setpoint.place.line, &tip(setpoint.psec()));
            prop_assert!(distance <= tolerance(control) + 1e-12, "deviation {distance}");
        }
        let last = outcome.setpoints.last().unwrap().psec();
        prop_assert!(last[3] == program.at[3] && last[4] == program.at[5]);
        let end = tip(last);
        prop_assert!((0..3).all(|i| (end[i] - program.at[i]).abs() < 1e-14), "{end:?}");
    }
}
