//! Compilation of a part program for its machine: points and feeds changed so that the simulated tool stays near the
//! programmed path.
//!
//! The program is interpreted, planned and simulated on the nominal machine and on deviating plants. Points between cuts are
//! shifted against the mean error vector of the plants, radii of arcs against their mean radial error, and feeds are lowered
//! at the largest errors, as iterative learning does with setpoints. Each step is simulated again against the path of the
//! program as it was, and only the best one remains.

mod error;
mod model;
mod outcome;
mod search;
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
use self::model::{ExtraPoints, ProgramModel};
pub use self::outcome::{CompileAim, CompileOptions, Compiled, CompiledFigures, CompiledLine};
use self::search::{Candidate, LARGE, Search, score};
use self::simulation::{Runs, Simulator};
use crate::interpret::InterpreterOptions;

/// Sets of distances of extra points from corners that are tried, m.
const DISTANCES: [&[f64]; 4] = [&[], &[1.2e-3], &[0.4e-3, 1.2e-3, 4e-3], &[0.1e-3, 0.3e-3, 1e-3, 3e-3]];
/// Largest shift, as a multiple of the largest error of the program.
const LARGEST_SHIFT: f64 = 3.0;
/// Change of the figures by which a program is better.
const IMPROVEMENT: f64 = 0.02;
/// Gain of time, relative to the cycle time, below which a program is no faster.
const TIME_ROUNDING: f64 = 2e-3;
/// Most corrections of the lines that are left out.
const VERIFICATIONS: usize = 20;

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
    let mut middles = BTreeMap::new();
    for distances in DISTANCES {
        let extra = ExtraPoints { distances, middles: &middles };
        let Some(model) = verified_model((text, name), machine, &interpreter, extra, &mut left_out)? else {
            continue;
        };
        if distances.is_empty() {
            middles = model.middles(&before, LARGE * before.max());
        }
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
    extra: ExtraPoints<'_>,
    left_out: &mut BTreeSet<usize>,
) -> Result<Option<ProgramModel>, CompileError> {
    let kinematics = Kinematics::new(machine);
    for _ in 0..VERIFICATIONS {
        let model = ProgramModel::read((text, name), (interpreter, &kinematics), extra, left_out)?;
        let mut trial = model.unchanged();
        for (index, (shift, node)) in trial.shifts.iter_mut().zip(&model.nodes).enumerate() {
            if !node.is_fixed {
                let step = 1e-5 * (1.0 + (index % 3) as f64);
                let trial = Vector3::new(step, -0.7 * step, if index % 2 == 0 { 0.0 } else { 0.4 * step });
                *shift = trial.component_mul(&node.free);
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
