//! Profile of a control, from a part program and the setpoints that the control made of it, or the positions of the axes
//! (`recorded_positions`).
//!
//! 1. Each sample of the log is assigned to a motion of the program.
//! 2. Ramps from rest to a constant speed show acceleration, jerk limit and filters of the axes (`ramp`, `law`).
//! 3. Corners show path and speed (`corner`), circles the parts of the acceleration across and along the path, rows of short
//!    lines the block cycle and the look-ahead (`blocks`), dwells the wait at standstills.
//!
//! All values are in closed form from the log; the planner has no part in them.

mod blocks;
mod corner;
mod law;
mod log;
mod probe;
mod ramp;
mod recorded_positions;
mod track;

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::statistics::{mean, rms};
use virtual_axes_core::units::{METER_PER_MINUTE, MILLISECOND, REVOLUTION, RPM};

pub use self::log::ControlLog;
pub use self::probe::probe_program;

use self::blocks::Blocks;
use self::corner::LineCorner;
use self::law::{ControlEstimate, FILTER_SHARE, RampLaw, Smoothing};
use self::ramp::{SpeedRamp, plateau, ramp};
use self::track::{Track, TrackedMotion, motions};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, PathControl, ProgramStep};

/// Identified parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlValue {
    /// Key of the parameter.
    pub key: String,
    /// Value, in the unit of the parameter.
    pub value: f64,
    /// Half width of its interval of 95 %.
    pub half_width: f64,
    /// Unit.
    pub unit: &'static str,
    /// Number of motions that show it.
    pub count: usize,
}

/// Profile of a control.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ControlIdentification {
    /// Numbers.
    pub values: Vec<ControlValue>,
    /// Choices: key, value and reason.
    pub choices: Vec<(String, String, String)>,
    /// Properties that the program cannot show, each with the remedy.
    pub not_shown: Vec<String>,
    /// Time from the first to the last motion in the log, s.
    pub motion_time: f64,
    /// Number of motions of the program.
    pub motions: usize,
}

impl ControlIdentification {
    fn push(&mut self, key: impl Into<String>, estimate: ControlEstimate, factor: f64, unit: &'static str) {
        self.values.push(ControlValue {
            key: key.into(),
            value: estimate.value / factor,
            half_width: estimate.half_width / factor,
            unit,
            count: estimate.count,
        });
    }
}

/// Identifies the profile of a control from the steps of a program and the setpoints that it made of them.
///
/// # Errors
///
/// Returns an error if the program is invalid, or if the log is not one of it.
pub fn identify_control<E: std::fmt::Display>(
    steps: impl Iterator<Item = Result<ProgramStep, E>>,
    machine: &MachineConfig,
    log: &ControlLog,
) -> Result<ControlIdentification, String> {
    let track = Track::new(log, motions(steps)?)?;
    let mut found =
        ControlIdentification { motions: track.motions.len(), ..ControlIdentification::default() };
    found.motion_time = motion_time(&track);
    let axes = Axes::new(machine, &track);
    axes.identify(&mut found);
    if let Some(law) = &axes.law {
        identify_corners(&track, law, &mut found);
        identify_circles(&track, law, &mut found);
        identify_blocks(&track, law, &mut found);
        identify_ends(&track, law, &mut found);
    }
    identify_wait(&track, &axes, &mut found);
    if log.accuracy.is_estimated() {
        for value in &mut found.values {
            value.half_width = value.half_width.hypot(OF_DRIVES * value.value);
        }
        let hidden = match axes.law.as_ref().map(|law| &law.smoothing) {
            Some(Smoothing::None(_)) => Some("filters as short as those of the drives"),
            Some(Smoothing::Filters(stages)) if stages.len() == 1 => {
                Some("a second filter below a third of the first")
            }
            _ => None,
        };
        found.not_shown.extend(
            hidden.map(|what| format!("{what}: recorded positions do not show them beside the drives")),
        );
    }
    Ok(found)
}

/// Relative uncertainty of values from recorded positions, by drives that differ from those of the machine.
const OF_DRIVES: f64 = 0.01;
/// Relative difference up to which a part is a whole.
const WHOLE: f64 = 0.015;
/// A rule of arcs has more than one arc in this number of corners.
const ARC_SHARE: usize = 4;
/// Part of the best ramp from which on a ramp shows its acceleration.
const SHOWN: f64 = 0.6;
/// Relative difference of equal speeds.
const SAME_SPEED: f64 = 5e-3;
/// Part of the feed below which a corner is a stop, and above which it does not slow down.
const CORNER_SPEEDS: [f64; 2] = [0.02, 0.97];

