//! Converts axis samples into messages with reused buffers.

use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;

use super::own::{DriveStates, MotorCurrents};
use super::time::header;
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::units::Nanoseconds;

/// Message with one value per axis in each field.
pub trait Sampled {
    /// Creates a message with the names of `joints` and without values.
    fn named(joints: &[String]) -> Self;
    /// Overwrites the values with those of an instant (ns since the Unix epoch), one sample per joint; allocates only in
    /// the first call.
    fn fill(&mut self, time: Nanoseconds, samples: &[AxisSample]);

    /// Creates the message of an instant, ns since the Unix epoch.
    fn of(time: Nanoseconds, samples: &[AxisSample], joints: &[String]) -> Self
    where
        Self: Sized,
    {
        let mut message = Self::named(joints);
        message.fill(time, samples);
        message
    }
}

fn put<T>(column: &mut Vec<T>, samples: &[AxisSample], value: impl Fn(&AxisSample) -> T) {
    column.clear();
    column.extend(samples.iter().map(value));
}

impl Sampled for JointState {
    fn named(joints: &[String]) -> Self {
        JointState { name: joints.to_vec(), ..JointState::default() }
    }

    fn fill(&mut self, time: Nanoseconds, samples: &[AxisSample]) {
        self.header = header(time);
        put(&mut self.position, samples, |s| s.position);
        put(&mut self.velocity, samples, |s| s.velocity);
        put(&mut self.effort, samples, |s| s.effort);
    }
}

impl Sampled for MotorCurrents {
    fn named(joints: &[String]) -> Self {
        MotorCurrents { name: joints.to_vec(), ..MotorCurrents::default() }
    }

    fn fill(&mut self, time: Nanoseconds, samples: &[AxisSample]) {
        self.header = header(time);
        put(&mut self.current, samples, |s| s.current);
        put(&mut self.current_setpoint, samples, |s| s.current_setpoint);
        put(&mut self.friction, samples, |s| s.friction_current);
        put(&mut self.gravity, samples, |s| s.gravity_current);
        put(&mut self.load, samples, |s| s.load_current);
        put(&mut self.saturated, samples, |s| s.saturated);
    }
}

impl Sampled for DriveStates {
    fn named(joints: &[String]) -> Self {
        DriveStates { name: joints.to_vec(), ..DriveStates::default() }
    }

    fn fill(&mut self, time: Nanoseconds, samples: &[AxisSample]) {
        self.header = header(time);
        put(&mut self.psec, samples, |s| s.psec);
        put(&mut self.position, samples, |s| s.position);
        put(&mut self.tracking_error, samples, AxisSample::following_error);
        put(&mut self.synchronized_tracking_error, samples, AxisSample::delay_compensated_following_error);
        put(&mut self.velocity, samples, |s| s.velocity);
        put(&mut self.velocity_setpoint, samples, |s| s.velocity_setpoint);
        put(&mut self.velocity_feedforward, samples, |s| s.velocity_feedforward);
        put(&mut self.torque_feedforward, samples, |s| s.torque_feedforward);
        put(&mut self.voltage, samples, |s| s.voltage);
        put(&mut self.wind_up, samples, |s| s.wind_up);
        self.controller.resize_with(samples.len(), String::new);
        for (name, sample) in self.controller.iter_mut().zip(samples) {
            name.clear();
            name.push_str(sample.controller);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refilled_message_equals_a_new_one() {
        let joints = ["x".to_owned(), "y".to_owned()];
        let sample = |v: f64| AxisSample {
            position: v,
            effort: 2.0 * v,
            load_current: 3.0 * v,
            wind_up: 4.0 * v,
            controller: if v > 0.0 { "cascade" } else { "none" },
            ..AxisSample::default()
        };
        let mut drives = DriveStates::of(5, &[sample(-1.0), sample(-2.0)], &joints);
        let mut state = JointState::of(5, &[sample(-1.0), sample(-2.0)], &joints);
        let samples = [sample(1.0), sample(2.0)];
        drives.fill(7, &samples);
        state.fill(7, &samples);
        assert_eq!(drives, DriveStates::of(7, &samples, &joints));
        assert_eq!(state, JointState::of(7, &samples, &joints));
        assert_eq!((drives.tracking_error[1], drives.controller[1].as_str()), (-2.0, "cascade"));
        assert_eq!((state.effort[1], state.header.stamp.nanosec), (4.0, 7));
        assert_eq!(drives.wind_up, [4.0, 8.0]);
        assert_eq!(MotorCurrents::of(7, &samples, &joints).load, [3.0, 6.0]);
    }
}
