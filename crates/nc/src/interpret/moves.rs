//! Straight motions, feeds, and the selection of the motion of a line.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use virtual_axes_core::units::{DEGREE, MINUTE, RPM};

use super::codes::{FeedMode, Motion, g_name};
use super::cycles::is_canned;
use super::dialect::Dialect;
use super::error::Outcome;
use super::frames::SCALING;
use super::limits::{MAX_ANGLE, MAX_LENGTH};
use super::line_words::LineWords;
use super::parameters::LOCALS;
use super::state::State;
use crate::motion::{
    AXIS_COUNT, AXIS_LETTERS, Coordinates, Feed, MotionKind, PlanarArc, ProgramMotion, is_rotary,
};

/// Distance of each axis below which a straight motion is the rounding of no motion, m and rad.
const STILL: f64 = 1e-12;
/// Distance of the chords of an arc from it, where it is no circle in a plane of axes, m.
pub(super) const CHORD_ERROR: f64 = 0.2e-6;
/// Largest number of chords of an arc.
const MAX_CHORDS: f64 = 1e5;

impl State {
    /// Executes the motion of a line: that of its code `motion`, or the modal one if the line has its words.
    pub(super) fn move_by(
        &mut self,
        block: &mut LineWords,
        motion: Option<Motion>,
        is_machine: bool,
    ) -> Outcome<()> {
        let is_arc = matches!(self.modal.motion, Some(Motion::ClockwiseArc | Motion::CounterclockwiseArc));
        let is_cycle = self.modal.motion.is_some_and(is_canned) && self.dialect == Dialect::Fanuc;
        let has_words = block.has_axis()
            || (is_cycle && block.has_any(&['R']))
            || (is_arc && block.has_any(&['I', 'J', 'K', 'R']))
            || (self.modal.has_tool_vectors && block.has_any(&['I', 'J', 'K']));
        if motion.is_none() && !has_words && !is_machine {
            return Ok(());
        }
        let is_linuxcnc = self.dialect == Dialect::LinuxCnc;
        let default = (is_machine && !is_linuxcnc).then_some(Motion::Rapid);
        let Some(code) = self.modal.motion.or(default) else {
            return match has_words {
                true => Err(format!("{}: axis word without G0, G1, G2 or G3", axis_words(block))),
                false if is_machine => Err("G53 requires G0 or G1".to_owned()),
                false => Ok(()),
            };
        };
        if is_machine {
            let is_straight = matches!(code, Motion::Rapid | Motion::Line);
            if is_linuxcnc && (self.modal.is_incremental || !is_straight) {
                return Err("G53 requires G90 with G0 or G1".to_owned());
            }
            if self.dialect == Dialect::Grbl && !is_straight {
                return Err("G53 requires G0 or G1 (error 30)".to_owned());
            }
            return self.move_in_machine_coordinates(block, code);
        }
        if !has_words && code != Motion::Nurbs {
            return Ok(());
        }
        if let Some(surface) = self.modal.surface {
            return self.surface_motion(block, code, surface);
        }
        match code {
            // G0 of Marlin moves at the feed.
            Motion::Rapid if self.dialect != Dialect::Marlin || self.modal.feed.is_none() => {
                let end = self.line_targets(block)?;
                self.rapid_to(&end)
            }
            Motion::Rapid | Motion::Line => {
                let end = self.line_targets(block)?;
                self.line_to(&end)
            }
            Motion::Skip | Motion::Probe382 | Motion::Probe383 | Motion::Probe384 | Motion::Probe385 => {
                self.probe(block, code)
            }
            Motion::Synchronous | Motion::SynchronousTapping => self.synchronous(block, code),
            Motion::ClockwiseArc => self.arc(block, true),
            Motion::CounterclockwiseArc => self.arc(block, false),
            Motion::CubicSpline | Motion::QuadraticSpline | Motion::Nurbs => self.start_spline(block, code),
            Motion::Cancel | Motion::NurbsEnd => Ok(()),
            _ if motion.is_none() && self.has_failed_cycle => {
                block.skip("ABCIJKLPQRUVWXYZ");
                Ok(())
            }
            _ => self.cycle(block, code),
        }
    }

    /// Returns the end of a line as [`targets`](Self::targets), with the change of the tool length since the last motion of Z.
    fn line_targets(&mut self, block: &mut LineWords) -> Outcome<Coordinates> {
        let is_increment = self.modal.is_incremental && block.get('Z').is_some();
        let change = if is_increment { self.pending_length() } else { 0.0 };
        let mut end = self.targets(block)?;
        end[2] += change;
        Ok(end)
    }

