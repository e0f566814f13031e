//! Variables of the control in macro B, from #1000 on: positions, offsets, tools and modes.

use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::codes::{Motion, PlaneCode};
use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::{ADDITIONAL_OFFSET_COUNT, WORK_OFFSET_COUNT};
use super::okuma::WORK_OFFSETS;
use super::state::State;
use crate::motion::{AXIS_COUNT, Plane, ProgramEvent, is_rotary};

/// Variable that raises an alarm.
pub(super) const ALARM: usize = 3000;
/// Number of work coordinate systems.
const SYSTEMS: usize = WORK_OFFSET_COUNT + ADDITIONAL_OFFSET_COUNT;

/// Quantity that a variable of the control gives access to.
enum Quantity {
    /// Index of a work offset, and axis.
    WorkOffset(usize, usize),
    /// Tool length of a tool.
    ToolLength(u32),
    /// Tool radius of a tool.
    ToolRadius(u32),
}

impl State {
    /// Returns the value of a variable of the control; 0 for one without meaning in a simulation.
    pub(super) fn control_variable(&self, number: usize) -> f64 {
        if let Some(value) = self.parameters.of_control(number) {
            return value;
        }
        if let Some(quantity) = quantity(number) {
            return match quantity {
                Quantity::WorkOffset(system, axis) => {
                    self.options.work_offsets[system][axis] / self.unit(axis)
                }
                Quantity::ToolLength(tool) => {
                    self.options.tools.get(tool).map_or(0.0, |tool| tool.length / self.modal.length)
                }
                Quantity::ToolRadius(tool) => {
                    self.options.tools.get(tool).map_or(0.0, |tool| tool.radius / self.modal.length)
                }
            };
        }
        let axis = |first: usize| (number - first).min(AXIS_COUNT - 1);
        match number {
            4001..=4130 => self.mode(number),
            5001..=5009 => self.coordinate(axis(5001)),
            5021..=5029 => self.position[axis(5021)] / self.unit(axis(5021)),
            5041..=5049 => self.coordinate(axis(5041)),
            5061..=5069 => self.coordinate(axis(5061)),
            5083 => self.offsets.tool_length / self.modal.length,
            // Common variables.
            98_000..=98_499 | 500_000.. => f64::NAN,
            _ => 0.0,
        }
    }

    /// Returns the code or word of a modal group.
    fn mode(&self, number: usize) -> f64 {
        let modal = &self.modal;
        let tenths = match number {
            4001 => modal.motion.filter(|motion| *motion != Motion::Cancel).map_or(0, Motion::number),
            4002 => match modal.plane {
                Plane::Xy => PlaneCode::Xy.number(),
                Plane::Zx => PlaneCode::Zx.number(),
                Plane::Yz => PlaneCode::Yz.number(),
            },
            4003 => {
                if modal.is_incremental {
                    910
                } else {
                    900
                }
            }
            4005 => modal.feed_mode.number(),
            4006 => {
                if self.is_metric() {
                    210
                } else {
                    200
                }
            }
            4008 => {
                if self.offsets.tool_length == 0.0 {
                    490
                } else {
                    430
                }
            }
            4009 => modal.cycle.map_or(800, |cycle| cycle.code.number()),
            4010 => {
                if modal.retracts_to_initial {
                    980
                } else {
                    990
                }
            }
            4014 if self.offsets.active < WORK_OFFSET_COUNT => 540 + 10 * self.offsets.active as u16,
            4014 => 541,
            4107 => return modal.radius_number.map_or(0.0, f64::from),
            4109 => return modal.feed_word,
            4111 | 4120 => return f64::from(modal.tool),
            4119 => return modal.spindle_speed,
            4130 => return self.offsets.active.saturating_sub(WORK_OFFSET_COUNT - 1) as f64,
            _ => 0,
        };
        f64::from(tenths) / 10.0
    }

    /// Sets a parameter of LinuxCNC from #5000 on: references and work offsets take effect, in mm and degrees.
    pub(super) fn set_parameter_of_control(&mut self, number: usize, value: f64) -> Outcome<()> {
        let unit = |axis: usize| if is_rotary(axis) { DEGREE } else { MILLIMETER };
        match number {
            5161..=5169 => self.options.references[0][number - 5161] = value * unit(number - 5161),
            5181..=5189 => self.options.references[1][number - 5181] = value * unit(number - 5181),
            5221..=5389 if (number - 5221) % 20 < AXIS_COUNT => {
                let (system, axis) = ((number - 5221) / 20, (number - 5221) % 20);
                self.options.work_offsets[system][axis] = value * unit(axis);
            }
            5210..=5220 | 5400..=5428 => {
                return Err(format!("#{number}: read only; program G92, G54 or a tool change"));
            }
            _ => self.parameters.set_of_control(number, value)?,
        }
        Ok(())
    }

    /// Sets a variable of the control: offsets and tools take effect, #3000 raises an alarm, #3006 stops.
    pub(super) fn set_control_variable(&mut self, number: usize, value: f64) -> Outcome<()> {
        let known = if value.is_nan() { 0.0 } else { value };
        match (number, quantity(number)) {
            (ALARM, _) => {
                // The control stops.
                self.has_ended = true;
                let name = if self.dialect == Dialect::Okuma { "VDOUT[992]" } else { "#3000" };
                return Err(format!("alarm of the program: {name}={known}"));
            }
            (5201..=5209, _) if known != 0.0 => {
                return Err(format!(
                    "#{number}, the external work offset, is not supported: add it to the work offsets"
                ));
            }
            (3006, _) => self.push_event(ProgramEvent::Stop),
            (_, Some(Quantity::WorkOffset(system, axis))) => {
                if let Some(given) = &mut self.options.given_work_offsets {
                    given.insert(system);
                }
                self.options.work_offsets[system][axis] = known * self.unit(axis);
            }
            (_, Some(Quantity::ToolLength(tool))) => {
                self.options.tools.entry(tool).length = known * self.modal.length;
            }
            (_, Some(Quantity::ToolRadius(tool))) => {
                self.options.tools.entry(tool).radius = known * self.modal.length;
            }
            (_, None) => self.parameters.set_of_control(number, value)?,
        }
        Ok(())
    }
}

fn quantity(number: usize) -> Option<Quantity> {
    let offset = |first: usize, system: usize| {
        let (index, axis) = ((number - first) / 20, (number - first) % 20);
        (axis < AXIS_COUNT).then_some(Quantity::WorkOffset(system + index, axis))
    };
    let tool = |first: usize| (number - first) as u32 + 1;
    match number {
        5221..=5340 => offset(5221, 0),
        // VZOFX[1] and on.
        number if (WORK_OFFSETS + 20..WORK_OFFSETS + 20 * (SYSTEMS + 1)).contains(&number) => {
            offset(WORK_OFFSETS + 20, 0)
        }
        7001..=7960 => offset(7001, WORK_OFFSET_COUNT),
        14001..=19980 => offset(14001, WORK_OFFSET_COUNT),
        // Of Mazak.
        70001..=75980 => offset(70001, WORK_OFFSET_COUNT),
        2001..=2200 => Some(Quantity::ToolLength(tool(2001))),
        2401..=2600 => Some(Quantity::ToolRadius(tool(2401))),
        11001..=11999 => Some(Quantity::ToolLength(tool(11001))),
        13001..=13999 => Some(Quantity::ToolRadius(tool(13001))),
        _ => None,
    }
}
