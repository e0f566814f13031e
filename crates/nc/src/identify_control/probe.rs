//! Part program that shows the profile of a control.

use std::f64::consts::PI;

use virtual_axes_core::config::{AxisKind, MachineConfig};

use crate::interpret::WorkOffset;
use crate::motion::AXIS_LETTERS;
use crate::offline::PartProgramOptions;

/// Largest distance of a linear axis from the middle of the travel, m, and of a rotary one, rad.
const REACH: [f64; 2] = [0.2, PI / 4.0];
/// Speeds of single axes, as parts of the largest one.
const SPEEDS: [f64; 6] = [0.01, 0.03, 0.08, 0.2, 0.4, 0.7];
/// Time at constant speed, s.
const CONSTANT: f64 = 0.3;
/// Feed in corners, m/s, at most half of the largest, and length of their lines, m.
const CORNER_FEED: f64 = 0.1;
const CORNER_LINE: f64 = 0.04;
/// Tolerances, mm, and changes of direction, degrees, of corners.
const TOLERANCES: [f64; 3] = [0.01, 0.03, 0.1];
const TURNS: [f64; 5] = [30.0, 60.0, 90.0, 120.0, 150.0];
/// Radii of circles, mm.
const RADII: [f64; 4] = [3.0, 6.0, 12.0, 25.0];
/// Lengths of short lines, mm, largest length of a row, mm, and largest number of its lines.
const LINES: [f64; 8] = [0.02, 0.03, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0];
const ROW: f64 = 80.0;
const MOST_LINES: usize = 300;

/// Axis of the machine with a letter.
struct ProbedAxis {
    letter: char,
    /// Units of the program per m or rad.
    scale: f64,
    middle: f64,
    reach: f64,
    velocity: f64,
    acceleration: f64,
}

/// Returns a part program in G54, with the work offsets of the machine or those given, whose setpoints show the profile of a control:
/// motions of single axes at several feeds, corners of several angles and tolerances, circles, rows of short lines and
/// standstills, within the travel of the axes.
///
/// # Errors
///
/// Returns an error if a work offset is invalid, if the machine lacks X or Y, or if their travel is too short.
pub fn probe_program(machine: &MachineConfig, work_offsets: &[WorkOffset]) -> Result<String, String> {
    let options = PartProgramOptions { work_offsets: work_offsets.to_vec(), ..PartProgramOptions::default() };
    let offset = options.interpreter(machine)?.work_offsets[0];
    let axes: Vec<ProbedAxis> = machine
        .axes()
        .iter()
        .filter_map(|axis| {
            let letter = axis.name().to_uppercase();
            let letter = letter.chars().next().filter(|_| letter.len() == 1)?;
            let is_linear = axis.kind() == AxisKind::Linear;
            let limits = axis.limits();
            let travel = [limits.travel_min, limits.travel_max];
            let most = if is_linear { REACH[0] } else { REACH[1] };
            let (middle, reach) = match travel.iter().all(|end| end.is_finite()) {
                true => (f64::midpoint(travel[0], travel[1]), most.min(0.45 * (travel[1] - travel[0]))),
                false => (0.0_f64.clamp(travel[0], travel[1]), most),
            };
            let index = AXIS_LETTERS.iter().position(|other| *other == letter)?;
            let middle = middle - offset[index];
            let scale = if is_linear { 1e3 } else { 180.0 / PI };
            let (velocity, acceleration) = (limits.velocity, limits.acceleration);
            Some(ProbedAxis { letter, scale, middle, reach, velocity, acceleration })
        })
        .collect();
    let axis = |letter: char| axes.iter().find(|axis| axis.letter == letter);
    let (Some(x), Some(y)) = (axis('X'), axis('Y')) else {
        return Err(
            "the machine lacks X or Y: the program has corners and circles in the plane of both".to_owned()
        );
    };
    let needed = CORNER_LINE + 1e-3;
    if let Some(short) = [x, y].into_iter().find(|axis| axis.reach < needed) {
        return Err(format!(
            "{} can move by {:.0} mm, the program needs {:.0} mm",
            short.letter,
            2e3 * short.reach / 0.9,
            2e3 * needed / 0.9
        ));
    }
    let mut text = String::from("G21 G90 G94 G17 G61\n");
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    for axis in &axes {
        line(format!("G0 {}{:.4}", axis.letter, axis.scale * axis.middle));
    }
    line("G4 P0.2".to_owned());
    for axis in &axes {
        line(format!("(motions of {} alone)", axis.letter));
        let at = |position: f64| format!("{}{:.4}", axis.letter, axis.scale * (axis.middle + position));
        for side in [-1.0, 1.0, -1.0] {
            line(format!("G0 {}\nG4 P0.2", at(side * axis.reach)));
        }
        for part in SPEEDS {
            let speed = part * axis.velocity;
            let length = speed * (CONSTANT + 1.5 * speed / axis.acceleration);
            let feed = 60.0 * axis.scale * speed;
            let most = 2.0 * axis.reach;
            if length > most {
                continue;
            }
            for end in [length, 0.0] {
                line(format!("G1 {} F{feed:.3}\nG4 P0.2", at(end - axis.reach)));
            }
        }
        line(format!("G64 P0.01\nG1 {} F{:.3}\nG4 P0.2\nG61", at(0.0), 24.0 * axis.scale * axis.velocity));
    }
    let point = |dx: f64, dy: f64| format!("X{:.4} Y{:.4}", 1e3 * x.middle + dx, 1e3 * y.middle + dy);
    let fastest = x.velocity.min(y.velocity);
    let feed = 60e3 * CORNER_FEED.min(0.5 * fastest);
    let leg = 1e3 * CORNER_LINE;
    line("(corners)".to_owned());
    let modes = TOLERANCES.map(|tolerance| (format!("G64 P{tolerance}"), &TURNS[..], feed));
    let others = [("G64".to_owned(), &TURNS[1..4], feed), ("G64".to_owned(), &TURNS[2..3], 0.5 * feed)];
    for (mode, turns, feed) in modes.into_iter().chain(others).chain([("G61".to_owned(), &TURNS[2..3], feed)])
    {
        for turn in turns {
            let (sine, cosine) = turn.to_radians().sin_cos();
            // The lines are on both sides of the middle.
            let start = [-0.5 * leg * (1.0 + cosine), -0.5 * leg * sine];
            line(format!("G61 G0 {}\nG4 P0.2", point(start[0], start[1])));
            line(format!("{mode} G1 {} F{feed:.3}", point(start[0] + leg, start[1])));
            line(format!("G1 {}\nG4 P0.2", point(start[0] + leg * (1.0 + cosine), start[1] + leg * sine)));
        }
    }
    line("G61 (circles)".to_owned());
    let feed = 60e3 * 0.7 * fastest;
    for radius in RADII {
        line(format!("G0 {}\nG4 P0.2", point(-radius, 0.0)));
        for code in ["G2", "G3"] {
            line(format!("{code} {} I{radius} J0 F{feed:.3}\nG4 P0.2", point(-radius, 0.0)));
        }
    }
    line("(rows of short lines)".to_owned());
    let feed = 60e3 * 0.7 * x.velocity;
    for length in LINES {
        let count = MOST_LINES.min((ROW / length) as usize);
        let start = -0.5 * length * count as f64;
        line(format!("G0 {}\nG4 P0.2\nG1 F{feed:.3}", point(start, 0.0)));
        for k in 1..=count {
            line(format!("X{:.4}", 1e3 * x.middle + start + length * k as f64));
        }
        line("G4 P0.2".to_owned());
    }
    text.push_str("M2\n");
    Ok(text)
}
