//! Canonical commands of rs274 and steps of the interpreter as comparable items, in mm, degrees and minutes.

use std::f64::consts::TAU;

use virtual_axes_nc::motion::{
    Feed, MotionKind, PathControl, Plane, ProgramEvent, ProgramMotion, ProgramStep,
};

/// Number of axes in the output of rs274: X, Y, Z, A, B, C.
const AXES: usize = 6;
/// Digits of the output of rs274.
const PRINTED: f64 = 0.5e-4;
/// Straight motions below this length are dropped on both sides, mm and degrees.
const STILL: f64 = 2e-4;

/// Motion or event with its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// Kind, turns and mode.
    pub kind: String,
    /// Numbers, each with its printed precision.
    pub numbers: Vec<(f64, f64)>,
}

impl Item {
    fn event(kind: impl Into<String>, numbers: &[f64]) -> Self {
        Self { kind: kind.into(), numbers: numbers.iter().map(|number| (*number, PRINTED)).collect() }
    }
}

/// Modes of rs274 that its later commands refer to.
struct Canon {
    /// Millimeters of the length unit.
    unit: f64,
    work: [f64; AXES],
    shift: [f64; AXES],
    tool: f64,
    /// Rotation of the work coordinate system, rad.
    rotation: f64,
    /// Pitch of synchronous motion, mm.
    pitch: Option<f64>,
    plane: Plane,
    /// Number of the feed command and its unit, mm.
    feed: (f64, f64),
    is_per_revolution: bool,
    speed: f64,
    direction: f64,
    path_control: (String, f64, f64),
    position: [f64; AXES],
    items: Vec<Item>,
}

/// Returns the items of a canonical output.
pub fn from_canon(text: &str) -> Vec<Item> {
    let mut canon = Canon {
        unit: 1.0,
        work: [0.0; AXES],
        shift: [0.0; AXES],
        tool: 0.0,
        rotation: 0.0,
        pitch: None,
        plane: Plane::Xy,
        feed: (0.0, 1.0),
        is_per_revolution: false,
        speed: 0.0,
        direction: 0.0,
        path_control: ("CANON_CONTINUOUS".to_owned(), 0.0, 0.0),
        position: [0.0; AXES],
        items: Vec::new(),
    };
    for line in text.lines() {
        let (command, rest) = line.split_once('(').expect("COMMAND(VALUES)");
        canon.command(command, rest.strip_suffix(')').expect("a closing parenthesis"));
        if command == "PROGRAM_END" || command == "FINISH" {
            break;
        }
    }
    without_stop_at_end(canon.items)
}

impl Canon {
    fn command(&mut self, command: &str, text: &str) {
        let words: Vec<&str> = text.split([',', ' ']).filter(|word| !word.is_empty()).collect();
        let numbers: Vec<f64> = words.iter().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
        let lengths = |first: usize| -> [f64; AXES] {
            std::array::from_fn(|axis| numbers[first + axis] * if axis < 3 { self.unit } else { 1.0 })
        };
        match command {
            "USE_LENGTH_UNITS" => self.unit = if text == "CANON_UNITS_INCHES" { 25.4 } else { 1.0 },
            "SET_G5X_OFFSET" => self.work = lengths(1),
            "SET_G92_OFFSET" => self.shift = lengths(0),
            "USE_TOOL_LENGTH_OFFSET" => self.tool = numbers[2] * self.unit,
            "SET_XY_ROTATION" => self.rotation = numbers[0].to_radians(),
            "START_SPEED_FEED_SYNC" => self.pitch = Some(numbers[0] * self.unit),
            "STOP_SPEED_FEED_SYNCH" => self.pitch = None,
            "RIGID_TAP" => {
                let (start, direction) = (self.position, self.direction);
                let mut end = start;
                end[..3]
                    .copy_from_slice(&self.machine([numbers[0], numbers[1], numbers[2], 0.0, 0.0, 0.0])[..3]);
                for (position, direction) in [(end, -direction), (start, direction)] {
                    self.position = position;
                    self.push_motion("line", &[], false);
                    self.spindle(self.speed, direction);
                }
            }
            "SELECT_PLANE" => {
                self.plane = match text {
                    "CANON_PLANE_XZ" => Plane::Zx,
                    "CANON_PLANE_YZ" => Plane::Yz,
                    _ => Plane::Xy,
                }
            }
            "SET_FEED_MODE" => self.is_per_revolution = numbers[1] == 1.0,
            "SET_FEED_RATE" => self.feed = (numbers[0], self.unit),
            "SET_MOTION_CONTROL_MODE" => {
                let tolerance = numbers.get(1).map_or(0.0, |tolerance| tolerance * self.unit);
                self.path_control = (words[0].to_owned(), tolerance, self.path_control.2);
            }
            "SET_NAIVECAM_TOLERANCE" => self.path_control.2 = numbers[0] * self.unit,
            "STRAIGHT_TRAVERSE" => self.straight("rapid", lengths(0)),
            "STRAIGHT_FEED" => self.straight("line", lengths(0)),
            "ARC_FEED" => self.arc(&numbers),
            "NURBS_FEED" => self.items.push(Item::event(format!("spline of {} points", words[0]), &[])),
            "SET_SPINDLE_SPEED" => self.spindle(numbers[1], self.direction),
            "START_SPINDLE_CLOCKWISE" => self.spindle(self.speed, 1.0),
            "START_SPINDLE_COUNTERCLOCKWISE" => self.spindle(self.speed, -1.0),
            "STOP_SPINDLE_TURNING" => self.spindle(self.speed, 0.0),
            "DWELL" => self.items.push(Item::event("dwell", &numbers)),
            "SELECT_TOOL" | "CHANGE_TOOL" => {
                self.items.push(Item::event(format!("{command} {}", words[0]), &[]))
            }
            "PROGRAM_STOP" | "OPTIONAL_PROGRAM_STOP" => self.items.push(Item::event(command, &[])),
            "PROGRAM_END" | "FINISH" => self.items.push(Item::event("PROGRAM_END", &[])),
            "MESSAGE" => {
                self.items.push(Item::event(format!("message {}", text.trim_matches(['"', ' '])), &[]))
            }
            "MIST_ON" | "FLOOD_ON" | "MIST_OFF" => self.items.push(Item::event(command, &[])),
            "COMMENT"
            | "FLOOD_OFF"
            | "SET_TOOL_TABLE_ENTRY"
            | "SET_FEED_REFERENCE"
            | "ON_RESET"
            | "START_CHANGE"
            | "SET_SPINDLE_MODE"
            | "PALLET_SHUTTLE" => {}
            _ => panic!("unknown command {command}"),
        }
    }