/// Returns the relative deviation of values from their mean, NaN without values.
fn spread(values: &[f64]) -> f64 {
    mean(values).and_then(|mean| rms(values.iter().map(|value| value / mean - 1.0))).unwrap_or(f64::NAN)
}

/// Identifies the rule for corners in G64.
fn identify_corners(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let corners: Vec<LineCorner> = (0..track.motions.len().saturating_sub(1))
        .filter_map(|index| LineCorner::of(track, index, law))
        .collect();
    let blended: Vec<LineCorner> = corners.into_iter().filter(LineCorner::is_blended).collect();
    if blended.is_empty() {
        found.not_shown.push(
            "corners: no corner in G64 of two lines of X, Y and Z with the same feed, both of which reach it"
                .to_owned(),
        );
        return;
    }
    let mut choose = |value: &str, reason: String| {
        found.choices.push(("control.corners".to_owned(), value.to_owned(), reason));
    };
    let count = blended.len();
    let arcs: Vec<&LineCorner> = blended.iter().filter(|corner| corner.radius > 0.0).collect();
    let slowed: Vec<&LineCorner> =
        blended.iter().filter(|corner| corner.speed < CORNER_SPEEDS[1] * corner.feed).collect();
    let steps: Vec<f64> = slowed.iter().map(|c| 2.0 * c.speed * (0.5 * c.turn).sin()).collect();
    // Filters hide the arcs of small P.
    if arcs.len() > count / ARC_SHARE {
        let within: Vec<&&LineCorner> = arcs.iter().filter(|corner| corner.tolerance().is_some()).collect();
        let parts: Vec<f64> = within.iter().filter_map(|c| Some(c.distance() / c.tolerance()?)).collect();
        let distance = ControlEstimate::of(parts, 0.0);
        choose(
            "arc",
            match distance {
                Some(d) => format!(
                    "{} of {count} corners leave the programmed path, by {:.3} ± {:.3} of P in {} with P",
                    arcs.len(),
                    d.value,
                    d.half_width.max(1e-3),
                    d.count
                ),
                None => format!("{} of {count} corners leave the programmed path", arcs.len()),
            },
        );
        let normal =
            slowed.iter().filter(|c| c.radius > 0.0).map(|c| c.speed * c.speed / (c.radius * c.limit));
        if let Some(normal) = ControlEstimate::of(normal.collect(), 5e-3) {
            found.push(
                "control.normal_fraction",
                ControlEstimate { value: normal.value.min(1.0), ..normal },
                1.0,
                "",
            );
        }
        let open: Vec<&&LineCorner> = arcs.iter().filter(|corner| corner.tolerance().is_none()).collect();
        let limited = open.iter().filter(|c| c.speed < CORNER_SPEEDS[1] * c.feed);
        match ControlEstimate::of(limited.map(|c| c.distance()).collect(), 5e-3) {
            Some(tolerance) => found.push("control.corner_tolerance_mm", tolerance, 1e-3, "mm"),
            None if open.is_empty() => {
                found.not_shown.push("deviation of G64 without P: no such corner".to_owned());
            }
            None => found.choices.push((
                "control.corner_tolerance_mm".to_owned(),
                "0".to_owned(),
                format!("{} corners in G64 without P are passed at the feed", open.len()),
            )),
        }
        return;
    }
    if blended.iter().all(|corner| corner.speed < CORNER_SPEEDS[0] * corner.feed) {
        choose("stop", format!("a stop in all {count} corners"));
        return;
    }
    if slowed.is_empty() {
        found.not_shown.push(format!(
            "corners: all {count} are passed exactly and at the feed; it takes a higher feed or sharper corners"
        ));
        return;
    }
    // Normal acceleration of an arc within P, as a part of the limit.
    let normal = |corner: &&LineCorner| {
        corner.tolerance().map(|tolerance| corner.speed.powi(2) * corner.bulge() / (tolerance * corner.limit))
    };
    let normals: Vec<f64> = slowed.iter().filter_map(normal).collect();
    let spreads = [spread(&steps), spread(&normals)];
    if steps.len() < 3 || normals.len() < 3 {
        found.not_shown.push(
            "rule for the speed in corners: it takes three slowed corners of several angles, in G64 with several P".to_owned(),
        );
    }
    if spreads[0] <= spreads[1] || normals.is_empty() {
        choose(
            "velocity_step",
            format!(
                "the change of velocity is alike in {} corners, within {:.2} %",
                steps.len(),
                100.0 * spreads[0]
            ),
        );
        if let Some(step) = ControlEstimate::of(steps, 2e-3) {
            found.push("control.corner_velocity_m_min", step, METER_PER_MINUTE, "m/min");
        }
        return;
    }
    choose(
        "deviation",
        format!(
            "the exact path at the speed of an arc within P in {} corners, within {:.2} %",
            normals.len(),
            100.0 * spreads[1]
        ),
    );
    let Some(normal) = ControlEstimate::of(normals, 5e-3) else { return };
    let open = slowed.iter().filter(|corner| corner.tolerance().is_none());
    let open = open.map(|c| c.speed.powi(2) * c.bulge() / (normal.value * c.limit));
    if let Some(tolerance) = ControlEstimate::of(open.collect(), 1e-2) {
        found.push("control.corner_tolerance_mm", tolerance, 1e-3, "mm");
    }
    found.push(
        "control.normal_fraction",
        ControlEstimate { value: normal.value.min(1.0), ..normal },
        1.0,
        "",
    );
}

