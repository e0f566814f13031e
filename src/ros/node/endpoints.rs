//! Creation of the ROS node with its topics, services and action.

use ros2_client::Node;
use ros2_interfaces_jazzy_serde::rcl_interfaces::msg::Log;

use super::NodeError;
use super::setup::NodeSetup;
use crate::interface::{CYCLE_START, FEED_HOLD, RESET, STOP};
use crate::ros::action::{ActionServer, ActionTopics, TrajectoryGoals};
use crate::ros::args::RosArgs;
use crate::ros::endpoints::{Endpoints, Publisher};
use crate::ros::parameter_services::ParameterServices;
use crate::ros::program::ProgramGoals;
use crate::ros::query_state::QueryStateService;
use crate::ros::recorder::TopicRecorder;
use crate::ros::renewable::EndpointContext;
use crate::ros::rosout;
use crate::ros::tool::ToolTopics;
use crate::ros::topics::Topics;
use crate::ros::trigger::TriggerService;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_io::messages::{FollowJointTrajectoryFeedback, RunProgramFeedback};

/// ROS node with its topics, services and action.
pub(super) struct NodeEndpoints {
    pub(super) node: Node,
    pub(super) rosout: Option<Publisher<Log>>,
    pub(super) topics: Topics,
    pub(super) tool: Option<ToolTopics>,
    pub(super) action: ActionServer<TrajectoryGoals>,
    pub(super) action_topics: ActionTopics<FollowJointTrajectoryFeedback>,
    pub(super) program: ActionServer<ProgramGoals>,
    pub(super) program_topics: ActionTopics<RunProgramFeedback>,
    pub(super) services: NodeServices,
}

/// Services of the node.
pub(super) struct NodeServices {
    pub(super) reset: TriggerService,
    pub(super) stop: TriggerService,
    pub(super) feed_hold: TriggerService,
    pub(super) cycle_start: TriggerService,
    pub(super) query_state: QueryStateService,
    pub(super) parameters: ParameterServices,
}

impl NodeEndpoints {
    /// Creates the endpoints of `node` in `context`; `services` are its parameter services.
    ///
    /// # Errors
    /// [`NodeError`] naming the topic or service that cannot be created.
    pub(super) fn create(
        mut node: Node,
        services: ParameterServices,
        context: &EndpointContext,
        args: &RosArgs,
        parameters: &Parameters,
        setup: &NodeSetup,
        recorder: &mut TopicRecorder,
    ) -> Result<Self, NodeError> {
        let rosout = rosout::publisher(&mut node, &context.domain_participant(), args, recorder)?;
        let mut endpoints = Endpoints::new(&mut node, context, args, parameters, recorder);
        let mut topics = Topics::create(&mut endpoints, args, setup.mode)?;
        let tool = ToolTopics::create(&mut endpoints, Kinematics::new(&setup.config))?;
        topics.names.add_published(tool.as_ref().map_or(&[], |tool| &tool.names));
        let (action, action_topics) = ActionServer::new(&mut node, context, args)?;
        let (program, program_topics) = ActionServer::new(&mut node, context, args)?;
        topics.names.actions.extend([action_topics.name.clone(), program_topics.name.clone()]);
        let reset = TriggerService::new(&mut node, context, args, &RESET)?;
        let stop = TriggerService::new(&mut node, context, args, &STOP)?;
        let feed_hold = TriggerService::new(&mut node, context, args, &FEED_HOLD)?;
        let cycle_start = TriggerService::new(&mut node, context, args, &CYCLE_START)?;
        let query_state = QueryStateService::new(&mut node, context, args)?;
        let services =
            NodeServices { reset, stop, feed_hold, cycle_start, query_state, parameters: services };
        Ok(NodeEndpoints {
            node,
            rosout,
            topics,
            tool,
            action,
            action_topics,
            program,
            program_topics,
            services,
        })
    }
}
