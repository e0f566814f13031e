//! Figures of a part program that runs: times, and lines with the largest following errors.

use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::trajectory::{MotionId, PathPlace};
use virtual_axes_core::units::Nanoseconds;

/// Number of lines with the largest errors.
const WORST_LINES: usize = 10;

/// Place of a part program at one position cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProgramPlace {
    /// Motion of the program.
    pub motion: MotionId,
    /// Place on the path.
    pub place: PathPlace,
    /// Contour error at the end of the position cycle, m; NaN if unknown.
    pub contour_error: f64,
}

/// Figures of a part program that has ended.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ProgramRunFigures {
    /// Time from the first to the last setpoint, ns.
    pub cycle_time: Nanoseconds,
    /// Lines with the largest delay-compensated following errors of the linear axes, m, largest first.
    pub worst_lines: Vec<(usize, f64)>,
}

/// Figures of the active part program, updated at each position cycle.
#[derive(Debug)]
pub struct ProgramMonitor {
    /// Motion of the program.
    pub motion: MotionId,
    linear: Vec<usize>,
    first: Option<Nanoseconds>,
    last: Nanoseconds,
    worst_lines: Vec<(usize, f64)>,
}

impl ProgramMonitor {
    /// Creates the figures of a program on a machine with the linear axes `linear`, by their indices.
    pub fn new(motion: MotionId, linear: Vec<usize>) -> Self {
        let worst_lines = Vec::with_capacity(WORST_LINES + 1);
        Self { motion, linear, first: None, last: 0, worst_lines }
    }

    /// Adds the position cycle at `time`, ns, with its place on the path and its contour error, m; returns the place after
    /// the program has begun.
    pub fn update(
        &mut self,
        time: Nanoseconds,
        place: Option<PathPlace>,
        samples: &[AxisSample],
        contour_error: Option<f64>,
    ) -> Option<ProgramPlace> {
        let place = place.filter(|place| place.line > 0 || self.first.is_some())?;
        self.first.get_or_insert(time);
        self.last = time;
        let error = |&axis: &usize| samples.get(axis).map_or(0.0, |s| s.delay_compensated_following_error());
        let square: f64 = self.linear.iter().map(|axis| error(axis).powi(2)).sum();
        self.add(place.line, square.sqrt());
        let contour_error = contour_error.unwrap_or(f64::NAN);
        Some(ProgramPlace { motion: self.motion, place, contour_error })
    }

    fn add(&mut self, line: usize, error: f64) {
        match self.worst_lines.iter_mut().find(|(known, _)| *known == line) {
            Some((_, worst)) => *worst = worst.max(error),
            None => self.worst_lines.push((line, error)),
        }
        self.worst_lines.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        self.worst_lines.truncate(WORST_LINES);
    }

    /// Returns the figures of the program, whose last setpoint was one period after the last update.
    pub fn finish(self, period: Nanoseconds) -> ProgramRunFigures {
        let cycle_time = self.first.map_or(0, |first| self.last + period - first);
        ProgramRunFigures { cycle_time, worst_lines: self.worst_lines }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worst_lines_are_bounded_and_in_the_order_of_their_errors() {
        let mut track = ProgramMonitor::new(MotionId(1), vec![1]);
        let sample =
            |error: f64| [AxisSample::default(), AxisSample { delayed_psec: error, ..AxisSample::default() }];
        assert_eq!(track.update(5, None, &sample(9.0), None), None);
        assert_eq!(track.update(10, Some(PathPlace::default()), &sample(9.0), None), None);
        for line in 1..=100_usize {
            let place = PathPlace { line, ..PathPlace::default() };
            let error = if line % 2 == 0 { line as f64 } else { -0.5 };
            assert_eq!(
                track.update(10 * line as i64 + 10, Some(place), &sample(error), Some(error)),
                Some(ProgramPlace { motion: MotionId(1), place, contour_error: error })
            );
        }
        track.update(2000, None, &sample(0.0), None);
        let figures = track.finish(10);
        assert_eq!(figures.cycle_time, 1000);
        assert_eq!(figures.worst_lines.len(), WORST_LINES);
        assert_eq!(figures.worst_lines[..2], [(100, 100.0), (98, 98.0)]);
    }
}
