//! Conversion of a scenario file to a program: path and feed profile.

use std::f64::consts::TAU;

use serde_saphyr::Spanned;

use crate::config::{AxisKind, MachineConfig};
use crate::kinematics::{AxisRole, Kinematics};
use crate::path::{Block, FeedProfile, Move, PathLimits, Program};
use crate::trajectory::JointLimits;
use crate::units::{DEGREE, METER_PER_MINUTE, REVOLUTION, RPM, Rounded};

use super::coordinates::{coordinate, overlay};
use super::error::ScenarioError;
use super::file::{ArcEntry, KeyedNumbers, MoveEntry, ScenarioFile};
use crate::yaml::{self, YamlNumber};

/// Maximum number of moves of a scenario.
const MAX_MOVES: usize = 1_000_000;
/// Maximum rest, dwell, ramp and duration of a scenario, s: one day.
const MAX_DURATION: f64 = 86_400.0;

/// Relative tolerance of the comparison with the limits of axes, which are converted to SI units and back.
const LIMIT_TOLERANCE: f64 = 1e-9;
/// Relative tolerance for a ramp as long as its move.
const RAMP_TOLERANCE: f64 = 1e-12;

/// Builds the moves of `file` in order and plans their feed profile.
pub(super) fn program(
    name: &str,
    file: &ScenarioFile,
    machine: &MachineConfig,
    feed: Option<f64>,
) -> Result<Program, ScenarioError> {
    let joints: Vec<JointLimits> = machine.axes().iter().map(JointLimits::from_axis).collect();
    let mut builder = ProgramBuilder {
        name,
        kinds: joints.iter().map(|joint| joint.kind).collect(),
        point: vec![0.0; joints.len()],
        limits: [PathLimits::default(); 2],
        feeds: default_feeds(name, file, feed)?,
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
        let reason = format!("found {found} moves, 1 … {MAX_MOVES} are allowed");
        return Err(ScenarioError::invalid(name, reason));
    }
    for entry in &file.moves {
        builder.add(entry)?;
    }
    let rest = file.rest_s.map_or(0.0, |YamlNumber(rest)| rest);
    check_time(name, "rest_s", rest)?;
    let ProgramBuilder { joints, mut moves, .. } = builder;
    if let Some(last) = moves.last_mut() {
        last.dwell += rest;
    }
    let period = machine.periods().position;
    let program = Program::plan(Kinematics::new(machine), file.frame, &joints, period, rest, moves)
        .map_err(|error| ScenarioError::invalid(name, error))?;
    let duration = program.duration();
    if duration > MAX_DURATION {
        let found = Rounded(duration);
        let reason = format!("duration is {found} s, at most {MAX_DURATION} s are allowed");
        return Err(ScenarioError::invalid(name, reason));
    }
    Ok(program)
}

/// Returns the default feeds of linear and of rotary moves; `replaced` is in m/min or rpm.
fn default_feeds(
    name: &str,
    file: &ScenarioFile,
    replaced: Option<f64>,
) -> Result<[Option<f64>; 2], ScenarioError> {
    let own =
        |entry: &&Spanned<MoveEntry>| entry.value.feed_m_min.is_some() || entry.value.feed_rpm.is_some();
    let Some(feed) = replaced else {
        return Ok([
            feed_of(name, "feed_m_min", file.feed_m_min, METER_PER_MINUTE)?,
            feed_of(name, "feed_rpm", file.feed_rpm, RPM)?,
        ]);
    };
    let wrong = |at: &str, reason: &str| Err(ScenarioError::key(at, "--feed", reason));
    if let Some(entry) = file.moves.iter().find(own) {
        let reason =
            "cannot replace the feed of this move; only the default feed of the scenario is replaced";
        return wrong(&at_line(name, entry), reason);
    }
    if file.feed_m_min.is_some() && file.feed_rpm.is_some() {
        return wrong(name, "cannot replace both feed_m_min and feed_rpm of the scenario");
    }
    Ok([
        file.feed_m_min.and(feed_of(name, "--feed", Some(YamlNumber(feed)), METER_PER_MINUTE)?),
        file.feed_rpm.and(feed_of(name, "--feed", Some(YamlNumber(feed)), RPM)?),
    ])
}

