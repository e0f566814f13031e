//! Logging in the format of rcl: one line per message on stderr, and `/rosout`.
//!
//! ```text
//! [INFO] [1700000000.123456789] [virtual_axes]: SIGINT: shutting down
//! ```
//!
//! The program logs with `tracing`. Records of the DDS crates, which use `log`, are received here, too. Those crates
//! log normal events as errors (their own shutdown, gaps in sequence numbers), so only their errors are shown, except
//! known noise. `--log-level rustdds:=debug` shows all.
//!
//! Except for debug messages, at most 50 lines of one kind are shown per second.

mod event_text;
mod filter;
mod rate_limit;
mod terminal;

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tokio::sync::mpsc;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::{
    layer::{Context, Layer, SubscriberExt},
    registry::LookupSpan,
    util::{SubscriberInitExt, TryInitError},
};

use self::event_text::EventText;
use self::filter::LoggerLevels;
use self::rate_limit::{LineRateLimiter, RateDecision};
use self::terminal::Terminal;
use crate::validation::args::{LogLevel, RosArgs};
use virtual_axes_core::text::is_control;

/// Longest time for which the end of the program waits for a slow reader of stderr.
const LAST_WAIT: Duration = Duration::from_millis(500);

/// Target of messages that are not published on `/rosout`, since they may quote files of this computer.
pub const STDERR_ONLY: &str = "virtual_axes::stderr";

/// Log message of this program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogRecord {
    /// Time since the Unix epoch.
    pub stamp: Duration,
    /// Severity.
    pub level: LogLevel,
    /// Name of the logger.
    pub logger: String,
    /// Text.
    pub message: String,
    /// Source file, if known.
    pub file: Option<&'static str>,
    /// Line in the source file, if known.
    pub line: Option<u32>,
}

/// Failure to set up the log.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The process has a log already.
    #[error("the log is set up already: {0}")]
    AlreadySet(#[from] TryInitError),
    /// The thread cannot be started.
    #[error("cannot start the thread that writes the log: {0}")]
    Thread(#[from] std::io::Error),
}

/// Log of this process.
#[derive(Debug)]
pub struct Log {
    terminal: Terminal,
}

impl Log {
    /// Writes a plain line and waits up to 0.5 s until all log lines are written.
    pub fn finish(self, line: Option<String>) {
        self.terminal.finish(line.map(|line| line + "\n"), LAST_WAIT);
    }
}

/// Sets up the log of this process from the arguments.
///
/// Messages of this program, not those of the middleware, also go into `rosout`. Messages are dropped if that queue
/// or the queue of the terminal is full, so that logging never blocks.
///
/// # Errors
/// [`LogError`] if the process has a log already, or the thread cannot be started.
pub fn init(args: &RosArgs, rosout: Option<mpsc::Sender<LogRecord>>) -> Result<Log, LogError> {
    let logger = logger_name(&args.node().to_string());
    let levels = LoggerLevels::new(&logger, args.log_level(), args.logger_levels());
    let sinks = args.log_sinks();
    let rosout = rosout.filter(|_| sinks.rosout);
    let own = logger.clone();
    let terminal =
        Terminal::start(std::io::stderr(), move |lines| terminal_line(&dropped_lines(&own, lines)))?;
    let shown = sinks.stdout.then(|| terminal.clone());
    let layer = RosLayer { logger, terminal: shown, rosout, limiter: LineRateLimiter::default() };
    tracing_subscriber::registry().with(layer.with_filter(levels)).try_init()?;
    Ok(Log { terminal })
}

/// Returns the message that replaces dropped lines.
fn dropped_lines(logger: &str, lines: u64) -> LogRecord {
    LogRecord {
        stamp: now(),
        level: LogLevel::Warn,
        logger: logger.to_owned(),
        message: format!("stderr was blocked: {lines} lines of this log were dropped here"),
        file: None,
        line: None,
    }
}

/// Returns the time since the Unix epoch.
fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Returns the logger name of a node as in rcl: `cell.mill` for `/cell/mill`.
fn logger_name(node: &str) -> String {
    node.trim_start_matches('/').replace('/', ".")
}

struct RosLayer {
    logger: String,
    terminal: Option<Terminal>,
    rosout: Option<mpsc::Sender<LogRecord>>,
    limiter: LineRateLimiter,
}

impl RosLayer {
    /// Returns the text to show for an event, or `None` if the rate limit suppresses it.
    fn limited(&self, event: &Event<'_>, text: EventText) -> Option<String> {
        if *event.metadata().level() > Level::INFO {
            return Some(text.message);
        }
        let kind = (event.metadata().callsite(), text.log_target.unwrap_or_default());
        match self.limiter.check(kind, Instant::now()) {
            RateDecision::Shown => Some(text.message),
            RateDecision::ShownAfter(left_out) => Some(rate_limit::resumed(left_out, &text.message)),
            RateDecision::FirstLeftOut => Some(rate_limit::suppressed(&text.message)),
            RateDecision::LeftOut => None,
        }
    }
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for RosLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let text = EventText::from_event(event);
        let own = filter::is_own(text.target(event));
        let is_published = own && text.target(event) != STDERR_ONLY;
        let logger = if own { self.logger.clone() } else { text.target(event).replace("::", ".") };
        let Some(message) = self.limited(event, text) else { return };
        let record = LogRecord {
            stamp: now(),
            level: severity(*event.metadata().level()),
            logger,
            message,
            file: event.metadata().file(),
            line: event.metadata().line(),
        };
        if let Some(terminal) = &self.terminal {
            terminal.line(terminal_line(&record));
        }
        if let Some(rosout) = self.rosout.as_ref().filter(|_| is_published) {
            let _ = rosout.try_send(record);
        }
    }
}

