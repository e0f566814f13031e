//! Diagnostics of the node and its axes (`/diagnostics`, REP-107).

use std::fmt::Display;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};

use super::convert::header;
use super::health::{AxisHealth, ClockSource, Health};
use super::process_memory::private_memory_mb;
use super::remote_endpoints::DiscoveredEndpoints;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};

/// Constant contents of the diagnostics, and the source of the discovery count.
#[derive(Debug, Clone)]
pub struct Diagnostics {
    /// Fully qualified name of the node.
    pub node: String,
    /// Name of the machine.
    pub machine: String,
    /// Names of the joints, with prefix.
    pub joints: Vec<String>,
    /// Time mode: `real`, `fast` or `sim`.
    pub time_mode: &'static str,
    /// Counter of the discovered remote endpoints.
    pub discovered: DiscoveredEndpoints,
}

fn value(key: &str, value: impl Display) -> KeyValue {
    KeyValue { key: key.to_owned(), value: value.to_string() }
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
        node.values.push(value("endpoints_discovered", self.discovered.count()));
        node.values.extend(private_memory_mb().map(|memory| value("memory_mb", format!("{memory:.1}"))));
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
            value("state", state),
            value("time", self.time_mode),
            value("clock", now.clock.source.name()),
            value("clock_jumps", now.clock.jumps),
            value("behind_clock_ms", now.clock.behind as f64 / MILLISECOND_NS as f64),
            value("position_periods", now.periods),
            value("missed_periods", now.missed),
            value("missed_periods_last_second", missed),
            value("unpublished_periods", now.unpublished),
            value("dropped_samples", now.dropped + new),
            value("mean_lateness_ms", format!("{:.3}", mean * 1e3)),
            value("max_lateness_ms", format!("{:.3}", now.max_lateness * 1e3)),
            value("stream_drives", now.stream.is_active),
            value("stream_delay_ms", now.stream.delay as f64 / MILLISECOND_NS as f64),
            value("stream_setpoints_rejected", now.stream.rejected),
            value("stream_setpoints_ignored", now.stream.ignored),
            value("stream_messages_out_of_order", now.stream.reordered),
            value("stream_gaps", now.stream.counts.gaps),
            value("stream_speed_limited_periods", now.stream.counts.limited),
            value("stream_held_off", now.stream.is_inhibited),
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
            value("saturated_periods", now.saturated),
            value("friction_extrapolated_periods", now.extrapolated),
            value("outside_travel_limits_periods", now.outside),
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

/// Returns the state of the node if `periods` position cycles were released since the previous message.
fn node_state(periods: u64, now: &Health) -> &'static str {
    let is_paused = periods == 0 && now.clock.source != ClockSource::Wall;
    if is_paused && now.clock.source == ClockSource::None {
        "waiting for /clock"
    } else if is_paused && (now.clock.is_blocked || now.clock.source == ClockSource::Own) {
        "waiting for a slow subscriber"
    } else if is_paused {
        "paused"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_reports_events_of_the_last_second_only() {
        let diagnostics = Diagnostics {
            node: "/virtual_axes".into(),
            machine: "m".into(),
            joints: vec!["x".into()],
            time_mode: "real",
            discovered: DiscoveredEndpoints::default(),
        };
        let before = Health { axes: vec![AxisHealth::default()], ..Health::default() };
        let mut now = before.clone();
        now.axes[0].saturated = 3;
        let first = diagnostics.message(0, &before, &now, (0, 0));
        assert_eq!((first.status[0].level, first.status[1].level), (0, 1));
        let second = diagnostics.message(0, &now, &now, (0, 0));
        assert_eq!(second.status[1].level, 0);
    }
}
