//! Conversion between trajectory messages and trajectory requests.

use std::fmt;

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::{Duration, Time};
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::{JointTrajectory, JointTrajectoryPoint};

use super::time::{duration, header};
use virtual_axes_core::trajectory::{Rejection, RejectionCode, Start, TrajectoryPoint, TrajectoryRequest};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// Converts a trajectory message into a request.
///
/// # Errors
/// [`Rejection`] if array sizes do not match, a value is not finite, a time is malformed, or there are more than
/// `max_points` points.
pub fn request(message: &JointTrajectory, max_points: usize) -> Result<TrajectoryRequest, Rejection> {
    let start = start(&message.header)?;
    let points = &message.points;
    if points.len() > max_points {
        let text = format!("{} points are more than max_points, {max_points}", points.len());
        return Err(Rejection::new(RejectionCode::TooManyPoints, text)
            .numbers(points.len() as f64, max_points as f64));
    }
    let mut request = TrajectoryRequest::new(start, message.joint_names.clone());
    request.reserve(points.len());
    for (index, point) in points.iter().enumerate() {
        request.push(
            point_time(&point.time_from_start, index)?,
            TrajectoryPoint {
                positions: &point.positions,
                velocities: &point.velocities,
                accelerations: &point.accelerations,
                effort: &point.effort,
            },
        )?;
    }
    Ok(request)
}

/// Returns the start time of a trajectory from its header.
fn start(header: &Header) -> Result<Start, Rejection> {
    let Time { sec, nanosec } = header.stamp;
    Ok(match nanoseconds(sec, nanosec, format_args!("header.stamp"), None)? {
        0 => Start::Now,
        at => Start::At(at),
    })
}

/// Returns the time of point `index`, ns from the start.
fn point_time(time: &Duration, index: usize) -> Result<Nanoseconds, Rejection> {
    let Duration { sec, nanosec } = *time;
    nanoseconds(sec, nanosec, format_args!("point {index}, time_from_start"), Some(index))
}

/// Converts a request into a message, with stamp 0 for [`Start::Now`].
///
/// This is the inverse of [`request`], except that efforts are not stored and times saturate at 32-bit seconds.
pub fn joint_trajectory(request: &TrajectoryRequest) -> JointTrajectory {
    let at = match request.start() {
        Start::Now => 0,
        Start::At(at) => at,
    };
    let mut message = JointTrajectory {
        header: header(at),
        joint_names: request.joints().to_vec(),
        points: Vec::with_capacity(request.points()),
    };
    for (time, row) in (0..request.points()).filter_map(|index| request.point(index)) {
        message.points.push(point(time, row));
    }
    message
}

/// Creates a point `time` ns after the start.
pub fn point(time: Nanoseconds, row: TrajectoryPoint<'_>) -> JointTrajectoryPoint {
    JointTrajectoryPoint {
        positions: row.positions.to_vec(),
        velocities: row.velocities.to_vec(),
        accelerations: row.accelerations.to_vec(),
        effort: row.effort.to_vec(),
        time_from_start: duration(time),
    }
}

/// Converts a ROS time or duration into nanoseconds.
///
/// # Errors
/// [`RejectionCode::InvalidTime`] if `nanosec` is one second or more; `what` and `index` name the field and the point.
fn nanoseconds(
    sec: i32,
    nanosec: u32,
    what: fmt::Arguments<'_>,
    index: Option<usize>,
) -> Result<Nanoseconds, Rejection> {
    if i64::from(nanosec) >= SECOND_NS {
        let text = format!("{what}: nanosec is {nanosec}, must be below {SECOND_NS}");
        let rejection = Rejection::new(RejectionCode::InvalidTime, text)
            .numbers(f64::from(nanosec), SECOND_NS as f64 - 1.0);
        return Err(match index {
            Some(index) => rejection.index(index),
            None => rejection,
        });
    }
    Ok(i64::from(sec) * SECOND_NS + i64::from(nanosec))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn nanosec_of_one_second_is_rejected_with_its_point() {
        let rejection = request(&trajectory(1_000_000_000), 10).expect_err("must be rejected");
        assert_eq!((rejection.code, rejection.index), (RejectionCode::InvalidTime, Some(0)));
        assert!(request(&trajectory(999_999_999), 10).is_ok());
    }

    #[test]
    fn more_than_max_points_are_rejected_before_they_are_copied() {
        let rejection = request(&trajectory(0), 0).expect_err("must be rejected");
        assert_eq!(
            (rejection.code, rejection.value, rejection.limit),
            (RejectionCode::TooManyPoints, 1.0, 0.0)
        );
    }

    #[test]
    fn message_round_trips_through_a_request() {
        let mut message = trajectory(5);
        message.header.stamp = Time { sec: 7, nanosec: 8 };
        message.points[0].velocities = vec![0.2];
        message.points.push(JointTrajectoryPoint {
            positions: vec![0.3],
            velocities: vec![0.4],
            accelerations: vec![0.5],
            effort: vec![],
            time_from_start: Duration { sec: 2, nanosec: 0 },
        });
        message.points.push(JointTrajectoryPoint {
            positions: vec![0.6],
            time_from_start: Duration { sec: 3, nanosec: 0 },
            ..JointTrajectoryPoint::default()
        });
        assert_eq!(joint_trajectory(&request(&message, 3).expect("a good message")), message);
    }
}
