//! Execution of one line, in the order of LinuxCNC: feed, spindle, tool, coolant, dwell, plane, units, cutter compensation,
//! tool length, coordinate system, path control, distance mode, motion, stop.

use virtual_axes_core::units::{DEGREE, INCH, MILLIMETER, MILLISECOND, RPM};

use super::codes::{
    Action, ArcDistance, Codes, Coolant, Distance, FeedMode, Motion, PathControlCode, PlaneCode, Retraction,
    SavedModes, Spindle, SpindleMode, SpindleWithCoolant, Stop, ToolChange, ToolLength, Units, WorkSystem,
    g_name,
};
use super::contour::Corner;
use super::cycles::is_canned;
use super::dialect::Dialect;
use super::error::Outcome;
use super::line_words::{LineWords, Setting};
use super::parameters::{FIRST_OF_CONTROL, FIRST_VARIABLE_OF_CONTROL, integer};
use super::state::{Modal, State};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Blend, PathControl, Plane, ProgramEvent};

/// Dwell from which the other unit of P is likely, s.
const LONG_DWELL: f64 = 100.0;
/// Letters that belong to codes which are not supported.
const ALL_LETTERS: &str = "ABCDEHIJKLPQRUVWXYZ";

impl State {
    /// Executes a line; its steps are appended to `steps`.
    pub(super) fn execute(&mut self, block: &mut LineWords) -> Outcome<()> {
        self.set_parameters(block)?;
        self.note_vacant(block.vacant.take());
        if self.spline.is_some() && block.is_ignored() {
            return Ok(());
        }
        if self.spline.is_some() && !block.is_empty() {
            return self.spline_line(block);
        }
        self.moves_in_machine_coordinates = false;
        if self.enters_parameters {
            if block.g.is_empty() && block.m.is_empty() {
                block.skip(ALL_LETTERS);
                return Ok(());
            }
            // G11 ends the entry, and so does any other code.
            self.enters_parameters = false;
        }
        let has_mapping = block.has_any(&['A', 'B', 'C', 'Q', 'R']);
        let has_p0 = block.get('P') == Some(0.0);
        let codes = Codes::new(&block.g, &block.m, has_mapping, has_p0, self.dialect)?;
        if self.request_macro(block, &codes)? {
            return Ok(());
        }
        // The words of a motion in effect, of a call and of the spindle are theirs, not those of an auxiliary function.
        let is_used = block.has_axis() || codes.m.subprogram.is_some();
        for (name, letters) in &codes.without_effect {
            self.note_without_effect(name.clone());
            if codes.g.motion.is_none() && codes.g.action.is_none() {
                block.skip(letters);
            }
        }
        if !is_used && codes.g.motion.is_none() && codes.g.action.is_none() {
            block.skip(codes.auxiliary_letters);
        }
        for (name, remedy) in &codes.unsupported {
            self.reject(format!("{name} is not supported in the dialect {}: {remedy}", self.dialect))?;
        }
        if codes.g.motion.is_some() {
            // Until the line has been executed: its next lines would have consequences of its error.
            self.has_failed_cycle = codes.g.motion.is_some_and(is_canned);
        }
        if self.dialect == Dialect::Grbl {
            self.note_grbl(block, &codes);
        }
        // F has the units of its line; LinuxCNC and Mach3 set it before the units.
        let sets_units =
            codes.g.units.is_some() && !matches!(self.dialect, Dialect::LinuxCnc | Dialect::Mach3);
        if sets_units {
            self.set_plane_and_units(block, &codes);
        }
        self.set_feed(block, &codes)?;
        self.set_spindle_and_tool(block, &codes)?;
        if block.is_ignored() {
            // The other words belong to the ignored codes.
            return Ok(());
        }
        self.set_coolant(&codes);
        self.dwell(block, &codes)?;
        if !sets_units {
            self.set_plane_and_units(block, &codes);
        }
        self.set_distance_modes(&codes);
        if !codes.unsupported.is_empty() {
            block.skip(ALL_LETTERS);
        }
        self.set_surface(block, &codes)?;
        self.set_frames(block, &codes)?;
        self.set_compensation(block, &codes)?;
        self.set_tool_length(block, &codes)?;
        self.switch_kinematics(&codes)?;
        let before = (self.offsets.active, self.modal.is_machine);
        self.set_coordinate_system(block, &codes)?;
        self.set_path_control(block, &codes)?;
        self.save_modes(&codes);
        if let Some((letter, size)) = block.corner.take() {
            let size = size * self.modal.length;
            self.corner = Some(if letter == 'R' { Corner::Round(size) } else { Corner::Chamfer(size) });
        }
        let path_control = self.modal.path_control;
        if codes.g.exact_stop.is_some() {
            self.modal.path_control = PathControl::ExactStop;
        }
        let steps = self.steps.len();
        let result = self.act(block, &codes);
        self.modal.path_control = path_control;
        if codes.g.work_system == Some(WorkSystem::Once) {
            (self.offsets.active, self.modal.is_machine) = before;
        }
        result?;
        self.corner = None;
        if self.steps.len() > steps {
            self.request_modal_macro();
        }
        self.stop(&codes)?;
        self.jump(block, &codes)?;
        block.skip(codes.auxiliary_letters);
        if self.dialect != Dialect::LinuxCnc {
            // Offset numbers may stand anywhere.
            block.skip("DH");
        }
        if codes.g.motion.is_some() && codes.unsupported.is_empty() {
            self.has_failed_cycle = false;
        }
        block.require_used()
    }

