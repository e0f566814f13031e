//! Setpoints as they reach the position controllers, with their velocities: what `~/controller_state`
//! and the action's feedback compare the axes with.

use super::pace::Frame;
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectoryPoint;
use virtual_axes_io::messages::{JointTrajectoryControllerState, header};

/// The velocities of the synchronized setpoints, by difference from frame to frame:
/// `(PSEC_floor(k − α/Tsp) − the one before) / Tsp`.
#[derive(Debug, Default)]
pub struct SetpointVelocities {
    /// Time and resets of the frame before.
    before: Option<(Nanoseconds, u64)>,
    positions: Vec<f64>,
    velocities: Vec<f64>,
}

impl SetpointVelocities {
    /// Takes the next frame in; m/s or rad/s per axis, 0 in the first, after a reset and where the
    /// clock went backwards.
    pub fn update(&mut self, frame: &Frame) -> &[f64] {
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

/// What is asked of some axes and what they do: positions and velocities.
pub struct Comparison {
    /// The synchronized setpoints.
    pub desired: JointTrajectoryPoint,
    /// The axes.
    pub actual: JointTrajectoryPoint,
    /// `desired` less `actual`.
    pub error: JointTrajectoryPoint,
}

impl Comparison {
    /// Of the axes at `places`, in this order; `velocities` are those of the setpoints.
    pub fn of(frame: &Frame, velocities: &[f64], places: impl Iterator<Item = usize>) -> Self {
        let [mut desired, mut actual, mut error] = [(); 3].map(|()| JointTrajectoryPoint::default());
        for place in places {
            let (Some(sample), Some(&velocity)) = (frame.samples.get(place), velocities.get(place)) else {
                continue;
            };
            desired.positions.push(sample.delayed_psec);
            desired.velocities.push(velocity);
            actual.positions.push(sample.position);
            actual.velocities.push(sample.velocity);
            error.positions.push(sample.delay_compensated_following_error());
            error.velocities.push(velocity - sample.velocity);
        }
        Comparison { desired, actual, error }
    }
}

/// `~/controller_state` of a frame; `output` holds what the drives put out: the efforts at the axes, N
/// or N·m.
pub fn controller_state(
    frame: &Frame,
    velocities: &[f64],
    joints: &[String],
) -> JointTrajectoryControllerState {
    let Comparison { desired, actual, error } = Comparison::of(frame, velocities, 0..joints.len());
    let effort = frame.samples.iter().map(|sample| sample.effort).collect();
    JointTrajectoryControllerState {
        header: header(frame.time),
        joint_names: joints.to_vec(),
        reference: desired,
        feedback: actual,
        error,
        output: JointTrajectoryPoint { effort, ..JointTrajectoryPoint::default() },
        speed_scaling_factor: 1.0,
        ..JointTrajectoryControllerState::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use virtual_axes_core::machine::AxisSample;
    use virtual_axes_core::units::MILLISECOND_NS;

    fn frame(instant: i64, setpoint: f64) -> Frame {
        let sample =
            AxisSample { delayed_psec: setpoint, position: 0.25, velocity: 1.0, ..Default::default() };
        let samples = vec![AxisSample::default(), sample];
        Frame { instant, time: instant * MILLISECOND_NS, samples, resets: 0, motions: Vec::new() }
    }

    #[test]
    fn the_velocity_of_a_set_point_is_its_difference_also_over_a_frame_that_is_missing() {
        let mut velocities = SetpointVelocities::default();
        assert_eq!(velocities.update(&frame(5, 0.5)), [0.0, 0.0]);
        assert_eq!(velocities.update(&frame(6, 0.5625)), [0.0, 62.5]);
        assert_eq!(velocities.update(&frame(8, 0.6875)), [0.0, 62.5]);
    }

    #[test]
    fn a_reset_and_a_clock_that_goes_backwards_are_no_motion() {
        let mut velocities = SetpointVelocities::default();
        velocities.update(&frame(5, 0.5));
        assert_eq!(velocities.update(&Frame { resets: 1, ..frame(6, 0.0) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&Frame { resets: 1, ..frame(4, 0.25) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&Frame { resets: 1, ..frame(5, 0.25) }), [0.0, 0.0]);
        assert_eq!(velocities.update(&Frame { resets: 1, ..frame(6, 0.5) }), [0.0, 250.0]);
    }

    #[test]
    fn a_comparison_keeps_the_order_that_is_asked_for() {
        let found = Comparison::of(&frame(0, 0.5), &[0.0, 3.0], [1, 0].into_iter());
        assert_eq!((found.desired.positions, found.desired.velocities), (vec![0.5, 0.0], vec![3.0, 0.0]));
        assert_eq!((found.actual.positions, found.actual.velocities), (vec![0.25, 0.0], vec![1.0, 0.0]));
        assert_eq!((found.error.positions, found.error.velocities), (vec![0.25, 0.0], vec![2.0, 0.0]));
    }
}
