//! Coordinate systems: settable frames, programmable frames and the pole.

use virtual_axes_core::units::DEGREE;

use super::super::error::Outcome;
use super::super::state::State;
use super::Sinumerik;
use super::frame::AxisFrame;
use super::words::{Approach, Words};
use crate::motion::AXIS_COUNT;

/// Instruction that changes the programmable frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FrameOperation {
    kind: FrameKind,
    /// True if it acts in the present frame (ATRANS), false if it replaces it.
    is_additive: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FrameKind {
    Translation,
    Rotation,
    Scale,
    Mirror,
}

impl FrameOperation {
    /// Returns the instruction by its keyword.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        let (name, is_additive) = match name.strip_prefix('A') {
            Some(rest) => (rest, true),
            None => (name, false),
        };
        let kind = match name {
            "TRANS" => FrameKind::Translation,
            "ROT" => FrameKind::Rotation,
            "SCALE" => FrameKind::Scale,
            "MIRROR" => FrameKind::Mirror,
            _ => return None,
        };
        Some(Self { kind, is_additive })
    }
}

impl Sinumerik {
    /// Sets settable and programmable frames, and the pole.
    pub(super) fn set_coordinates(
        &mut self,
        words: &mut Words,
        frame: Option<FrameOperation>,
        state: &mut State,
    ) -> Outcome<()> {
        let settable = words.take_any(|code| matches!(code, 54..=57 | 500 | 505..=599))?;
        if let Some(code) = settable {
            let number = match code {
                54..=57 => code - 53,
                code => code - 500,
            };
            self.modes.has_settable_frame = number > 0;
            if let Some(system) = (number as usize).checked_sub(1) {
                select_system(system, state);
            }
            self.modes.update_frame(state)?;
        }
        if let Some(operation) = frame {
            self.change_frame(operation, words, state)?;
        }
        for (code, is_fine) in [(58, false), (59, true)] {
            if words.take_g(code) {
                for (axis, word) in words.axes.iter_mut().enumerate() {
                    let Some((value, _)) = word.take() else { continue };
                    let frame = &mut self.modes.frame;
                    let offset = if is_fine { &mut frame.fine } else { &mut frame.offset };
                    offset[axis] = value * state.unit(axis);
                }
                self.modes.update_frame(state)?;
            }
        }
        if let Some(code) = words.take_group(&[110, 111, 112])? {
            let [first, second, _] = state.modal.plane.axes();
            let position = state.programmed();
            let base = match code {
                110 => [position[first], position[second]],
                111 => [0.0; 2],
                _ => self.modes.pole,
            };
            let mut offset = [0.0; 2];
            for (offset, axis) in offset.iter_mut().zip([first, second]) {
                *offset = words.axes[axis].take().map_or(0.0, |(value, _)| value * state.modal.length);
            }
            if let Some(radius) = words.number("RP")? {
                let angle = words.number("AP")?.unwrap_or(0.0) * DEGREE;
                let radius = radius * state.modal.length;
                offset = [radius * angle.cos(), radius * angle.sin()];
            }
            self.modes.pole = [base[0] + offset[0], base[1] + offset[1]];
        }
        Ok(())
    }

    fn change_frame(
        &mut self,
        operation: FrameOperation,
        words: &mut Words,
        state: &mut State,
    ) -> Outcome<()> {
        let mut values = [None; AXIS_COUNT];
        for (value, word) in values.iter_mut().zip(&mut words.axes) {
            *value = word.take().map(|(value, _): (f64, Approach)| value);
        }
        let of = |axis: usize| values[axis].unwrap_or(0.0);
        let inner = match operation.kind {
            FrameKind::Translation => {
                let offset = std::array::from_fn(|axis| of(axis) * state.unit(axis));
                match operation.is_additive {
                    true => AxisFrame { fine: offset, ..AxisFrame::default() },
                    false => AxisFrame::translation(offset),
                }
            }
            FrameKind::Rotation => match words.number("RPL")? {
                Some(angle) => AxisFrame::about(state.modal.plane.axes()[2], angle * DEGREE),
                None => AxisFrame::rotation([0, 1, 2].map(|axis| of(axis) * DEGREE)),
            },
            FrameKind::Scale => AxisFrame::scaling([0, 1, 2].map(|axis| values[axis].unwrap_or(1.0))),
            FrameKind::Mirror => {
                AxisFrame::scaling([0, 1, 2].map(|axis| if values[axis].is_some() { -1.0 } else { 1.0 }))
            }
        };
        let is_rotary = (3..6).any(|axis| values[axis].is_some());
        if is_rotary && operation.kind != FrameKind::Translation {
            return Err("ROT, SCALE and MIRROR of a rotary axis are not supported: program TRANS".to_owned());
        }
        self.modes.frame = match operation.is_additive {
            true => self.modes.frame.then(&inner),
            false => inner,
        };
        self.modes.update_frame(state)
    }
}

/// Selects a work offset of the options, which is reported if it is not given.
fn select_system(system: usize, state: &mut State) {
    state.offsets.active = system;
    let given = &state.options.given_work_offsets;
    if given.as_ref().is_some_and(|given| !given.contains(&system)) {
        let code = if system < 4 { 54 + system } else { 501 + system };
        state.assume(format!("work offset G{code} is not given: the workpiece frame of the machine"));
    }
}
