//! Execution of the words of one block: modes, tool and spindle, frames, then the motion, then stops.

use virtual_axes_core::units::{DEGREE, INCH, MILLIMETER, RPM};

use super::super::codes::FeedMode;
use super::super::error::Outcome;
use super::super::limits::MAX_RATE;
use super::super::parameters::integer;
use super::super::state::State;
use super::call::Invocation;
use super::coordinates::FrameOperation;
use super::index::ProgramLines;
use super::modes::MotionMode;
use super::motions::Suppression;
use super::value::ProgramValue;
use super::words::Words;
use super::{Sinumerik, keywords};
use crate::motion::{AXIS_COUNT, PathControl, Plane, ProgramEvent};

/// Counts a word without effect on the path.
pub(super) fn accept(name: &str, state: &mut State) {
    state.note_without_effect(name.to_owned());
}

/// Rejects a word that changes the geometry.
pub(super) fn reject(name: &str, remedy: &str, state: &mut State) -> Outcome<()> {
    state.reject(format!("{name} is not supported: {remedy}"))
}

/// Takes the effect from the codes that the options ignore.
fn ignore_codes(words: &mut Words, state: &mut State) {
    let Words { g, m, .. } = words;
    let mut ignored = Vec::new();
    let tenths = |code: &u32| u16::try_from(code * 10).unwrap_or(u16::MAX);
    for (letter, codes, is_ignored) in [
        ('G', g, &(|code: &u32| state.options.ignored.has_g(tenths(code))) as &dyn Fn(&u32) -> bool),
        ('M', m, &(|code: &u32| state.options.ignored.has_m(*code))),
    ] {
        ignored.extend(codes.iter().filter(|code| is_ignored(code)).map(|code| format!("{letter}{code}")));
        codes.retain(|code| !is_ignored(code));
    }
    for name in ignored {
        state.note_without_effect(name);
    }
}

impl Sinumerik {
    /// Executes the words of a block.
    pub(super) fn execute(
        &mut self,
        words: &mut Words,
        frame: Option<FrameOperation>,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        if words.take_g(4) {
            return self.dwell(words, state);
        }
        state.moves_in_machine_coordinates = false;
        ignore_codes(words, state);
        self.reject_codes(words, state)?;
        if words.take_group(&[25, 26])?.is_some() {
            // Limits of spindle speed and working area.
            words.take("S");
            words.axes = [None; AXIS_COUNT];
            accept("G25, G26", state);
        }
        self.set_units(words, state)?;
        self.set_feed(words, state)?;
        self.set_spindle(words, state)?;
        self.set_tool(words, state)?;
        self.set_coolant(words, state);
        self.set_transformation(words, state)?;
        self.set_coordinates(words, frame, state)?;
        self.set_path_control(words, state)?;
        if let Some(code) = words.take_group(&[340, 341])? {
            self.modes.approaches_in_space = code == 340;
        }
        words.take_g(140);
        let soft = self.soft_path(words, state)?;
        if let Some((path, false)) = &soft {
            self.set_motion_mode(words)?;
            self.retract_from_contour(path, words, state)?;
        }
        self.set_compensation(words, state)?;
        if let Some((path, true)) = soft {
            self.set_motion_mode(words)?;
            self.prepare_approach(path, words, state)?;
        }
        self.move_axes(words, state, lines)?;
        self.finish(words, state, lines)
    }

    /// Executes `G4 F` (seconds) and `G4 S` (revolutions), which leave feed and speed unchanged.
    fn dwell(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let time = match (words.positive("F", MAX_RATE)?, words.positive("S", MAX_RATE)?) {
            (Some(time), _) => time,
            (None, Some(_)) if state.modal.spindle_speed <= 0.0 => {
                return Err(
                    "G4 S requires a turning spindle: program S in a block before, or G4 F in s".to_owned()
                );
            }
            (None, Some(revolutions)) => 60.0 * revolutions / state.modal.spindle_speed,
            (None, None) => return Err("G4 requires F, the dwell in s, or S, in revolutions".to_owned()),
        };
        state.push_event(ProgramEvent::Dwell(time.min(MAX_RATE)));
        self.reject_rest(words, state)
    }

