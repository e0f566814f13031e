//! Publishes `joint_states` of five joints at the period of the node, and does nothing else: the least that a publisher
//! with this middleware costs.
//!
//! ```text
//! cargo run --release --example minimal_publisher -- [PERIOD_MS]
//! ```
//!
//! `tools/measure_node.py` compares the node with it. It runs until it is terminated.

use std::env;
use std::error::Error;
use std::thread;
use std::time::{Duration, Instant};

use ros2_client::qos::{History, QosProfile};
use ros2_client::{MessageTypeName, Name, NodeName, NodeOptions};
use virtual_axes::ros::environment::Environment;
use virtual_axes::ros::participant::Participant;
use virtual_axes_io::messages::builtin_interfaces::msg::Time;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::std_msgs::msg::Header;

/// History depth, as of the node's publisher.
const DEPTH: usize = 10;

fn main() -> Result<(), Box<dyn Error>> {
    let period_ms: f64 = env::args().nth(1).as_deref().unwrap_or("6").parse()?;
    let period = Duration::from_secs_f64(period_ms * 1e-3);
    let participant = Participant::open(&Environment::from_process()?)?;
    let context = participant.context()?;
    let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
    let mut node = context.new_node(NodeName::new("/", "minimal_publisher")?, options)?;
    let topic = node.create_topic(
        &Name::new("/", "joint_states")?,
        MessageTypeName::new("sensor_msgs", "JointState"),
        &QosProfile::publisher_default().history(History::KeepLast { depth: DEPTH }),
    )?;
    let publisher = node.create_publisher::<JointState>(&topic, None)?;
    let name: Vec<String> = ["x", "y", "z", "a", "c"].map(str::to_owned).to_vec();
    let began = Instant::now();
    for cycle in 1_u32.. {
        thread::sleep((period * cycle).saturating_sub(began.elapsed()));
        let since = period * cycle;
        let stamp = Time { sec: i32::try_from(since.as_secs())?, nanosec: since.subsec_nanos() };
        let values = vec![f64::from(cycle); name.len()];
        publisher.publish(JointState {
            header: Header { stamp, frame_id: String::new() },
            name: name.clone(),
            position: values.clone(),
            velocity: values.clone(),
            effort: values,
        })?;
    }
    Ok(())
}
