//! The node's log, as ROS users know it: one line on stderr, and `/rosout` for whoever wants it.
//!
//! ```text
//! [INFO] [1700000000.123456789] [virtual_axes]: listens on /psec
//! ```
//!
//! The program logs with `tracing`; the DDS crates log with `log`, which arrives here too. They
//! report much as errors that is none (a participant's own shutdown, gaps in sequence numbers), so
//! from them only errors are shown, less the known noise. `--log-level rustdds:=debug` shows all.
//!
//! Of the lines of one kind 50 a second are shown, but of debugging.

mod filter;
mod limit;
mod terminal;

use std::{
    fmt::{self, Write as _},
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use tokio::sync::mpsc;
use tracing::{
    Event, Level, Subscriber,
    field::{Field, Visit},
};
use tracing_subscriber::{
    layer::{Context, Layer, SubscriberExt},
    registry::LookupSpan,
    util::{SubscriberInitExt, TryInitError},
};

use self::filter::LoggerLevels;
use self::limit::{Limiter, Verdict};
use self::terminal::Terminal;
use super::args::{LogLevel, RosArgs};
use virtual_axes_core::config::breaks_line;

/// How long the end of the program waits for whoever reads its log.
const LAST_WAIT: Duration = Duration::from_millis(500);

/// One message of this program, for `/rosout`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogRecord {
    /// When, since 1970.
    pub stamp: Duration,
    /// How severe.
    pub level: LogLevel,
    /// The node's logger.
    pub logger: String,
    /// What.
    pub message: String,
    /// The source file, if known.
    pub file: Option<&'static str>,
    /// The line in it, if known.
    pub line: Option<u32>,
}

