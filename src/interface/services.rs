//! Services of the node.

use virtual_axes_io::messages::CONTROL_PACKAGE;

use super::NodeService;

/// Creates a parameter service of rcl_interfaces.
const fn parameters(label: &'static str, service: &'static str, content: &'static str) -> NodeService {
    NodeService { label, package: "rcl_interfaces", service, content }
}

/// Creates a service of lifecycle_msgs.
const fn lifecycle(label: &'static str, service: &'static str, content: &'static str) -> NodeService {
    NodeService { label, package: "lifecycle_msgs", service, content }
}

/// Creates a service of type std_srvs/Trigger.
const fn trigger(label: &'static str, content: &'static str) -> NodeService {
    NodeService { label, package: "std_srvs", service: "Trigger", content }
}

/// Service that resets the axes to rest at home.
pub const RESET: NodeService = trigger("reset", "resets all axes to rest at home");
/// Service that stops the axes within their limits.
pub const STOP: NodeService = trigger("stop", "controlled stop of every axis within its limits");

/// Service that stops the trajectories on their path.
pub const FEED_HOLD: NodeService =
    trigger("feed_hold", "feed hold: trajectories stop on their path within the limits of the axes");
/// Service that continues the trajectories after a feed hold.
pub const CYCLE_START: NodeService = trigger("cycle_start", "continues the trajectories after a feed hold");

/// Service that returns the setpoints planned at a time.
pub const QUERY_STATE: NodeService = NodeService {
    label: "query_state",
    package: CONTROL_PACKAGE,
    service: "QueryTrajectoryState",
    content: "setpoints of all joints planned at a time, rounded up to a position cycle; `success` is false at a time at \
              which no trajectory commands a joint, and the setpoints are those held then",
};

/// Service that lists the parameters.
pub const LIST_PARAMETERS: NodeService =
    parameters("list_parameters", "ListParameters", "names of all parameters");
/// Service that describes parameters.
pub const DESCRIBE_PARAMETERS: NodeService = parameters(
    "describe_parameters",
    "DescribeParameters",
    "type, description, unit and range of parameters, and if they are live",
);
/// Service that returns the types of parameters.
pub const GET_PARAMETER_TYPES: NodeService =
    parameters("get_parameter_types", "GetParameterTypes", "types of parameters");
/// Service that returns the values of parameters.
pub const GET_PARAMETERS: NodeService = parameters("get_parameters", "GetParameters", "values of parameters");
/// Service that sets parameters one by one.
pub const SET_PARAMETERS: NodeService =
    parameters("set_parameters", "SetParameters", "sets live parameters one by one");
/// Service that sets parameters together.
pub const SET_PARAMETERS_ATOMICALLY: NodeService = parameters(
    "set_parameters_atomically",
    "SetParametersAtomically",
    "sets several live parameters in the same position cycle, or none",
);

/// Service that executes a transition of a managed node.
pub const CHANGE_STATE: NodeService = lifecycle("change_state", "ChangeState", "executes a transition");
/// Service that returns the state of a managed node.
pub const GET_STATE: NodeService = lifecycle("get_state", "GetState", "present state");
/// Service that lists the states of a managed node.
pub const GET_AVAILABLE_STATES: NodeService =
    lifecycle("get_available_states", "GetAvailableStates", "all states");
/// Service that lists the transitions of a managed node that are possible.
pub const GET_AVAILABLE_TRANSITIONS: NodeService =
    lifecycle("get_available_transitions", "GetAvailableTransitions", "transitions that are possible now");
/// Service that lists all transitions of a managed node.
pub const GET_TRANSITION_GRAPH: NodeService =
    lifecycle("get_transition_graph", "GetAvailableTransitions", "all transitions");

/// Services of a managed node (`--lifecycle`), besides [`SERVICES`].
pub const LIFECYCLE_SERVICES: &[NodeService] =
    &[CHANGE_STATE, GET_STATE, GET_AVAILABLE_STATES, GET_AVAILABLE_TRANSITIONS, GET_TRANSITION_GRAPH];

/// All services, those of the action and of the lifecycle excluded.
pub const SERVICES: &[NodeService] = &[
    RESET,
    STOP,
    FEED_HOLD,
    CYCLE_START,
    QUERY_STATE,
    LIST_PARAMETERS,
    DESCRIBE_PARAMETERS,
    GET_PARAMETER_TYPES,
    GET_PARAMETERS,
    SET_PARAMETERS,
    SET_PARAMETERS_ATOMICALLY,
];
