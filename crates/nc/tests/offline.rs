//! Errors of simulated part programs: motions at feed apart from rapid traverse, orientation of a standing tip.

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use virtual_axes_builtin::PROGRAMS;
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::trial::{self, Figures, GridRows, GridSource, Measures, SetpointSource, Trial};
use virtual_axes_nc::offline::{
    Cause, CycleError, LineErrors, OperationMeter, PartProgramOptions, PartProgramSource, ProgramFigures,
    ProgramTrack,
};

/// Approach and retract at rapid traverse around a cut with a corner.
const POCKET: &str = "G21 G90 G17 G64
G0 X40 Y0
G0 X40 Y30
G1 X20 Y30 F600
G1 X20 Y10
G0 X60 Y10
G0 X0 Y0
M2
";
/// Turns of the tool about a standing tip, and a rest.
const TURNS: &str = "G21 G90 G43.4 H1
G0 X10 Y5 Z20
G0 A-30 C50
G4 P0.4
G0 A0 C0
G4 P0.4
M2
";

fn machine() -> MachineConfig {
    Parameters::embedded_default().unwrap().machine_config().unwrap()
}

fn trial_of(machine: &MachineConfig) -> Trial<'_> {
    Trial {
        machine,
        program: None,
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::ALL,
    }
}

/// Simulated program.
struct Run {
    figures: Figures,
    program: ProgramFigures,
    /// Setpoints with their kinds of motion.
    rows: Vec<f64>,
    rapid: Vec<bool>,
    cycles: Vec<CycleError>,
}

/// Simulates a program.
fn run(name: &str, text: &str) -> Run {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, text).unwrap();
    let (machine, name) = (machine(), path.to_str().unwrap());
    let (track, options) = (RefCell::new(ProgramTrack::default()), PartProgramOptions::default());
    let open = || PartProgramSource::open(name, PROGRAMS, &machine, &options, &track).unwrap();
    let (mut rows, mut rapid, mut source) = (Vec::new(), Vec::new(), open());
    let mut row = vec![0.0; machine.axes().len()];
    while source.next(&mut row).unwrap() {
        rows.extend_from_slice(&row);
        rapid.push(source.is_rapid());
    }
    let (mut lines, mut cycles) = (LineErrors::new(&machine), Vec::new());
    let source = SetpointSource::Grid(Box::new(open()));
    let outcome = trial::run(&trial_of(&machine), source, |tick| {
        cycles.extend(lines.add(&tick, &mut track.borrow_mut()));
        Ok(())
    });
    let program = lines.finish(name, PROGRAMS, &track.borrow(), |cycle| cycles.push(*cycle)).unwrap();
    Run { figures: outcome.unwrap().figures, program, rows, rapid, cycles }
}

#[test]
fn motions_at_feed_and_rapid_traverse_have_errors_of_their_own() {
    let Run { figures, program, rows, mut rapid, .. } = run("pocket.nc", POCKET);
    let contour = figures.contour.unwrap();
    let rapids = contour.rapids.unwrap();
    // At up to 30 m/min the axes deviate more than at 0.6 m/min.
    assert!(contour.max > 0.0 && rapids.max > contour.max, "{contour:?}");
    let lines = |lines: &[virtual_axes_nc::offline::WorstLine]| -> Vec<usize> {
        let mut numbers: Vec<usize> = lines.iter().map(|worst| worst.cycle.line).collect();
        numbers.sort_unstable();
        numbers
    };
    assert_eq!(lines(&program.worst_lines), [4, 5]);
    assert_eq!(lines(&program.worst_rapids), [2, 3, 6, 7]);
    // With the kinds of all motions exchanged, so are the figures.
    rapid.iter_mut().for_each(|is_rapid| *is_rapid = !*is_rapid);
    let machine = machine();
    let joints: Vec<usize> = (0..machine.axes().len()).collect();
    let source = SetpointSource::Grid(Box::new(GridRows::new(&joints, &rows).with_rapid(&rapid)));
    let exchanged = trial::run(&trial_of(&machine), source, |_| Ok(())).unwrap().figures.contour.unwrap();
    assert_eq!(exchanged.max, rapids.max);
    assert_eq!(exchanged.rapids.unwrap().max, contour.max);
}

#[test]
fn the_orientation_of_a_standing_tip_is_compared_at_equal_times() {
    let Run { figures, program, .. } = run("turns.nc", TURNS);
    let turning = figures.axes.iter().filter(|axis| axis.name == "a" || axis.name == "c");
    // The axes follow with a lag of degrees, far above the error of the same time.
    assert!(turning.clone().any(|axis| axis.report.max_following_error > 0.5_f64.to_radians()));
    let delayed = turning.map(|axis| axis.report.max_delay_compensated_following_error).sum::<f64>();
    let orientation = figures.orientation.unwrap();
    assert!(orientation.max > 0.0 && orientation.max <= delayed, "{orientation:?} {delayed}");
    assert!(orientation.max < 0.1_f64.to_radians(), "{orientation:?}");
    for worst in &program.worst_rapids {
        assert!(worst.orientation < 0.1_f64.to_radians(), "{worst:?}");
    }
}

