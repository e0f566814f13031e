//! Deep-hole drilling: CYCLE83.

use virtual_axes_core::units::MILLIMETER;

use super::super::error::Outcome;
use super::super::limits::MAX_PECKS;
use super::super::state::State;
use super::cycle_values::{CycleValues, Dwell, feed_to, pause, rapid};

/// Distance above the last depth to which a peck returns at rapid traverse, up to a depth of 30 mm, m.
const SHORT_CLEARANCE: f64 = 0.6 * MILLIMETER;
/// Depth up to which it is that distance, m; beyond, it is a fiftieth of the depth.
const SHORT_DEPTH: f64 = 30.0 * MILLIMETER;
/// Largest distance, m.
const LONG_CLEARANCE: f64 = 7.0 * MILLIMETER;
/// Retraction that breaks the chip, m.
const CHIP_BREAK: f64 = MILLIMETER;

/// Values of CYCLE83, m and s.
#[derive(Debug, Clone)]
pub(super) struct DeepHole {
    /// Depth of the first peck.
    first: f64,
    /// Degression: an amount, or as a negative value a factor.
    degression: f64,
    /// Smallest peck.
    least: f64,
    /// Factor of the feed of the first peck.
    feed_factor: f64,
    /// True if each peck returns to the start plane (VARI 1).
    removes_chips: bool,
    /// Dwell at the start plane, and at each intermediate depth.
    dwells: [Option<Dwell>; 2],
    /// Retraction that breaks the chip, and distance above the last depth; `None` for the built-in one.
    retraction: f64,
    clearance: Option<f64>,
}

impl DeepHole {
    pub(super) fn new(values: &CycleValues<'_>, reference: f64, bottom: f64) -> Outcome<Self> {
        let depth = (reference - bottom).abs();
        let first = match (values.get(5)?, values.get(6)?.filter(|first| *first != 0.0)) {
            (_, Some(first)) => first.abs() * values.length,
            (Some(first), None) => {
                let first = (reference - first * values.length) * (reference - bottom).signum();
                if first < 0.0 {
                    return Err("CYCLE83: FDEP, its value 6, is above the reference plane: the first drilling depth must \
                                lie between the reference plane and the depth (alarm 61107 of the control)"
                        .to_owned());
                }
                first
            }
            (None, None) => depth,
        };
        let degression = values.get(7)?.unwrap_or(0.0);
        let degression = if degression > 0.0 { degression * values.length } else { degression };
        let positive = |value: Option<f64>| value.filter(|value| *value > 0.0);
        let removes_chips = values.get(11)?.unwrap_or(0.0) == 1.0;
        let peck_dwell = match values.get(15)? {
            Some(value) if value > 0.0 => Some(Dwell::Time(value)),
            Some(value) if value < 0.0 => Some(Dwell::Revolutions(-value)),
            // Without a value of its own, the dwell at the depth.
            _ => values.dwell(8)?,
        };
        Ok(Self {
            first,
            degression,
            least: positive(values.get(13)?).map_or(0.0, |least| least * values.length),
            feed_factor: positive(values.get(10)?).unwrap_or(1.0),
            removes_chips,
            dwells: [values.dwell(9)?, peck_dwell],
            retraction: positive(values.get(14)?).map_or(CHIP_BREAK, |value| value * values.length),
            clearance: positive(values.get(16)?).map(|value| value * values.length),
        })
    }

    /// Returns the depths of the pecks below the reference plane, m; the last one is `depth`.
    fn depths(&self, depth: f64) -> Outcome<Vec<f64>> {
        let (mut depths, mut reached, mut peck) = (Vec::new(), 0.0, self.first.min(depth));
        if peck <= 0.0 {
            return Err("CYCLE83 requires FDEP below the reference plane, its value 6".to_owned());
        }
        loop {
            reached += peck;
            if reached >= depth * (1.0 - 1e-12) {
                depths.push(depth);
                return Ok(depths);
            }
            depths.push(reached);
            if depths.len() as f64 > MAX_PECKS {
                return Err(format!("CYCLE83: more than {MAX_PECKS} pecks"));
            }
            let rest = depth - reached;
            if self.degression == 0.0 {
                continue;
            }
            peck = match self.degression {
                // The last two pecks are equal.
                amount if amount > 0.0 && (amount..2.0 * amount).contains(&rest) => 0.5 * rest,
                amount if amount > 0.0 => (peck - amount).max(amount),
                factor => (peck * factor.abs().min(1.0)).max(1e-6),
            };
            peck = peck.max(self.least);
        }
    }

    /// Drills a hole between the reference plane, the start plane and the depth, m, with a dwell at the depth.
    pub(super) fn drill(
        &self,
        [reference, start, bottom]: [f64; 3],
        dwell: Option<Dwell>,
        state: &mut State,
    ) -> Outcome<()> {
        let down = (bottom - start).signum();
        // Depths count from the reference plane.
        let depth = (bottom - reference).abs();
        let depths = self.depths(depth)?;
        let programmed = state.modal.feed;
        for (index, peck) in depths.iter().enumerate() {
            let is_last = index + 1 == depths.len();
            let target = reference + down * peck;
            state.modal.feed = match programmed {
                Some(feed) if index == 0 => Some(feed.map(|feed| feed * self.feed_factor)),
                feed => feed,
            };
            feed_to(target, state)?;
            pause(if is_last { dwell } else { self.dwells[1] }, state)?;
            if is_last {
                break;
            }
            if self.removes_chips {
                rapid(start, state)?;
                pause(self.dwells[0], state)?;
                let built_in =
                    if depth <= SHORT_DEPTH { SHORT_CLEARANCE } else { (depth / 50.0).min(LONG_CLEARANCE) };
                let clearance = self.clearance.unwrap_or(built_in).min((target - start).abs());
                rapid(target - down * clearance, state)?;
            } else {
                state.modal.feed = programmed;
                feed_to(target - down * self.retraction.min((target - start).abs()), state)?;
            }
        }
        state.modal.feed = programmed;
        Ok(())
    }
}
