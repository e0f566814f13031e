//! `/diagnostics` once a second (REP-107), readable with stock types.

use std::fmt::Display;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::{DiagnosticArray, DiagnosticStatus, KeyValue};

use super::convert::header;
use super::pace::{AxisHealth, ClockSource, Health};
use super::process_memory::private_memory_mb;
use super::remote_endpoints::DiscoveredEndpoints;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds};

/// What stays the same from message to message.
#[derive(Debug, Clone)]
pub struct Diagnostics {
    /// Fully qualified name of the node.
    pub node: String,
    /// Name of the machine.
    pub machine: String,
    /// Joints, with prefix.
    pub joints: Vec<String>,
    /// `real`, `fast` or `sim`.
    pub time_mode: &'static str,
    /// Counts the endpoints elsewhere.
    pub discovered: DiscoveredEndpoints,
}

fn value(key: &str, value: impl Display) -> KeyValue {
    KeyValue { key: key.to_owned(), value: value.to_string() }
}

impl Diagnostics {
    /// The message at `time` (ns): what has happened between `before` and `now`.
    ///
    /// `outputs_dropped` counts messages that a slow subscriber made the node drop since the start.
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

    /// Joints that stood outside their travel limits between `before` and `now`.
    pub fn outside_travel_limits(&self, before: &Health, now: &Health) -> Vec<&str> {
        let left = |&(_, before, now): &(&str, AxisHealth, AxisHealth)| now.outside > before.outside;
        self.axes(before, now).filter(left).map(|(joint, ..)| joint).collect()
    }

    fn axes(&self, before: &Health, now: &Health) -> impl Iterator<Item = (&str, AxisHealth, AxisHealth)> {
        let of = |health: &Health, place| health.axes.get(place).copied().unwrap_or_default();
        self.joints
            .iter()
            .enumerate()
            .map(move |(place, joint)| (joint.as_str(), of(before, place), of(now, place)))
    }

    fn status(&self, name: String, problems: &[&str], fine: &str, values: Vec<KeyValue>) -> DiagnosticStatus {
        let level = if problems.is_empty() { DiagnosticStatus::OK } else { DiagnosticStatus::WARN };
        let message = if problems.is_empty() { fine.to_owned() } else { problems.join("; ") };
        DiagnosticStatus { level, name, message, hardware_id: self.machine.clone(), values }
    }

    fn node_status(&self, before: &Health, now: &Health, (old, new): (u64, u64)) -> DiagnosticStatus {
        let periods = now.periods - before.periods;
        let missed = now.missed - before.missed;
        let dropped = (now.dropped - before.dropped) + (new - old);
        let mean =
            if periods == 0 { 0.0 } else { (now.total_lateness - before.total_lateness) / periods as f64 };
        let mut problems = Vec::new();
        if missed > 0 {
            problems.push("position periods were released late");
        }
        if now.unpublished > before.unpublished {
            problems.push("the node stood still: position instants were computed and not published");
        }
        if dropped > 0 {
            problems.push("samples were dropped: a subscriber is slow");
        }
        if now.stream.refused > before.stream.refused {
            problems.push("setpoints of the stream were refused");
        }
        if now.stream.counts.gaps > before.stream.counts.gaps {
            problems.push("the stream broke off in motion");
        }
        if now.stream.counts.limited > before.stream.counts.limited {
            problems.push("the stream asked for more than the axes' largest speed");
        }
        if now.stream.held_off {
            problems.push("a stream is ignored after a stop until it pauses");
        }
        if now.clock.jumps > before.clock.jumps {
            problems.push("the clock jumped");
        }
        let stands = periods == 0 && now.clock.source != ClockSource::Wall;
        let fine = if stands && now.clock.source == ClockSource::None {
            "waiting for /clock"
        } else if stands && (now.clock.held_back || now.clock.source == ClockSource::Own) {
            "waiting for a slow subscriber"
        } else if stands {
            "paused"
        } else if now.moving {
            "running"
        } else if now.stream.drives {
            "streaming"
        } else if now.busy {
            "settling"
        } else {
            "holding"
        };
        let values = vec![
            value("state", fine),
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
            value("stream_drives", now.stream.drives),
            value("stream_delay_ms", now.stream.delay as f64 / MILLISECOND_NS as f64),
            value("stream_setpoints_refused", now.stream.refused),
            value("stream_setpoints_ignored", now.stream.ignored),
            value("stream_messages_out_of_order", now.stream.overtaken),
            value("stream_gaps", now.stream.counts.gaps),
            value("stream_speed_limited_periods", now.stream.counts.limited),
            value("stream_held_off", now.stream.held_off),
        ];
        self.status(format!("{}: axes", self.node), &problems, fine, values)
    }

    fn axis(&self, joint: &str, before: AxisHealth, now: AxisHealth) -> DiagnosticStatus {
        let mut problems = Vec::new();
        if now.saturated > before.saturated {
            problems.push("speed, current or voltage setpoint at its limit");
        }
        if now.extrapolated > before.extrapolated {
            problems.push("friction law used beyond its fitted range of 20 m/min or rev/min");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_names_what_happened_in_the_last_second_only() {
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
