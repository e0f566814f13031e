//! Which messages are shown.

use tracing::{Event, Metadata, Subscriber, level_filters::LevelFilter, subscriber::Interest};
use tracing_subscriber::layer::{Context, Filter};

use super::{super::args::LogLevel, EventText};

/// The crates of which this program consists: the library and the node.
const OWN: [&str; 2] = ["virtual_axes", "virtual_axes_node"];

/// What is shown of others unless the arguments say otherwise.
const DEFAULTS: [(&str, LevelFilter); 3] = [
    ("", LevelFilter::WARN),
    // The middleware warns about readers without locators and the like, all through discovery.
    ("rustdds", LevelFilter::ERROR),
    ("ros2_client", LevelFilter::ERROR),
];

/// Errors that are none: target, and how the message begins.
const NOISE: [(&str, &str); 4] = [
    // Gaps of more than 256 samples are cut to what fits into one message, and asked for again.
    ("rustdds::structure::sequence_number", ""),
    // At shutdown, endpoints find the participant's threads gone already.
    ("rustdds::dds::pubsub", "Cannot remove Reader"),
    ("rustdds::dds::pubsub", "Cannot remove Writer"),
    // It leaves by the default interface the group that it joined on another.
    ("rustdds::network::udp_listener", "leave_multicast_group"),
];

/// Whether `target` is a part of this program.
pub(super) fn is_own(target: &str) -> bool {
    OWN.iter().any(|own| is_under(target, own))
}

fn is_under(target: &str, prefix: &str) -> bool {
    prefix.is_empty()
        || target.strip_prefix(prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// Levels by the beginning of the target, longest first.
pub(super) struct LoggerLevels {
    levels: Vec<(String, LevelFilter)>,
    /// Targets for which the arguments ask, noise included.
    asked_for: Vec<String>,
}

impl LoggerLevels {
    /// `level` is for this program, `loggers` for the loggers that they name: `own_logger` is this
    /// program too, anything else is a crate or module, parted by dots or double colons.
    pub(super) fn new(own_logger: &str, level: Option<LogLevel>, loggers: &[(String, LogLevel)]) -> Self {
        let general = filter_of(level.unwrap_or(LogLevel::Unset));
        let mut levels: Vec<(String, LevelFilter)> = DEFAULTS
            .into_iter()
            .chain(OWN.map(|own| (own, general)))
            .map(|(target, filter)| (target.to_owned(), filter))
            .collect();
        let mut asked_for = Vec::new();
        for (logger, level) in loggers {
            let targets = if logger == own_logger {
                OWN.map(str::to_owned).to_vec()
            } else {
                vec![logger.replace('.', "::")]
            };
            for target in targets {
                levels.retain(|(known, _)| *known != target);
                levels.push((target.clone(), filter_of(*level)));
                asked_for.push(target);
            }
        }
        levels.sort_by_key(|(target, _)| std::cmp::Reverse(target.len()));
        Self { levels, asked_for }
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
            && !self.asked_for.iter().any(|asked| is_under(target, asked))
    }
}

impl<S: Subscriber> Filter<S> for LoggerLevels {
    fn enabled(&self, metadata: &Metadata<'_>, _context: &Context<'_, S>) -> bool {
        self.shows(metadata)
    }

    fn callsite_enabled(&self, metadata: &'static Metadata<'static>) -> Interest {
        // What comes through `log` shares one callsite for all targets.
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
        let text = EventText::of(event);
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
        // Nothing here logs as fatal: a program that cannot go on ends with its message.
        LogLevel::Fatal => LevelFilter::OFF,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_target_decides() {
        let loggers = [("rustdds.rtps".to_owned(), LogLevel::Debug), ("mill".to_owned(), LogLevel::Error)];
        let levels = LoggerLevels::new("mill", Some(LogLevel::Debug), &loggers);
        for (target, level) in [
            ("virtual_axes", LevelFilter::ERROR),
            ("virtual_axes::ros::log", LevelFilter::ERROR),
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
    fn noise_is_hidden_until_somebody_asks_for_it() {
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
