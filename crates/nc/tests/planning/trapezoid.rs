//! Trapezoidal profile of the control: closed forms, deviation, limits, effect of each parameter.

use proptest::prelude::*;
use virtual_axes_core::config::{MachineConfig, Parameters, ValueSource};
use virtual_axes_core::trajectory::MotionChunk;
use virtual_axes_nc::motion::{Blend, PathControl, ProgramEvent, ProgramStep};
use virtual_axes_nc::plan::{FeedPlanError, PartProgramPlanner, PlanOptions};

use crate::deviation::to_program;
use crate::programs::{Program, Step, blend};
use crate::random::{Draw, draws, program};

const PERIOD: f64 = 1e-3;

fn machine(settings: &[&str]) -> MachineConfig {
    let mut parameters = Parameters::embedded_default().unwrap();
    for text in ["periods.position_ms=1", "control.profile=linuxcnc"].iter().chain(settings) {
        parameters.set_text(text, &ValueSource::named("test")).unwrap();
    }
    parameters.machine_config().unwrap()
}

fn planner<'a>(program: &'a Program, machine: &MachineConfig) -> PartProgramPlanner<'a> {
    let steps: Box<dyn Iterator<Item = Step> + 'a> = Box::new(program.iter());
    PartProgramPlanner::new(steps, machine, PlanOptions::default()).unwrap()
}

/// Returns the setpoints with their lines, and the duration, s.
fn plan(program: &Program, machine: &MachineConfig) -> (Vec<(usize, Vec<f64>)>, f64) {
    let mut planner = planner(program, machine);
    let mut setpoints = Vec::new();
    while let Some(setpoint) = planner.next_setpoint(1.0).unwrap() {
        setpoints.push((setpoint.place.line, setpoint.psec().to_vec()));
    }
    (setpoints, planner.path_time())
}

fn exact_merging(control: PathControl) -> PathControl {
    match control {
        PathControl::Blend(blend) => PathControl::Blend(Blend { merge_tolerance: Some(1e-12), ..blend }),
        control => control,
    }
}

#[test]
fn a_line_takes_the_time_of_a_trapezoid() {
    // X: 2.5 m/s²; a motion that could overlap with the next one has half of it.
    for (control, acceleration) in [(PathControl::ExactStop, 2.5), (blend(1e-5), 1.25)] {
        let mut program = Program::new(0.2, control);
        program.line(0.1, 0.0, 0.0);
        let (setpoints, time) = plan(&program, &machine(&[]));
        assert!((time - (0.1 / 0.2 + 0.2 / acceleration)).abs() < 1e-9, "{time} s");
        assert_eq!(setpoints.last().unwrap().1[0], 0.1);
    }
}

#[test]
fn a_corner_deviates_by_its_tolerance() {
    let mut program = Program::new(0.1, blend(100e-6));
    program.line(0.05, 0.0, 0.0).line(0.05, 0.05, 0.0);
    let (setpoints, _) = plan(&program, &machine(&[]));
    let distance = |psec: &[f64]| (psec[0] - 0.05).hypot(psec[1]);
    let nearest =
        (0..setpoints.len()).min_by(|&i, &j| distance(&setpoints[i].1).total_cmp(&distance(&setpoints[j].1)));
    let nearest = nearest.unwrap();
    // Half a cycle from the middle of the arc at most.
    let found = distance(&setpoints[nearest].1);
    assert!((100e-6..100.5e-6).contains(&found), "{found} m");
    let [before, after] = [nearest - 1, nearest + 1].map(|i| &setpoints[i].1);
    let speed = (after[0] - before[0]).hypot(after[1] - before[1]) / (2.0 * PERIOD);
    // The arc around a right angle has the radius P / (√2 − 1), and X is the slower axis.
    let wanted = (0.866 * 2.5 * 100e-6 / (2f64.sqrt() - 1.0)).sqrt();
    assert!((speed / wanted - 1.0).abs() < 2e-3, "{speed} m/s, {wanted} m/s");
}

#[test]
fn rotary_axes_overlap_at_half_of_the_acceleration() {
    let machine = machine(&[]);
    let acceleration = machine.axes()[3].limits().acceleration;
    let (count, step) = (20, 0.9558_f64.to_radians());
    let mut program = Program::new(10.0, blend(1e-5));
    for k in 1..=count {
        let mut end = program.at;
        end[3] = f64::from(k) * step;
        program.line_to(end);
    }
    let (_, time) = plan(&program, &machine);
    // Each motion starts when the one before is at its peak; the last one also slows down.
    let wanted = f64::from(count + 1) * (step / (0.5 * acceleration)).sqrt();
    assert!((time / wanted - 1.0).abs() < 1e-9, "{time} s, {wanted} s");
}