    fn spindle(&mut self, speed: f64, direction: f64) {
        let before = self.speed * self.direction;
        (self.speed, self.direction) = (speed, direction);
        if speed * direction != before {
            self.items.push(Item::event("spindle", &[speed * direction]));
        }
    }

    /// Returns machine coordinates of programmed ones.
    fn machine(&self, programmed: [f64; AXES]) -> [f64; AXES] {
        let tool = [0.0, 0.0, self.tool, 0.0, 0.0, 0.0];
        let mut shifted: [f64; AXES] = std::array::from_fn(|axis| programmed[axis] + self.shift[axis]);
        let ([x, y, ..], (sin, cos)) = (shifted, self.rotation.sin_cos());
        [shifted[0], shifted[1]] = [x * cos - y * sin, x * sin + y * cos];
        std::array::from_fn(|axis| shifted[axis] + self.work[axis] + tool[axis])
    }

    fn straight(&mut self, kind: &str, programmed: [f64; AXES]) {
        let end = self.machine(programmed);
        let start = std::mem::replace(&mut self.position, end);
        let moved: [bool; AXES] = std::array::from_fn(|axis| (end[axis] - start[axis]).abs() > STILL);
        if moved.contains(&true) {
            let is_rotary = !moved[..3].contains(&true);
            self.push_motion(kind, &[], is_rotary);
        }
    }

    fn arc(&mut self, numbers: &[f64]) {
        let [first, second, normal] = self.plane.axes();
        let mut end = [0.0; AXES];
        let mut center = [0.0; AXES];
        for (index, axis) in [first, second].into_iter().enumerate() {
            end[axis] = numbers[index] * self.unit;
            center[axis] = numbers[index + 2] * self.unit;
        }
        end[normal] = numbers[5] * self.unit;
        end[3..].copy_from_slice(&numbers[6..9]);
        let center = self.machine(center);
        self.position = self.machine(end);
        self.push_motion(
            &format!("arc {:?} {} turns", self.plane, numbers[4]),
            &[center[first], center[second]],
            false,
        );
    }

    fn push_motion(&mut self, kind: &str, center: &[f64], is_rotary: bool) {
        let (control, tolerance, merge) = &self.path_control;
        let coordinate = |value: &f64| (*value, PRINTED * (3.0 + self.unit));
        let mut numbers: Vec<_> = self.position.iter().chain(center).map(coordinate).collect();
        if control == "CANON_CONTINUOUS" {
            numbers.extend([(*tolerance, PRINTED * self.unit), (*merge, PRINTED * self.unit)]);
        }
        if kind != "rapid" {
            let unit = if is_rotary { 1.0 } else { self.feed.1 };
            let revolutions = if self.is_per_revolution { self.speed } else { 1.0 };
            numbers.push(match self.pitch {
                Some(pitch) => (pitch * self.speed, PRINTED * self.speed),
                None => (self.feed.0 * unit * revolutions, PRINTED * unit * revolutions),
            });
        }
        self.items.push(Item { kind: format!("{kind} {control}"), numbers });
    }
}

/// Drops the stop of the spindle that M2 implies in rs274.
fn without_stop_at_end(mut items: Vec<Item>) -> Vec<Item> {
    if items.len() > 1 && items[items.len() - 2] == Item::event("spindle", &[0.0]) {
        items.remove(items.len() - 2);
    }
    items
}

