//! `/clock`: followed with `use_sim_time`, and watched for a second publisher in `fast`.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures::StreamExt;
use ros2_interfaces_jazzy_serde::builtin_interfaces::msg::Time;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use tokio::sync::watch;
use tokio::task::JoinSet;
use tracing::{error, warn};

use crate::ros::axes::{ClockFollower, ClockState};
use crate::ros::topics::TopicInput;
use crate::ros_interface::{CLOCK_INPUT, CLOCK_INPUT_QOS};
use virtual_axes_core::units::{Nanoseconds, SECOND_NS};
use virtual_axes_dds::{Gid, Node, TopicEndpointInfo};

/// Polling period of the publishers of the clock; in a large graph a poll takes long.
const POLL_PERIOD: Duration = Duration::from_millis(200);
/// Type of a topic that every node of this package publishes, and no other node.
const MACHINE_TYPE: &str = "virtual_axes::msg::dds_::DriveStates_";

/// GUID prefix of a participant.
type GuidPrefix = [u8; 12];

fn prefix_of(guid: &Gid) -> GuidPrefix {
    std::array::from_fn(|i| guid[i])
}

/// Logs each publisher of the topic `name` beside that of `node`, which is in `fast`, and sets `count` to their number,
/// until the task is aborted.
pub async fn watch_other_clocks(node: Node, name: String, count: Arc<AtomicUsize>) {
    let mut known = HashSet::new();
    let mut timer = tokio::time::interval(POLL_PERIOD);
    loop {
        timer.tick().await;
        let of_clock = |info: &TopicEndpointInfo| info.topic_name.as_ref() == Some(&name);
        let found: Vec<_> = node.get_publishers_info().into_iter().filter(of_clock).collect();
        for other in found.iter().filter(|other| !known.contains(&other.endpoint_gid)) {
            let publisher = other.node_name.as_ref();
            error!(
                "{name}: {} publishes it, too; in time:=fast this node must be its only publisher: start one of them with \
                 use_sim_time:=true, or end the other publisher",
                publisher.map_or("another participant".to_owned(), |name| format!("node {name}"))
            );
        }
        count.store(found.len(), Ordering::Relaxed);
        known = found.into_iter().map(|other| other.endpoint_gid).collect::<HashSet<Gid>>();
    }
}

/// Follower of the clock and the sender of its state; `None` while the node does not follow it.
type Followed = Arc<Mutex<Option<(ClockFollower, watch::Sender<ClockState>)>>>;

/// Subscription of `/clock`, from the first time at which the node follows it.
///
/// It is kept when the node follows the wall clock again: RustDDS 0.15.1 gives a second subscription of a topic the samples
/// that the first has received.
pub struct ClockSubscription {
    node: Node,
    /// Resolved name of the topic.
    name: String,
    /// Position cycle Tsp, ns.
    period: Nanoseconds,
    followed: Followed,
    /// Task that receives the messages, empty before the first.
    task: JoinSet<()>,
}

impl ClockSubscription {
    /// Creates the state of a node that does not follow the topic `name`; `period` is Tsp, ns.
    pub fn new(node: Node, name: String, period: Nanoseconds) -> Self {
        ClockSubscription { node, name, period, followed: Arc::default(), task: JoinSet::new() }
    }

    /// Subscribes to the topic, without a recording, and follows it. Returns the state of the clock.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn subscribe(&mut self) -> Result<watch::Receiver<ClockState>, String> {
        if self.task.is_empty() {
            let input = TopicInput::create(&self.node, &CLOCK_INPUT, self.name.clone(), CLOCK_INPUT_QOS)?;
            return Ok(self.follow(input));
        }
        Ok(self.restart())
    }

    /// Follows the messages of `subscription`. Returns the state of the clock.
    pub fn follow(&mut self, subscription: TopicInput<Clock>) -> watch::Receiver<ClockState> {
        let state = self.restart();
        self.task.spawn(receive_clock(subscription, self.node.clone(), Arc::clone(&self.followed)));
        state
    }

    fn restart(&self) -> watch::Receiver<ClockState> {
        let (sender, state) = watch::channel(ClockState::default());
        *lock(&self.followed) = Some((ClockFollower::new(self.period), sender));
        state
    }

    /// Ignores the messages from now on.
    pub fn end(&self) {
        *lock(&self.followed) = None;
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Receives the messages of the clock until the task is aborted; `node` discovers the publishers.
async fn receive_clock(subscription: TopicInput<Clock>, node: Node, followed: Followed) {
    let name = &subscription.name;
    // Nodes of this package, whose clock never jumps ahead.
    let mut machines = HashSet::new();
    // Number of publishers at the last poll.
    let mut clocks = 0;
    let mut has_warned = false;
    let mut timer = tokio::time::interval(POLL_PERIOD);
    let mut messages = std::pin::pin!(subscription.messages());
    loop {
        tokio::select! {
            _ = timer.tick() => {
                let publishers = node.get_publishers_info();
                let of_machines = publishers.iter().filter(|info| info.topic_type == MACHINE_TYPE);
                machines = of_machines.map(|info| prefix_of(&info.endpoint_gid)).collect();
                let found = publishers_of(name, &publishers, &machines);
                if found.len() > clocks.max(1) && lock(&followed).is_some() {
                    warn!(
                        "{name}: {} publishers, of {}; each change between their times is a jump, which stops the axes: \
                         end all but one",
                        found.len(),
                        found.join(", ")
                    );
                }
                clocks = found.len();
            }
            Some(received) = messages.next() => match received {
                Ok((message, info)) => match valid_time(&message.clock) {
                    Some(time) => {
                        if let Some((follower, state)) = &mut *lock(&followed) {
                            follower.receive(time, machines.contains(&prefix_of(&info.publisher_gid)));
                            let received = follower.state();
                            state.send_if_modified(|sent| std::mem::replace(sent, received) != received);
                        }
                    }
                    None if !std::mem::replace(&mut has_warned, true) => warn!(
                        "{name}: invalid time: sec {}, nanosec {}; ignored, use sec >= 0 and nanosec < 1000000000",
                        message.clock.sec, message.clock.nanosec
                    ),
                    None => {}
                },
                Err(error) => warn!("{name}: invalid message: {error}"),
            },
        }
    }
}

/// Returns the nodes of the publishers of the topic `name`, one for each publisher; one of `machines` counts once, since for a
/// while it has two publishers of a topic.
fn publishers_of(
    name: &str,
    publishers: &[TopicEndpointInfo],
    machines: &HashSet<GuidPrefix>,
) -> Vec<String> {
    let mut counted = HashSet::new();
    let of_clock = publishers.iter().filter(|info| info.topic_name.as_deref() == Some(name));
    let of_clock = of_clock.filter(|info| {
        let prefix = prefix_of(&info.endpoint_gid);
        !machines.contains(&prefix) || counted.insert(prefix)
    });
    let node = |info: &TopicEndpointInfo| info.node_name.clone().unwrap_or("another participant".to_owned());
    of_clock.map(node).collect()
}

/// Returns a time in ns; `None` before the epoch or with a whole second of nanoseconds.
fn valid_time(time: &Time) -> Option<Nanoseconds> {
    let nanosec = Nanoseconds::from(time.nanosec);
    (time.sec >= 0 && nanosec < SECOND_NS).then_some(Nanoseconds::from(time.sec) * SECOND_NS + nanosec)
}
