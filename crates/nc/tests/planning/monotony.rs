//! Relaxed limits: the motion is not longer, and planning takes work in proportion to the path.

use proptest::prelude::*;
use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_nc::motion::PathControl;
use virtual_axes_nc::plan::{PartProgramPlanner, PlanOptions};

use crate::programs::{Program, Step, blend};
use crate::random::{Draw, controls, draws, program};

/// Velocity, acceleration and jerk of X, Y and Z in SI units.
type AxisLimits = [[f64; 3]; 3];

/// Returns the embedded machine with other limits of X, Y and Z.
fn machine(limits: &AxisLimits) -> MachineConfig {
    let mut parameters = Parameters::embedded_default().unwrap();
    for (axis, [velocity, acceleration, jerk]) in ["x", "y", "z"].into_iter().zip(limits) {
        for text in [
            format!("{axis}.limits.velocity_m_min={}", 60.0 * velocity),
            format!("{axis}.limits.acceleration_m_s2={acceleration}"),
            format!("{axis}.limits.jerk_m_s3={jerk}"),
        ] {
            parameters.set_text(&text, &ValueSource::named("test")).unwrap();
        }
    }
    parameters.machine_config().unwrap()
}

/// Returns the duration, s, and the number of intervals planned.
fn plan(program: &Program, limits: &AxisLimits) -> (f64, u64) {
    let steps: Box<dyn Iterator<Item = Step>> = Box::new(program.iter());
    let mut planner = PartProgramPlanner::new(steps, &machine(limits), PlanOptions::default()).unwrap();
    while planner.next_setpoint(1.0).unwrap().is_some() {}
    (planner.path_time(), planner.planned_intervals())
}

#[test]
fn planning_takes_work_in_proportion_to_the_path_whatever_the_limits() {
    // A rapid traverse that is blended, and an arc at a feed far below it: its intervals fill the look-ahead window.
    let mut program = Program::new(0.026, blend(20e-6));
    program.rapid([-0.3, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    program.control = PathControl::ExactPath;
    program.arc([-0.29, -0.199], -3.0, 0.0);
    let plan = |velocity: f64| plan(&program, &[[velocity, 1.48, 2980.0]; 3]);
    let (time, work) = plan(0.4);
    for velocity in [1.2, 4.0, 30.0] {
        let (found, found_work) = plan(velocity);
        assert!(found <= 1.002 * time, "{velocity} m/s: {found} s, {time} s at 0.4 m/s");
        assert!(found_work < 20 * work, "{velocity} m/s: {found_work} intervals, {work} at 0.4 m/s");
    }
}

#[test]
fn planning_takes_the_same_work_at_any_jerk_limit() {
    let mut program = Program::new(0.1, blend(10e-6));
    program.line(0.02, 0.0, 0.0).line(0.02, 0.02, 0.0).arc([0.01, 0.02], 3.0, 0.0);
    program.line(0.0, 0.03, -0.01).line(0.0, 0.0, 0.0);
    let work = |jerk: f64| plan(&program, &[[0.5, 2.5, jerk]; 3]).1;
    let least = work(1e3);
    for jerk in [1e4, 1e5, 1e6, 1e7] {
        let found = work(jerk);
        assert!(found < 4 * least, "{jerk} m/s³: {found} intervals, {least} at 1000 m/s³");
    }
}

/// Relative tolerance of the planned time: the planner's own, and that of its intervals, which depend on the limits.
const TOLERANCE: f64 = 5e-3;

/// Returns the limits of an axis: velocity 0.2 to 1 m/s, acceleration 1 to 10 m/s², jerk 30 to 10 000 m/s³.
fn axis_limits() -> impl Strategy<Value = [f64; 3]> {
    (-0.7..0.0f64, 0.0..1.0f64, 1.5..4.0f64)
        .prop_map(|exponents| [exponents.0, exponents.1, exponents.2].map(|exponent| 10f64.powf(exponent)))
}

/// Asserts that a program takes no longer with a higher feed or with one limit relaxed, each by `factor`.
fn assert_monotonic(
    draws: &[Draw],
    feed: f64,
    control: PathControl,
    limits: &AxisLimits,
    factor: f64,
) -> Result<(), TestCaseError> {
    let drawn = program(draws, feed, control);
    let (time, _) = plan(&drawn, limits);
    let (found, _) = plan(&program(draws, factor * feed, control), limits);
    prop_assert!(found <= (1.0 + TOLERANCE) * time, "feed: {} s, {} s before", found, time);
    for axis in 0..limits.len() {
        for (order, name) in ["velocity", "acceleration", "jerk"].into_iter().enumerate() {
            let mut relaxed = *limits;
            relaxed[axis][order] *= factor;
            let (found, _) = plan(&drawn, &relaxed);
            prop_assert!(
                found <= (1.0 + TOLERANCE) * time,
                "{} {}: {} s, {} s before",
                axis,
                name,
                found,
                time
            );
        }
    }
    Ok(())
}

#[test]
fn a_higher_jerk_does_not_stop_a_line_at_the_end_of_the_window() {
    // One interval from constant speed to the standstill at the end of the look-ahead window lasted 0.2 s.
    let draws = [(0, 0.0, -1.5, 0.0, 0.05)];
    let limits = [[1.0, 3.934, 497.1], [1.0, 1.0, 31.62], [1.0, 3.737, 33.709]];
    assert_monotonic(&draws, 0.02896, blend(316e-6), &limits, 3.5893).unwrap();
}

#[test]
fn a_higher_acceleration_keeps_the_intervals_of_ramps_within_the_jerk_limit() {
    // The speed stays below that of the acceleration limit: a ramp has two jerk phases.
    let draws = [(0, 0.0, -3.1286, 0.0, 0.05), (0, -2.4569, -2.7997, 0.0, 0.05)];
    let limits = [[1.0, 9.723, 416.86], [1.0, 1.0, 31.62], [1.0, 1.0, 31.62]];
    assert_monotonic(&draws, 0.007854, blend(316e-6), &limits, 5.611).unwrap();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, max_shrink_iters: 100, ..ProptestConfig::default() })]

    #[test]
    fn no_relaxed_limit_lengthens_the_motion(
        draws in draws(10), feed in -2.5..-0.5f64, control in controls(), limits in [axis_limits(), axis_limits(), axis_limits()],
        factor in 1.05..8.0f64,
    ) {
        assert_monotonic(&draws, 10f64.powf(feed), control, &limits, factor)?;
    }
}