fn severity(level: Level) -> LogLevel {
    match level {
        Level::ERROR => LogLevel::Error,
        Level::WARN => LogLevel::Warn,
        Level::INFO => LogLevel::Info,
        Level::DEBUG | Level::TRACE => LogLevel::Debug,
    }
}

/// Formats a line for the terminal.
///
/// Control characters are escaped: parts of a message may come from other nodes and must neither clear the screen nor
/// forge a line.
fn terminal_line(record: &LogRecord) -> String {
    let mut line = format!(
        "[{}] [{}.{:09}] [{}]: ",
        record.level.name(),
        record.stamp.as_secs(),
        record.stamp.subsec_nanos(),
        record.logger
    );
    for character in record.message.chars() {
        if is_control(character) && character != '\t' {
            line.extend(character.escape_default());
        } else {
            line.push(character);
        }
    }
    line.push('\n');
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capture(
        level: Option<LogLevel>,
        loggers: &[(String, LogLevel)],
        log: impl FnOnce(),
    ) -> Vec<LogRecord> {
        let (sender, mut receiver) = mpsc::channel(16);
        let (logger, limiter) = ("cell.mill".to_owned(), LineRateLimiter::default());
        let layer = RosLayer { logger, terminal: None, rosout: Some(sender), limiter };
        let levels = LoggerLevels::new("cell.mill", level, loggers);
        let subscriber = tracing_subscriber::registry().with(layer.with_filter(levels));
        tracing::subscriber::with_default(subscriber, log);
        std::iter::from_fn(|| receiver.try_recv().ok()).collect()
    }

    #[test]
    fn messages_contain_level_logger_and_fields() {
        let records = capture(None, &[], || {
            tracing::warn!(axis = "x", limit = 3, "outside {}", "limits");
            tracing::debug!("not shown by default");
        });
        assert_eq!(records.len(), 1);
        assert_eq!(records[0].level, LogLevel::Warn);
        assert_eq!(records[0].logger, "cell.mill");
        assert_eq!(records[0].message, "outside limits axis=\"x\" limit=3");
    }

    #[test]
    fn messages_of_the_middleware_and_those_that_quote_files_are_not_published_on_rosout() {
        let records = capture(Some(LogLevel::Debug), &[], || {
            tracing::error!(target: "rustdds::rtps::writer", "error");
            tracing::error!(target: STDERR_ONLY, "line of a file");
            tracing::debug!("ours");
        });
        assert_eq!(records.len(), 1);
        assert_eq!(records[0].message, "ours");
    }

    #[test]
    fn the_level_of_the_node_logger_overrides_the_general_level() {
        let loggers = [("cell.mill".to_owned(), LogLevel::Error)];
        let records = capture(Some(LogLevel::Debug), &loggers, || tracing::warn!("hidden"));
        assert!(records.is_empty());
    }

    #[test]
    fn a_full_rosout_queue_drops_messages() {
        let records = capture(None, &[], || {
            for _ in 0..100 {
                tracing::info!("again");
            }
        });
        assert_eq!(records.len(), 16);
    }

    #[test]
    fn control_characters_of_a_message_are_escaped() {
        let record = LogRecord {
            stamp: Duration::new(1_700_000_000, 123_456_789),
            level: LogLevel::Info,
            logger: logger_name("/cell/mill"),
            message: "joint 'a\n[FATAL]\u{1b}[2J'".to_owned(),
            file: None,
            line: None,
        };
        assert_eq!(
            terminal_line(&record),
            "[INFO] [1700000000.123456789] [cell.mill]: joint 'a\\n[FATAL]\\u{1b}[2J'\n"
        );
    }
}
