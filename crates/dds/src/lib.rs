//! ROS 2 nodes, topics and services on RustDDS.
//!
//! The names are those of rclcpp and rclrs. A [`Context`] joins the network; its [`Node`] creates publishers,
//! subscriptions and services, and reports the graph. [`Node::spin`] must run while the node exists.
//!
//! RustDDS and Fast DDS have defects that concern each other. The modules in `defects` have one each, with its symptom,
//! its place upstream, the test that fails without the remedy, and the condition under which it is superfluous;
//! docs/internals/middleware.md is their index.
//!
//! ```no_run
//! use virtual_axes_dds::{Context, Environment, QoSProfile, Security};
//!
//! # async fn run() -> Result<(), Box<dyn std::error::Error>> {
//! let context = Context::open(&Environment::from_process()?, &Security::Off)?;
//! let node = context.create_node("/cell", "counter")?;
//! tokio::spawn(node.spin());
//! let publisher = node.create_publisher::<i32>("/cell/count", "std_msgs/msg/Int32", &QoSProfile::reliable(10))?;
//! publisher.publish(1).await;
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod context;
pub mod datagrams;
mod defects;
mod discovery;
mod environment;
mod hosts;
mod node;
mod publisher;
mod qos;
mod rtps;
mod security;
mod service;
mod subscription;

pub use context::{Context, ContextError};
pub use defects::discovery_gate::{ClosedGate, pass as pass_discovery_gate};
pub use discovery::{EndpointCounts, TopicEndpointInfo};
pub use environment::{DiscoveryRange, Environment, EnvironmentError};
pub use node::Node;
pub use publisher::Publisher;
pub use qos::QoSProfile;
pub use rtps::Guid as Gid;
pub use security::{Security, SecurityError};
pub use service::{RequestId, ResponseLimiter, ResponsePermit, Service, response_fits};
pub use subscription::{MessageInfo, Subscription};
