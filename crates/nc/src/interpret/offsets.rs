//! Offsets and references: G10, G28, G30, G52 to G59.3, G92.

use super::codes::{Action, Codes, CoordinateSystem, g_name};
use super::dialect::Dialect;
use super::error::Outcome;
use super::limits::{ADDITIONAL_OFFSET_COUNT, WORK_OFFSET_COUNT};
use super::line_words::LineWords;
use super::okuma::PREFIX;
use super::parameters::integer;
use super::state::{Offsets, State};
use super::work_offset::system_name;
use crate::motion::{AXIS_COUNT, AXIS_LETTERS};

impl State {
    /// Returns the upper travel limit of an axis in the coordinates in effect and units of the program.
    pub(super) fn upper_limit(&self, axis: usize) -> Option<f64> {
        let origin = if self.modal.is_machine { 0.0 } else { self.origin(axis) };
        let limit = self.options.upper_limits[axis];
        limit.is_finite().then(|| (limit - origin) / self.unit(axis))
    }

    /// Returns true if a named parameter belongs to the control.
    pub(super) fn is_of_control(&self, name: &str) -> bool {
        self.is_defined(name) && self.parameters.named(name).is_none()
    }

    /// Selects the work coordinate system: G54 to G59.3, G54.1 P, G154 P, G110 to G129, and G59 P of Mach3.
    pub(super) fn set_coordinate_system(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        if codes.g.work_system.is_some() {
            return self.select_system(block);
        }
        let Some(code) = codes.g.coordinates else { return Ok(()) };
        let of_code = block.g.iter().find(|code| (1100..=1290).contains(*code)).map(|code| code / 10 - 109);
        let is_additional = code.index().is_none();
        let takes_p = match code {
            CoordinateSystem::First => self.dialect == Dialect::Fanuc,
            CoordinateSystem::Sixth => self.dialect == Dialect::Mach3,
            _ => is_additional,
        };
        let number = match of_code {
            Some(number) => Some(u32::from(number)),
            None if takes_p && codes.g.action.is_none() => block.take_integer('P')?,
            None => None,
        };
        self.offsets.active = match (code.index(), number) {
            (Some(index), None) => index,
            // G59 P of Mach3 has G54 to G59 at 1 to 6.
            (Some(_), Some(number @ 1..=6)) if code == CoordinateSystem::Sixth => number as usize - 1,
            (Some(_), Some(number @ 7..=254)) if code == CoordinateSystem::Sixth => {
                WORK_OFFSET_COUNT - 7 + number as usize
            }
            (_, Some(number)) if (1..=ADDITIONAL_OFFSET_COUNT as u32).contains(&number) => {
                WORK_OFFSET_COUNT - 1 + number as usize
            }
            _ => {
                let name = g_name(code.number());
                return Err(format!(
                    "{name} requires P, the work coordinate system 1 to {ADDITIONAL_OFFSET_COUNT}"
                ));
            }
        };
        self.note_missing_offset();
        Ok(())
    }

    /// Selects the work coordinate system of G15 H and G16 H; H0 is that of the machine.
    fn select_system(&mut self, block: &mut LineWords) -> Outcome<()> {
        const LAST: usize = WORK_OFFSET_COUNT + ADDITIONAL_OFFSET_COUNT;
        let number = block.take_integer('H')?.map(|number| number as usize).filter(|number| *number <= LAST);
        let number =
            number.ok_or_else(|| format!("G15 and G16 require H, the work coordinate system 0 to {LAST}"))?;
        self.modal.is_machine = number == 0;
        if let Some(index) = number.checked_sub(1) {
            self.offsets.active = index;
            self.note_missing_offset();
        }
        Ok(())
    }

    /// Sets the work offset PP of Okuma to that of the point PX, PY, PZ of the work coordinate system PH, with the rotary
    /// axes at PA, PB, PC.
    pub(super) fn set_fixture_offset(&mut self) -> Outcome<()> {
        let argument =
            |name: &str| self.parameters.named(&format!("{PREFIX}p{name}")).filter(|value| !value.is_nan());
        let system = |name: &str| {
            let number = argument(name).and_then(integer).map(|number| number as usize);
            let index = number.and_then(|number| number.checked_sub(1));
            index.filter(|index| *index < self.options.work_offsets.len()).ok_or_else(|| {
                let name = name.to_uppercase();
                format!("CALL OO88 requires P{name}, the number of a work coordinate system, as in P{name}=1")
            })
        };
        let (from, to) = (system("h")?, system("p")?);
        let mut position = self.options.work_offsets[from];
        for (axis, name) in ["x", "y", "z", "a", "b", "c"].into_iter().enumerate() {
            position[axis] += argument(name).unwrap_or(0.0) * self.unit(axis);
        }
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("CALL OO88 requires a machine with kinematics")?;
        let turned = transform.positions(&position, Some(0.0));
        let mut offset = self.options.work_offsets[from];
        offset[..3].copy_from_slice(&turned[..3]);
        self.options.work_offsets[to] = offset;
        Ok(())
    }