/// Returns the distance of a point from the line between two others.
fn from_line(point: [f64; 3], from: [f64; 3], to: [f64; 3]) -> f64 {
    let step: Vec<f64> = (0..3).map(|i| to[i] - from[i]).collect();
    let square = step.iter().map(|value| value * value).sum::<f64>();
    let along = (0..3).map(|i| step[i] * (point[i] - from[i])).sum::<f64>() / square.max(f64::MIN_POSITIVE);
    let along = along.clamp(0.0, 1.0);
    (0..3).map(|i| (point[i] - from[i] - along * step[i]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn errors_are_those_against_the_programmed_corner() {
    // A corner between lines of 80 mm is passed at the tolerance.
    for (tolerance, feed) in [(0.2, 600.0), (0.05, 100.0), (1.0, 1500.0)] {
        let text = format!("G21 G90 G64 P{tolerance}\nG1 X80 F{feed}\nY80\nM2\n");
        let Run { program, cycles, .. } = run(&format!("corner_{tolerance}.nc"), &text);
        let cuts = program.cuts.unwrap();
        assert!(program.rapids.is_none() || program.rapids.unwrap().max < 1e-6);
        assert!((cuts.blending / (1e-3 * tolerance) - 1.0).abs() < 0.01, "{tolerance}: {cuts:?}");
        let start = cycles[0].tip;
        let at = |x: f64, y: f64| [start[0] + 0.08 * x, start[1] + 0.08 * y, start[2]];
        let expected = |cycle: &CycleError| {
            let lines = [(at(0.0, 0.0), at(1.0, 0.0)), (at(1.0, 0.0), at(1.0, 1.0))];
            lines.map(|(from, to)| from_line(cycle.tip, from, to)).into_iter().fold(f64::INFINITY, f64::min)
        };
        for cycle in &cycles {
            assert!((cycle.contour_error - expected(cycle)).abs() < 1e-9, "{cycle:?}");
            assert!(cycle.contour_error <= cycle.blending + cycle.drives + 1e-12, "{cycle:?}");
        }
        // The corner itself is farthest from the tool path.
        let corner = at(1.0, 0.0);
        let tips = cycles.windows(2).map(|pair| from_line(corner, pair[0].tip, pair[1].tip));
        let largest = tips.fold(f64::INFINITY, f64::min);
        assert!((cuts.max - largest).abs() < 1e-9, "{cuts:?} {largest}");
        assert!(cuts.max <= cuts.blending + cuts.drives);
        let worst = &program.worst_lines[0];
        let CycleError { contour_error, blending, drives, .. } = worst.cycle;
        assert!(contour_error == cuts.max && contour_error <= blending + drives + 1e-12, "{worst:?}");
        // Also with a tolerance so wide that the path turns in a curve.
        assert!(matches!(worst.cause, Cause::Corner), "{worst:?}");
    }
}

#[test]
fn errors_of_arcs_and_of_exact_paths_have_no_share_of_blending() {
    // A circle of 20 mm on an exact path: the polyline of setpoints is within its sagitta.
    let Run { program, cycles, .. } = run("circle.nc", "G21 G90 G61 G17\nG1 X20 F3000\nG3 I-20\nG1 X0\nM2\n");
    let cuts = program.cuts.unwrap();
    // 50 mm/s in cycles of 6 ms.
    let sagitta = 0.3e-3_f64.powi(2) / (8.0 * 20e-3);
    assert!(cuts.blending < 1.1 * sagitta, "{cuts:?}");
    let start = cycles[0].tip;
    // Away from both ends, where the path is followed in order.
    let (first, last) = (22e-3, 18e-3 + TAU * 20e-3);
    for cycle in cycles.iter().filter(|cycle| (first..last).contains(&cycle.path_position)) {
        let radius = (cycle.tip[0] - start[0]).hypot(cycle.tip[1] - start[1]);
        let expected = (radius - 20e-3).abs();
        assert!((cycle.contour_error - expected).abs() < 1e-8, "{cycle:?} {expected}");
    }
}

#[test]
fn the_path_of_a_turning_table_has_no_share_of_blending_on_an_exact_path() {
    // The tip stands on the workpiece or moves along a line while the tables turn.
    let text = "G21 G90 G61.1 G43.4 H1\nG1 X10 Y5 Z20 F3000\nX30 A-20 C40\nX0 A0 C0\nM2\n";
    let cuts = run("tables.nc", text).program.cuts.unwrap();
    assert!(cuts.blending < 0.2e-6, "{cuts:?}");
    assert!((cuts.max - cuts.drives).abs() < 0.2e-6, "{cuts:?}");
}

/// Two operations, a rapid approach to each, a dwell, and two tool changes.
const OPERATIONS: &str = "G21 G90 G17 G64
T1 M6
(Face)
G0 X20 Y10 Z-5
G1 X60 F1200
G4 P0.5
(Drill)
T7 M6
S5000 M3
G0 X10
G1 Y40 F600
M2
";

#[test]
fn times_and_energy_by_operation_and_tool_add_up_to_those_of_the_program() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("operations.nc");
    fs::write(&path, OPERATIONS).unwrap();
    let (machine, name) = (machine(), path.to_str().unwrap());
    let options = PartProgramOptions {
        tool_change_time: Some(3.0),
        spindle_time: Some(1.2),
        ..PartProgramOptions::default()
    };
    let track = RefCell::new(ProgramTrack::default());
    let source = PartProgramSource::open(name, PROGRAMS, &machine, &options, &track).unwrap();
    let mut lines = LineErrors::new(&machine);
    let outcome = trial::run(&trial_of(&machine), SetpointSource::Grid(Box::new(source)), |tick| {
        lines.add(&tick, &mut track.borrow_mut());
        Ok(())
    });
    let figures = outcome.unwrap().figures;
    let program = lines.finish(name, PROGRAMS, &track.borrow(), |_| {}).unwrap();
    let summary = &program.operations;
    // A position cycle at each end of a kind of time, and the ramps of lines of 40 and 30 mm at 20 and 10 mm/s.
    let cycles = 3.0 * 6e-3;
    let times = summary.times;
    assert!((times.total() - program.cycle_time).abs() < 1e-9, "{times:?} of {}", program.cycle_time);
    assert!((times.dwell - 0.5).abs() < cycles, "{times:?}");
    assert!((times.auxiliary - 7.2).abs() < 2.0 * cycles, "{times:?}");
    assert!((5.0..5.4).contains(&times.feed) && times.rapid > 0.3, "{times:?}");

    let operations: Vec<_> =
        summary.operations.iter().map(|one| (one.line, one.text.as_str(), one.tool)).collect();
    let expected = [(0, "", Some(1)), (3, "Face", Some(1)), (7, "Drill", Some(7))];
    assert_eq!(operations, expected);
    let [start, face, drill] = &summary.operations[..] else { panic!("{:?}", summary.operations) };
    assert!(start.times.total() == start.times.auxiliary && (start.times.total() - 3.0).abs() < cycles);
    assert!((face.times.dwell - 0.5).abs() < cycles && face.times.auxiliary == 0.0, "{face:?}");
    assert!((2.0..2.2).contains(&face.times.feed) && (3.0..3.2).contains(&drill.times.feed));
    assert!((drill.times.auxiliary - 4.2).abs() < cycles && drill.times.dwell == 0.0, "{drill:?}");

    let total = |times: Vec<f64>| times.iter().sum::<f64>();
    let [first, second] = &summary.tools[..] else { panic!("{:?}", summary.tools) };
    assert_eq!([first.tool, second.tool], [Some(1), Some(7)]);
    assert!((first.times.total() - start.times.total() - face.times.total()).abs() < 1e-9);
    assert!((second.times.total() - drill.times.total()).abs() < 1e-9);

    let input = total(figures.axes.iter().map(|axis| axis.energy.unwrap().input).collect());
    let of_tools = total(summary.tools.iter().map(|tool| tool.energy.unwrap().input).collect());
    let of_operations = total(summary.operations.iter().map(|one| one.energy.unwrap().input).collect());
    let of_lines = total(summary.energy_lines.iter().map(|line| line.energy.input).collect());
    for sum in [of_tools, of_operations] {
        assert!(input > 1.0 && (sum / input - 1.0).abs() < 1e-9, "{sum} J of {input} J");
    }
    // The lines do not have the energy before the first motion.
    assert!(0.5 * input < of_lines && of_lines < input, "{of_lines} J of {input} J");
    assert!(summary.energy_lines.is_sorted_by(|a, b| a.energy.input >= b.energy.input));
    assert!(
        summary.energy_lines.iter().all(|line| line.line > 0 && !line.text.is_empty()),
        "{:?}",
        summary.energy_lines
    );
}

/// Without energy in the figures there is none by operation, and the times are the same, as are those of the setpoints
/// without a simulation.
#[test]
fn times_do_not_need_energy() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("times.nc");
    fs::write(&path, POCKET.replacen("G1 X20 Y30", "(Slot)\nT2 M6\nG4 P0.3\nG1 X20 Y30", 1)).unwrap();
    let (machine, name) = (machine(), path.to_str().unwrap());
    let times = |measures| {
        let (track, options) = (RefCell::new(ProgramTrack::default()), PartProgramOptions::default());
        let source = PartProgramSource::open(name, PROGRAMS, &machine, &options, &track).unwrap();
        let mut lines = LineErrors::new(&machine);
        let trial = Trial { measures, ..trial_of(&machine) };
        let outcome = trial::run(&trial, SetpointSource::Grid(Box::new(source)), |tick| {
            lines.add(&tick, &mut track.borrow_mut());
            Ok(())
        });
        outcome.unwrap();
        lines.finish(name, PROGRAMS, &track.borrow(), |_| {}).unwrap().operations
    };
    let (with, without) = (times(Measures::ALL), times(Measures::WITHOUT_CIRCLES));
    assert!(with.tools[0].energy.is_some() && without.tools[0].energy.is_none());
    assert!(without.energy_lines.is_empty() && with.times == without.times);

    let (track, options) = (RefCell::new(ProgramTrack::default()), PartProgramOptions::default());
    let mut source = PartProgramSource::open(name, PROGRAMS, &machine, &options, &track).unwrap();
    let (mut meter, mut row) = (OperationMeter::new(&machine), vec![0.0; machine.axes().len()]);
    while source.next(&mut row).unwrap() {
        let (_, activity) = track.borrow_mut().setpoints.pop_front().unwrap();
        meter.add_time(&track.borrow().comments, activity);
    }
    let planned = meter.finish(&track.borrow().comments);
    assert!(planned.operations.len() > 1);
    assert_eq!((planned.operations, planned.tools), (without.operations, without.tools));
    assert!((planned.times.dwell - 0.3).abs() < 0.0061 && planned.times == without.times);
}

/// Returns the errors of `text` against the path of `reference`.
fn errors_against(name: &str, [text, reference]: [&str; 2]) -> virtual_axes_nc::offline::ProgrammedErrors {
    let (machine, options) = (machine(), PartProgramOptions::default());
    let track = RefCell::new(ProgramTrack::default());
    let mut row = vec![0.0; machine.axes().len()];
    let mut source = PartProgramSource::read(reference, (name, None), &machine, &options, &track).unwrap();
    while source.next(&mut row).unwrap() {}
    drop(source);
    let mut lines = LineErrors::new(&machine).with_reference(track.take().programmed);
    let source = PartProgramSource::read(text, (name, None), &machine, &options, &track).unwrap();
    trial::run(&trial_of(&machine), SetpointSource::Grid(Box::new(source)), |tick| {
        lines.add(&tick, &mut track.borrow_mut());
        Ok(())
    })
    .unwrap();
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, text).unwrap();
    let figures = lines.finish(path.to_str().unwrap(), PROGRAMS, &track.borrow(), |_| ()).unwrap();
    figures.cuts.unwrap()
}

