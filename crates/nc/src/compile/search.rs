//! Search for the changes of a program that make it better.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::error::CompileError;
use super::model::{ChangedProgram, Changes, ProgramModel};
use super::outcome::{CompileAim, CompileOptions};
use super::simulation::{Runs, Simulator};
use crate::interpret::InterpreterOptions;
use crate::plan::ProgrammedPath;

/// Plants of the search: the first ones; all plants decide at the end.
const SEARCH_PLANTS: usize = 5;
/// Shift of a point relative to its error in the first iteration, and the least one.
const GAIN: f64 = 0.7;
const LEAST_GAIN: f64 = 0.12;
/// Shift of a point relative to its error after changes of feeds.
const FINE_GAIN: f64 = 0.4;
/// Most iterations of shifts, of those after the feeds, and of feeds.
const SHIFT_ITERATIONS: usize = 12;
const FINE_ITERATIONS: usize = 6;
const FEED_ITERATIONS: usize = 40;
/// Weight of the mean of the largest errors of the lines beside the largest error of the program.
const MEAN_WEIGHT: f64 = 0.3;
/// Part of the largest error from which a line is one of the worst.
const WORST: f64 = 0.9;
/// Part of the largest error below which no feed is lowered, and no line gets a point in its middle.
pub(super) const LARGE: f64 = 0.5;
/// Factors by which the feed of a line is lowered and raised, and the least one in all. The overshoot after a short slow part
/// can grow before it falls.
const SLOWER: f64 = 0.8;
const MUCH_SLOWER: f64 = 0.5;
const FASTER: f64 = 1.15;
const SLOWEST: f64 = 0.1;
/// Pieces before and after a point whose errors decide on its shift, and the growth that is no growth.
const NEAR: usize = 2;
const LOCAL_TOLERANCE: f64 = 0.01;
/// Distance between points of a fine path, m, whose shifts are smoothed.
const FINE: f64 = 2e-3;

/// Changes with their runs.
pub(super) struct Candidate {
    pub changes: Changes,
    pub program: ChangedProgram,
    pub runs: Runs,
    /// Largest distance of the end of each piece from the simulated path on any plant, m: a corner that is cut.
    missed: Vec<f64>,
}

/// Search for the changes of one program.
pub(super) struct Search<'a> {
    pub simulator: &'a Simulator<'a>,
    pub model: &'a ProgramModel,
    pub reference: &'a ProgrammedPath,
    pub interpreter: &'a InterpreterOptions,
    pub options: &'a CompileOptions,
    /// Longest cycle time, s.
    pub time: f64,
    pub largest_shift: f64,
}

impl ProgramModel {
    /// Makes the ends of whole turns the same point, on a circle of the changed radius.
    pub(super) fn join_turns(&self, changes: &mut Changes) {
        for (index, piece) in self.pieces.iter().enumerate().filter(|(index, _)| self.is_whole_turn(*index)) {
            if self.nodes[piece.from].is_fixed || self.nodes[piece.to].is_fixed {
                changes.radii[index] = 0.0;
                changes.shifts[piece.from] = Vector3::zeros();
                changes.shifts[piece.to] = Vector3::zeros();
                continue;
            }
            let shift = self.normal(index, false) * changes.radii[index];
            changes.shifts[piece.from] = shift;
            changes.shifts[piece.to] = shift;
        }
    }
}

impl Candidate {
    /// Returns the program as it is.
    pub fn unchanged(text: &str, runs: &Runs) -> Self {
        let lines = text.split('\n').count();
        Self {
            changes: Changes { shifts: Vec::new(), radii: Vec::new(), feeds: Vec::new() },
            program: ChangedProgram {
                text: text.to_owned(),
                pieces: vec![None; lines],
                sources: (1..=lines).collect(),
            },
            runs: Runs { time: runs.time, plants: Vec::new() },
            missed: Vec::new(),
        }
    }

    /// Returns the largest error of the cuts and of the ends that they miss, m.
    fn largest(&self) -> f64 {
        self.missed.iter().copied().fold(self.runs.max(), f64::max)
    }

