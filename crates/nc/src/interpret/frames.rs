//! Programmable frames: scaling and mirroring (G51, G51.1), rotation (G68), tilted planes (G68.2, G53.1), polar
//! coordinates (G16).

use nalgebra::{Matrix3, Vector3};

use super::codes::{Codes, Polar, Rotation, Scaling};
use super::dialect::Dialect;
use super::error::Outcome;
use super::frame::CoordinateFrame;
use super::line_words::LineWords;
use super::state::State;
use crate::motion::{AXIS_LETTERS, Coordinates};

/// Index of the scaling in the parts of the frame.
pub(super) const SCALING: usize = 0;
/// Index of the mirroring.
const MIRROR: usize = 1;
/// Index of the rotation.
const ROTATION: usize = 2;
/// Factor of a P without decimal point in G51 of Fanuc and Haas.
const THOUSANDTH: f64 = 1e-3;
/// Smallest integer that is a factor in thousandths.
const LEAST_THOUSANDTHS: f64 = 50.0;
/// Smallest factor of a scaling.
const LEAST_FACTOR: f64 = 1e-6;

impl State {
    /// Sets polar coordinates and frames: G15, G16, G50, G51, G50.1, G51.1, G68, G68.2, G68.3, G69.
    pub(super) fn set_frames(&mut self, block: &mut LineWords, codes: &Codes) -> Outcome<()> {
        match codes.g.polar {
            Some(Polar::On) => {
                self.modal.polar = Some([0.0; 2]);
                self.modal.polar_center = [0.0; 2];
                // The center is the position on Mach3, and the zero of the workpiece on other controls.
                if self.dialect == Dialect::Mach3 {
                    let [first, second, _] = self.modal.plane.axes();
                    let position = self.programmed();
                    self.modal.polar_center = [position[first], position[second]];
                }
            }
            Some(Polar::Off) => self.modal.polar = None,
            None => {}
        }
        if codes.g.scaling.is_none() && codes.g.rotation.is_none() {
            return Ok(());
        }
        self.finish_contour()?;
        match codes.g.scaling {
            None => {}
            Some(Scaling::Off) => self.modal.frames[SCALING] = CoordinateFrame::identity(),
            Some(Scaling::On) => self.modal.frames[SCALING] = self.scaling(block)?,
            Some(Scaling::MirrorOff | Scaling::MirrorOff100) => {
                block.skip("XYZABC");
                self.modal.frames[MIRROR] = CoordinateFrame::identity();
            }
            Some(Scaling::MirrorByFlags) => {
                // R rounds corners.
                block.skip("R");
                let factors =
                    self.center(block)?.map(|flag| if flag.unwrap_or(0.0) == 0.0 { 1.0 } else { -1.0 });
                self.modal.frames[MIRROR] = CoordinateFrame::scaling(Vector3::from(factors));
            }
            Some(Scaling::Mirror | Scaling::Mirror101) => {
                let center = self.center(block)?;
                let factors = center.map(|center| if center.is_some() { -1.0 } else { 1.0 });
                let center = Vector3::from(center.map(Option::unwrap_or_default));
                let mirror = CoordinateFrame::scaling(Vector3::from(factors)).about(center);
                self.modal.frames[MIRROR] = self.modal.frames[MIRROR].then(&mirror);
            }
        }
        match codes.g.rotation {
            None => {}
            Some(Rotation::ShiftAndTurn) => {
                let shift = Vector3::from(self.center(block)?.map(Option::unwrap_or_default));
                let angle = block.take('P').unwrap_or(0.0).to_radians();
                let turned = CoordinateFrame::rotation(self.modal.plane.axes()[2], angle);
                self.modal.frames[ROTATION] = CoordinateFrame::shift(shift).then(&turned);
            }
            Some(Rotation::Off | Rotation::OffByG10 | Rotation::FeatureOff) => {
                self.modal.frames[ROTATION] = CoordinateFrame::identity();
                self.tilt = None;
            }
            Some(Rotation::On) => self.modal.frames[ROTATION] = self.rotation(block)?,
            Some(Rotation::Feature) => {
                let origin = Vector3::from(self.center(block)?.map(Option::unwrap_or_default));
                let angles = ['I', 'J', 'K'].map(|letter| block.take(letter).unwrap_or(0.0).to_radians());
                let turned = roll_pitch_yaw(block.take_integer('Q')?.unwrap_or(321), angles)?;
                self.tilt = Some(CoordinateFrame::shift(origin).then(&turned));
            }
            Some(Rotation::Tilted) => {
                if let Some(plane) = self.tilted(block)? {
                    self.tilt = Some(plane);
                }
            }
            Some(Rotation::ByTool) => self.tilt = Some(self.tilted_by_tool(block)?),
        }
        let [scaling, mirror, rotation] = &self.modal.frames;
        self.frame = rotation.then(scaling).then(mirror);
        Ok(())
    }

