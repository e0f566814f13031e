//! Action `RunProgram` of this package with the fields of `msg/action/RunProgram.action`.

use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;
use serde::{Deserialize, Serialize};

/// Goal of the action `RunProgram`; units in `msg/action/RunProgram.action`.
#[allow(missing_docs, reason = "documented in msg/action/RunProgram.action")]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunProgramGoal {
    pub path: String,
    pub program: String,
    pub start_line: u32,
    pub feed_override: f64,
}

/// Result of the action `RunProgram`; units in `msg/action/RunProgram.action`. `synchronized_tracking_error` is the
/// delay-compensated following error.
#[allow(missing_docs, reason = "documented in msg/action/RunProgram.action")]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunProgramResult {
    pub error_code: i32,
    pub error_string: String,
    pub cycle_time: f64,
    pub programmed_time: f64,
    pub max_contour_error: f64,
    pub rms_contour_error: f64,
    pub name: Vec<String>,
    pub max_synchronized_tracking_error: Vec<f64>,
    pub rms_synchronized_tracking_error: Vec<f64>,
    pub worst_line: Vec<u32>,
    pub worst_synchronized_tracking_error: Vec<f64>,
}

/// Feedback of the action `RunProgram`; units in `msg/action/RunProgram.action`. `synchronized_tracking_error` is the
/// delay-compensated following error.
#[allow(missing_docs, reason = "documented in msg/action/RunProgram.action")]
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunProgramFeedback {
    pub header: Header,
    pub line: u32,
    pub path_position: f64,
    pub feed: f64,
    pub programmed_feed: f64,
    pub feed_override: f64,
    pub contour_error: f64,
    pub name: Vec<String>,
    pub synchronized_tracking_error: Vec<f64>,
}

/// Values of `error_code` in the result of the action `RunProgram`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum ProgramErrorCode {
    /// The program has ended, or was canceled.
    Successful = 0,
    /// Goal without a program, with two, or with an invalid feed override.
    InvalidGoal = -1,
    /// File that cannot be read.
    FileError = -2,
    /// Invalid program, or one that the machine cannot execute.
    ProgramError = -3,
    /// Preempted by a newer trajectory, goal or program.
    Preempted = -4,
    /// Stopped by a service, a clock jump or the end of the node.
    Stopped = -5,
}