    /// Returns the largest error and part of the mean of those of the source lines, m.
    fn score(&self) -> f64 {
        self.largest() - self.runs.max() + score(&self.runs)
    }
}

impl Search<'_> {
    /// Returns the best changes; `None` if none can be simulated.
    pub fn run(&self) -> Result<Option<Candidate>, CompileError> {
        let Some(first) = self.candidate(self.model.unchanged())? else { return Ok(None) };
        let mut best = self.shifted(first, GAIN, SHIFT_ITERATIONS)?;
        best = self.with_feeds(best)?;
        // Other feeds have other errors.
        best = self.shifted(best, FINE_GAIN, FINE_ITERATIONS)?;
        Ok(Some(self.with_feeds(best)?))
    }

    /// Writes, verifies and simulates changes; `None` if they are not interpreted as they are meant, or beyond limits.
    fn candidate(&self, changes: Changes) -> Result<Option<Candidate>, CompileError> {
        let program = self.model.write(&changes);
        if self.model.verify(&program, &changes, self.simulator.name, self.interpreter).is_err() {
            return Ok(None);
        }
        let planned = match self.simulator.plan(&program.text) {
            Ok(planned) => planned,
            Err(CompileError::Program(_)) => return Ok(None),
            Err(error) => return Err(error),
        };
        let runs = self.simulator.run(&planned, self.reference, SEARCH_PLANTS)?;
        let mut missed = vec![0.0; self.model.pieces.len()];
        for run in &runs.plants {
            let tips = by_piece(&program, missed.len(), &run.tips);
            for (piece, missed) in missed.iter_mut().enumerate() {
                *missed = self.error_at_end(piece, &run.tips, &tips).norm().max(*missed);
            }
        }
        Ok(Some(Candidate { changes, program, runs, missed }))
    }

    /// Returns the order of candidates: the smallest is the best.
    pub fn key(&self, candidate: &Candidate) -> (f64, f64) {
        let runs = &candidate.runs;
        if runs.plants.is_empty() {
            return (f64::INFINITY, f64::INFINITY);
        }
        match self.options.aim {
            CompileAim::Tolerance(tolerance) if candidate.largest() <= tolerance => (0.0, runs.time),
            CompileAim::Time(_) if runs.time > self.time => (f64::MAX, runs.time),
            _ => (candidate.score(), runs.time),
        }
    }

    /// Shifts points and radii. A point whose surrounding errors grow returns, and moves by less in the next iteration.
    fn shifted(&self, first: Candidate, gain: f64, iterations: usize) -> Result<Candidate, CompileError> {
        let model = self.model;
        let mut gains = vec![gain; model.nodes.len()];
        let mut errors = self.piece_errors(&first);
        let (mut best, mut present): (Candidate, Option<Candidate>) = (first, None);
        for _ in 0..iterations {
            let from = present.as_ref().unwrap_or(&best);
            let Some(next) = self.candidate(self.shift(from, &gains))? else {
                gains.iter_mut().for_each(|gain| *gain *= 0.5);
                continue;
            };
            let found = self.piece_errors(&next);
            let mut merged = next.changes.clone();
            let mut is_reverted = false;
            for (piece, parts) in model.pieces.iter().enumerate() {
                let around =
                    |errors: &[f64]| self.around(piece, NEAR).map(|near| errors[near]).fold(0.0, f64::max);
                if around(&found) > around(&errors) * (1.0 + LOCAL_TOLERANCE) {
                    merged.shifts[parts.to] = from.changes.shifts[parts.to];
                    merged.radii[piece] = from.changes.radii[piece];
                    gains[parts.to] *= 0.5;
                    is_reverted = true;
                }
            }
            let next = if is_reverted {
                model.join_turns(&mut merged);
                match self.candidate(merged)? {
                    Some(merged) if merged.score() < next.score() => merged,
                    _ => next,
                }
            } else {
                next
            };
            errors = self.piece_errors(&next);
            let is_better = next.score() < best.score() && self.is_in_time(&next, &best);
            if is_better {
                best = next;
                present = None;
            } else {
                present = Some(next);
            }
            if gains.iter().all(|gain| *gain < LEAST_GAIN) {
                break;
            }
        }
        Ok(best)
    }

    /// Returns true if a program is within the time, or no longer than another.
    fn is_in_time(&self, next: &Candidate, best: &Candidate) -> bool {
        next.runs.time <= self.time.max(best.runs.time)
    }

    /// Returns changes with points and radii moved against their errors: the middle between those of all plants.
    fn shift(&self, from: &Candidate, gains: &[f64]) -> Changes {
        let model = self.model;
        let mut errors = vec![Middle::<3>::default(); model.nodes.len()];
        let mut radial = vec![Middle::<1>::default(); model.pieces.len()];
        for run in &from.runs.plants {
            let tips = by_piece(&from.program, model.pieces.len(), &run.tips);
            for (piece, parts) in model.pieces.iter().enumerate() {
                let of = |piece: usize| &run.tips[tips[piece][0]..tips[piece][1]];
                let error = match self.following(piece) {
                    Some(after) if model.is_line_corner(piece) => {
                        model.corner_error(piece, [of(piece), of(after)])
                    }
                    _ => self.error_at_end(piece, &run.tips, &tips),
                };
                errors[parts.to].add(error.into());
                if let Some((center, radius, [first, second])) = model.circle(piece) {
                    let all = of(piece);
                    let inner = &all[all.len() / 8..all.len() - all.len() / 8];
                    let error = |tip: &Vector3<f64>| {
                        (tip[first] - center[first]).hypot(tip[second] - center[second]) - radius
                    };
                    let sum: f64 = inner.iter().map(|(_, tip)| error(tip)).sum();
                    radial[piece].add([sum / inner.len().max(1) as f64]);
                }
            }
        }
        let errors: Vec<Vector3<f64>> = errors.iter().map(|error| error.value().into()).collect();
        let mut changes = from.changes.clone();
        for (index, radial) in radial.iter().enumerate() {
            let node = model.pieces[index].to;
            let gain = gains[node];
            if !model.nodes[node].is_fixed {
                let error = self.smoothed(&errors, index);
                changes.shifts[node] -= (error * gain).component_mul(&model.nodes[node].free);
                changes.shifts[node] = changes.shifts[node].cap_magnitude(self.largest_shift);
            }
            let [error] = radial.value();
            changes.radii[index] =
                (changes.radii[index] - error * gain).clamp(-self.largest_shift, self.largest_shift);
        }
        model.join_turns(&mut changes);
        changes
    }

    /// Returns the piece that begins at the end of another one.
    fn following(&self, piece: usize) -> Option<usize> {
        let [before, after] = [self.model.pieces.get(piece)?, self.model.pieces.get(piece + 1)?];
        (after.from == before.to).then_some(piece + 1)
    }

    /// Returns the vector from the end of a piece to the nearest point of the tool path near it, m; `ranges` are the tool
    /// tips of each piece.
    fn error_at_end(
        &self,
        piece: usize,
        tips: &[(usize, Vector3<f64>)],
        ranges: &[[usize; 2]],
    ) -> Vector3<f64> {
        let to = self.following(piece).map_or(0, |after| ranges[after][1]).max(ranges[piece][1]);
        let window = &tips[ranges[piece][0].saturating_sub(1)..(to + 1).min(tips.len())];
        let tip = self.model.nodes[self.model.pieces[piece].to].tip;
        nearest(window, &tip).map_or(Vector3::zeros(), |nearest| nearest - tip)
    }

    /// Returns the error at the end of a piece, on a fine path as a mean with its neighbors.
    fn smoothed(&self, errors: &[Vector3<f64>], piece: usize) -> Vector3<f64> {
        let pieces = &self.model.pieces;
        let node = pieces[piece].to;
        let tip = |node: usize| self.model.nodes[node].tip;
        let before = pieces[piece].from;
        let Some(after) = pieces.get(piece + 1).filter(|next| next.from == node).map(|next| next.to) else {
            return errors[node];
        };
        let (one, two) = (tip(node) - tip(before), tip(after) - tip(node));
        let is_fine = one.norm() < FINE && two.norm() < FINE && one.angle(&two) < 0.5;
        match is_fine {
            true => 0.5 * errors[node] + 0.25 * (errors[before] + errors[after]),
            false => errors[node],
        }
    }

    /// Lowers feeds at the largest errors and raises them where errors are small, within the aim.
    fn with_feeds(&self, first: Candidate) -> Result<Candidate, CompileError> {
        let mut best = first;
        let mut is_blocked = vec![false; self.model.pieces.len()];
        let bound = match self.options.aim {
            CompileAim::Tolerance(tolerance) => tolerance,
            CompileAim::Time(_) => 0.0,
        };
        for _ in 0..FEED_ITERATIONS {
            let errors = self.piece_errors(&best);
            let open = |piece: &usize| !is_blocked[*piece] && errors[*piece] > bound;
            let largest = (0..errors.len()).filter(open).map(|piece| errors[piece]).fold(0.0, f64::max);
            let worst: Vec<usize> =
                (0..errors.len()).filter(open).filter(|piece| errors[*piece] >= WORST * largest).collect();
            if worst.is_empty() || largest < LARGE * errors.iter().copied().fold(0.0, f64::max) {
                break;
            }
            let own: BTreeSet<usize> = worst.iter().copied().collect();
            let before: BTreeSet<usize> = worst.iter().map(|piece| piece.saturating_sub(1)).collect();
            let around: BTreeSet<usize> = worst.iter().flat_map(|&piece| self.around(piece, 1)).collect();
            let reached = self.reached_feeds(&best);
            let mut next = None;
            for (pieces, factor) in [
                (&before, SLOWER),
                (&own, SLOWER),
                (&around, SLOWER),
                (&before, MUCH_SLOWER),
                (&own, MUCH_SLOWER),
                (&around, SLOWER.sqrt()),
            ] {
                let mut changes = best.changes.clone();
                for piece in pieces {
                    let (feed, reached) = (changes.feeds[*piece] * factor, reached[*piece]);
                    let has_effect = feed < reached;
                    changes.feeds[*piece] = if has_effect { feed } else { reached * factor }.max(SLOWEST);
                }
                next = self
                    .candidate(changes)?
                    .filter(|next| next.runs.time <= self.time && self.key(next) < self.key(&best));
                if next.is_some() {
                    break;
                }
            }
            match next {
                Some(next) => best = self.shifted(next, FINE_GAIN, 1)?,
                None => worst.iter().for_each(|&piece| is_blocked[piece] = true),
            }
        }
        self.with_raised_feeds(best)
    }

    /// Returns the largest feed that the nominal plant reaches on each piece, relative to the programmed one: limits of the
    /// axes can keep it below, and a feed above it has no effect. Infinite for a piece without a cycle of its own.
    fn reached_feeds(&self, candidate: &Candidate) -> Vec<f64> {
        let mut reached: Vec<Option<f64>> = vec![None; self.model.pieces.len()];
        for cycle in candidate.runs.plants.first().iter().flat_map(|nominal| nominal.tips.windows(2)) {
            let line = cycle[1].0;
            if let Some(Some(piece)) = candidate.program.pieces.get(line.wrapping_sub(1)) {
                let feed =
                    (cycle[1].1 - cycle[0].1).norm() / self.simulator.period() / self.model.feed(*piece);
                reached[*piece] = Some(reached[*piece].map_or(feed, |largest| feed.max(largest)));
            }
        }
        reached.into_iter().map(|feed| feed.unwrap_or(f64::INFINITY)).collect()
    }

    /// Raises feeds up to the limit, and lowered ones again, where the errors allow it.
    fn with_raised_feeds(&self, first: Candidate) -> Result<Candidate, CompileError> {
        let mut best = first;
        let bound = match self.options.aim {
            CompileAim::Tolerance(tolerance) => tolerance,
            CompileAim::Time(_) => best.largest(),
        };
        let mut factor = FASTER;
        for _ in 0..SHIFT_ITERATIONS {
            let errors = self.piece_errors(&best);
            let mut changes = best.changes.clone();
            let mut is_raised = false;
            for (piece, feed) in changes.feeds.iter_mut().enumerate() {
                let room = self.around(piece, 1).map(|near| errors[near]).fold(0.0, f64::max);
                if room * factor < bound && *feed < self.options.feed_limit {
                    *feed = (*feed * factor).min(self.options.feed_limit);
                    is_raised = true;
                }
            }
            if !is_raised {
                break;
            }
            match self.candidate(changes)? {
                Some(next) if next.largest() <= bound && next.runs.time < best.runs.time => best = next,
                _ => factor = 1.0 + 0.5 * (factor - 1.0),
            }
            if factor < 1.02 {
                break;
            }
        }
        Ok(best)
    }

    /// Returns a piece and those up to `count` beside it.
    fn around(&self, piece: usize, count: usize) -> impl Iterator<Item = usize> {
        piece.saturating_sub(count)..(piece + count + 1).min(self.model.pieces.len())
    }

    /// Returns the largest error of each piece on any plant, m.
    fn piece_errors(&self, candidate: &Candidate) -> Vec<f64> {
        let mut errors = candidate.missed.clone();
        for (line, error) in candidate.runs.lines() {
            if let Some(Some(piece)) = candidate.program.pieces.get(line.wrapping_sub(1)) {
                errors[*piece] = error.max(errors[*piece]);
            }
        }
        errors
    }
}