    /// Returns the words X, Y and Z, which then count as used, m.
    fn center(&self, block: &mut LineWords) -> Outcome<[Option<f64>; 3]> {
        let words = ['X', 'Y', 'Z'].map(|letter| block.take(letter).map(|value| value * self.modal.length));
        Ok(words)
    }

    fn scaling(&self, block: &mut LineWords) -> Outcome<CoordinateFrame> {
        let letters = if self.dialect == Dialect::Mach3 { ['X', 'Y', 'Z'] } else { ['I', 'J', 'K'] };
        let mut factor = |letter: char| {
            let has_point = block.has_point(letter);
            let value = block.take(letter)?;
            let has_thousandths = matches!(self.dialect, Dialect::Fanuc | Dialect::Haas);
            let is_integer = !has_point && has_thousandths && value.abs() >= LEAST_THOUSANDTHS;
            Some(if is_integer { value * THOUSANDTH } else { value })
        };
        let each = letters.map(&mut factor);
        let factors = match factor('P') {
            Some(all) => [all; 3],
            None => each.map(|factor| factor.unwrap_or(1.0)),
        };
        if factors.iter().any(|factor| factor.abs() < LEAST_FACTOR) {
            return Err("G51: a factor of 0 is not allowed".to_owned());
        }
        let center = self.center(block)?;
        let here = self.programmed();
        // Without a center, Mach3 scales about the origin, others about the position.
        let default = |axis: usize| if self.dialect == Dialect::Mach3 { 0.0 } else { here[axis] };
        let center = Vector3::from([0, 1, 2].map(|axis| center[axis].unwrap_or_else(|| default(axis))));
        Ok(CoordinateFrame::scaling(Vector3::from(factors)).about(center))
    }

    fn rotation(&mut self, block: &mut LineWords) -> Outcome<CoordinateFrame> {
        if block.has_any(&['I', 'J', 'K']) {
            return Err("G68 with I, J and K is not supported: program G68.2 with Euler angles".to_owned());
        }
        let [first, second, normal] = self.modal.plane.axes();
        if self.dialect == Dialect::Haas && self.modal.is_incremental && block.get('R').is_some() {
            self.assume(
                "G68 R with G91: the angle replaces the one before, as with Setting 73 off; with it on, the control adds R"
                    .to_owned(),
            );
        }
        let angle = block.take('R').unwrap_or(0.0).to_radians();
        // The center counts before the rotation.
        self.modal.frames[ROTATION] = CoordinateFrame::identity();
        self.frame = self.modal.frames[SCALING].then(&self.modal.frames[MIRROR]);
        let here = self.programmed();
        let mut center = Vector3::from_column_slice(&here[..3]);
        // Mach3 has the center in A and B.
        for (letter, axis) in [('A', first), ('B', second)] {
            if self.dialect == Dialect::Mach3
                && let Some(value) = block.take(letter)
            {
                center[axis] = value * self.modal.length;
            }
        }
        for axis in [first, second] {
            if let Some(value) = block.take(AXIS_LETTERS[axis]) {
                center[axis] = value * self.modal.length;
            }
        }
        block.take(AXIS_LETTERS[normal]);
        Ok(CoordinateFrame::rotation(normal, angle).about(center))
    }

