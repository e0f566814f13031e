//! The node's own log messages on `/rosout`.

use ros2_client::builtin_interfaces::Time;
use ros2_client::log::{Log, LogLevel as Severity};
use ros2_client::{Node, rosout::RosoutRaw};
use tokio::sync::mpsc;

use super::args::LogLevel;
use super::log::LogRecord;
use super::recorder::{Direction, Recorder, Tap};
use crate::config::QosConfig;
use crate::messages::{Recorded, Schema};
use crate::units::Nanoseconds;

/// Messages that may wait; more are dropped, so that logging never waits.
pub const QUEUE: usize = 256;

/// What rcl offers `/rosout` with.
const QOS: QosConfig = QosConfig { reliable: true, transient_local: true, depth: 1000 };

impl Recorded for Log {
    fn schema() -> Schema {
        Schema::log()
    }

    fn time(&self) -> Nanoseconds {
        self.stamp.to_nanos()
    }
}

/// What records the node's log messages.
pub fn tap(recorder: &mut Recorder) -> Tap<Log> {
    recorder.tap("/rosout", QOS, Direction::Out)
}

/// A task that publishes what comes until the log is closed; nothing where `/rosout` is off.
pub fn publish(
    node: &Node,
    mut records: mpsc::Receiver<LogRecord>,
    tap: Tap<Log>,
) -> impl Future<Output = ()> + use<> {
    let writer = node.logging_handle().rosout_writer();
    async move {
        let Some(publisher) = writer.as_ref() else { return };
        while let Some(record) = records.recv().await {
            let message = Log {
                stamp: Time::from_nanos(i64::try_from(record.stamp.as_nanos()).unwrap_or(i64::MAX)),
                level: severity(record.level) as u8,
                name: record.logger,
                msg: record.message,
                file: record.file.unwrap_or_default().to_owned(),
                function: String::new(),
                line: record.line.unwrap_or_default(),
            };
            tap.record(&message).await;
            // To log a failure here would make the next one.
            let _ = publisher.async_publish(message).await;
        }
    }
}

fn severity(level: LogLevel) -> Severity {
    match level {
        LogLevel::Unset | LogLevel::Debug => Severity::Debug,
        LogLevel::Info => Severity::Info,
        LogLevel::Warn => Severity::Warn,
        LogLevel::Error => Severity::Error,
        LogLevel::Fatal => Severity::Fatal,
    }
}