    /// Returns the programmed coordinates of the end of a motion by the axis words, which then count as used, m and rad.
    pub(super) fn targets(&mut self, block: &mut LineWords) -> Outcome<Coordinates> {
        let mut end = self.programmed();
        let increments = self.take_increments(block);
        let [first, second, _] = self.modal.plane.axes();
        let polar = self.polar_words(block);
        let before = [end[first], end[second]];
        let words = self.take_axes(block)?;
        for (end, value) in end.iter_mut().zip(words) {
            let Some(value) = value else { continue };
            *end = if self.modal.is_incremental { *end + value } else { value };
        }
        if block.polar != [None; 2] {
            let [radius, angle] = std::mem::take(&mut block.polar);
            let before = [end[first].hypot(end[second]), end[second].atan2(end[first])];
            let is_incremental = self.modal.is_incremental;
            let coordinate = |word: Option<f64>, unit: f64, before: f64| match word {
                Some(word) if is_incremental => before + word * unit,
                Some(word) => word * unit,
                None => before,
            };
            let radius = coordinate(radius, self.modal.length, before[0]);
            let (sin, cos) = coordinate(angle, DEGREE, before[1]).sin_cos();
            (end[first], end[second]) = (radius * cos, radius * sin);
        }
        if self.modal.polar.is_some() {
            [end[first], end[second]] = before;
            self.replace_polar(polar, [first, second], &mut end);
        }
        for (end, increment) in end.iter_mut().zip(increments) {
            *end += increment.unwrap_or(0.0);
        }
        if self.modal.has_tool_vectors {
            self.orient(block, &mut end)?;
        }
        Ok(end)
    }

    /// Replaces A, B and C by those of the tool direction I J K (G43.5), which then count as used.
    fn orient(&mut self, block: &mut LineWords, end: &mut Coordinates) -> Outcome<()> {
        if !matches!(self.modal.motion, Some(Motion::Rapid | Motion::Line))
            || !block.has_any(&['I', 'J', 'K'])
        {
            return Ok(());
        }
        let direction = ['I', 'J', 'K'].map(|letter| block.take(letter).unwrap_or(0.0));
        let transform = self.options.kinematics.as_ref();
        let transform = transform.ok_or("G43.5 requires a machine with kinematics")?;
        let near = self.position_at(end);
        let oriented = transform
            .oriented(direction, &near)
            .map_err(|reason| format!("tool direction I J K: {reason}"))?;
        for axis in 3..6 {
            end[axis] = oriented[axis] - self.origin(axis);
        }
        Ok(())
    }

    /// Executes a motion in machine coordinates (G53): without offsets and tool center point control.
    fn move_in_machine_coordinates(&mut self, block: &mut LineWords, code: Motion) -> Outcome<()> {
        if !block.has_axis() {
            return Ok(());
        }
        self.finish_contour()?;
        self.moves_in_machine_coordinates = true;
        let tcp_length = self.modal.tcp_length;
        self.leave_tcp();
        let mut end = self.position;
        for (end, value) in end.iter_mut().zip(self.take_axes(block)?) {
            *end = value.unwrap_or(*end);
        }
        match code {
            Motion::Line => self.push_feed(MotionKind::Line, end)?,
            Motion::Skip => self.probe_to(block, code, |state| state.push_feed(MotionKind::Line, end))?,
            _ => self.push_rapid(end)?,
        }
        tcp_length.map_or(Ok(()), |length| self.enter_tcp(length))
    }

    /// Executes a probing motion: a straight line to its end, where nothing is touched.
    fn probe(&mut self, block: &mut LineWords, code: Motion) -> Outcome<()> {
        let end = self.targets(block)?;
        self.probe_to(block, code, |state| state.line_to(&end))
    }

    /// Executes the line `motion` of a probing motion.
    fn probe_to(
        &mut self,
        block: &mut LineWords,
        code: Motion,
        motion: impl FnOnce(&mut Self) -> Outcome<()>,
    ) -> Outcome<()> {
        // R of Mitsubishi selects the acceleration.
        block.skip("PQR");
        let name = g_name(code.number());
        self.assume(format!("{name}: a straight line to its end, nothing is touched"));
        motion(self)?;
        // The position of the touch.
        for axis in 0..AXIS_COUNT {
            self.parameters.set_of_control(5061 + axis, self.coordinate(axis))?;
        }
        if self.dialect == Dialect::Mach3 {
            for axis in 0..6 {
                self.parameters.set_numbered(2000 + axis, self.coordinate(axis))?;
            }
        }
        // Without a touch, G38.2 and G38.4 would end in an error, which the simulation does not have.
        let is_touched = !matches!(code, Motion::Probe383 | Motion::Probe385);
        self.parameters.set_of_control(5070, f64::from(is_touched))?;
        if code == Motion::Skip {
            self.modal.motion = Some(Motion::Line);
        }
        Ok(())
    }

