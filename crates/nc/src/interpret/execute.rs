//! Execution of one line, in the order of LinuxCNC: feed, spindle, tool, coolant, dwell, plane, units, tool length,
//! coordinate system, path control, distance mode, motion, stop.

use virtual_axes_core::units::{DEGREE, MILLIMETER, RPM};

use super::codes::{Codes, Group, MGroup, g_name};
use super::error::Outcome;
use super::limits::MAX_RATE;
use super::line_words::{LineWords, Setting};
use super::state::{FeedMode, Jump, State};
use crate::motion::{Blend, PathControl, Plane, ProgramEvent};

/// Millimeters in an inch.
const INCH: f64 = 25.4 * MILLIMETER;

impl State {
    /// Executes a line; its steps are appended to `steps`.
    pub(super) fn execute(&mut self, block: &mut LineWords) -> Outcome<()> {
        for (target, value) in block.settings.drain(..) {
            match target {
                Setting::Number(number) => self.parameters.set_numbered(number, value)?,
                Setting::Name(name) if self.is_of_control(&name) => {
                    return Err(format!("#<{name}>: a value of the control, which cannot be set"));
                }
                Setting::Name(name) => self.parameters.set_named(&name, value)?,
            }
        }
        if self.spline.is_some() && block.is_ignored() {
            return Ok(());
        }
        if self.spline.is_some() && !block.is_empty() {
            return self.spline_line(block);
        }
        let codes = Codes::new(block)?;
        self.set_feed(block, &codes)?;
        self.set_spindle_and_tool(block, &codes)?;
        if block.is_ignored() {
            // The other words belong to the ignored codes.
            return Ok(());
        }
        self.set_coolant(&codes);
        self.dwell(block, &codes)?;
        self.set_plane_and_units(&codes);
        self.set_tool_length(block, &codes)?;
        self.set_coordinate_system(&codes);
        self.set_path_control(block, &codes)?;
        self.set_distance_modes(&codes);
        self.act(block, &codes)?;
        self.stop(&codes);
        self.jump(block, &codes)?;
        block.require_used()
    }

    /// Sets feed mode and feed: G93, G94, G95, F.
    fn set_feed(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let mode = match codes.g(Group::FeedMode) {
            Some(930) => FeedMode::InverseTime,
            Some(940) => FeedMode::PerMinute,
            Some(950) => FeedMode::PerRevolution,
            _ => self.modal.feed_mode,
        };
        // A feed of another mode has no meaning, and G93 requires a feed in each line.
        if mode != self.modal.feed_mode || mode == FeedMode::InverseTime {
            (self.modal.feed_word, self.modal.feed) = (0.0, None);
        }
        self.modal.feed_mode = mode;
        if let Some(feed) = take_rate(block, 'F')? {
            let units = if mode == FeedMode::InverseTime { [1.0; 2] } else { [self.modal.length, DEGREE] };
            self.modal.feed_word = feed;
            self.modal.feed = (feed > 0.0).then(|| units.map(|unit| feed * unit));
        }
        Ok(())
    }

    /// Sets spindle and tool: S, T, M6, M3, M4, M5, G97.
    fn set_spindle_and_tool(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let speed = take_rate(block, 'S')?;
        self.modal.spindle_speed = speed.unwrap_or(self.modal.spindle_speed);
        if let Some(tool) = block.take_integer('T')? {
            self.modal.selected_tool = tool;
            self.push_event(ProgramEvent::ToolSelection(tool));
        }
        if codes.m(MGroup::ToolChange).is_some() {
            self.modal.tool = self.modal.selected_tool;
            self.push_event(ProgramEvent::ToolChange(self.modal.tool));
        }
        let direction = match codes.m(MGroup::Spindle) {
            Some(3) => Some(1.0),
            Some(4) => Some(-1.0),
            Some(_) => Some(0.0),
            None => None,
        };
        self.modal.spindle_direction = direction.unwrap_or(self.modal.spindle_direction);
        if direction.is_some() || (speed.is_some() && self.modal.spindle_direction != 0.0) {
            let speed = self.modal.spindle_direction * self.modal.spindle_speed * RPM;
            self.push_event(ProgramEvent::Spindle(speed));
        }
        Ok(())
    }

    fn set_coolant(&mut self, codes: &Codes) {
        let Some(code) = codes.m(MGroup::Coolant) else { return };
        self.modal.mist = code == 7 || (code == 8 && self.modal.mist);
        self.modal.flood = code == 8 || (code == 7 && self.modal.flood);
        self.push_event(ProgramEvent::Coolant { mist: self.modal.mist, flood: self.modal.flood });
    }

    fn dwell(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        if codes.g(Group::NonModal) != Some(40) {
            return Ok(());
        }
        let time = take_rate(block, 'P')?.ok_or("G4 requires P, the dwell in s")?;
        self.push_event(ProgramEvent::Dwell(time));
        Ok(())
    }

