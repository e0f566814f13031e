//! Summary of a part program that was surveyed: motions, lengths and extents.

use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::text::escaped;
use virtual_axes_core::units::{MILLIMETER, Rounded};
use virtual_axes_nc::offline::ProgramSurvey;

use crate::input::program_text::joint_line;
use crate::output::text_table::wrapped_line;

/// Returns the summary of a part program.
pub fn summary(survey: &ProgramSurvey, machine: &MachineConfig) -> String {
    let ProgramSurvey { rapids, lines, arcs, splines, length, start, end, ranges, .. } = survey;
    let shortest = match survey.shortest.is_finite() {
        true => format!(", shortest motion {} mm", Rounded(survey.shortest / MILLIMETER)),
        false => String::new(),
    };
    let joints = machine.axes().iter().enumerate().filter(|(joint, _)| ranges[*joint][1] > ranges[*joint][0]);
    let joints: String = joints
        .map(|(joint, axis)| joint_line(axis, [start[joint], end[joint]], ranges[joint], None))
        .collect();
    let time = format!(
        "part program for {}: {:.3} s at the programmed feed, without rapid traverse and acceleration",
        escaped(machine.name()),
        survey.time
    );
    let motions = format!(
        "motions: {rapids} rapid, {lines} lines, {arcs} arcs, {splines} splines; {} m at feed{shortest}",
        Rounded(*length)
    );
    wrapped_line(&time) + &wrapped_line(&motions) + &joints
}