    /// Executes a macro of the control for probing that the program lacks. P9810 moves to a point, the others have no motion.
    pub(super) fn probing_macro(&mut self, program: u32, arguments: &[f64; LOCALS]) -> Outcome<()> {
        let argument = |number: usize| Some(arguments[number - 1]).filter(|value| !value.is_nan());
        if program != 9810 {
            self.assume(format!("G65 P{program}: macro of the control for probing, without motion"));
            return Ok(());
        }
        self.assume("G65 P9810: a straight line to its end, nothing is touched".to_owned());
        if let Some(feed) = argument(9) {
            self.modal.feed_word = feed;
            self.modal.feed = Some([feed * self.modal.length, feed * DEGREE]);
        }
        let mut end = self.programmed();
        for (end, number) in end.iter_mut().zip(24..27) {
            *end = argument(number).map_or(*end, |value| value * self.modal.length);
        }
        match self.modal.feed {
            Some(_) => self.line_to(&end),
            None => self.rapid_to(&end),
        }
    }

    /// Executes a straight line with a pitch per revolution: G33 K, or G33.1 K to a point and back.
    fn synchronous(&mut self, block: &mut LineWords, code: Motion) -> Outcome<()> {
        let pitch = block.take('K').filter(|pitch| *pitch > 0.0);
        let pitch = pitch.ok_or("G33 and G33.1 require K above 0, the pitch per revolution")?;
        if self.modal.spindle_speed == 0.0 || self.modal.spindle_direction == 0.0 {
            return Err("G33 and G33.1 require a turning spindle: program S with M3 or M4".to_owned());
        }
        let start = self.programmed();
        let end = self.targets(block)?;
        let feed = [pitch * self.modal.length, pitch * DEGREE];
        let (mode, before) = (self.modal.feed_mode, self.modal.feed.replace(feed));
        self.modal.feed_mode = FeedMode::PerRevolution;
        self.line_to(&end)?;
        if code == Motion::SynchronousTapping {
            self.push_spindle(-1.0);
            self.line_to(&start)?;
            self.push_spindle(1.0);
        }
        (self.modal.feed_mode, self.modal.feed) = (mode, before);
        Ok(())
    }

    /// Appends a rapid traverse to programmed coordinates, m and rad.
    pub(super) fn rapid_to(&mut self, programmed: &Coordinates) -> Outcome<()> {
        self.push_rapid(self.position_at(programmed))
    }

    /// Appends a straight line at feed to programmed coordinates, m and rad.
    pub(super) fn line_to(&mut self, programmed: &Coordinates) -> Outcome<()> {
        self.push_feed(MotionKind::Line, self.position_at(programmed))
    }

    /// Appends an arc at feed to programmed coordinates, m and rad; plane, center and sweep of `arc` are programmed ones
    /// too.
    pub(super) fn arc_to(&mut self, arc: &PlanarArc, programmed: &Coordinates) -> Outcome<()> {
        let map = self.map();
        let start = self.programmed();
        let [first, second, _] = arc.plane.axes();
        let has_one_factor = self.modal.frames[SCALING].image_of(arc.plane).is_some();
        if !has_one_factor && self.dialect == Dialect::Fanuc {
            return Err(
                "an arc with different factors I, J and K of G51 is not supported, the control gives no ellipse: program \
                 one factor P, or G50 before the arc"
                    .to_owned(),
            );
        }
        let Some((plane, sign)) = map.image_of(arc.plane) else {
            return self.chords_to(arc, &start, programmed);
        };
        let mut center = Vector3::from_column_slice(&start[..3]);
        [center[first], center[second]] = arc.center;
        let center = map.apply(&center);
        let [first, second, _] = plane.axes();
        let arc = PlanarArc { plane, center: [center[first], center[second]], sweep: sign * arc.sweep };
        self.push_feed(MotionKind::Arc(arc), self.position_at(programmed))
    }

    /// Appends an arc that is no circle in a plane of axes as straight lines.
    fn chords_to(&mut self, arc: &PlanarArc, start: &Coordinates, end: &Coordinates) -> Outcome<()> {
        let [first, second, _] = arc.plane.axes();
        let from = [start[first] - arc.center[0], start[second] - arc.center[1]];
        let radii = [from, [end[first] - arc.center[0], end[second] - arc.center[1]]]
            .map(|[x, y]: [f64; 2]| x.hypot(y));
        let step = (8.0 * CHORD_ERROR / (radii[0].max(radii[1]) * self.map().linear.norm())).sqrt();
        let count = (arc.sweep.abs() / step).ceil().clamp(1.0, MAX_CHORDS);
        let feed_word = self.modal.feed;
        if let (FeedMode::InverseTime, Some(feed)) = (self.modal.feed_mode, &mut self.modal.feed) {
            feed[0] *= count;
        }
        for index in 1..=count as usize {
            let share = index as f64 / count;
            let mut point: Coordinates =
                std::array::from_fn(|axis| start[axis] + share * (end[axis] - start[axis]));
            if (index as f64) < count {
                let (sin, cos) = (arc.sweep * share).sin_cos();
                let size = 1.0 + share * (radii[1] / radii[0] - 1.0);
                point[first] = arc.center[0] + size * (from[0] * cos - from[1] * sin);
                point[second] = arc.center[1] + size * (from[0] * sin + from[1] * cos);
            }
            self.line_to(&point)?;
        }
        self.modal.feed = feed_word;
        Ok(())
    }

