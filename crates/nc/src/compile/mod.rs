//! Compilation of a part program for its machine: points and feeds changed so that the simulated tool stays near the
//! programmed path.
//!
//! The program is interpreted, planned and simulated on the nominal machine and on deviating plants. Points between cuts are
//! shifted against the mean error vector of the plants, radii of arcs against their mean radial error, and feeds are lowered
//! at the largest errors, as iterative learning does with setpoints. Each step is simulated again against the path of the
//! program as it was, and only the best one remains.

mod error;
mod model;
mod simulation;
mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::PathBuf;

use nalgebra::Vector3;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::kinematics::Kinematics;
use virtual_axes_core::units::seconds;

pub use self::error::CompileError;
use self::model::{ChangedProgram, Changes, ProgramModel};
use self::simulation::{Runs, Simulator};
use crate::interpret::InterpreterOptions;
use crate::offline::PartProgramOptions;
use crate::plan::ProgrammedPath;

/// Plants of the search: the first ones; all plants decide at the end.
const SEARCH_PLANTS: usize = 5;
/// Sets of distances of extra points from corners that are tried, m.
const DISTANCES: [&[f64]; 3] = [&[], &[1.2e-3], &[0.4e-3, 1.2e-3, 4e-3]];
/// Shift of a point relative to its error in the first iteration, and the least one.
const GAIN: f64 = 0.7;
const LEAST_GAIN: f64 = 0.12;
/// Most iterations of shifts, and of feeds.
const SHIFT_ITERATIONS: usize = 12;
const FEED_ITERATIONS: usize = 40;
/// Largest shift, as a multiple of the largest error of the program.
const LARGEST_SHIFT: f64 = 3.0;
/// Weight of the mean of the largest errors of the lines beside the largest error of the program.
const MEAN_WEIGHT: f64 = 0.3;
/// Part of the largest error from which a line is one of the worst.
const WORST: f64 = 0.9;
/// Factors by which the feed of a line is lowered and raised, and the least one in all.
const SLOWER: f64 = 0.8;
const FASTER: f64 = 1.15;
const SLOWEST: f64 = 0.1;
/// Change of the figures by which a program is better.
const IMPROVEMENT: f64 = 0.02;
/// Gain of time, relative to the cycle time, below which a program is no faster.
const TIME_ROUNDING: f64 = 2e-3;
/// Pieces before and after a point whose errors decide on its shift, and the growth that is no growth.
const NEAR: usize = 2;
const LOCAL_TOLERANCE: f64 = 0.01;
/// Distance between points of a fine path, m, whose shifts are smoothed.
const FINE: f64 = 2e-3;
/// Most corrections of the lines that are left out.
const VERIFICATIONS: usize = 20;

/// Aim of a compilation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CompileAim {
    /// Contour errors up to a tolerance, m, in the least time.
    Tolerance(f64),
    /// Least error with a cycle time of at most that of the program, times one plus this value, or one position cycle more
    /// than that of the program.
    Time(f64),
}

/// Options of a compilation.
#[derive(Debug, Clone, PartialEq)]
pub struct CompileOptions {
    /// Aim.
    pub aim: CompileAim,
    /// Highest feed relative to the programmed one, at least 1.
    pub feed_limit: f64,
    /// Interpretation and planning of the program.
    pub program: PartProgramOptions,
}

/// Figures of a program on all plants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompiledFigures {
    /// Cycle time, s.
    pub cycle_time: f64,
    /// Largest contour error at feed on the nominal machine, m.
    pub nominal: f64,
    /// Largest contour error at feed on any plant, m.
    pub worst: f64,
    /// Largest RMS contour error at feed on any plant, m.
    pub rms: f64,
}

/// Line of the program with its largest contour errors.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledLine {
    /// Source line, from 1.
    pub line: usize,
    /// First of its lines in the compiled program, from 1.
    pub new_line: usize,
    /// Text in the program, and in the compiled one with its extra lines.
    pub texts: [String; 2],
    /// Largest contour error on any plant before and after, m.
    pub errors: [f64; 2],
}

