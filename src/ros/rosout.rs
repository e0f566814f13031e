//! The node's own log messages on `/rosout`.

use ros2_client::builtin_interfaces::Time;
use ros2_client::log::{Log, LogLevel as Severity};
use ros2_client::{Node, rosout::RosoutRaw};
use tokio::sync::mpsc;

use super::args::LogLevel;
use super::log::LogRecord;

/// Messages that may wait; more are dropped, so that logging never waits.
pub const QUEUE: usize = 256;

/// A task that publishes what comes until the log is closed; nothing where `/rosout` is off.
pub fn publish(node: &Node, mut records: mpsc::Receiver<LogRecord>) -> impl Future<Output = ()> + use<> {
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
