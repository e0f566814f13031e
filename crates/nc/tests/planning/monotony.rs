//! Relaxed limits: planning takes work in proportion to the path.

use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

use crate::programs::{Program, Step, blend};

/// Returns the embedded machine with a velocity limit of X, Y and Z, m/s.
fn machine(velocity: f64) -> MachineConfig {
    let mut parameters = Parameters::embedded_default().unwrap();
    for axis in ["x", "y", "z"] {
        for text in [
            format!("{axis}.limits.velocity_m_min={}", 60.0 * velocity),
            format!("{axis}.limits.acceleration_m_s2=1.48"),
            format!("{axis}.limits.jerk_m_s3=2980"),
        ] {
            parameters.set_text(&text, &ValueSource::named("test")).unwrap();
        }
    }
    parameters.machine_config().unwrap()
}

#[test]
fn planning_takes_work_in_proportion_to_the_path_whatever_the_limits() {
    // A rapid traverse that is blended, and an arc at a feed far below it: its intervals fill the look-ahead window.
    let mut program = Program::new(0.026, blend(20e-6));
    program.rapid([-0.3, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    program.control = PathControl::ExactPath;
    program.arc([-0.29, -0.199], -3.0, 0.0);
    let plan = |velocity: f64| {
        let steps: Box<dyn Iterator<Item = Step>> = Box::new(program.iter());
        let mut planner = PartProgramPlanner::new(steps, &machine(velocity), PlanOptions::default()).unwrap();
        while planner.next_setpoint(1.0).unwrap().is_some() {}
        (planner.path_time(), planner.planned_intervals())
    };
    let (time, work) = plan(0.4);
    for velocity in [1.2, 4.0, 30.0] {
        let (found, found_work) = plan(velocity);
        assert!(found <= 1.002 * time, "{velocity} m/s: {found} s, {time} s at 0.4 m/s");
        assert!(found_work < 20 * work, "{velocity} m/s: {found_work} intervals, {work} at 0.4 m/s");
    }
}