/// Compiled program.
#[derive(Debug, Clone, PartialEq)]
pub struct Compiled {
    /// Text of the program; that of the input if nothing is better.
    pub text: String,
    /// True if the text differs from the input.
    pub is_changed: bool,
    /// Figures of the program, and of the compiled one against the path of the program.
    pub figures: [CompiledFigures; 2],
    /// Lines with their errors, the largest before first.
    pub lines: Vec<CompiledLine>,
    /// Number of lines that can be changed.
    pub eligible: usize,
    /// Number of lines at feed that are not changed, by reason.
    pub left: BTreeMap<&'static str, usize>,
    /// Number of points that are shifted, extra points, and parts of lines with another feed.
    pub counts: [usize; 3],
    /// Largest shift of a point or radius, m.
    pub largest_shift: f64,
}

/// Changes with their runs.
struct Candidate {
    changes: Changes,
    program: ChangedProgram,
    runs: Runs,
}

/// Search for the changes of one program.
struct Search<'a> {
    simulator: &'a Simulator<'a>,
    model: &'a ProgramModel,
    reference: &'a ProgrammedPath,
    interpreter: &'a InterpreterOptions,
    options: &'a CompileOptions,
    /// Longest cycle time, s.
    time: f64,
    largest_shift: f64,
}

/// Compiles the part program `text` for `plants`, the nominal machine first, and plants that differ from it in inertia,
/// friction or torque constant. `name` and the folder of its subprograms are those of the file; `check` interrupts with
/// its error.
///
/// # Errors
///
/// A program that is invalid, or a run that fails.
pub fn compile(
    text: &str,
    (name, folder): (&str, Option<PathBuf>),
    plants: &[MachineConfig],
    options: &CompileOptions,
    check: &(dyn Fn() -> io::Result<()> + Sync),
) -> Result<Compiled, CompileError> {
    let machine = plants.first().ok_or(CompileError::NoPlant)?;
    let simulator = Simulator { name, folder: folder.clone(), plants, options: &options.program, check };
    let interpreter = options.program.interpreter(machine).map_err(CompileError::Program)?;
    let interpreter = InterpreterOptions { subprogram_folder: folder, ..interpreter };
    let planned = simulator.plan(text)?;
    let before = simulator.run(&planned, planned.path(), plants.len())?;
    let longest = match options.aim {
        CompileAim::Tolerance(_) => f64::INFINITY,
        // Setpoints lie on the grid of the position cycle: the same time may be one cycle later.
        CompileAim::Time(more) => {
            (before.time * (1.0 + more)).max(before.time + seconds(machine.periods().position))
        }
    };
    let (mut best, mut left_out): (Option<(ProgramModel, Candidate)>, BTreeSet<usize>) =
        (None, BTreeSet::new());
    let mut pieces = Vec::new();
    for distances in DISTANCES {
        let Some(model) = verified_model((text, name), machine, &interpreter, distances, &mut left_out)?
        else {
            continue;
        };
        if model.pieces.is_empty() || pieces.contains(&model.pieces.len()) {
            if best.is_none() {
                best = Some((model, Candidate::unchanged(text, &before)));
            }
            continue;
        }
        pieces.push(model.pieces.len());
        let search = Search {
            simulator: &simulator,
            model: &model,
            reference: planned.path(),
            interpreter: &interpreter,
            options,
            time: longest,
            largest_shift: LARGEST_SHIFT * before.max(),
        };
        if let Some(found) = search.run()? {
            let is_better = best.as_ref().is_none_or(|(_, best)| search.key(&found) < search.key(best));
            if is_better {
                best = Some((model, found));
            }
        }
    }
    let Some((model, found)) = best else { return Ok(Compiled::unchanged(text, &before)) };
    // All plants decide.
    let runs = simulator.run(&simulator.plan(&found.program.text)?, planned.path(), plants.len())?;
    let is_better = runs.time <= longest
        && match options.aim {
            CompileAim::Tolerance(tolerance) if runs.max() <= tolerance => {
                before.max() > tolerance || runs.time < before.time * (1.0 - TIME_ROUNDING)
            }
            CompileAim::Tolerance(_) => runs.max() < before.max() * (1.0 - IMPROVEMENT),
            CompileAim::Time(_) => {
                runs.max() <= before.max() && score(&runs) < score(&before) * (1.0 - IMPROVEMENT)
            }
        };
    let (found, runs) = match is_better && found.program.text != text {
        true => (found, Some(runs)),
        false => (Candidate::unchanged(text, &before), None),
    };
    Ok(report(text, &model, &found, &before, runs.as_ref().unwrap_or(&before), runs.is_some()))
}