/// Middle between the least and the largest of the values that are added.
#[derive(Clone, Copy)]
struct Middle<const N: usize>([[f64; 2]; N]);

impl<const N: usize> Default for Middle<N> {
    fn default() -> Self {
        Self([[f64::INFINITY, f64::NEG_INFINITY]; N])
    }
}

impl<const N: usize> Middle<N> {
    fn add(&mut self, values: [f64; N]) {
        for (range, value) in self.0.iter_mut().zip(values) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }

    /// Returns the middle; 0 without a value.
    fn value(&self) -> [f64; N] {
        self.0.map(|[least, most]| if least <= most { 0.5 * (least + most) } else { 0.0 })
    }
}

/// Returns the largest error and part of the mean of those of the source lines, m.
pub(super) fn score(runs: &Runs) -> f64 {
    let lines = runs.lines();
    let mean = (lines.values().map(|error| error.powi(2)).sum::<f64>() / lines.len().max(1) as f64).sqrt();
    runs.max() + MEAN_WEIGHT * mean
}

/// Returns first and last + 1 index of the tool tips of each piece.
fn by_piece(program: &ChangedProgram, count: usize, tips: &[(usize, Vector3<f64>)]) -> Vec<[usize; 2]> {
    let mut ranges = vec![[usize::MAX, 0]; count];
    for (index, (line, _)) in tips.iter().enumerate() {
        if let Some(Some(piece)) = program.pieces.get(line.wrapping_sub(1)) {
            let [from, to] = ranges[*piece];
            ranges[*piece] = [from.min(index), to.max(index + 1)];
        }
    }
    // A piece without a cycle of its own lies between its neighbors.
    let mut last = 0;
    for range in &mut ranges {
        if range[0] == usize::MAX {
            *range = [last, last];
        }
        last = range[1];
    }
    ranges
}

/// Returns the point of the polyline through tool tips that is nearest to `point`.
fn nearest(tips: &[(usize, Vector3<f64>)], point: &Vector3<f64>) -> Option<Vector3<f64>> {
    let foot = |pair: &[(usize, Vector3<f64>)]| {
        let step = pair[1].1 - pair[0].1;
        let square = step.norm_squared();
        let along =
            if square > 0.0 { ((point - pair[0].1).dot(&step) / square).clamp(0.0, 1.0) } else { 0.0 };
        pair[0].1 + step * along
    };
    let distance = |at: &Vector3<f64>| (at - point).norm_squared();
    tips.windows(2).map(foot).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
