//! Tool orientation with TRAORI: direction vectors, Euler and RPY angles.

use std::f64::consts::PI;

use nalgebra::Vector3;
use virtual_axes_core::units::DEGREE;

use super::super::error::Outcome;
use super::super::state::State;
use super::Sinumerik;
use super::frame::AxisFrame;
use super::modes::OrientationAngles;
use super::words::Words;
use crate::motion::{Coordinates, PathControl};

/// Largest angle between the tool and the great circle of ORIVECT within a line, rad.
const ORIENTATION_ERROR: f64 = 0.01 * DEGREE;
/// Most lines that one block becomes.
const MAX_PARTS: usize = 4096;

impl Sinumerik {
    /// Returns the tool axis in the workpiece that A3 B3 C3 or A2 B2 C2 of a block give; the words then count as used.
    pub(super) fn tool_axis(&self, words: &mut Words, state: &State) -> Outcome<Option<Vector3<f64>>> {
        let mut take = |names: [&str; 3]| -> Outcome<Option<Vector3<f64>>> {
            let mut found = false;
            let mut vector = Vector3::zeros();
            for (value, name) in vector.iter_mut().zip(names) {
                if let Some(number) = words.number(name)? {
                    (*value, found) = (number, true);
                }
            }
            Ok(found.then_some(vector))
        };
        let direction = take(["A3", "B3", "C3"])?;
        let angles = take(["A2", "B2", "C2"])?;
        let axis = match (direction, angles) {
            (None, None) => return Ok(None),
            (Some(_), Some(_)) => {
                return Err("A3 B3 C3 and A2 B2 C2 exclude each other in one block".to_owned());
            }
            (Some(direction), None) => direction,
            (None, Some(angles)) => {
                let [a, b, c] = [angles.x, angles.y, angles.z].map(|angle| angle * DEGREE);
                let rotation = match self.modes.orientation.angles {
                    OrientationAngles::Euler => {
                        AxisFrame::about(2, a).then(&AxisFrame::about(0, b)).then(&AxisFrame::about(2, c))
                    }
                    OrientationAngles::Rpy => AxisFrame::rotation([a, b, c]),
                    OrientationAngles::Rpy2 => {
                        AxisFrame::about(0, a).then(&AxisFrame::about(1, b)).then(&AxisFrame::about(2, c))
                    }
                };
                rotation.linear * Vector3::z()
            }
        };
        if state.modal.tcp_length.is_none() {
            return Err("A3 B3 C3 and A2 B2 C2 require TRAORI: program it in a block before".to_owned());
        }
        if axis.norm() < 1e-6 {
            return Err("A3 B3 C3: a direction of length 0".to_owned());
        }
        let axis = axis.normalize();
        Ok(Some(match self.modes.orientation.is_of_machine {
            true => axis,
            false => (state.map().linear * axis).normalize(),
        }))
    }

    /// Returns the axis positions of the rotary axes for a tool axis, nearest to the present ones.
    pub(super) fn rotary_axes(&self, axis: &Vector3<f64>, state: &State) -> Outcome<Coordinates> {
        let transform = state.options.kinematics.as_ref();
        let transform = transform.ok_or("TRAORI requires a machine with rotary axes")?;
        transform.oriented((*axis).into(), &self.axis_positions(state))
    }

    /// Moves along a line to programmed coordinates while the tool turns on a great circle to a tool axis in the workpiece.
    pub(super) fn line_with_vector(
        &mut self,
        end: &Coordinates,
        axis: &Vector3<f64>,
        is_rapid: bool,
        state: &mut State,
    ) -> Outcome<()> {
        let Some(transform) = state.options.kinematics.clone() else { return Ok(()) };
        let start = state.programmed();
        let first = transform.orientation(&state.position) * Vector3::z();
        let angle = first.cross(axis).norm().atan2(first.dot(axis));
        let mut parts = 1;
        if !self.modes.orientation.interpolates_axes
            && !is_rapid
            && angle > ORIENTATION_ERROR
            && angle < PI - 1e-6
        {
            // The largest deviation of one line, at parts that also see a turn of the rotary axes near the singularity.
            let deviation = [0.25, 0.5, 0.75].map(|part| {
                let mixed: Coordinates = std::array::from_fn(|index| {
                    state.position[index] + part * (end[index] + state.origin(index) - state.position[index])
                });
                let found = transform.orientation(&mixed) * Vector3::z();
                let wanted = great_circle(&first, axis, angle, part);
                found.cross(&wanted).norm().atan2(found.dot(&wanted))
            });
            let deviation = deviation.into_iter().fold(0.0, f64::max);
            // It falls with the square of the length of a line.
            parts = ((deviation / ORIENTATION_ERROR).sqrt().ceil() as usize).clamp(1, MAX_PARTS);
        }
        // From the end on, so that all parts have its solution of the rotary axes.
        let mut near = self.axis_positions(state);
        (3..6).for_each(|index| near[index] = end[index] + state.origin(index));
        let mut turns = Vec::with_capacity(parts);
        for part in (1..parts).rev() {
            let axis = great_circle(&first, axis, angle, part as f64 / parts as f64);
            near = transform.oriented(axis.into(), &near)?;
            turns.push(near);
        }
        let path_control = state.modal.path_control;
        for part in 1..=parts {
            let share = part as f64 / parts as f64;
            let mut point: Coordinates =
                std::array::from_fn(|index| start[index] + share * (end[index] - start[index]));
            if let Some(turn) = turns.pop() {
                (3..6).for_each(|index| point[index] = turn[index] - state.origin(index));
            }
            if part < parts && path_control == PathControl::ExactStop {
                state.modal.path_control = PathControl::ExactPath;
            } else {
                state.modal.path_control = path_control;
            }
            if part == parts {
                point[..3].copy_from_slice(&end[..3]);
                point[6..].copy_from_slice(&end[6..]);
            }
            if is_rapid { state.rapid_to(&point)? } else { state.line_to(&point)? }
        }
        state.modal.path_control = path_control;
        Ok(())
    }
}

/// Returns the direction at a part of the great circle between two directions with an angle between them, rad.
fn great_circle(first: &Vector3<f64>, last: &Vector3<f64>, angle: f64, part: f64) -> Vector3<f64> {
    if angle < 1e-12 {
        return *last;
    }
    ((1.0 - part) * angle).sin() / angle.sin() * first + (part * angle).sin() / angle.sin() * last
}