struct ProgramBuilder<'a> {
    name: &'a str,
    joints: Vec<JointLimits>,
    kinds: Vec<AxisKind>,
    /// Start of the next move, programmed coordinates.
    point: Vec<f64>,
    /// Limits and feeds of linear and of rotary moves.
    limits: [PathLimits; 2],
    feeds: [Option<f64>; 2],
    moves: Vec<Move>,
}

impl ProgramBuilder<'_> {
    fn at<T>(&self, spanned: &Spanned<T>) -> String {
        at_line(self.name, spanned)
    }

    fn add(&mut self, spanned: &Spanned<MoveEntry>) -> Result<(), ScenarioError> {
        let (entry, at) = (&spanned.value, self.at(spanned));
        let block = match (&entry.line, &entry.arc, &entry.spline, entry.dwell_s) {
            (Some(line), None, None, None) => self.line(line, &at)?,
            (None, Some(arc), None, None) => self.arc(arc, entry, &at)?,
            (None, None, Some(points), None) => self.spline(points, &at)?,
            (None, None, None, Some(YamlNumber(dwell))) => return self.dwell(dwell, entry, &at),
            _ => {
                let reason = "a move must have exactly one of line, arc, spline, dwell_s";
                return Err(ScenarioError::invalid(&at, reason));
            }
        };
        let profile = match entry.ramp_s {
            Some(YamlNumber(ramp)) => {
                check_time(&at, "ramp_s", ramp)?;
                if ramp == 0.0 {
                    return Err(ScenarioError::value(&at, "ramp_s", ramp, "be above 0"));
                }
                FeedProfile::Cosine { ramp }
            }
            None => FeedProfile::JerkLimited,
        };
        let kind = block.kind();
        match kind {
            AxisKind::Linear => reject_options(entry, "_rpm", "a move of linear axes", &at)?,
            AxisKind::Rotary => reject_options(entry, "_m_min", "a move of rotary axes only", &at)?,
        }
        let feed = self.feed(entry, kind, &at)?;
        if let FeedProfile::Cosine { ramp } = profile
            && feed * ramp > block.length() * (1.0 + RAMP_TOLERANCE)
        {
            let allowed = format!(
                "be at most {} s, the duration of this move at its feed",
                Rounded(block.length() / feed)
            );
            return Err(ScenarioError::value(&at, "ramp_s", ramp, &allowed));
        }
        let corner = match kind {
            AxisKind::Linear => feed_of(&at, "corner_m_min", entry.corner_m_min, METER_PER_MINUTE)?,
            AxisKind::Rotary => feed_of(&at, "corner_rpm", entry.corner_rpm, RPM)?,
        };
        block.point(block.length(), &mut self.point);
        self.moves.push(Move {
            block,
            feed,
            corner,
            limits: self.limits[kind as usize],
            profile,
            dwell: 0.0,
        });
        Ok(())
    }

    fn dwell(&mut self, dwell: f64, entry: &MoveEntry, at: &str) -> Result<(), ScenarioError> {
        reject_options(entry, "", "a dwell", at)?;
        check_time(at, "dwell_s", dwell)?;
        let Some(last) = self.moves.last_mut() else {
            let reason = "dwell_s must follow a move; use rest_s for a rest before the first move";
            return Err(ScenarioError::invalid(at, reason));
        };
        last.dwell += dwell;
        Ok(())
    }

    fn line(&self, to: &KeyedNumbers, at: &str) -> Result<Block, ScenarioError> {
        let mut end = self.point.clone();
        overlay(&mut end, to, &self.joints, at)?;
        Block::line(&self.point, &end, &self.kinds).map_err(|error| ScenarioError::invalid(at, error))
    }

    fn spline(&self, points: &[KeyedNumbers], at: &str) -> Result<Block, ScenarioError> {
        let mut control = Vec::with_capacity(points.len());
        let mut point = self.point.clone();
        for values in points {
            overlay(&mut point, values, &self.joints, at)?;
            control.push(point.clone());
        }
        Block::spline(&self.point, &control, &self.kinds).map_err(|error| ScenarioError::invalid(at, error))
    }

    fn arc(&self, arc: &ArcEntry, entry: &MoveEntry, at: &str) -> Result<Block, ScenarioError> {
        let mut center = Vec::new();
        for (key, &YamlNumber(value)) in &arc.center {
            center.push(coordinate(key, value, &self.joints, at)?);
        }
        // Axes named x, y and z come first, in this order; the others in the order of the machine, not of the file.
        center.sort_by_key(|&(index, _)| {
            let joint = &self.joints[index];
            let role = AxisRole::LINEAR.iter().position(|role| role.matches(&joint.name, joint.kind));
            (role.unwrap_or(AxisRole::LINEAR.len()), index)
        });
        let [(first, u), (second, v)] = center[..] else {
            let reason = format!("center must have two coordinates, found {}", center.len());
            return Err(ScenarioError::invalid(at, reason));
        };
        if let Some(&index) = [first, second].iter().find(|&&index| self.kinds[index] == AxisKind::Rotary) {
            let reason = format!(
                "center contains {}, a rotary axis; the plane of an arc is spanned by two linear axes",
                self.joints[index].name
            );
            return Err(ScenarioError::invalid(at, reason));
        }
        let mut sweep = match (arc.angle_deg, arc.turns) {
            (Some(YamlNumber(angle)), None) => finite(at, "angle_deg", angle)? * DEGREE,
            (None, Some(YamlNumber(turns))) => finite(at, "turns", turns)? * TAU,
            _ => {
                let reason = "an arc must have one of angle_deg and turns, positive counterclockwise";
                return Err(ScenarioError::invalid(at, reason));
            }
        };
        let mut end = self.point.clone();
        for (key, &YamlNumber(value)) in &arc.to {
            let (index, value) = coordinate(key, value, &self.joints, at)?;
            if index == first || index == second {
                let reason = "lies in the plane of the arc, where the angle determines the end point";
                return Err(ScenarioError::key(at, key, reason));
            }
            end[index] = value;
        }
        if let Some(YamlNumber(ramp)) = entry.ramp_s {
            // The angle is covered at full feed; each of the two ramps adds half of its length at full feed.
            let radius = (self.point[first] - u).hypot(self.point[second] - v);
            let feed = self.feed(entry, self.kinds[first], at)?;
            // An arc without angle or radius is rejected below.
            if sweep != 0.0 && radius > 0.0 {
                sweep += sweep.signum() * feed * ramp / radius;
            }
        }
        Block::arc(&self.point, [first, second], [u, v], sweep, &end, &self.kinds)
            .map_err(|error| ScenarioError::invalid(at, error))
    }

    /// Returns the feed of a move of type `kind`, m/s or rad/s.
    fn feed(&self, entry: &MoveEntry, kind: AxisKind, at: &str) -> Result<f64, ScenarioError> {
        let (key, own, unit) = match kind {
            AxisKind::Linear => ("feed_m_min", entry.feed_m_min, METER_PER_MINUTE),
            AxisKind::Rotary => ("feed_rpm", entry.feed_rpm, RPM),
        };
        let missing = || format!("{key} is missing; set it for this move or for the scenario");
        let feed = feed_of(at, key, own, unit)?.or(self.feeds[kind as usize]);
        feed.ok_or_else(|| ScenarioError::invalid(at, missing()))
    }
}

