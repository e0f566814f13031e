//! Validation of part programs: words, extents and travel limits.

use std::error::Error;
use std::f64::consts::FRAC_PI_2;
use std::io::{self, BufRead};
use std::path::Path;

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::text::escaped;
use virtual_axes_core::units::{MILLIMETER, Rounded, position_text};
use virtual_axes_io::files::{self, InputError};
use virtual_axes_nc::builtin::{BuiltinProgram, open_program};
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions, TipTransform};
use virtual_axes_nc::motion::{Coordinates, Feed, MotionKind, ProgramEvent, ProgramMotion, ProgramStep};

use crate::interrupt;
use crate::program_text::joint_line;
use crate::progress::TrialProgress;

/// Extensions of part programs.
const EXTENSIONS: [&str; 8] = ["nc", "ngc", "tap", "cnc", "mpf", "gcode", "iso", "eia"];
/// Number of intervals in which the joints of a curved motion are evaluated.
const SAMPLES: u32 = 32;
/// Distance beyond a travel limit that is the rounding of a program, m or rad.
const ROUNDING: f64 = 1e-9;

/// Returns true for a built-in part program and for a file with the extension of one.
pub fn is_part_program(name: &str) -> bool {
    let extension = Path::new(name).extension().and_then(|extension| extension.to_str());
    let is_known = |extension: &str| EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known));
    BuiltinProgram::find(name).is_some() || extension.is_some_and(is_known)
}

/// Opens a file that is no part program and detects its kind; the error of an unknown one names the extensions of part
/// programs.
pub fn open_other(path: &Path) -> Result<files::Input, String> {
    files::Input::open(path).map_err(|error| match error {
        InputError::Unknown { .. } | InputError::Syntax { is_first_line: true, .. } => {
            format!("{error}; part programs have the extension {}", EXTENSIONS.join(", "))
        }
        InputError::Unreadable { .. } | InputError::Syntax { .. } => error.to_string(),
    })
}

/// Returns the number of lines of a part program.
///
/// # Errors
///
/// Returns an error of the operating system.
pub fn count_lines(name: &str) -> io::Result<u64> {
    let mut reader = open_program(name)?;
    let (mut lines, mut is_open) = (0, false);
    loop {
        let bytes = reader.fill_buf()?;
        let Some(last) = bytes.last() else { return Ok(lines + u64::from(is_open)) };
        lines += bytes.iter().filter(|byte| **byte == b'\n').count() as u64;
        is_open = *last != b'\n';
        let length = bytes.len();
        reader.consume(length);
    }
}

/// Validates words, axes and travel limits of a part program on a machine and returns a summary.
pub fn check(
    name: &str,
    machine: &MachineConfig,
    ignored: &[u32],
    progress: &mut TrialProgress,
) -> Result<String, Box<dyn Error>> {
    let source = open_program(name).map_err(|error| format!("{name}: {error}"))?;
    let mut options = InterpreterOptions::for_machine(machine);
    options.ignored_m_codes = ignored.to_vec();
    let transform = TipTransform::new(machine);
    let mut summary = ProgramSummary::new(&transform.joints(&options.start, None));
    let mut steps = Interpreter::new(source, &escaped(name), options);
    while let Some(step) = steps.next() {
        interrupt::check()?;
        progress.set_line(steps.line());
        match step? {
            ProgramStep::Motion(motion) => {
                summary.add(&motion, &transform);
                summary
                    .require_travel(machine, &motion)
                    .map_err(|error| format!("{}:{error}", escaped(name)))?;
            }
            ProgramStep::Event { event: ProgramEvent::Dwell(time), .. } => summary.time += time,
            ProgramStep::Event { .. } => {}
        }
    }
    Ok(summary.text(machine))
}

/// Counts, lengths and extents of a part program.
struct ProgramSummary {
    rapid: usize,
    lines: usize,
    arcs: usize,
    splines: usize,
    /// Length of the path at feed, m.
    length: f64,
    /// Shortest motion at feed, m.
    shortest: f64,
    /// Time at the programmed feed, with dwells, s.
    time: f64,
    start: Vec<f64>,
    end: Vec<f64>,
    ranges: Vec<[f64; 2]>,
}

impl ProgramSummary {
    fn new(start: &[f64]) -> Self {
        let ranges = start.iter().map(|value| [*value; 2]).collect();
        let (start, end) = (start.to_vec(), start.to_vec());
        let (length, time) = (0.0, 0.0);
        Self {
            rapid: 0,
            lines: 0,
            arcs: 0,
            splines: 0,
            length,
            shortest: f64::INFINITY,
            time,
            start,
            end,
            ranges,
        }
    }

    /// Adds a motion.
    fn add(&mut self, motion: &ProgramMotion, transform: &TipTransform) {
        match motion.kind {
            MotionKind::Rapid => self.rapid += 1,
            MotionKind::Line => self.lines += 1,
            MotionKind::Arc(_) => self.arcs += 1,
            MotionKind::Nurbs(_) => self.splines += 1,
        }
        let length = length(motion);
        if motion.feed != Feed::Rapid && length > 0.0 {
            self.length += length;
            self.shortest = self.shortest.min(length);
        }
        self.time += match motion.feed {
            Feed::Rapid => 0.0,
            Feed::Linear(feed) => length / feed,
            Feed::Rotary(feed) => norm(motion, 3..6) / feed,
            Feed::Duration(time) => time,
        };
        for position in positions(motion) {
            self.end = transform.joints(&position, motion.tcp_length);
            for (range, value) in self.ranges.iter_mut().zip(&self.end) {
                *range = [range[0].min(*value), range[1].max(*value)];
            }
        }
    }

