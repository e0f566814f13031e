//! Why a recording cannot be used.

/// Why a recording cannot be used; each names the recording and what is likely wrong.
///
/// A `looks_like` is what the numbers suggest; it is empty where nothing known fits.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingFault {
    /// A channel has not one value for each stamp.
    #[error("{name}: the {channel} has {found} values for {stamps} stamps; the file is likely truncated")]
    Lengths {
        /// The recording.
        name: String,
        /// Which channel.
        channel: &'static str,
        /// Values there are.
        found: usize,
        /// Stamps there are.
        stamps: usize,
    },
    /// There are hardly any samples.
    #[error("{name}: {found} samples, at least {wanted} are wanted; the file is likely empty or truncated")]
    TooFew {
        /// The recording.
        name: String,
        /// Samples there are.
        found: usize,
        /// Samples there must be.
        wanted: usize,
    },
    /// There is no position.
    #[error("{name}: no actual position was recorded; say which column it is: position=COLUMN[UNIT]")]
    NoPosition {
        /// The recording.
        name: String,
    },
    /// Most stamps are no numbers.
    #[error("{name}: {bad} of {stamps} stamps are not finite; is the column of the time the right one?")]
    StampsNotFinite {
        /// The recording.
        name: String,
        /// How many.
        bad: usize,
        /// Of how many.
        stamps: usize,
    },
    /// All stamps are the same.
    #[error("{name}: every stamp is {stamp} s; is the column of the time the right one?")]
    StampsEqual {
        /// The recording.
        name: String,
        /// The stamp, s.
        stamp: f64,
    },
    /// The stamps run backwards.
    #[error(
        "{name}: {back} of {stamps} stamps lie before the one above them; is the column of the time the right one?"
    )]
    StampsBackwards {
        /// The recording.
        name: String,
        /// How many.
        back: usize,
        /// Of how many.
        stamps: usize,
    },
    /// Samples this far apart are no recording of a drive.
    #[error(
        "{name}: the samples are {period:e} s apart, must be {shortest:e} … {longest} s{}",
        suggestion(looks_like)
    )]
    TimeUnit {
        /// The recording.
        name: String,
        /// Sampling period as read, s.
        period: f64,
        /// Shortest that is plausible, s.
        shortest: f64,
        /// Longest that is plausible, s.
        longest: f64,
        /// The unit that the stamps are likely written in.
        looks_like: String,
    },
    /// The axis travels further than it can.
    #[error(
        "{name}: the {channel} covers {travel} {unit}, the stroke of the axis is {stroke} {unit}{}",
        suggestion(looks_like)
    )]
    BeyondStroke {
        /// The recording.
        name: String,
        /// Position or PSEC.
        channel: &'static str,
        /// From the smallest to the largest value, m or rad.
        travel: f64,
        /// Length of the stroke, m or rad.
        stroke: f64,
        /// m or rad.
        unit: &'static str,
        /// The unit that it is likely written in.
        looks_like: String,
    },
    /// The axis moves faster than it can.
    #[error(
        "{name}: the position changes by {velocity} {unit}/s, the axis is permitted {limit} {unit}/s{}",
        suggestion(looks_like)
    )]
    TooFast {
        /// The recording.
        name: String,
        /// 99th percentile of the speed, m/s or rad/s.
        velocity: f64,
        /// Vmax, m/s or rad/s.
        limit: f64,
        /// m or rad.
        unit: &'static str,
        /// What is likely wrong.
        looks_like: String,
    },
    /// The recorded velocity is a multiple of the position's derivative.
    #[error(
        "{name}: the velocity is {factor} times the derivative of the position{}",
        suggestion(looks_like)
    )]
    VelocityScale {
        /// The recording.
        name: String,
        /// How many times.
        factor: f64,
        /// What is likely wrong.
        looks_like: String,
    },
    /// The recorded velocity does not follow the position.
    #[error(
        "{name}: the velocity does not go with the derivative of the position (correlation {correlation:.2}){}",
        suggestion(looks_like)
    )]
    VelocityUnrelated {
        /// The recording.
        name: String,
        /// Between −1 and 1.
        correlation: f64,
        /// What is likely wrong.
        looks_like: String,
    },
    /// PSEC is a multiple of the position.
    #[error("{name}: PSEC moves {factor} times as far as the position{}", suggestion(looks_like))]
    PsecScale {
        /// The recording.
        name: String,
        /// How many times.
        factor: f64,
        /// What is likely wrong.
        looks_like: String,
    },
    /// PSEC does not go with the position.
    #[error(
        "{name}: the position does not follow PSEC (correlation {correlation:.2}); \
         are the columns of another axis, or swapped?"
    )]
    PsecUnrelated {
        /// The recording.
        name: String,
        /// Between −1 and 1.
        correlation: f64,
    },
    /// PSEC and the position have different zeros.
    #[error(
        "{name}: at rest PSEC lies {distance} {unit} from the position, more than the largest following error \
         {allowed} {unit}; record both from the same zero"
    )]
    PsecApart {
        /// The recording.
        name: String,
        /// Median distance, m or rad.
        distance: f64,
        /// Vmax / Kp, m or rad.
        allowed: f64,
        /// m or rad.
        unit: &'static str,
    },
    /// PSEC comes after the position.
    #[error(
        "{name}: PSEC comes {} ms after the position that should follow it; the two columns are likely swapped",
        lag * 1e3
    )]
    PsecBehind {
        /// The recording.
        name: String,
        /// By how much, s.
        lag: f64,
    },
    /// The current is larger than the motor can have.
    #[error(
        "{name}: the current reaches {current} A, the motor is limited to {limit} A{}",
        suggestion(looks_like)
    )]
    CurrentTooLarge {
        /// The recording.
        name: String,
        /// 99th percentile of its magnitude, A.
        current: f64,
        /// Largest current of the motor, A.
        limit: f64,
        /// What is likely wrong.
        looks_like: String,
    },
    /// The current works against the motion.
    #[error(
        "{name}: the current opposes the motion ({friction} A at steady speed towards plus, without gravity; \
         it must be positive): its sign is counted the other way; turn it: current=COLUMN[-1 A]"
    )]
    CurrentSign {
        /// The recording.
        name: String,
        /// Current that goes with the direction of motion, A.
        friction: f64,
    },
    /// The current is another signal.
    #[error(
        "{name}: the current is a multiple of the {signal} (correlation {correlation:.5}); \
         its column is likely that of a {signal}"
    )]
    CurrentIsMotion {
        /// The recording.
        name: String,
        /// Position or velocity.
        signal: &'static str,
        /// Between −1 and 1.
        correlation: f64,
    },
    /// The cut-off is out of range.
    #[error(
        "{name}: cut-off {found} Hz, must be {lowest:.3} … {highest:.1} Hz with samples {period} s apart"
    )]
    Cutoff {
        /// The recording.
        name: String,
        /// What was wished for, Hz.
        found: f64,
        /// Lowest that the length of the recording allows, Hz.
        lowest: f64,
        /// Highest that the sampling allows, Hz.
        highest: f64,
        /// Sampling period, s.
        period: f64,
    },
    /// The lag of the current is out of range.
    #[error("{name}: lag of the current {found} s, must be {lowest} … {highest} s")]
    Lag {
        /// The recording.
        name: String,
        /// What was given, s.
        found: f64,
        /// Smallest, s.
        lowest: f64,
        /// Largest, s.
        highest: f64,
    },
    /// No part of the recording is long enough.
    #[error(
        "{name}: between its gaps at most {longest} samples follow each other, at least {wanted} are wanted; \
         record without gaps"
    )]
    NothingLeft {
        /// The recording.
        name: String,
        /// Samples of the longest part.
        longest: usize,
        /// Samples there must be.
        wanted: usize,
    },
}

fn suggestion(looks_like: &str) -> String {
    if looks_like.is_empty() { String::new() } else { format!("; {looks_like}") }
}
