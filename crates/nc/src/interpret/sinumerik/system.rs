//! System variables: values of the control that programs read and write.

use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::super::error::Outcome;
use super::super::state::State;
use super::super::tools::Tool;
use super::expression::Names;
use super::frame::AxisFrame;
use super::modes::{Modes, active_tool};
use super::value::ProgramValue;
use super::variables::Variables;
use crate::motion::{AXIS_COUNT, Coordinates, is_rotary};

/// Largest number of a tool in the tool data.
const MAX_TOOL: f64 = 1e6;
/// Largest number of a settable frame: G599.
const MAX_SETTABLE: f64 = 99.0;

/// Names that the expressions of a program refer to.
#[derive(Debug, Clone, Copy)]
pub(super) struct NameScope<'a> {
    pub variables: &'a Variables,
    pub modes: &'a Modes,
    pub state: &'a State,
}

impl Names for NameScope<'_> {
    fn variable(&self, name: &str, indices: &[ProgramValue]) -> Outcome<ProgramValue> {
        if name.starts_with('$') {
            return self.system(name, indices);
        }
        self.variables.value(name, indices)?.ok_or_else(|| {
            format!("{name} has no value: add DEF REAL {name} and a setting, or the data of the machine that it belongs to")
        })
    }

    fn is_defined(&self, name: &str) -> bool {
        self.variables.is_defined(name)
    }
}

impl NameScope<'_> {
    /// Returns the number of a variable.
    pub(super) fn number(&self, name: &str, indices: &[ProgramValue]) -> Outcome<f64> {
        self.variable(name, indices)?.number()
    }

    /// Returns a system variable; lengths in mm, angles in degrees.
    fn system(&self, name: &str, indices: &[ProgramValue]) -> Outcome<ProgramValue> {
        let state = self.state;
        let number = |value: f64| Ok(ProgramValue::Number(value));
        let of_axis = |coordinates: &Coordinates| match indices {
            [ProgramValue::Axis(axis)] => Ok(ProgramValue::Number(coordinates[*axis] / unit(*axis))),
            _ => Err(format!("{name} requires an axis in brackets, as {name}[X]")),
        };
        match name {
            "$AA_IM" | "$VA_IM" | "$AA_MM" => {
                let transform = state.options.kinematics.as_ref();
                let length = state.modal.tcp_length;
                of_axis(
                    &transform
                        .map_or(state.position, |transform| transform.positions(&state.position, length)),
                )
            }
            "$AA_IW" | "$P_EP" | "$AA_IBN" | "$AA_IEN" | "$AA_IB" => of_axis(&state.programmed()),
            "$P_TOOLNO" | "$P_MTHSDC" => number(f64::from(active_tool(state))),
            "$P_TOOLP" => number(f64::from(state.modal.selected_tool)),
            "$P_TOOL" => number(f64::from(self.modes.edge)),
            "$P_TOOLL" => {
                let is_length_1 = matches!(indices, [ProgramValue::Number(1.0)]);
                let length = state.modal.tcp_length.unwrap_or(state.offsets.tool_length);
                number(if is_length_1 { length / MILLIMETER } else { 0.0 })
            }
            "$P_TOOLR" => number(self.tool(active_tool(state)).radius / MILLIMETER),
            "$TC_DP3" | "$TC_DP6" => match indices {
                [ProgramValue::Number(tool), ProgramValue::Number(_)] => {
                    let tool = self.tool(tool_number(name, *tool)?);
                    number(if name == "$TC_DP3" { tool.length } else { tool.radius } / MILLIMETER)
                }
                _ => Err(format!("{name} requires tool and cutting edge in brackets, as {name}[1,1]")),
            },
            "$P_UIFR" => self.settable(indices),
            "$P_PFRAME" | "$P_ACTFRAME" if indices.is_empty() => {
                Ok(ProgramValue::CoordinateFrame(Box::new(self.modes.frame)))
            }
            "$P_PFRAME" => match indices {
                [ProgramValue::Axis(axis), ProgramValue::Text(component)] if component == "FI" => {
                    number(self.modes.frame.fine[*axis] / unit(*axis))
                }
                _ => component(&self.modes.frame.offset, indices),
            },
            "$P_F" => number(state.modal.feed_word),
            "$P_S" | "$AA_S" => number(state.modal.spindle_speed),
            "$P_SDIR" => number(match state.modal.spindle_direction {
                direction if direction > 0.0 => 3.0,
                direction if direction < 0.0 => 4.0,
                _ => 5.0,
            }),
            "$P_SIM" | "$P_SEARCH" | "$P_SEARCHL" | "$P_DRYRUN" | "$P_PROGTEST" | "$P_ISTEST"
            | "$AN_SLTRACE" => number(0.0),
            "$P_SUBPAR" => number(1.0),
            "$P_METRIC" | "$MN_SCALING_SYSTEM_IS_METRIC" => number(1.0),
            "$P_STACK" => number(state.calls as f64),
            "$AC_TIME" | "$AC_TIMER" | "$AC_ACTUAL_PARTS" | "$AC_TOTAL_PARTS" | "$AC_REQUIRED_PARTS"
            | "$AC_CYCLE_TIME" | "$AC_OPERATING_TIME" | "$A_DBB" | "$A_DBW" | "$A_DBD" | "$A_DBR"
            | "$A_IN" | "$A_INA" | "$A_OUT" | "$AC_MARKER" | "$AC_PARAM" => number(0.0),
            _ => Err(format!(
                "{name} is not supported; supported: $P_TOOLNO $P_TOOL $P_TOOLL $P_TOOLR $TC_DP3 $TC_DP6 $P_UIFR $P_PFRAME \
                 $AA_IM $AA_IW $P_EP $P_F $P_S, and timers, inputs and PLC data as 0"
            )),
        }
    }

    fn tool(&self, number: u32) -> Tool {
        let default = self.state.options.default_tool_length.unwrap_or(0.0);
        let unknown = || Tool { length: default, ..Tool::default() };
        self.state.options.tools.get(number).cloned().unwrap_or_else(unknown)
    }

    fn settable(&self, indices: &[ProgramValue]) -> Outcome<ProgramValue> {
        let (number, indices) = settable_number(indices)?;
        let offset = settable_offset(number, self.state);
        match indices {
            [] => Ok(ProgramValue::CoordinateFrame(Box::new(AxisFrame::translation(offset)))),
            indices => component(&offset, indices),
        }
    }
}