    fn set_units(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        match words.take_group(&[70, 71, 700, 710])? {
            Some(70) => (state.modal.length, self.modes.feed_length) = (INCH, MILLIMETER),
            Some(700) => (state.modal.length, self.modes.feed_length) = (INCH, INCH),
            Some(71 | 710) => (state.modal.length, self.modes.feed_length) = (MILLIMETER, MILLIMETER),
            _ => {}
        }
        let plane = match words.take_group(&[17, 18, 19])? {
            Some(17) => Plane::Xy,
            Some(18) => Plane::Zx,
            Some(19) => Plane::Yz,
            _ => state.modal.plane,
        };
        if plane != state.modal.plane {
            state.finish_contour()?;
            state.modal.plane = plane;
        }
        if let Some(code) = words.take_group(&[90, 91])? {
            state.modal.is_incremental = code == 91;
        }
        Ok(())
    }

    fn set_feed(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let code = words.take_group(&[93, 94, 95, 96, 97, 961, 962, 971, 972, 973])?;
        let mode = match code {
            Some(93) => FeedMode::InverseTime,
            Some(94 | 961 | 971) => FeedMode::PerMinute,
            Some(95..=97 | 962 | 972 | 973) => FeedMode::PerRevolution,
            _ => state.modal.feed_mode,
        };
        if matches!(code, Some(96 | 961 | 962)) {
            // S is the cutting speed of a lathe.
            words.take("S");
            state.assume("G96, G961, G962: the spindle keeps its speed".to_owned());
        }
        if mode != state.modal.feed_mode || mode == FeedMode::InverseTime {
            (state.modal.feed_word, state.modal.feed) = (0.0, None);
        }
        state.modal.feed_mode = mode;
        if let Some(feed) = words.positive("F", MAX_RATE)? {
            self.apply_feed(feed, state);
        }
        Ok(())
    }

    /// Sets the feed of a word.
    fn apply_feed(&self, feed: f64, state: &mut State) {
        let is_inverse = state.modal.feed_mode == FeedMode::InverseTime;
        let units = if is_inverse { [1.0; 2] } else { [self.modes.feed_length, DEGREE] };
        state.modal.feed_word = feed;
        state.modal.feed = (feed > 0.0).then(|| units.map(|unit| feed * unit));
    }

    fn set_spindle(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let speed = words.positive("S", MAX_RATE)?;
        state.modal.spindle_speed = speed.unwrap_or(state.modal.spindle_speed);
        let mut direction = None;
        words.m.retain(|code| {
            let found = match code {
                3 => Some(1.0),
                4 => Some(-1.0),
                5 => Some(0.0),
                _ => None,
            };
            direction = found.or(direction);
            found.is_none()
        });
        state.modal.spindle_direction = direction.unwrap_or(state.modal.spindle_direction);
        if direction.is_some() || (speed.is_some() && state.modal.spindle_direction != 0.0) {
            let speed = state.modal.spindle_direction * state.modal.spindle_speed * RPM;
            state.push_event(ProgramEvent::Spindle(speed));
            state.push_pause(state.options.spindle_time);
        }
        Ok(())
    }

    /// Sets the tool: T, M6, and the cutting edge D.
    fn set_tool(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        if let Some(word) = words.take("T") {
            let number = match word.value {
                ProgramValue::Number(number) => integer(number.trunc()).ok_or_else(|| {
                    format!("word T: {number} is invalid, a tool number or a name is required")
                })?,
                value => self.named_tool(&value.text(), state)?,
            };
            state.modal.selected_tool = number;
            state.push_event(ProgramEvent::ToolSelection(number));
        }
        let changes = words.m.contains(&6) | std::mem::take(&mut self.changes_tool);
        words.m.retain(|code| *code != 6);
        let mut has_edge = false;
        if changes {
            self.change_tool(state);
            has_edge = true;
        }
        if let Some(edge) = words.integer("D")? {
            (self.modes.edge, has_edge) = (edge, true);
        }
        if has_edge { self.modes.update_tool_length(state) } else { Ok(()) }
    }

    /// Changes to the selected tool, with its first cutting edge.
    fn change_tool(&mut self, state: &mut State) {
        state.modal.tool = state.modal.selected_tool;
        self.modes.edge = 1;
        state.push_event(ProgramEvent::ToolChange(state.modal.tool));
        state.push_pause(state.options.tool_change_time);
    }

