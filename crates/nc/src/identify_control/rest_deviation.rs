//! Distance of rests from the ends of motions: setpoints behind a compensation, or with another scale than the program.

use virtual_axes_core::units::Rounded;

use super::track::{Track, TrackedMotion, distance};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, is_rotary};

/// Fewest steps of a rest.
const LEAST_STEPS: usize = 5;
/// Distance from the end of a motion above which a rest is a stop on the way, m.
const MOST_DISTANCE: f64 = 1e-3;
/// Part of the largest deviation up to which a scale leaves deviations.
const LEFT_BY_SCALE: f64 = 0.1;

impl Track<'_> {
    /// Allows for rests that are off the ends of motions by more than digits.
    pub(super) fn allow_rest_deviation(&mut self) {
        let rests = self.rests_beside_ends();
        let largest =
            |axis: usize| rests.iter().map(|[at, end]| (at[axis] - end[axis]).abs()).fold(0.0, f64::max);
        let most = rests.iter().map(|[at, end]| distance(at, end)).fold(0.0, f64::max);
        if most <= self.rest_tolerance {
            return;
        }
        for axis in (0..AXIS_COUNT).filter(|&axis| largest(axis) > self.rest_tolerance) {
            let (size, unit) = if is_rotary(axis) { (1f64.to_radians(), "deg") } else { (1e-6, "µm") };
            let scale =
                scale(rests.iter().map(|[at, end]| [end[axis], at[axis]]), LEFT_BY_SCALE * largest(axis));
            let scale = scale.map_or_else(String::new, |scale| format!(", as with a scale of {scale:.6}"));
            self.warnings.push(format!(
                "{} rests up to {} {unit} beside the ends of motions{scale}: record setpoints before compensations, or use the \
                 program with this scale",
                AXIS_LETTERS[axis],
                Rounded(largest(axis) / size)
            ));
        }
        self.rest_tolerance += most;
    }

    /// Returns the position of each rest, and the end of a motion beside it.
    fn rests_beside_ends(&self) -> Vec<[Coordinates; 2]> {
        let mut rests = Vec::new();
        let (mut motion, mut steps) = (0, 0);
        for (sample, &is_at_rest) in self.is_at_rest.iter().enumerate() {
            steps = if is_at_rest { steps + 1 } else { 0 };
            if steps != LEAST_STEPS {
                continue;
            }
            while self.samples[motion][1] <= sample && motion + 1 < self.motions.len() {
                motion += 1;
            }
            let at = self.log.positions[sample];
            let ends = |motion: &TrackedMotion| [motion.from, motion.to];
            let beside = self.motions[motion.saturating_sub(1)..(motion + 2).min(self.motions.len())].iter();
            let nearest = beside.flat_map(ends).min_by(|a, b| distance(a, &at).total_cmp(&distance(b, &at)));
            rests.extend(nearest.filter(|end| distance(end, &at) < MOST_DISTANCE).map(|end| [at, end]));
        }
        rests
    }
}

/// Returns the scale that leaves at most these deviations of positions from those of the program, given as pairs of
/// positions of the program and of the log.
fn scale(pairs: impl Iterator<Item = [f64; 2]> + Clone, most: f64) -> Option<f64> {
    let count = pairs.clone().count() as f64;
    let mean = |index: usize| pairs.clone().map(|pair| pair[index]).sum::<f64>() / count;
    let means = [mean(0), mean(1)];
    let products = |index: usize| {
        pairs.clone().map(|pair| (pair[0] - means[0]) * (pair[index] - means[index])).sum::<f64>()
    };
    let scale = products(1) / products(0);
    let left = pairs.clone().map(|[end, at]| (at - means[1] - scale * (end - means[0])).abs());
    (left.fold(0.0, f64::max) <= most).then_some(scale)
}
