//! Subscriptions `psec`, `psec_stream`, `~/speed_scaling_input`, `load` and `/clock`: validation and submission to the simulation.

mod clock;

pub use clock::{ClockSubscription, watch_other_clocks};

use std::sync::Arc;

use futures::StreamExt;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;
use serde::de::DeserializeOwned;
use tokio::sync::{mpsc, watch};
use tokio::time::Instant;
use tracing::warn;

use crate::ros::axes::{ArcPool, Command, Health, MotionIds, Throttle};
use crate::ros::results::{Origin, TrajectoryResults};
use crate::ros::topics::TopicInput;
use crate::validation::{ReorderFilter, StreamSetpoints, TrajectoryValidator, loads};
use virtual_axes_core::trajectory::check_feed_override;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_dds::MessageInfo;
use virtual_axes_io::messages::{Recorded, SpeedScalingFactor};

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
    pub ids: MotionIds,
}

impl PsecInput {
    /// Processes messages until the node shuts down.
    pub async fn run(self, subscription: TopicInput<JointTrajectory>) {
        let mut messages = std::pin::pin!(subscription.messages());
        while let Some(received) = messages.next().await {
            match received {
                Ok((message, info)) => self.submit(message, &info).await,
                Err(error) => warn!("psec: invalid message: {error}"),
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
                let id = self.ids.next();
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
    subscription: TopicInput<JointState>,
    joints: Vec<String>,
    commands: mpsc::Sender<Command>,
) {
    let mut messages = std::pin::pin!(subscription.messages());
    let (mut filter, mut pool) = (ReorderFilter::default(), ArcPool::default());
    while let Some(received) = messages.next().await {
        match received {
            Ok((message, info)) => {
                let publisher = info.publisher_gid;
                let setpoints =
                    StreamSetpoints::from_message_in_order(&message, &joints, publisher, &mut filter);
                let _ = commands.send(Command::Stream(pool.acquire(|last| *last = setpoints))).await;
            }
            Err(error) => warn!("psec_stream: invalid message: {error}"),
        }
    }
}

/// Processes feed overrides until the node shuts down.
pub async fn receive_feed_overrides(
    subscription: TopicInput<SpeedScalingFactor>,
    commands: mpsc::Sender<Command>,
) {
    receive(subscription, "speed_scaling_input", commands, |SpeedScalingFactor { factor }| {
        check_feed_override(factor).map(|()| Command::SetFeedOverride(factor)).map_err(|e| e.to_string())
    })
    .await;
}

/// Processes loads until the node shuts down; each is applied for `hold`, ns.
pub async fn receive_loads(
    subscription: TopicInput<JointState>,
    joints: Vec<String>,
    hold: Nanoseconds,
    commands: mpsc::Sender<Command>,
) {
    let mut pool = ArcPool::default();
    receive(subscription, "load", commands, |message| {
        loads(&message, &joints)
            .map(|found| Command::Load { loads: pool.acquire(|last| *last = found), hold })
    })
    .await;
}

/// Sends the command of each message of the topic `name`; invalid messages are ignored with a warning.
async fn receive<M: Recorded + DeserializeOwned + Send + Sync + 'static>(
    subscription: TopicInput<M>,
    name: &str,
    commands: mpsc::Sender<Command>,
    mut command: impl FnMut(M) -> Result<Command, String>,
) {
    let mut messages = std::pin::pin!(subscription.messages());
    let (mut throttle, started) = (Throttle::default(), Instant::now());
    while let Some(received) = messages.next().await {
        match received.and_then(|(message, _)| command(message)) {
            Ok(command) => {
                let _ = commands.send(command).await;
            }
            Err(reason) => {
                let now = Nanoseconds::try_from(started.elapsed().as_nanos()).unwrap_or(Nanoseconds::MAX);
                // One throttle for all reasons: a reason can contain a value, which differs each time.
                if throttle.is_due((), now) {
                    warn!("{name} message ignored: {reason}");
                }
            }
        }
    }
}