    /// Notes what other firmware of the kind of grbl accepts, and grbl 1.1 rejects.
    fn note_grbl(&mut self, block: &LineWords, codes: &Codes) {
        let is_dwell = codes.g.action == Some(Action::Dwell) && block.get('P').is_none();
        for (is_found, text) in [
            (
                codes.m.tool_change.is_some(),
                "M6: grbl 1.1 rejects it (error 20), a sender or grblHAL changes the tool",
            ),
            (codes.g.path_control == Some(PathControlCode::Blend), "G64: grbl 1.1 rejects it (error 20)"),
            (is_dwell && block.get('S').is_some(), "G4 S: grbl 1.1 requires P, the dwell in s (error 28)"),
        ] {
            if is_found {
                self.assume(text.to_owned());
            }
        }
    }

    /// Notes a word without effect, whose variable has no value, in the main program.
    fn note_vacant(&mut self, vacant: Option<(char, usize)>) {
        match vacant {
            None | Some((_, 0)) => {}
            Some(('F', variable)) => self.vacant_feed = variable,
            Some((letter, variable)) if self.calls == 0 => {
                self.assume(format!("word {letter} has no effect: {}", self.value_source(variable)));
            }
            Some(_) => {}
        }
    }

    pub(super) fn set_parameters(&mut self, block: &mut LineWords) -> Outcome<()> {
        for (target, value) in block.settings.drain(..) {
            match target {
                Setting::Number(0) => return Err("#0 has no value and cannot be set".to_owned()),
                Setting::Number(number)
                    if self.dialect.has_macro_b() && number >= FIRST_VARIABLE_OF_CONTROL =>
                {
                    self.set_control_variable(number, value)?;
                }
                Setting::Number(number) if number >= FIRST_OF_CONTROL => {
                    self.set_parameter_of_control(number, value)?;
                }
                Setting::Number(number) => self.parameters.set_numbered(number, value)?,
                Setting::Name(name) if self.is_of_control(&name) => {
                    return Err(format!("#<{name}>: a value of the control, which cannot be set"));
                }
                Setting::Name(name) => self.parameters.set_named(&name, value)?,
            }
        }
        Ok(())
    }

    /// Sets feed mode and feed: G93, G94, G95, F.
    fn set_feed(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let mode = codes.g.feed_mode.unwrap_or(self.modal.feed_mode);
        // A feed of another mode has no meaning, and G93 requires a feed in each line.
        if mode != self.modal.feed_mode || mode == FeedMode::InverseTime {
            (self.modal.feed_word, self.modal.feed) = (0.0, None);
        }
        self.modal.feed_mode = mode;
        if codes.g.action == Some(Action::Dwell) && self.dialect == Dialect::Okuma {
            // F is the dwell.
            return Ok(());
        }
        if let Some(feed) = block.take_rate('F')? {
            let units = if mode == FeedMode::InverseTime { [1.0; 2] } else { [self.modal.length, DEGREE] };
            self.modal.feed_word = feed;
            self.modal.feed = (feed > 0.0).then(|| units.map(|unit| feed * unit));
            self.vacant_feed = 0;
        }
        Ok(())
    }

