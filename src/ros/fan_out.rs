//! From the simulation to the topics: each position instant, the clock, and the diagnostics.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use rustdds::{DomainParticipant, RTPSEntity};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use tracing::info;

use super::convert;
use super::diagnostics::Diagnostics;
use super::outputs::Output;
use super::pace::{Frame, Health};
use super::recorder::RecordingStatus;
use crate::messages::{DriveStates, MotorCurrents};

/// Period of `/diagnostics` (REP-107).
const DIAGNOSTICS_PERIOD: Duration = Duration::from_secs(1);
/// How often it is looked whether somebody else publishes `/clock`.
const CLOCK_WATCH_PERIOD: Duration = Duration::from_millis(500);

/// The clock, unless another node publishes it.
pub struct ClockOutput {
    /// Where it goes.
    pub output: Output<Clock>,
    /// Whether somebody else publishes it.
    pub silent: Arc<AtomicBool>,
}

/// The outputs of every position instant.
pub struct FanOut {
    /// `joint_states`.
    pub joint_states: Output<JointState>,
    /// `~/motor_currents`.
    pub motor_currents: Output<MotorCurrents>,
    /// `~/drive_states`.
    pub drive_states: Output<DriveStates>,
    /// `/clock`, in `fast`.
    pub clock: Option<ClockOutput>,
    /// Joints, with prefix.
    pub joints: Vec<String>,
    /// Position instants from one publication to the next.
    pub every: i64,
}

impl FanOut {
    /// Publishes frames until the simulation ends.
    pub async fn run(self, mut frames: mpsc::Receiver<Frame>) {
        while let Some(frame) = frames.recv().await {
            if let Some(clock) = &self.clock
                && !clock.silent.load(Ordering::Relaxed)
            {
                clock.output.send(Clock { clock: convert::stamp(frame.time) }).await;
            }
            if frame.instant % self.every == 0 {
                self.joint_states.send(convert::joint_state(&frame, &self.joints)).await;
                self.motor_currents.send(convert::motor_currents(&frame, &self.joints)).await;
                self.drive_states.send(convert::drive_states(&frame, &self.joints)).await;
            }
        }
    }
}

/// Publishes what has happened since the last message, once a second.
pub async fn publish_diagnostics(
    text: Diagnostics,
    output: Output<DiagnosticArray>,
    health: watch::Receiver<Health>,
    dropped: Arc<AtomicU64>,
    mut recording: Option<RecordingStatus>,
) {
    let mut timer = tokio::time::interval(DIAGNOSTICS_PERIOD);
    let (mut before, mut dropped_before) = (Health::default(), 0);
    loop {
        timer.tick().await;
        let now = health.borrow().clone();
        let dropped_now = dropped.load(Ordering::Relaxed);
        let mut message = text.message(now.time, &before, &now, (dropped_before, dropped_now));
        message.status.extend(recording.as_mut().map(|status| status.message(&text.node, &text.machine)));
        output.send(message).await;
        (before, dropped_before) = (now, dropped_now);
    }
}

/// Starts a task that notes whether another participant publishes the clock `name`.
pub fn watch_clock(participant: DomainParticipant, name: String, tasks: &mut JoinSet<()>) -> Arc<AtomicBool> {
    let others = Arc::new(AtomicBool::new(false));
    let noted = Arc::clone(&others);
    tasks.spawn(async move {
        let topic = format!("rt{name}");
        let own = participant.guid().prefix;
        loop {
            let found = participant.discovered_writers().iter().any(|writer| {
                writer.publication_topic_data.topic_name == topic
                    && writer.writer_proxy.remote_writer_guid.prefix != own
            });
            if found != noted.swap(found, Ordering::Relaxed) {
                let what = if found { "somebody else publishes it; holding back" } else { "publishing it" };
                info!("{name}: {what}");
            }
            tokio::time::sleep(CLOCK_WATCH_PERIOD).await;
        }
    });
    others
}