    /// Returns the plane of G68.2, or `None` before the last line of a plane by points or vectors. P is the method: 0 Euler
    /// angles I about Z, J about X, K about Z; 1 roll, pitch and yaw I, J, K about X, Y, Z of the work coordinate system, in
    /// the order Q; 2 three points; 3 two vectors; 4 projection angles.
    fn tilted(&mut self, block: &mut LineWords) -> Outcome<Option<CoordinateFrame>> {
        let method = block.take_integer('P')?.unwrap_or(0);
        let number = block.take_integer('Q')?;
        let given = self.center(block)?;
        let origin = Vector3::from(given.map(Option::unwrap_or_default));
        let words = ['I', 'J', 'K'].map(|letter| block.take(letter).unwrap_or(0.0));
        let turn = block.take('R').unwrap_or(0.0).to_radians();
        let angles = words.map(f64::to_radians);
        let rotation = CoordinateFrame::rotation;
        let turned = match method {
            0 => rotation(2, angles[0]).then(&rotation(0, angles[1])).then(&rotation(2, angles[2])),
            1 => roll_pitch_yaw(number.unwrap_or(123), angles)?,
            2 | 3 => {
                let number = number.unwrap_or(1) as usize;
                let vector = Vector3::from(words);
                let entry =
                    if method == 2 { [origin, Vector3::new(turn, 0.0, 0.0)] } else { [origin, vector] };
                let last = if method == 2 { 3 } else { 2 };
                let entries = &mut self.modal.plane_points;
                *entries.get_mut(number).filter(|_| number <= last).ok_or_else(|| {
                    format!("G68.2 P{method} Q{number} is invalid: Q1 to Q{last} are the lines of the plane")
                })? = Some(entry);
                let found = if method == 2 { plane_of_points(entries)? } else { plane_of_vectors(entries)? };
                if found.is_some() {
                    *entries = [None; 4];
                    self.tilt = None;
                }
                return Ok(found);
            }
            4 => {
                let ([sin_i, cos_i], [sin_j, cos_j]) =
                    ([angles[0].sin(), angles[0].cos()], [angles[1].sin(), angles[1].cos()]);
                let first = Vector3::new(cos_i, 0.0, -sin_i);
                let plane = plane_of(Vector3::zeros(), first, first.cross(&Vector3::new(0.0, cos_j, sin_j)))?;
                plane.then(&rotation(2, angles[2]))
            }
            _ => return Err(format!("G68.2 P{method} is not supported: P0 to P4 are")),
        };
        self.tilt = None;
        Ok(Some(CoordinateFrame::shift(origin).then(&turned)))
    }

    /// Returns the plane normal to the tool axis: G68.3.
    fn tilted_by_tool(&mut self, block: &mut LineWords) -> Outcome<CoordinateFrame> {
        let origin = Vector3::from(self.center(block)?.map(Option::unwrap_or_default));
        let turn = block.take('R').unwrap_or(0.0).to_radians();
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("G68.3 requires a machine with kinematics")?;
        let normal = Vector3::from(transform.direction(&self.position));
        self.tilt = None;
        // X of the plane is horizontal.
        let x = Vector3::new(0.0, 0.0, 1.0).cross(&normal);
        let x = if x.norm() < 1e-9 { Vector3::x() } else { x.normalize() };
        let plane = CoordinateFrame { linear: Matrix3::from_columns(&[x, normal.cross(&x), normal]), origin };
        Ok(plane.then(&CoordinateFrame::rotation(2, turn)))
    }

    /// Turns the tool axis normal to the tilted plane: G53.1. X, Y and Z stand still.
    pub(super) fn tilt_tool(&mut self, block: &mut LineWords) -> Outcome<()> {
        block.skip("PR");
        let tilt = self.tilt.ok_or("G53.1 requires a tilted plane: program G68.2 first")?;
        self.finish_contour()?;
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("G53.1 requires a machine with kinematics")?;
        let normal = tilt.linear.column(2).into_owned();
        let end: Coordinates =
            transform.oriented(normal.into(), &self.position).map_err(|reason| format!("G53.1: {reason}"))?;
        self.push_rapid(end)
    }