    /// Returns the number of a tool by its name; a name that the table lacks gets a number of its own.
    fn named_tool(&mut self, name: &str, state: &State) -> Outcome<u32> {
        if let Some((number, _)) = state.options.tools.named(name) {
            return Ok(number);
        }
        if let Ok(number) = name.trim().parse::<u32>() {
            return Ok(number);
        }
        if let Some(number) = self.modes.tool_names.get(name) {
            return Ok(*number);
        }
        if state.options.default_tool_length.is_none() {
            return Err(format!("tool {name:?} is not in the tool table: add its name, length and radius"));
        }
        let is_free = |number: &u32| {
            state.options.tools.get(*number).is_none()
                && !self.modes.tool_names.values().any(|used| used == number)
        };
        let number = (1..u32::MAX).find(is_free).unwrap_or(u32::MAX);
        self.modes.tool_names.insert(name.to_owned(), number);
        Ok(number)
    }

    fn set_coolant(&mut self, words: &mut Words, state: &mut State) {
        let mut has_code = false;
        words.m.retain(|code| {
            match code {
                7 => state.modal.mist = true,
                8 => state.modal.flood = true,
                9 => (state.modal.mist, state.modal.flood) = (false, false),
                _ => return true,
            }
            has_code = true;
            false
        });
        if has_code {
            let (mist, flood) = (state.modal.mist, state.modal.flood);
            state.push_event(ProgramEvent::Coolant { mist, flood });
        }
    }

    /// Sets TRAORI, TRAFOOF and the mode of the orientation.
    fn set_transformation(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let orientation = &mut self.modes.orientation;
        words.keywords.retain(|keyword| !orientation.set(keyword));
        if words.take_keyword("TRAFOOF") && state.modal.tcp_length.is_some() {
            state.finish_contour()?;
            state.leave_tcp();
            self.modes.update_tool_length(state)?;
            self.modes.update_frame(state)?;
        }
        if words.take_keyword("TRAORI") && state.modal.tcp_length.is_none() {
            if state.options.kinematics.is_none() {
                return Err("TRAORI requires a machine with rotary axes".to_owned());
            }
            let length = self.modes.tool_length(state)?;
            state.finish_contour()?;
            state.enter_tcp(length)?;
            self.modes.update_frame(state)?;
        }
        Ok(())
    }

    fn set_motion_mode(&mut self, words: &mut Words) -> Outcome<()> {
        self.modes.motion = match words.take_group(&[0, 1, 2, 3])? {
            Some(0) => MotionMode::Rapid,
            Some(1) => MotionMode::Line,
            Some(2) => MotionMode::Clockwise,
            Some(3) => MotionMode::Counterclockwise,
            _ => self.modes.motion,
        };
        Ok(())
    }

    /// Executes the motion of the block.
    fn move_axes(
        &mut self,
        words: &mut Words,
        state: &mut State,
        lines: &mut dyn ProgramLines,
    ) -> Outcome<()> {
        for (keyword, mode) in [("CIP", MotionMode::ThroughPoint), ("CT", MotionMode::Tangential)] {
            if words.take_keyword(keyword) {
                self.modes.motion = mode;
            }
        }
        self.set_motion_mode(words)?;
        let is_exact = words.take_g(9);
        let suppresses = words.take_group(&[53, 153])?.is_some() | words.take_keyword("SUPA");
        let suppression = if suppresses { Suppression::All } else { Suppression::None };
        if let Some(code) = words.take_group(&[74, 75])? {
            return self.move_to_reference(code, words, state);
        }
        if let Some(_code) = words.take_group(&[331, 332, 63])? {
            return match words.has("I") || words.has("J") || words.has("K") {
                true => self.tap(words, state),
                false => {
                    self.modes.motion = MotionMode::Line;
                    self.motion(words, Suppression::None, state)
                }
            };
        }
        if let Some(rounding) = words.positive("RNDM", MAX_RATE)? {
            self.modes.rounding = rounding * state.modal.length;
        }
        let block_feed = words.positive("FB", MAX_RATE)?.filter(|feed| *feed > 0.0);
        if !self.moves(words) {
            return Ok(());
        }
        let path_control = state.modal.path_control;
        if is_exact {
            state.modal.path_control = PathControl::ExactStop;
        }
        let feed = (state.modal.feed_word, state.modal.feed);
        if let Some(block_feed) = block_feed {
            self.apply_feed(block_feed, state);
        }
        let result = self.motion(words, suppression, state);
        state.modal.path_control = path_control;
        (state.modal.feed_word, state.modal.feed) = feed;
        result?;
        if suppression == Suppression::All { Ok(()) } else { self.repeat_modal_call(state, lines) }
    }

