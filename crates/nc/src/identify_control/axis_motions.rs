//! Limits and filters of the axes, from straight motions of single axes between rests.

use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::statistics::median;
use virtual_axes_core::units::{METER_PER_MINUTE, MILLISECOND, REVOLUTION, RPM, Rounded};

use super::control_estimate::ControlEstimate;
use super::identification::ControlIdentification;
use super::law::{FILTER_SHARE, RampLaw, Smoothing};
use super::ramp::{SpeedRamp, plateau, ramp};
use super::track::{Track, TrackedMotion};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, PathControl};

/// Relative difference of equal speeds.
const SAME_SPEED: f64 = 5e-3;
/// Fewest motions that show a feed override.
const LEAST_MOTIONS: usize = 4;

/// Straight motions of single axes between rests.
pub(super) struct AxisMotions<'a> {
    machine: &'a MachineConfig,
    ramps: Vec<Vec<SpeedRamp>>,
    /// Programmed feeds of the ramps.
    feeds: Vec<Vec<f64>>,
    rapids: Vec<Vec<f64>>,
    moving: [bool; AXIS_COUNT],
    pub law: Option<RampLaw>,
    /// Length of the shortest filter that the drives do not hide, s; 0 with setpoints.
    shortest: f64,
}

impl<'a> AxisMotions<'a> {
    pub fn new(machine: &'a MachineConfig, track: &Track<'_>) -> Self {
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

    /// Returns a warning if most straight motions run at the same part of the programmed feed, and below rapid traverse.
    pub fn feed_warning(&self, track: &Track<'_>) -> Option<String> {
        let factors = track.motions.iter().enumerate().filter_map(|(index, motion)| {
            if motion.arc.is_some() || !motion.is_linear() || motion.feed.is_infinite() {
                return None;
            }
            let [start, end] = track.samples[index];
            let constant = plateau(&track.places(index, start..end), track.log.accuracy)?;
            let speed = constant.step / track.log.period;
            let is_rapid = self.rapids.iter().zip(motion.direction()).any(|(rapids, part)| {
                rapids.first().is_some_and(|rapid| speed * part.abs() > (1.0 - SAME_SPEED) * rapid)
            });
            (!is_rapid).then_some(speed / motion.feed)
        });
        let mut factors: Vec<f64> = factors.collect();
        let factor = median(&mut factors)?;
        let alike = factors.iter().filter(|other| (*other / factor - 1.0).abs() < SAME_SPEED).count();
        let is_shown = alike >= LEAST_MOTIONS && 2 * alike > factors.len();
        (is_shown && (factor - 1.0).abs() > SAME_SPEED).then(|| {
            format!(
                "{alike} of {} motions run at {factor:.4} of the programmed feed: the sampling rate is wrong, and {} Hz would \
                 fit (--rate-hz), or the feed override is {} %",
                factors.len(),
                Rounded(1.0 / (track.log.period * factor)),
                Rounded(100.0 * factor)
            )
        })
    }

    /// Returns true if a motion of one axis reaches its feed.
    pub fn reaches(&self, axis: usize, motion: &TrackedMotion, speed: f64) -> bool {
        let rapid = self.rapids[axis].first().copied().unwrap_or(f64::INFINITY);
        speed > (1.0 - SAME_SPEED) * motion.feed.min(rapid)
    }

    pub fn identify(&self, found: &mut ControlIdentification) {
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
