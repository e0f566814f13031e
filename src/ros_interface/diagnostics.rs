//! Keys of the statuses in `/diagnostics`.

/// Key of a diagnostic status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiagnosticKey {
    /// Key.
    pub key: &'static str,
    /// Unit of the value; empty if it has none.
    pub unit: &'static str,
    /// Meaning of the value.
    pub description: &'static str,
}

/// Kind of diagnostic status with its keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DiagnosticKind {
    /// Name of the status, with NODE and JOINT as placeholders.
    pub status: &'static str,
    /// Keys in the order of the message.
    pub keys: &'static [DiagnosticKey],
}

/// Defines a constant for each key, and the list of all.
macro_rules! keys {
    ($list:ident, $about:literal: $($name:ident = $key:literal, $unit:literal, $description:literal;)*) => {
        $(
            #[doc = concat!("Key `", $key, "`: ", $description, ".")]
            pub const $name: DiagnosticKey =
                DiagnosticKey { key: $key, unit: $unit, description: $description };
        )*
        #[doc = $about]
        pub const $list: &[DiagnosticKey] = &[$($name),*];
    };
}

keys! {
    NODE_KEYS, "Keys of the status of the node.":
    STATE = "state", "", "running, streaming, settling, holding, feed hold; paused, or waiting for `/clock` or a slow subscriber";
    FEED_OVERRIDE = "feed_override", "", "feed override in effect, 1 at the planned speed";
    TIME = "time", "", "time mode: real, fast, sim";
    CLOCK = "clock", "", "source of the clock: none, wall, own, followed";
    CLOCK_JUMPS = "clock_jumps", "", "jumps of `/clock` (back by a position cycle or more, ahead by more than 10 s) or steps of the wall clock (more than 0.1 s)";
    BEHIND_CLOCK_MS = "behind_clock_ms", "ms", "delay of the position cycles behind the clock";
    POSITION_PERIODS = "position_periods", "", "computed position cycles";
    MISSED_PERIODS = "missed_periods", "", "position cycles released after the next one was due";
    MISSED_PERIODS_LAST_SECOND = "missed_periods_last_second", "", "`missed_periods` since the previous message";
    UNPUBLISHED_PERIODS = "unpublished_periods", "",
        "position cycles computed but not published, after a stop of the process";
    DROPPED_SAMPLES = "dropped_samples", "", "samples not published because of a slow subscriber";
    MEAN_LATENESS_MS = "mean_lateness_ms", "ms",
        "mean delay of a position cycle behind its time, since the previous message";
    MAX_LATENESS_MS = "max_lateness_ms", "ms", "largest delay of a position cycle since the start";
    STREAM_DRIVES = "stream_drives", "", "true if a stream has a joint, moving or not";
    STREAM_DELAY_MS = "stream_delay_ms", "ms", "delay of the stream, the preview of the controllers";
    STREAM_SETPOINTS_REJECTED = "stream_setpoints_rejected", "",
        "setpoints out of range, outside the travel limits, not finite, or of an unknown joint";
    STREAM_SETPOINTS_IGNORED = "stream_setpoints_ignored", "",
        "setpoints received while a trajectory or a stop had the joint, or after a stop";
    STREAM_MESSAGES_OUT_OF_ORDER = "stream_messages_out_of_order", "",
        "messages ignored because a newer one was received before";
    STREAM_GAPS = "stream_gaps", "", "gaps during motion";
    STREAM_SPEED_LIMITED_PERIODS = "stream_speed_limited_periods", "",
        "position cycles in which the stream exceeded Vmax";
    STREAM_HELD_OFF = "stream_held_off", "", "true if a stream is ignored until it pauses";
    OTHER_CLOCK_PUBLISHERS = "other_clock_publishers", "",
        "other publishers of `/clock` with `time: fast`, an error: the node must be the only one";
    ENDPOINTS_DISCOVERED = "endpoints_discovered", "",
        "appearances of remote endpoints since the start (publishers, subscriptions, two of each service and client); one that returns counts again";
    ENDPOINTS_DEPARTED = "endpoints_departed", "",
        "disappearances of remote endpoints since the start; the middleware keeps 0.83 kB of each";
    MEMORY_MB = "memory_mb", "MB", "private memory of the process (RssAnon; Linux only)";
}

keys! {
    JOINT_KEYS, "Keys of the status of a joint.":
    SATURATED_PERIODS = "saturated_periods", "",
        "position cycles with a speed, current or voltage setpoint at its limit";
    FRICTION_EXTRAPOLATED_PERIODS = "friction_extrapolated_periods", "",
        "position cycles with the friction law extrapolated beyond its fitted speeds";
    OUTSIDE_TRAVEL_LIMITS_PERIODS = "outside_travel_limits_periods", "",
        "position cycles with the axis outside its travel limits";
}

keys! {
    RECORDING_KEYS, "Keys of the status of the recording.":
    FILE = "file", "", "path of the recording; this status exists if the node records";
    RECORDING = "recording", "", "true if the recording is active";
    SIZE_MB = "size_mb", "MB", "present size of the file";
    MESSAGES = "messages", "", "recorded messages";
    LEFT_OUT = "left_out", "", "messages not recorded";
}

/// All kinds of status.
pub const DIAGNOSTIC_KINDS: &[DiagnosticKind] = &[
    DiagnosticKind { status: "NODE: axes", keys: NODE_KEYS },
    DiagnosticKind { status: "NODE: JOINT", keys: JOINT_KEYS },
    DiagnosticKind { status: "NODE: recording", keys: RECORDING_KEYS },
];
