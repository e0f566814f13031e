//! Filter of log messages by target and level.

use tracing::{Event, Metadata, Subscriber, level_filters::LevelFilter, subscriber::Interest};
use tracing_subscriber::layer::{Context, Filter};

use super::event_text::EventText;
use crate::validation::args::LogLevel;

/// Crates of this program: library and node.
const OWN: [&str; 3] = ["virtual_axes", "virtual_axes_dds", "virtual_axes_node"];

/// Default levels of other crates.
const DEFAULTS: [(&str, LevelFilter); 3] = [
    ("", LevelFilter::WARN),
    // The middleware logs warnings during normal discovery, such as readers without locators.
    ("rustdds", LevelFilter::ERROR),
    ("ros2_client", LevelFilter::ERROR),
];

/// Error messages about normal events: target, and beginning of the message.
const NOISE: [(&str, &str); 7] = [
    // A gap of more than 256 samples is truncated to one message and requested again.
    ("rustdds::structure::sequence_number", ""),
    // At shutdown the threads of the participant end before its endpoints.
    ("rustdds::dds::pubsub", "Cannot remove Reader"),
    ("rustdds::dds::pubsub", "Cannot remove Writer"),
    // RustDDS leaves the multicast group by the default interface, not by the one it joined on.
    ("rustdds::network::udp_listener", "leave_multicast_group"),
    // The wall clock was set back, of which the node warns once; this error repeats with each datagram.
    ("rustdds::structure::dds_cache", "get_changes_in_range_best_effort: Did my clock jump"),
    // Fast DDS sends a long request with one fragment more than its size needs.
    ("rustdds::rtps::fragment_assembler", "insert_frags: "),
    ("rustdds::rtps::fragment_assembler", "new_datafrag: rejected invalid DATAFRAG"),
];

/// Returns true if `target` is a module of this program.
pub(super) fn is_own(target: &str) -> bool {
    OWN.iter().any(|own| is_under(target, own))
}

fn is_under(target: &str, prefix: &str) -> bool {
    prefix.is_empty()
        || target.strip_prefix(prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// Levels by target prefix, longest first.
pub(super) struct LoggerLevels {
    levels: Vec<(String, LevelFilter)>,
    /// Targets named in the arguments, for which noise is shown.
    requested: Vec<String>,
}

impl LoggerLevels {
    /// Creates the levels from the arguments.
    ///
    /// `level` applies to this program, `loggers` to the loggers that they name: `own_logger` is this program,
    /// anything else a crate or module, separated by dots or double colons.
    pub(super) fn new(own_logger: &str, level: Option<LogLevel>, loggers: &[(String, LogLevel)]) -> Self {
        let general = filter_of(level.unwrap_or(LogLevel::Unset));
        let mut levels: Vec<(String, LevelFilter)> = DEFAULTS
            .into_iter()
            .chain(OWN.map(|own| (own, general)))
            .map(|(target, filter)| (target.to_owned(), filter))
            .collect();
        let mut requested = Vec::new();
        for (logger, level) in loggers {
            let targets = if logger == own_logger {
                OWN.map(str::to_owned).to_vec()
            } else {
                vec![logger.replace('.', "::")]
            };
            for target in targets {
                levels.retain(|(known, _)| *known != target);
                levels.push((target.clone(), filter_of(*level)));
                requested.push(target);
            }
        }
        levels.sort_by_key(|(target, _)| std::cmp::Reverse(target.len()));
        Self { levels, requested }
    }

    fn level_of(&self, target: &str) -> LevelFilter {
        self.levels
            .iter()
            .find(|(prefix, _)| is_under(target, prefix))
            .map_or(LevelFilter::OFF, |(_, filter)| *filter)
    }

    fn shows(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= self.level_of(metadata.target())
    }

    fn is_noise(&self, target: &str, message: &str) -> bool {
        NOISE.iter().any(|(noisy, start)| target == *noisy && message.starts_with(start))
            && !self.requested.iter().any(|requested| is_under(target, requested))
    }
}

impl<S: Subscriber> Filter<S> for LoggerLevels {
    fn enabled(&self, metadata: &Metadata<'_>, _context: &Context<'_, S>) -> bool {
        self.shows(metadata)
    }

    fn callsite_enabled(&self, metadata: &'static Metadata<'static>) -> Interest {
        // Records of `log` share one callsite for all targets.
        if metadata.target() == "log" {
            Interest::sometimes()
        } else if self.shows(metadata) {
            Interest::always()
        } else {
            Interest::never()
        }
    }

    fn event_enabled(&self, event: &Event<'_>, _context: &Context<'_, S>) -> bool {
        if is_own(event.metadata().target()) {
            return true;
        }
        let text = EventText::from_event(event);
        !self.is_noise(text.target(event), &text.message)
    }

    fn max_level_hint(&self) -> Option<LevelFilter> {
        self.levels.iter().map(|(_, filter)| *filter).max()
    }
}

fn filter_of(level: LogLevel) -> LevelFilter {
    match level {
        LogLevel::Unset | LogLevel::Info => LevelFilter::INFO,
        LogLevel::Debug => LevelFilter::DEBUG,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Error => LevelFilter::ERROR,
        // This program logs no fatal messages; it exits with an error message instead.
        LogLevel::Fatal => LevelFilter::OFF,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_matching_target_determines_the_level() {
        let loggers = [("rustdds.rtps".to_owned(), LogLevel::Debug), ("mill".to_owned(), LogLevel::Error)];
        let levels = LoggerLevels::new("mill", Some(LogLevel::Debug), &loggers);
        for (target, level) in [
            ("virtual_axes", LevelFilter::ERROR),
            ("virtual_axes::ros::log", LevelFilter::ERROR),
            ("virtual_axes_dds::discovery", LevelFilter::ERROR),
            ("virtual_axes_node", LevelFilter::ERROR),
            ("virtual_axes_other", LevelFilter::WARN),
            ("rustdds::rtps::writer", LevelFilter::DEBUG),
            ("rustdds::rtps2", LevelFilter::ERROR),
            ("ros2_client::node", LevelFilter::ERROR),
            ("mio", LevelFilter::WARN),
        ] {
            assert_eq!(levels.level_of(target), level, "{target}");
        }
    }

    #[test]
    fn noise_is_hidden_unless_its_target_is_requested() {
        let target = "rustdds::network::udp_listener";
        let message = "leave_multicast_group: Os { code: 99 }";
        let quiet = LoggerLevels::new("mill", Some(LogLevel::Debug), &[]);
        assert!(quiet.is_noise(target, message));
        assert!(!quiet.is_noise(target, "cannot bind"));
        assert!(quiet.is_noise("rustdds::structure::sequence_number", "anything"));
        let loggers = [("rustdds".to_owned(), LogLevel::Error)];
        assert!(!LoggerLevels::new("mill", None, &loggers).is_noise(target, message));
    }
}
