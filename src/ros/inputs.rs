//! What the node listens to: `psec`, `psec_stream` and `load`.

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
use super::convert;
use super::endpoints::Subscription;
use super::pace::{Command, Health};
use super::results::{Origin, Results};
use super::stream::{ReorderFilter, StreamSetpoints};
use super::throttle::Throttle;
pub use crate::ingress::TrajectoryValidator;
use virtual_axes_core::trajectory::MotionId;
use virtual_axes_core::units::Nanoseconds;

/// Takes trajectories in, makes the checks that need no state, and hands them to the simulation.
pub struct PsecInput {
    /// Those checks.
    pub checks: Arc<TrajectoryValidator>,
    /// To the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Where decisions are published.
    pub results: Arc<Results>,
    /// What time it is in the simulation.
    pub health: watch::Receiver<Health>,
    /// Names of motions.
    pub ids: Arc<AtomicU64>,
}

/// A motion's next name.
pub fn next_id(ids: &AtomicU64) -> MotionId {
    MotionId(ids.fetch_add(1, Ordering::Relaxed))
}

impl PsecInput {
    /// Takes messages until the node shuts down.
    pub async fn run(self, subscription: Subscription<JointTrajectory>) {
        let mut messages = std::pin::pin!(subscription.async_stream());
        while let Some(received) = messages.next().await {
            match received {
                Ok((message, info)) => self.take(message, &info).await,
                Err(error) => warn!("a message on psec could not be read: {error:?}"),
            }
        }
    }

    async fn take(&self, message: JointTrajectory, info: &MessageInfo) {
        let origin = Origin::of(&message.header.stamp, info);
        // A large trajectory takes a while to check; other tasks go on meanwhile.
        let checked = tokio::task::block_in_place(|| self.checks.validate(&message))
            .and_then(|trajectory| self.results.hold(trajectory));
        match checked {
            Ok(trajectory) => {
                let id = next_id(&self.ids);
                self.results.remember(id, origin, Arc::clone(&trajectory)).await;
                // The simulation is gone only when the node shuts down.
                let _ = self.commands.send(Command::Offer { id, trajectory, tolerances: None }).await;
            }
            Err(rejection) => {
                let now = self.health.borrow().time;
                self.results.rejected(&origin, now, &rejection).await;
            }
        }
    }
}

/// Takes streamed setpoints in until the node shuts down.
pub async fn take_stream(
    subscription: Subscription<JointState>,
    joints: Vec<String>,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.async_stream());
    let (mut order, mut sent) = (ReorderFilter::default(), ArcPool::default());
    while let Some(received) = messages.next().await {
        match received {
            Ok((message, info)) => {
                let publisher = info.publisher_gid().to_bytes16();
                let setpoints =
                    StreamSetpoints::from_message_in_order(&message, &joints, publisher, &mut order);
                let _ = commands.send(Command::Stream(sent.acquire(|last| *last = setpoints))).await;
            }
            Err(error) => warn!("a message on psec_stream could not be read: {error:?}"),
        }
    }
}

/// Takes loads in until the node shuts down; each holds for `hold` ns.
pub async fn take_loads(
    subscription: Subscription<JointState>,
    joints: Vec<String>,
    hold: Nanoseconds,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.async_stream());
    let (mut told, started) = (Throttle::default(), Instant::now());
    let mut sent = ArcPool::default();
    while let Some(received) = messages.next().await {
        match received.map_err(|e| format!("{e:?}")).and_then(|(m, _)| convert::loads(&m, &joints)) {
            Ok(loads) => {
                let loads = sent.acquire(|last| *last = loads);
                let _ = commands.send(Command::Load { loads, hold }).await;
            }
            Err(reason) => {
                let now = Nanoseconds::try_from(started.elapsed().as_nanos()).unwrap_or(Nanoseconds::MAX);
                // Whatever the reason: one can name a value, which differs each time.
                if told.is_due((), now) {
                    warn!("a message on load is left out: {reason}");
                }
            }
        }
    }
}
