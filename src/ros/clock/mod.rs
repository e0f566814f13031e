//! `/clock`: followed where somebody else gives it, given in `fast` where nobody else does.
//!
//! In `use_sim_time` whoever publishes it is followed. In `fast` the machines of a domain agree on
//! one that gives it ([`election`]); the others follow, and are silent.

mod election;
mod follower;

pub use election::Role;
pub use follower::{Jump, first_instant};

use std::collections::HashSet;
use std::time::Duration;

use futures::StreamExt;
use ros2_client::MessageInfo;
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use rustdds::{DomainParticipant, RTPSEntity};
use tokio::sync::watch;
use tracing::{info, warn};

use super::endpoints::Subscription;
use super::outputs::Output;
use super::pace::Health;
use election::{Election, Prefix, Rival};
use follower::Follower;
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};

/// How often it is looked who publishes the clock.
const LOOK_PERIOD: Duration = Duration::from_millis(50);
/// Looks before a machine takes it that nobody else does: others are known 10 to 160 ms after the
/// start, and give a clock every position period.
const LOOKS: u32 = 6;
/// Once it has listened, it looks only every so many times: a graph can be large.
const LOOK_EVERY: u32 = 4;
/// A topic that every machine of this package publishes, and nobody else.
const MACHINE_TYPE: &str = "virtual_axes::msg::dds_::DriveStates_";

/// What is known about the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockState {
    /// What this node does about it.
    pub role: Role,
    /// The newest time that was heard, ns.
    pub newest: Option<Nanoseconds>,
    /// Where it last began anew.
    pub jump: Jump,
}

impl ClockState {
    /// Nothing yet; `fast` listens first.
    pub fn new(fast: bool) -> Self {
        let role = if fast { Role::Listening } else { Role::Following(None) };
        ClockState { role, newest: None, jump: Jump::default() }
    }

    /// Whether there is a time.
    pub fn is_known(&self) -> bool {
        self.role == Role::Leading || self.newest.is_some()
    }

    /// Whether this node tells the others that it is `time` (ns): they have not heard so before.
    fn is_told(&self, time: Nanoseconds) -> bool {
        self.role == Role::Leading && self.newest.is_none_or(|newest| time > newest)
    }
}

/// `/clock` of this node's own, in `fast`.
pub struct ClockOutput {
    /// Where it goes.
    pub output: Output<Clock>,
    /// Whether it goes there.
    pub state: watch::Receiver<ClockState>,
}

impl ClockOutput {
    /// Publishes `time` (ns), unless somebody else gives the clock.
    pub async fn send(&self, time: Nanoseconds) {
        let is_told = self.state.borrow().is_told(time);
        if is_told {
            self.output.send(Clock { clock: super::convert::stamp(time) }).await;
        }
    }
}

/// Listens to the clock and to who publishes it.
pub struct ClockInput {
    /// `/clock`.
    pub subscription: Subscription<Clock>,
    /// Its resolved name.
    pub name: String,
    /// What knows who publishes it.
    pub participant: DomainParticipant,
    /// Tsp, ns.
    pub period: Nanoseconds,
    /// What the node's own clock shows.
    pub health: watch::Receiver<Health>,
    /// Who wants to know.
    pub state: watch::Sender<ClockState>,
}

impl ClockInput {
    /// Listens until the node shuts down; in `fast` it takes part in the election.
    pub async fn run(self, fast: bool) {
        let own = prefix_of(&self.participant.guid().to_bytes());
        let election = fast.then(|| Election::new(own));
        let follower = Follower::new(self.period);
        let ClockInput { subscription, name, participant, health, state, .. } = self;
        let graph = Graph { participant, topic: format!("rt{name}"), own };
        let machines = HashSet::new();
        let mut watcher = Watcher {
            name,
            own,
            election,
            machines,
            follower,
            health,
            state,
            graph,
            is_fresh: false,
            told_invalid: false,
        };
        let mut looks = 0_u32;
        let mut timer = tokio::time::interval(LOOK_PERIOD);
        let mut messages = std::pin::pin!(subscription.async_stream());
        loop {
            tokio::select! {
                _ = timer.tick() => {
                    looks = looks.saturating_add(1);
                    let listened = looks > LOOKS;
                    if !listened || looks.is_multiple_of(LOOK_EVERY) {
                        watcher.is_fresh = false;
                        watcher.look(listened);
                    }
                }
                Some(received) = messages.next() => match received {
                    Ok((message, info)) => watcher.take(&message.clock, &info),
                    Err(error) => warn!("a message on {} could not be read: {error:?}", watcher.name),
                },
            }
        }
    }
}

