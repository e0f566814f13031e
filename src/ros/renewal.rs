//! Renewal of the DDS participant at rest, which releases the memory of departed endpoints.
//!
//! RustDDS keeps data of every endpoint that it has discovered until its participant is dropped
//! (docs/internals/middleware.md). A new participant with a node of the same name and the same endpoints is therefore
//! opened beside the present one. When it has discovered all endpoints that the present one knows, the node uses it,
//! and drops the previous one:
//!
//! | step | messages and responses by | messages and requests from |
//! |---|---|---|
//! | both exist; the new one discovers and is discovered | old | old |
//! | switch | new | old until empty, then new without those that the old one has delivered |
//! | retention for repetitions | new | new |
//!
//! Simulation, clock, parameters, goals and recording are not involved. A motion delays the switch; if there is none in
//! time, the new participant is dropped instead.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ros2_client::{Context, Node};
use rustdds::DomainParticipant;
use tokio::sync::watch;
use tokio::task::{JoinSet, block_in_place, spawn_blocking};
use tracing::{info, warn};

use super::args::RosArgs;
use super::discovery_gate::ClosedGate;
use super::duplicate_node_name;
use super::health::Health;
use super::matched_subscriptions::{DiscoveryEvents, MatchedSubscriptionTracker};
use super::own_participants::OwnParticipants;
use super::participant::create_node;
use super::remote_endpoints::{DiscoveredEndpoints, EndpointCounter};
use super::remote_participants::RemoteParticipants;
use super::renewable::RenewableEndpoint;
use super::rtps::Guid;
use super::topic_writers::RotatedTopic;
use super::writer_rotation::RotationContext;

/// Time at rest before a renewal.
const REST_TIME: Duration = Duration::from_secs(5);
/// Time for which both participants exist before the switch, in which the new one is discovered.
const DISCOVERY_TIME: Duration = Duration::from_secs(5);
/// Time after which the switch does not wait any more until no other participant is being discovered.
const SETTLING_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest time for which both participants exist before the switch.
const DISCOVERY_TIMEOUT: Duration = Duration::from_secs(60);
/// Time for which the previous participant exists after the switch, for repetitions.
const RETENTION_TIME: Duration = Duration::from_secs(5);
/// Longest additional time for responses and writes in progress.
const RETENTION_TIMEOUT: Duration = Duration::from_secs(60);
/// Period at which discovery and retention are checked.
const POLL_PERIOD: Duration = Duration::from_millis(200);
/// Time after a failed renewal before the next one.
const RETRY_TIME: Duration = Duration::from_secs(600);

/// Renewal of the participant, with the tasks that watch its discovery.
pub(super) struct Renewal {
    settings: RenewalSettings,
    tracker: MatchedSubscriptionTracker,
    endpoints: Vec<Arc<dyn RenewableEndpoint>>,
    watch: DiscoveryWatch,
    /// Time since which the axes are at rest.
    rest_since: Option<Instant>,
    not_before: Option<Instant>,
}

/// Settings and inputs of the renewal.
pub(super) struct RenewalSettings {
    /// Number of departed endpoints at which the participant is renewed; `None` disables the renewal.
    pub threshold: Option<u64>,
    /// Participants of this process.
    pub own: OwnParticipants,
    /// Arguments with the name of the node.
    pub args: RosArgs,
    /// State of the axes' thread.
    pub health: watch::Receiver<Health>,
    /// Counter of the discovered endpoints.
    pub discovered: DiscoveredEndpoints,
}

/// Tasks that watch the discovery of one participant, aborted on drop.
pub(super) struct DiscoveryWatch {
    _tasks: JoinSet<()>,
    tracker: watch::Sender<MatchedSubscriptionTracker>,
    participants: RemoteParticipants,
    counter: Arc<EndpointCounter>,
    is_current: Arc<AtomicBool>,
}

/// Participant with its node, before or after its use.
struct Successor {
    context: Context,
    node: Node,
    watch: DiscoveryWatch,
}