/// Reads a program and leaves out lines whose change would change others, until a small change of all points is
/// interpreted as it is meant; `None` if some remain.
fn verified_model(
    (text, name): (&str, &str),
    machine: &MachineConfig,
    interpreter: &InterpreterOptions,
    distances: &[f64],
    left_out: &mut BTreeSet<usize>,
) -> Result<Option<ProgramModel>, CompileError> {
    let kinematics = Kinematics::new(machine);
    for _ in 0..VERIFICATIONS {
        let model = ProgramModel::read((text, name), (interpreter, &kinematics), distances, left_out)?;
        let mut trial = model.unchanged();
        for (index, (shift, node)) in trial.shifts.iter_mut().zip(&model.nodes).enumerate() {
            if !node.is_fixed {
                let step = 1e-5 * (1.0 + (index % 3) as f64);
                *shift = Vector3::new(step, -0.7 * step, if index % 2 == 0 { 0.0 } else { 0.4 * step });
            }
        }
        trial.feeds.iter_mut().enumerate().for_each(|(i, feed)| *feed = [1.0, 0.5, 0.8][i % 3]);
        model.join_turns(&mut trial);
        let Err(line) = model.verify(&model.write(&trial), &trial, name, interpreter) else {
            return Ok(Some(model));
        };
        if line == 0 || !left_out.insert(line) {
            return Ok(None);
        }
    }
    Ok(None)
}

impl ProgramModel {
    /// Makes the ends of whole turns the same point, on a circle of the changed radius.
    fn join_turns(&self, changes: &mut Changes) {
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
    fn unchanged(text: &str, runs: &Runs) -> Self {
        let lines = text.split('\n').count();
        Self {
            changes: Changes { shifts: Vec::new(), radii: Vec::new(), feeds: Vec::new() },
            program: ChangedProgram {
                text: text.to_owned(),
                pieces: vec![None; lines],
                sources: (1..=lines).collect(),
            },
            runs: Runs { time: runs.time, plants: Vec::new() },
        }
    }
}

impl Search<'_> {
    /// Returns the best changes; `None` if none can be simulated.
    fn run(&self) -> Result<Option<Candidate>, CompileError> {
        let Some(first) = self.candidate(self.model.unchanged())? else { return Ok(None) };
        let mut best = self.shifted(first, GAIN, SHIFT_ITERATIONS)?;
        best = self.with_feeds(best)?;
        Ok(Some(best))
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
        Ok(Some(Candidate { changes, program, runs }))
    }