    /// Rejects positions outside of the travel limits.
    fn require_travel(&self, machine: &MachineConfig, motion: &ProgramMotion) -> Result<(), String> {
        for (axis, range) in machine.axes().iter().zip(&self.ranges) {
            let limits = axis.limits();
            let beyond = range.iter().find(|value| {
                **value < limits.travel_min - ROUNDING || **value > limits.travel_max + ROUNDING
            });
            if let Some(value) = beyond {
                let unit = if axis.kind() == AxisKind::Linear { "m" } else { "rad" };
                let [value, least, most] =
                    [*value, limits.travel_min, limits.travel_max].map(|value| position_text(value, unit));
                let (line, name) = (motion.line, axis.name());
                return Err(format!(
                    "{line}: {name} at {value} is outside of its travel limits {least} to {most}"
                ));
            }
        }
        Ok(())
    }

    fn text(&self, machine: &MachineConfig) -> String {
        let Self { rapid, lines, arcs, splines, length, .. } = self;
        let shortest = match self.shortest.is_finite() {
            true => format!(", shortest motion {} mm", Rounded(self.shortest / MILLIMETER)),
            false => String::new(),
        };
        let joints = machine
            .axes()
            .iter()
            .enumerate()
            .filter(|(joint, _)| self.ranges[*joint][1] > self.ranges[*joint][0]);
        let joints: String = joints
            .map(|(joint, axis)| {
                joint_line(axis, [self.start[joint], self.end[joint]], self.ranges[joint], None)
            })
            .collect();
        format!(
            "part program for {}: {:.3} s at the programmed feed, without rapid traverse and acceleration\n\
             motions: {rapid} rapid, {lines} lines, {arcs} arcs, {splines} splines; {} m at feed{shortest}\n\
             {joints}",
            escaped(machine.name()),
            self.time,
            Rounded(*length),
        )
    }
}

/// Returns the Euclidean norm of the distances along some axes, m or rad.
fn norm(motion: &ProgramMotion, axes: std::ops::Range<usize>) -> f64 {
    axes.map(|axis| (motion.end[axis] - motion.start[axis]).powi(2)).sum::<f64>().sqrt()
}

/// Returns the length of a motion along X, Y and Z, or U, V and W, m. Of a spline it is that of the control polygon.
fn length(motion: &ProgramMotion) -> f64 {
    match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let radius = (motion.start[first] - arc.center[0]).hypot(motion.start[second] - arc.center[1]);
            (radius * arc.sweep).hypot(motion.end[normal] - motion.start[normal])
        }
        MotionKind::Nurbs(spline) => {
            let distance =
                |pair: &[([f64; 2], f64)]| (pair[1].0[0] - pair[0].0[0]).hypot(pair[1].0[1] - pair[0].0[1]);
            spline.control.windows(2).map(distance).sum()
        }
        _ => match norm(motion, 0..3) {
            0.0 => norm(motion, 6..9),
            length => length,
        },
    }
}

/// Returns positions of a motion that contain the extreme ones of each joint, with the end as the last: exact for lines and
/// arcs without tool center point control, samples otherwise.
fn positions(motion: &ProgramMotion) -> Vec<Coordinates> {
    let mut fractions: Vec<f64> = match (&motion.kind, motion.tcp_length) {
        (_, Some(_)) => (0..SAMPLES).map(|step| f64::from(step) / f64::from(SAMPLES)).collect(),
        (MotionKind::Arc(arc), None) => {
            let [first, second, _] = arc.plane.axes();
            let from = (motion.start[second] - arc.center[1]).atan2(motion.start[first] - arc.center[0]);
            let first = if arc.sweep > 0.0 { (from / FRAC_PI_2).ceil() } else { (from / FRAC_PI_2).floor() };
            // One turn has all extreme points.
            let quadrants = (0..4).map(|step| (first + f64::from(step) * arc.sweep.signum()) * FRAC_PI_2);
            quadrants.map(|angle| (angle - from) / arc.sweep).filter(|fraction| *fraction < 1.0).collect()
        }
        (MotionKind::Nurbs(spline), None) => {
            let count = SAMPLES * spline.control.len() as u32;
            (0..count).map(|step| f64::from(step) / f64::from(count)).collect()
        }
        _ => Vec::new(),
    };
    fractions.push(1.0);
    fractions.into_iter().map(|fraction| at(motion, fraction)).collect()
}

/// Returns the position at a fraction of a motion.
fn at(motion: &ProgramMotion, fraction: f64) -> Coordinates {
    let mut position: Coordinates =
        std::array::from_fn(|axis| motion.start[axis] + fraction * (motion.end[axis] - motion.start[axis]));
    if let (MotionKind::Arc(arc), true) = (&motion.kind, fraction < 1.0) {
        let [first, second, _] = arc.plane.axes();
        let [x, y] = [motion.start[first] - arc.center[0], motion.start[second] - arc.center[1]];
        let (sin, cos) = (arc.sweep * fraction).sin_cos();
        position[first] = arc.center[0] + x * cos - y * sin;
        position[second] = arc.center[1] + x * sin + y * cos;
    }
    if let (MotionKind::Nurbs(spline), true) = (&motion.kind, fraction < 1.0) {
        let [first, second, _] = spline.plane.axes();
        [position[first], position[second]] = spline.point(fraction);
    }
    position
}
