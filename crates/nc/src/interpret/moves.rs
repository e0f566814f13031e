//! Straight motions, feeds, and the selection of the motion of a line.

use std::f64::consts::TAU;

use virtual_axes_core::units::{MINUTE, RPM};

use super::error::Outcome;
use super::limits::{MAX_ANGLE, MAX_LENGTH};
use super::line_words::LineWords;
use super::state::{FeedMode, State, is_rotary};
use crate::motion::{AXIS_COUNT, AXIS_LETTERS, Coordinates, Feed, MotionKind, ProgramMotion, ProgramStep};

/// Distance of each axis below which a straight motion is the rounding of no motion, m and rad.
const STILL: f64 = 1e-12;

impl State {
    /// Executes the motion of a line: that of its code `motion`, or the modal one if the line has its words.
    pub(super) fn move_by(
        &mut self,
        block: &mut LineWords,
        motion: Option<u16>,
        is_machine: bool,
    ) -> Outcome<()> {
        let is_arc = matches!(self.modal.motion, Some(20 | 30));
        let has_words = block.has_axis() || (is_arc && block.has_any(&['I', 'J', 'K', 'R']));
        if motion.is_none() && !has_words && !is_machine {
            return Ok(());
        }
        let Some(code) = self.modal.motion else {
            return match has_words {
                true => Err(format!("{}: axis word without G0, G1, G2 or G3", axis_words(block))),
                false if is_machine => Err("G53 requires G0 or G1".to_owned()),
                false => Ok(()),
            };
        };
        if is_machine {
            self.require_axis_positions()?;
            if self.modal.is_incremental || !matches!(code, 0 | 10) {
                return Err("G53 requires G90 with G0 or G1".to_owned());
            }
        }
        match code {
            0 | 10 if has_words => {
                let end = self.targets(block, is_machine)?;
                if code == 0 { self.push_rapid(end) } else { self.push_feed(MotionKind::Line, end) }
            }
            20 | 30 if has_words => self.arc(block, code == 20),
            730..=890 if has_words => self.cycle(block, code),
            50..=52 if has_words || code == 52 => self.start_spline(block, code),
            _ => Ok(()),
        }
    }

    /// Returns the end of a motion by the axis words, which then count as used; `is_machine` for axis positions (G53).
    pub(super) fn targets(&self, block: &mut LineWords, is_machine: bool) -> Outcome<Coordinates> {
        let mut end = self.position;
        for (axis, value) in self.take_axes(block)?.into_iter().enumerate() {
            let Some(value) = value else { continue };
            end[axis] = match (is_machine, self.modal.is_incremental) {
                (true, _) => value,
                (false, true) => self.position[axis] + value,
                (false, false) => value + self.origin(axis),
            };
        }
        Ok(end)
    }

    /// Appends a rapid traverse to the steps.
    pub(super) fn push_rapid(&mut self, end: Coordinates) -> Outcome<()> {
        self.push_motion(MotionKind::Rapid, end, Feed::Rapid)
    }

    /// Appends a motion at the programmed feed to the steps.
    pub(super) fn push_feed(&mut self, kind: MotionKind, end: Coordinates) -> Outcome<()> {
        let feed = self.feed(&end, matches!(kind, MotionKind::Line))?;
        self.push_motion(kind, end, feed)
    }

    fn push_motion(&mut self, kind: MotionKind, end: Coordinates, feed: Feed) -> Outcome<()> {
        for (axis, value) in end.into_iter().enumerate() {
            let (limit, unit) = if is_rotary(axis) { (MAX_ANGLE, "rad") } else { (MAX_LENGTH, "m") };
            if value.is_nan() || value.abs() > limit {
                return Err(format!(
                    "word {}: more than {limit} {unit} from the machine zero",
                    AXIS_LETTERS[axis]
                ));
            }
        }
        let start = self.position;
        let is_still = start.iter().zip(end).all(|(start, end)| (end - start).abs() < STILL);
        if is_still && matches!(kind, MotionKind::Line | MotionKind::Rapid) {
            return Ok(());
        }
        self.position = end;
        let Self { line, modal, .. } = self;
        let (line, path_control, tcp_length) = (*line, modal.path_control, modal.tcp_length);
        let motion = ProgramMotion { line, kind, start, end, feed, path_control, tcp_length };
        self.steps.push_back(ProgramStep::Motion(motion));
        Ok(())
    }

    /// Returns the feed of a motion to `end`; `is_line` if the end alone determines the moving axes.
    fn feed(&self, end: &Coordinates, is_line: bool) -> Outcome<Feed> {
        let mode = self.modal.feed_mode;
        let Some([linear, rotary]) = self.modal.feed else {
            return Err(match mode {
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
