//! Motions before and after a standstill: their acceleration, and the wait between them.

use virtual_axes_core::statistics::mean;
use virtual_axes_core::units::MILLISECOND;

use super::axis_motions::AxisMotions;
use super::control_estimate::ControlEstimate;
use super::identification::ControlIdentification;
use super::law::{RampLaw, Smoothing};
use super::ramp::{plateau, ramp};
use super::track::{Track, TrackedMotion};
use crate::motion::PathControl;

/// Relative difference up to which a part is a whole.
const WHOLE: f64 = 0.015;

/// Identifies the acceleration of motions before a standstill in G64, and beside corners in G61.
pub(super) fn identify_ends(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    // Parts of the acceleration, and what they are divided by.
    let [mut overlaps, mut kinks] = [const { (Vec::new(), Vec::new()) }; 2];
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
            true => Some([limit.value, 1.0]),
            false => law.acceleration(&ramp, &[axis]),
        };
        let Some([acceleration, share]) = acceleration else { continue };
        let (parts, divisors) = if is_blended { &mut overlaps } else { &mut kinks };
        parts.push(acceleration / limit.value);
        divisors.extend([limit, ramp.square(share, track.log.accuracy.drive_squares)]);
    }
    let estimate = |(parts, divisors): (Vec<f64>, Vec<ControlEstimate>)| {
        ControlEstimate::of(parts, 2e-3).map(|estimate| estimate.divided_by(&divisors))
    };
    match estimate(overlaps) {
        Some(part) if part.value > 1.0 - WHOLE => {
            found.push("control.overlap_fraction", ControlEstimate { value: 1.0, ..part }, 1.0, "");
        }
        Some(part) => found.push("control.overlap_fraction", part, 1.0, ""),
        None => found.not_shown.push(
            "acceleration before a standstill in G64: no motion of one axis from rest to rest in G64 with a dwell behind it"
                .to_owned(),
        ),
    }
    match estimate(kinks) {
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
pub(super) fn identify_wait(track: &Track<'_>, axes: &AxisMotions<'_>, found: &mut ControlIdentification) {
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
        let law = axes.law.as_ref()?;
        let ramp = ControlEstimate { value: 0.5 * law.ramp_time(axis, speed)?, half_width: 0.0, count: 1 };
        let ramp = ramp.divided_by(law.accelerations[axis].as_slice());
        axes.reaches(axis, motion, speed).then(|| (at(0.0) * period, at(motion.length) * period, ramp))
    };
    let filters: f64 = axes.law.as_ref().map_or(0.0, |law| law.filters().iter().sum());
    let of_filters = match axes.law.as_ref().map(|law| &law.smoothing) {
        Some(Smoothing::Filters(stages)) => stages.iter().map(|stage| stage.half_width).sum(),
        _ => 0.0,
    };
    let mut of_ramps = Vec::new();
    let waits = (0..track.motions.len()).filter_map(|index| {
        let dwell = track.motions[index].dwell?;
        let is_blended = |motion: &TrackedMotion| matches!(motion.path_control, PathControl::Blend(_));
        let pair = [track.motions.get(index)?, track.motions.get(index + 1)?];
        if pair.into_iter().any(|motion| is_blended(motion) && motion.feed.is_finite()) {
            return None;
        }
        let ((_, end, braking), (start, _, starting)) = (ends(index)?, ends(index + 1)?);
        of_ramps.push(starting.half_width + braking.half_width);
        Some(start - starting.value - end - braking.value - dwell - filters)
    });
    match ControlEstimate::of(waits.collect(), 0.0) {
        Some(wait) => {
            let half_width = wait.half_width.max(0.1 * period).max(0.5 * track.log.accuracy.smoothing);
            let half_width = half_width.hypot(mean(&of_ramps).unwrap_or(0.0)).hypot(of_filters);
            let wait = ControlEstimate { value: wait.value.max(0.0), half_width, ..wait };
            found.push("control.wait_ms", wait, MILLISECOND, "ms");
        }
        None => found.not_shown.push(
            "wait at standstills: no dwell (G4) between two motions of single axes in G61 or at rapid traverse".to_owned(),
        ),
    }
}