/// Identifies the parts of the acceleration on arcs.
fn identify_circles(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let period = track.log.period;
    let (mut normals, mut tangentials) = (Vec::new(), Vec::new());
    for (index, motion) in track.motions.iter().enumerate() {
        let Some(arc) = motion.arc.filter(|_| motion.is_linear()) else { continue };
        let [Some(before), _] = track.rests(index) else { continue };
        let limits = arc.plane.map(|axis| law.accelerations[axis].map(|a| a.value));
        let [Some(x), Some(y)] = limits else { continue };
        let places = track.places(index, before.saturating_sub(5)..track.samples[index][1]);
        let Some(constant) = plateau(&places, track.log.accuracy) else { continue };
        let speed = constant.step / period;
        let limit = x.min(y);
        if speed < CORNER_SPEEDS[1] * motion.feed {
            normals.push(speed * speed / (arc.radius * limit));
        }
        let Some(ramp) = ramp(&places, &constant, period) else { continue };
        let acceleration = law.acceleration(&ramp, &arc.plane);
        tangentials.extend(acceleration.map(|[a, share]| [a / limit, share]));
    }
    found.values.retain(|value| value.key != "control.normal_fraction" || normals.is_empty());
    match ControlEstimate::of(normals, 2e-3) {
        Some(e) => found.push("control.normal_fraction", ControlEstimate { value: e.value.min(1.0), ..e }, 1.0, ""),
        None => found.not_shown.push(
            "acceleration across the path on arcs: no arc from rest that limits the feed; it takes a higher feed or smaller \
             radii"
                .to_owned(),
        ),
    }
    // The circles that show it best.
    let best = tangentials.iter().map(|[_, share]| *share).fold(0.0, f64::max);
    tangentials.retain(|[_, share]| *share >= SHOWN * best);
    let tangentials = tangentials.iter().map(|[part, _]| *part).collect();
    match ControlEstimate::of(tangentials, 2e-3) {
        Some(e) => found.push(
            "control.tangential_fraction",
            ControlEstimate { value: e.value.min(1.0), ..e },
            1.0,
            "",
        ),
        None => found
            .not_shown
            .push("acceleration along the path on arcs: no arc from rest to a constant speed".to_owned()),
    }
}

/// Identifies block cycle and look-ahead.
fn identify_blocks(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let blocks = Blocks::of(track, law);
    let Some([cycle, ahead]) = blocks.bounds else {
        found.not_shown.push(
            "block cycle and look-ahead: no row of short lines of one axis, of the same length, without a corner".to_owned(),
        );
        return;
    };
    match blocks.cycle {
        Some(cycle) => found.push("control.block_cycle_ms", cycle, MILLISECOND, "ms"),
        None => found.not_shown.push(format!(
            "block cycle: at most {:.3} ms; it takes two rows of shorter lines that it limits",
            1e3 * cycle
        )),
    }
    match blocks.look_ahead {
        Some(count) => found.push("control.look_ahead", count, 1.0, "blocks"),
        None => found.not_shown.push(format!(
            "look-ahead: at least {:.0} blocks; it takes rows of short lines at a higher feed that it limits",
            ahead.floor()
        )),
    }
}

