//! Memory that planning takes for short programs.

use std::io::Cursor;

use virtual_axes_core::config::Parameters;
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

/// Bytes that the planner of a few motions takes at most.
const ALLOWED: u64 = 4_000_000;

/// Returns the largest number of bytes that planning a program allocates at one time.
fn peak(parameters: &Parameters, text: &str) -> u64 {
    let machine = parameters.machine_config().unwrap();
    let measured = allocation_counter::measure(|| {
        let options = InterpreterOptions::for_machine(&machine);
        let steps = Interpreter::new(Cursor::new(text), "part.nc", options);
        let mut planner = PartProgramPlanner::new(steps, &machine, PlanOptions::default()).unwrap();
        while planner.next_setpoint(1.0).unwrap().is_some() {}
    });
    measured.bytes_max
}

#[test]
fn blends_between_opposite_motions_take_little_memory() {
    let default = Parameters::embedded_default().unwrap();
    for text in [
        "G64 P0.01\nG0 Z10\nG0 Z0\nG0 Z10\nM2\n",
        "G64 P1\nF500\nG1 X10\nX0\nX10\nX0\nM2\n",
        "T1 M6\nG43 H1\nG0 Z10\nG49 G0 Z10\nG43 H2 G0 Z5\nG43 H3\nZ5\nG43 G0 Z6\nG49\nG53 G0 Z0\nM2\n",
    ] {
        let bytes = peak(&default, text);
        assert!(bytes < ALLOWED, "{bytes} bytes for {text:?}");
    }
}
