//! Programs in the manner of each dialect: tests/dialects has their texts, each with the motions and events that follow
//! from hand-worked geometry.
//!
//! A file `fanuc_cycles.txt` has sections `== name`, the program, `--`, and the expected result in mm, degrees and min:
//!
//! - `G0 X1 Y2`, `G1 Z-3 F100`, `G3 X0 Y10 I0 J0`: all motions by their ends, axes without a word keep their place; I, J, K
//!   are absolute centers, L the swept angle if it is not that of at most one turn, D the duration of inverse time, s
//! - `P0`, `P1` with X Y Z I J K, or I J K: tip and axis of the tool in the workpiece, in `== name on the machine`
//! - `last X1 Y2`, `count 5`, `feed 120.5`: end of the last motion, number of motions, length of all motions at feed, mm
//! - `dwell 0.5`, `spindle -500`, `tool 3`, `stop`, `message A`: all events of this kind, in their order
//! - `note text`, `reject text`: part of an assumption, of the rejection

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::io::Cursor;
use std::path::Path;

use nalgebra::Vector3;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, TipTransform, Tool};
use virtual_axes_nc::motion::{
    AXIS_LETTERS, Coordinates, Feed, MotionKind, PlanarArc, ProgramEvent, ProgramMotion, ProgramStep,
};

use crate::sinumerik::orientation::machine;

/// Rounding of expected values with four decimals, mm and degrees.
const TOLERANCE: f64 = 6e-5;

/// Program with its expected result.
struct Case {
    name: String,
    program: String,
    expected: Vec<String>,
}

fn cases(dialect: Dialect) -> Vec<Case> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dialects");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).expect("the programs").map(|entry| entry.expect("a file").path()).collect();
    files.sort();
    let mut cases = Vec::new();
    for file in files {
        let stem = file.file_stem().expect("a name").to_string_lossy();
        if stem.split('_').next() != Some(dialect.name()) {
            continue;
        }
        let text = std::fs::read_to_string(&file).expect("a text");
        for section in text.split("\n== ").skip(1) {
            let (name, rest) = section.split_once('\n').expect("a program");
            let (program, expected) =
                rest.split_once("\n--\n").unwrap_or_else(|| panic!("{name}: no result"));
            let expected = expected.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
            cases.push(Case {
                name: format!("{stem}: {name}"),
                program: format!("{program}\n"),
                expected: expected.filter(|line| !line.is_empty()).map(str::to_owned).collect(),
            });
        }
    }
    cases
}

