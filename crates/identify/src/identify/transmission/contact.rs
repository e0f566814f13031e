//! Equation of motion of the load: stiffness and damping relative to its inertia, and backlash.

use rayon::prelude::*;

use super::block_regression::BlockRegression;
use super::motion::TwoEncoderMotion;
use virtual_axes_core::statistics::median;

/// Number of blocks of the jackknife.
pub(super) const BLOCKS: usize = 20;
/// Largest number of steps of the search, and step relative to the twist at which it ends.
const STEPS: usize = 40;
const SETTLED: f64 = 1e-4;
/// Acceleration, relative to its 99 % quantile, above which its sign tells the flank that carries the load.
const CLEAR: f64 = 0.3;
/// Share of the samples that must touch each flank of the gap.
const TOUCHING: f64 = 0.01;
/// Smallest part of the effect of the gap that friction, spring and damper do not explain.
const INDEPENDENT: f64 = 0.01;
/// Columns: contact, its derivative, constant, direction, velocity, friction law, sine and cosine of the position; then the derivatives by
/// the middle of the gap and by half of its width.
const LINEAR: usize = 8;
const DIRECTION: usize = 3;
const VELOCITY: usize = 4;
const FRICTION: usize = 5;
const WITH_MIDDLE: usize = LINEAR + 1;
const WITH_GAP: usize = LINEAR + 2;

/// Fitted equation of the load.
#[derive(Debug, Clone)]
pub(super) struct ContactFit {
    /// Middle of the gap and its width, m or rad.
    pub gap: [f64; 2],
    /// Stiffness relative to the inertia of the load, 1/s², from all blocks and without each of them.
    pub stiffness: (f64, Vec<f64>),
    /// Damping relative to the inertia of the load, 1/s.
    pub damping: (f64, Vec<f64>),
    /// Force of the friction at the load relative to its inertia and to the friction law, 1/kg or 1/(kg·m²).
    pub load_friction: (f64, Vec<f64>),
    /// Error of `load_friction` by an error of the gap's width, 1/(N·s²).
    pub friction_by_width: f64,
    /// Time from the sample of the load's position to that of the motor's, s, if friction has no part in the twist by velocity.
    pub delay: (f64, Vec<f64>),
    /// Width of the gap, m or rad, without each of the blocks, or why it is unknown.
    pub widths: Result<Vec<f64>, UnknownGap>,
    /// Standard deviation of the twist within the contact, m or rad.
    pub spread: f64,
    /// Coefficient of determination R² of the acceleration.
    pub r_squared: f64,
    /// Largest standard deviation of the twist by the encoders, m or rad.
    pub noise: f64,
}

/// Reason why the width of a gap is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UnknownGap {
    /// One of the flanks is not touched.
    OneFlank,
    /// The flanks change with the direction of motion only, as the friction does.
    LikeFriction,
}

/// Gap of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gap {
    /// No gap: the width is 0.
    Closed,
    /// Gap of unknown width.
    Free,
}

/// Returns the fit of the least squares, or none if the motion does not determine it.
pub(super) fn fit_contact(motions: &[TwoEncoderMotion], has_tilt: bool, gap: Gap) -> Option<ContactFit> {
    let search = ContactSearch { motions, has_tilt, gap };
    let starts: Vec<[f64; 2]> = match gap {
        Gap::Closed => vec![[search.middle()?, 0.0]],
        Gap::Free => search.starts()?,
    };
    let found: Vec<(f64, [f64; 2])> = starts.into_iter().filter_map(|start| search.minimize(start)).collect();
    let (_, best) = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    search.finish(best)
}

struct ContactSearch<'a> {
    motions: &'a [TwoEncoderMotion],
    has_tilt: bool,
    gap: Gap,
}

