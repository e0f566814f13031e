//! The node's own log messages on `/rosout`.
//!
//! The crate's own publisher keeps one message for late joiners; this one keeps as many as rcl's.

use std::time::Duration;

use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{MessageTypeName, Node};
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use rustdds::DomainParticipant;
use tokio::sync::mpsc;

use super::args::{LogLevel, RosArgs};
use super::endpoints::{EndpointError, Publisher, keeping, topic};
use super::log::LogRecord;
use super::recorder::{Direction, Recorder};
use virtual_axes_core::config::QosConfig;

/// Messages that may wait; more are dropped, so that logging never waits.
pub const QUEUE: usize = 256;

/// The topic.
const NAME: &str = "/rosout";
/// Depth and lifespan of rcl's publisher (`rcl_qos_profile_rosout_default`).
const DEPTH: usize = 1000;
const LIFESPAN: Duration = Duration::from_secs(10);
/// How long a message may wait for a slow reader.
const WRITE_TIMEOUT: Duration = Duration::from_millis(100);

/// The publisher, where the arguments want one: reliable, transient local, as rcl's.
///
/// # Errors
/// [`EndpointError`] when the middleware refuses it.
pub(super) fn publisher(
    node: &mut Node,
    participant: &DomainParticipant,
    args: &RosArgs,
    recorder: &mut Recorder,
) -> Result<Option<Publisher<Log>>, EndpointError> {
    if !args.log_sinks().rosout {
        return Ok(None);
    }
    let failed = |reason: String| EndpointError::Refused { name: NAME.to_owned(), reason };
    let resolved = args.resolve_topic(NAME).map_err(|e| failed(e.to_string()))?;
    let profile = QosProfile {
        durability: Durability::TransientLocal,
        history: History::KeepLast { depth: DEPTH },
        lifespan: Some(LIFESPAN),
        ..QosProfile::publisher_default().reliability_reliable(WhenFull::Wait(WRITE_TIMEOUT))
    };
    let type_name = MessageTypeName::new("rcl_interfaces", "Log");
    let topic = topic(participant, &resolved, &type_name, &keeping(&profile, DEPTH)).map_err(failed)?;
    let network = node.create_publisher(&topic, None).map_err(|e| failed(e.to_string()))?;
    let qos = QosConfig { reliable: true, transient_local: true, depth: DEPTH };
    let tap = recorder.tap(&resolved, qos, Direction::Out);
    Ok(Some(Publisher { network, tap, topic, volatile: false, kept: DEPTH }))
}

/// Publishes what comes until the log is closed.
pub(super) async fn publish(publisher: Publisher<Log>, mut records: mpsc::Receiver<LogRecord>) {
    while let Some(record) = records.recv().await {
        let message = message(record);
        publisher.tap.record(&message).await;
        // To log a failure here would make the next one.
        let _ = publisher.network.async_publish(message).await;
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
    fn levels_are_those_of_the_interface_file() {
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