/// The log could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// There is one already.
    #[error("the log is set up already: {0}")]
    Twice(#[from] TryInitError),
    /// The operating system gives no thread.
    #[error("cannot start the thread that writes the log: {0}")]
    Thread(#[from] std::io::Error),
}

/// The log of this process.
#[derive(Debug)]
pub struct Log {
    terminal: Terminal,
}

impl Log {
    /// Writes a line that is no message, and waits (not for long) until all that was logged is written.
    pub fn finish(self, line: Option<String>) {
        self.terminal.finish(line.map(|line| line + "\n"), LAST_WAIT);
    }
}

/// Sets up the log of this process as `args` ask. Messages of this program (not the middleware's)
/// also go into `rosout`; when that is full, or nobody reads stderr, they are dropped, so that logging never waits.
///
/// # Errors
/// [`LogError`] when the process has a log already, or can have no thread more.
pub fn init(args: &RosArgs, rosout: Option<mpsc::Sender<LogRecord>>) -> Result<Log, LogError> {
    let logger = logger_name(&args.node().to_string());
    let levels = LoggerLevels::new(&logger, args.log_level(), args.logger_levels());
    let sinks = args.log_sinks();
    let rosout = rosout.filter(|_| sinks.rosout);
    let of = logger.clone();
    let terminal = Terminal::start(std::io::stderr(), move |lines| terminal_line(&missed(&of, lines)))?;
    let shown = sinks.stdout.then(|| terminal.clone());
    let layer = RosLayer { logger, terminal: shown, rosout, limiter: Limiter::default() };
    tracing_subscriber::registry().with(layer.with_filter(levels)).try_init()?;
    Ok(Log { terminal })
}

/// What stands in the place of lines that were left out.
fn missed(logger: &str, lines: u64) -> LogRecord {
    LogRecord {
        stamp: now(),
        level: LogLevel::Warn,
        logger: logger.to_owned(),
        message: format!("nobody read this log for a while: {lines} lines are left out here"),
        file: None,
        line: None,
    }
}

/// Since 1970.
fn now() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// rcl's name for the logger of a node: `/cell/mill` has `cell.mill`.
fn logger_name(node: &str) -> String {
    node.trim_start_matches('/').replace('/', ".")
}

struct RosLayer {
    logger: String,
    terminal: Option<Terminal>,
    rosout: Option<mpsc::Sender<LogRecord>>,
    limiter: Limiter,
}

impl RosLayer {
    /// What is shown of an event; nothing when there are too many of its kind.
    fn limited(&self, event: &Event<'_>, text: EventText) -> Option<String> {
        if *event.metadata().level() > Level::INFO {
            return Some(text.message);
        }
        let kind = (event.metadata().callsite(), text.log_target.unwrap_or_default());
        match self.limiter.judge(kind, Instant::now()) {
            Verdict::Shown => Some(text.message),
            Verdict::ShownAfter(left_out) => Some(limit::ends(left_out, &text.message)),
            Verdict::FirstLeftOut => Some(limit::begins(&text.message)),
            Verdict::LeftOut => None,
        }
    }
}

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for RosLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let text = EventText::of(event);
        let own = filter::is_own(text.target(event));
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
        if let Some(rosout) = self.rosout.as_ref().filter(|_| own) {
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

/// The line for the terminal. Control characters are escaped: parts of a message may come from
/// other nodes, and must neither clear the screen nor look like a line of their own.
fn terminal_line(record: &LogRecord) -> String {
    let mut line = format!(
        "[{}] [{}.{:09}] [{}]: ",
        record.level.name(),
        record.stamp.as_secs(),
        record.stamp.subsec_nanos(),
        record.logger
    );
    for character in record.message.chars() {
        if breaks_line(character) && character != '\t' {
            line.extend(character.escape_default());
        } else {
            line.push(character);
        }
    }
    line.push('\n');
    line
}

/// The fields of an event as text: the message, then `name=value` for the others.
#[derive(Default)]
struct EventText {
    message: String,
    fields: String,
    log_target: Option<String>,
}

impl EventText {
    fn of(event: &Event<'_>) -> Self {
        let mut text = Self::default();
        event.record(&mut text);
        let fields = std::mem::take(&mut text.fields);
        text.message.push_str(&fields);
        text
    }

    /// What has come through `log` carries its target in a field.
    fn target<'a>(&'a self, event: &Event<'a>) -> &'a str {
        self.log_target.as_deref().unwrap_or_else(|| event.metadata().target())
    }
}

impl Visit for EventText {
    fn record_str(&mut self, field: &Field, value: &str) {
        match field.name() {
            "log.target" => self.log_target = Some(value.to_owned()),
            "message" => self.message.push_str(value),
            _ => self.record_debug(field, &value),
        }
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name if name.starts_with("log.") => Ok(()),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
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
        let (logger, limiter) = ("cell.mill".to_owned(), Limiter::default());
        let layer = RosLayer { logger, terminal: None, rosout: Some(sender), limiter };
        let levels = LoggerLevels::new("cell.mill", level, loggers);
        let subscriber = tracing_subscriber::registry().with(layer.with_filter(levels));
        tracing::subscriber::with_default(subscriber, log);
        std::iter::from_fn(|| receiver.try_recv().ok()).collect()
    }

    #[test]
    fn messages_carry_level_logger_and_fields() {
        let records = capture(None, &[], || {
            tracing::warn!(axis = "x", limit = 3, "outside {}", "stroke");
            tracing::debug!("not shown by default");
        });
        assert_eq!(records.len(), 1);
        assert_eq!(records[0].level, LogLevel::Warn);
        assert_eq!(records[0].logger, "cell.mill");
        assert_eq!(records[0].message, "outside stroke axis=\"x\" limit=3");
    }

    #[test]
    fn the_middleware_does_not_get_into_rosout() {
        let records = capture(Some(LogLevel::Debug), &[], || {
            tracing::error!(target: "rustdds::rtps::writer", "loud");
            tracing::debug!("ours");
        });
        assert_eq!(records.len(), 1);
        assert_eq!(records[0].message, "ours");
    }

    #[test]
    fn a_level_for_the_nodes_logger_wins_over_the_general_one() {
        let loggers = [("cell.mill".to_owned(), LogLevel::Error)];
        let records = capture(Some(LogLevel::Debug), &loggers, || tracing::warn!("hidden"));
        assert!(records.is_empty());
    }

    #[test]
    fn a_full_rosout_drops_instead_of_waiting() {
        let records = capture(None, &[], || {
            for _ in 0..100 {
                tracing::info!("again");
            }
        });
        assert_eq!(records.len(), 16);
    }

    #[test]
    fn a_message_from_outside_cannot_forge_a_line() {
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
