//! `/clock`: subscribed with `use_sim_time`, published or subscribed in `fast`.
//!
//! With `use_sim_time` the node follows any publisher. In `fast` the nodes of a domain elect one that publishes
//! ([`election`]); the others follow it and do not publish.

mod election;
mod follower;

pub use election::Role;
pub use follower::{ClockJump, first_instant};

use std::collections::HashSet;
use std::time::Duration;

use futures::StreamExt;
use ros2_client::MessageInfo;
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use rustdds::RTPSEntity;
use tokio::sync::watch;
use tracing::{info, warn};

use super::convert::stamp;
use super::endpoints::Subscription;
use super::health::Health;
use super::outputs::Output;
use super::own_participants::OwnParticipants;
use election::{Election, GuidPrefix, RemoteClock};
use follower::ClockFollower;
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// Polling period of the publishers of the clock.
const POLL_PERIOD: Duration = Duration::from_millis(50);
/// Number of polls before a node may publish the clock. Other nodes are discovered 10 to 160 ms after the start and
/// publish every position cycle.
const LISTENING_POLLS: u32 = 6;
/// Number of timer ticks per poll after the listening phase; in a large graph a poll takes long.
const POLL_EVERY: u32 = 4;
/// Type of a topic that every node of this package publishes, and no other node.
const MACHINE_TYPE: &str = "virtual_axes::msg::dds_::DriveStates_";

/// State of the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockState {
    /// Role of this node.
    pub role: Role,
    /// Newest received time, ns.
    pub newest: Option<Nanoseconds>,
    /// Last jump.
    pub jump: ClockJump,
}

impl ClockState {
    /// Creates the state without a time. The role is listening in `fast`, else following.
    pub fn new(is_fast: bool) -> Self {
        let role = if is_fast { Role::Listening } else { Role::Following(None) };
        ClockState { role, newest: None, jump: ClockJump::default() }
    }

    /// Returns true if the time is known.
    pub fn is_known(&self) -> bool {
        self.role == Role::Leading || self.newest.is_some()
    }

    /// Returns true if this node publishes `time`, ns: it leads, and the time has not been published before.
    fn publishes(&self, time: Nanoseconds) -> bool {
        self.role == Role::Leading && self.newest.is_none_or(|newest| time > newest)
    }
}

/// Output `/clock` of this node, in `fast`.
pub struct ClockOutput {
    /// Output of the topic.
    pub output: Output<Clock>,
    /// State of the clock.
    pub state: watch::Receiver<ClockState>,
}

impl ClockOutput {
    /// Publishes `time`, ns, unless another node publishes the clock.
    pub async fn send(&self, time: Nanoseconds) {
        let is_published = self.state.borrow().publishes(time);
        if is_published {
            self.output.send(Clock { clock: stamp(time) }).await;
        }
    }
}

/// Input of the clock: subscription and discovery of its publishers.
pub struct ClockInput {
    /// Subscription `/clock`.
    pub subscription: Subscription<Clock>,
    /// Resolved name of the topic.
    pub name: String,
    /// Participants of this process, of which the current one discovers the publishers.
    pub participants: OwnParticipants,
    /// Position cycle Tsp, ns.
    pub period: Nanoseconds,
    /// State of the axes' thread, with the time of the last position cycle.
    pub health: watch::Receiver<Health>,
    /// Sender of the state of the clock.
    pub state: watch::Sender<ClockState>,
}

impl ClockInput {
    /// Follows the clock until the node shuts down; takes part in the election if `is_fast`.
    pub async fn run(self, is_fast: bool) {
        // The participant is not renewed in `fast`, where it takes part in the election.
        let own =
            self.participants.current().map(|dds| prefix_of(&dds.guid().to_bytes())).unwrap_or_default();
        let election = is_fast.then(|| Election::new(own));
        let follower = ClockFollower::new(self.period);
        let ClockInput { subscription, name, participants, health, state, .. } = self;
        let graph = ClockGraph { participants, topic: format!("rt{name}"), own };
        let machines = HashSet::new();
        let mut watcher = ClockWatcher {
            name,
            own,
            election,
            machines,
            follower,
            health,
            state,
            graph,
            has_polled_for_message: false,
            has_warned: false,
        };
        let mut ticks = 0_u32;
        let mut timer = tokio::time::interval(POLL_PERIOD);
        let mut messages = std::pin::pin!(subscription.async_stream());
        loop {
            tokio::select! {
                _ = timer.tick() => {
                    ticks = ticks.saturating_add(1);
                    let has_listened = ticks > LISTENING_POLLS;
                    if !has_listened || ticks.is_multiple_of(POLL_EVERY) {
                        watcher.has_polled_for_message = false;
                        watcher.poll(has_listened);
                    }
                }
                Some(received) = messages.next() => match received {
                    Ok((message, info)) => watcher.receive(&message.clock, &info),
                    Err(error) => warn!("{}: invalid message: {error:?}", watcher.name),
                },
            }
        }
    }
}