/// Sets a system variable; returns false for one without effect on the motions.
pub(super) fn set_system(
    name: &str,
    indices: &[ProgramValue],
    value: ProgramValue,
    modes: &mut Modes,
    state: &mut State,
) -> Outcome<bool> {
    match name {
        "$P_UIFR" => {
            let (number, indices) = settable_number(indices)?;
            let mut offset = settable_offset(number, state);
            match (indices, value) {
                ([], ProgramValue::CoordinateFrame(frame)) if frame.is_translation() => {
                    offset = frame.total()
                }
                ([], ProgramValue::CoordinateFrame(_)) => {
                    return Err(
                        "$P_UIFR: a rotated or scaled settable frame is not supported; program ROT or SCALE"
                            .to_owned(),
                    );
                }
                ([ProgramValue::Axis(axis), ProgramValue::Text(component)], ProgramValue::Number(value)) => {
                    match component.as_str() {
                        "TR" => offset[*axis] = value * unit(*axis),
                        "FI" => offset[*axis] += value * unit(*axis),
                        _ if value == 0.0 => {}
                        _ => {
                            return Err(format!(
                                "$P_UIFR[…,{component}]: only TR and FI are supported; program ROT, SCALE or MIRROR"
                            ));
                        }
                    }
                }
                _ => return Err("$P_UIFR requires number, axis and TR, or a frame".to_owned()),
            }
            if let Some(slot) = (number as usize).checked_sub(1) {
                state.options.work_offsets[slot] = offset;
                if let Some(given) = &mut state.options.given_work_offsets {
                    given.insert(slot);
                }
            }
            modes.update_frame(state)?;
            Ok(true)
        }
        "$P_PFRAME" => {
            match (indices, value) {
                ([], ProgramValue::CoordinateFrame(frame)) => modes.frame = *frame,
                ([ProgramValue::Axis(axis), ProgramValue::Text(component)], ProgramValue::Number(value))
                    if component == "TR" =>
                {
                    modes.frame.offset[*axis] = value * unit(*axis);
                }
                _ => return Err("$P_PFRAME requires a frame, or axis and TR".to_owned()),
            }
            modes.update_frame(state)?;
            Ok(true)
        }
        "$TC_DP3" | "$TC_DP6" => {
            let [ProgramValue::Number(tool), ProgramValue::Number(edge)] = indices else {
                return Err(format!("{name} requires tool and cutting edge in brackets, as {name}[1,1]"));
            };
            let number = tool_number(name, *tool)?;
            let value = value.number()? * MILLIMETER;
            if *edge != 1.0 {
                return Ok(false);
            }
            let default = state.options.default_tool_length.unwrap_or(0.0);
            let known = state.options.tools.get(number).cloned();
            let mut tool = known.unwrap_or_else(|| Tool { length: default, ..Tool::default() });
            if name == "$TC_DP3" {
                tool.length = value
            } else {
                tool.radius = value
            }
            state.options.tools.insert(number, tool);
            if active_tool(state) == number {
                modes.update_tool_length(state)?;
            }
            Ok(true)
        }
        // Axis of the tool length in all planes, by the plane of which it is the normal.
        "$SC_TOOL_LENGTH_CONST" => {
            let axis = match value.number()?.abs() {
                0.0 => None,
                18.0 => Some(1),
                19.0 => Some(0),
                _ => Some(2),
            };
            if axis != state.offsets.length_axis {
                state.finish_contour()?;
                state.offsets.length_axis = axis;
            }
            Ok(true)
        }
        _ => Ok(false),
    }
}

