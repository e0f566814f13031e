//! Subscribes to `joint_states` from Rust and counts received and lost samples.
//!
//! ```text
//! cargo run --release --example count_joint_states -- [SECONDS [PERIOD_MS [TOPIC]]]
//! ```
//!
//! The node publishes one sample per position cycle with the time of its position cycle as stamp, so consecutive
//! samples are PERIOD_MS (default 6) apart; a larger distance means lost samples.

use std::env;
use std::error::Error;
use std::time::{Duration, Instant};

use futures::StreamExt;
use ros2_client::qos::{History, QosProfile};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions};
use virtual_axes::ros::environment::Environment;
use virtual_axes::ros::participant::Participant;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;

/// Timeout for the first sample.
const FIRST: Duration = Duration::from_secs(10);
/// History depth; RustDDS limits "keep all" to fewer samples.
const DEPTH: usize = 100_000;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let seconds: f64 = arguments.next().as_deref().unwrap_or("10").parse()?;
    let period_ms: f64 = arguments.next().as_deref().unwrap_or("6").parse()?;
    let topic = arguments.next().unwrap_or_else(|| "/joint_states".to_owned());

    // Reads ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and related variables.
    let environment = Environment::from_process()?;
    let participant = Participant::open(&environment)?;
    let counted = tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(count(
        &participant,
        &topic,
        Duration::from_secs_f64(seconds),
    ));
    participant.shutdown();
    let Counted { stamps, seconds } = counted?;

    let period = period_ms * 1e6;
    let lost: f64 = stamps.windows(2).map(|w| ((w[1] - w[0]) as f64 / period).round() - 1.0).sum();
    println!(
        "{} samples in {seconds:.2} s: {:.1} per second, {lost} lost",
        stamps.len(),
        stamps.len().saturating_sub(1) as f64 / seconds
    );
    Ok(())
}

/// Received stamps, ns, and the time from the first to the last sample, s.
struct Counted {
    stamps: Vec<i64>,
    seconds: f64,
}

async fn count(participant: &Participant, topic: &str, span: Duration) -> Result<Counted, Box<dyn Error>> {
    let context = participant.context()?;
    let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
    let mut node = context.new_node(NodeName::new("/", "count_joint_states")?, options)?;
    // The default profile of a publisher is reliable and compatible with the node.
    let qos = QosProfile::publisher_default().history(History::KeepLast { depth: DEPTH });
    let topic =
        node.create_topic(&Name::parse(topic)?, MessageTypeName::new("sensor_msgs", "JointState"), &qos)?;
    let subscription = node.create_subscription::<JointState>(&topic, None)?;

    let mut samples = std::pin::pin!(subscription.async_stream());
    tokio::time::timeout(FIRST, samples.next()).await.map_err(|_| "no sample within 10 s")?;
    let (mut stamps, start) = (Vec::new(), Instant::now());
    let (end, mut last) = (tokio::time::Instant::from_std(start + span), start);
    while let Ok(Some(received)) = tokio::time::timeout_at(end, samples.next()).await {
        let (sample, _) = received?;
        last = Instant::now();
        stamps.push(
            i64::from(sample.header.stamp.sec) * 1_000_000_000 + i64::from(sample.header.stamp.nanosec),
        );
    }
    Ok(Counted { stamps, seconds: (last - start).as_secs_f64() })
}
