//! Offsets of tools: length (G43 to G44, G49), radius (G40 to G42), tool center point control (G43.4).

use virtual_axes_core::units::{MILLIMETER, Rounded};

use super::codes::{Codes, CutterCompensation, KinematicsSwitch, ToolLength, g_name};
use super::contour::Compensation;
use super::dialect::Dialect;
use super::error::Outcome;
use super::line_words::LineWords;
use super::state::State;

impl State {
    /// Sets the tool length: G43, G43.1, G43.2, G43.4, G43.5, G44, G234, G49.
    pub(super) fn set_tool_length(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        // H alone is another length of the code in effect.
        let has_number = matches!(self.dialect, Dialect::Fanuc | Dialect::Haas) && block.get('H').is_some();
        let active = self.modal.tool_length_code.filter(|_| has_number);
        let Some(code) = codes.g.tool_length.or(active) else { return Ok(()) };
        self.modal.tool_length_code = Some(code);
        let before = self.offsets.tool_length + self.modal.tcp_length.unwrap_or(0.0);
        match code {
            ToolLength::Off | ToolLength::OffByG53 | ToolLength::CenterPointOff => {
                self.leave_tcp();
                self.offsets.tool_length = 0.0;
                self.modal.tool_length_code = None;
                block.take_integer('H')?;
            }
            ToolLength::Given => {
                let words = self.take_axes(block)?;
                if words.iter().enumerate().any(|(axis, word)| axis != 2 && word.is_some()) {
                    return Err("G43.1: only Z is supported".to_owned());
                }
                self.leave_tcp();
                self.offsets.tool_length = words[2].ok_or("G43.1 requires Z, the tool length")?;
            }
            _ => {
                let length = match block.take_integer('H')? {
                    Some(0) => 0.0,
                    tool => self.tool_length(tool.unwrap_or(self.modal.tool))?,
                };
                self.leave_tcp();
                match code {
                    ToolLength::CenterPoint
                    | ToolLength::CenterPointVector
                    | ToolLength::CenterPoint234
                    | ToolLength::CenterPoint169 => {
                        self.enter_tcp(length)?;
                        self.modal.has_tool_vectors = code == ToolLength::CenterPointVector;
                    }
                    ToolLength::Additional => self.offsets.tool_length += length,
                    ToolLength::Negative => self.offsets.tool_length = -length,
                    _ => self.offsets.tool_length = length,
                }
            }
        }
        if matches!(self.dialect, Dialect::Fanuc | Dialect::Haas) {
            // An increment counts from the programmed point, which a new length does not move.
            let after = self.offsets.tool_length + self.modal.tcp_length.unwrap_or(0.0);
            self.offsets.length_change = Some((self.position[2], self.pending_length() + after - before));
        }
        Ok(())
    }

    /// Returns the change of the tool length offset since the last motion of Z, m; 0 for controls that do not add it to an
    /// increment.
    pub(super) fn pending_length(&self) -> f64 {
        let change = self.offsets.length_change.filter(|(position, _)| *position == self.position[2]);
        change.map_or(0.0, |(_, change)| change)
    }

    /// Switches between tool center point control and positions of the axes, as the machines of LinuxCNC with switchable
    /// kinematics do: M428, M429, M430.
    pub(super) fn switch_kinematics(&mut self, codes: &Codes) -> Outcome<()> {
        let Some(code) = codes.m.kinematics else { return Ok(()) };
        let has_tables = self.options.kinematics.is_some() && (3..6).any(|axis| self.options.axes[axis]);
        match (code, self.modal.tcp_length) {
            (KinematicsSwitch::CenterPoint, None) if has_tables => self.enter_tcp(self.offsets.tool_length),
            (KinematicsSwitch::Axes | KinematicsSwitch::User, Some(length)) => {
                self.leave_tcp();
                self.offsets.tool_length = length;
                Ok(())
            }
            _ => {
                self.note_without_effect(format!("M{}", code.number()));
                Ok(())
            }
        }
    }

