//! Swiveled planes: CYCLE800.

use nalgebra::Vector3;
use virtual_axes_core::units::{DEGREE, MILLIMETER};

use super::super::error::Outcome;
use super::super::state::State;
use super::Sinumerik;
use super::frame::AxisFrame;
use super::value::ProgramValue;
use crate::motion::{AXIS_COUNT, Coordinates};

/// Modes of the angles: bits 6 and 7 of `_MODE`.
const BY_AXIS: u32 = 0;
const SOLID_ANGLES: u32 = 1;
const ROTARY_AXES: u32 = 3;

impl Sinumerik {
    /// Executes `CYCLE800(_FR,_TC,_ST,_MODE,_X0,_Y0,_Z0,_A,_B,_C,_X1,_Y1,_Z1,_DIR,_FR_I,_DMODE)`.
    pub(super) fn swivel(&mut self, values: &[Option<ProgramValue>], state: &mut State) -> Outcome<()> {
        let number = |index: usize| match values.get(index) {
            Some(Some(ProgramValue::Number(value))) => *value,
            _ => 0.0,
        };
        let is_deselected = matches!(values.get(1), Some(Some(ProgramValue::Text(name))) if name == "0");
        if values.iter().all(Option::is_none) || is_deselected {
            self.modes.tilt = None;
            self.modes.frame = AxisFrame::default();
            return self.modes.update_frame(state);
        }
        let mode = number(3).max(0.0) as u32;
        let length = state.modal.length;
        let [before, after] = [4, 10].map(|first| {
            let mut offset = [0.0; AXIS_COUNT];
            (0..3).for_each(|axis| offset[axis] = number(first + axis) * length);
            AxisFrame::translation(offset)
        });
        let angles = [7, 8, 9].map(|index| number(index) * DEGREE);
        let near = self.axis_positions(state);
        let (rotation, given) = match mode >> 6 & 3 {
            BY_AXIS => (by_axis(mode, angles), None),
            SOLID_ANGLES => (AxisFrame::about(2, angles[0]).then(&AxisFrame::about(1, angles[1])), None),
            ROTARY_AXES => {
                let positions = rotary_positions(angles, near, state)?;
                let transform = state.options.kinematics.as_ref().ok_or("CYCLE800 requires rotary axes")?;
                let linear = transform.orientation(&positions);
                (AxisFrame { linear, ..AxisFrame::default() }, Some(positions))
            }
            _ => {
                return Err(format!(
                    "CYCLE800: projection angles (_MODE {mode}) are not supported; post axis by axis (_MODE 57 or 27), \
                     solid angles (64) or rotary axes (192)"
                ));
            }
        };
        let is_additive = number(2).abs() as u32 % 10 == 1;
        let start = match &self.modes.tilt {
            Some(tilt) if is_additive => tilt.then(&self.modes.frame),
            _ if is_additive => self.modes.frame,
            _ => AxisFrame::default(),
        };
        let frame = start.then(&before).then(&rotation).then(&after);
        let direction = number(13);
        let angles = match given {
            Some(positions) => positions,
            None => {
                let axis = frame.linear * Vector3::z();
                let transform = state.options.kinematics.as_ref();
                let is_level = (axis - Vector3::z()).norm() < 1e-12;
                match transform {
                    Some(transform) => transform
                        .oriented_towards(axis.into(), &near, direction)
                        .map_err(|reason| format!("CYCLE800: {reason}"))?,
                    None if is_level => near,
                    None => return Err("CYCLE800 requires a machine with rotary axes".to_owned()),
                }
            }
        };
        if direction != 0.0 && mode >> 6 & 3 != ROTARY_AXES {
            require_travel(&angles, direction, state)?;
        }
        state.finish_contour()?;
        self.retract(number(0), state)?;
        self.modes.frame = AxisFrame::default();
        self.modes.tilt = Some(frame);
        if direction != 0.0 {
            self.align(&angles, state)?;
        }
        self.modes.update_frame(state)
    }

