//! Built-in scenarios: setpoints and figures.

use std::sync::Arc;

use virtual_axes_builtin::SCENARIOS;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::trial::{AxisFigures, Figures, Measures, Tick, Trial, run as run_trial};
use virtual_axes_core::units::{DEGREE, REVOLUTION, RPM};
use virtual_axes_verification::fixtures::machines::*;

const X: usize = 0;
const Y: usize = 1;
const Z: usize = 2;
const A: usize = 3;
const C: usize = 4;
const MICROMETER: f64 = 1e-6;
const MILLIDEGREE: f64 = 1e-3 * DEGREE;
/// Rest before the first move of the lines, rotations and corners, s.
const REST: f64 = 0.504;

fn config(changes: &[(&str, f64)]) -> MachineConfig {
    parameters(changes).machine_config().expect("the machine is valid")
}

/// Runs a built-in scenario and calls `look` at every tick.
fn watch(name: &str, changes: &[(&str, f64)], look: impl FnMut(Tick<'_>)) -> Figures {
    trace_scenario(name, &config(changes), look)
}

fn figures(name: &str, changes: &[(&str, f64)]) -> Figures {
    watch(name, changes, |_| ())
}

const NO_FEEDFORWARD: &[(&str, f64)] = &[
    ("x.feedforward.velocity", 0.0),
    ("x.feedforward.torque_kg_m2", 0.0),
    ("y.feedforward.velocity", 0.0),
    ("y.feedforward.torque_kg_m2", 0.0),
];

/// Asserts that the setpoints of a scenario equal `wanted(t)` within a picometer.
#[track_caller]
fn assert_setpoints(name: &str, duration: f64, wanted: impl Fn(f64) -> [f64; AXES]) {
    let program = program(name, &config(&[]));
    assert!((program.duration() - duration).abs() < 1e-9, "{name} lasts {} s", program.duration());
    let mut psec = [0.0; AXES];
    for k in 0..=(duration / TSP).ceil() as u64 {
        let t = k as f64 * TSP;
        program.psec(t, &mut psec);
        for (found, wanted) in psec.iter().zip(wanted(t)) {
            assert!((found - wanted).abs() < 1e-12, "{name} at {t} s: {psec:?}, wanted {wanted}");
        }
    }
}

#[test]
fn the_ballbar_is_two_turns_between_cosine_ramps() {
    let trial = Ballbar::paper();
    assert_setpoints("ballbar", trial.duration(), |t| trial.psec(t));
}

#[test]
fn lines_and_rotations_are_seven_phase_profiles() {
    let line = |acceleration| RestToRestProfile::new(0.200, 10.0 * M_MIN, acceleration, 50.0);
    let turn = RestToRestProfile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * REVOLUTION, 50.0 * REVOLUTION);
    let trials = [
        ("x-constant", X, line(2.5)),
        ("y-constant", Y, line(2.5)),
        ("z-constant", Z, line(2.1)),
        ("a-constant", A, turn),
        ("c-constant", C, turn),
    ];
    for (name, axis, profile) in trials {
        assert_setpoints(name, profile.duration() + 2.0 * REST, |t| {
            let mut psec = [0.0; AXES];
            psec[axis] = profile.at(t - REST);
            psec
        });
    }
}

#[test]
fn corners_are_two_lines_with_a_stop_in_between() {
    for (name, turn) in [("corner-90", 90.0 * DEGREE), ("corner-45", 45.0 * DEGREE)] {
        let leg = RestToRestProfile::new(0.050, 10.0 * M_MIN, 2.5, 50.0);
        assert_setpoints(name, 2.0 * leg.duration() + 2.0 * REST, |t| {
            let (first, second) = (leg.at(t - REST), leg.at(t - REST - leg.duration()));
            [first + second * turn.cos(), second * turn.sin(), 0.0, 0.0, 0.0]
        });
    }
}