fn options(dialect: Dialect, is_on_machine: bool) -> InterpreterOptions {
    let mut options = match is_on_machine {
        true => InterpreterOptions::for_machine(&machine()),
        false => InterpreterOptions::default(),
    };
    options.dialect = Some(dialect);
    options.axes[6..].fill(false);
    for (number, length, radius) in [(1, 0.050, 0.005), (2, 0.040, 0.002), (3, 0.0, 0.003)] {
        options.tools.insert(number, Tool { length, radius, name: Some(format!("MILL_{number}")) });
    }
    if !is_on_machine {
        options.work_offsets[1][..3].copy_from_slice(&[0.1, 0.05, 0.0]);
        // G54.1 P1.
        options.work_offsets[9][..3].copy_from_slice(&[0.0, 0.2, 0.01]);
        options.references =
            [[0.0, 0.0, 0.3], [-0.05, -0.06, 0.25]].map(|[x, y, z]| [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        options.upper_limits[..3].fill(0.5);
    }
    options
}

/// Returns the words of an expected line.
fn words(line: &str) -> Result<BTreeMap<char, f64>, String> {
    let word = |text: &str| {
        let letter = text.chars().next()?;
        Some((letter, text[1..].parse().ok()?))
    };
    line.split_whitespace().skip(1).map(|text| word(text).ok_or(format!("{line:?} is invalid"))).collect()
}

fn units(coordinates: &Coordinates) -> [f64; 6] {
    std::array::from_fn(|axis| coordinates[axis] * if axis < 3 { 1e3 } else { 180.0 / PI })
}

fn is_close(found: f64, expected: f64) -> bool {
    (found - expected).abs() < TOLERANCE
}

/// Compares a motion with its line; `place` is the end before and becomes that of the line.
fn compare(motion: &ProgramMotion, line: &str, place: &mut [f64; 6]) -> Result<(), String> {
    let words = words(line)?;
    for (axis, letter) in AXIS_LETTERS.iter().enumerate().take(6) {
        place[axis] = words.get(letter).copied().unwrap_or(place[axis]);
    }
    let (found, kind) = (units(&motion.end), line.split(' ').next().unwrap_or_default());
    if let Some(axis) = (0..6).find(|axis| !is_close(found[*axis], place[*axis])) {
        return Err(format!("{} {} in place of {line}", AXIS_LETTERS[axis], found[axis]));
    }
    let is_of_kind = match (&motion.kind, kind) {
        (MotionKind::Rapid, "G0") | (MotionKind::Line, "G1") => true,
        (MotionKind::Arc(arc), "G2" | "G3") => {
            let [first, second, _] = arc.plane.axes();
            let center = [first, second].map(|axis| words.get(&['I', 'J', 'K'][axis]).copied());
            let is_center = center
                .iter()
                .zip(arc.center)
                .all(|(expected, found)| expected.is_some_and(|expected| is_close(found * 1e3, expected)));
            let sign = if kind == "G2" { -1.0 } else { 1.0 };
            is_center
                && is_close(
                    sign * arc.sweep.to_degrees(),
                    words.get(&'L').copied().unwrap_or_else(|| sweep(motion, arc, sign)),
                )
        }
        _ => false,
    };
    let is_at_feed = match motion.feed {
        Feed::Linear(feed) => words.get(&'F').is_none_or(|expected| is_close(feed * 60e3, *expected)),
        Feed::Rotary(feed) => {
            words.get(&'F').is_none_or(|expected| is_close(feed.to_degrees() * 60.0, *expected))
        }
        Feed::Duration(time) => words.get(&'D').is_some_and(|expected| is_close(time, *expected)),
        Feed::Rapid => !words.contains_key(&'F'),
    };
    if is_of_kind && is_at_feed {
        Ok(())
    } else {
        Err(format!("{:?} {:?} in place of {line}", motion.kind, motion.feed))
    }
}

/// Returns the angle from start to end about the center of an arc, above 0 and at most 360°.
fn sweep(motion: &ProgramMotion, arc: &PlanarArc, sign: f64) -> f64 {
    let [first, second, _] = arc.plane.axes();
    let angle = |point: &Coordinates| (point[second] - arc.center[1]).atan2(point[first] - arc.center[0]);
    let turn = (sign * (angle(&motion.end) - angle(&motion.start))).rem_euclid(TAU).to_degrees();
    if !(1e-6..360.0 - 1e-6).contains(&turn) { 360.0 } else { turn }
}

/// Compares the pose of the tool in the workpiece at the end of a motion.
fn compare_pose(motion: &ProgramMotion, line: &str) -> Result<(), String> {
    let words = words(line)?;
    let machine = machine();
    let joints = TipTransform::new(&machine).joints(&motion.end, motion.tcp_length);
    let pose = Kinematics::new(&machine).forward(&joints);
    let vector = |letters: [char; 3]| {
        Vector3::from(letters.map(|letter| words.get(&letter).copied().unwrap_or(f64::NAN)))
    };
    let (tip, axis) = (vector(['X', 'Y', 'Z']), vector(['I', 'J', 'K']).normalize());
    let is_rapid = line.starts_with("P0");
    let is_at_tip = !words.contains_key(&'X') || (pose.tip * 1e3 - tip).norm() < TOLERANCE;
    let is_close = is_at_tip && (pose.axis - axis).norm() < TOLERANCE;
    match is_close && is_rapid == matches!(motion.kind, MotionKind::Rapid) {
        true => Ok(()),
        false => Err(format!("{:?} {:?} in place of {line}", pose.tip * 1e3, pose.axis)),
    }
}

/// Returns an event as an expected line has it.
fn event(event: &ProgramEvent) -> Option<(&'static str, String)> {
    let rounded = |value: f64| format!("{}", (value * 1e4).round() / 1e4 + 0.0);
    Some(match event {
        ProgramEvent::Dwell(time) => ("dwell", rounded(*time)),
        ProgramEvent::Spindle(speed) => ("spindle", rounded(speed * 60.0 / TAU)),
        ProgramEvent::ToolChange(tool) => ("tool", tool.to_string()),
        ProgramEvent::Stop | ProgramEvent::OptionalStop => ("stop", String::new()),
        ProgramEvent::Message(text) => ("message", text.clone()),
        _ => return None,
    })
}

/// Returns the length of a motion along X, Y and Z, mm.
fn length(motion: &ProgramMotion) -> f64 {
    let moved = |axis: usize| motion.end[axis] - motion.start[axis];
    1e3 * match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let radius = (motion.start[first] - arc.center[0]).hypot(motion.start[second] - arc.center[1]);
            (radius * arc.sweep).hypot(moved(normal))
        }
        _ => moved(0).hypot(moved(1)).hypot(moved(2)),
    }
}