    /// Appends a rapid traverse to the steps.
    pub(super) fn push_rapid(&mut self, mut end: Coordinates) -> Outcome<()> {
        if self.dialect == Dialect::Okuma && self.modal.tcp_length.is_none() {
            for (axis, limit) in self.options.upper_limits.into_iter().enumerate().take(3) {
                if end[axis] > limit {
                    end[axis] = limit;
                    self.assume(format!(
                        "G0 beyond the upper travel limit of {}: the axis stops there, as on the control",
                        AXIS_LETTERS[axis]
                    ));
                }
            }
        }
        self.push_motion(MotionKind::Rapid, end, Feed::Rapid)
    }

    /// Appends a motion at the programmed feed to the steps.
    pub(super) fn push_feed(&mut self, kind: MotionKind, end: Coordinates) -> Outcome<()> {
        match self.feed(&end, matches!(kind, MotionKind::Line)) {
            Ok(feed) => self.push_motion(kind, end, feed),
            Err(error) => {
                // Later motions start at its end.
                self.position = end;
                Err(error)
            }
        }
    }

    pub(super) fn push_motion(&mut self, kind: MotionKind, end: Coordinates, feed: Feed) -> Outcome<()> {
        for (axis, value) in end.into_iter().enumerate() {
            let (limit, unit) = if is_rotary(axis) { (MAX_ANGLE, "rad") } else { (MAX_LENGTH, "m") };
            if value.is_nan() || value.abs() > limit {
                return Err(format!(
                    "word {}: more than {limit} {unit} from the machine zero",
                    AXIS_LETTERS[axis]
                ));
            }
        }
        self.cubic_end = None;
        let start = self.position;
        let is_still = start.iter().zip(end).all(|(start, end)| (end - start).abs() < STILL);
        if is_still && matches!(kind, MotionKind::Line | MotionKind::Rapid) {
            return Ok(());
        }
        self.position = end;
        let Self { line, modal, .. } = self;
        let (line, path_control, tcp_length) = (*line, modal.path_control, modal.tcp_length);
        let motion = ProgramMotion { line, kind, start, end, feed, path_control, tcp_length };
        self.push_contour(motion)
    }

    /// Returns the feed of a motion to `end`; `is_line` if the end alone determines the moving axes.
    pub(super) fn feed(&self, end: &Coordinates, is_line: bool) -> Outcome<Feed> {
        let mode = self.modal.feed_mode;
        let Some([linear, rotary]) = self.modal.feed else {
            return Err(match mode {
                _ if self.vacant_feed != 0 => {
                    format!("feed missing: word F: {}", self.value_source(self.vacant_feed))
                }
                FeedMode::InverseTime => {
                    "feed missing: G93 requires F in each line with G1, G2 or G3".to_owned()
                }
                _ => {
                    "feed missing: program F above 0, also after a change between G93, G94 and G95".to_owned()
                }
            });
        };
        let per_second = match mode {
            FeedMode::InverseTime => return Ok(Feed::Duration(MINUTE / linear)),
            FeedMode::PerMinute => MINUTE.recip(),
            FeedMode::PerRevolution => {
                if self.modal.spindle_direction == 0.0 || self.modal.spindle_speed == 0.0 {
                    return Err(
                        "G95 (feed per revolution) requires a turning spindle: program S with M3 or M4"
                            .to_owned(),
                    );
                }
                self.modal.spindle_speed * RPM / TAU
            }
        };
        let moves_linear = (0..AXIS_COUNT).any(|axis| !is_rotary(axis) && self.position[axis] != end[axis]);
        Ok(match moves_linear || !is_line {
            true => Feed::Linear(linear * per_second),
            false => Feed::Rotary(rotary * per_second),
        })
    }
}

/// Returns the axis words of a line for a message.
fn axis_words(block: &LineWords) -> String {
    let words = AXIS_LETTERS.into_iter().filter_map(|letter| Some(format!("{letter}{}", block.get(letter)?)));
    words.collect::<Vec<_>>().join(" ")
}