    /// Sets spindle and tool: S, T, M6, M61, M3, M4, M5, M13, M14, G96, G97.
    fn set_spindle_and_tool(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        // S of a dwell is its time.
        let is_dwell = self.dialect.is_firmware() && codes.g.action == Some(Action::Dwell);
        let mut speed = if is_dwell { None } else { block.take_rate('S')? };
        match codes.g.spindle_mode {
            Some(SpindleMode::SurfaceSpeed) => {
                self.modal.has_surface_speed = true;
                self.assume("G96: the spindle keeps its speed, the surface speed has no effect".to_owned());
                // D limits the speed, rpm.
                speed = block.take_rate('D')?;
            }
            Some(SpindleMode::ConstantSpeed) => self.modal.has_surface_speed = false,
            None if self.modal.has_surface_speed => speed = None,
            None => {}
        }
        self.modal.spindle_speed = speed.unwrap_or(self.modal.spindle_speed);
        if let Some(tool) =
            block.get('T').filter(|tool| tool.fract() != 0.0 && self.dialect == Dialect::Fanuc)
        {
            self.assume(format!(
                "word T{tool}: tool {}, the digits after the point have no effect",
                tool.trunc()
            ));
            block.truncate('T');
        }
        if let Some(tool) = block.get('T').filter(|tool| tool.fract() != 0.0) {
            return Err(format!(
                "word T: {tool} is a tool with an offset, as Fagor and Mazak have it: program T{}, or give --dialect fanuc \
                 for Mazak",
                tool.trunc()
            ));
        }
        if let Some(tool) = block.take_integer('T')? {
            self.modal.selected_tool = tool;
            self.push_event(ProgramEvent::ToolSelection(tool));
        }
        let of_macro = matches!(codes.g.action, Some(Action::ToolChange111 | Action::ToolChange116));
        match codes.m.tool_change.or(of_macro.then_some(ToolChange::Change)) {
            Some(ToolChange::Change) => {
                if of_macro && block.has_any(&['P', 'Q', 'R']) {
                    // G111 and G116 are macros of the machine builder.
                    self.assume("words P, Q and R of a tool change macro have no effect".to_owned());
                    block.skip("PQR");
                }
                // Of two words T, Mazak loads the first one and prepares the second.
                let first = block.first_tool.and_then(integer).filter(|_| self.dialect.has_macro_b());
                self.modal.tool = first.unwrap_or(self.modal.selected_tool);
                self.push_event(ProgramEvent::ToolChange(self.modal.tool));
                self.push_pause(self.options.tool_change_time);
            }
            Some(ToolChange::SetNumber) => {
                self.modal.tool =
                    block.take_integer('Q')?.ok_or("M61 requires Q, the tool in the spindle")?;
            }
            None => {}
        }
        let direction = match codes.m.spindle {
            Some(Spindle::Clockwise) => Some(1.0),
            Some(Spindle::Counterclockwise) => Some(-1.0),
            Some(Spindle::Off) => Some(0.0),
            None => codes.m.spindle_with_coolant.map(|code| match code {
                SpindleWithCoolant::Clockwise => 1.0,
                SpindleWithCoolant::Counterclockwise => -1.0,
            }),
        };
        if self.dialect == Dialect::Marlin && direction.is_some() {
            // Power of a laser or spindle.
            block.skip("IOP");
        }
        self.modal.spindle_direction = direction.unwrap_or(self.modal.spindle_direction);
        if direction.is_some() || (speed.is_some() && self.modal.spindle_direction != 0.0) {
            self.push_spindle(1.0);
        }
        Ok(())
    }

