//! The door: ROS messages to typed values and back. Messages are converted here and nowhere else.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::{Duration, Time};
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;

use super::pace::Frame;
use crate::machine::AxisSample;
use crate::messages::{DriveStates, MotorCurrents};
use crate::simulation::MAX_LOAD;
use crate::trajectory::{Code, Rejection, Request, Row, Start};
use crate::units::{Nanoseconds, SECOND_NS};

/// A ROS stamp of a time in ns since the Unix epoch; what its 32 bits cannot say is cut off.
pub fn stamp(time: Nanoseconds) -> Time {
    let sec = time.div_euclid(SECOND_NS).clamp(i32::MIN.into(), i32::MAX.into());
    Time { sec: sec as i32, nanosec: time.rem_euclid(SECOND_NS) as u32 }
}

/// Nanoseconds of a ROS time or duration.
///
/// # Errors
/// [`Code::InvalidTime`] if `nanosec` is a second or more; `what` and `index` say where it stands.
fn nanoseconds(sec: i32, nanosec: u32, what: &str, index: Option<usize>) -> Result<Nanoseconds, Rejection> {
    if i64::from(nanosec) >= SECOND_NS {
        let text = format!("{what}: nanosec is {nanosec}, must be below {SECOND_NS}");
        let rejection =
            Rejection::new(Code::InvalidTime, text).numbers(f64::from(nanosec), SECOND_NS as f64 - 1.0);
        return Err(match index {
            Some(index) => rejection.index(index),
            None => rejection,
        });
    }
    Ok(i64::from(sec) * SECOND_NS + i64::from(nanosec))
}

/// A trajectory message as a request.
///
/// # Errors
/// [`Rejection`] for what no machine could run: wrong array sizes, values that are not finite,
/// malformed times, more than `max_points` points.
pub fn request(message: &JointTrajectory, max_points: usize) -> Result<Request, Rejection> {
    let Time { sec, nanosec } = message.header.stamp;
    let start = match nanoseconds(sec, nanosec, "header.stamp", None)? {
        0 => Start::Now,
        at => Start::At(at),
    };
    let points = &message.points;
    if points.len() > max_points {
        let text = format!("{} points are more than max_points, {max_points}", points.len());
        return Err(Rejection::new(Code::TooManyPoints, text).numbers(points.len() as f64, max_points as f64));
    }
    let mut request = Request::new(start, message.joint_names.clone());
    request.reserve(points.len());
    for (index, point) in points.iter().enumerate() {
        let Duration { sec, nanosec } = point.time_from_start;
        let time = nanoseconds(sec, nanosec, &format!("point {index}, time_from_start"), Some(index))?;
        request.push(
            time,
            Row {
                positions: &point.positions,
                velocities: &point.velocities,
                accelerations: &point.accelerations,
                effort: &point.effort,
            },
        )?;
    }
    Ok(request)
}

/// The loads of a message: place of the axis in `joints` and load, N or N·m.
///
/// # Errors
/// A sentence that names the first thing that is wrong; no load of the message is taken then.
pub fn loads(message: &JointState, joints: &[String]) -> Result<Vec<(usize, f64)>, String> {
    if message.name.len() != message.effort.len() {
        return Err(format!(
            "{} efforts for {} joints; effort needs one value for each name",
            message.effort.len(),
            message.name.len()
        ));
    }
    message
        .name
        .iter()
        .zip(&message.effort)
        .map(|(name, &load)| {
            let Some(place) = joints.iter().position(|j| j == name) else {
                return Err(format!("unknown joint {name}; there are {}", joints.join(", ")));
            };
            if message.name.iter().filter(|n| *n == name).count() > 1 {
                return Err(format!("joint {name} is named twice"));
            }
            if load.is_nan() || load.abs() > MAX_LOAD {
                return Err(format!("joint {name}: effort is {load}, must lie in ±{MAX_LOAD}"));
            }
            Ok((place, load))
        })
        .collect()
}

/// Header of what belongs to a position instant.
pub fn header(time: Nanoseconds) -> Header {
    Header { stamp: stamp(time), frame_id: String::new() }
}

fn column<T>(frame: &Frame, value: impl Fn(&AxisSample) -> T) -> Vec<T> {
    frame.samples.iter().map(value).collect()
}

/// `joint_states` of a frame.
pub fn joint_state(frame: &Frame, joints: &[String]) -> JointState {
    JointState {
        header: header(frame.time),
        name: joints.to_vec(),
        position: column(frame, |s| s.position),
        velocity: column(frame, |s| s.velocity),
        effort: column(frame, |s| s.effort),
    }
}

/// `~/motor_currents` of a frame.
pub fn motor_currents(frame: &Frame, joints: &[String]) -> MotorCurrents {
    MotorCurrents {
        header: header(frame.time),
        name: joints.to_vec(),
        current: column(frame, |s| s.current),
        current_setpoint: column(frame, |s| s.current_setpoint),
        friction: column(frame, |s| s.friction_current),
        gravity: column(frame, |s| s.gravity_current),
        load: column(frame, |s| s.load_current),
        saturated: column(frame, |s| s.saturated),
    }
}

/// `~/drive_states` of a frame.
pub fn drive_states(frame: &Frame, joints: &[String]) -> DriveStates {
    DriveStates {
        header: header(frame.time),
        name: joints.to_vec(),
        psec: column(frame, |s| s.psec),
        position: column(frame, |s| s.position),
        tracking_error: column(frame, AxisSample::tracking_error),
        synchronized_tracking_error: column(frame, AxisSample::synchronized_tracking_error),
        velocity: column(frame, |s| s.velocity),
        velocity_setpoint: column(frame, |s| s.velocity_setpoint),
        velocity_feedforward: column(frame, |s| s.velocity_feedforward),
        torque_feedforward: column(frame, |s| s.torque_feedforward),
        voltage: column(frame, |s| s.voltage),
        controller: column(frame, |s| s.controller.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectoryPoint;

    fn trajectory(nanosec: u32) -> JointTrajectory {
        JointTrajectory {
            joint_names: vec!["x".into()],
            points: vec![JointTrajectoryPoint {
                positions: vec![0.1],
                time_from_start: Duration { sec: 1, nanosec },
                ..JointTrajectoryPoint::default()
            }],
            ..JointTrajectory::default()
        }
    }

    #[test]
    fn a_nanosec_field_of_a_second_is_refused_with_its_point() {
        let rejection = request(&trajectory(1_000_000_000), 10).expect_err("must be refused");
        assert_eq!((rejection.code, rejection.index), (Code::InvalidTime, Some(0)));
        assert!(request(&trajectory(999_999_999), 10).is_ok());
    }

    #[test]
    fn more_points_than_allowed_are_refused_before_they_are_copied() {
        let rejection = request(&trajectory(0), 0).expect_err("must be refused");
        assert_eq!((rejection.code, rejection.value, rejection.limit), (Code::TooManyPoints, 1.0, 0.0));
    }

    #[test]
    fn a_load_of_nan_takes_the_whole_message_down() {
        let message = JointState {
            name: vec!["x".into(), "y".into()],
            effort: vec![1.0, f64::NAN],
            ..JointState::default()
        };
        let joints = ["x".to_owned(), "y".to_owned()];
        let error = loads(&message, &joints).expect_err("must be refused");
        assert!(error.contains('y') && error.contains("NaN"), "{error}");
    }

    #[test]
    fn stamps_before_the_epoch_keep_their_nanoseconds_positive() {
        assert_eq!(stamp(-1), Time { sec: -1, nanosec: 999_999_999 });
    }
}