impl Renewal {
    /// Creates the renewal of the participant whose discovery `watch` watches; its publishers are those of `tracker`.
    ///
    /// `endpoints` are moved at a renewal, besides the topics that are passed to [`Self::run`].
    pub(super) fn new(
        settings: RenewalSettings,
        watch: DiscoveryWatch,
        tracker: MatchedSubscriptionTracker,
        endpoints: Vec<Arc<dyn RenewableEndpoint>>,
    ) -> Self {
        watch.tracker.send_replace(tracker.clone());
        settings.discovered.set(Arc::clone(&watch.counter));
        Renewal { settings, tracker, endpoints, watch, rest_since: None, not_before: None }
    }

    /// Returns the other participants that the present one has discovered.
    pub(super) fn participants(&self) -> RemoteParticipants {
        self.watch.participants.clone()
    }

    /// Returns true if enough endpoints have departed and the axes have been at rest for [`REST_TIME`]; called every
    /// second.
    pub(super) fn is_due(&mut self, now: Instant) -> bool {
        let is_at_rest = self.is_at_rest();
        let since = *self.rest_since.get_or_insert(now);
        if !is_at_rest {
            self.rest_since = None;
        }
        is_at_rest
            && now - since >= REST_TIME
            && self.not_before.is_none_or(|begin| now >= begin)
            && self.settings.threshold.is_some_and(|threshold| self.has_departed(threshold))
    }

    /// Returns true if at least `count` of the discovered endpoints have departed.
    fn has_departed(&self, count: u64) -> bool {
        // The list of the present endpoints is long.
        self.watch.counter.count() >= count && self.departed() >= count
    }

    fn departed(&self) -> u64 {
        let present = self.settings.own.current().map_or(0, |own| self.remote_endpoints(&own).len());
        self.watch.counter.count().saturating_sub(present as u64)
    }

    fn is_at_rest(&self) -> bool {
        let health = self.settings.health.borrow();
        !(health.is_moving || health.is_busy || health.stream.is_active)
    }

    /// Renews the participant, with the writers of `topics` and the node of `owner`; logs the result.
    pub(super) async fn run(&mut self, topics: &[Arc<dyn RotatedTopic>], owner: &mut RotationContext) {
        let departed = self.departed();
        info!("renewing the DDS participant: {departed} remote endpoints have departed");
        let others = self.endpoints.clone();
        let topics = topics.iter().map(|topic| &**topic as &dyn RenewableEndpoint);
        let endpoints: Vec<_> = topics.chain(others.iter().map(|endpoint| &**endpoint)).collect();
        let result = self.renew(&endpoints, owner).await;
        endpoints.iter().for_each(|endpoint| endpoint.release());
        let own = self.settings.own.clone();
        // The dispose takes 40 ms.
        let _ = spawn_blocking(move || own.close_other()).await;
        match result {
            Ok(()) => info!("the DDS participant is renewed"),
            Err(reason) => {
                self.not_before = Some(Instant::now() + RETRY_TIME);
                let retry = RETRY_TIME.as_secs();
                warn!(
                    "the DDS participant is not renewed: {reason}; the next attempt is in {retry} s at the earliest"
                );
            }
        }
    }

    /// Moves the node and its endpoints to a new participant. The caller releases the endpoints and the participant
    /// that are not used.
    async fn renew(
        &mut self,
        endpoints: &[&dyn RenewableEndpoint],
        owner: &mut RotationContext,
    ) -> Result<(), String> {
        let successor = self.prepare(endpoints)?;
        let began = Instant::now();
        for endpoint in endpoints {
            endpoint.replay().await;
        }
        self.wait_for_discovery(&successor, began).await?;
        for endpoint in endpoints {
            endpoint.switch().await;
        }
        self.settings.own.switch();
        self.settings.discovered.renew(Arc::clone(&successor.watch.counter));
        self.watch.is_current.store(false, Ordering::Relaxed);
        successor.watch.is_current.store(true, Ordering::Relaxed);
        let Successor { context, node, watch } = successor;
        owner.participants = watch.participants.clone();
        owner.disposed = 0;
        let predecessor = Successor {
            node: std::mem::replace(&mut owner.node, node),
            context: std::mem::replace(&mut owner.context, context),
            watch: std::mem::replace(&mut self.watch, watch),
        };
        tokio::time::sleep(RETENTION_TIME).await;
        let began = Instant::now();
        while began.elapsed() < RETENTION_TIMEOUT && endpoints.iter().any(|e| e.is_predecessor_in_use()) {
            tokio::time::sleep(POLL_PERIOD).await;
        }
        drop(predecessor);
        Ok(())
    }