    /// Appends the spindle speed, with `sign` −1 against its direction and 0 for a stop.
    pub(super) fn push_spindle(&mut self, sign: f64) {
        let speed = self.modal.spindle_direction * self.modal.spindle_speed * RPM;
        self.push_event(ProgramEvent::Spindle(sign * speed));
        self.push_pause(self.options.spindle_time);
    }

    /// Appends a standstill for an auxiliary function, s.
    pub(super) fn push_pause(&mut self, time: f64) {
        if time > 0.0 {
            self.push_event(ProgramEvent::Pause(time));
        }
    }

    fn set_coolant(&mut self, codes: &Codes) {
        let with_spindle = codes.m.spindle_with_coolant.map(|_| Coolant::Flood);
        let Some(code) = codes.m.coolant.or(with_spindle) else { return };
        let Modal { mist, flood, .. } = &mut self.modal;
        match code {
            Coolant::Mist => *mist = true,
            Coolant::Flood => *flood = true,
            Coolant::Off => (*mist, *flood) = (false, false),
        }
        self.push_event(ProgramEvent::Coolant { mist: self.modal.mist, flood: self.modal.flood });
    }

    fn dwell(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        if codes.g.action != Some(Action::Dwell) {
            return Ok(());
        }
        let time = self.dwell_time(block)?.ok_or("G4 requires P, the dwell in s")?;
        self.push_event(ProgramEvent::Dwell(time));
        Ok(())
    }

    /// Returns the dwell of the words P, or X and U of other controls, s.
    pub(super) fn dwell_time(&mut self, block: &mut LineWords) -> Outcome<Option<f64>> {
        let is_ngc = self.dialect == Dialect::LinuxCnc || self.dialect.is_firmware();
        if codes_of_seconds(block) && !is_ngc {
            let time = block.take_rate('X')?;
            return Ok(time.or(block.take_rate('U')?));
        }
        if self.dialect == Dialect::Okuma
            && let Some(time) = block.take_rate('F')?
        {
            return Ok(Some(time));
        }
        if self.dialect.is_firmware()
            && let Some(time) = block.take_rate('S')?
        {
            block.take('P');
            return Ok(Some(time));
        }
        let has_point = block.has_point('P');
        let Some(value) = block.take_rate('P')? else {
            return if is_ngc { Ok(None) } else { Ok(Some(0.0)) };
        };
        let has_ms = matches!(self.dialect, Dialect::Fanuc | Dialect::Haas);
        let is_ms = has_ms && !has_point || self.dialect == Dialect::Marlin;
        if is_ms && !self.has_given_dialect {
            self.assume(format!(
                "dwell P is in ms, as in the dialect {}; in s it would be {value} s",
                self.dialect
            ));
        } else if has_point && self.dialect == Dialect::Fanuc && value >= LONG_DWELL {
            self.assume(format!(
                "dwell P{value}. with a decimal point is {value} s, where Fanuc has P without one: write P{value} for \
                 {} s",
                value * MILLISECOND
            ));
        } else if !is_ms && !has_ms && value >= LONG_DWELL {
            self.assume(format!(
                "dwell P{value} is {value} s, as in the dialect {}; in ms, as Fanuc has it, it would be {} s \
                 (--dialect fanuc)",
                self.dialect,
                value * MILLISECOND
            ));
        } else if self.dialect == Dialect::Mach3 {
            self.assume(
                "dwell P is in s; with the setting \"G04 Dwell in ms\" of Mach3 it would be in ms".to_owned(),
            );
        }
        Ok(Some(if is_ms { value * MILLISECOND } else { value }))
    }

    fn set_plane_and_units(&mut self, block: &LineWords, codes: &Codes) {
        match codes.g.plane {
            Some(PlaneCode::Xy) => self.modal.plane = Plane::Xy,
            Some(PlaneCode::Zx) => self.modal.plane = Plane::Zx,
            Some(PlaneCode::Yz) => self.modal.plane = Plane::Yz,
            None => {}
        }
        match codes.g.units {
            Some(code @ (Units::Inch | Units::Inch70)) => {
                self.assume(format!("{}: lengths and feeds are in inches", g_name(code.number())));
                self.modal.length = INCH;
            }
            Some(Units::Millimeter | Units::Millimeter71) => self.modal.length = MILLIMETER,
            None => {
                // A parameter of these controls sets the units.
                let is_set = self.has_units || !matches!(self.dialect, Dialect::Fanuc | Dialect::Haas);
                let has_length = || "XYZ".chars().any(|axis| block.get(axis).is_some_and(|word| word != 0.0));
                if is_set || !has_length() {
                    return;
                }
                self.assume("lengths and feeds are in mm: no G20 or G21 stands before".to_owned());
            }
        }
        self.has_units = true;
    }