fn check(case: &Case, dialect: Dialect) -> Result<(), String> {
    let options = options(dialect, case.name.ends_with(" on the machine"));
    let mut interpreter = Interpreter::new(Cursor::new(case.program.as_bytes()), "part.nc", options);
    let mut steps = Vec::new();
    let mut rejection = None;
    for step in interpreter.by_ref() {
        match step {
            Ok(step) => steps.push(step),
            Err(error) => rejection = Some(error.to_string()),
        }
    }
    let expected = |word: &str| -> Vec<&str> {
        let of_word = |line: &String| line.split(' ').next() == Some(word);
        case.expected.iter().filter(|line| of_word(line)).map(|line| line[word.len()..].trim()).collect()
    };
    match (rejection, expected("reject").first()) {
        (None, None) => {}
        (Some(found), Some(text)) if found.contains(text) => return Ok(()),
        (found, text) => return Err(format!("rejection {found:?} in place of {text:?}")),
    }
    let motions: Vec<_> = steps
        .iter()
        .filter_map(|step| if let ProgramStep::Motion(motion) = step { Some(motion) } else { None })
        .collect();
    let mut is_checked = false;
    let lines: Vec<_> = case.expected.iter().filter(|line| line.starts_with(['G', 'P'])).collect();
    if !lines.is_empty() {
        is_checked = true;
        let mut place = [0.0; 6];
        for (motion, line) in motions.iter().zip(&lines) {
            match line.starts_with('G') {
                true => compare(motion, line, &mut place)?,
                false => compare_pose(motion, line)?,
            }
        }
        if motions.len() != lines.len() {
            let next = motions.get(lines.len()).map(|motion| units(&motion.end));
            return Err(format!("{} motions in place of {}; next {next:?}", motions.len(), lines.len()));
        }
    }
    for word in ["dwell", "spindle", "tool", "stop", "message"] {
        let wanted = expected(word);
        let found = steps.iter().filter_map(|step| match step {
            ProgramStep::Event { event: found, .. } => event(found),
            ProgramStep::Motion(_) => None,
        });
        let found: Vec<_> = found.filter(|(kind, _)| *kind == word).map(|(_, text)| text).collect();
        if !wanted.is_empty() && found != wanted {
            return Err(format!("{word} {found:?} in place of {wanted:?}"));
        }
        is_checked |= !wanted.is_empty();
    }
    for text in expected("note") {
        is_checked = true;
        let notes = &interpreter.report().assumptions;
        if !notes.iter().any(|(note, _)| note.contains(text)) {
            return Err(format!("notes {:?} in place of {text:?}", notes.iter().collect::<Vec<_>>()));
        }
    }
    let number = |word: &str| expected(word).first().map(|text| text.parse::<f64>().expect("a number"));
    if let Some(count) = number("count") {
        is_checked = true;
        if motions.len() as f64 != count {
            return Err(format!("{} motions in place of {count}", motions.len()));
        }
    }
    if let Some(expected) = number("feed") {
        is_checked = true;
        let is_at_feed = |motion: &&&ProgramMotion| !matches!(motion.kind, MotionKind::Rapid);
        let found: f64 = motions.iter().filter(is_at_feed).map(|motion| length(motion)).sum();
        // A rounding for each motion.
        if (found - expected).abs() > TOLERANCE * (motions.len() as f64).max(1.0) {
            return Err(format!("feed along {found} mm in place of {expected}"));
        }
    }
    if let Some(line) = case.expected.iter().find(|line| line.starts_with("last ")) {
        is_checked = true;
        let found = units(&motions.last().ok_or("no motion")?.end);
        for (letter, expected) in words(line)? {
            let axis = AXIS_LETTERS.iter().position(|axis| *axis == letter).expect("an axis");
            if !is_close(found[axis], expected) {
                return Err(format!("{found:?} in place of {line}"));
            }
        }
    }
    if is_checked { Ok(()) } else { Err("no expected result".to_owned()) }
}

/// Runs the programs of a dialect, of which there are at least `least`.
fn run(dialect: Dialect, least: usize) {
    let cases = cases(dialect);
    let failure = |case: &Case| check(case, dialect).err().map(|reason| format!("{}: {reason}", case.name));
    let failures: Vec<_> = cases.iter().filter_map(failure).collect();
    assert!(failures.is_empty(), "{} of {} programs:\n{}", failures.len(), cases.len(), failures.join("\n"));
    assert!(cases.len() >= least, "{} programs", cases.len());
}

#[test]
fn programs_of_fanuc() {
    run(Dialect::Fanuc, 60);
}

#[test]
fn programs_of_haas() {
    run(Dialect::Haas, 60);
}

#[test]
fn programs_of_sinumerik() {
    run(Dialect::Sinumerik, 60);
}

#[test]
fn programs_of_grbl() {
    run(Dialect::Grbl, 90);
}

#[test]
fn programs_of_marlin() {
    run(Dialect::Marlin, 20);
}

#[test]
fn programs_of_mach3() {
    run(Dialect::Mach3, 70);
}

#[test]
fn programs_of_okuma() {
    run(Dialect::Okuma, 40);
}
