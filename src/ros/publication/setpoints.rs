//! Delay-compensated setpoints with their velocities, and their comparison with the axes in `~/controller_state` and
//! the feedback of the action.

use crate::ros::axes::SampleFrame;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectoryPoint;
use virtual_axes_io::messages::{JointTrajectoryControllerState, header};

/// Velocities of the setpoints delayed by α, as the difference quotient of successive frames:
/// `(PSEC(floor(k − α/Tsp)) − PSEC(floor(k − 1 − α/Tsp))) / Tsp`.
#[derive(Debug, Default)]
pub struct SetpointVelocities {
    /// Time, ns, and number of resets of the previous frame.
    before: Option<(Nanoseconds, u64)>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
}

impl SetpointVelocities {
    /// Returns the setpoint velocities of all axes at the next frame, m/s or rad/s; 0 at the first frame, after a
    /// reset, and if the clock went backwards.
    pub fn update(&mut self, frame: &SampleFrame) -> &[f64] {
        let before = self.before.filter(|&(_, resets)| resets == frame.resets);
        let elapsed = before.map(|(time, _)| seconds(frame.time - time)).filter(|&time| time > 0.0);
        self.velocities.clear();
        self.velocities.extend(frame.samples.iter().enumerate().map(|(axis, sample)| {
            match (elapsed, self.positions.get(axis)) {
                (Some(elapsed), Some(position)) => (sample.delayed_psec - position) / elapsed,
                _ => 0.0,
            }
        }));
        self.positions.clear();
        self.positions.extend(frame.samples.iter().map(|sample| sample.delayed_psec));
        self.before = Some((frame.time, frame.resets));
        &self.velocities
    }
}

/// Comparison of the delayed setpoints of some axes with their positions and velocities.
pub struct JointComparison {
    /// Setpoints delayed by α.
    pub desired: JointTrajectoryPoint,
    /// Simulated positions and velocities.
    pub actual: JointTrajectoryPoint,
    /// Difference `desired` − `actual`: the delay-compensated following error.
    pub error: JointTrajectoryPoint,
}

impl JointComparison {
    /// Creates the comparison of the axes with the given indices, in their order; `velocities` are the setpoint
    /// velocities of all axes.
    pub fn new(frame: &SampleFrame, velocities: &[f64], indices: impl Iterator<Item = usize>) -> Self {
        let [mut desired, mut actual, mut error] = [(); 3].map(|()| JointTrajectoryPoint::default());
        for index in indices {
            let (Some(sample), Some(&velocity)) = (frame.samples.get(index), velocities.get(index)) else {
                continue;
            };
            desired.positions.push(sample.delayed_psec);
            desired.velocities.push(velocity);
            actual.positions.push(sample.position);
            actual.velocities.push(sample.velocity);
            error.positions.push(sample.delay_compensated_following_error());
            error.velocities.push(velocity - sample.velocity);
        }
        JointComparison { desired, actual, error }
    }
}

/// Creates the message `~/controller_state` of a frame; its `output` contains the efforts of the drives at the axes,
/// N or N·m.
pub fn controller_state(
    frame: &SampleFrame,
    velocities: &[f64],
    joints: &[String],
) -> JointTrajectoryControllerState {
    let JointComparison { desired, actual, error } = JointComparison::new(frame, velocities, 0..joints.len());
    let effort = frame.samples.iter().map(|sample| sample.effort).collect();
    JointTrajectoryControllerState {
        header: header(frame.time),
        joint_names: joints.to_vec(),
        reference: desired,
        feedback: actual,
        error,
        output: JointTrajectoryPoint { effort, ..JointTrajectoryPoint::default() },
        speed_scaling_factor: frame.feed_rate,
        ..JointTrajectoryControllerState::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::machine::AxisSample;
    use virtual_axes_core::units::MILLISECOND_NS;

    fn frame(instant: i64, setpoint: f64) -> SampleFrame {
        let sample =
            AxisSample { delayed_psec: setpoint, position: 0.25, velocity: 1.0, ..Default::default() };
        let samples = vec![AxisSample::default(), sample];
        SampleFrame { instant, time: instant * MILLISECOND_NS, samples, ..SampleFrame::default() }
    }

    #[test]
    fn setpoint_velocity_is_the_difference_also_over_missing_frames() {
        let mut velocities = SetpointVelocities::default();
        assert_eq!(velocities.update(&frame(5, 0.5)), [0.0, 0.0]);
        assert_eq!(velocities.update(&frame(6, 0.5625)), [0.0, 62.5]);
        assert_eq!(velocities.update(&frame(8, 0.6875)), [0.0, 62.5]);
    }

    #[test]
    fn a_reset_or_a_backward_clock_jump_gives_zero_velocity() {
        let mut velocities = SetpointVelocities::default();
        velocities.update(&frame(5, 0.5));
        assert_eq!(velocities.update(&SampleFrame { resets: 1, ..frame(6, 0.0) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&SampleFrame { resets: 1, ..frame(4, 0.25) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&SampleFrame { resets: 1, ..frame(5, 0.25) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&SampleFrame { resets: 1, ..frame(6, 0.5) }), [0.0, 250.0]);
    }

    #[test]
    fn a_comparison_keeps_the_requested_order() {
        let found = JointComparison::new(&frame(0, 0.5), &[0.0, 3.0], [1, 0].into_iter());
        assert_eq!((found.desired.positions, found.desired.velocities), (vec![0.5, 0.0], vec![3.0, 0.0]));
        assert_eq!((found.actual.positions, found.actual.velocities), (vec![0.25, 0.0], vec![1.0, 0.0]));
        assert_eq!((found.error.positions, found.error.velocities), (vec![0.25, 0.0], vec![2.0, 0.0]));
    }
}
