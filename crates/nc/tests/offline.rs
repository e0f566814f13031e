//! Errors of simulated part programs: motions at feed apart from rapid traverse, orientation of a standing tip.

use std::cell::RefCell;
use std::fs;
use std::path::Path;

use virtual_axes_builtin::PROGRAMS;
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::trial::{self, Figures, GridRows, GridSource, Measures, SetpointSource, Trial};
use virtual_axes_nc::offline::{
    LineErrors, PartProgramOptions, PartProgramSource, ProgramFigures, ProgramTrack,
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

/// Simulates a program; returns its figures, those of its lines, and its setpoints with their kinds of motion.
fn run(name: &str, text: &str) -> (Figures, ProgramFigures, Vec<f64>, Vec<bool>) {
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
    let mut lines = LineErrors::new(&machine);
    let source = SetpointSource::Grid(Box::new(open()));
    let outcome = trial::run(&trial_of(&machine), source, |tick| {
        lines.add(&tick, &mut track.borrow_mut());
        Ok(())
    });
    let program = lines.finish(name, PROGRAMS, &track.borrow(), |_| ()).unwrap();
    (outcome.unwrap().figures, program, rows, rapid)
}

#[test]
fn motions_at_feed_and_rapid_traverse_have_errors_of_their_own() {
    let (figures, program, rows, mut rapid) = run("pocket.nc", POCKET);
    let contour = figures.contour.unwrap();
    let rapids = contour.rapids.unwrap();
    // At up to 30 m/min the axes deviate more than at 0.6 m/min.
    assert!(contour.max > 0.0 && rapids.max > contour.max, "{contour:?}");
    let lines = |lines: &[virtual_axes_nc::offline::WorstLine]| -> Vec<usize> {
        let mut numbers: Vec<usize> = lines.iter().map(|worst| worst.line).collect();
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
    let (figures, program, ..) = run("turns.nc", TURNS);
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