    fn note_missing_offset(&mut self) {
        if let Some(given) = &self.options.given_work_offsets
            && !given.contains(&self.offsets.active)
        {
            self.assume(format!(
                "work offset {} is not given: the workpiece frame of the machine",
                system_name(self.offsets.active)
            ));
        }
    }

    /// Returns the axis words in m and rad, which then count as used.
    ///
    /// # Errors
    ///
    /// An axis that the machine lacks, or a coordinate out of range.
    pub(super) fn take_axes(&self, block: &mut LineWords) -> Outcome<[Option<f64>; AXIS_COUNT]> {
        let mut values = [None; AXIS_COUNT];
        let mut missing = Vec::new();
        for (axis, letter) in AXIS_LETTERS.into_iter().enumerate() {
            let Some(value) = block.take(letter) else { continue };
            if !self.options.axes[axis] && self.dialect != Dialect::LinuxCnc && value == 0.0 && axis >= 3 {
                // An axis that the machine lacks may stay at 0.
                continue;
            }
            if !self.options.axes[axis] {
                missing.push(letter);
                continue;
            }
            values[axis] = Some(value * self.unit(axis));
        }
        if missing.is_empty() { Ok(values) } else { Err(self.reject_axes(&missing)) }
    }

    /// Sets offsets and tools: G10 L1, L10 to L13 (tools), L2 (work offset), L20 (coordinates of the position, or
    /// additional work offset).
    pub(super) fn set_data(&mut self, block: &mut LineWords) -> Outcome<()> {
        let is_macro_b = self.dialect.has_macro_b();
        let level = match block.take_integer('L')? {
            // One offset of older controls, for H and D.
            None if is_macro_b && block.get('R').is_some() && !block.has_axis() => {
                return self.set_tool_memory(block);
            }
            level => level.or(is_macro_b.then_some(2)),
        };
        match level {
            // Loads the tool table again.
            Some(0) => return Ok(()),
            Some(1 | 10 | 11 | 12 | 13) => return self.set_tool_data(block, level.unwrap_or_default()),
            Some(2 | 20) => {}
            // Parameters, and lives of tools.
            Some(level) if is_macro_b && matches!(level, 3 | 50..=52) => {
                self.note_without_effect(format!("G10 L{level}"));
                self.enters_parameters = true;
                block.skip("ABCDEHIJKPQRUVWXYZ");
                return Ok(());
            }
            _ => return Err("G10 requires L2 or L20, or L1 or L10 to L13 for tools".to_owned()),
        }
        let level = level.unwrap_or_default();
        let number = block.take_integer('P')?.map(|number| number as usize);
        if level == 20 && is_macro_b {
            let number = number.filter(|number| (1..=ADDITIONAL_OFFSET_COUNT).contains(number));
            let number =
                number.ok_or("G10 L20 requires P, the additional work coordinate system 1 to 300")?;
            return self.set_offset(block, WORK_OFFSET_COUNT - 1 + number, 2);
        }
        let system = number.filter(|number| *number <= WORK_OFFSET_COUNT);
        let system = system.ok_or("G10 requires P, the coordinate system 1 to 9, or 0 for the active one")?;
        if system == 0 && is_macro_b {
            let words = self.take_axes(block)?;
            if words.iter().any(Option::is_some) && words.iter().flatten().all(|value| *value == 0.0) {
                // The external work offset is 0.
                return Ok(());
            }
            return Err("G10 L2 P0, the external work offset, is not supported: add it to the work offsets"
                .to_owned());
        }
        let system = system.checked_sub(1).unwrap_or(self.offsets.active);
        self.set_offset(block, system, level)
    }

