//! The node's topics, all of them, and what it says about itself when it starts.

use std::io::Write;

use ros2_client::MessageTypeName;
use ros2_interfaces_jazzy_serde::diagnostic_msgs::msg::DiagnosticArray;
use ros2_interfaces_jazzy_serde::rosgraph_msgs::msg::Clock;
use ros2_interfaces_jazzy_serde::sensor_msgs::msg::JointState;
use ros2_interfaces_jazzy_serde::trajectory_msgs::msg::JointTrajectory;

use super::args::RosArgs;
use super::endpoints::{EndpointError, Endpoints, Publisher, Subscription};
use virtual_axes_core::config::{QosConfig, TimeMode};
use virtual_axes_io::messages::{
    CONTROL_PACKAGE, DriveStates, JointTrajectoryControllerState, MotorCurrents, PACKAGE, TrajectoryResult,
};

/// Publishers of `/clock` may be reliable or not, and of what they say only the newest counts; the
/// depth is for several of them.
const CLOCK_QOS: QosConfig = QosConfig { reliable: false, transient_local: false, depth: 10 };

/// Every topic of the node.
pub struct Topics {
    /// `psec`.
    pub psec: Subscription<JointTrajectory>,
    /// `psec_stream`.
    pub psec_stream: Subscription<JointState>,
    /// `load`.
    pub load: Subscription<JointState>,
    /// `joint_states`.
    pub joint_states: Publisher<JointState>,
    /// `~/motor_currents`.
    pub motor_currents: Publisher<MotorCurrents>,
    /// `~/drive_states`.
    pub drive_states: Publisher<DriveStates>,
    /// `~/controller_state`.
    pub controller_state: Publisher<JointTrajectoryControllerState>,
    /// `~/trajectory_result`.
    pub results: Publisher<TrajectoryResult>,
    /// `/diagnostics`.
    pub diagnostics: Publisher<DiagnosticArray>,
    /// `/clock`, in `fast`.
    pub clock: Option<Publisher<Clock>>,
    /// `/clock` of others and its resolved name, in `fast` and with `use_sim_time`.
    pub clock_input: Option<(Subscription<Clock>, String)>,
    /// Resolved names.
    pub names: Names,
}

/// Names in the graph.
pub struct Names {
    subscribed: Vec<String>,
    published: Vec<String>,
    served: Vec<String>,
    /// Actions.
    pub goals_on: Vec<String>,
}

impl Topics {
    /// Creates them; `/clock` not in real time, and its publisher only in `fast`.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic that the middleware refuses.
    pub fn create(
        endpoints: &mut Endpoints<'_>,
        args: &RosArgs,
        time: TimeMode,
    ) -> Result<Self, EndpointError> {
        let joint_state = || MessageTypeName::new("sensor_msgs", "JointState");
        let trajectory = MessageTypeName::new("trajectory_msgs", "JointTrajectory");
        let diagnostic = MessageTypeName::new("diagnostic_msgs", "DiagnosticArray");
        let own = |name: &str| MessageTypeName::new(PACKAGE, name);

        let (psec, psec_name) = endpoints.subscription("psec", trajectory)?;
        let (psec_stream, stream_name) = endpoints.subscription("psec_stream", joint_state())?;
        let (load, load_name) = endpoints.subscription("load", joint_state())?;
        let (joint_states, joint_states_name) = endpoints.publisher("joint_states", joint_state())?;
        let (motor_currents, currents_name) =
            endpoints.publisher("~/motor_currents", own("MotorCurrents"))?;
        let (drive_states, states_name) = endpoints.publisher("~/drive_states", own("DriveStates"))?;
        let controller_type = MessageTypeName::new(CONTROL_PACKAGE, "JointTrajectoryControllerState");
        let (controller_state, controller_name) =
            endpoints.publisher("~/controller_state", controller_type)?;
        let (results, results_name) = endpoints.publisher("~/trajectory_result", own("TrajectoryResult"))?;
        let (diagnostics, diagnostics_name) = endpoints.publisher("/diagnostics", diagnostic)?;
        let clock_type = || MessageTypeName::new("rosgraph_msgs", "Clock");
        let clock = match time {
            TimeMode::Fast => Some(endpoints.publisher("/clock", clock_type())?),
            TimeMode::Real | TimeMode::SimTime => None,
        };
        let clock_input = match time {
            TimeMode::Fast | TimeMode::SimTime => {
                Some(endpoints.subscription_of("/clock", clock_type(), CLOCK_QOS)?)
            }
            TimeMode::Real => None,
        };
        let names = Names {
            subscribed: [psec_name, stream_name, load_name]
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
            served: ["~/reset", "~/stop"].iter().filter_map(|s| args.resolve_service(s).ok()).collect(),
            goals_on: Vec::new(),
        };
        Ok(Topics {
            psec,
            psec_stream,
            load,
            joint_states,
            motor_currents,
            drive_states,
            controller_state,
            results,
            diagnostics,
            clock: clock.map(|(publisher, _)| publisher),
            clock_input,
            names,
        })
    }
}

impl Names {
    /// Names that are published beside those of [`Topics`].
    pub fn also_publishes(&mut self, names: &[String]) {
        self.published.extend_from_slice(names);
    }

    /// One screen for whoever started the node.
    pub fn print(&self, args: &RosArgs, machine: &str, time: TimeMode) {
        let time = match time {
            TimeMode::Fast => "as fast as subscribers take it",
            TimeMode::SimTime => "of /clock",
            TimeMode::Real => "real",
        };
        let mut screen = format!("{}: {machine}, time: {time}\n", args.node());
        for (what, names) in [
            ("listens to", &self.subscribed),
            ("publishes", &self.published),
            ("serves", &self.served),
            ("goals on", &self.goals_on),
        ] {
            for (place, name) in names.iter().enumerate() {
                screen += &format!("  {:<11}{name}\n", if place == 0 { what } else { "" });
            }
        }
        screen += "  and the parameter services; stop it with Ctrl-C\n";
        // The node runs as well without anybody who reads it.
        let _ = std::io::stdout().write_all(screen.as_bytes());
    }
}
