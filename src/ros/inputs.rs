//! Subscriptions `psec`, `psec_stream`, `~/speed_scaling_input` and `load`: validation and submission to the simulation.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use futures::StreamExt;
use ros2_client::MessageInfo;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;
use tracing::warn;

use super::arc_pool::ArcPool;
use super::axes_interface::Command;
use super::convert;
use super::endpoints::Subscription;
use super::health::Health;
use super::results::{Origin, TrajectoryResults};
use super::stream::{ReorderFilter, StreamSetpoints};
use super::throttle::Throttle;
pub use crate::ingress::TrajectoryValidator;
use virtual_axes_core::trajectory::{MotionId, check_feed_override};
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::messages::SpeedScalingFactor;

/// Input `psec`: validates trajectories and submits them to the simulation.
pub struct PsecInput {
    /// Validator of the checks that do not depend on the state of the axes.
    pub validator: Arc<TrajectoryValidator>,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Results of the trajectories.
    pub results: Arc<TrajectoryResults>,
    /// State of the axes' thread, with the simulation time.
    pub health: watch::Receiver<Health>,
    /// Counter of motion ids.
    pub ids: Arc<AtomicU64>,
}

/// Returns the next motion id.
pub fn next_motion_id(ids: &AtomicU64) -> MotionId {
    MotionId(ids.fetch_add(1, Ordering::Relaxed))
}

impl PsecInput {
    /// Processes messages until the node shuts down.
    pub async fn run(self, subscription: Subscription<JointTrajectory>) {
        let mut messages = std::pin::pin!(subscription.async_stream());
        while let Some(received) = messages.next().await {
            match received {
                Ok((message, info)) => self.submit(message, &info).await,
                Err(error) => warn!("psec: invalid message: {error:?}"),
            }
        }
    }

    async fn submit(&self, message: JointTrajectory, info: &MessageInfo) {
        let origin = Origin::from_message(&message.header.stamp, info);
        // Validation of a large trajectory takes long; other tasks continue meanwhile.
        let validated = tokio::task::block_in_place(|| self.validator.validate(&message))
            .and_then(|trajectory| self.results.admit(trajectory));
        match validated {
            Ok(trajectory) => {
                let id = next_motion_id(&self.ids);
                self.results.register(id, origin, Some(Arc::clone(&trajectory))).await;
                // The channel is closed only at shutdown.
                let _ = self.commands.send(Command::Submit { id, trajectory, tolerances: None }).await;
            }
            Err(rejection) => {
                let now = self.health.borrow().time;
                self.results.publish_rejection(&origin, now, &rejection).await;
            }
        }
    }
}

/// Processes streamed setpoints until the node shuts down.
pub async fn receive_stream(
    subscription: Subscription<JointState>,
    joints: Vec<String>,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.async_stream());
    let (mut filter, mut pool) = (ReorderFilter::default(), ArcPool::default());
    while let Some(received) = messages.next().await {
        match received {
            Ok((message, info)) => {
                let publisher = info.publisher_gid().to_bytes16();
                let setpoints =
                    StreamSetpoints::from_message_in_order(&message, &joints, publisher, &mut filter);
                let _ = commands.send(Command::Stream(pool.acquire(|last| *last = setpoints))).await;
            }
            Err(error) => warn!("psec_stream: invalid message: {error:?}"),
        }
    }
}

/// Processes feed overrides until the node shuts down.
pub async fn receive_feed_overrides(
    subscription: Subscription<SpeedScalingFactor>,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.async_stream());
    let (mut throttle, started) = (Throttle::default(), Instant::now());
    while let Some(received) = messages.next().await {
        let checked =
            received.map_err(|e| format!("{e:?}")).and_then(|(SpeedScalingFactor { factor }, _)| {
                check_feed_override(factor).map(|()| factor).map_err(|e| e.to_string())
            });
        match checked {
            Ok(factor) => {
                let _ = commands.send(Command::SetFeedOverride(factor)).await;
            }
            Err(reason) => {
                let now = Nanoseconds::try_from(started.elapsed().as_nanos()).unwrap_or(Nanoseconds::MAX);
                if throttle.is_due((), now) {
                    warn!("speed_scaling_input message ignored: {reason}");
                }
            }
        }
    }
}

/// Processes loads until the node shuts down; each is applied for `hold`, ns.
pub async fn receive_loads(
    subscription: Subscription<JointState>,
    joints: Vec<String>,
    hold: Nanoseconds,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.async_stream());
    let (mut throttle, started) = (Throttle::default(), Instant::now());
    let mut pool = ArcPool::default();
    while let Some(received) = messages.next().await {
        match received.map_err(|e| format!("{e:?}")).and_then(|(m, _)| convert::loads(&m, &joints)) {
            Ok(loads) => {
                let loads = pool.acquire(|last| *last = loads);
                let _ = commands.send(Command::Load { loads, hold }).await;
            }
            Err(reason) => {
                let now = Nanoseconds::try_from(started.elapsed().as_nanos()).unwrap_or(Nanoseconds::MAX);
                // One throttle for all reasons: a reason can contain a value, which differs each time.
                if throttle.is_due((), now) {
                    warn!("load message ignored: {reason}");
                }
            }
        }
    }
}