/// Identifies the acceleration of motions before a standstill in G64, and beside corners in G61.
fn identify_ends(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let [mut overlaps, mut kinks] = [Vec::new(), Vec::new()];
    let period = track.log.period;
    for (index, motion) in track.motions.iter().enumerate() {
        let Some(axis) = motion.single_axis().filter(|_| motion.feed.is_finite()) else { continue };
        let Some(limit) = law.accelerations[axis] else { continue };
        let is_blended = matches!(motion.path_control, PathControl::Blend(_));
        let [Some(before), after] = track.rests(index) else { continue };
        let is_last = motion.dwell.is_some() && after.is_some();
        if is_blended != is_last {
            continue;
        }
        // A row of lines without corners is no motion beside one.
        let has_corner = track.motions.get(index + 1).is_some_and(|next| next.single_axis() != Some(axis));
        if !is_blended && !has_corner {
            continue;
        }
        let scale = (motion.to[axis] - motion.from[axis]).abs() / motion.length;
        let places = track.places(index, before.saturating_sub(5)..track.samples[index][1]);
        let places: Vec<f64> = places.iter().map(|place| place * scale).collect();
        let Some(constant) = plateau(&places, track.log.accuracy) else { continue };
        let Some(ramp) = ramp(&places, &constant, period) else { continue };
        let acceleration = match law.is_limit(&ramp, axis) {
            true => Some(limit.value),
            false => law.acceleration(&ramp, &[axis]).map(|[a, _]| a),
        };
        let parts = if is_blended { &mut overlaps } else { &mut kinks };
        parts.extend(acceleration.map(|a| a / limit.value));
    }
    match ControlEstimate::of(overlaps, 2e-3) {
        Some(part) if part.value > 1.0 - WHOLE => {
            found.push("control.overlap_fraction", ControlEstimate { value: 1.0, ..part }, 1.0, "");
        }
        Some(part) => found.push("control.overlap_fraction", part, 1.0, ""),
        None => found.not_shown.push(
            "acceleration before a standstill in G64: no motion of one axis from rest to rest in G64 with a dwell behind it"
                .to_owned(),
        ),
    }
    match ControlEstimate::of(kinks, 2e-3) {
        Some(part) if part.value > 1.0 - WHOLE => {
            found.push("control.kink_fraction", ControlEstimate { value: 1e-3, ..part }, 1.0, "");
        }
        Some(part) => {
            found.push("control.kink_fraction", ControlEstimate { value: 1.0 - part.value, ..part }, 1.0, "");
        }
        None => found.not_shown.push(
            "acceleration of motions beside a corner in G61: no such motion of one axis from rest to a constant speed"
                .to_owned(),
        ),
    }
}

/// Identifies the wait at standstills: the time between two ramps of single axes, less what they and the dwell last. Filters
/// delay both ramps alike.
fn identify_wait(track: &Track<'_>, axes: &Axes<'_>, found: &mut ControlIdentification) {
    let period = track.log.period;
    // Times at which the line of constant speed starts at the start of the motion, and reaches its end.
    let ends = |index: usize| {
        let motion = track.motions.get(index)?;
        let axis = motion.single_axis()?;
        let [start, end] = track.samples[index];
        let places = track.places(index, start..end);
        let constant = plateau(&places, track.log.accuracy)?;
        let middle = usize::midpoint(constant.ends[0], constant.ends[1]);
        let at = |place: f64| (start + middle) as f64 + (place - constant.place) / constant.step;
        let speed = constant.step / period * (motion.to[axis] - motion.from[axis]).abs() / motion.length;
        let ramp = axes.law.as_ref()?.ramp_time(axis, speed)?;
        axes.reaches(axis, motion, speed).then(|| (at(0.0) * period, at(motion.length) * period, 0.5 * ramp))
    };
    let filters: f64 = axes.law.as_ref().map_or(0.0, |law| law.filters().iter().sum());
    let waits = (0..track.motions.len()).filter_map(|index| {
        let dwell = track.motions[index].dwell?;
        let is_blended = |motion: &TrackedMotion| matches!(motion.path_control, PathControl::Blend(_));
        let pair = [track.motions.get(index)?, track.motions.get(index + 1)?];
        if pair.into_iter().any(|motion| is_blended(motion) && motion.feed.is_finite()) {
            return None;
        }
        let ((_, end, braking), (start, _, starting)) = (ends(index)?, ends(index + 1)?);
        Some(start - starting - end - braking - dwell - filters)
    });
    match ControlEstimate::of(waits.collect(), 0.0) {
        Some(wait) => {
            let half_width = wait.half_width.max(0.1 * period).max(0.5 * track.log.accuracy.smoothing);
            let wait = ControlEstimate { value: wait.value.max(0.0), half_width, ..wait };
            found.push("control.wait_ms", wait, MILLISECOND, "ms");
        }
        None => found.not_shown.push(
            "wait at standstills: no dwell (G4) between two motions of single axes in G61 or at rapid traverse".to_owned(),
        ),
    }
}

