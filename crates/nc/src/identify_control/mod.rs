//! Profile of a control, from a part program and the setpoints that the control made of it, or the positions of the axes
//! (`recorded_positions`).
//!
//! 1. Each sample of the log is assigned to a motion of the program (`track`).
//! 2. Ramps from rest to a constant speed show acceleration, jerk limit and filters of the axes (`axes`, `ramp`, `law`).
//! 3. Corners show path and speed (`corner`, `corner_rule`), circles the parts of the acceleration across and along the path
//!    (`arcs`), rows of short lines the block cycle and the look-ahead (`blocks`), dwells the wait at standstills
//!    (`standstill`).
//!
//! All values are in closed form from the log; the planner has no part in them.

mod arcs;
mod axes;
mod blocks;
mod corner;
mod corner_rule;
mod law;
mod log;
mod probe;
mod ramp;
mod recorded_positions;
mod standstill;
mod track;

use virtual_axes_core::config::MachineConfig;

pub use self::log::ControlLog;
pub use self::probe::probe_program;

use self::arcs::identify_circles;
use self::axes::Axes;
use self::blocks::identify_blocks;
use self::corner_rule::identify_corners;
use self::law::{ControlEstimate, Smoothing};
use self::standstill::{identify_ends, identify_wait};
use self::track::{Track, motions};
use crate::motion::ProgramStep;

/// Identified parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlValue {
    /// Key of the parameter.
    pub key: String,
    /// Value, in the unit of the parameter.
    pub value: f64,
    /// Half width of its interval of 95 %.
    pub half_width: f64,
    /// Unit.
    pub unit: &'static str,
    /// Number of motions that show it.
    pub count: usize,
}

/// Profile of a control.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ControlIdentification {
    /// Numbers.
    pub values: Vec<ControlValue>,
    /// Choices: key, value and reason.
    pub choices: Vec<(String, String, String)>,
    /// Properties that the program cannot show, each with the remedy.
    pub not_shown: Vec<String>,
    /// Time from the first to the last motion in the log, s.
    pub motion_time: f64,
    /// Number of motions of the program.
    pub motions: usize,
}

impl ControlIdentification {
    fn push(&mut self, key: impl Into<String>, estimate: ControlEstimate, factor: f64, unit: &'static str) {
        self.values.push(ControlValue {
            key: key.into(),
            value: estimate.value / factor,
            half_width: estimate.half_width / factor,
            unit,
            count: estimate.count,
        });
    }
}

/// Identifies the profile of a control from the steps of a program and the setpoints that it made of them.
///
/// # Errors
///
/// Returns an error if the program is invalid, or if the log is not one of it.
pub fn identify_control<E: std::fmt::Display>(
    steps: impl Iterator<Item = Result<ProgramStep, E>>,
    machine: &MachineConfig,
    log: &ControlLog,
) -> Result<ControlIdentification, String> {
    let track = Track::new(log, motions(steps)?)?;
    let mut found =
        ControlIdentification { motions: track.motions.len(), ..ControlIdentification::default() };
    found.motion_time = motion_time(&track);
    let axes = Axes::new(machine, &track);
    axes.identify(&mut found);
    if let Some(law) = &axes.law {
        identify_corners(&track, law, &mut found);
        identify_circles(&track, law, &mut found);
        identify_blocks(&track, law, &mut found);
        identify_ends(&track, law, &mut found);
    }
    identify_wait(&track, &axes, &mut found);
    if log.accuracy.is_estimated() {
        for value in &mut found.values {
            value.half_width = value.half_width.hypot(OF_DRIVES * value.value);
        }
        let hidden = match axes.law.as_ref().map(|law| &law.smoothing) {
            Some(Smoothing::None(_)) => Some("filters as short as those of the drives"),
            Some(Smoothing::Filters(stages)) if stages.len() == 1 => {
                Some("a second filter below a third of the first")
            }
            _ => None,
        };
        found.not_shown.extend(
            hidden.map(|what| format!("{what}: recorded positions do not show them beside the drives")),
        );
    }
    Ok(found)
}

/// Relative uncertainty of values from recorded positions, by drives that differ from those of the machine.
const OF_DRIVES: f64 = 0.01;

/// Returns the time from the first to the last change of a position, s.
fn motion_time(track: &Track<'_>) -> f64 {
    let moving = |sample: &usize| !track.is_at_rest[*sample];
    let mut samples = 0..track.is_at_rest.len();
    let first = samples.find(moving);
    let last = samples.rfind(moving).or(first);
    match (first, last) {
        // The first sample is at rest until the end of its window.
        (Some(first), Some(last)) => {
            (last + 2).saturating_sub(first + track.log.accuracy.window) as f64 * track.log.period
        }
        _ => 0.0,
    }
}