fn prefix_of(guid: &[u8; 16]) -> GuidPrefix {
    std::array::from_fn(|i| guid[i])
}

/// Discovered publishers of the clock.
struct ClockGraph {
    participants: OwnParticipants,
    topic: String,
    own: GuidPrefix,
}

impl ClockGraph {
    /// Returns the other participants that have a publisher of the clock.
    fn remote_clocks(&self) -> Vec<RemoteClock> {
        let writers: Vec<(String, String, GuidPrefix)> = self
            .participants
            .current()
            .map(|participant| participant.discovered_writers())
            .unwrap_or_default()
            .into_iter()
            .map(|writer| {
                let prefix = prefix_of(&writer.writer_proxy.remote_writer_guid.to_bytes());
                let data = writer.publication_topic_data;
                (data.topic_name, data.type_name, prefix)
            })
            .collect();
        let is_machine =
            |prefix: GuidPrefix| writers.iter().any(|(_, kind, by)| kind == MACHINE_TYPE && *by == prefix);
        writers
            .iter()
            .filter(|(topic, _, by)| *topic == self.topic && *by != self.own)
            .map(|&(_, _, prefix)| RemoteClock { prefix, is_machine: is_machine(prefix) })
            .collect()
    }
}

struct ClockWatcher {
    name: String,
    own: GuidPrefix,
    /// Election, in `fast`.
    election: Option<Election>,
    /// Nodes of this package that have a publisher of the clock.
    machines: HashSet<GuidPrefix>,
    follower: ClockFollower,
    health: watch::Receiver<Health>,
    state: watch::Sender<ClockState>,
    graph: ClockGraph,
    /// True if a message of an unknown publisher has caused a poll since the last regular one.
    has_polled_for_message: bool,
    has_warned: bool,
}

impl ClockWatcher {
    /// Updates the publishers of the clock and the election.
    fn poll(&mut self, has_listened: bool) {
        let remote = self.graph.remote_clocks();
        self.machines = remote.iter().filter(|r| r.is_machine).map(|r| r.prefix).collect();
        if let Some(election) = &mut self.election {
            let before = election.role();
            election.update(remote, has_listened);
            let role = election.role();
            self.report(before, role);
        }
    }

    fn receive(&mut self, time: &Time, info: &MessageInfo) {
        let from = prefix_of(&info.publisher_gid().to_bytes16());
        if from == self.own {
            return;
        }
        if i64::from(time.nanosec) >= SECOND_NS || time.sec < 0 {
            if !std::mem::replace(&mut self.has_warned, true) {
                warn!(
                    "{}: invalid time: sec {}, nanosec {}; ignored, use sec >= 0 and nanosec < 1000000000",
                    self.name, time.sec, time.nanosec
                );
            }
            return;
        }
        let time = i64::from(time.sec) * SECOND_NS + i64::from(time.nanosec);
        let Some(election) = &mut self.election else {
            let role = Role::Following(Some(from));
            self.follow(time, from);
            self.report(role, role);
            return;
        };
        let before = election.role();
        let mut is_followed = election.receive(from);
        if !is_followed && before != Role::Leading && !self.has_polled_for_message {
            // The first message of a publisher can arrive before the poll that finds the publisher.
            self.has_polled_for_message = true;
            election.update(self.graph.remote_clocks(), false);
            is_followed = election.receive(from);
        }
        if !is_followed {
            return;
        }
        let role = election.role();
        if !matches!(before, Role::Following(_)) {
            let (time, periods) = {
                let health = self.health.borrow();
                (health.time, health.periods)
            };
            if periods > 0 {
                self.follower.continue_from(time);
            }
        }
        self.follow(time, from);
        self.report(before, role);
    }

    fn follow(&mut self, time: Nanoseconds, from: GuidPrefix) {
        self.follower.receive(time, self.machines.contains(&from));
    }

    /// Sends the state to the axes' thread and logs a change of role.
    fn report(&self, before: Role, role: Role) {
        let state = ClockState { role, newest: self.follower.newest(), jump: self.follower.jump() };
        self.state.send_if_modified(|sent| std::mem::replace(sent, state) != state);
        let follows = |role| matches!(role, Role::Following(_));
        if follows(role) && !follows(before) {
            info!("{}: another node publishes it; following it", self.name);
        } else if role == Role::Leading && before != Role::Leading {
            info!("{}: publishing it", self.name);
        }
    }
}