    /// Sets length or radius of a tool: G10 L1, L10, L11 (length), L12, L13 (radius).
    fn set_tool_data(&mut self, block: &mut LineWords, level: u32) -> Outcome<()> {
        let number = block.take_integer('P')?.ok_or("G10 of a tool requires P, its number")?;
        let is_macro_b = self.dialect.has_macro_b();
        let unit = self.modal.length;
        let radius = block.take('R').map(|value| value * unit);
        let is_incremental = self.modal.is_incremental && is_macro_b;
        if is_macro_b {
            let value = radius.ok_or("G10 of a tool requires R, its length or radius")?;
            let tool = self.options.tools.entry(number);
            let part = match level {
                12 | 13 => &mut tool.radius,
                _ => &mut tool.length,
            };
            // L11 and L13 are wear, in addition to the geometry.
            *part = if is_incremental || level == 11 || level == 13 { *part + value } else { value };
            return Ok(());
        }
        let words = self.take_axes(block)?;
        block.skip("IJQ");
        let origin = self.origin(2) - self.offsets.tool_length;
        let position = self.position[2];
        let tool = self.options.tools.entry(number);
        tool.radius = radius.unwrap_or(tool.radius);
        if let Some(z) = words[2] {
            tool.length = match level {
                1 => z,
                10 => position - origin - z,
                _ => position - z,
            };
        }
        Ok(())
    }

    /// Sets the offset of the tool memory A of Fanuc, a length for H and a radius for D: G10 P R without L.
    fn set_tool_memory(&mut self, block: &mut LineWords) -> Outcome<()> {
        if self.dialect != Dialect::Fanuc {
            return Err("G10 with R requires L10 to L13, for length or radius of the tool".to_owned());
        }
        let number = block.take_integer('P')?.ok_or("G10 with R requires P, the number of the offset")?;
        let value = block.take('R').unwrap_or_default() * self.modal.length;
        let is_incremental = self.modal.is_incremental;
        let tool = self.options.tools.entry(number);
        for part in [&mut tool.length, &mut tool.radius] {
            *part = if is_incremental { *part + value } else { value };
        }
        Ok(())
    }

    fn set_offset(&mut self, block: &mut LineWords, system: usize, level: u32) -> Outcome<()> {
        if let Some(given) = &mut self.options.given_work_offsets {
            given.insert(system);
        }
        let is_macro_b = self.dialect.has_macro_b();
        let is_incremental = self.modal.is_incremental && is_macro_b;
        // A rotation is a word of LinuxCNC.
        let rotation = if is_macro_b { None } else { block.take('R').filter(|_| level == 2) };
        let words = self.take_axes(block)?;
        if words.iter().all(Option::is_none) && rotation.is_none() {
            return Err(format!("G10 L{level} requires at least one axis word"));
        }
        if level == 20 {
            return self.set_coordinates(&words, system, |state, axis, value| {
                state.options.work_offsets[system][axis] += value;
            });
        }
        for (offset, value) in self.options.work_offsets[system].iter_mut().zip(words) {
            let Some(value) = value else { continue };
            *offset = if is_incremental { *offset + value } else { value };
        }
        if let Some(rotation) = rotation {
            self.offsets.rotations.insert(system, rotation.to_radians());
        }
        Ok(())
    }

    /// Changes an offset of a coordinate system by `add`, so that the position gets the coordinates of the words.
    fn set_coordinates(
        &mut self,
        words: &[Option<f64>; AXIS_COUNT],
        system: usize,
        add: impl Fn(&mut Self, usize, f64),
    ) -> Outcome<()> {
        let active = std::mem::replace(&mut self.offsets.active, system);
        let mut wanted = self.programmed();
        for (wanted, word) in wanted.iter_mut().zip(words) {
            *wanted = word.unwrap_or(*wanted);
        }
        let position = self.position_at(&wanted);
        let present = self.position;
        for (axis, (present, wanted)) in present.into_iter().zip(position).enumerate() {
            add(self, axis, present - wanted);
        }
        self.offsets.active = active;
        Ok(())
    }

