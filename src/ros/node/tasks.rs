//! Tasks of the node: creation of their topics, services and actions where they are used.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

use futures::FutureExt;
use futures::future::{BoxFuture, join, pending};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::task::{AbortHandle, JoinSet};

use super::error::NodeError;
use super::requests::{reset_axes, set_feed_hold, stop_axes, stop_of_all_joints};
use super::setup::NodeSetup;
use crate::ros::actions::{
    ActionChannels, ActionServer, GoalHandler, ProgramGoals, ShutdownHandle, TrajectoryGoals,
};
use crate::ros::axes::{Clock, Command, Health, MotionIds, SimulationReport};
use crate::ros::inputs::{
    ClockSubscription, PsecInput, receive_feed_overrides, receive_loads, receive_stream, watch_other_clocks,
};
use crate::ros::publication::{
    Diagnostics, FanOut, FeedbackOutput, ProgramFeedbackOutput, ToolOutput, feedback_period,
};
use crate::ros::results::{GoalEvent, TrajectoryResults};
use crate::ros::services::{
    NodeParameterHost, ParameterServices, QueryStateService, SetClock, TriggerService,
};
use crate::ros::topics::{EndpointError, TopicFactory};
use crate::ros_interface::{
    CLOCK, CLOCK_INPUT, CONTROLLER_STATE, CYCLE_START, DRIVE_STATES, FEED_HOLD, JOINT_STATES, LOAD,
    MOTOR_CURRENTS, PSEC, PSEC_STREAM, RESET, SPEED_SCALING_INPUT, STOP, TRAJECTORY_RESULT,
};
use crate::validation::args::RosArgs;
use crate::validation::parameters::LiveNodeParameters;
use crate::validation::{GoalId, GoalValidator, TrajectoryValidator};
use virtual_axes_core::config::{Parameters, TimeMode};
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::text::BuiltinFiles;
use virtual_axes_core::trajectory::{MotionId, Trajectory};
use virtual_axes_dds::Node;
use virtual_axes_io::messages::stamp;

/// State that the tasks of the node share.
pub(super) struct NodeTasks<'a> {
    pub(super) args: &'a RosArgs,
    pub(super) setup: &'a NodeSetup,
    /// Built-in part programs.
    pub(super) builtin: &'static BuiltinFiles,
    pub(super) commands: mpsc::Sender<Command>,
    pub(super) health: watch::Receiver<Health>,
    pub(super) results: Arc<TrajectoryResults>,
    pub(super) ids: MotionIds,
    pub(super) live: Arc<LiveNodeParameters>,
}

/// Events of the goals of both actions.
pub(super) struct GoalEvents {
    pub(super) trajectories: mpsc::UnboundedReceiver<(GoalId, GoalEvent)>,
    pub(super) programs: mpsc::UnboundedReceiver<(GoalId, GoalEvent)>,
}

/// Creates the results of trajectories, and the receivers of the events of goals.
pub(super) fn create_results(
    topics: &mut TopicFactory<'_>,
    setup: &NodeSetup,
) -> Result<(TrajectoryResults, GoalEvents), EndpointError> {
    let output = topics.output(&TRAJECTORY_RESULT, setup.result_overflow)?;
    let (goal_events, trajectories) = mpsc::unbounded_channel();
    let (program_events, programs) = mpsc::unbounded_channel();
    let limits = setup.joint_limits.clone();
    let results =
        TrajectoryResults::new(output, limits, goal_events, program_events, setup.node_config.max_points);
    Ok((results, GoalEvents { trajectories, programs }))
}

/// Returns the change of the clock of a running node.
fn clock_change(mut clock: ClockSubscription, commands: mpsc::Sender<Command>) -> SetClock {
    Box::new(move |is_followed| {
        let permit = commands.try_reserve();
        let permit = permit.map_err(|_| "the queue of commands is full; repeat the request")?;
        if is_followed {
            permit.send(Command::SetClock(Clock::Ros(Some(clock.subscribe()?))));
        } else {
            // Before the end of the followed clock, which ends the axes' thread.
            permit.send(Command::SetClock(Clock::Wall));
            clock.end();
        }
        Ok(())
    })
}

