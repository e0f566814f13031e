//! Offsets and references: G10, G28, G30, G43, G49, G52 to G59.3, G92.

use super::codes::{Codes, Group};
use super::error::Outcome;
use super::line_words::LineWords;
use super::options::WORK_OFFSET_COUNT;
use super::state::State;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS};

/// Work coordinate systems, in tenths of their G codes.
const SYSTEMS: [u16; WORK_OFFSET_COUNT] = [540, 550, 560, 570, 580, 590, 591, 592, 593];

impl State {
    /// Returns true if a named parameter belongs to the control.
    pub(super) fn is_of_control(&self, name: &str) -> bool {
        use super::parameters::Variables;

        self.is_defined(name) && self.parameters.named(name).is_none()
    }

    pub(super) fn set_coordinate_system(&mut self, codes: &Codes) {
        let code = codes.g(Group::Coordinates);
        if let Some(system) = SYSTEMS.iter().position(|system| Some(*system) == code) {
            self.offsets.active = system;
        }
    }

    /// Returns the axis words in m and rad, which then count as used.
    ///
    /// # Errors
    ///
    /// An axis that the machine lacks, or a coordinate out of range.
    pub(super) fn take_axes(&self, block: &mut LineWords) -> Outcome<[Option<f64>; AXIS_COUNT]> {
        let mut values = [None; AXIS_COUNT];
        for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
            let Some(value) = block.take(letter) else { continue };
            if !self.options.axes[axis] {
                let known = AXIS_LETTERS.into_iter().zip(self.options.axes).filter(|(_, has)| *has);
                let known = known.map(|(letter, _)| letter.to_string()).collect::<Vec<_>>().join(" ");
                return Err(format!("word {letter}: the machine has no axis {letter}; axes: {known}"));
            }
            values[axis] = Some(value * self.unit(axis));
        }
        Ok(values)
    }

    /// Sets a work offset: G10 L2 (offset) or G10 L20 (coordinates of the position).
    pub(super) fn set_offset_data(&mut self, block: &mut LineWords) -> Outcome<()> {
        let system = block.take_integer('P')?.map(|number| number as usize);
        let system = system.filter(|number| *number <= WORK_OFFSET_COUNT);
        let system = system.ok_or("G10 requires P, the coordinate system 1 to 9, or 0 for the active one")?;
        let system = system.checked_sub(1).unwrap_or(self.offsets.active);
        let level = block.take_integer('L')?;
        let level = level.filter(|level| [2, 20].contains(level)).ok_or("G10 requires L2 or L20")?;
        let words = self.take_axes(block)?;
        if words.iter().all(Option::is_none) {
            return Err(format!("G10 L{level} requires at least one axis word"));
        }
        for (axis, value) in words.into_iter().enumerate() {
            let Some(value) = value else { continue };
            let rest = self.origin(axis) - self.options.work_offsets[self.offsets.active][axis];
            self.options.work_offsets[system][axis] =
                if level == 2 { value } else { self.position[axis] - rest - value };
        }
        Ok(())
    }

    /// Sets the shift of all coordinate systems: G52 (shift) or G92 (coordinates of the position).
    pub(super) fn shift(&mut self, block: &mut LineWords, code: u16) -> Outcome<()> {
        let words = self.take_axes(block)?;
        if words.iter().all(Option::is_none) {
            return Err(format!("G{} requires at least one axis word", code / 10));
        }
        for (axis, value) in words.into_iter().enumerate() {
            let Some(value) = value else { continue };
            let rest = self.origin(axis) - self.offsets.shift[axis];
            self.offsets.shift[axis] = if code == 520 { value } else { self.position[axis] - rest - value };
        }
        self.offsets.saved_shift = self.offsets.shift;
        Ok(())
    }

    /// Clears (G92.1), suspends (G92.2) or restores (G92.3) the shift.
    pub(super) fn change_shift(&mut self, code: u16) {
        self.offsets.shift = if code == 923 { self.offsets.saved_shift } else { [0.0; AXIS_COUNT] };
        if code == 921 {
            self.offsets.saved_shift = self.offsets.shift;
        }
    }

    /// Sets the tool length: G43, G43.1, G43.4, G49.
    pub(super) fn set_tool_length(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        match codes.g(Group::ToolLength) {
            None => {}
            Some(490) => {
                self.leave_tcp();
                self.offsets.tool_length = 0.0;
            }
            Some(431) => {
                let words = self.take_axes(block)?;
                if words.iter().enumerate().any(|(axis, word)| axis != 2 && word.is_some()) {
                    return Err("G43.1: only Z is supported".to_owned());
                }
                self.leave_tcp();
                self.offsets.tool_length = words[2].ok_or("G43.1 requires Z, the tool length")?;
            }
            Some(code) => {
                let length = match block.take_integer('H')? {
                    Some(0) => 0.0,
                    tool => self.tool_length(tool.unwrap_or(self.modal.tool))?,
                };
                self.leave_tcp();
                match code {
                    434 => self.enter_tcp(length)?,
                    _ => self.offsets.tool_length = length,
                }
            }
        }
        Ok(())
    }

    fn tool_length(&self, tool: u32) -> Outcome<f64> {
        let length = self.options.tool_lengths.get(&tool).copied().or(self.options.default_tool_length);
        length.ok_or_else(|| format!("tool {tool} is not in the tool table"))
    }

    /// Starts tool center point control: the position becomes the tip of the tool.
    fn enter_tcp(&mut self, length: f64) -> Outcome<()> {
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("G43.4 requires a machine with kinematics; program G43")?;
        transform.tip(&mut self.position, length);
        self.modal.tcp_length = Some(length);
        self.offsets.tool_length = 0.0;
        Ok(())
    }

    /// Ends tool center point control: the position becomes that of the axes.
    fn leave_tcp(&mut self) {
        if let (Some(length), Some(transform)) = (self.modal.tcp_length.take(), &self.options.kinematics) {
            transform.axis_positions(&mut self.position, length);
        }
    }

    /// Moves through the programmed coordinates to a reference: G28, G30.
    pub(super) fn go_to_reference(&mut self, block: &mut LineWords, reference: usize) -> Outcome<()> {
        self.require_axis_positions()?;
        let has_words = block.has_axis();
        let words = AXIS_LETTERS.map(|letter| block.get(letter).is_some());
        let between = self.targets(block, false)?;
        self.push_rapid(between)?;
        let mut end = self.position;
        for axis in 0..AXIS_COUNT {
            if self.options.axes[axis] && (words[axis] || !has_words) {
                end[axis] = self.options.references[reference][axis];
            }
        }
        self.push_rapid(end)
    }

    /// Stores the position as a reference: G28.1, G30.1.
    pub(super) fn store_reference(&mut self, reference: usize) -> Outcome<()> {
        self.require_axis_positions()?;
        self.options.references[reference] = self.position;
        Ok(())
    }

    /// Rejects axis positions with tool center point control.
    pub(super) fn require_axis_positions(&self) -> Outcome<()> {
        match self.modal.tcp_length {
            None => Ok(()),
            Some(_) => {
                Err("axis positions (G28, G30, G53) with tool center point control: program G49 first"
                    .to_owned())
            }
        }
    }
}
