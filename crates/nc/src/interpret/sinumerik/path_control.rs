//! Path control and cutter radius compensation: G60, G64, G641 to G645, ADIS, CTOL, OTOL, G40 to G42.

use virtual_axes_core::units::DEGREE;

use super::super::contour::Compensation;
use super::super::error::Outcome;
use super::super::limits::MAX_RATE;
use super::super::state::State;
use super::Sinumerik;
use super::execute::reject;
use super::modes::{PathMode, active_tool};
use super::words::Words;

impl Sinumerik {
    pub(super) fn set_path_control(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        let mut is_changed = false;
        if let Some(distance) = words.positive("ADIS", MAX_RATE)? {
            self.modes.smoothing_distance = distance * state.modal.length;
            is_changed = true;
        }
        words.positive("ADISPOS", MAX_RATE)?;
        if let Some(tolerance) = words.number("CTOL")? {
            self.modes.tolerance = (tolerance > 0.0).then_some(tolerance * state.modal.length);
            is_changed = true;
        }
        if let Some(tolerance) = words.number("OTOL")? {
            self.modes.rotary_tolerance = (tolerance > 0.0).then_some(tolerance * DEGREE);
            is_changed = true;
        }
        if let Some(code) = words.take_group(&[60, 64, 641, 642, 643, 644, 645])? {
            self.modes.path = match code {
                60 => PathMode::ExactStop,
                64 => PathMode::Continuous,
                641 => PathMode::Distance(0.0),
                _ => PathMode::Tolerance,
            };
            is_changed = true;
        }
        if let PathMode::Distance(distance) = &mut self.modes.path {
            *distance = self.modes.smoothing_distance;
        }
        if is_changed {
            self.modes.update_path_control(state);
        }
        Ok(())
    }

    /// Sets outside corners, start and end of compensation: G450, G451, DISC, NORM, KONT.
    fn set_corners(&self, words: &mut Words, state: &mut State) -> Outcome<()> {
        if let Some(code) = words.take_group(&[450, 451])? {
            state.contour.has_intersections = code == 451;
        }
        if words.number("DISC")?.is_some_and(|share| share > 0.0) {
            return reject("DISC above 0", "program DISC=0, or G451", state);
        }
        if words.take_keyword("KONT") {
            state.contour.goes_around = true;
        }
        if words.take_keyword("NORM") {
            state.contour.goes_around = false;
        }
        Ok(())
    }

    pub(super) fn set_compensation(&mut self, words: &mut Words, state: &mut State) -> Outcome<()> {
        self.set_corners(words, state)?;
        let offset = words.number("OFFN")?.map_or(0.0, |offset| offset * state.modal.length);
        match words.take_group(&[40, 41, 42])? {
            None => Ok(()),
            Some(40) => {
                self.modes.is_tool_left = None;
                state.compensate(None)
            }
            Some(code) => {
                self.modes.is_tool_left = Some(code == 41);
                let known = state.options.tools.get(active_tool(state)).map(|tool| tool.radius);
                if known.is_none() && self.modes.edge != 0 {
                    let tool = self.modes.tool_text(active_tool(state));
                    state.assume(format!("{tool} is not in the tool table: radius 0 mm"));
                }
                let radius = if self.modes.edge == 0 { 0.0 } else { known.unwrap_or(0.0) };
                state.compensate(Some(Compensation { is_left: code == 41, radius: radius + offset }))
            }
        }
    }
}