    /// Sets the shift of all coordinate systems: G52 (shift) or G92 (coordinates of the position).
    pub(super) fn shift(&mut self, block: &mut LineWords, code: Action) -> Outcome<()> {
        let words = self.take_axes(block)?;
        if words.iter().all(Option::is_none) {
            // G92 S limits the speed of the spindle.
            let is_spindle_limit = self.dialect.has_macro_b() && code == Action::ShiftToPosition;
            if is_spindle_limit || block.was_given('E') {
                return Ok(());
            }
            return Err(format!("{} requires at least one axis word", g_name(code.number())));
        }
        self.finish_contour()?;
        let has_local = self.dialect.has_macro_b();
        if code == Action::Shift {
            let Offsets { local, shift, .. } = &mut self.offsets;
            for (shift, value) in if has_local { local } else { shift }.iter_mut().zip(words) {
                *shift = value.unwrap_or(*shift);
            }
        } else {
            // G92 ends the local shift of its axes.
            for (local, _) in self.offsets.local.iter_mut().zip(words).filter(|(_, word)| word.is_some()) {
                *local = 0.0;
            }
            let rotation = self.offsets.rotations.get(&self.offsets.active).copied().unwrap_or(0.0);
            let (sin, cos) = rotation.sin_cos();
            self.set_coordinates(&words, self.offsets.active, |state, axis, value| match axis {
                0 => {
                    state.offsets.shift[0] += cos * value;
                    state.offsets.shift[1] -= sin * value;
                }
                1 => {
                    state.offsets.shift[0] += sin * value;
                    state.offsets.shift[1] += cos * value;
                }
                _ => state.offsets.shift[axis] += value,
            })?;
        }
        self.offsets.saved_shift = self.offsets.shift;
        Ok(())
    }

    /// Moves through the programmed coordinates to a reference: G28, G30.
    pub(super) fn go_to_reference(&mut self, block: &mut LineWords, reference: usize) -> Outcome<()> {
        self.finish_contour()?;
        self.moves_in_machine_coordinates = true;
        let number = if self.dialect.has_macro_b() { block.take_integer('P')? } else { None };
        if number.is_some_and(|number| number > 2) {
            self.assume("G30 P3 and P4: their references are that of P2".to_owned());
        }
        let increments = self.take_increments(block);
        let mut between = self.targets(block)?;
        let words = AXIS_LETTERS.map(|letter| block.was_given(letter));
        let mut is_named = words;
        for (axis, increment) in increments.into_iter().enumerate() {
            if let Some(increment) = increment {
                between[axis] += increment;
                is_named[axis] = true;
            }
        }
        let has_words = is_named.iter().any(|is_named| *is_named);
        self.rapid_to(&between)?;
        self.modal.between = between;
        let tcp_length = self.modal.tcp_length;
        self.leave_tcp();
        let mut end = self.position;
        for axis in 0..AXIS_COUNT {
            if self.options.axes[axis] && (is_named[axis] || !has_words) {
                end[axis] = self.options.references[reference][axis];
            }
        }
        self.push_rapid(end)?;
        tcp_length.map_or(Ok(()), |length| self.enter_tcp(length))
    }

    /// Moves axes to their home switches, the first reference: G28.1 of Mach3. The words are positions at which the axes slow
    /// down.
    pub(super) fn home_axes(&mut self, block: &mut LineWords) -> Outcome<()> {
        self.finish_contour()?;
        self.moves_in_machine_coordinates = true;
        let words = self.take_axes(block)?;
        let mut end = self.position;
        for ((end, word), reference) in end.iter_mut().zip(words).zip(self.options.references[0]) {
            *end = word.map_or(*end, |_| reference);
        }
        self.assume(
            "G28.1: homing is a rapid traverse to the reference of G28, no switch is searched".to_owned(),
        );
        self.push_rapid(end)
    }

    /// Returns the increments of X, Y and Z by U, V and W on a machine of Fanuc and Haas without these axes, m.
    pub(super) fn take_increments(&self, block: &mut LineWords) -> [Option<f64>; 3] {
        if !self.dialect.has_macro_b() {
            return [None; 3];
        }
        [6, 7, 8].map(|axis| match self.options.axes[axis] {
            true => None,
            false => block.take(AXIS_LETTERS[axis]).map(|value| value * self.modal.length),
        })
    }

    /// Stores the position as a reference: G28.1, G30.1.
    pub(super) fn store_reference(&mut self, reference: usize) -> Outcome<()> {
        self.finish_contour()?;
        let mut position = self.position;
        if let (Some(length), Some(transform)) = (self.modal.tcp_length, &self.options.kinematics) {
            transform.axis_positions(&mut position, length);
        }
        self.options.references[reference] = position;
        Ok(())
    }
}
