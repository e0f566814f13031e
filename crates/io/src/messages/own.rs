//! This package's own messages, field by field as in `msg/`.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use serde::{Deserialize, Serialize};

/// Name of this ROS package.
pub const PACKAGE: &str = "virtual_axes";

/// `msg/MotorCurrents.msg`; units there.
#[allow(missing_docs, reason = "documented in msg/MotorCurrents.msg")]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MotorCurrents {
    pub header: Header,
    pub name: Vec<String>,
    pub current: Vec<f64>,
    pub current_setpoint: Vec<f64>,
    pub friction: Vec<f64>,
    pub gravity: Vec<f64>,
    pub load: Vec<f64>,
    pub saturated: Vec<bool>,
}

/// `msg/DriveStates.msg`; units there.
#[allow(missing_docs, reason = "documented in msg/DriveStates.msg")]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveStates {
    pub header: Header,
    pub name: Vec<String>,
    pub psec: Vec<f64>,
    pub position: Vec<f64>,
    pub tracking_error: Vec<f64>,
    pub synchronized_tracking_error: Vec<f64>,
    pub velocity: Vec<f64>,
    pub velocity_setpoint: Vec<f64>,
    pub velocity_feedforward: Vec<f64>,
    pub torque_feedforward: Vec<f64>,
    pub voltage: Vec<f64>,
    pub controller: Vec<String>,
}

/// `msg/TrajectoryResult.msg`; units there.
#[allow(missing_docs, reason = "documented in msg/TrajectoryResult.msg")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryResult {
    pub header: Header,
    pub source: u8,
    pub trajectory_stamp: Time,
    pub sequence_number: u64,
    pub publisher_gid: [u8; 16],
    pub goal_id: [u8; 16],
    pub start: Time,
    pub status: u8,
    pub code: u16,
    pub joint: String,
    pub point_index: i32,
    pub value: f64,
    pub limit: f64,
    pub text: String,
    pub name: Vec<String>,
    pub max_tracking_error: Vec<f64>,
    pub rms_tracking_error: Vec<f64>,
    pub max_synchronized_tracking_error: Vec<f64>,
    pub rms_synchronized_tracking_error: Vec<f64>,
    pub max_contour_error: f64,
    pub rms_contour_error: f64,
    pub peak_current: Vec<f64>,
    pub saturation_time: Vec<f64>,
}

/// `SOURCE_*` of `msg/TrajectoryResult.msg`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Source {
    /// The topic `psec`.
    Topic = 0,
    /// A goal of `~/follow_joint_trajectory`.
    Action = 1,
    /// The topic `psec_stream`.
    Stream = 2,
}

/// `ACCEPTED` … `ABORTED` of `msg/TrajectoryResult.msg`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// It starts at `start`.
    Accepted = 0,
    /// Refused whole.
    Rejected = 1,
    /// Every point has been executed.
    Completed = 2,
    /// A newer one took axes over.
    Preempted = 3,
    /// Ended by a controlled stop, or called off.
    Stopped = 4,
    /// Ended by a reset, a clock that jumped, or a tolerance that was not kept.
    Aborted = 5,
}

impl Default for TrajectoryResult {
    fn default() -> Self {
        TrajectoryResult {
            header: Header::default(),
            source: Source::Topic as u8,
            trajectory_stamp: Time::default(),
            sequence_number: 0,
            publisher_gid: [0; 16],
            goal_id: [0; 16],
            start: Time::default(),
            status: Status::Accepted as u8,
            code: 0,
            joint: String::new(),
            point_index: -1,
            value: f64::NAN,
            limit: f64::NAN,
            text: String::new(),
            name: Vec::new(),
            max_tracking_error: Vec::new(),
            rms_tracking_error: Vec::new(),
            max_synchronized_tracking_error: Vec::new(),
            rms_synchronized_tracking_error: Vec::new(),
            max_contour_error: f64::NAN,
            rms_contour_error: f64::NAN,
            peak_current: Vec::new(),
            saturation_time: Vec::new(),
        }
    }
}