    /// Returns the order of candidates: the smallest is the best.
    fn key(&self, candidate: &Candidate) -> (f64, f64) {
        let runs = &candidate.runs;
        if runs.plants.is_empty() {
            return (f64::INFINITY, f64::INFINITY);
        }
        match self.options.aim {
            CompileAim::Tolerance(tolerance) if runs.max() <= tolerance => (0.0, runs.time),
            CompileAim::Time(_) if runs.time > self.time => (f64::MAX, runs.time),
            _ => (score(runs), runs.time),
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
                    Some(merged) if score(&merged.runs) < score(&next.runs) => merged,
                    _ => next,
                }
            } else {
                next
            };
            errors = self.piece_errors(&next);
            let is_better = score(&next.runs) < score(&best.runs) && self.is_in_time(&next, &best);
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
                let after =
                    model.pieces.get(piece + 1).filter(|next| next.from == parts.to).map(|_| piece + 1);
                let of = |piece: usize| &run.tips[tips[piece][0]..tips[piece][1]];
                let error = match after {
                    Some(after) if model.is_line_corner(piece) => {
                        model.corner_error(piece, [of(piece), of(after)])
                    }
                    _ => {
                        let to = after.map_or(0, |after| tips[after][1]).max(tips[piece][1]);
                        let window =
                            &run.tips[tips[piece][0].saturating_sub(1)..(to + 1).min(run.tips.len())];
                        let tip = model.nodes[parts.to].tip;
                        nearest(window, &tip).map_or(Vector3::zeros(), |nearest| nearest - tip)
                    }
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
                changes.shifts[node] -= error * gain;
                changes.shifts[node] = changes.shifts[node].cap_magnitude(self.largest_shift);
            }
            let [error] = radial.value();
            changes.radii[index] =
                (changes.radii[index] - error * gain).clamp(-self.largest_shift, self.largest_shift);
        }
        model.join_turns(&mut changes);
        changes
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
            if worst.is_empty() {
                break;
            }
            let before: BTreeSet<usize> = worst.iter().map(|piece| piece.saturating_sub(1)).collect();
            let around: BTreeSet<usize> = worst.iter().flat_map(|&piece| self.around(piece, 1)).collect();
            let mut next = None;
            for (pieces, factor) in [(&before, SLOWER), (&around, SLOWER), (&around, SLOWER.sqrt())] {
                let mut changes = best.changes.clone();
                for piece in pieces {
                    changes.feeds[*piece] = (changes.feeds[*piece] * factor).max(SLOWEST);
                }
                next = self
                    .candidate(changes)?
                    .filter(|next| next.runs.time <= self.time && self.key(next) < self.key(&best));
                if next.is_some() {
                    break;
                }
            }
            match next {
                Some(next) => best = self.shifted(next, 0.4, 1)?,
                None => worst.iter().for_each(|&piece| is_blocked[piece] = true),
            }
        }
        self.with_raised_feeds(best)
    }

    /// Raises feeds up to the limit, and lowered ones again, where the errors allow it.
    fn with_raised_feeds(&self, first: Candidate) -> Result<Candidate, CompileError> {
        let mut best = first;
        let bound = match self.options.aim {
            CompileAim::Tolerance(tolerance) => tolerance,
            CompileAim::Time(_) => best.runs.max(),
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
                Some(next) if next.runs.max() <= bound && next.runs.time < best.runs.time => best = next,
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
        let mut errors = vec![0.0; self.model.pieces.len()];
        for (line, error) in candidate.runs.lines() {
            if let Some(Some(piece)) = candidate.program.pieces.get(line.wrapping_sub(1)) {
                errors[*piece] = error;
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
fn score(runs: &Runs) -> f64 {
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

impl CompiledFigures {
    fn of(runs: &Runs) -> Self {
        Self {
            cycle_time: runs.time,
            nominal: runs.plants.first().map_or(0.0, |run| run.cuts.max),
            worst: runs.max(),
            rms: runs.rms(),
        }
    }
}

impl Compiled {
    fn unchanged(text: &str, before: &Runs) -> Self {
        Self {
            text: text.to_owned(),
            is_changed: false,
            figures: [CompiledFigures::of(before); 2],
            lines: Vec::new(),
            eligible: 0,
            left: BTreeMap::new(),
            counts: [0; 3],
            largest_shift: 0.0,
        }
    }
}

/// Returns the program with the figures before and after.
fn report(
    text: &str,
    model: &ProgramModel,
    found: &Candidate,
    before: &Runs,
    after: &Runs,
    is_changed: bool,
) -> Compiled {
    let mut new: BTreeMap<usize, (usize, Vec<&str>)> = BTreeMap::new();
    let mut after_lines: BTreeMap<usize, f64> = BTreeMap::new();
    let errors = after.lines();
    for ((line, source), text) in (1..).zip(&found.program.sources).zip(found.program.text.split('\n')) {
        new.entry(*source).or_insert((line, Vec::new())).1.push(text.trim());
        let largest = after_lines.entry(*source).or_default();
        *largest = largest.max(errors.get(&line).copied().unwrap_or(0.0));
    }
    let mut lines: Vec<CompiledLine> = before
        .lines()
        .into_iter()
        .filter_map(|(line, error)| {
            let (new_line, texts) = new.get(&line)?;
            Some(CompiledLine {
                line,
                new_line: *new_line,
                texts: [model.line(line).to_owned(), texts.join(" / ")],
                errors: [error, after_lines.get(&line).copied().unwrap_or(0.0)],
            })
        })
        .collect();
    lines.sort_by(|a, b| b.errors[0].total_cmp(&a.errors[0]));
    let eligible: BTreeSet<usize> = model.pieces.iter().map(|piece| piece.line).collect();
    let changes = &found.changes;
    let shifts = changes.shifts.iter().map(|shift| shift.norm());
    let extra = if is_changed { model.pieces.len() - eligible.len() } else { 0 };
    Compiled {
        text: found.program.text.clone(),
        is_changed: is_changed && found.program.text != text,
        figures: [before, after].map(CompiledFigures::of),
        lines,
        eligible: eligible.len(),
        left: model.left.clone(),
        counts: [
            changes.shifts.iter().filter(|shift| shift.norm() > 0.0).count(),
            extra,
            changes.feeds.iter().filter(|feed| **feed != 1.0).count(),
        ],
        largest_shift: shifts.chain(changes.radii.iter().map(|radius| radius.abs())).fold(0.0, f64::max),
    }
}
