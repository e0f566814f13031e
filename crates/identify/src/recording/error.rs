//! Errors of the conditioning of a recording.

use virtual_axes_core::units::{MILLISECOND, Rounded};

/// Error of [`condition`](super::condition()): a recording that is not plausible for the axis.
///
/// Each variant names the recording. `looks_like` is the likely cause that the numbers suggest; it is empty
/// if no known cause fits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConditioningError {
    /// Channel whose number of values differs from the number of stamps.
    #[error("{name}: the {channel} has {found} values for {stamps} stamps; the file is likely truncated")]
    Lengths {
        /// Name of the recording.
        name: String,
        /// Name of the channel.
        channel: &'static str,
        /// Number of values.
        found: usize,
        /// Number of stamps.
        stamps: usize,
    },
    /// Recording with too few samples.
    #[error("{name}: {found} samples, at least {wanted} are required; the file is likely empty or truncated")]
    TooFew {
        /// Name of the recording.
        name: String,
        /// Number of samples.
        found: usize,
        /// Smallest permitted number of samples.
        wanted: usize,
    },
    /// Recording without position.
    #[error(
        "{name}: no position was recorded, or none of its values is a number; name its column by position=COLUMN[UNIT]"
    )]
    NoPosition {
        /// Name of the recording.
        name: String,
    },
    /// Recording with mostly non-finite stamps.
    #[error("{name}: {bad} of {stamps} stamps are not finite; check the time column")]
    StampsNotFinite {
        /// Name of the recording.
        name: String,
        /// Number of non-finite stamps.
        bad: usize,
        /// Number of stamps.
        stamps: usize,
    },
    /// Recording whose stamps are all equal.
    #[error("{name}: every stamp is {} s; check the time column", Rounded(*stamp))]
    StampsEqual {
        /// Name of the recording.
        name: String,
        /// Stamp, s.
        stamp: f64,
    },
    /// Recording whose stamps decrease.
    #[error("{name}: {back} of {stamps} stamps are earlier than the one before; check the time column")]
    StampsBackwards {
        /// Name of the recording.
        name: String,
        /// Number of decreasing stamps.
        back: usize,
        /// Number of stamps.
        stamps: usize,
    },
    /// Implausible sampling period; the time unit is likely wrong.
    #[error(
        "{name}: sampling period {} s, must be {} … {} s{}",
        Rounded(*period), Rounded(*shortest), Rounded(*longest), suggestion(looks_like)
    )]
    TimeUnit {
        /// Name of the recording.
        name: String,
        /// Sampling period, s.
        period: f64,
        /// Shortest plausible sampling period, s.
        shortest: f64,
        /// Longest plausible sampling period, s.
        longest: f64,
        /// Likely time unit of the stamps.
        looks_like: String,
    },
    /// Travel beyond the travel limits of the axis.
    #[error(
        "{name}: the {channel} covers {} {unit}, the travel limits of the axis {} {unit}{}",
        Rounded(*travel), Rounded(*range), suggestion(looks_like)
    )]
    BeyondTravelLimits {
        /// Name of the recording.
        name: String,
        /// Position or PSEC.
        channel: &'static str,
        /// Largest minus smallest value, m or rad.
        travel: f64,
        /// Length between the travel limits, m or rad.
        range: f64,
        /// Unit: m or rad.
        unit: &'static str,
        /// Likely unit of the channel.
        looks_like: String,
    },
    /// Speed beyond the limit of the axis.
    #[error(
        "{name}: the position changes at {} {unit}/s, the limit of the axis is {} {unit}/s{}",
        Rounded(*velocity), Rounded(*limit), suggestion(looks_like)
    )]
    TooFast {
        /// Name of the recording.
        name: String,
        /// 99th percentile of the speed, m/s or rad/s.
        velocity: f64,
        /// Vmax, m/s or rad/s.
        limit: f64,
        /// Unit: m or rad.
        unit: &'static str,
        /// Likely cause.
        looks_like: String,
    },
    /// Recorded velocity that is a multiple of the derivative of the position.
    #[error(
        "{name}: the velocity is {} times the derivative of the position{}",
        Rounded(*factor), suggestion(looks_like)
    )]
    VelocityScale {
        /// Name of the recording.
        name: String,
        /// Factor between recorded velocity and derivative.
        factor: f64,
        /// Likely cause.
        looks_like: String,
    },
    /// Recorded velocity that does not correlate with the derivative of the position.
    #[error(
        "{name}: the velocity does not correlate with the derivative of the position (correlation {correlation:.2}){}",
        suggestion(looks_like)
    )]
    VelocityUnrelated {
        /// Name of the recording.
        name: String,
        /// Correlation coefficient.
        correlation: f64,
        /// Likely cause.
        looks_like: String,
    },
    /// PSEC that is a multiple of the position.
    #[error("{name}: PSEC is {} times the position{}", Rounded(*factor), suggestion(looks_like))]
    PsecScale {
        /// Name of the recording.
        name: String,
        /// Factor between PSEC and position.
        factor: f64,
        /// Likely cause.
        looks_like: String,
    },
    /// PSEC that does not correlate with the position.
    #[error(
        "{name}: the position does not correlate with PSEC (correlation {correlation:.2}); \
         the columns are likely swapped or of another axis"
    )]
    PsecUnrelated {
        /// Name of the recording.
        name: String,
        /// Correlation coefficient.
        correlation: f64,
    },
    /// Offset between PSEC and position at rest.
    #[error(
        "{name}: at rest PSEC and position differ by {} {unit}, more than the largest following error {} {unit}; \
         record both with the same zero",
        Rounded(*distance), Rounded(*allowed)
    )]
    PsecApart {
        /// Name of the recording.
        name: String,
        /// Median distance, m or rad.
        distance: f64,
        /// Largest permitted distance, Vmax / Kp, m or rad.
        allowed: f64,
        /// Unit: m or rad.
        unit: &'static str,
    },
    /// PSEC that lags behind the position.
    #[error(
        "{name}: PSEC lags behind the position by {} ms: the recording delays the setpoint, or the two columns are swapped; \
         --psec-shift auto moves PSEC by this lag, --psec-shift MS by a known one",
        Rounded(lag * 1e3)
    )]
    PsecBehind {
        /// Name of the recording.
        name: String,
        /// Lag, s.
        lag: f64,
    },
    /// Low-pass filter of the control out of range.
    #[error("{name}: trace filter {} Hz, must lie in {lowest} … {highest} Hz", Rounded(*found))]
    TraceFilter {
        /// Name of the recording.
        name: String,
        /// Frequency given, Hz.
        found: f64,
        /// Lowest allowed frequency, Hz.
        lowest: f64,
        /// Highest allowed frequency, Hz.
        highest: f64,
    },
    /// Current beyond the limit of the motor.
    #[error(
        "{name}: the current reaches {} A, the limit of the motor is {} A{}",
        Rounded(*current), Rounded(*limit), suggestion(looks_like)
    )]
    CurrentTooLarge {
        /// Name of the recording.
        name: String,
        /// 99th percentile of the current magnitude, A.
        current: f64,
        /// Current limit of the motor, A.
        limit: f64,
        /// Likely cause.
        looks_like: String,
    },
    /// Current that is a multiple of a motion signal.
    #[error(
        "{name}: the current is a multiple of the {signal} (correlation {correlation:.5}); \
         its column likely contains a {signal}"
    )]
    CurrentIsMotion {
        /// Name of the recording.
        name: String,
        /// Position or velocity.
        signal: &'static str,
        /// Correlation coefficient.
        correlation: f64,
    },
    /// Cut-off frequency out of range.
    #[error(
        "{name}: cut-off {} Hz, must be {lowest:.3} … {highest:.1} Hz at a sampling period of {} s",
        Rounded(*found), Rounded(*period)
    )]
    Cutoff {
        /// Name of the recording.
        name: String,
        /// Given cut-off frequency, Hz.
        found: f64,
        /// Lowest cut-off frequency for the length of the recording, Hz.
        lowest: f64,
        /// Highest cut-off frequency for the sampling period, Hz.
        highest: f64,
        /// Sampling period, s.
        period: f64,
    },
    /// Given current lag out of range.
    #[error("{name}: --current-lag-ms is {}, must be {} … {}",
        Rounded(found / MILLISECOND),
        Rounded(lowest / MILLISECOND),
        Rounded(highest / MILLISECOND)
    )]
    Lag {
        /// Name of the recording.
        name: String,
        /// Given lag, s.
        found: f64,
        /// Smallest permitted lag, s.
        lowest: f64,
        /// Largest permitted lag, s.
        highest: f64,
    },
    /// Recording without a section of sufficient length.
    #[error(
        "{name}: the longest section without gap has {longest} samples, at least {wanted} are required; \
         record without gaps"
    )]
    NothingLeft {
        /// Name of the recording.
        name: String,
        /// Samples of the longest section.
        longest: usize,
        /// Smallest permitted number of samples.
        wanted: usize,
    },
}

fn suggestion(looks_like: &str) -> String {
    if looks_like.is_empty() { String::new() } else { format!("; {looks_like}") }
}