/// Rejects options of a move whose keys end in `suffix`, since they do not apply to it.
fn reject_options(entry: &MoveEntry, suffix: &str, found: &str, at: &str) -> Result<(), ScenarioError> {
    match entry.options().iter().find(|(key, value)| key.ends_with(suffix) && value.is_some()) {
        Some((key, _)) => Err(ScenarioError::key(at, key, &format!("does not apply to {found}"))),
        None => Ok(()),
    }
}

fn at_line<T>(name: &str, spanned: &Spanned<T>) -> String {
    yaml::position(name, spanned.referenced.line())
}

fn finite(at: &str, key: &str, value: f64) -> Result<f64, ScenarioError> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(ScenarioError::value(at, key, value, "be a finite number"))
    }
}

fn check_time(at: &str, key: &str, value: f64) -> Result<(), ScenarioError> {
    if (0.0..=MAX_DURATION).contains(&value) {
        return Ok(());
    }
    Err(ScenarioError::value(at, key, value, &format!("lie in 0 … {MAX_DURATION} s")))
}

/// Largest feed, m/min or rpm, and largest limit of a path, in the units of its key.
const MAX_FEED: f64 = 1e6;
const MAX_LIMIT: f64 = 1e9;

fn feed_of(at: &str, key: &str, value: Option<YamlNumber>, unit: f64) -> Result<Option<f64>, ScenarioError> {
    match value {
        Some(YamlNumber(feed)) if !(feed > 0.0 && feed <= MAX_FEED) => {
            Err(ScenarioError::value(at, key, feed, &format!("be above 0 and at most {MAX_FEED:e}")))
        }
        feed => Ok(feed.map(|YamlNumber(feed)| feed * unit)),
    }
}

