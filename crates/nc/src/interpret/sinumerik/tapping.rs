//! Rigid tapping: CYCLE84.

use virtual_axes_core::units::MILLIMETER;

use super::super::codes::FeedMode;
use super::super::error::Outcome;
use super::super::limits::MAX_PECKS;
use super::super::state::State;
use super::cycle_values::{CycleValues, Dwell, feed_to, pause};

/// Retraction that breaks the chip, unless `_VRT` has another one, m.
const CHIP_BREAK: f64 = MILLIMETER;

/// Values of CYCLE84.
#[derive(Debug, Clone)]
pub(super) struct Tapping {
    /// Pitch of the thread, m.
    pitch: f64,
    /// Speeds in and out, rpm; 0 for the active one.
    speeds: [f64; 2],
    /// Depth of a peck and retraction after it; `None` for one stroke.
    pecks: Option<(f64, Retraction)>,
}

/// Retraction between two pecks.
#[derive(Debug, Clone, Copy)]
enum Retraction {
    /// Chip breaking (`_VARI` 1): by a distance, m.
    Distance(f64),
    /// Swarf removal (`_VARI` 2): to the start plane.
    Start,
}

impl Tapping {
    pub(super) fn new(values: &CycleValues<'_>) -> Outcome<Self> {
        let pitch = values.pitch(7, 8, Some(13))?;
        let pitch =
            pitch.ok_or("CYCLE84 requires MPIT or PIT, its value 8 or 9: size or pitch of the thread")?;
        let speeds = [values.get(10)?, values.get(11)?].map(|speed| speed.unwrap_or(0.0).abs());
        let peck = values.length(16)?.abs();
        let retraction = match values.get(15)?.unwrap_or(0.0).abs() as u32 % 10 {
            1 => match values.length(17)?.abs() {
                0.0 => Some(Retraction::Distance(CHIP_BREAK)),
                distance => Some(Retraction::Distance(distance)),
            },
            2 => Some(Retraction::Start),
            _ => None,
        };
        let pecks = retraction.map(|retraction| (peck, retraction));
        Ok(Self { pitch, speeds, pecks })
    }

    /// Taps a hole between the reference plane, the start plane and the depth, m, with a dwell at the end of each stroke. The
    /// feed follows the spindle, which reverses at the end of each stroke.
    pub(super) fn tap(
        &self,
        [reference, start, bottom]: [f64; 3],
        dwell: Option<Dwell>,
        state: &mut State,
    ) -> Outcome<()> {
        let feeds = self.speeds.map(|speed| {
            let speed = if speed > 0.0 { speed } else { state.modal.spindle_speed };
            speed * self.pitch
        });
        if feeds[0] <= 0.0 {
            return Err("CYCLE84 requires SST, its value 11, or a spindle speed S".to_owned());
        }
        let [inward, outward] = [feeds[0], if feeds[1] > 0.0 { feeds[1] } else { feeds[0] }];
        state.modal.feed_mode = FeedMode::PerMinute;
        let stroke = |level: f64, feed: f64, state: &mut State| {
            state.modal.feed = Some([feed; 2]);
            feed_to(level, state)
        };
        let depth = (bottom - reference).abs();
        let down = (bottom - start).signum();
        if self.pecks.is_some_and(|(peck, _)| peck == 0.0) {
            state.assume("CYCLE84 without _DAM, its value 17: the thread is cut in one stroke".to_owned());
        }
        if let Some((peck, retraction)) = self.pecks.filter(|(peck, _)| *peck > 0.0) {
            let count = (depth / peck - 1e-9).ceil();
            if count > MAX_PECKS {
                return Err(format!("CYCLE84: more than {MAX_PECKS} pecks"));
            }
            for index in 1..count as u32 {
                let level = reference + down * peck * f64::from(index);
                stroke(level, inward, state)?;
                pause(dwell, state)?;
                let distance = (level - start).abs();
                match retraction {
                    Retraction::Distance(least) => {
                        stroke(level - down * least.min(distance), outward, state)?;
                    }
                    Retraction::Start => {
                        stroke(start, outward, state)?;
                        pause(dwell, state)?;
                    }
                }
            }
        }
        stroke(bottom, inward, state)?;
        pause(dwell, state)?;
        stroke(start, outward, state)
    }
}
