//! Tasks of the node: reception of messages, goals and requests, and publication of reports.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use futures::future::{BoxFuture, join, pending};
use futures::stream::FuturesUnordered;
use futures::{FutureExt, StreamExt};
use ros2_client::Node;
use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;
use tokio::runtime::Handle;
use tokio::sync::{Mutex, mpsc, watch};
use tokio::task::{AbortHandle, JoinSet};

use super::endpoints::NodeServices;
use super::outputs::{ActionOutputs, ProgramOutputs};
use super::requests::{reset_axes, set_feed_hold, stop_axes, stop_of_all_joints};
use super::setup::NodeSetup;
use crate::ros::action::{ActionChannels, ActionServer, GoalValidator, ShutdownHandle, TrajectoryGoals};
use crate::ros::args::RosArgs;
use crate::ros::axes_interface::{Command, SimulationReport};
use crate::ros::clock::{ClockInput, ClockState};
use crate::ros::diagnostics::Diagnostics;
use crate::ros::endpoints::Subscription;
use crate::ros::fan_out::publish_diagnostics;
use crate::ros::health::Health;
use crate::ros::inputs::{
    PsecInput, TrajectoryValidator, next_motion_id, receive_feed_overrides, receive_loads, receive_stream,
};
use crate::ros::log::LogRecord;
use crate::ros::matched_subscriptions::MatchedSubscriptionTracker;
use crate::ros::outputs::Output;
use crate::ros::own_participants::OwnParticipants;
use crate::ros::pace::{CooperativeTasks, Pace};
use crate::ros::parameter_host::{LiveNodeParameters, NodeParameterHost};
use crate::ros::program::ProgramGoals;
use crate::ros::recorder::{RecordingStatus, Tap};
use crate::ros::remote_endpoints::DiscoveredEndpoints;
use crate::ros::renewable::EndpointContext;
use crate::ros::renewal::{DiscoveryWatch, Renewal, RenewalSettings};
use crate::ros::results::TrajectoryResults;
use crate::ros::rtps::is_secured;
use crate::ros::topic_writers::TopicWriters;
use crate::ros::writer_rotation::{RotatedTopics, RotationContext};
use crate::ros::{convert, rosout};
use virtual_axes_core::config::{Parameters, TimeMode};
use virtual_axes_core::trajectory::{MotionId, Trajectory};
use virtual_axes_io::messages::SpeedScalingFactor;

/// Tasks of the node, with their shared state.
pub(super) struct NodeTasks<'a> {
    pub(super) args: &'a RosArgs,
    pub(super) setup: &'a NodeSetup,
    pub(super) participants: OwnParticipants,
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) health: watch::Receiver<Health>,
    pub(super) results: Arc<TrajectoryResults>,
    /// Counter of motion ids.
    pub(super) ids: Arc<AtomicU64>,
    pub(super) live: Arc<LiveNodeParameters>,
    pub(super) tasks: JoinSet<()>,
    /// Handle of the task that serves the parameters.
    pub(super) parameters: Option<AbortHandle>,
}

