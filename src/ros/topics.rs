//! Topics of the node, and the summary that it prints at start.

use std::io::Write;

use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;

use super::args::RosArgs;
use super::endpoints::{EndpointError, Endpoints, Publisher, Subscription};
use crate::interface;
use virtual_axes_core::config::TimeMode;
use virtual_axes_io::messages::{
    DriveStates, JointTrajectoryControllerState, MotorCurrents, SpeedScalingFactor, TrajectoryResult,
};

/// Publishers and subscriptions of the node.
pub struct Topics {
    /// Subscriptions.
    pub subscriptions: TopicSubscriptions,
    /// Publishers.
    pub publishers: TopicPublishers,
    /// Resolved names.
    pub names: GraphNames,
}

/// Subscriptions of the node.
pub struct TopicSubscriptions {
    /// Subscription `psec`.
    pub psec: Subscription<JointTrajectory>,
    /// Subscription `psec_stream`.
    pub psec_stream: Subscription<JointState>,
    /// Subscription `~/speed_scaling_input`.
    pub feed_override: Subscription<SpeedScalingFactor>,
    /// Subscription `load`.
    pub load: Subscription<JointState>,
    /// Subscription `/clock` and its resolved name, in `fast` and with `use_sim_time`.
    pub clock: Option<(Subscription<Clock>, String)>,
}

/// Publishers of the node.
pub struct TopicPublishers {
    /// Publisher `joint_states`.
    pub joint_states: Publisher<JointState>,
    /// Publisher `~/motor_currents`.
    pub motor_currents: Publisher<MotorCurrents>,
    /// Publisher `~/drive_states`.
    pub drive_states: Publisher<DriveStates>,
    /// Publisher `~/controller_state`.
    pub controller_state: Publisher<JointTrajectoryControllerState>,
    /// Publisher `~/trajectory_result`.
    pub results: Publisher<TrajectoryResult>,
    /// Publisher `/diagnostics`.
    pub diagnostics: Publisher<DiagnosticArray>,
    /// Publisher `/clock`, in `fast` only.
    pub clock: Option<Publisher<Clock>>,
}

/// Resolved names for the summary at start.
pub struct GraphNames {
    subscribed: Vec<String>,
    published: Vec<String>,
    services: Vec<String>,
    /// Names of the actions.
    pub actions: Vec<String>,
}

impl Topics {
    /// Creates all topics. In real time there is no `/clock`; its publisher exists in `fast` only.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic that cannot be created.
    pub fn create(
        endpoints: &mut Endpoints<'_>,
        args: &RosArgs,
        time: TimeMode,
    ) -> Result<Self, EndpointError> {
        let (psec, psec_name) = endpoints.subscription(&interface::PSEC)?;
        let (psec_stream, stream_name) = endpoints.subscription(&interface::PSEC_STREAM)?;
        let (feed_override, override_name) = endpoints.subscription(&interface::SPEED_SCALING_INPUT)?;
        let (load, load_name) = endpoints.subscription(&interface::LOAD)?;
        let (joint_states, joint_states_name) = endpoints.publisher(&interface::JOINT_STATES)?;
        let (motor_currents, currents_name) = endpoints.publisher(&interface::MOTOR_CURRENTS)?;
        let (drive_states, states_name) = endpoints.publisher(&interface::DRIVE_STATES)?;
        let (controller_state, controller_name) = endpoints.publisher(&interface::CONTROLLER_STATE)?;
        let (results, results_name) = endpoints.publisher(&interface::TRAJECTORY_RESULT)?;
        let (diagnostics, diagnostics_name) = endpoints.publisher(&interface::DIAGNOSTICS)?;
        let clock = match time {
            TimeMode::Fast => Some(endpoints.publisher(&interface::CLOCK)?),
            TimeMode::Real | TimeMode::SimTime => None,
        };
        let clock_input = match time {
            TimeMode::Fast | TimeMode::SimTime => Some(endpoints.subscription(&interface::CLOCK_INPUT)?),
            TimeMode::Real => None,
        };
        let names = GraphNames {
            subscribed: [psec_name, stream_name, override_name, load_name]
                .into_iter()
                .chain(clock_input.iter().map(|(_, name)| name.clone()))
                .collect(),
            published: [
                joint_states_name,
                currents_name,
                states_name,
                controller_name,
                results_name,
                diagnostics_name,
            ]
            .into_iter()
            .chain(clock.iter().map(|(_, name)| name.clone()))
            .collect(),
            // Every node has parameter services.
            services: interface::SERVICES
                .iter()
                .filter(|service| service.package != "rcl_interfaces")
                .filter_map(|service| args.resolve_service(&service.name()).ok())
                .collect(),
            actions: Vec::new(),
        };
        let subscriptions = TopicSubscriptions { psec, psec_stream, feed_override, load, clock: clock_input };
        let publishers = TopicPublishers {
            joint_states,
            motor_currents,
            drive_states,
            controller_state,
            results,
            diagnostics,
            clock: clock.map(|(publisher, _)| publisher),
        };
        Ok(Topics { subscriptions, publishers, names })
    }
}

impl GraphNames {
    /// Adds names of publishers that are not in [`Topics`].
    pub fn add_published(&mut self, names: &[String]) {
        self.published.extend_from_slice(names);
    }

    /// Prints the summary to stdout.
    pub fn print(&self, args: &RosArgs, machine: &str, time: TimeMode) {
        let time = match time {
            TimeMode::Fast => "fast (limited by subscribers)",
            TimeMode::SimTime => "/clock",
            TimeMode::Real => "real",
        };
        let mut screen = format!("{}: {machine}, time: {time}\n", args.node());
        for (label, names) in [
            ("subscribes", &self.subscribed),
            ("publishes", &self.published),
            ("services", &self.services),
            ("actions", &self.actions),
        ] {
            for (index, name) in names.iter().enumerate() {
                screen += &format!("  {:<11}{name}\n", if index == 0 { label } else { "" });
            }
        }
        screen += "  and the parameter services; stop with Ctrl-C\n";
        // A closed stdout does not stop the node.
        let _ = std::io::stdout().write_all(screen.as_bytes());
    }
}