fn prefix_of(guid: &[u8; 16]) -> Prefix {
    std::array::from_fn(|i| guid[i])
}

/// Who publishes what.
struct Graph {
    participant: DomainParticipant,
    topic: String,
    own: Prefix,
}

impl Graph {
    /// Others who publish the clock.
    fn rivals(&self) -> Vec<Rival> {
        let writers: Vec<(String, String, Prefix)> = self
            .participant
            .discovered_writers()
            .into_iter()
            .map(|writer| {
                let prefix = prefix_of(&writer.writer_proxy.remote_writer_guid.to_bytes());
                let data = writer.publication_topic_data;
                (data.topic_name, data.type_name, prefix)
            })
            .collect();
        let is_machine =
            |prefix: Prefix| writers.iter().any(|(_, kind, by)| kind == MACHINE_TYPE && *by == prefix);
        writers
            .iter()
            .filter(|(topic, _, by)| *topic == self.topic && *by != self.own)
            .map(|&(_, _, prefix)| Rival { prefix, machine: is_machine(prefix) })
            .collect()
    }
}

struct Watcher {
    name: String,
    own: Prefix,
    /// In `fast`.
    election: Option<Election>,
    /// Machines of this package that publish the clock.
    machines: HashSet<Prefix>,
    follower: Follower,
    health: watch::Receiver<Health>,
    state: watch::Sender<ClockState>,
    graph: Graph,
    /// Whether somebody unknown has been looked up since the last look.
    is_fresh: bool,
    told_invalid: bool,
}

impl Watcher {
    /// Looks who publishes the clock.
    fn look(&mut self, listened: bool) {
        let rivals = self.graph.rivals();
        self.machines = rivals.iter().filter(|r| r.machine).map(|r| r.prefix).collect();
        if let Some(election) = &mut self.election {
            let before = election.role();
            election.see(rivals, listened);
            let role = election.role();
            self.tell(before, role);
        }
    }

    fn take(&mut self, time: &Time, info: &MessageInfo) {
        let from = prefix_of(&info.publisher_gid().to_bytes16());
        if from == self.own {
            return;
        }
        if i64::from(time.nanosec) >= SECOND_NS || time.sec < 0 {
            if !std::mem::replace(&mut self.told_invalid, true) {
                warn!("{}: sec {}, nanosec {} is no time; left out", self.name, time.sec, time.nanosec);
            }
            return;
        }
        let time = i64::from(time.sec) * SECOND_NS + i64::from(time.nanosec);
        let Some(election) = &mut self.election else {
            let role = Role::Following(Some(from));
            self.follow(time, from);
            self.tell(role, role);
            return;
        };
        let before = election.role();
        let mut follows = election.hear(from);
        if !follows && before != Role::Leading && !self.is_fresh {
            // Its first message can be here before the look that finds it.
            self.is_fresh = true;
            election.see(self.graph.rivals(), false);
            follows = election.hear(from);
        }
        if !follows {
            return;
        }
        let role = election.role();
        if !matches!(before, Role::Following(_)) {
            let (time, periods) = {
                let health = self.health.borrow();
                (health.time, health.periods)
            };
            if periods > 0 {
                self.follower.follow_on_from(time);
            }
        }
        self.follow(time, from);
        self.tell(before, role);
    }

    fn follow(&mut self, time: Nanoseconds, from: Prefix) {
        self.follower.take(time, self.machines.contains(&from));
    }

    /// Tells the simulation, and the log when it is news.
    fn tell(&self, before: Role, role: Role) {
        let state = ClockState { role, newest: self.follower.newest(), jump: self.follower.jump() };
        self.state.send_if_modified(|told| std::mem::replace(told, state) != state);
        let follows = |role| matches!(role, Role::Following(_));
        if follows(role) && !follows(before) {
            info!("{}: somebody else publishes it; holding back and following it", self.name);
        } else if role == Role::Leading && before != Role::Leading {
            info!("{}: publishing it", self.name);
        }
    }
}
