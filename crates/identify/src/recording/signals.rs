//! Recorded signals of one axis, raw and conditioned.

/// Raw recording of one axis in SI units.
///
/// Each recorded channel has one value per stamp, NaN for missing values.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RawRecording {
    /// Name in messages, usually the file name.
    pub name: String,
    /// Stamps as recorded, s; they can jitter, jump and repeat.
    pub time: Vec<f64>,
    /// PSEC, m or rad.
    pub psec: Option<Vec<f64>>,
    /// Actual position, m or rad.
    pub position: Option<Vec<f64>>,
    /// Actual velocity of the axis, m/s or rad/s.
    pub velocity: Option<Vec<f64>>,
    /// Motor current, A.
    pub current: Option<Vec<f64>>,
    /// Motor torque, N·m (force of a linear motor, N), beside the current: both tell the torque constant.
    pub torque: Option<Vec<f64>>,
    /// VFFWS, rad/s of the motor (m/s of a linear motor).
    pub velocity_feedforward: Option<Vec<f64>>,
    /// TFFWS, N·m at the motor (N of a linear motor).
    pub torque_feedforward: Option<Vec<f64>>,
    /// Position of the motor at the axis, m or rad, beside that of the load in `position`.
    pub motor_position: Option<Vec<f64>>,
}

/// R² from which on a torque is a multiple of the current.
const PROPORTIONAL: f64 = 0.9;

impl RawRecording {
    /// Returns the torque constant, N·m/A (force constant, N/A), with its standard error; none without current and a torque
    /// in proportion to it.
    pub(super) fn torque_constant(&self) -> Option<(f64, f64)> {
        let pairs = self.current.iter().flatten().zip(self.torque.iter().flatten());
        let pairs = pairs.filter(|(current, torque)| current.is_finite() && torque.is_finite());
        let (mut count, mut square, mut product, mut torques) = (0.0, 0.0, 0.0, 0.0);
        for (current, torque) in pairs {
            count += 1.0;
            square += current * current;
            product += current * torque;
            torques += torque * torque;
        }
        let (value, determination) = (product / square, product * product / (square * torques));
        let error = ((torques / square - value * value).max(0.0) / (count - 1.0)).sqrt();
        (determination >= PROPORTIONAL && error.is_finite()).then_some((value.abs(), error))
    }
}

/// Conditioned recording: uniform sampling within each span, with zero-phase derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// Name in messages, usually the file name.
    pub name: String,
    /// Sampling period, s.
    pub period: f64,
    /// Period at which the control renews its signals, s, if the samples show it: repeated ones, or ones that move smoothly at
    /// the instants of the renewals only.
    pub renewal: Option<f64>,
    /// Cut-off frequency (half power) of the filter of velocity, acceleration and smoothed current, Hz.
    pub cutoff: f64,
    /// Half-power frequency, Hz, of the low-pass filter of the control that all signals but PSEC have passed.
    pub trace_filter: Option<f64>,
    /// Torque constant, N·m/A, or force constant, N/A, with its standard error, if current and torque were recorded.
    pub torque_constant: Option<(f64, f64)>,
    /// Compensated lag of the recorded current behind the motion, s.
    pub current_lag: f64,
    /// Sections between gaps, in order of time.
    pub spans: Vec<SignalSpan>,
}

/// Section of a recording without gap. Sample i is at `start + i · period`; all channels have the same
/// length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SignalSpan {
    /// Time of the first sample in the recording, s.
    pub start: f64,
    /// PSEC, m or rad.
    pub psec: Option<Vec<f64>>,
    /// Recorded position, m or rad.
    pub position: Vec<f64>,
    /// Velocity, m/s or rad/s: derivative of the filtered position.
    pub velocity: Vec<f64>,
    /// Acceleration, m/s² or rad/s²: second derivative of the filtered position.
    pub acceleration: Vec<f64>,
    /// Recorded velocity, m/s or rad/s.
    pub recorded_velocity: Option<Vec<f64>>,
    /// Recorded motor current, A.
    pub current: Option<Vec<f64>>,
    /// Motor current filtered as the position, A.
    pub smooth_current: Option<Vec<f64>>,
    /// VFFWS, rad/s of the motor.
    pub velocity_feedforward: Option<Vec<f64>>,
    /// TFFWS, N·m at the motor.
    pub torque_feedforward: Option<Vec<f64>>,
    /// Recorded position of the motor at the axis, m or rad.
    pub motor_position: Option<Vec<f64>>,
}
