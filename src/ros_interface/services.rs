//! Services of the node.

use virtual_axes_io::messages::CONTROL_PACKAGE;

use super::description::NodeService;

/// Defines a constant for each service, and the list of all: name, package, type and content.
macro_rules! services {
    ($list:ident, $about:literal: $($const:ident = $label:literal, $package:expr, $service:literal, $content:literal;)*) => {
        $(
            #[doc = concat!("Service `", $label, "`: ", $content, ".")]
            pub const $const: NodeService =
                NodeService { label: $label, package: $package, service: $service, content: $content };
        )*
        #[doc = $about]
        pub const $list: &[NodeService] = &[$($const),*];
    };
}

services! {
    SERVICES, "All services, those of the action and of the lifecycle excluded.":
    RESET = "reset", "std_srvs", "Trigger", "resets all axes to rest at home";
    STOP = "stop", "std_srvs", "Trigger", "controlled stop of every axis within its limits";
    FEED_HOLD = "feed_hold", "std_srvs", "Trigger",
        "feed hold: trajectories stop on their path within the limits of the axes";
    CYCLE_START = "cycle_start", "std_srvs", "Trigger", "continues the trajectories after a feed hold";
    QUERY_STATE = "query_state", CONTROL_PACKAGE, "QueryTrajectoryState",
        "setpoints of all joints planned at a time, rounded up to a position cycle; `success` is false at a \
         time at which no trajectory commands a joint, and the setpoints are those held then";
    LIST_PARAMETERS = "list_parameters", "rcl_interfaces", "ListParameters", "names of all parameters";
    DESCRIBE_PARAMETERS = "describe_parameters", "rcl_interfaces", "DescribeParameters",
        "type, description, unit and range of parameters, and if they are live";
    GET_PARAMETER_TYPES = "get_parameter_types", "rcl_interfaces", "GetParameterTypes", "types of parameters";
    GET_PARAMETERS = "get_parameters", "rcl_interfaces", "GetParameters", "values of parameters";
    SET_PARAMETERS = "set_parameters", "rcl_interfaces", "SetParameters", "sets live parameters one by one";
    SET_PARAMETERS_ATOMICALLY = "set_parameters_atomically", "rcl_interfaces", "SetParametersAtomically",
        "sets several live parameters in the same position cycle, or none";
}

services! {
    LIFECYCLE_SERVICES, "Services of a managed node (`--lifecycle`), besides [`SERVICES`].":
    CHANGE_STATE = "change_state", "lifecycle_msgs", "ChangeState", "executes a transition";
    GET_STATE = "get_state", "lifecycle_msgs", "GetState", "present state";
    GET_AVAILABLE_STATES = "get_available_states", "lifecycle_msgs", "GetAvailableStates", "all states";
    GET_AVAILABLE_TRANSITIONS = "get_available_transitions", "lifecycle_msgs", "GetAvailableTransitions",
        "transitions that are possible now";
    GET_TRANSITION_GRAPH = "get_transition_graph", "lifecycle_msgs", "GetAvailableTransitions", "all transitions";
}