    /// Returns the length of a tool, m; a tool that is missing in the table has the default length, which is reported.
    pub(super) fn tool_length(&mut self, number: u32) -> Outcome<f64> {
        if let Some(tool) = self.options.tools.get(number) {
            return Ok(tool.length);
        }
        let missing = || format!("tool {number} is not in the tool table");
        let length = self.options.default_tool_length.ok_or_else(missing)?;
        if length == 0.0 {
            self.assume(format!("{}: length 0", missing()));
        } else if self.dialect != Dialect::LinuxCnc {
            // These controls have lengths in memory, not in a file beside the program.
            self.assume(format!(
                "tools without entry in the tool table have the tool length of the machine, {} mm",
                Rounded(length / MILLIMETER)
            ));
        }
        Ok(length)
    }

    /// Starts or ends cutter radius compensation: G40, G41, G42, G41.1, G42.1.
    pub(super) fn set_compensation(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        use CutterCompensation::{Left, LeftDiameter, Off, Right, RightDiameter};
        // D alone is another radius of the code in effect.
        let has_number = matches!(self.dialect, Dialect::Fanuc | Dialect::Haas) && block.get('D').is_some();
        let active = self.modal.cutter_compensation_code;
        let Some(code) = codes.g.cutter_compensation.or(active.filter(|_| has_number)) else {
            if self.dialect != Dialect::LinuxCnc
                && let Some(number) = block.take_integer('D')?
            {
                self.modal.radius_number = Some(number);
            }
            return Ok(());
        };
        if let Some(active) = active.filter(|active| *active != code && code != Off) {
            let [code, active] = [code, active].map(|code| g_name(code.number()));
            return Err(format!(
                "{code} while {active} is in effect is not supported: program G40 and a straight line away from the \
                 contour before {code}"
            ));
        }
        self.modal.cutter_compensation_code = Some(code).filter(|code| *code != Off);
        let is_left = matches!(code, Left | LeftDiameter);
        let radius = match code {
            Off => {
                if self.dialect != Dialect::LinuxCnc {
                    block.skip("D");
                }
                return self.compensate(None);
            }
            LeftDiameter | RightDiameter => {
                let diameter =
                    block.take('D').ok_or("G41.1 and G42.1 require D, the diameter of the tool")?;
                block.skip("L");
                0.5 * diameter * self.modal.length
            }
            Left | Right if self.dialect == Dialect::Mach3 && block.get('P').is_some() => {
                block.take('P').unwrap_or_default() * self.modal.length
            }
            Left | Right => {
                let mut number = block.take_integer('D')?;
                if self.dialect.has_macro_b() && number.is_none() && codes.g.tool_length.is_none() {
                    // Older controls have the radius in the table of H.
                    number = block.take_integer('H')?;
                }
                self.modal.radius_number = number.or(self.modal.radius_number);
                // LinuxCNC takes the tool in the spindle, other controls the last D.
                let last = self.modal.radius_number.filter(|_| self.dialect != Dialect::LinuxCnc);
                if self.dialect.has_macro_b() && last.is_none() {
                    self.assume("G41 and G42 without D: the radius of the tool in the spindle".to_owned());
                }
                self.tool_radius(number.or(last).unwrap_or(self.modal.tool))
            }
        };
        self.compensate(Some(Compensation { is_left, radius }))
    }

    /// Returns the radius of a tool, m; 0 for one that is missing in the table, which is reported.
    pub(super) fn tool_radius(&mut self, number: u32) -> f64 {
        match self.options.tools.get(number) {
            Some(tool) => tool.radius,
            None if number == 0 => 0.0,
            None => {
                self.assume(format!(
                    "tool {number} is not in the tool table: radius 0, the contour is the path"
                ));
                0.0
            }
        }
    }

    /// Starts tool center point control: the position becomes the tip of the tool.
    pub(super) fn enter_tcp(&mut self, length: f64) -> Outcome<()> {
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("G43.4 requires a machine with kinematics; program G43")?;
        let axes = self.position;
        transform.tip(&mut self.position, length);
        self.offsets.tcp_start = Some([self.position, axes]);
        self.modal.tcp_length = Some(length);
        self.offsets.tool_length = 0.0;
        Ok(())
    }

    /// Ends tool center point control: the position becomes that of the axes.
    pub(super) fn leave_tcp(&mut self) {
        if let (Some(length), Some(transform)) = (self.modal.tcp_length.take(), &self.options.kinematics) {
            match self.offsets.tcp_start {
                Some([tip, axes]) if tip == self.position => self.position = axes,
                _ => transform.axis_positions(&mut self.position, length),
            }
        }
    }
}