    fn set_plane_and_units(&mut self, codes: &Codes) {
        match codes.g(Group::Plane) {
            Some(170) => self.modal.plane = Plane::Xy,
            Some(180) => self.modal.plane = Plane::Zx,
            Some(_) => self.modal.plane = Plane::Yz,
            None => {}
        }
        match codes.g(Group::Units) {
            Some(200) => self.modal.length = INCH,
            Some(_) => self.modal.length = MILLIMETER,
            None => {}
        }
    }

    /// Sets path control: G61, G61.1, G64.
    fn set_path_control(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let Some(code) = codes.g(Group::PathControl) else { return Ok(()) };
        self.modal.path_control = match code {
            610 => PathControl::ExactPath,
            611 => PathControl::ExactStop,
            _ => {
                let length = self.modal.length;
                let tolerance =
                    take_rate(block, 'P')?.filter(|tolerance| *tolerance > 0.0).map(|p| p * length);
                let merge_tolerance = take_rate(block, 'Q')?.map(|q| q * length);
                let rotary_tolerance = tolerance.map(|tolerance| tolerance / MILLIMETER * DEGREE);
                PathControl::Blend(Blend { tolerance, rotary_tolerance, merge_tolerance })
            }
        };
        Ok(())
    }

    fn set_distance_modes(&mut self, codes: &Codes) {
        if let Some(code) = codes.g(Group::Distance) {
            self.modal.is_incremental = code == 910;
        }
        if let Some(code) = codes.g(Group::ArcDistance) {
            self.modal.has_absolute_centers = code == 901;
        }
        if let Some(code) = codes.g(Group::Retract) {
            self.modal.retracts_to_initial = code == 980;
        }
    }

    /// Executes the code that uses the axis words: a motion, a reference, an offset.
    fn act(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        let action = codes.g(Group::NonModal).filter(|code| !matches!(code, 40 | 530));
        let motion = codes.g(Group::Motion);
        let of_axes = action.filter(|code| matches!(code, 100 | 280 | 300 | 520 | 920));
        let of_axes = of_axes.or(codes.g(Group::ToolLength).filter(|code| *code == 431));
        // Post-processors write G0 G28 and G0 G30, where the motion is a rapid traverse anyway.
        let is_plain = matches!((action, motion), (Some(280 | 300), Some(0)));
        if let (Some(code), Some(motion), false) = (of_axes, motion, is_plain) {
            let names = (g_name(code), g_name(motion));
            return Err(format!(
                "{} and {} both use the axis words: program them in two lines",
                names.0, names.1
            ));
        }
        if let Some(code) = action {
            self.act_once(code, block)?;
        }
        let is_machine = codes.g(Group::NonModal) == Some(530);
        if let Some(motion) = motion {
            if self.modal.motion != Some(motion) {
                self.modal.cycle = None;
            }
            self.modal.motion = (motion != 800).then_some(motion);
        }
        if of_axes.is_some() { Ok(()) } else { self.move_by(block, motion, is_machine) }
    }

    /// Executes a code that acts in its line only.
    fn act_once(&mut self, code: u16, block: &mut LineWords) -> Outcome<()> {
        match code {
            100 => self.set_offset_data(block),
            280 => self.go_to_reference(block, 0),
            300 => self.go_to_reference(block, 1),
            281 => self.store_reference(0),
            301 => self.store_reference(1),
            520 | 920 => self.shift(block, code),
            _ => {
                self.change_shift(code);
                Ok(())
            }
        }
    }

    fn stop(&mut self, codes: &Codes) {
        match codes.m(MGroup::Stop) {
            Some(0) => self.push_event(ProgramEvent::Stop),
            Some(1) => self.push_event(ProgramEvent::OptionalStop),
            Some(_) => self.end(),
            None => {}
        }
    }

    /// Requests the call of a subprogram or the return from it: M98 P L, M99.
    fn jump(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        self.jump = match codes.m(MGroup::Subprogram) {
            Some(98) => {
                let program =
                    block.take_integer('P')?.ok_or("M98 requires P, the number of the subprogram")?;
                Some(Jump::Call { program, times: block.take_integer('L')?.unwrap_or(1) })
            }
            Some(_) => Some(Jump::Return),
            None => None,
        };
        Ok(())
    }

    /// Ends the program.
    pub(super) fn end(&mut self) {
        self.push_event(ProgramEvent::End);
        self.has_ended = true;
    }
}

/// Returns the value of a word that must be 0 or positive, which then counts as used.
pub(super) fn take_rate(block: &mut LineWords, letter: char) -> Outcome<Option<f64>> {
    match block.take(letter) {
        Some(value) if !(0.0..=MAX_RATE).contains(&value) => {
            Err(format!("word {letter}: {value} is invalid, must be between 0 and {MAX_RATE:e}"))
        }
        value => Ok(value),
    }
}