    /// Returns the axis positions, also with tool center point control.
    pub(super) fn axis_positions(&self, state: &State) -> Coordinates {
        let transform = state.options.kinematics.as_ref();
        transform
            .map_or(state.position, |transform| transform.positions(&state.position, state.modal.tcp_length))
    }

    /// Retracts before the swivel: 1 along Z, 2 along Z, then X and Y, to the reference, unless the axis is beyond it.
    fn retract(&mut self, kind: f64, state: &mut State) -> Outcome<()> {
        if state.modal.tcp_length.is_some() || !(1.0..=2.0).contains(&kind) {
            return Ok(());
        }
        let reference = state.options.references[0];
        let mut end = state.position;
        end[2] = end[2].max(reference[2]);
        state.push_rapid(end)?;
        if kind == 2.0 {
            end[..2].copy_from_slice(&reference[..2]);
            state.push_rapid(end)?;
        }
        Ok(())
    }

    /// Moves the rotary axes to positions at rapid traverse.
    fn align(&mut self, angles: &Coordinates, state: &mut State) -> Outcome<()> {
        let mut end = state.position;
        end[3..6].copy_from_slice(&angles[3..6]);
        state.push_rapid(end)
    }
}

/// Rejects angles of which no solution is within the travel of the rotary axes, and notes a solution that is not the one of
/// `direction` (`_DIR`): the control takes the other one, if one cannot be reached.
fn require_travel(angles: &Coordinates, direction: f64, state: &mut State) -> Outcome<()> {
    let Some(transform) = &state.options.kinematics else { return Ok(()) };
    let other = transform.other_solution(angles);
    let other_excess = other.map(|other| transform.rotary_excess(&other)).unwrap_or_default();
    let excess = transform.rotary_excess(angles);
    if !excess.is_empty() {
        let other = if other_excess.is_empty() {
            String::new()
        } else {
            format!("; of the other solution, {other_excess}")
        };
        return Err(format!(
            "CYCLE800: the rotary axes do not reach this plane: {excess}{other}; no work offset helps: program another \
             plane, clamp the workpiece in another way, or check on a machine with that travel"
        ));
    }
    let is_against = transform.first_rotary_axis().is_some_and(|first| direction * angles[first] < 0.0);
    if is_against && !other_excess.is_empty() {
        let (taken, opposite) = (transform.rotary_text(angles), if direction < 0.0 { "1" } else { "-1" });
        state.assume(format!(
            "CYCLE800 with _DIR={direction}: {other_excess}; the other solution {taken} is taken, as on the control: \
             that of _DIR={opposite}"
        ));
    }
    Ok(())
}

/// Returns the rotation of angles about successive axes, whose order is in bits 0 to 5: X is 1, Y is 2, Z is 3.
fn by_axis(mode: u32, angles: [f64; 3]) -> AxisFrame {
    let order = [0, 2, 4].map(|shift| mode >> shift & 3);
    // Without an order, as in 0: X, Y, Z.
    let order = if order.contains(&0) { [1, 2, 3] } else { order };
    let turns = order.into_iter().zip(angles).map(|(axis, angle)| AxisFrame::about(axis as usize - 1, angle));
    turns.fold(AxisFrame::default(), |frame, turn| frame.then(&turn))
}

/// Returns the axis positions with rotary axes at the first angles of CYCLE800, in the order of the machine.
fn rotary_positions(angles: [f64; 3], near: Coordinates, state: &State) -> Outcome<Coordinates> {
    let mut positions = near;
    let rotary = (3..6).filter(|axis| state.options.axes[*axis]);
    for (axis, angle) in rotary.zip(angles) {
        positions[axis] = angle;
    }
    match positions[3..6].iter().all(|angle| angle.abs() < 1e6 * MILLIMETER.recip()) {
        true => Ok(positions),
        false => Err("CYCLE800: an angle is out of range".to_owned()),
    }
}
