//! Diagnostics of the node and its axes (`/diagnostics`, REP-107).

use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};

use tokio::sync::watch;
use tracing::warn;

use super::process_memory::private_memory_mb;
use crate::ros::axes::{AxisHealth, ClockSource, Health};
use crate::ros::topics::{Output, RecordingStatus};
use crate::ros_interface::diagnostics::{self as keys, DiagnosticKey};
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, Rounded};
use virtual_axes_dds::EndpointCounts;
use virtual_axes_io::messages::header;

/// Period of `/diagnostics` (REP-107).
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);

/// Constant contents of the diagnostics, and the source of the discovery count.
#[derive(Debug, Clone)]
pub struct Diagnostics {
    /// Fully qualified name of the node.
    pub node: String,
    /// Name of the machine.
    pub machine: String,
    /// Names of the joints, with prefix.
    pub joints: Vec<String>,
    /// Counts of remote endpoints.
    pub endpoints: EndpointCounts,
    /// Number of other publishers of `/clock` in `fast`.
    pub other_clocks: Arc<AtomicUsize>,
}

fn value(key: DiagnosticKey, value: impl Display) -> KeyValue {
    KeyValue { key: key.key.to_owned(), value: value.to_string() }
}

impl Diagnostics {
    /// Creates the message at `time`, ns, with the events between the states `before` and `now`.
    ///
    /// `outputs_dropped` is the number of messages dropped for slow subscribers since the start, before and now.
    pub fn message(
        &self,
        time: Nanoseconds,
        before: &Health,
        now: &Health,
        outputs_dropped: (u64, u64),
    ) -> DiagnosticArray {
        let axes = self.axes(before, now).map(|(joint, before, now)| self.axis(joint, before, now));
        let mut node = self.node_status(before, now, outputs_dropped);
        let other_clocks = self.other_clocks.load(Ordering::Relaxed);
        if other_clocks > 0 {
            node.level = DiagnosticStatus::ERROR;
            node.message = "another node publishes /clock: it must have one publisher".to_owned();
        }
        node.values.push(value(keys::OTHER_CLOCK_PUBLISHERS, other_clocks));
        node.values.push(value(keys::ENDPOINTS_DISCOVERED, self.endpoints.discovered()));
        node.values.push(value(keys::ENDPOINTS_DEPARTED, self.endpoints.departed()));
        node.values.extend(private_memory_mb().map(|memory| value(keys::MEMORY_MB, format!("{memory:.1}"))));
        let status = std::iter::once(node).chain(axes).collect();
        DiagnosticArray { header: header(time), status }
    }

    /// Returns the joints that were outside their travel limits between `before` and `now`.
    pub fn outside_travel_limits(&self, before: &Health, now: &Health) -> Vec<&str> {
        let is_outside = |&(_, before, now): &(&str, AxisHealth, AxisHealth)| now.outside > before.outside;
        self.axes(before, now).filter(is_outside).map(|(joint, ..)| joint).collect()
    }

    fn axes(&self, before: &Health, now: &Health) -> impl Iterator<Item = (&str, AxisHealth, AxisHealth)> {
        let of = |health: &Health, index| health.axes.get(index).copied().unwrap_or_default();
        self.joints
            .iter()
            .enumerate()
            .map(move |(index, joint)| (joint.as_str(), of(before, index), of(now, index)))
    }

    fn status(&self, name: String, problems: &[&str], fine: &str, values: Vec<KeyValue>) -> DiagnosticStatus {
        let level = if problems.is_empty() { DiagnosticStatus::OK } else { DiagnosticStatus::WARN };
        let message = if problems.is_empty() { fine.to_owned() } else { problems.join("; ") };
        DiagnosticStatus { level, name, message, hardware_id: self.machine.clone(), values }
    }

