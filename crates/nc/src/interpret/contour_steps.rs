//! Steps of the contour: motions and events pass corners and cutter radius compensation in their order.

use super::contour::{Compensation, Compensator, Contour, ContourPiece, Point, SAME, require_in_front};
use super::dialect::Dialect;
use super::error::Outcome;
use super::state::State;
use crate::motion::{Feed, MotionKind, ProgramEvent, ProgramMotion, ProgramStep};

impl State {
    /// Starts cutter radius compensation with the next motion in the active plane, or ends it (`None`). That in effect
    /// continues.
    pub(super) fn compensate(&mut self, compensation: Option<Compensation>) -> Outcome<()> {
        let plane = self.modal.plane;
        // A tool of radius 0 follows the contour.
        let compensation = compensation.filter(|compensation| compensation.radius != 0.0);
        let compensation = compensation.map(|compensation| {
            let (plane, sign) = self.map().image_of(plane).unwrap_or((plane, 1.0));
            (Compensation { is_left: compensation.is_left == (sign > 0.0), ..compensation }, plane)
        });
        if compensation.is_none() || compensation != self.contour.compensation {
            self.finish_contour()?;
            self.contour.compensation = compensation;
        }
        Ok(())
    }

    /// Appends all steps that wait. Compensation in effect begins again with the next motion.
    pub(super) fn finish_contour(&mut self) -> Outcome<()> {
        if let Some((motion, _, _, events)) = self.contour.corner.take() {
            self.push_compensated(motion)?;
            for step in events {
                self.push_step(step);
            }
        }
        if let Some(mut compensator) = self.contour.compensator.take() {
            let end = compensator.end(&mut self.contour.out);
            let plane = self.contour.compensation.map_or(self.modal.plane, |(_, plane)| plane);
            self.contour.leave = end.map(|(center, _)| (center, plane));
            self.contour.leave_direction = end.map(|(_, direction)| direction);
        }
        self.steps.extend(self.contour.out.drain(..));
        Ok(())
    }

    /// Appends an event to the steps, after motions that wait.
    pub(super) fn push_event(&mut self, event: ProgramEvent) {
        self.push_step(ProgramStep::Event { line: self.line, event });
    }

    fn push_step(&mut self, step: ProgramStep) {
        let Contour { corner, compensator, .. } = &mut self.contour;
        match (corner, compensator) {
            (Some((_, _, _, events)), _) => events.push(step),
            (None, Some(compensator)) if compensator.is_waiting() => compensator.push_event(step),
            _ => self.steps.push_back(step),
        }
    }

    /// Appends a motion as programmed.
    pub(super) fn push_contour(&mut self, mut motion: ProgramMotion) -> Outcome<()> {
        let plane = self.modal.plane;
        if let Some((mut before, corner, plane, events)) = self.contour.corner.take() {
            // Sinumerik omits a corner without motions in the plane on both sides.
            let is_omitted = self.dialect == Dialect::Sinumerik
                && [&before, &motion].into_iter().any(|motion| {
                    motion.feed == Feed::Rapid
                        || ContourPiece::new(motion, plane).is_none_or(|piece| piece.is_still())
                });
            let between = match is_omitted {
                true => None,
                false => corner.insert(&mut before, &mut motion, plane)?,
            };
            self.push_compensated(before)?;
            for step in events {
                self.push_step(step);
            }
            if let Some(between) = between {
                self.push_compensated(between)?;
            }
        }
        match self.corner.take() {
            Some(corner) => {
                let plane = self.map().image_of(plane).map_or(plane, |(plane, _)| plane);
                self.contour.corner = Some((motion, corner, plane, Vec::new()));
                Ok(())
            }
            None => self.push_compensated(motion),
        }
    }

    fn push_compensated(&mut self, mut motion: ProgramMotion) -> Outcome<()> {
        if let Some((point, plane)) = self.contour.leave.take() {
            let [first, second, _] = plane.axes();
            if !matches!(motion.kind, MotionKind::Line | MotionKind::Rapid)
                && (point - Point::new(motion.start[first], motion.start[second])).norm() > SAME
            {
                return Err(
                    "the motion after the end of cutter compensation must be a straight line".to_owned()
                );
            }
            let leave = self.contour.leave_direction.take();
            if let (Some(direction), true, None) =
                (leave, self.contour.goes_around, self.contour.compensation)
            {
                let end = Point::new(motion.end[first], motion.end[second]);
                let contour = Point::new(motion.start[first], motion.start[second]);
                require_in_front((end - contour).dot(&direction))?;
            }
            [motion.start[first], motion.start[second]] = point.into();
        }
        let Some((compensation, plane)) = self.contour.compensation else {
            self.steps.push_back(ProgramStep::Motion(motion));
            return Ok(());
        };
        let ends_perpendicular =
            matches!(self.dialect, Dialect::LinuxCnc | Dialect::Mach3 | Dialect::Grbl | Dialect::Marlin);
        let new = || Compensator::new(compensation, plane, ends_perpendicular);
        let compensator = self.contour.compensator.get_or_insert_with(new);
        compensator.has_intersections = self.contour.has_intersections;
        compensator.goes_around = self.contour.goes_around;
        let result = compensator.push(motion, &mut self.contour.out);
        self.steps.extend(self.contour.out.drain(..));
        result
    }
}