    /// Returns the words of the plane as radius, m, and angle, degrees.
    pub(super) fn polar_words(&self, block: &LineWords) -> [Option<f64>; 2] {
        let [first, second, _] = self.modal.plane.axes();
        let radius = block.get(AXIS_LETTERS[first]).map(|radius| radius * self.modal.length);
        [radius, block.get(AXIS_LETTERS[second])]
    }

    /// Replaces the coordinates `end` in the plane, before the motion, by those of polar coordinates (G16): radius and angle.
    /// An incremental radius of Fanuc and Haas begins at the position, which becomes the center.
    pub(super) fn replace_polar(
        &mut self,
        [radius_word, angle_word]: [Option<f64>; 2],
        [first, second]: [usize; 2],
        end: &mut Coordinates,
    ) {
        let is_incremental = self.modal.is_incremental;
        if radius_word.is_some() && self.dialect.has_macro_b() {
            self.modal.polar_center = if is_incremental { [end[first], end[second]] } else { [0.0; 2] };
        }
        let center = self.modal.polar_center;
        let Some([radius, angle]) = &mut self.modal.polar else { return };
        if radius_word.is_none() && angle_word.is_none() {
            return;
        }
        *radius = radius_word.unwrap_or(*radius);
        if let Some(word) = angle_word {
            *angle = if is_incremental { *angle + word } else { word };
        }
        let (sin, cos) = angle.to_radians().sin_cos();
        (end[first], end[second]) = (center[0] + *radius * cos, center[1] + *radius * sin);
    }
}

/// Returns rotations about the axes X, Y and Z of the work coordinate system, in the order of the digits of `order`.
fn roll_pitch_yaw(order: u32, angles: [f64; 3]) -> Outcome<CoordinateFrame> {
    let axes = [order / 100, order / 10 % 10, order % 10];
    let mut sorted = axes;
    sorted.sort_unstable();
    if sorted != [1, 2, 3] {
        return Err(format!("G68.2 P1 Q{order} is invalid: Q is the order of the rotations, 123 to 321"));
    }
    Ok(axes.into_iter().fold(CoordinateFrame::identity(), |turned, axis| {
        let axis = axis as usize - 1;
        CoordinateFrame::rotation(axis, angles[axis]).then(&turned)
    }))
}

/// Returns the plane of three points: origin, a point on X and one on the side of Y; line 0 shifts and turns it.
fn plane_of_points(entries: &[Option<[Vector3<f64>; 2]>; 4]) -> Outcome<Option<CoordinateFrame>> {
    let [shift, Some([origin, _]), Some([on_x, _]), Some([beside, _])] = entries else { return Ok(None) };
    let first = on_x - origin;
    let plane = plane_of(*origin, first, first.cross(&(beside - origin)))?;
    let Some([shift, turn]) = shift else { return Ok(Some(plane)) };
    Ok(Some(plane.then(&CoordinateFrame::shift(*shift)).then(&CoordinateFrame::rotation(2, turn.x))))
}

/// Returns the plane of an origin with the direction of X, and the direction of Z.
fn plane_of_vectors(entries: &[Option<[Vector3<f64>; 2]>; 4]) -> Outcome<Option<CoordinateFrame>> {
    let [_, Some([origin, first]), Some([_, normal]), _] = entries else { return Ok(None) };
    plane_of(*origin, *first, *normal).map(Some)
}

/// Returns the plane with a direction of X and a normal; the part of X along the normal has no effect.
fn plane_of(origin: Vector3<f64>, first: Vector3<f64>, normal: Vector3<f64>) -> Outcome<CoordinateFrame> {
    let invalid = || "G68.2: points on a line, or vectors of the same direction, give no plane".to_owned();
    let normal = normal.try_normalize(1e-12).ok_or_else(invalid)?;
    let x = (first - normal * first.dot(&normal)).try_normalize(1e-12).ok_or_else(invalid)?;
    Ok(CoordinateFrame { linear: Matrix3::from_columns(&[x, normal.cross(&x), normal]), origin })
}