impl NodeTasks<'_> {
    /// Starts the output `/rosout`, if it is enabled.
    pub(super) fn spawn_log_output(
        &mut self,
        rosout: Option<(Arc<TopicWriters<Log>>, Tap<Log>)>,
        log: Arc<Mutex<mpsc::Receiver<LogRecord>>>,
    ) {
        if let Some(output) = rosout {
            self.tasks.spawn(rosout::publish(output, log));
        }
    }

    /// Starts the handling of discovery, the rotation of writers and the renewal of the participant. Returns the count
    /// of discovered endpoints.
    pub(super) fn spawn_discovery(
        &mut self,
        watch: DiscoveryWatch,
        tracker: MatchedSubscriptionTracker,
        rotated: RotatedTopics,
        node: Node,
        context: EndpointContext,
    ) -> DiscoveredEndpoints {
        let discovered = DiscoveredEndpoints::default();
        let is_renewable = self.setup.mode != TimeMode::Fast && !is_secured();
        let settings = RenewalSettings {
            threshold: self.setup.node_config.renewal_endpoints.filter(|_| is_renewable),
            own: self.participants.clone(),
            args: self.args.clone(),
            health: self.health.clone(),
            discovered: discovered.clone(),
        };
        let (context, endpoints) = context.into_parts();
        let renewal = Renewal::new(settings, watch, tracker, endpoints);
        let (range, participants) = (self.participants.range(), renewal.participants());
        let owner = RotationContext { node, context, range, participants, disposed: 0 };
        self.tasks.spawn(rotated.run(owner, renewal));
        discovered
    }

    /// Starts the input `/clock`, if there is one; the state of the clock is sent to `state`.
    pub(super) fn spawn_clock_input(
        &mut self,
        input: Option<(Subscription<Clock>, String)>,
        state: watch::Sender<ClockState>,
    ) {
        let Some((subscription, name)) = input else { return };
        let (participants, health) = (self.participants.clone(), self.health.clone());
        let period = self.setup.period;
        let input = ClockInput { subscription, name, participants, period, health, state };
        self.tasks.spawn(input.run(self.setup.mode == TimeMode::Fast));
    }

    /// Starts the action server and the input `psec`.
    pub(super) fn spawn_trajectory_inputs(
        &mut self,
        action: ActionServer<TrajectoryGoals>,
        outputs: ActionOutputs,
        psec: Subscription<JointTrajectory>,
    ) -> ShutdownHandle {
        let validator = Arc::new(TrajectoryValidator {
            joints: self.setup.joint_limits.clone(),
            period: self.setup.period,
            max_points: self.setup.node_config.max_points,
            interpolates: self.setup.node_config.interpolates,
            live: Arc::clone(&self.live),
        });
        let (handle, shutdown) = ShutdownHandle::new();
        let ActionOutputs { status, running, events } = outputs;
        let handler = TrajectoryGoals {
            validator: GoalValidator { trajectories: Arc::clone(&validator) },
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            ids: Arc::clone(&self.ids),
            running: Vec::new(),
            running_out: running,
        };
        let (commands, health) = (self.commands.clone(), self.health.clone());
        let channels = ActionChannels { handler, events, commands, health, status, shutdown };
        self.tasks.spawn(action.serve(channels));
        let psec_input = PsecInput {
            validator,
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            health: self.health.clone(),
            ids: Arc::clone(&self.ids),
        };
        self.tasks.spawn(psec_input.run(psec));
        handle
    }

    /// Starts the server of part programs.
    pub(super) fn spawn_program_server(
        &mut self,
        server: ActionServer<ProgramGoals>,
        outputs: ProgramOutputs,
    ) -> ShutdownHandle {
        let (handle, shutdown) = ShutdownHandle::new();
        let ProgramOutputs { status, running, events } = outputs;
        let handler = ProgramGoals {
            machine: Arc::new(self.setup.config.clone()),
            joints: self.setup.joints.clone(),
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            ids: Arc::clone(&self.ids),
            running_out: running,
            programs: HashMap::new(),
        };
        let (commands, health) = (self.commands.clone(), self.health.clone());
        let channels = ActionChannels { handler, events, commands, health, status, shutdown };
        self.tasks.spawn(server.serve(channels));
        handle
    }

    /// Starts the input `~/speed_scaling_input`.
    pub(super) fn spawn_feed_override_input(&mut self, input: Subscription<SpeedScalingFactor>) {
        self.tasks.spawn(receive_feed_overrides(input, self.commands.clone()));
    }

    /// Returns the function that returns a controlled stop of every joint and its identifier.
    pub(super) fn stop(&self) -> impl Fn() -> (MotionId, Option<Arc<Trajectory>>) + Send + 'static {
        let NodeSetup { joint_limits, period, node_config, .. } = self.setup;
        let stop = stop_of_all_joints(joint_limits, *period, node_config.max_points);
        let ids = Arc::clone(&self.ids);
        move || (next_motion_id(&ids), stop.clone())
    }

    /// Starts the parameter services, `~/stop`, `~/reset`, `~/feed_hold` and `~/cycle_start`.
    pub(super) fn spawn_services(&mut self, services: NodeServices, parameters: Parameters) {
        let health = self.health.clone();
        let now = move || convert::stamp(health.borrow().time);
        let mut host = NodeParameterHost::new(parameters, self.commands.clone(), Arc::clone(&self.live));
        let parameters = services.parameters;
        let served = self.tasks.spawn(async move { parameters.serve(&mut host, now, pending()).await });
        self.parameters = Some(served);
        let (commands, stop) = (self.commands.clone(), self.stop());
        let act = move || {
            let (id, stop) = stop();
            stop_axes(commands.clone(), id, stop)
        };
        self.tasks.spawn(services.stop.serve(act));
        let commands = self.commands.clone();
        self.tasks.spawn(services.reset.serve(move || reset_axes(commands.clone())));
        self.tasks.spawn(services.query_state.serve(self.setup.joints.clone(), self.commands.clone()));
        for (service, is_held) in [(services.feed_hold, true), (services.cycle_start, false)] {
            let commands = self.commands.clone();
            self.tasks.spawn(service.serve(move || set_feed_hold(commands.clone(), is_held)));
        }
    }

    /// Starts the publication of the diagnostics.
    pub(super) fn spawn_diagnostics(
        &mut self,
        output: Output<DiagnosticArray>,
        discovered: DiscoveredEndpoints,
        dropped: Arc<AtomicU64>,
        recording: Option<RecordingStatus>,
    ) {
        let diagnostics = Diagnostics {
            node: self.args.node().to_string(),
            machine: self.setup.config.name().to_owned(),
            joints: self.setup.joints.clone(),
            time_mode: match self.setup.mode {
                TimeMode::Real => "real",
                TimeMode::Fast => "fast",
                TimeMode::SimTime => "sim",
            },
            discovered,
        };
        let health = self.health.clone();
        self.tasks.spawn(publish_diagnostics(diagnostics, output, health, dropped, recording));
    }

    /// Starts the publication of the simulation's reports.
    pub(super) fn spawn_reports(&mut self, mut reports: mpsc::UnboundedReceiver<SimulationReport>) {
        let results = Arc::clone(&self.results);
        self.tasks.spawn(async move {
            while let Some(report) = reports.recv().await {
                results.publish(report).await;
            }
        });
    }

    /// Returns the reception of streamed setpoints and loads, which does not end.
    pub(super) fn stream_and_load_inputs(
        &self,
        psec_stream: Subscription<JointState>,
        load: Subscription<JointState>,
    ) -> BoxFuture<'static, ()> {
        let NodeSetup { joints, node_config, .. } = self.setup;
        let stream = receive_stream(psec_stream, joints.clone(), self.commands.clone());
        let loads = receive_loads(load, joints.clone(), node_config.load_timeout, self.commands.clone());
        join(stream, loads).then(|_| pending()).boxed()
    }

    /// Returns the pacing of the axes' thread. In real time the thread polls `inputs` and `outputs` itself, otherwise
    /// another thread does.
    pub(super) fn pace(
        &mut self,
        inputs: BoxFuture<'static, ()>,
        outputs: BoxFuture<'static, ()>,
        clock: watch::Receiver<ClockState>,
    ) -> Pace {
        match self.setup.mode {
            TimeMode::Real => Pace::Real(CooperativeTasks { inputs, outputs }),
            TimeMode::Fast | TimeMode::SimTime => {
                // A separate thread, because the publication may wait for subscribers. It ends with the frames.
                let futures = FuturesUnordered::from_iter([outputs, inputs]);
                let runtime = Handle::current();
                self.tasks.spawn_blocking(move || {
                    let _ = runtime.block_on(futures.into_future());
                });
                Pace::Clock { state: clock, runtime: Handle::current() }
            }
        }
    }
}