impl NodeTasks<'_> {
    /// Starts the inputs `psec` and `~/speed_scaling_input`. Returns the reception of streamed setpoints and loads, which
    /// does not end.
    pub(super) fn start_inputs(
        &self,
        topics: &mut TopicFactory<'_>,
        validator: &Arc<TrajectoryValidator>,
    ) -> Result<BoxFuture<'static, ()>, EndpointError> {
        let NodeSetup { joints, node_config, .. } = self.setup;
        let psec_input = PsecInput {
            validator: Arc::clone(validator),
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            health: self.health.clone(),
            ids: self.ids.clone(),
        };
        let psec = topics.subscription(&PSEC)?;
        topics.tasks.spawn(psec_input.run(psec));
        let stream = topics.subscription(&PSEC_STREAM)?;
        let stream = receive_stream(stream, joints.clone(), self.commands.clone());
        let feed_override = topics.latched_subscription(&SPEED_SCALING_INPUT)?;
        topics.tasks.spawn(receive_feed_overrides(feed_override, self.commands.clone()));
        let load = topics.subscription(&LOAD)?;
        let loads = receive_loads(load, joints.clone(), node_config.load_timeout, self.commands.clone());
        Ok(join(stream, loads).then(|_| pending()).boxed())
    }

    /// Returns the clock of the start, and the subscription of `/clock`, which begins with `use_sim_time`.
    pub(super) fn start_clock(
        &self,
        topics: &mut TopicFactory<'_>,
    ) -> Result<(Clock, ClockSubscription), EndpointError> {
        let name = self.args.resolve_topic(CLOCK_INPUT.name).unwrap_or_else(|_| CLOCK_INPUT.name.to_owned());
        let mut subscription = ClockSubscription::new(topics.node.clone(), name, self.setup.period);
        let clock = match self.setup.mode {
            TimeMode::Real => Clock::Wall,
            TimeMode::Fast => Clock::Ros(None),
            TimeMode::SimTime => Clock::Ros(Some(subscription.follow(topics.subscription(&CLOCK_INPUT)?))),
        };
        Ok((clock, subscription))
    }

    /// Creates the outputs of the frames, and starts both action servers with their feedback among these outputs; in
    /// `fast` also the detection of other publishers of the clock, whose number `other_clocks` is.
    pub(super) fn start_outputs(
        &self,
        topics: &mut TopicFactory<'_>,
        validator: Arc<TrajectoryValidator>,
        events: GoalEvents,
        other_clocks: &Arc<AtomicUsize>,
    ) -> Result<(FanOut, [ShutdownHandle; 2]), NodeError> {
        let NodeSetup { config, node_config, joints, overflow, result_overflow, .. } = self.setup;
        let (joint_states, motor_currents) =
            (topics.output(&JOINT_STATES, *overflow)?, topics.output(&MOTOR_CURRENTS, *overflow)?);
        let (drive_states, controller_state) =
            (topics.output(&DRIVE_STATES, *overflow)?, topics.output(&CONTROLLER_STATE, *overflow)?);
        let clock = match self.setup.mode {
            TimeMode::Fast => Some(topics.output(&CLOCK, *overflow)?),
            TimeMode::Real | TimeMode::SimTime => None,
        };
        if let (Some(_), Ok(name)) = (&clock, self.args.resolve_topic(CLOCK.name)) {
            topics.tasks.spawn(watch_other_clocks(topics.node.clone(), name, Arc::clone(other_clocks)));
        }
        let tool = ToolOutput::create(topics, Kinematics::new(config), node_config.tool.clone(), *overflow)?;
        let (server, output) = ActionServer::new(topics, self.args, *overflow, *result_overflow)?;
        let (running_out, goals) = watch::channel(Arc::from([]));
        let handler = TrajectoryGoals {
            validator: GoalValidator { trajectories: validator },
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            ids: self.ids.clone(),
            running: Vec::new(),
            running_out,
        };
        let (action, channels) = self.channels(handler, events.trajectories);
        topics.tasks.spawn(server.serve(channels));
        let every = feedback_period(node_config.action_monitor_rate, self.setup.period);
        let feedback = FeedbackOutput { goals, output, joints: joints.clone(), every };
        let (server, output) = ActionServer::new(topics, self.args, *overflow, *result_overflow)?;
        let (running_out, programs) = watch::channel(Arc::from([]));
        let handler = ProgramGoals {
            builtin: self.builtin,
            program_folder: node_config.program_folder.clone(),
            machine: Arc::new(config.clone()),
            joints: joints.clone(),
            commands: self.commands.clone(),
            results: Arc::clone(&self.results),
            ids: self.ids.clone(),
            running_out,
            programs: HashMap::new(),
            planners: Arc::default(),
        };
        let (program, channels) = self.channels(handler, events.programs);
        topics.tasks.spawn(server.serve(channels));
        let fan_out = FanOut {
            joint_states,
            motor_currents,
            drive_states,
            controller_state,
            feedback,
            program: ProgramFeedbackOutput { programs, output, joints: joints.clone(), every },
            tool,
            clock,
            joints: joints.clone(),
            every: self.setup.publication_period(),
        };
        Ok((fan_out, [action, program]))
    }

    /// Returns the channels of an action server, and the handle of its shutdown.
    fn channels<H: GoalHandler>(
        &self,
        handler: H,
        events: mpsc::UnboundedReceiver<(GoalId, GoalEvent)>,
    ) -> (ShutdownHandle, ActionChannels<H>) {
        let (handle, shutdown) = ShutdownHandle::new();
        let (commands, health) = (self.commands.clone(), self.health.clone());
        (handle, ActionChannels { handler, events, commands, health, shutdown })
    }

    /// Returns the validator of trajectories on `psec` and of goals.
    pub(super) fn validator(&self) -> Arc<TrajectoryValidator> {
        Arc::new(TrajectoryValidator {
            joints: self.setup.joint_limits.clone(),
            period: self.setup.period,
            max_points: self.setup.node_config.max_points,
            interpolates: self.setup.node_config.interpolates,
            live: Arc::clone(&self.live),
        })
    }

    /// Returns the function that returns a controlled stop of every joint and its identifier.
    pub(super) fn stop(&self) -> impl Fn() -> (MotionId, Option<Arc<Trajectory>>) + Send + 'static {
        let NodeSetup { joint_limits, period, node_config, .. } = self.setup;
        let stop = stop_of_all_joints(joint_limits, *period, node_config.max_points);
        let ids = self.ids.clone();
        move || (ids.next(), stop.clone())
    }

    /// Starts `~/reset`, `~/stop`, `~/feed_hold`, `~/cycle_start`, `~/query_state` and the parameter services. Returns the
    /// task that serves the parameters.
    pub(super) fn start_services(
        &self,
        node: &Node,
        parameter_services: ParameterServices,
        parameters: Parameters,
        clock: ClockSubscription,
        tasks: &mut JoinSet<()>,
    ) -> Result<AbortHandle, NodeError> {
        let commands = self.commands.clone();
        let reset = TriggerService::new(node, self.args, &RESET)?;
        tasks.spawn(reset.serve(move || reset_axes(commands.clone())));
        let (commands, stop) = (self.commands.clone(), self.stop());
        let act = move || {
            let (id, stop) = stop();
            stop_axes(commands.clone(), id, stop)
        };
        tasks.spawn(TriggerService::new(node, self.args, &STOP)?.serve(act));
        for (service, is_held) in [(&FEED_HOLD, true), (&CYCLE_START, false)] {
            let commands = self.commands.clone();
            let service = TriggerService::new(node, self.args, service)?;
            tasks.spawn(service.serve(move || set_feed_hold(commands.clone(), is_held)));
        }
        let query_state = QueryStateService::new(node, self.args)?;
        tasks.spawn(query_state.serve(self.setup.joints.clone(), self.commands.clone()));
        let health = self.health.clone();
        let now = move || stamp(health.borrow().time);
        let set_clock = clock_change(clock, self.commands.clone());
        let mut host =
            NodeParameterHost::new(parameters, self.commands.clone(), Arc::clone(&self.live), set_clock);
        Ok(tasks.spawn(async move { parameter_services.serve(&mut host, now, pending()).await }))
    }

    /// Returns the constant contents of the diagnostics.
    pub(super) fn diagnostics(&self, node: &Node, other_clocks: Arc<AtomicUsize>) -> Diagnostics {
        Diagnostics {
            node: self.args.node().to_string(),
            machine: self.setup.config.name().to_owned(),
            joints: self.setup.joints.clone(),
            endpoints: node.endpoint_counts(),
            other_clocks,
        }
    }

    /// Publishes the simulation's reports until their sender is dropped.
    pub(super) async fn publish_reports(
        results: Arc<TrajectoryResults>,
        mut reports: mpsc::UnboundedReceiver<SimulationReport>,
    ) {
        while let Some(report) = reports.recv().await {
            results.publish(report).await;
        }
    }

    /// Deactivates the axes of a managed node. The thread executes it before its first position cycle.
    pub(super) async fn deactivate(&self) {
        let (done, _) = oneshot::channel();
        let deactivate = Command::Deactivate { id: self.ids.next(), stop: None, done };
        _ = self.commands.send(deactivate).await;
    }
}
