//! Parts of the acceleration on arcs, across and along the path.

use super::control_estimate::ControlEstimate;
use super::corner::CORNER_SPEEDS;
use super::identification::ControlIdentification;
use super::law::RampLaw;
use super::ramp::{plateau, ramp};
use super::track::Track;

/// Part of the best ramp from which on a ramp shows its acceleration.
const SHOWN: f64 = 0.6;

/// Identifies the parts of the acceleration on arcs.
pub(super) fn identify_circles(track: &Track<'_>, law: &RampLaw, found: &mut ControlIdentification) {
    let period = track.log.period;
    let (mut normals, mut tangentials, mut divisors) = (Vec::new(), Vec::new(), Vec::new());
    for (index, motion) in track.motions.iter().enumerate() {
        let Some(arc) = motion.arc.filter(|_| motion.is_linear()) else { continue };
        let [Some(before), _] = track.rests(index) else { continue };
        let [Some(x), Some(y)] = arc.plane.map(|axis| law.accelerations[axis]) else { continue };
        let places = track.places(index, before.saturating_sub(5)..track.samples[index][1]);
        let Some(constant) = plateau(&places, track.log.accuracy) else { continue };
        let speed = constant.step / period;
        let limit = x.value.min(y.value);
        divisors.extend([x, y]);
        if speed < CORNER_SPEEDS[1] * motion.feed {
            normals.push(speed * speed / (arc.radius * limit));
        }
        let Some(ramp) = ramp(&places, &constant, period) else { continue };
        let Some([acceleration, share]) = law.acceleration(&ramp, &arc.plane) else { continue };
        tangentials.push((acceleration / limit, share, ramp.square(share, track.log.accuracy.drive_squares)));
    }
    found.values.retain(|value| value.key != "control.normal_fraction" || normals.is_empty());
    let estimate = |parts: Vec<f64>, divisors: &[ControlEstimate]| {
        ControlEstimate::of(parts, 2e-3).map(|estimate| estimate.divided_by(divisors))
    };
    match estimate(normals, &divisors) {
        Some(e) => found.push("control.normal_fraction", ControlEstimate { value: e.value.min(1.0), ..e }, 1.0, ""),
        None => found.not_shown.push(
            "acceleration across the path on arcs: no arc from rest that limits the feed; it takes a higher feed or smaller \
             radii"
                .to_owned(),
        ),
    }
    // The circles that show it best.
    let best = tangentials.iter().map(|(_, share, _)| *share).fold(0.0, f64::max);
    tangentials.retain(|(_, share, _)| *share >= SHOWN * best);
    divisors.extend(tangentials.iter().map(|(.., ramp)| *ramp));
    match estimate(tangentials.iter().map(|(part, ..)| *part).collect(), &divisors) {
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
