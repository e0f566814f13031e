//! Figures of one motion, gathered while it runs.

use crate::config::AxisKind;
use crate::machine::Machine;

use super::ContourTracker;

/// Figures of one axis over a motion.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisReport {
    /// Largest |PSEC − SP| at position instants, m or rad; contains the pure delay.
    pub max_tracking_error: f64,
    /// RMS of PSEC − SP at position instants, m or rad.
    pub rms_tracking_error: f64,
    /// Largest |PSEC delayed by α − SP| at position instants, m or rad.
    pub max_synchronized_tracking_error: f64,
    /// RMS of PSEC delayed by α − SP at position instants, m or rad.
    pub rms_synchronized_tracking_error: f64,
    /// Largest |i| at any tick, A.
    pub peak_current: f64,
    /// Time with speed, current or voltage set-point at its limit, s.
    pub saturation_time: f64,
}

/// Figures of a motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionReport {
    /// Of each axis that took part, in the order of the assessor's axes.
    pub axes: Vec<AxisReport>,
    /// Largest distance from the path of the set-points at any tick, m; none without a linear axis.
    pub max_contour_error: Option<f64>,
    /// RMS of that distance, m.
    pub rms_contour_error: Option<f64>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    report: AxisReport,
    square_tracking: f64,
    square_synchronized: f64,
    saturated_ticks: u64,
}

/// Gathers the figures of a motion of some axes; nothing is allocated while it runs.
#[derive(Debug, Clone)]
pub struct MotionAssessor {
    /// Places of the axes in the machine, and their sums.
    axes: Vec<(usize, Sums)>,
    /// Places of the linear ones among them.
    linear: Vec<usize>,
    contour: ContourTracker,
    position: Vec<f64>,
    square_contour: f64,
    max_contour: f64,
    instants: u64,
    ticks: u64,
    tick: f64,
}

impl MotionAssessor {
    /// An assessor of the axes at `places` of a machine whose axes are of `kinds`, with ticks of
    /// `tick` seconds.
    pub fn new(places: &[usize], kinds: &[AxisKind], tick: f64) -> Self {
        let linear: Vec<usize> =
            places.iter().copied().filter(|&p| kinds.get(p) == Some(&AxisKind::Linear)).collect();
        MotionAssessor {
            axes: places.iter().map(|&p| (p, Sums::default())).collect(),
            contour: ContourTracker::new(linear.len()),
            position: vec![0.0; linear.len()],
            linear,
            square_contour: 0.0,
            max_contour: 0.0,
            instants: 0,
            ticks: 0,
            tick,
        }
    }

    /// Takes a tick into account; `position_instant` tells the first of a position period.
    pub fn observe(&mut self, machine: &Machine, position_instant: bool) {
        let axes = machine.axes();
        for (place, sums) in &mut self.axes {
            let s = axes[*place].sample();
            let report = &mut sums.report;
            report.peak_current = report.peak_current.max(s.current.abs());
            sums.saturated_ticks += u64::from(s.saturated);
            if position_instant {
                let (tracking, synchronized) = (s.tracking_error(), s.synchronized_tracking_error());
                report.max_tracking_error = report.max_tracking_error.max(tracking.abs());
                report.max_synchronized_tracking_error =
                    report.max_synchronized_tracking_error.max(synchronized.abs());
                sums.square_tracking += tracking * tracking;
                sums.square_synchronized += synchronized * synchronized;
            }
        }
        if !self.linear.is_empty() {
            if position_instant {
                self.contour.push(self.linear.iter().map(|&p| axes[p].sample().psec));
            }
            for (value, &p) in self.position.iter_mut().zip(&self.linear) {
                *value = axes[p].sample().position;
            }
            let distance = self.contour.distance(&self.position);
            self.max_contour = self.max_contour.max(distance);
            self.square_contour += distance * distance;
        }
        self.instants += u64::from(position_instant);
        self.ticks += 1;
    }

    /// The figures so far.
    pub fn report(&self) -> MotionReport {
        let rms = |square: f64, count: u64| if count == 0 { 0.0 } else { (square / count as f64).sqrt() };
        let axes = self
            .axes
            .iter()
            .map(|(_, sums)| AxisReport {
                rms_tracking_error: rms(sums.square_tracking, self.instants),
                rms_synchronized_tracking_error: rms(sums.square_synchronized, self.instants),
                saturation_time: sums.saturated_ticks as f64 * self.tick,
                ..sums.report
            })
            .collect();
        let has_path = !self.linear.is_empty();
        MotionReport {
            axes,
            max_contour_error: has_path.then_some(self.max_contour),
            rms_contour_error: has_path.then(|| rms(self.square_contour, self.ticks)),
        }
    }
}
