//! One axis of a real (or virtual) machine, as it was recorded.

/// What was recorded of one axis, as it was read: SI units, nothing mended.
///
/// Every channel that is there has a value for each stamp; NaN where nothing was recorded.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawRecording {
    /// What it is called in messages: the file.
    pub name: String,
    /// Stamps, s, as they were written: they can jitter, leap and repeat.
    pub time: Vec<f64>,
    /// PSEC, m or rad.
    pub psec: Option<Vec<f64>>,
    /// Actual position, m or rad.
    pub position: Option<Vec<f64>>,
    /// Actual velocity of the axis, m/s or rad/s.
    pub velocity: Option<Vec<f64>>,
    /// Motor current, A.
    pub current: Option<Vec<f64>>,
    /// VFFWS, rad/s of the motor (m/s of a linear motor).
    pub velocity_feedforward: Option<Vec<f64>>,
    /// TFFWS, N·m at the motor (N of a linear motor).
    pub torque_feedforward: Option<Vec<f64>>,
}

/// A recording that is fit for use: even in time within its spans, with zero-phase derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// What it is called in messages: the file.
    pub name: String,
    /// Sampling period, s.
    pub period: f64,
    /// Where the filter of velocity, acceleration and smoothed current passes half the power, Hz.
    pub cutoff: f64,
    /// How far the recorded current lags behind the motion, s; it has been taken back.
    pub current_lag: f64,
    /// What lies between two gaps, in the order of time.
    pub spans: Vec<Span>,
}

/// A part of a recording without gap: sample i is at `start + i · period`; all channels are as long.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Span {
    /// Time of the first sample in the recording, s.
    pub start: f64,
    /// PSEC, m or rad.
    pub psec: Option<Vec<f64>>,
    /// Actual position, m or rad, as recorded.
    pub position: Vec<f64>,
    /// Velocity, m/s or rad/s: derivative of the filtered position.
    pub velocity: Vec<f64>,
    /// Acceleration, m/s² or rad/s²: second derivative of the filtered position.
    pub acceleration: Vec<f64>,
    /// Velocity as recorded, m/s or rad/s.
    pub recorded_velocity: Option<Vec<f64>>,
    /// Motor current as recorded, A.
    pub current: Option<Vec<f64>>,
    /// Motor current behind the filter of the derivatives, A.
    pub smooth_current: Option<Vec<f64>>,
    /// VFFWS, rad/s of the motor.
    pub velocity_feedforward: Option<Vec<f64>>,
    /// TFFWS, N·m at the motor.
    pub torque_feedforward: Option<Vec<f64>>,
}
