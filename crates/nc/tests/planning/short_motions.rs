//! Motions shorter than the shortest interval of the path.

use proptest::prelude::*;
use virtual_axes_nc::motion::PathControl;

use crate::limits::plan;
use crate::programs::{Program, blend};

proptest! {
    #[test]
    fn motions_of_any_length_are_planned(
        exponents in prop::collection::vec(-13.0..-2.0f64, 1..6),
        mode in 0..4usize,
        sweep in 0.1..6.2f64,
        stops in any::<u8>(),
        has_tool_center_point: bool,
    ) {
        let control =
            [PathControl::ExactStop, PathControl::ExactPath, blend(1e-8), blend(2e-5)][mode];
        let mut program = Program::new(0.02, control);
        program.tcp_length = has_tool_center_point.then_some(0.1);
        for (i, exponent) in exponents.iter().enumerate() {
            let length = 10f64.powf(*exponent);
            let [x, y, z] = [program.at[0], program.at[1], program.at[2]];
            match i % 3 {
                0 => program.line(x + length, y, z),
                1 => program.arc([x, y + length], sweep, 0.0),
                _ => program.line(x, y + length, z - length),
            };
            if stops >> i & 1 == 1 {
                program.dwell(0.01);
            }
        }
        let outcome = plan(&program);
        outcome.audit.assert_kept();
        let last = outcome.setpoints.last().expect("no setpoint");
        for k in 0..3 {
            prop_assert!(has_tool_center_point || (last.psec()[k] - program.at[k]).abs() < 1e-12);
        }
    }
}