    fn node_status(&self, before: &Health, now: &Health, (old, new): (u64, u64)) -> DiagnosticStatus {
        let periods = now.periods - before.periods;
        let missed = now.missed - before.missed;
        let mean =
            if periods == 0 { 0.0 } else { (now.total_lateness - before.total_lateness) / periods as f64 };
        let problems = node_problems(before, now, new - old);
        let state = node_state(periods, now);
        let values = vec![
            value(keys::STATE, state),
            value(keys::FEED_OVERRIDE, Rounded(now.feed_rate)),
            value(keys::TIME, time_mode(now.clock.source)),
            value(keys::CLOCK, now.clock.source.name()),
            value(keys::CLOCK_JUMPS, now.clock.jumps),
            value(keys::BEHIND_CLOCK_MS, now.clock.behind as f64 / MILLISECOND_NS as f64),
            value(keys::POSITION_PERIODS, now.periods),
            value(keys::MISSED_PERIODS, now.missed),
            value(keys::MISSED_PERIODS_LAST_SECOND, missed),
            value(keys::UNPUBLISHED_PERIODS, now.unpublished),
            value(keys::DROPPED_SAMPLES, now.dropped + new),
            value(keys::MEAN_LATENESS_MS, format!("{:.3}", mean * 1e3)),
            value(keys::MAX_LATENESS_MS, format!("{:.3}", now.max_lateness * 1e3)),
            value(keys::STREAM_DRIVES, now.stream.is_active),
            value(keys::STREAM_DELAY_MS, now.stream.delay as f64 / MILLISECOND_NS as f64),
            value(keys::STREAM_SETPOINTS_REJECTED, now.stream.rejected),
            value(keys::STREAM_SETPOINTS_IGNORED, now.stream.ignored),
            value(keys::STREAM_MESSAGES_OUT_OF_ORDER, now.stream.reordered),
            value(keys::STREAM_GAPS, now.stream.counts.gaps),
            value(keys::STREAM_SPEED_LIMITED_PERIODS, now.stream.counts.limited),
            value(keys::STREAM_HELD_OFF, now.stream.is_inhibited),
        ];
        self.status(format!("{}: axes", self.node), &problems, state, values)
    }

    fn axis(&self, joint: &str, before: AxisHealth, now: AxisHealth) -> DiagnosticStatus {
        let mut problems = Vec::new();
        if now.saturated > before.saturated {
            problems.push("speed, current or voltage setpoint at its limit");
        }
        if now.extrapolated > before.extrapolated {
            problems.push("friction law extrapolated beyond its fitted range of 20 m/min or rev/min");
        }
        if now.outside > before.outside {
            problems.push("outside its travel limits");
        }
        let values = vec![
            value(keys::SATURATED_PERIODS, now.saturated),
            value(keys::FRICTION_EXTRAPOLATED_PERIODS, now.extrapolated),
            value(keys::OUTSIDE_TRAVEL_LIMITS_PERIODS, now.outside),
        ];
        self.status(format!("{}: {joint}", self.node), &problems, "ok", values)
    }
}

/// Returns the problems of the node between the states `before` and `now`, with `dropped` messages.
fn node_problems(before: &Health, now: &Health, dropped: u64) -> Vec<&'static str> {
    let (old, new) = (&before.stream, &now.stream);
    let conditions = [
        (now.missed > before.missed, "position cycles were released late"),
        (
            now.unpublished > before.unpublished,
            "the node stalled: position cycles were computed but not published",
        ),
        (now.dropped - before.dropped + dropped > 0, "samples were dropped: a subscriber is slow"),
        (new.rejected > old.rejected, "streamed setpoints were rejected"),
        (new.counts.gaps > old.counts.gaps, "gap in the stream during motion"),
        (new.counts.limited > old.counts.limited, "streamed setpoints exceeded the axes' maximum velocity"),
        (new.is_inhibited, "a stream is ignored after a stop until it pauses"),
        (now.clock.jumps > before.clock.jumps, "the clock jumped"),
    ];
    conditions.into_iter().filter_map(|(is_present, text)| is_present.then_some(text)).collect()
}