/// Returns the items of steps of the interpreter.
pub fn from_steps(steps: &[ProgramStep]) -> Vec<Item> {
    let mut spindle = 0.0;
    without_stop_at_end(steps.iter().flat_map(|step| items(step, &mut spindle)).collect())
}

fn items(step: &ProgramStep, spindle: &mut f64) -> Vec<Item> {
    let event = match step {
        ProgramStep::Motion(motion) => return motion_item(motion).into_iter().collect(),
        ProgramStep::Event { event, .. } => event,
    };
    let item = match event {
        ProgramEvent::Dwell(time) | ProgramEvent::Pause(time) => Item::event("dwell", &[*time]),
        ProgramEvent::Stop => Item::event("PROGRAM_STOP", &[]),
        ProgramEvent::OptionalStop => Item::event("OPTIONAL_PROGRAM_STOP", &[]),
        ProgramEvent::End => Item::event("PROGRAM_END", &[]),
        ProgramEvent::ToolSelection(tool) => Item::event(format!("SELECT_TOOL {tool}"), &[]),
        // rs274 stops the spindle before a tool change.
        ProgramEvent::ToolChange(tool) => Item::event(format!("CHANGE_TOOL {tool}"), &[]),
        ProgramEvent::Spindle(speed) => {
            let speed = speed / TAU * 60.0;
            let before = std::mem::replace(spindle, speed);
            return if speed == before { vec![] } else { vec![Item::event("spindle", &[speed])] };
        }
        ProgramEvent::Coolant { mist: false, flood: false } => Item::event("MIST_OFF", &[]),
        ProgramEvent::Coolant { mist: true, .. } => Item::event("MIST_ON", &[]),
        ProgramEvent::Coolant { .. } => Item::event("FLOOD_ON", &[]),
        ProgramEvent::Message(text) => Item::event(format!("message {text}"), &[]),
    };
    vec![item]
}

/// Returns a coordinate in mm or degrees.
fn shown(axis: usize, value: f64) -> f64 {
    if (3..6).contains(&axis) { value.to_degrees() } else { value * 1e3 }
}

fn motion_item(motion: &ProgramMotion) -> Option<Item> {
    let (control, tolerances) = match motion.path_control {
        PathControl::ExactStop => ("CANON_EXACT_STOP", vec![]),
        PathControl::ExactPath => ("CANON_EXACT_PATH", vec![]),
        PathControl::Blend(blend) => {
            let tolerance = blend.tolerance.unwrap_or(0.0) * 1e3;
            let merge = blend.merge_tolerance.map_or(tolerance, |merge| merge * 1e3);
            ("CANON_CONTINUOUS", vec![tolerance, merge])
        }
    };
    let is_still = (0..AXES).all(|axis| shown(axis, motion.end[axis] - motion.start[axis]).abs() <= STILL);
    let mut numbers: Vec<f64> = (0..AXES).map(|axis| shown(axis, motion.end[axis])).collect();
    let kind = match &motion.kind {
        MotionKind::Nurbs(nurbs) => {
            return Some(Item::event(format!("spline of {} points", nurbs.control.len()), &[]));
        }
        MotionKind::Rapid | MotionKind::Line if is_still => return None,
        MotionKind::Rapid => "rapid".to_owned(),
        MotionKind::Line => "line".to_owned(),
        MotionKind::Arc(arc) => {
            numbers.extend(arc.center.map(|value| value * 1e3));
            let turns = ((arc.sweep.abs() - 1e-6) / TAU).floor() + 1.0;
            format!("arc {:?} {} turns", arc.plane, turns.copysign(arc.sweep))
        }
    };
    numbers.extend(tolerances);
    match motion.feed {
        Feed::Rapid => {}
        Feed::Linear(feed) => numbers.push(feed * 60e3),
        Feed::Rotary(feed) => numbers.push(feed.to_degrees() * 60.0),
        Feed::Duration(time) => numbers.push(length(motion) / time * 60.0),
    }
    Some(Item {
        kind: format!("{kind} {control}"),
        numbers: numbers.into_iter().map(|number| (number, 0.0)).collect(),
    })
}

/// Returns the length of a motion as G93 of rs274 has it, mm or degrees.
fn length(motion: &ProgramMotion) -> f64 {
    let moved = |axis: usize| shown(axis, motion.end[axis] - motion.start[axis]);
    let norm = |axes: std::ops::Range<usize>| axes.map(|axis| moved(axis).powi(2)).sum::<f64>().sqrt();
    match &motion.kind {
        MotionKind::Arc(arc) => {
            let [first, second, normal] = arc.plane.axes();
            let [x, y] = [motion.start[first] - arc.center[0], motion.start[second] - arc.center[1]];
            (x.hypot(y) * 1e3 * arc.sweep).hypot(moved(normal))
        }
        _ if norm(0..3) > 0.0 => norm(0..3),
        _ => norm(3..6),
    }
}