#[test]
fn errors_against_another_program_contain_the_distance_of_its_path() {
    // A slow cut on a line 50 µm beside that of the reference, after a rest; then away from and back to the start.
    let program = |y: &str| {
        format!("G21 G90 G64 P0.001\nG0 X10 Y0\nG4 P0.5\nG1 Y{y} F60\nX40 F300\nX10\nY0 F60\nG0 X0\nM2\n")
    };
    let [near, moved] = [program("5"), program("5.05")];
    let own = errors_against("own.nc", [&near, &near]);
    assert_eq!(own, run("own_path.nc", &near).program.cuts.unwrap());
    let found = errors_against("moved.nc", [&moved, &near]);
    assert!((found.max - 50e-6).abs() < own.max, "{found:?} {own:?}");
    assert!(found.rms > 30e-6, "{found:?}");
}

#[test]
fn short_lines_bound_their_corners_which_a_note_says() {
    let notes = |tolerance: &str| {
        let text = format!("G21 G90 G17\nG64 {tolerance}\nG1 X100 F15000\nY100\nX0\nY0\nM2\n");
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("corners.ngc");
        fs::write(&path, text).unwrap();
        let (machine, name) = (machine(), path.to_str().unwrap());
        let (track, options) = (RefCell::new(ProgramTrack::default()), PartProgramOptions::default());
        let mut source = PartProgramSource::open(name, PROGRAMS, &machine, &options, &track).unwrap();
        let mut row = vec![0.0; machine.axes().len()];
        while source.next(&mut row).unwrap() {}
        let notes = track.borrow().notes();
        notes.into_iter().filter(|(_, note)| note.contains("corners")).collect::<Vec<_>>()
    };
    assert_eq!(notes("P5"), []);
    // Knots of a quarter of 100 mm, two unit directions at a right angle: 25 √2 / 6.
    let text = "G64 P: 3 corners are passed nearer than P, at most 5.893 mm away: the lines beside them are too short";
    assert_eq!(notes("P10"), [(4, text.to_owned())]);
}