/// Returns the parameter `time` that has the clock of this source; before its first message a clock is followed.
fn time_mode(source: ClockSource) -> &'static str {
    match source {
        ClockSource::Wall => "real",
        ClockSource::Own => "fast",
        ClockSource::Followed | ClockSource::None => "sim",
    }
}

/// Returns the state of the node if `periods` position cycles were released since the previous message.
fn node_state(periods: u64, now: &Health) -> &'static str {
    let is_paused = periods == 0 && now.clock.source != ClockSource::Wall;
    if is_paused && now.clock.source == ClockSource::None {
        "waiting for /clock"
    } else if is_paused && (now.clock.is_blocked || now.clock.source == ClockSource::Own) {
        "waiting for a slow subscriber"
    } else if is_paused {
        "paused"
    } else if now.is_feed_hold {
        "feed hold"
    } else if now.is_moving {
        "running"
    } else if now.stream.is_active {
        "streaming"
    } else if now.is_busy {
        "settling"
    } else {
        "holding"
    }
}

/// Publishes the diagnostics once per second, with the events since the previous message, and logs axes that leave
/// their travel limits.
pub async fn publish_diagnostics(
    text: Diagnostics,
    output: Output<DiagnosticArray>,
    health: watch::Receiver<Health>,
    dropped: Arc<AtomicU64>,
    mut recording: Option<RecordingStatus>,
) {
    let mut timer = tokio::time::interval(DIAGNOSTICS_PERIOD);
    let (mut before, mut dropped_before) = (Health::default(), 0);
    let mut outside: Vec<&str> = Vec::new();
    loop {
        timer.tick().await;
        let now = health.borrow().clone();
        let dropped_now = dropped.load(Ordering::Relaxed);
        let mut message = text.message(now.time, &before, &now, (dropped_before, dropped_now));
        message.status.extend(recording.as_mut().map(|status| status.message(&text.node, &text.machine)));
        output.send(message).await;
        let left = text.outside_travel_limits(&before, &now);
        left.iter()
            .filter(|joint| !outside.contains(joint))
            .for_each(|joint| warn!("{joint} has left its travel limits"));
        outside = left;
        (before, dropped_before) = (now, dropped_now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_reports_events_of_the_last_second_only() {
        let diagnostics = Diagnostics {
            node: "/virtual_axes".into(),
            machine: "m".into(),
            joints: vec!["x".into()],
            endpoints: EndpointCounts::default(),
            other_clocks: Arc::default(),
        };
        let before = Health { axes: vec![AxisHealth::default()], ..Health::default() };
        let mut now = before.clone();
        now.axes[0].saturated = 3;
        let first = diagnostics.message(0, &before, &now, (0, 0));
        assert_eq!((first.status[0].level, first.status[1].level), (0, 1));
        let second = diagnostics.message(0, &now, &now, (0, 0));
        assert_eq!(second.status[1].level, 0);
    }

    #[test]
    fn statuses_have_the_keys_of_the_interface() {
        let diagnostics = Diagnostics {
            node: "/virtual_axes".into(),
            machine: "m".into(),
            joints: vec!["x".into()],
            endpoints: EndpointCounts::default(),
            other_clocks: Arc::default(),
        };
        let message = diagnostics.message(0, &Health::default(), &Health::default(), (0, 0));
        for (status, expected) in message.status.iter().zip([keys::NODE_KEYS, keys::JOINT_KEYS]) {
            let found: Vec<&str> = status.values.iter().map(|value| value.key.as_str()).collect();
            // Other systems than Linux have no figure for the memory.
            let expected = expected.iter().map(|key| key.key);
            let expected: Vec<&str> =
                expected.filter(|&key| key != "memory_mb" || found.contains(&key)).collect();
            assert_eq!(found, expected, "{}", status.name);
        }
    }
}