#[test]
fn chunks_have_the_setpoints_of_the_planner() {
    let mut program = Program::new(0.1, blend(50e-6));
    program.line(0.02, 0.01, 0.0).arc([0.03, 0.01], 2.0, 0.0).line(0.06, 0.02, 0.0);
    let mut end = program.at;
    (end[3], end[0]) = (0.1, 0.07);
    program.line_to(end);
    end[5] = -0.2;
    program.line_to(end);
    let machine = machine(&[]);
    let (setpoints, _) = plan(&program, &machine);
    let (mut chunked, mut cycle) = (planner(&program, &machine), 0);
    while let Some(chunk) = chunked.next_chunk(7).unwrap() {
        for k in 1..=chunk.cycles() {
            let mut joints = [0.0; 5];
            chunk.positions(k as f64 * PERIOD, &mut joints);
            let wanted = &setpoints[(cycle + k) as usize].1;
            for (found, wanted) in joints.iter().zip(wanted) {
                assert!((found - wanted).abs() < 1e-12, "cycle {}: {found}, {wanted}", cycle + k);
            }
        }
        cycle += chunk.cycles();
    }
    assert_eq!(cycle as usize + 1, setpoints.len());
}

#[test]
fn splines_are_rejected() {
    let mut program = Program::new(0.1, PathControl::ExactPath);
    program.nurbs(3, &[([0.01, 0.0], 1.0), ([0.02, 0.01], 1.0), ([0.03, 0.0], 1.0)]);
    let machine = machine(&[]);
    let error = planner(&program, &machine).next_setpoint(1.0).unwrap_err();
    assert!(matches!(error, FeedPlanError::SplineUnsupported { line: 1 }), "{error}");
}

#[test]
fn each_parameter_has_an_effect() {
    let any_deviation =
        PathControl::Blend(Blend { tolerance: None, rotary_tolerance: None, merge_tolerance: None });
    let mut program = Program::new(0.3, any_deviation);
    for k in 1..40 {
        program.line(0.001 * f64::from(k), if k % 2 == 0 { 0.0 } else { 50e-6 }, 0.0);
    }
    for k in 1..20 {
        program.line(0.04 + 0.0015 * f64::from(k), if k % 2 == 0 { 0.0 } else { 0.0008 }, 0.0);
    }
    program.arc([0.07, 0.0], 3.0, 0.0).arc([0.05, 0.02], -1.0, 0.004).line(0.2, 0.1, 0.0);
    program.steps.push(ProgramStep::Event { line: 90, event: ProgramEvent::Dwell(0.1) });
    program.control = PathControl::ExactPath;
    program.line(0.22, 0.1, 0.0).line(0.22, 0.12, 0.0);
    let duration = |settings: &[&str]| plan(&program, &machine(settings)).1;
    let base = duration(&[]);
    for setting in [
        "control.path_velocity_m_min=6",
        "control.normal_fraction=0.5",
        "control.tangential_fraction=0.3",
        "control.overlap_fraction=0.3",
        "control.kink_fraction=0.5",
        "control.corner_tolerance_mm=0.005",
        "control.look_ahead=2",
        "control.block_cycle_ms=20",
        "control.gap_cycles=40",
        "control.wait_ms=200",
    ] {
        let changed = duration(&[setting]);
        assert!(changed > 1.001 * base, "{setting}: {changed} s, {base} s");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, max_shrink_iters: 100, ..ProptestConfig::default() })]

    #[test]
    fn lines_keep_tolerance_speed_and_acceleration(
        draws in draws(30), feed in -2.5..-0.5f64, exponent in -5.5..-3.5f64,
    ) {
        let lines: Vec<Draw> = draws.into_iter().map(|draw| (draw.0 % 3, draw.1, draw.2, draw.3, draw.4)).collect();
        let tolerance = 10f64.powf(exponent);
        let program = program(&lines, 10f64.powf(feed), exact_merging(blend(tolerance)));
        let machine = machine(&[]);
        let (setpoints, _) = plan(&program, &machine);
        let motions: Vec<_> = program.motions().collect();
        for (line, psec) in &setpoints {
            let deviation = to_program(&motions, *line, psec);
            prop_assert!(deviation <= tolerance + 1e-11, "line {line}: {deviation} m");
        }
        for (j, axis) in machine.axes().iter().enumerate().take(3) {
            for window in setpoints.windows(3) {
                let [a, b, c] = [0, 1, 2].map(|i| window[i].1[j]);
                let (speed, acceleration) = ((c - b).abs() / PERIOD, (c - 2.0 * b + a).abs() / (PERIOD * PERIOD));
                prop_assert!(speed <= axis.limits().velocity * (1.0 + 1e-9));
                // A change of direction without a corner takes up to a tenth in addition.
                prop_assert!(acceleration <= 1.1 * axis.limits().acceleration + 1e-6, "{acceleration} m/s²");
            }
        }
        let end = &setpoints.last().unwrap().1;
        prop_assert_eq!(&end[..3], &program.at[..3]);
    }
}