/// Returns the time from the first to the last change of a position, s.
fn motion_time(track: &Track<'_>) -> f64 {
    let moving = |sample: &usize| !track.is_at_rest[*sample];
    let mut samples = 0..track.is_at_rest.len();
    let first = samples.find(moving);
    let last = samples.rfind(moving).or(first);
    match (first, last) {
        // The first sample is at rest until the end of its window.
        (Some(first), Some(last)) => {
            (last + 2).saturating_sub(first + track.log.accuracy.window) as f64 * track.log.period
        }
        _ => 0.0,
    }
}

/// Straight motions of single axes between rests.
struct Axes<'a> {
    machine: &'a MachineConfig,
    ramps: Vec<Vec<SpeedRamp>>,
    /// Programmed feeds of the ramps.
    feeds: Vec<Vec<f64>>,
    rapids: Vec<Vec<f64>>,
    moving: [bool; AXIS_COUNT],
    law: Option<RampLaw>,
    /// Length of the shortest filter that the drives do not hide, s; 0 with setpoints.
    shortest: f64,
}

impl<'a> Axes<'a> {
    fn new(machine: &'a MachineConfig, track: &Track<'_>) -> Self {
        let mut axes = Self {
            machine,
            ramps: vec![Vec::new(); AXIS_COUNT],
            feeds: vec![Vec::new(); AXIS_COUNT],
            rapids: vec![Vec::new(); AXIS_COUNT],
            moving: [false; AXIS_COUNT],
            law: None,
            shortest: (FILTER_SHARE * track.log.accuracy.drive_squares).sqrt(),
        };
        for (index, motion) in track.motions.iter().enumerate() {
            for axis in 0..AXIS_COUNT {
                axes.moving[axis] |= motion.from[axis] != motion.to[axis];
            }
            let Some(axis) = motion.single_axis() else { continue };
            // In G64 the last motion before a rest may have another acceleration.
            if matches!(motion.path_control, PathControl::Blend(_)) && motion.feed.is_finite() {
                continue;
            }
            let [Some(before), Some(after)] = track.rests(index) else { continue };
            let scale = (motion.to[axis] - motion.from[axis]).abs() / motion.length;
            let places = track.places(
                index,
                before.saturating_sub(5)..(after + 5 + track.log.accuracy.window).min(log_end(track)),
            );
            let places: Vec<f64> = places.iter().map(|place| place * scale).collect();
            let Some(constant) = plateau(&places, track.log.accuracy) else { continue };
            let start = ramp(&places, &constant, track.log.period);
            let last = places.len() - 1;
            let length = motion.length * scale;
            let reversed: Vec<f64> = places.iter().rev().map(|place| length - place).collect();
            let constant = constant.reversed(last, length);
            let (Some(start), Some(end)) = (start, ramp(&reversed, &constant, track.log.period)) else {
                continue;
            };
            axes.ramps[axis].extend([start, end]);
            let speed = constant.step / track.log.period;
            axes.feeds[axis].extend([motion.feed; 2]);
            if motion.feed.is_infinite() {
                axes.rapids[axis].push(speed);
            }
        }
        axes.drop_short();
        axes.law = RampLaw::fit(&axes.ramps, track.log.period, track.log.accuracy.drive_squares);
        axes
    }

    /// Drops motions that do not reach their feed: filters make one of a shorter motion a part of constant speed as well.
    fn drop_short(&mut self) {
        for axis in 0..AXIS_COUNT {
            let rapid = self.rapids[axis].iter().copied().fold(0.0, f64::max);
            self.rapids[axis].retain(|speed| *speed > (1.0 - SAME_SPEED) * rapid);
            let feeds = std::mem::take(&mut self.feeds[axis]);
            let mut feeds = feeds.iter();
            self.ramps[axis].retain(|ramp| {
                feeds.next().is_some_and(|feed| {
                    ramp.speed
                        > (1.0 - SAME_SPEED) * feed.min(if rapid > 0.0 { rapid } else { f64::INFINITY })
                })
            });
        }
    }