/// Limits along a path: key, kind of the path, true for the jerk, and unit.
const LIMIT_KEYS: [(&str, AxisKind, bool, f64); 4] = [
    ("acceleration_m_s2", AxisKind::Linear, false, 1.0),
    ("acceleration_rev_s2", AxisKind::Rotary, false, REVOLUTION),
    ("jerk_m_s3", AxisKind::Linear, true, 1.0),
    ("jerk_rev_s3", AxisKind::Rotary, true, REVOLUTION),
];

/// Returns a note on each limit that exceeds that of every axis.
pub(super) fn notes_on_limits(values: &KeyedNumbers, machine: &MachineConfig) -> Vec<String> {
    let note = |(key, kind, is_jerk, unit)| {
        let &YamlNumber(value) = values.get(key)?;
        let axes = machine.axes().iter().filter(|axis| axis.kind() == kind).map(|axis| axis.limits());
        let limits = axes.map(|limits| if is_jerk { limits.jerk } else { limits.acceleration });
        let largest = limits.fold(0.0, f64::max) / unit;
        (largest > 0.0 && value > largest * (1.0 + LIMIT_TOLERANCE)).then(|| {
            let [value, largest] = [Rounded(value), Rounded(largest)];
            format!("limits.{key}: {value} exceeds that of the axes, {largest}, which keep their own")
        })
    };
    LIMIT_KEYS.into_iter().filter_map(note).collect()
}

/// Parses the path limits, which apply in addition to the axis limits.
fn path_limits(values: &KeyedNumbers, at: &str) -> Result<[PathLimits; 2], ScenarioError> {
    let mut limits = [PathLimits::default(); 2];
    for (key, &YamlNumber(value)) in values {
        let Some(&(_, kind, is_jerk, unit)) = LIMIT_KEYS.iter().find(|(known, ..)| known == key) else {
            let reason = "unknown limit; there are acceleration_m_s2 and jerk_m_s3 for linear paths, \
                          acceleration_rev_s2 and jerk_rev_s3 for rotary paths";
            return Err(ScenarioError::key(at, key, reason));
        };
        if !(value > 0.0 && value <= MAX_LIMIT) {
            let allowed = format!("be above 0 and at most {MAX_LIMIT:e}");
            return Err(ScenarioError::value(at, key, value, &allowed));
        }
        let limits = &mut limits[kind as usize];
        *(if is_jerk { &mut limits.jerk } else { &mut limits.acceleration }) = value * unit;
    }
    Ok(limits)
}