impl ContactSearch<'_> {
    /// Returns the median twist.
    fn middle(&self) -> Option<f64> {
        let twists = self.motions.iter().flat_map(|motion| motion.samples().map(|i| motion.twist[i]));
        median(&mut twists.collect::<Vec<_>>())
    }

    /// Returns starting values of middle and width: from the accelerations whose sign tells the flank, and from the
    /// directions of motion at small accelerations.
    fn starts(&self) -> Option<Vec<[f64; 2]>> {
        let samples = || self.motions.iter().flat_map(|motion| motion.samples().map(move |i| (motion, i)));
        let mut sizes: Vec<f64> = samples().map(|(motion, i)| motion.load.second[i].abs()).collect();
        let large = virtual_axes_core::statistics::quantile(&mut sizes, 0.99)?;
        let mut regression = BlockRegression::new(3, 1);
        let [mut forward, mut backward] = [Vec::new(), Vec::new()];
        for (motion, i) in samples() {
            let (twist, acceleration) = (motion.twist[i], motion.load.second[i]);
            if acceleration.abs() > CLEAR * large {
                regression.add(0, &[1.0, acceleration.signum(), acceleration], twist);
            } else if motion.direction[i].abs() > 0.99 {
                let side = if motion.direction[i] > 0.0 { &mut forward } else { &mut backward };
                side.push(twist);
            }
        }
        let middle = self.middle()?;
        let mut starts = vec![[middle, 0.0]];
        let mut add = |middle: f64, width: f64| {
            starts.extend([0.5, 1.0, 1.5].map(|factor| [middle, factor * width.max(0.0)]));
        };
        if let Some(found) = regression.solve(3, None) {
            add(found[0], 2.0 * found[1]);
        }
        if let (Some(forward), Some(backward)) = (median(&mut forward), median(&mut backward)) {
            add((forward + backward) / 2.0, forward - backward);
        }
        Some(starts)
    }

    /// Returns the normal equations at a gap, with the share of the samples that touch each flank.
    fn regression(&self, [middle, width]: [f64; 2]) -> (BlockRegression, [f64; 2]) {
        let total: usize = self.motions.iter().map(|motion| motion.samples().len()).sum();
        let of_motion = |(motion, first): (&TwoEncoderMotion, usize)| {
            let mut regression = BlockRegression::new(WITH_GAP, BLOCKS);
            let mut flanks = [0.0; 2];
            let [contact, rate, by_middle, by_half] = motion.contact(middle, width);
            for (k, i) in motion.samples().enumerate() {
                // A load at rest may be held by its friction.
                if !motion.is_moving(i) {
                    continue;
                }
                let tilt = if self.has_tilt { motion.load.value[i].sin_cos() } else { (0.0, 0.0) };
                let row = [
                    contact[i],
                    rate[i],
                    1.0,
                    motion.direction[i],
                    motion.load.first[i],
                    motion.load_friction[i],
                    tilt.0,
                    tilt.1,
                    by_middle[i],
                    by_half[i],
                ];
                regression.add((first + k) * BLOCKS / total, &row, motion.load.second[i]);
                flanks[0] += (-by_middle[i] - by_half[i]) / 2.0;
                flanks[1] += (-by_middle[i] + by_half[i]) / 2.0;
            }
            (regression, flanks)
        };
        let firsts = self.motions.iter().scan(0, |before, motion| {
            let first = *before;
            *before += motion.samples().len();
            Some(first)
        });
        let parts: Vec<_> =
            self.motions.iter().zip(firsts).collect::<Vec<_>>().into_par_iter().map(of_motion).collect();
        let mut sum = BlockRegression::new(WITH_GAP, BLOCKS);
        let mut flanks = [0.0; 2];
        for (part, of_part) in parts {
            sum.merge(&part);
            flanks[0] += of_part[0] / total as f64;
            flanks[1] += of_part[1] / total as f64;
        }
        (sum, flanks)
    }

    /// Returns the number of columns with the derivatives that the search follows.
    fn columns(&self, flanks: [f64; 2]) -> usize {
        match self.gap {
            // Without a gap the middle is a part of the constant.
            Gap::Closed => LINEAR,
            Gap::Free if flanks[0].min(flanks[1]) < TOUCHING => LINEAR,
            Gap::Free => WITH_GAP,
        }
    }

    /// Returns the least squares from a start, with the gap there.
    fn minimize(&self, start: [f64; 2]) -> Option<(f64, [f64; 2])> {
        let mut gap = start;
        let (mut regression, mut flanks) = self.regression(gap);
        let mut least = regression.residual_squares(&regression.solve(LINEAR, None)?);
        for _ in 0..STEPS {
            let columns = self.columns(flanks);
            if columns < WITH_MIDDLE {
                break;
            }
            let solution = regression.solve(columns, None)?;
            let step = [solution[LINEAR] / solution[0], 2.0 * solution[WITH_MIDDLE] / solution[0]];
            let scale = self.spread(gap);
            if !step.iter().all(|x| x.is_finite()) || step[0].hypot(step[1]) < SETTLED * scale {
                break;
            }
            let mut factor = (scale / step[0].hypot(step[1])).min(1.0);
            let better = loop {
                let trial = [gap[0] + factor * step[0], (gap[1] + factor * step[1]).max(0.0)];
                let (there, touching) = self.regression(trial);
                let squares = there.residual_squares(&there.solve(LINEAR, None)?);
                if squares < least {
                    break Some((trial, there, touching, squares));
                }
                factor /= 4.0;
                if factor < 1e-3 {
                    break None;
                }
            };
            let Some(found) = better else { break };
            (gap, regression, flanks, least) = found;
        }
        Some((least, gap))
    }

    /// Returns the standard deviation of the twist beyond the gap, m or rad.
    fn spread(&self, [middle, width]: [f64; 2]) -> f64 {
        let mut sum = [0.0; 3];
        for motion in self.motions {
            let [contact, ..] = motion.contact(middle, width);
            for i in motion.samples() {
                sum[0] += 1.0;
                sum[1] += contact[i];
                sum[2] += contact[i] * contact[i];
            }
        }
        (sum[2] / sum[0] - (sum[1] / sum[0]).powi(2)).max(0.0).sqrt()
    }

    /// Returns the projection of the direction of motion on the friction law, 1/N or 1/(N·m).
    fn direction_along_law(&self) -> f64 {
        let mut sum = [0.0; 2];
        for motion in self.motions {
            for i in motion.samples().filter(|i| motion.is_moving(*i)) {
                sum[0] += motion.direction[i] * motion.load_friction[i];
                sum[1] += motion.load_friction[i].powi(2);
            }
        }
        if sum[1] > 0.0 { sum[0] / sum[1] } else { 0.0 }
    }

    fn finish(&self, gap: [f64; 2]) -> Option<ContactFit> {
        let (regression, flanks) = self.regression(gap);
        let columns = self.columns(flanks);
        let along_law = self.direction_along_law();
        let of = |c: &nalgebra::DVector<f64>| {
            let width = if columns == WITH_GAP { gap[1] + 2.0 * c[WITH_MIDDLE] / c[0] } else { gap[1] };
            // The part of the direction that the friction law does not contain, as a part of the law.
            let friction = c[FRICTION] + c[DIRECTION] * along_law;
            [c[0], c[1], width, -friction, -c[VELOCITY] / c[0]]
        };
        let (all, without) = regression.jackknife(columns, of)?;
        let column = |k: usize| without.iter().map(|values| values[k]).collect::<Vec<f64>>();
        let solution = regression.solve(LINEAR, None)?;
        let mut constant = BlockRegression::new(1, 1);
        for motion in self.motions {
            motion.samples().for_each(|i| constant.add(0, &[1.0], motion.load.second[i]));
        }
        let total = constant.residual_squares(&constant.solve(1, None)?);
        Some(ContactFit {
            gap,
            stiffness: (all[0], column(0)),
            damping: (all[1], column(1)),
            load_friction: (all[3], column(3)),
            friction_by_width: all[0] * along_law.abs() / 2.0,
            delay: (all[4], column(4)),
            widths: match columns {
                WITH_GAP if regression.independence(WITH_GAP, WITH_MIDDLE) < INDEPENDENT => {
                    Err(UnknownGap::LikeFriction)
                }
                WITH_GAP => Ok(column(2)),
                _ => Err(UnknownGap::OneFlank),
            },
            spread: self.spread(gap),
            r_squared: 1.0 - regression.residual_squares(&solution) / total,
            noise: self.motions.iter().map(|motion| motion.noise).fold(0.0, f64::max),
        })
    }
}
