//! From a scenario's file to a path with a law of time.

use std::f64::consts::TAU;

use serde_saphyr::Spanned;

use crate::config::{AxisKind, MachineConfig, shortened};
use crate::kinematics::Kinematics;
use crate::path::{Block, Frame, Law, Move, PathError, PathLimits, Program};
use crate::trajectory::JointLimits;
use crate::units::{DEGREE, METER_PER_MINUTE, REVOLUTION, RPM};

use super::coordinates::{coordinate, overlay};
use super::error::ScenarioError;
use super::file::{ArcEntry, Entry, File, FrameName, Number, Values};

/// Most moves of one scenario.
const MAX_MOVES: usize = 1_000_000;
/// Longest rest, dwell, ramp, and scenario, s: a day.
const LONGEST: f64 = 86_400.0;

/// Relative rounding of a ramp that takes the whole of a move.
const RAMP_TOLERANCE: f64 = 1e-12;

/// Builds the moves of `file` one after the other, then plans their times.
pub(super) fn program(
    name: &str,
    file: &File,
    machine: &MachineConfig,
    feed: Option<f64>,
) -> Result<Program, ScenarioError> {
    let joints: Vec<JointLimits> = machine.axes().iter().map(JointLimits::of_axis).collect();
    let mut builder = Builder {
        name,
        kinds: joints.iter().map(|joint| joint.kind).collect(),
        point: vec![0.0; joints.len()],
        limits: PathLimits { acceleration: f64::INFINITY, jerk: f64::INFINITY },
        feeds: Feeds::of(name, file, feed)?,
        moves: Vec::new(),
        joints,
    };
    if let Some(start) = &file.start {
        let at = builder.at(start);
        overlay(&mut builder.point, &start.value, &builder.joints, &at)?;
    }
    if let Some(limits) = &file.limits {
        builder.limits = path_limits(&limits.value, &builder.at(limits))?;
    }
    if file.moves.is_empty() || file.moves.len() > MAX_MOVES {
        let found = file.moves.len();
        let reason = format!("{found} moves; a scenario has 1 to {MAX_MOVES}");
        return Err(ScenarioError::Move { at: name.to_owned(), reason });
    }
    for entry in &file.moves {
        builder.add(entry)?;
    }
    let rest = file.rest_s.map_or(0.0, |Number(rest)| rest);
    check_time(name, "rest_s", rest)?;
    let Builder { joints, mut moves, .. } = builder;
    if let Some(last) = moves.last_mut() {
        last.dwell += rest;
    }
    let frame = match file.frame {
        FrameName::Joints => Frame::Joints,
        FrameName::Workpiece => Frame::Workpiece,
    };
    let period = machine.periods().position;
    let program = Program::plan(Kinematics::new(machine), frame, &joints, period, rest, moves)
        .map_err(|error| ScenarioError::Plan { name: name.to_owned(), error })?;
    let duration = program.duration();
    if duration > LONGEST {
        return Err(ScenarioError::TooLong { name: name.to_owned(), duration, limit: LONGEST });
    }
    Ok(program)
}

/// Feeds of moves that have none of their own: m/s along linear ones, rad/s along rotary ones.
#[derive(Debug, Clone, Copy)]
struct Feeds {
    linear: Option<f64>,
    rotary: Option<f64>,
}

impl Feeds {
    fn of(name: &str, file: &File, replaced: Option<f64>) -> Result<Self, ScenarioError> {
        let own =
            |entry: &&Spanned<Entry>| entry.value.feed_m_min.is_some() || entry.value.feed_rpm.is_some();
        let Some(feed) = replaced else {
            return Ok(Feeds {
                linear: feed_of(name, "feed_m_min", file.feed_m_min, METER_PER_MINUTE)?,
                rotary: feed_of(name, "feed_rpm", file.feed_rpm, RPM)?,
            });
        };
        if let Some(entry) = file.moves.iter().find(own) {
            return Err(ScenarioError::Key {
                at: at_line(name, entry),
                key: "--feed".to_owned(),
                reason: "this move has a feed of its own, which one feed for all cannot replace".to_owned(),
            });
        }
        let Feeds { linear, rotary } = Feeds {
            linear: file.feed_m_min.and(feed_of(name, "--feed", Some(Number(feed)), METER_PER_MINUTE)?),
            rotary: file.feed_rpm.and(feed_of(name, "--feed", Some(Number(feed)), RPM)?),
        };
        if linear.is_some() && rotary.is_some() {
            return Err(ScenarioError::Key {
                at: name.to_owned(),
                key: "--feed".to_owned(),
                reason: "the scenario has feed_m_min and feed_rpm, which one feed cannot replace".to_owned(),
            });
        }
        Ok(Feeds { linear, rotary })
    }
}