#[test]
fn the_lower_of_two_feeds_is_reached_at_the_block_boundary() {
    let program = program("c-two-speeds", &config(&[]));
    let border = program.time_range(0).end;
    let speed = |t: f64| (program.progress(t + 1e-5) - program.progress(t - 1e-5)) / 2e-5;
    assert!((program.progress(border) - 130.0 * DEGREE).abs() < 1e-12);
    assert!((speed(border) - 6.0 * RPM).abs() < 1e-6 * RPM, "{} rpm", speed(border) / RPM);
    // The feed is higher up to the deceleration before the boundary, and constant after it.
    assert!(speed(border - 0.01) > 6.0 * RPM * 1.000_01);
    assert!((speed(border + 0.01) - 6.0 * RPM).abs() < 1e-6 * RPM);
    let fastest = (0..1000).map(|i| speed(border * f64::from(i) / 1000.0)).fold(0.0, f64::max);
    assert!((fastest - 18.0 * RPM).abs() < 1e-6 * RPM, "{} rpm", fastest / RPM);
}

#[test]
fn every_builtin_scenario_runs_on_the_machines_with_home_in_the_middle() {
    for machine in ["mikron_ucp710", "linear_motor_center"] {
        let config = virtual_axes_core::config::Parameters::load(machine, virtual_axes_builtin::MACHINES)
            .and_then(|parameters| parameters.machine_config())
            .expect("the built-in machines are valid");
        for (name, text) in SCENARIOS {
            let scenario = Scenario::from_yaml(text, name).expect("built-in");
            let program =
                Arc::new(scenario.program(&config, None).unwrap_or_else(|e| panic!("{machine}: {e}")));
            let trial = Trial {
                machine: &config,
                program: Some(Arc::clone(&program)),
                allow_nonzero_end_velocity: false,
                record: true,
                measures: Measures::ALL,
            };
            let outcome = run_trial(&trial, setpoints(name, program, &config), |_| Ok(()));
            // The circle exceeds the travel limits of the smaller machine.
            if machine == "linear_motor_center" && name.starts_with("ballbar") {
                let error = outcome.expect_err("outside the travel limits").to_string();
                assert!(error.contains("outside the travel limits"), "{error}");
                continue;
            }
            let outcome = outcome.unwrap_or_else(|error| panic!("{name} on {machine}: {error}"));
            let figures = outcome.figures;
            assert!(figures.axes.iter().any(|axis| axis.moves), "{name} on {machine} moves nothing");
            let contour = figures.contour.expect("linear axes");
            assert!(contour.max < 2e-3, "{name} on {machine}: contour error {} m", contour.max);
            assert!(contour.max_within_ends <= contour.max);
        }
    }
}

#[test]
fn ballbar_figures() {
    for (changes, mean, min, max) in [(&[][..], 49.0, 47.7, 68.6), (NO_FEEDFORWARD, -283.1, -284.4, -263.5)] {
        let circles = figures("ballbar", changes).circles;
        assert_eq!(circles.len(), 1);
        let circle = &circles[0];
        assert_near("mean, µm", circle.mean / MICROMETER, mean, 0.2);
        assert_near("min, µm", circle.min / MICROMETER, min, 1.0);
        assert_near("max, µm", circle.max / MICROMETER, max, 1.0);
        // G is the range about the center of the least-squares circle, which is near the nominal center here.
        let deviation = circle.circular_deviation.expect("two turns");
        assert_near("G, µm", deviation / MICROMETER, (circle.max - circle.min) / MICROMETER, 1.0);
    }
}