fn settable_number(indices: &[ProgramValue]) -> Outcome<(u32, &[ProgramValue])> {
    match indices {
        [ProgramValue::Number(number), rest @ ..] if (0.0..=MAX_SETTABLE).contains(number) => {
            Ok((number.round() as u32, rest))
        }
        _ => Err(format!("$P_UIFR requires its number in brackets, 0 to {MAX_SETTABLE}: $P_UIFR[1] is G54")),
    }
}

/// Returns the offset of a settable frame, m and rad: 1 is G54, 5 is G505; 0 is none.
fn settable_offset(number: u32, state: &State) -> Coordinates {
    let index = (number as usize).checked_sub(1);
    index.and_then(|index| state.options.work_offsets.get(index)).copied().unwrap_or([0.0; AXIS_COUNT])
}

fn component(offset: &Coordinates, indices: &[ProgramValue]) -> Outcome<ProgramValue> {
    match indices {
        [ProgramValue::Axis(axis), ProgramValue::Text(component)] if component == "TR" => {
            Ok(ProgramValue::Number(offset[*axis] / unit(*axis)))
        }
        [ProgramValue::Axis(_), ProgramValue::Text(component)] => {
            Ok(ProgramValue::Number(f64::from(component == "SC")))
        }
        _ => Err("a frame requires axis and component, as [X,TR]".to_owned()),
    }
}

fn tool_number(name: &str, number: f64) -> Outcome<u32> {
    match (0.0..=MAX_TOOL).contains(&number) {
        true => Ok(number.round() as u32),
        false => Err(format!("{name}[{number}]: the number of a tool must be between 0 and {MAX_TOOL}")),
    }
}

fn unit(axis: usize) -> f64 {
    debug_assert!(axis < AXIS_COUNT);
    if is_rotary(axis) { DEGREE } else { MILLIMETER }
}