struct Builder<'a> {
    name: &'a str,
    joints: Vec<JointLimits>,
    kinds: Vec<AxisKind>,
    /// Where the next move starts, programmed coordinates.
    point: Vec<f64>,
    limits: PathLimits,
    feeds: Feeds,
    moves: Vec<Move>,
}

impl Builder<'_> {
    fn at<T>(&self, spanned: &Spanned<T>) -> String {
        at_line(self.name, spanned)
    }

    fn add(&mut self, spanned: &Spanned<Entry>) -> Result<(), ScenarioError> {
        let (entry, at) = (&spanned.value, self.at(spanned));
        let wrong = |reason: &str| ScenarioError::Move { at: at.clone(), reason: reason.to_owned() };
        let given =
            [entry.line.is_some(), entry.arc.is_some(), entry.spline.is_some(), entry.dwell_s.is_some()];
        if given.iter().filter(|&&given| given).count() != 1 {
            return Err(wrong("a move is exactly one of line, arc, spline, dwell_s"));
        }
        if let Some(Number(dwell)) = entry.dwell_s {
            check_time(&at, "dwell_s", dwell)?;
            let Some(last) = self.moves.last_mut() else {
                return Err(wrong("a dwell stands behind a move; rest_s is the rest before the first"));
            };
            last.dwell += dwell;
            return Ok(());
        }
        let law = match entry.ramp_s {
            Some(Number(ramp)) => {
                check_time(&at, "ramp_s", ramp)?;
                if ramp == 0.0 {
                    return Err(value_error(&at, "ramp_s", ramp, "be above 0"));
                }
                Law::Cosine { ramp }
            }
            None => Law::JerkLimited,
        };
        let block = if let Some(line) = &entry.line {
            self.line(line, &at)?
        } else if let Some(points) = &entry.spline {
            self.spline(points, &at)?
        } else if let Some(arc) = &entry.arc {
            self.arc(arc, entry, &at)?
        } else {
            return Err(wrong("a move is exactly one of line, arc, spline, dwell_s"));
        };
        let feed = self.feed(entry, block.kind(), &at)?;
        if let Law::Cosine { ramp } = law
            && feed * ramp > block.length() * (1.0 + RAMP_TOLERANCE)
        {
            let allowed =
                format!("be {:.4} s at most, for the length of this move at its feed", block.length() / feed);
            return Err(value_error(&at, "ramp_s", ramp, &allowed));
        }
        let corner = match block.kind() {
            AxisKind::Linear => feed_of(&at, "corner_m_min", entry.corner_m_min, METER_PER_MINUTE)?,
            AxisKind::Rotary => feed_of(&at, "corner_rpm", entry.corner_rpm, RPM)?,
        };
        block.point(block.length(), &mut self.point);
        self.moves.push(Move { block, feed, corner, limits: self.limits, law, dwell: 0.0 });
        Ok(())
    }

    fn line(&self, to: &Values, at: &str) -> Result<Block, ScenarioError> {
        let mut end = self.point.clone();
        overlay(&mut end, to, &self.joints, at)?;
        Block::line(&self.point, &end, &self.kinds).map_err(|error| path_error(at, error))
    }

    fn spline(&self, points: &[Values], at: &str) -> Result<Block, ScenarioError> {
        let mut control = Vec::with_capacity(points.len());
        let mut point = self.point.clone();
        for values in points {
            overlay(&mut point, values, &self.joints, at)?;
            control.push(point.clone());
        }
        Block::spline(&self.point, &control, &self.kinds).map_err(|error| path_error(at, error))
    }

    fn arc(&self, arc: &ArcEntry, entry: &Entry, at: &str) -> Result<Block, ScenarioError> {
        let mut center = Vec::new();
        for (key, &Number(value)) in &arc.center {
            center.push(coordinate(key, value, &self.joints, at)?);
        }
        // The plane's first coordinate is the machine's first, whatever the order in the file.
        center.sort_by_key(|&(place, _)| place);
        let [(first, u), (second, v)] = center[..] else {
            let reason = format!("center has {} coordinates; an arc has a center in two", center.len());
            return Err(ScenarioError::Move { at: at.to_owned(), reason });
        };
        if let Some(&place) = [first, second].iter().find(|&&place| self.kinds[place] == AxisKind::Rotary) {
            let reason = format!(
                "center names {}, which is rotary; a circle lies in two linear axes",
                self.joints[place].name
            );
            return Err(ScenarioError::Move { at: at.to_owned(), reason });
        }
        let mut sweep = match (arc.angle_deg, arc.turns) {
            (Some(Number(angle)), None) => finite(at, "angle_deg", angle)? * DEGREE,
            (None, Some(Number(turns))) => finite(at, "turns", turns)? * TAU,
            _ => {
                let reason = "an arc has one of angle_deg and turns, positive counterclockwise".to_owned();
                return Err(ScenarioError::Move { at: at.to_owned(), reason });
            }
        };
        let mut end = self.point.clone();
        for (key, &Number(value)) in &arc.to {
            let (place, value) = coordinate(key, value, &self.joints, at)?;
            if place == first || place == second {
                return Err(ScenarioError::Key {
                    at: at.to_owned(),
                    key: shortened(key),
                    reason: "lies in the plane of the arc, whose end follows from its angle".to_owned(),
                });
            }
            end[place] = value;
        }
        if let Some(Number(ramp)) = entry.ramp_s {
            // The angle is that at full feed; each of the two ramps adds half of what full feed would.
            let radius = (self.point[first] - u).hypot(self.point[second] - v);
            let feed = self.feed(entry, self.kinds[first], at)?;
            sweep += sweep.signum() * feed * ramp / radius;
        }
        Block::arc(&self.point, [first, second], [u, v], sweep, &end, &self.kinds)
            .map_err(|error| path_error(at, error))
    }

    /// Feed along a move whose length counts in `kind`.
    fn feed(&self, entry: &Entry, kind: AxisKind, at: &str) -> Result<f64, ScenarioError> {
        let (key, own, unit, default) = match kind {
            AxisKind::Linear => ("feed_m_min", entry.feed_m_min, METER_PER_MINUTE, self.feeds.linear),
            AxisKind::Rotary => ("feed_rpm", entry.feed_rpm, RPM, self.feeds.rotary),
        };
        feed_of(at, key, own, unit)?.or(default).ok_or_else(|| ScenarioError::Move {
            at: at.to_owned(),
            reason: format!("there is no {key}, neither here nor for the whole scenario"),
        })
    }
}

