//! Publication of the node's log messages on `/rosout`.
//!
//! The publisher of ros2-client keeps one message for late joiners; this one keeps as many as rcl's.

use std::sync::Arc;
use std::time::Duration;

use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use tokio::sync::{Mutex, mpsc};

use crate::ros::log::LogRecord;
use crate::ros::topics::{EndpointError, Tap, TopicFactory};
use crate::ros_interface::{ROSOUT, ROSOUT_QOS};
use crate::validation::args::{LogLevel, RosArgs};
use virtual_axes_dds::{Publisher, QoSProfile};

/// Capacity of the queue, in messages. Further messages are dropped, so that logging never blocks.
pub const QUEUE: usize = 256;

/// Lifespan of rcl's publisher.
const LIFESPAN: Duration = Duration::from_secs(10);
/// Longest time for which a write waits for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// Publisher of `/rosout`.
pub struct Rosout {
    publisher: Publisher<Log>,
    tap: Tap<Log>,
}

impl Rosout {
    /// Creates the publisher, reliable and transient local as in rcl. Returns `None` if the arguments disable `/rosout`.
    ///
    /// # Errors
    /// [`EndpointError`] if the middleware cannot create the topic.
    pub fn create(topics: &mut TopicFactory<'_>, args: &RosArgs) -> Result<Option<Self>, EndpointError> {
        if !args.log_sinks().rosout {
            return Ok(None);
        }
        let failed = |reason: String| EndpointError::NotCreated { name: ROSOUT.name.to_owned(), reason };
        let resolved = args.resolve_topic(ROSOUT.name).map_err(|e| failed(e.to_string()))?;
        let qos = QoSProfile {
            is_transient_local: true,
            lifespan: Some(LIFESPAN),
            max_blocking_time: Some(WRITE_TIMEOUT),
            max_unacknowledged: ROSOUT_QOS.depth,
            ..QoSProfile::reliable(ROSOUT_QOS.depth)
        };
        let publisher = topics.node.create_publisher(&resolved, &ROSOUT.type_name(), &qos).map_err(failed)?;
        Ok(Some(Rosout { publisher, tap: topics.tap(&resolved, ROSOUT_QOS) }))
    }

    /// Publishes log records until the log is closed.
    pub async fn run(self, records: Arc<Mutex<mpsc::Receiver<LogRecord>>>) {
        let mut records = records.lock().await;
        while let Some(record) = records.recv().await {
            let message = message(record);
            self.tap.record(&message).await;
            // A failure is not logged: the log record would fail in turn.
            let _ = self.publisher.publish(message).await;
        }
    }
}

fn message(record: LogRecord) -> Log {
    Log {
        stamp: Time {
            sec: i32::try_from(record.stamp.as_secs()).unwrap_or(i32::MAX),
            nanosec: record.stamp.subsec_nanos(),
        },
        level: severity(record.level),
        name: record.logger,
        msg: record.message,
        file: record.file.unwrap_or_default().to_owned(),
        function: String::new(),
        line: record.line.unwrap_or_default(),
    }
}

fn severity(level: LogLevel) -> u8 {
    match level {
        LogLevel::Unset | LogLevel::Debug => Log::DEBUG,
        LogLevel::Info => Log::INFO,
        LogLevel::Warn => Log::WARN,
        LogLevel::Error => Log::ERROR,
        LogLevel::Fatal => Log::FATAL,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_levels_match_rcl_interfaces() {
        for (level, number) in [
            (LogLevel::Debug, 10),
            (LogLevel::Info, 20),
            (LogLevel::Warn, 30),
            (LogLevel::Error, 40),
            (LogLevel::Fatal, 50),
        ] {
            let record = LogRecord {
                stamp: Duration::new(1_700_000_000, 123_456_789),
                level,
                logger: "cell.mill".to_owned(),
                message: "text".to_owned(),
                file: None,
                line: None,
            };
            let message = message(record);
            assert_eq!(message.level, number);
            assert_eq!((message.stamp.sec, message.stamp.nanosec), (1_700_000_000, 123_456_789));
        }
    }
}