    /// Moves the axes of the block to a reference (G74) or fixed point (G75) at rapid traverse.
    fn move_to_reference(&mut self, code: u32, words: &mut Words, state: &mut State) -> Outcome<()> {
        let point = words.integer("FP")?.unwrap_or(1);
        let reference = state.options.references[usize::from(code == 75 && point == 2)];
        if state.modal.tcp_length.is_some() {
            return Err(format!("G{code} with TRAORI: program TRAFOOF first"));
        }
        state.moves_in_machine_coordinates = true;
        let mut end = state.position;
        for (axis, word) in words.axes.iter_mut().enumerate() {
            if word.take().is_some() && state.options.axes[axis] {
                end[axis] = reference[axis];
            }
        }
        state.push_rapid(end)
    }

    /// Executes stops, the end and the return, and rejects what nothing has used.
    fn finish(&mut self, words: &mut Words, state: &mut State, lines: &mut dyn ProgramLines) -> Outcome<()> {
        let mut ends = false;
        let mut returns = words.take_keyword("RET") | words.take_keyword("ENDPROC");
        let subprogram = words.integer("L")?;
        let times = if subprogram.is_some() { words.integer("P")?.unwrap_or(1) } else { 1 };
        for code in std::mem::take(&mut words.m) {
            match code {
                0 => state.push_event(ProgramEvent::Stop),
                1 => state.push_event(ProgramEvent::OptionalStop),
                2 | 30 => ends = true,
                17 => returns = true,
                code => accept(&format!("M{code}"), state),
            }
        }
        self.reject_rest(words, state)?;
        if ends {
            self.require_no_approach()?;
            return state.end();
        }
        if returns {
            return self.return_or_end(state, lines);
        }
        match subprogram {
            None => Ok(()),
            Some(number) => {
                let name = format!("L{number}");
                if !self.has_subprogram(&name, state, lines)? {
                    self.accept_absent(&name, state)?;
                    if !std::mem::take(&mut self.changes_tool) {
                        return Ok(());
                    }
                    self.change_tool(state);
                    return self.modes.update_tool_length(state);
                }
                let invocation = Invocation { name, arguments: Vec::new() };
                self.call(invocation, times, state, lines)
            }
        }
    }

    /// Counts the G codes without effect, and rejects those that are not supported.
    fn reject_codes(&self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let is_known = |code: &u32| keywords::is_executed_g(*code);
        for code in words.g.iter().filter(|code| !is_known(code)) {
            let name = format!("G{code}");
            match keywords::is_accepted_g(*code) {
                true => accept(&name, state),
                false => reject(&name, keywords::g_remedy(*code), state)?,
            }
        }
        if words.g.iter().any(|code| matches!(code, 33..=35 | 335 | 336)) {
            // Pitch and start angle of a thread belong to its code.
            ["I", "J", "K", "SF"].into_iter().for_each(|name| drop(words.take(name)));
        }
        if words.g.iter().any(|code| matches!(code, 158 | 258 | 259)) {
            // Shift and angle belong to the code.
            words.take("RPL");
            words.axes = [None; AXIS_COUNT];
        }
        words.g.retain(is_known);
        Ok(())
    }

    /// Counts the words without effect that are left, and rejects the others.
    fn reject_rest(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        for keyword in std::mem::take(&mut words.keywords) {
            reject(&keyword, "it does not belong to this block", state)?;
        }
        let rest: Vec<String> = words.rest().map(str::to_owned).collect();
        for name in rest {
            match keywords::is_accepted(&name) || name == "S" || name == "M" || name == "T" {
                true => accept(&name, state),
                false => {
                    let remedy = keywords::remedy(&name);
                    let remedy = remedy.unwrap_or(
                        "it has no effect in this block: remove it, or program the code that it belongs to",
                    );
                    reject(&name, remedy, state)?;
                }
            }
        }
        if words.has_axis() {
            return Err("axis words without a motion: program them in a block of their own".to_owned());
        }
        Ok(())
    }
}