fn at_line<T>(name: &str, spanned: &Spanned<T>) -> String {
    match spanned.referenced.line() {
        0 => name.to_owned(),
        line => format!("{name}:{line}"),
    }
}

fn path_error(at: &str, error: PathError) -> ScenarioError {
    ScenarioError::Path { at: at.to_owned(), error }
}

fn value_error(at: &str, key: &str, value: f64, allowed: &str) -> ScenarioError {
    ScenarioError::Value { at: at.to_owned(), key: shortened(key), value, allowed: allowed.to_owned() }
}

fn finite(at: &str, key: &str, value: f64) -> Result<f64, ScenarioError> {
    if value.is_finite() { Ok(value) } else { Err(value_error(at, key, value, "be a finite number")) }
}

fn check_time(at: &str, key: &str, value: f64) -> Result<(), ScenarioError> {
    if (0.0..=LONGEST).contains(&value) {
        return Ok(());
    }
    Err(value_error(at, key, value, &format!("lie in 0 … {LONGEST} s")))
}

fn feed_of(at: &str, key: &str, value: Option<Number>, unit: f64) -> Result<Option<f64>, ScenarioError> {
    match value {
        Some(Number(feed)) if !(feed > 0.0 && feed.is_finite()) => {
            Err(value_error(at, key, feed, "be a finite number above 0"))
        }
        feed => Ok(feed.map(|Number(feed)| feed * unit)),
    }
}

/// Limits along the path, besides those of the axes.
fn path_limits(values: &Values, at: &str) -> Result<PathLimits, ScenarioError> {
    let mut limits = PathLimits { acceleration: f64::INFINITY, jerk: f64::INFINITY };
    for (key, &Number(value)) in values {
        let (limit, unit) = match key.as_str() {
            "acceleration_m_s2" => (&mut limits.acceleration, 1.0),
            "acceleration_rev_s2" => (&mut limits.acceleration, REVOLUTION),
            "jerk_m_s3" => (&mut limits.jerk, 1.0),
            "jerk_rev_s3" => (&mut limits.jerk, REVOLUTION),
            _ => {
                return Err(ScenarioError::Key {
                    at: at.to_owned(),
                    key: shortened(key),
                    reason: "unknown; limits are acceleration_m_s2 and jerk_m_s3 along the path, or \
                             acceleration_rev_s2 and jerk_rev_s3"
                        .to_owned(),
                });
            }
        };
        if !(value > 0.0 && value.is_finite()) {
            return Err(value_error(at, key, value, "be a finite number above 0"));
        }
        *limit = value * unit;
    }
    Ok(limits)
}