#[test]
fn bidirectional_circular_deviation() {
    let both = figures("ballbar-both", &[]);
    let [first, second] = &both.circles[..] else { panic!("{} circles", both.circles.len()) };
    assert!(first.counterclockwise && !second.counterclockwise);
    assert_near("counterclockwise, mean, µm", first.mean / MICROMETER, 49.0, 0.2);
    let [pair] = &both.bidirectional[..] else { panic!("{} pairs", both.bidirectional.len()) };
    // D is the mean of the means of both directions; G(b) is at least the range of each.
    let mean = (first.mean + second.mean) / 2.0;
    assert_near("D, µm", pair.mean_radial_deviation / MICROMETER, mean / MICROMETER, 0.1);
    // The common center is near the center of each direction.
    for circle in [first, second] {
        assert!(pair.circular_deviation > circle.circular_deviation.expect("two turns") - MICROMETER);
    }
    let range = first.max.max(second.max) - first.min.min(second.min);
    assert_near("G(b), µm", pair.circular_deviation / MICROMETER, range / MICROMETER, 1.0);
}

#[test]
fn corner_figures() {
    for (name, turn, wanted) in [("corner-90", 90.0, 146.6), ("corner-45", 45.0, 103.7)] {
        let corners = figures(name, &[]).corners;
        assert_eq!(corners.len(), 1, "{corners:?}");
        assert_near("turn, °", corners[0].turn / DEGREE, turn, 1e-9);
        assert_near(name, corners[0].max_contour_error / MICROMETER, wanted, wanted / 100.0);
    }
}

#[test]
fn line_and_rotation_figures() {
    let trials = [
        ("x-constant", X, MICROMETER, 218.9, 14.40),
        ("y-constant", Y, MICROMETER, 230.5, 12.40),
        ("z-constant", Z, MICROMETER, 102.7, 11.50),
        ("c-constant", C, MILLIDEGREE, 35.4, 1.76),
        ("a-constant", A, MILLIDEGREE, 35.0, 2.37),
    ];
    for (name, axis, unit, error, current) in trials {
        let figures = figures(name, &[]);
        let report = figures.axes[axis].report;
        let moving: Vec<bool> = figures.axes.iter().map(|axis| axis.moves).collect();
        assert_eq!(moving.iter().position(|&moves| moves), Some(axis));
        assert_near(name, report.max_delay_compensated_following_error / unit, error, error / 100.0);
        assert_near(name, report.peak_current, current, current / 100.0);
    }
}

/// Following error and delay-compensated following error of X at constant velocity in x-constant, m.
fn steady_errors(changes: &[(&str, f64)]) -> (f64, f64) {
    let mut errors = (f64::NAN, f64::NAN);
    watch("x-constant", changes, |tick| {
        let time = tick.time as f64 * 1e-9;
        // One second after the start of the motion, 100 ms before the deceleration.
        if tick.position_instant && time < 1.5 {
            let sample = tick.machine.axis(X).sample();
            errors = (sample.following_error(), sample.delay_compensated_following_error());
        }
    });
    errors
}

#[test]
fn without_feedforward_the_steady_following_error_is_velocity_over_gain_plus_the_delay() {
    let speed = 10.0 * M_MIN;
    let (following, compensated) = steady_errors(NO_FEEDFORWARD);
    // Kp = 1.5 (m/min)/mm = 25 s⁻¹; the comparator reads the setpoint of two position cycles earlier.
    assert_near(
        "delay-compensated following error, µm",
        compensated / MICROMETER,
        speed / 25.0 / MICROMETER,
        1e-3,
    );
    assert_near(
        "following error, µm",
        following / MICROMETER,
        (speed / 25.0 + speed * 2.0 * TSP) / MICROMETER,
        1e-3,
    );
}

#[test]
fn with_feedforward_the_steady_following_error_is_that_of_the_delay() {
    let (following, compensated) = steady_errors(&[]);
    assert_near("delay-compensated following error, µm", compensated / MICROMETER, 0.0, 1e-3);
    assert_near("following error, µm", following / MICROMETER, 10.0 * M_MIN * 2.0 * TSP / MICROMETER, 1e-3);
}

#[test]
fn overshoot_beyond_the_ends_is_excluded_within_ends() {
    // The contour error of a line consists of its overshoot only.
    let contour = figures("x-constant", &[]).contour.expect("X is linear");
    assert!(contour.max > 10.0 * MICROMETER, "{contour:?}");
    assert!(contour.max_within_ends < 1e-15, "{contour:?}");
}