    /// Opens the next participant with its node and the successors of `endpoints`; it is announced when all exist.
    fn prepare(&self, endpoints: &[&dyn RenewableEndpoint]) -> Result<Successor, String> {
        block_in_place(|| {
            let gate = ClosedGate::new();
            let context = self.settings.own.open_next().map_err(|error| error.to_string())?;
            let mut node = create_node(&context, &self.settings.args)?;
            endpoints.iter().try_for_each(|endpoint| endpoint.prepare(&mut node, &context))?;
            let watch = DiscoveryWatch::new(
                &self.settings.own,
                &self.settings.args,
                context.domain_participant(),
                self.tracker.clone(),
            );
            drop(gate);
            Ok(Successor { context, node, watch })
        })
    }

    /// Waits until `next` has discovered all endpoints that the present participant knows, has been announced for
    /// [`DISCOVERY_TIME`] since `began`, and the axes are at rest.
    async fn wait_for_discovery(&self, next: &Successor, began: Instant) -> Result<(), String> {
        let participant = next.context.domain_participant();
        loop {
            tokio::time::sleep(POLL_PERIOD).await;
            let elapsed = began.elapsed();
            let present = self.settings.own.current().ok_or("the node is shutting down")?;
            let (known, discovered) = (self.remote_endpoints(&present), self.remote_endpoints(&participant));
            let missing = known.difference(&discovered).count();
            let is_settled =
                next.watch.participants.is_settled(Instant::now()) || elapsed >= SETTLING_TIMEOUT;
            if missing == 0 && is_settled && elapsed >= DISCOVERY_TIME && self.is_at_rest() {
                return Ok(());
            }
            if elapsed >= DISCOVERY_TIMEOUT {
                let (known, timeout) = (known.len(), DISCOVERY_TIMEOUT.as_secs());
                return Err(match missing {
                    0 => format!("the axes were not at rest within {timeout} s"),
                    _ => format!(
                        "{missing} of {known} remote endpoints were not discovered again within {timeout} s"
                    ),
                });
            }
        }
    }

    /// Returns the endpoints of other processes that `participant` has discovered.
    fn remote_endpoints(&self, participant: &DomainParticipant) -> HashSet<Guid> {
        let readers = participant.discovered_readers().into_iter();
        let writers = participant.discovered_writers().into_iter();
        readers
            .map(|reader| reader.reader_proxy.remote_reader_guid.to_bytes())
            .chain(writers.map(|writer| writer.writer_proxy.remote_writer_guid.to_bytes()))
            .filter(|guid| !self.settings.own.contains(guid))
            .collect()
    }
}

impl DiscoveryWatch {
    /// Starts the tasks for the first participant; it is the current one, without publishers.
    pub(super) fn of_first(own: &OwnParticipants, args: &RosArgs, participant: DomainParticipant) -> Self {
        let watch = Self::new(own, args, participant, MatchedSubscriptionTracker::default());
        watch.is_current.store(true, Ordering::Relaxed);
        watch
    }

    /// Starts the tasks for `participant`, which is not the current one yet.
    fn new(
        own: &OwnParticipants,
        args: &RosArgs,
        participant: DomainParticipant,
        tracker: MatchedSubscriptionTracker,
    ) -> Self {
        let (tracker, tracked) = watch::channel(tracker);
        let mut tasks = JoinSet::new();
        let participants = RemoteParticipants::default();
        let (counter, is_current) = (Arc::<EndpointCounter>::default(), Arc::<AtomicBool>::default());
        tasks.spawn(duplicate_node_name::watch(&participant, args.node().clone(), own.clone()));
        let events = DiscoveryEvents {
            participant,
            tracker: tracked,
            own: own.clone(),
            counter: Arc::clone(&counter),
            participants: participants.clone(),
            is_current: Arc::clone(&is_current),
        };
        tasks.spawn(events.run());
        DiscoveryWatch { _tasks: tasks, tracker, participants, counter, is_current }
    }
}