    /// Sets path control: G61, G61.1, G64.
    fn set_path_control(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let Some(code) = codes.g.path_control else { return Ok(()) };
        self.modal.path_control = match code {
            PathControlCode::ExactPath => PathControl::ExactPath,
            PathControlCode::ExactStop => PathControl::ExactStop,
            PathControlCode::Blend if self.dialect.has_macro_b() => self.options.path_control,
            PathControlCode::Blend => {
                let length = self.modal.length;
                let tolerance =
                    block.take_rate('P')?.filter(|tolerance| *tolerance > 0.0).map(|p| p * length);
                let merge_tolerance = block.take_rate('Q')?.map(|q| q * length);
                let rotary_tolerance = tolerance.map(|tolerance| tolerance / MILLIMETER * DEGREE);
                PathControl::Blend(Blend { tolerance, rotary_tolerance, merge_tolerance })
            }
        };
        Ok(())
    }

    fn set_distance_modes(&mut self, codes: &Codes) {
        let Modal { is_incremental, has_absolute_centers, retracts_to_initial, .. } = &mut self.modal;
        *is_incremental = codes.g.distance.map_or(*is_incremental, |code| code == Distance::Incremental);
        *has_absolute_centers =
            codes.g.arc_distance.map_or(*has_absolute_centers, |code| code == ArcDistance::Absolute);
        *retracts_to_initial =
            codes.g.retraction.map_or(*retracts_to_initial, |code| code == Retraction::ToInitial);
        if let Some(level) = codes.m.return_level {
            self.modal.return_level.0 = level;
        }
    }

    /// Saves, restores or discards the modes: M70 to M73.
    fn save_modes(&mut self, codes: &Codes) {
        match codes.m.modes {
            Some(SavedModes::Save | SavedModes::SaveForCall) => {
                self.saved_modes = Some(Box::new(self.modal.clone()));
            }
            Some(SavedModes::Discard) => self.saved_modes = None,
            Some(SavedModes::Restore) => {
                if let Some(saved) = self.saved_modes.take() {
                    let (tool, selected_tool, tcp_length) =
                        (self.modal.tool, self.modal.selected_tool, self.modal.tcp_length);
                    self.modal = Modal { tool, selected_tool, tcp_length, ..*saved };
                }
            }
            None => {}
        }
    }

