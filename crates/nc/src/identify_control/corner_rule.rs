//! Rule for the speed in corners, from all corners of a program.

use virtual_axes_core::statistics::{mean, rms};
use virtual_axes_core::units::METER_PER_MINUTE;

use super::control_estimate::ControlEstimate;
use super::corner::{CORNER_SPEEDS, LineCorner};
use super::identification::ControlIdentification;
use super::law::RampLaw;
use super::track::Track;

/// A rule of arcs has more than one arc in this number of corners.
const ARC_SHARE: usize = 4;

/// Returns the relative deviation of values from their mean, NaN without values.
fn spread(values: &[f64]) -> f64 {
    mean(values).and_then(|mean| rms(values.iter().map(|value| value / mean - 1.0))).unwrap_or(f64::NAN)
}

/// Identifies the rule for corners in G64.
pub(super) fn identify_corners(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
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
    let limits: Vec<ControlEstimate> = blended.iter().map(|corner| corner.limit).collect();
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
            slowed.iter().filter(|c| c.radius > 0.0).map(|c| c.speed * c.speed / (c.radius * c.limit.value));
        if let Some(normal) = ControlEstimate::of(normal.collect(), 5e-3) {
            found.push(
                "control.normal_fraction",
                ControlEstimate { value: normal.value.min(1.0), ..normal.divided_by(&limits) },
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
        corner
            .tolerance()
            .map(|tolerance| corner.speed.powi(2) * corner.bulge() / (tolerance * corner.limit.value))
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
    let open = open.map(|c| c.speed.powi(2) * c.bulge() / (normal.value * c.limit.value));
    if let Some(tolerance) = ControlEstimate::of(open.collect(), 1e-2) {
        found.push("control.corner_tolerance_mm", tolerance, 1e-3, "mm");
    }
    found.push(
        "control.normal_fraction",
        ControlEstimate { value: normal.value.min(1.0), ..normal.divided_by(&limits) },
        1.0,
        "",
    );
}
