//! Conversion between integer nanoseconds and ROS times and durations.

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::{Duration, Time};
use ros2_interfaces_jazzy_serde::std_msgs::msg::Header;

use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// Converts a time in ns since the Unix epoch into a ROS stamp; saturates at 32-bit seconds.
pub fn stamp(time: Nanoseconds) -> Time {
    let (sec, nanosec) = parts(time);
    Time { sec, nanosec }
}

/// Converts `time` in ns into a ROS duration; saturates at 32-bit seconds.
pub fn duration(time: Nanoseconds) -> Duration {
    let (sec, nanosec) = parts(time);
    Duration { sec, nanosec }
}

/// Creates a header with a time in ns since the Unix epoch and an empty frame.
pub fn header(time: Nanoseconds) -> Header {
    Header { stamp: stamp(time), frame_id: String::new() }
}

/// Splits a time in ns into whole seconds, rounded down, and the remaining nanoseconds.
pub fn parts(time: Nanoseconds) -> (i32, u32) {
    let sec = time.div_euclid(SECOND_NS).clamp(i32::MIN.into(), i32::MAX.into());
    (sec as i32, time.rem_euclid(SECOND_NS) as u32)
}

/// Converts a ROS time into ns since the Unix epoch without validation: `nanosec` may exceed one second.
pub fn nanoseconds(time: &Time) -> Nanoseconds {
    Nanoseconds::from(time.sec) * SECOND_NS + Nanoseconds::from(time.nanosec)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_before_the_epoch_keep_their_nanoseconds_positive() {
        assert_eq!(stamp(-1), Time { sec: -1, nanosec: 999_999_999 });
        assert_eq!(nanoseconds(&stamp(-1)), -1);
        assert_eq!(duration(-1_700_000_000), Duration { sec: -2, nanosec: 300_000_000 });
    }
}
