//! Start of the node's outputs.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;
use rustdds::DomainParticipant;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;

use super::setup::NodeSetup;
use crate::ros::action::{FeedbackOutput, RunningGoal, feedback_period};
use crate::ros::clock::{ClockOutput, ClockState};
use crate::ros::endpoints::Publisher;
use crate::ros::fan_out::FanOut;
use crate::ros::goal_event::GoalEvent;
use crate::ros::matched_subscriptions::MatchedSubscriptionTracker;
use crate::ros::outputs::{Output, OutputFactory};
use crate::ros::overflow::OverflowPolicy;
use crate::ros::program::{ProgramFeedbackOutput, ProgramGoalEvent, RunningProgram};
use crate::ros::recorder::Tap;
use crate::ros::results::TrajectoryResults;
use crate::ros::tool::ToolTopics;
use crate::ros::topic_writers::TopicWriters;
use crate::ros::topics::TopicPublishers;
use crate::ros::writer_rotation::RotatedTopics;
use virtual_axes_core::units::seconds;
use virtual_axes_io::messages::action_msgs::msg::GoalStatusArray;
use virtual_axes_io::messages::{FeedbackMessage, RunProgramFeedback};

/// Publishers whose outputs are started.
pub(super) struct NodePublishers {
    pub(super) rosout: Option<Publisher<Log>>,
    pub(super) topics: TopicPublishers,
    pub(super) tool: Option<ToolTopics>,
    pub(super) action_status: Publisher<GoalStatusArray>,
    pub(super) action_feedback: Publisher<FeedbackMessage>,
    pub(super) program_status: Publisher<GoalStatusArray>,
    pub(super) program_feedback: Publisher<FeedbackMessage<RunProgramFeedback>>,
}

/// Outputs of the node, with what their background tasks need.
pub(super) struct NodeOutputs {
    /// Writers and tap of `/rosout`, if it is enabled.
    pub(super) rosout: Option<(Arc<TopicWriters<Log>>, Tap<Log>)>,
    pub(super) fan_out: FanOut,
    pub(super) results: Arc<TrajectoryResults>,
    pub(super) diagnostics: Output<DiagnosticArray>,
    pub(super) action: ActionOutputs,
    pub(super) program: ProgramOutputs,
    pub(super) tracker: MatchedSubscriptionTracker,
    pub(super) rotated: RotatedTopics,
}

/// Outputs of the action server, and the events of its goals.
pub(super) struct ActionOutputs {
    pub(super) status: Output<GoalStatusArray>,
    pub(super) running: watch::Sender<Arc<[RunningGoal]>>,
    pub(super) events: mpsc::UnboundedReceiver<GoalEvent>,
}

/// Outputs of the server of part programs, and the events of its goals.
pub(super) struct ProgramOutputs {
    pub(super) status: Output<GoalStatusArray>,
    pub(super) running: watch::Sender<Arc<[RunningProgram]>>,
    pub(super) events: mpsc::UnboundedReceiver<ProgramGoalEvent>,
}

/// Starts the publishing tasks in `tasks`, one per topic; `dropped` counts dropped messages.
pub(super) fn start_outputs(
    publishers: NodePublishers,
    participant: &DomainParticipant,
    setup: &NodeSetup,
    clock: &watch::Receiver<ClockState>,
    dropped: &Arc<AtomicU64>,
    tasks: &mut JoinSet<()>,
) -> NodeOutputs {
    let NodePublishers {
        rosout,
        topics,
        tool,
        action_status,
        action_feedback,
        program_status,
        program_feedback,
    } = publishers;
    let NodeSetup { node_config, overflow, result_overflow, .. } = setup;
    let mut tracker = MatchedSubscriptionTracker::default();
    let mut rotated = RotatedTopics::default();
    let (tracker_in, rotated_in) = (&mut tracker, &mut rotated);
    let mut factory = OutputFactory { participant, dropped, tracker: tracker_in, tasks, rotated: rotated_in };
    let rosout = rosout.map(|publisher| factory.writers(publisher));
    let (goal_events, events) = mpsc::unbounded_channel();
    let (program_events, program_updates) = mpsc::unbounded_channel();
    let results = TrajectoryResults::new(
        factory.start(topics.results, *result_overflow),
        setup.joint_limits.clone(),
        goal_events,
        program_events,
        node_config.max_points,
    );
    let diagnostics = factory.start(topics.diagnostics, OverflowPolicy::Drop);
    let (running, goals) = watch::channel(Arc::from([]));
    let status = factory.start(action_status, *result_overflow);
    let every = feedback_period(node_config.action_monitor_rate, setup.period);
    let (running_program, programs) = watch::channel(Arc::from([]));
    let program = ProgramOutputs {
        status: factory.start(program_status, *result_overflow),
        running: running_program,
        events: program_updates,
    };
    let fan_out = FanOut {
        joint_states: factory.start(topics.joint_states, *overflow),
        motor_currents: factory.start(topics.motor_currents, *overflow),
        drive_states: factory.start(topics.drive_states, *overflow),
        controller_state: factory.start(topics.controller_state, *overflow),
        feedback: FeedbackOutput {
            goals,
            output: factory.start(action_feedback, *overflow),
            joints: setup.joints.clone(),
            every,
        },
        program: ProgramFeedbackOutput {
            programs,
            output: factory.start(program_feedback, *overflow),
            joints: setup.joints.clone(),
            every,
        },
        tool: tool.map(|tool| tool.start(&mut factory, node_config.tool.clone(), *overflow)),
        clock: topics.clock.map(|publisher| ClockOutput {
            output: factory.start(publisher, *overflow),
            state: clock.clone(),
        }),
        joints: setup.joints.clone(),
        every: publication_period(setup),
    };
    let action = ActionOutputs { status, running, events };
    let results = Arc::new(results);
    NodeOutputs { rosout, fan_out, results, diagnostics, action, program, tracker, rotated }
}

/// Returns the number of position cycles between publications, at least 1.
fn publication_period(setup: &NodeSetup) -> i64 {
    let period = seconds(setup.period);
    setup.node_config.publish_rate.map_or(1, |rate| (1.0 / (rate * period)).round() as i64).max(1)
}