    /// Executes the code that uses the axis words: a motion, a reference, an offset.
    fn act(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let motion = codes.g.motion;
        let is_given_length = codes.g.tool_length == Some(ToolLength::Given);
        let of_axes = match codes.g.action {
            Some(
                code @ (Action::Data
                | Action::ToReference
                | Action::ToSecondReference
                | Action::FromReference
                | Action::ReferenceCheck
                | Action::ReturnLevel
                | Action::Shift
                | Action::ShiftToPosition),
            ) => Some(code.number()),
            Some(code @ Action::StoreReference) if self.dialect == Dialect::Mach3 => Some(code.number()),
            _ => is_given_length.then_some(ToolLength::Given.number()),
        };
        // Post-processors write G0 G28, where the motion is a rapid traverse anyway.
        let is_plain = motion == Some(Motion::Rapid)
            && self.dialect != Dialect::Grbl
            && (self.dialect != Dialect::LinuxCnc
                || matches!(codes.g.action, Some(Action::ToReference | Action::ToSecondReference)));
        let is_end = motion == Some(Motion::Cancel) && self.dialect != Dialect::LinuxCnc;
        if let (Some(code), Some(motion), false) = (of_axes, motion, is_plain || is_end) {
            let [code, motion] = [code, motion.number()].map(g_name);
            return Err(format!("{code} and {motion} both use the axis words: program them in two lines"));
        }
        let mut is_machine = self.modal.is_machine;
        match codes.g.action {
            None
            | Some(Action::Dwell | Action::MacroCall | Action::ToolChange111 | Action::ToolChange116) => {}
            Some(Action::ReturnLevel) => {
                let drill = self.modal.plane.axes()[2];
                let level = block.take(AXIS_LETTERS[drill]).map(|level| level * self.modal.length);
                self.modal.return_level.1 =
                    Some(level.ok_or("G71 requires the level of retraction, as in G71 Z50")?);
            }
            Some(Action::MachineCoordinates)
                if self.dialect == Dialect::Fanuc && self.modal.is_incremental && block.has_axis() =>
            {
                self.assume("G53 has no effect with G91: the words are increments".to_owned());
            }
            Some(Action::MachineCoordinates) => is_machine = true,
            Some(Action::Data) => self.set_data(block)?,
            Some(Action::ToReference) => self.go_to_reference(block, 0)?,
            Some(Action::ToSecondReference) => self.go_to_reference(block, 1)?,
            Some(Action::ReferenceCheck) => {
                let end = self.targets(block)?;
                self.rapid_to(&end)?;
            }
            Some(Action::FromReference) => {
                let between = self.modal.between;
                self.rapid_to(&between)?;
                let end = self.targets(block)?;
                self.rapid_to(&end)?;
            }
            Some(Action::TiltTool | Action::TiltTool253) => self.tilt_tool(block)?,
            Some(Action::ClockwisePocket) => self.circular_pocket(block, true)?,
            Some(Action::CounterclockwisePocket) => self.circular_pocket(block, false)?,
            Some(Action::StoreReference) if self.dialect == Dialect::Mach3 => self.home_axes(block)?,
            Some(Action::StoreReference) => self.store_reference(0)?,
            Some(Action::StoreSecondReference) => self.store_reference(1)?,
            Some(Action::Shift) => self.shift(block, Action::Shift)?,
            Some(Action::ShiftToPosition) => self.shift(block, Action::ShiftToPosition)?,
            Some(Action::ClearShift) => {
                if self.dialect.has_macro_b() {
                    block.skip("XYZABCUVW");
                }
                [self.offsets.shift, self.offsets.local] = [[0.0; AXIS_COUNT]; 2];
                self.offsets.saved_shift = self.offsets.shift;
            }
            Some(Action::SuspendShift) => self.offsets.shift = [0.0; AXIS_COUNT],
            Some(Action::RestoreShift) => self.offsets.shift = self.offsets.saved_shift,
        }
        if let Some(motion) = motion {
            if !is_canned(motion) {
                self.modal.cycle = None;
            }
            self.modal.motion = match (motion, self.dialect) {
                (Motion::Cancel, Dialect::LinuxCnc | Dialect::Grbl) => None,
                (Motion::Cancel, _) => Some(Motion::Rapid),
                _ => Some(motion),
            };
        }
        if let Some(pattern) = codes.g.pattern {
            return self.hole_pattern(block, pattern);
        }
        if of_axes.is_some() { Ok(()) } else { self.move_by(block, motion, is_machine) }
    }

    fn stop(&mut self, codes: &Codes) -> Outcome<()> {
        match codes.m.stop {
            Some(Stop::Program | Stop::Pallet) => self.push_event(ProgramEvent::Stop),
            Some(Stop::Optional) => self.push_event(ProgramEvent::OptionalStop),
            Some(Stop::End | Stop::EndAndRewind) => self.end()?,
            None => {}
        }
        Ok(())
    }

    /// Ends the program.
    pub(super) fn end(&mut self) -> Outcome<()> {
        self.has_ended = true;
        self.finish_contour()?;
        self.push_event(ProgramEvent::End);
        Ok(())
    }
}

/// Returns true for a dwell in s by X or U.
fn codes_of_seconds(block: &LineWords) -> bool {
    block.has_any(&['X', 'U']) && block.get('P').is_none()
}
