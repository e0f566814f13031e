//! Messages of this package with the fields of `msg/`.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use serde::{Deserialize, Serialize};

/// Name of this ROS package.
pub const PACKAGE: &str = "virtual_axes";

/// Message `MotorCurrents`; units in `msg/MotorCurrents.msg`.
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

/// Message `DriveStates`; units in `msg/DriveStates.msg`. `tracking_error` is the following error.
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
    pub wind_up: Vec<f64>,
}

/// Message `TrajectoryResult`; units in `msg/TrajectoryResult.msg`. `tracking_error` is the following error.
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

/// Source of a trajectory: the constants `SOURCE_*` of `msg/TrajectoryResult.msg`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Source {
    /// Topic `psec`.
    Topic = 0,
    /// Action `~/follow_joint_trajectory`.
    Action = 1,
    /// Topic `psec_stream`.
    Stream = 2,
    /// Action `~/run_program`.
    Program = 3,
}

/// Status of a trajectory: the constants `ACCEPTED` … `ABORTED` of `msg/TrajectoryResult.msg`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Accepted; starts at `start`.
    Accepted = 0,
    /// Rejected as a whole.
    Rejected = 1,
    /// All points were executed.
    Completed = 2,
    /// Preempted by a newer trajectory.
    Preempted = 3,
    /// Ended by a controlled stop or canceled.
    Stopped = 4,
    /// Ended by a reset, a clock jump or a violated tolerance.
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