    /// Returns true if a motion of one axis reaches its feed.
    fn reaches(&self, axis: usize, motion: &TrackedMotion, speed: f64) -> bool {
        let rapid = self.rapids[axis].first().copied().unwrap_or(f64::INFINITY);
        speed > (1.0 - SAME_SPEED) * motion.feed.min(rapid)
    }

    fn identify(&self, found: &mut ControlIdentification) {
        for axis in 0..AXIS_COUNT {
            let letter = AXIS_LETTERS[axis];
            let Some(config) =
                self.machine.axes().iter().find(|config| {
                    self.moving[axis] && config.name().eq_ignore_ascii_case(&letter.to_string())
                })
            else {
                continue;
            };
            let is_linear = config.kind() == AxisKind::Linear;
            let key = |name: &str| format!("{}.limits.{name}", config.name());
            let law = self.law.as_ref();
            match law.and_then(|law| law.accelerations[axis]) {
                Some(a) if a.half_width.is_infinite() => {
                    let (name, unit) =
                        if is_linear { ("acceleration_m_s2", 1.0) } else { ("acceleration_rev_s2", REVOLUTION) };
                    let reason = "at least this: no ramp reaches it within the jerk limit".to_owned();
                    found.choices.push((key(name), format!("{:.6}", a.value / unit), reason));
                }
                Some(a) if is_linear => found.push(key("acceleration_m_s2"), a, 1.0, "m/s²"),
                Some(a) => found.push(key("acceleration_rev_s2"), a, REVOLUTION, "rev/s²"),
                None => found.not_shown.push(format!(
                    "acceleration of {letter}: no straight motion of {letter} alone, from rest to a constant speed, in G61 or \
                     at rapid traverse"
                )),
            }
            if let Some(RampLaw { smoothing: Smoothing::Jerk(limits), .. }) = law {
                match limits[axis] {
                    Some(j) if is_linear => found.push(key("jerk_m_s3"), j, 1.0, "m/s³"),
                    Some(j) => found.push(key("jerk_rev_s3"), j, REVOLUTION, "rev/s³"),
                    None => found.not_shown.push(format!("jerk of {letter}: no ramp of {letter} alone")),
                }
            }
            match ControlEstimate::of(self.rapids[axis].clone(), 1e-4) {
                Some(v) if is_linear => found.push(key("velocity_m_min"), v, METER_PER_MINUTE, "m/min"),
                Some(v) => found.push(key("velocity_rpm"), v, RPM, "rpm"),
                None => found.not_shown.push(format!(
                    "rapid traverse of {letter}: no G0 of {letter} alone, between rests, that reaches a constant speed"
                )),
            }
        }
        let Some(law) = &self.law else { return };
        let filters = match &law.smoothing {
            Smoothing::Filters(stages) => stages.as_slice(),
            _ => &[],
        };
        let mut choose = |key: &str, value: &str, reason: String| {
            found.choices.push((key.to_owned(), value.to_owned(), reason));
        };
        match &law.smoothing {
            Smoothing::None(time) => choose(
                "control.jerk_limited",
                "false",
                format!(
                    "the acceleration is constant, smoothed over {:.1} ms at most",
                    1e3 * time.max(self.shortest)
                ),
            ),
            Smoothing::Filters(_) => {
                choose(
                    "control.jerk_limited",
                    "false",
                    "all ramps are longer by the time of filters".to_owned(),
                );
            }
            Smoothing::Jerk(_) => choose(
                "control.jerk_limited",
                "true",
                "slow ramps are shorter than fast ones as with a jerk limit, not as with a filter".to_owned(),
            ),
        }
        for (index, key) in ["control.filter_1_ms", "control.filter_2_ms"].into_iter().enumerate() {
            match filters.get(index) {
                Some(stage) => found.push(key, *stage, MILLISECOND, "ms"),
                None => found.choices.push((key.to_owned(), "0".to_owned(), String::new())),
            }
        }
        if law.is_ambiguous {
            found.not_shown.push(
                "filter or jerk limit: the ramps do not tell them apart; it takes motions of one axis at several feeds, the \
                 lowest below a²/j"
                    .to_owned(),
            );
        }
    }
}

fn log_end(track: &Track<'_>) -> usize {
    track.log.positions.len()
}
