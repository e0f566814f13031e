//! Smooth approach and retraction: G147, G247, G347 to a contour with cutter radius compensation, and G148, G248, G348 from
//! it, on a straight line, a quarter circle or a semicircle of the tool center that is tangent to the contour.

use super::super::error::Outcome;
use super::super::limits::MAX_RATE;
use super::super::state::State;
use super::Sinumerik;
use super::modes::MotionMode;
use super::soft_path::{Beside, SoftPath, SoftShape};
use super::words::{Approach, Words};
use crate::motion::{AXIS_LETTERS, Coordinates, PlanarArc};

/// G codes of approach and retraction.
const CODES: [u32; 6] = [147, 148, 247, 248, 347, 348];

impl Sinumerik {
    /// Returns the values of G147 to G348 in a block, which then count as used, with true for an approach.
    pub(super) fn soft_path(&self, words: &mut Words, state: &State) -> Outcome<Option<(SoftPath, bool)>> {
        let Some(code) = words.take_group(&CODES)? else { return Ok(None) };
        let length = state.modal.length;
        let normal = state.modal.plane.axes()[2];
        let distance = words.positive("DISR", MAX_RATE)?.filter(|distance| *distance > 0.0);
        let distance = distance.ok_or_else(|| format!("G{code} requires DISR above 0"))? * length;
        let clearance = words.take("DISCL");
        let infeed = words.positive("FAD", MAX_RATE)?.map(|feed| feed * self.modes.feed_length);
        let is_approach = code % 10 == 7;
        let mut point = state.programmed();
        if let (true, Some((value, approach))) = (is_approach, words.axes[normal]) {
            let value = value * length;
            let is_incremental = match approach {
                Approach::Incremental => true,
                Approach::Modal => state.modal.is_incremental,
                _ => false,
            };
            point[normal] = if is_incremental { point[normal] + value } else { value };
        }
        let level = match clearance {
            None => None,
            Some(word) => {
                let value = word.value.number()? * length;
                let base = if word.approach == Approach::Absolute { 0.0 } else { point[normal] };
                Some(base + value).filter(|level| *level != point[normal])
            }
        };
        let shape = match code / 100 {
            1 => SoftShape::Line,
            2 => SoftShape::Quarter,
            _ => SoftShape::Semicircle,
        };
        let path = SoftPath { shape, distance, level, infeed, is_rapid: false, point, has_point: false };
        Ok(Some((path, is_approach)))
    }

    /// Stores an approach, which the next motion in the plane completes.
    pub(super) fn prepare_approach(
        &mut self,
        mut path: SoftPath,
        words: &mut Words,
        state: &State,
    ) -> Outcome<()> {
        let [first, second, normal] = state.modal.plane.axes();
        if words.axes[first].is_some() || words.axes[second].is_some() {
            path.point = self.targets(words, &state.programmed(), state)?;
            path.has_point = true;
        }
        words.axes[normal] = None;
        path.is_rapid = self.modes.motion == MotionMode::Rapid;
        self.approach = Some(path);
        Ok(())
    }

    /// Approaches the contour, which begins with a tangent.
    pub(super) fn approach_contour(
        &mut self,
        path: &SoftPath,
        tangent: Option<[f64; 2]>,
        state: &mut State,
    ) -> Outcome<()> {
        let [first, second, normal] = state.modal.plane.axes();
        let tangent = tangent.ok_or_else(|| {
            format!(
                "a smooth approach requires a motion along {} or {} behind it",
                AXIS_LETTERS[first], AXIS_LETTERS[second]
            )
        })?;
        let beside = path.beside([path.point[first], path.point[second]], tangent, -1.0, self.side(state)?);
        let start = state.programmed();
        let mut at = start;
        [at[first], at[second]] = beside.end;
        if path.level.is_none() {
            at[normal] = path.point[normal];
        }
        match path.is_rapid {
            true => state.rapid_to(&at)?,
            false => state.line_to(&at)?,
        }
        if let Some(level) = path.level {
            at[normal] = level;
            state.rapid_to(&at)?;
            if !self.modes.approaches_in_space {
                at[normal] = path.point[normal];
                let feed = state.modal.feed;
                state.modal.feed = path.infeed.map(|feed| [feed; 2]).or(feed);
                state.line_to(&at)?;
                state.modal.feed = feed;
            }
        }
        follow(&beside, &path.point, state)
    }

    /// Leaves the contour, and moves to the end of the block.
    pub(super) fn retract_from_contour(
        &mut self,
        path: &SoftPath,
        words: &mut Words,
        state: &mut State,
    ) -> Outcome<()> {
        let plane = state.modal.plane;
        let [first, second, normal] = plane.axes();
        let tangent = self.tangent.filter(|(of_plane, _)| *of_plane == plane);
        let (_, tangent) =
            tangent.ok_or("a smooth retraction requires a motion in the plane in front of it")?;
        let start = state.programmed();
        let end = self.targets(words, &start, state)?;
        let beside = path.beside([start[first], start[second]], tangent, 1.0, self.side(state)?);
        let mut at = start;
        [at[first], at[second]] = beside.end;
        if self.modes.approaches_in_space {
            at[normal] = path.level.unwrap_or(at[normal]);
        }
        follow(&beside, &at, state)?;
        at[normal] = path.level.unwrap_or(at[normal]);
        state.line_to(&at)?;
        at[normal] = end[normal];
        let is_rapid = self.modes.motion == MotionMode::Rapid;
        let mut go = |to: &Coordinates| if is_rapid { state.rapid_to(to) } else { state.line_to(to) };
        go(&at)?;
        self.set_compensation(words, state)?;
        if is_rapid { state.rapid_to(&end) } else { state.line_to(&end) }
    }

    /// Rejects an approach that no motion has completed.
    pub(super) fn require_no_approach(&self) -> Outcome<()> {
        match self.approach {
            None => Ok(()),
            Some(_) => {
                Err("a smooth approach requires a contour behind it: G1, G2 or G3 in the plane".to_owned())
            }
        }
    }

    /// Returns the side of the tool, 1 to the left, and the radius of the compensation, m.
    fn side(&self, state: &State) -> Outcome<(f64, f64)> {
        let is_left = self.modes.is_tool_left;
        let is_left = is_left.ok_or("a smooth approach or retraction requires G41 or G42")?;
        let radius = state.contour.compensation.map_or(0.0, |(compensation, _)| compensation.radius);
        Ok((if is_left == (radius >= 0.0) { 1.0 } else { -1.0 }, radius.abs()))
    }
}

/// Appends the line or arc beside the contour to its end `to`.
fn follow(beside: &Beside, to: &Coordinates, state: &mut State) -> Outcome<()> {
    match beside.arc {
        None => state.line_to(to),
        Some((center, sweep)) => {
            let plane = state.modal.plane;
            state.arc_to(&PlanarArc { plane, center, sweep }, to)
        }
    }
}