#[test]
fn recorded_signals_have_the_maxima_of_the_figures() {
    for name in ["corner-90", "five-axis"] {
        let config = config(&[]);
        let program = program(name, &config);
        let trial = Trial {
            machine: &config,
            program: Some(Arc::clone(&program)),
            allow_nonzero_end_velocity: false,
            record: true,
            measures: Measures::ALL,
        };
        let outcome = run_trial(&trial, setpoints(name, program, &config), |_| Ok(())).expect("a run");
        let (figures, recording) = (outcome.figures, outcome.recording.expect("recording is enabled"));
        let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let tool = recording.tool.expect("tool signals");
        assert_eq!(largest(&tool.contour_error), figures.contour.expect("tool signals").max, "{name}");
        if !tool.orientation_error.is_empty() {
            let orientation = figures.orientation.expect("rotary axes");
            assert_eq!(largest(&tool.orientation_error), orientation.max, "{name}");
        }
        for (axis, shown) in figures.axes.iter().zip(&recording.axes).filter(|(axis, _)| axis.moves) {
            let at = format!("{name}, {}", axis.name);
            assert_eq!(largest(&shown.current), axis.report.peak_current, "{at}");
            assert_eq!(largest(&shown.following_error), axis.report.max_following_error, "{at}");
        }
    }
}

#[test]
fn a_choice_of_figures_leaves_the_others_as_they_are() {
    let config = config(&[]);
    let program = program("ballbar", &config);
    let figures = |measures| {
        let trial = Trial {
            machine: &config,
            program: Some(Arc::clone(&program)),
            allow_nonzero_end_velocity: false,
            record: false,
            measures,
        };
        let setpoints = setpoints("ballbar", Arc::clone(&program), &config);
        run_trial(&trial, setpoints, |_| Ok(())).expect("a run").figures
    };
    let all = figures(Measures::ALL);
    assert!(all.contour.is_some() && !all.circles.is_empty());
    let without_energy = |figures: Figures| {
        let axes = figures.axes.into_iter().map(|axis| AxisFigures { energy: None, ..axis }).collect();
        Figures { axes, dc_link: None, ..figures }
    };
    let all = without_energy(all);
    let without_circles = Figures { circles: Vec::new(), bidirectional: Vec::new(), ..all.clone() };
    assert_eq!(figures(Measures::WITHOUT_CIRCLES), without_circles);
    let circles = Figures { contour: None, orientation: None, corners: Vec::new(), ..all };
    assert_eq!(figures(Measures { contour: false, circles: true, energy: false }), circles);
    let axes = Figures { circles: Vec::new(), bidirectional: Vec::new(), ..circles };
    assert_eq!(figures(Measures::AXES), axes);
}

/// The peak current of a reversal occurs between two position cycles.
#[test]
fn a_peak_between_two_position_cycles_is_recorded() {
    let config = config(&[]);
    let mut at_instants = 0.0_f64;
    let figures = trace_scenario("x-there-and-back", &config, |tick| {
        if tick.position_instant {
            at_instants = at_instants.max(tick.machine.axis(X).sample().current.abs());
        }
    });
    let program = program("x-there-and-back", &config);
    let trial = Trial {
        machine: &config,
        program: Some(Arc::clone(&program)),
        allow_nonzero_end_velocity: false,
        record: true,
        measures: Measures::ALL,
    };
    let outcome = run_trial(&trial, setpoints("x-there-and-back", program, &config), |_| Ok(()));
    let recording = outcome.expect("a run").recording.expect("recording is enabled");
    let plotted = recording.axes[X].current.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    assert!(plotted > at_instants, "{plotted} A, at the instants {at_instants} A");
    assert_eq!(plotted, figures.axes[X].report.peak_current);
}
