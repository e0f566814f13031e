//! Distance of rests from the ends of motions: setpoints behind a compensation, or with another scale than the program.

use virtual_axes_core::units::Rounded;

use super::log::ControlLog;
use super::track::{Track, TrackedMotion, distance};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, is_rotary};

/// Fewest steps of a rest.
const LEAST_STEPS: usize = 5;
/// Distance from the end of a motion above which a rest is a stop on the way, m.
const MOST_DISTANCE: f64 = 1e-3;
/// Part of the largest deviation up to which a scale leaves deviations.
const LEFT_BY_SCALE: f64 = 0.1;

/// Deviation of the rests of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RestDeviation {
    axis: usize,
    /// Largest deviation, m or rad.
    largest: f64,
    /// Scale and offset of the positions, m or rad, that explain the deviations.
    scale: Option<[f64; 2]>,
}

impl RestDeviation {
    /// Returns what the deviation means for the values.
    pub fn warning(&self) -> String {
        let (size, unit) = if is_rotary(self.axis) { (1f64.to_radians(), "deg") } else { (1e-6, "µm") };
        let letter = AXIS_LETTERS[self.axis];
        let largest = Rounded(self.largest / size);
        match self.scale {
            Some([scale, offset]) => format!(
                "{letter} rests up to {largest} {unit} beside the ends of motions, at {scale:.6} times the positions of the program \
                 plus {:.3} {unit}: its positions are corrected",
                offset / size
            ),
            None => format!(
                "{letter} rests up to {largest} {unit} beside the ends of motions, so that motions do not count: record setpoints \
                 before compensations"
            ),
        }
    }
}

/// Returns the log without the scales of deviations; `None` if none has a scale.
pub(super) fn without_scales(log: &ControlLog, deviations: &[RestDeviation]) -> Option<ControlLog> {
    deviations.iter().any(|deviation| deviation.scale.is_some()).then(|| {
        let mut log = log.clone();
        for RestDeviation { axis, scale, .. } in deviations {
            let Some([scale, offset]) = scale else { continue };
            log.positions.iter_mut().for_each(|at| at[*axis] = (at[*axis] - offset) / scale);
        }
        log
    })
}

impl Track<'_> {
    /// Returns the axes whose rests are off the ends of motions by more than digits.
    pub(super) fn rest_deviations(&self) -> Vec<RestDeviation> {
        if self.log.accuracy.is_estimated() {
            return Vec::new();
        }
        let rests = self.rests_beside_ends();
        let of = |axis: usize| {
            let pairs = rests.iter().map(|[at, end]| [end[axis], at[axis]]);
            let largest = pairs.clone().map(|[end, at]| (at - end).abs()).fold(0.0, f64::max);
            let scale = scale(pairs, LEFT_BY_SCALE * largest);
            (largest > self.rest_tolerance()).then_some(RestDeviation { axis, largest, scale })
        };
        (0..AXIS_COUNT).filter_map(of).collect()
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

/// Returns scale and offset that leave at most these deviations of positions from those of the program, given as pairs of
/// positions of the program and of the log.
fn scale(pairs: impl Iterator<Item = [f64; 2]> + Clone, most: f64) -> Option<[f64; 2]> {
    let count = pairs.clone().count() as f64;
    let mean = |index: usize| pairs.clone().map(|pair| pair[index]).sum::<f64>() / count;
    let means = [mean(0), mean(1)];
    let products = |index: usize| {
        pairs.clone().map(|pair| (pair[0] - means[0]) * (pair[index] - means[index])).sum::<f64>()
    };
    let scale = products(1) / products(0);
    let offset = means[1] - scale * means[0];
    let left = pairs.clone().map(|[end, at]| (at - offset - scale * end).abs());
    (left.fold(0.0, f64::max) <= most && scale.is_finite()).then_some([scale, offset])
}
