//! Summary that the node prints at its start.

use std::io::Write;

use crate::ros::topics::TopicFactory;
use crate::ros_interface::{ACTIONS, SERVICES, TopicDirection};
use crate::validation::args::RosArgs;
use virtual_axes_core::config::TimeMode;

/// Returns the names of topics, services and actions, one a line.
pub(super) fn start_screen(
    args: &RosArgs,
    topics: &TopicFactory<'_>,
    machine: &str,
    mode: TimeMode,
) -> String {
    let time = match mode {
        TimeMode::Fast => "fast (limited by subscribers)",
        TimeMode::SimTime => "/clock",
        TimeMode::Real => "real",
    };
    // Every node has parameter services.
    let services = SERVICES.iter().filter(|service| service.package != "rcl_interfaces");
    let mut screen = format!("{}: {machine}, time: {time}\n", args.node());
    for (label, names) in [
        ("subscribes", topics.names(TopicDirection::In)),
        ("publishes", topics.names(TopicDirection::Out)),
        ("services", services.filter_map(|service| args.resolve_service(&service.name()).ok()).collect()),
        ("actions", ACTIONS.iter().filter_map(|action| args.resolve_service(action.name).ok()).collect()),
    ] {
        for (index, name) in names.iter().enumerate() {
            screen += &format!("  {:<11}{name}\n", if index == 0 { label } else { "" });
        }
    }
    screen + "  and the parameter services; stop with Ctrl-C\n"
}

/// Prints the summary to stdout; a closed stdout does not stop the node.
pub(super) fn print(screen: &str) {
    let _ = std::io::stdout().write_all(screen.as_bytes());
}
