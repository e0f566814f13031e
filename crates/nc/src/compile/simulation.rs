//! Simulation of a program on the nominal plant and on deviating ones.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::thread;

use nalgebra::Vector3;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::trial::{self, GridRows, GridSource, Measures, SetpointSource, Trial, TrialError};
use virtual_axes_core::units::seconds;

use super::error::CompileError;
use crate::offline::{LineErrors, PartProgramOptions, PartProgramSource, ProgramTrack, ProgrammedErrors};
use crate::plan::ProgrammedPath;

/// Machine, plants and options of all simulations of a program.
pub(super) struct Simulator<'a> {
    /// Name of the program in messages, and the folder of its subprograms.
    pub name: &'a str,
    pub folder: Option<PathBuf>,
    /// Nominal machine first.
    pub plants: &'a [MachineConfig],
    pub options: &'a PartProgramOptions,
    pub check: &'a (dyn Fn() -> io::Result<()> + Sync),
}

/// Setpoints of a program.
pub(super) struct PlannedProgram {
    rows: Vec<f64>,
    rapid: Vec<bool>,
    track: ProgramTrack,
}

/// Contour errors of a program on one plant.
pub(super) struct PlantRun {
    /// Errors of all motions at feed.
    pub cuts: ProgrammedErrors,
    /// Largest error by line of the program, m.
    pub lines: BTreeMap<usize, f64>,
    /// Tool tips with their lines, in order of time.
    pub tips: Vec<(usize, Vector3<f64>)>,
}

/// Contour errors of a program on several plants.
pub(super) struct Runs {
    /// Cycle time, s.
    pub time: f64,
    pub plants: Vec<PlantRun>,
}

impl Runs {
    /// Returns the largest error on any plant, m.
    pub fn max(&self) -> f64 {
        self.plants.iter().map(|run| run.cuts.max).fold(0.0, f64::max)
    }

    /// Returns the largest RMS error on any plant, m.
    pub fn rms(&self) -> f64 {
        self.plants.iter().map(|run| run.cuts.rms).fold(0.0, f64::max)
    }

    /// Returns the largest error by line on any plant, m.
    pub fn lines(&self) -> BTreeMap<usize, f64> {
        let mut lines = BTreeMap::new();
        for (line, error) in self.plants.iter().flat_map(|run| &run.lines) {
            let largest: &mut f64 = lines.entry(*line).or_default();
            *largest = largest.max(*error);
        }
        lines
    }
}

impl Simulator<'_> {
    /// Returns the position cycle, s.
    pub fn period(&self) -> f64 {
        self.plants.first().map_or(f64::INFINITY, |machine| seconds(machine.periods().position))
    }

    /// Plans a program, which is the same for all plants.
    ///
    /// # Errors
    ///
    /// An invalid program, or one beyond the travel limits.
    pub fn plan(&self, text: &str) -> Result<PlannedProgram, CompileError> {
        let Some(machine) = self.plants.first() else { return Err(CompileError::NoPlant) };
        let track = RefCell::new(ProgramTrack::default());
        let (mut rows, mut rapid) = (Vec::new(), Vec::new());
        let place = (self.name, self.folder.clone());
        let mut source = PartProgramSource::read(text, place, machine, self.options, &track)
            .map_err(CompileError::Program)?;
        let mut row = vec![0.0; machine.axes().len()];
        while source.next(&mut row).map_err(|error| CompileError::Program(error.to_string()))? {
            (self.check)().map_err(|error| CompileError::Trial(TrialError::Callback(error)))?;
            rows.extend_from_slice(&row);
            rapid.push(source.is_rapid());
        }
        drop(source);
        Ok(PlannedProgram { rows, rapid, track: track.into_inner() })
    }

    /// Simulates a planned program on the first `count` plants; contour errors are those against `reference`.
    ///
    /// # Errors
    ///
    /// A run that fails.
    pub fn run(
        &self,
        planned: &PlannedProgram,
        reference: &ProgrammedPath,
        count: usize,
    ) -> Result<Runs, CompileError> {
        let plants = &self.plants[..count.min(self.plants.len())];
        let threads = thread::available_parallelism().map_or(1, usize::from);
        let share = plants.len().div_ceil(threads).max(1);
        let part = |plants: &[MachineConfig]| -> Result<Vec<PlantRun>, CompileError> {
            plants.iter().map(|plant| self.run_on(plant, planned, reference)).collect()
        };
        let part = &part;
        let runs = thread::scope(|scope| {
            let parts: Vec<_> =
                plants.chunks(share).map(|plants| scope.spawn(move || part(plants))).collect();
            let joined = parts.into_iter().map(|part| part.join().unwrap_or(Err(CompileError::NoPlant)));
            joined.collect::<Result<Vec<_>, _>>()
        })?;
        Ok(Runs { time: planned.track.cycle_time, plants: runs.into_iter().flatten().collect() })
    }

    fn run_on(
        &self,
        machine: &MachineConfig,
        planned: &PlannedProgram,
        reference: &ProgrammedPath,
    ) -> Result<PlantRun, CompileError> {
        let trial = Trial {
            machine,
            program: None,
            allow_nonzero_end_velocity: false,
            record: false,
            measures: Measures::AXES,
        };
        let joints: Vec<usize> = (0..machine.axes().len()).collect();
        let rows = GridRows::new(&joints, &planned.rows).with_rapid(&planned.rapid);
        let mut errors = LineErrors::new(machine).with_reference(reference.clone()).with_line_maxima();
        let (mut track, mut tips) = (planned.track.clone(), Vec::new());
        let setpoints = SetpointSource::Grid(Box::new(rows));
        trial::run(&trial, setpoints, |tick| {
            (self.check)()?;
            let cycle = errors.add(&tick, &mut track);
            tips.extend(cycle.map(|cycle| (cycle.line, Vector3::from(cycle.tip))));
            Ok(())
        })
        .map_err(CompileError::Trial)?;
        let (cuts, lines) = errors.into_cuts(|cycle| tips.push((cycle.line, Vector3::from(cycle.tip))));
        Ok(PlantRun { cuts: cuts.unwrap_or_default(), lines, tips })
    }
}

impl PlannedProgram {
    /// Returns the programmed path.
    pub fn path(&self) -> &ProgrammedPath {
        &self.track.programmed
    }
}
