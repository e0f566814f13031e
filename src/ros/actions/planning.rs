//! Thread that interprets and plans a part program while it runs.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, oneshot};
use tokio::task::JoinError;
use tracing::warn;

use super::program_text::ProgramText;
use crate::ros::axes::Command;
use crate::ros::log::STDERR_ONLY;
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::trajectory::{JointLimits, KinematicState, MotionChunk, MotionId, PathPlace};
use virtual_axes_core::units::seconds;
use virtual_axes_nc::StartLine;
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions, ProgramError};
use virtual_axes_nc::plan::{FeedPlanError, PartProgramPlanner, PlanOptions, PlannedChunk};

/// Number of chunks in the timeline.
const CHUNKS: usize = 8;
/// Name of the parameters of the set-up in messages.
const SETUP: &str = "part_program";
/// Shortest chunk, s.
const MIN_CHUNK: f64 = 0.1;

/// State of a part program, shared by its goal and its planning.
#[derive(Debug)]
pub(super) struct ProgramState {
    /// Permits for chunks in the timeline; closed at the end of the motion.
    chunks: Arc<Semaphore>,
    outcome: Mutex<PlanOutcome>,
}

/// Outcome of the planning so far.
#[derive(Debug, Clone, Default)]
pub(super) struct PlanOutcome {
    /// Error of the program.
    pub error: Option<String>,
    /// Duration of the planned motions at their programmed feed, s.
    pub programmed_time: f64,
}

impl ProgramState {
    pub(super) fn new() -> Self {
        Self { chunks: Arc::new(Semaphore::new(CHUNKS)), outcome: Mutex::default() }
    }

    /// Ends the planning and returns its outcome.
    pub(super) fn finish(&self) -> PlanOutcome {
        self.chunks.close();
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn update(&self, change: impl FnOnce(&mut PlanOutcome)) {
        change(&mut self.outcome.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Chunk with its permit, which is returned when the timeline has passed the chunk.
#[derive(Debug)]
struct PermittedChunk {
    chunk: PlannedChunk,
    _permit: OwnedSemaphorePermit,
}

impl MotionChunk for PermittedChunk {
    fn cycles(&self) -> i64 {
        self.chunk.cycles()
    }

    fn positions(&self, time: f64, joints: &mut [f64]) {
        self.chunk.positions(time, joints);
    }

    fn state(&self, joint: usize, time: f64) -> KinematicState {
        self.chunk.state(joint, time)
    }

    fn place(&self, time: f64) -> PathPlace {
        self.chunk.place(time)
    }
}

/// Part program to be planned.
pub(super) struct Planning {
    pub(super) motion: MotionId,
    pub(super) source: ProgramText,
    pub(super) start_line: usize,
    pub(super) machine: Arc<MachineConfig>,
    pub(super) state: Arc<ProgramState>,
    pub(super) commands: mpsc::Sender<Command>,
    /// Receiver of the positions at which the motion begins, m or rad.
    pub(super) rest: oneshot::Receiver<Vec<f64>>,
    /// Counter of the planners.
    pub(super) planner: Arc<()>,
}

impl Planning {
    /// Plans the program in a thread of its own until its end, its first error or the end of its motion.
    pub(super) async fn run(self) {
        let (commands, motion, state) = (self.commands.clone(), self.motion, Arc::clone(&self.state));
        let runtime = Handle::current();
        let planned = tokio::task::spawn_blocking(move || self.plan(&runtime)).await;
        let command = match error_of(planned) {
            None => Command::FinishMotion(motion),
            Some(error) => {
                state.update(|outcome| outcome.error = Some(error));
                // The end of the motion reports the error.
                Command::Cancel(motion, oneshot::channel().0)
            }
        };
        // The channel is closed only at shutdown.
        let _ = commands.send(command).await;
    }

    /// Plans the program; blocks while enough is planned ahead.
    fn plan(self, runtime: &Handle) -> Result<(), String> {
        let Planning { motion, source, start_line, machine, state, commands, rest, planner: _planner } = self;
        let ProgramText { name, reader, folders } = source;
        // The sender is dropped if the motion is canceled before its start, or at shutdown.
        let Ok(rest) = rest.blocking_recv() else { return Ok(()) };
        let setup = InterpreterOptions::for_machine(&machine).with_setup(machine.part_program());
        let options = setup.map_err(|error| without_contents(SETUP, &error))?.starting_at(&rest);
        let is_file = folders.is_some();
        let (subprogram_folder, subprogram_root) = folders.map(|folders| (folders.own, folders.root)).unzip();
        let options = InterpreterOptions { subprogram_folder, subprogram_root, ..options };
        let steps = Interpreter::new(reader, &name, options.clone());
        let steps = StartLine::new(steps, start_line, &options);
        let named = |error: FeedPlanError| match &error {
            FeedPlanError::Step(step) => match step.downcast_ref::<ProgramError>() {
                Some(error) if is_file => {
                    without_contents(&format!("{}:{}", error.name, error.line), &error.to_string())
                }
                // The interpreter's error names the file.
                Some(error) => error.to_string(),
                None => format!("{name}: {step}"),
            },
            _ => format!("{name}: {error}"),
        };
        let mut planner = PartProgramPlanner::new(steps, &machine, PlanOptions::default()).map_err(named)?;
        let cycles = chunk_cycles(&machine);
        loop {
            // Closed at the end of the motion.
            let Ok(permit) = runtime.block_on(Arc::clone(&state.chunks).acquire_owned()) else {
                return Ok(());
            };
            let chunk = planner.next_chunk(cycles).map_err(named)?;
            state.update(|outcome| outcome.programmed_time = planner.programmed_time());
            let Some(chunk) = chunk else { return Ok(()) };
            let chunk = Arc::new(PermittedChunk { chunk, _permit: permit });
            if commands.blocking_send(Command::ExtendMotion { id: motion, chunk }).is_err() {
                return Ok(());
            }
        }
    }
}

/// Writes an error that may quote a file to standard error and returns the text for other nodes, without its contents.
fn without_contents(place: &str, error: &str) -> String {
    warn!(target: STDERR_ONLY, "{error}");
    format!("{place}: invalid; the reason is in the node's log on stderr, since it may quote the file")
}

/// Returns the error of a program, also if its thread has panicked: then no goal would ever end.
fn error_of(planned: Result<Result<(), String>, JoinError>) -> Option<String> {
    match planned {
        Ok(planned) => planned.err(),
        Err(error) => Some(format!("internal error of the planner: {error}")),
    }
}

/// Returns the length of a chunk, position cycles: the longest time in which an axis stops.
fn chunk_cycles(machine: &MachineConfig) -> u32 {
    let stopping_time = |limits: JointLimits| {
        let limits = limits.limits;
        limits.velocity / limits.acceleration + limits.acceleration / limits.jerk
    };
    let times = machine.axes().iter().map(|axis| stopping_time(JointLimits::from_axis(axis)));
    let longest = times.fold(MIN_CHUNK, f64::max);
    (longest / seconds(machine.periods().position)).ceil().clamp(1.0, 1e6) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn every_end_of_the_thread_has_its_outcome() {
        let failed = tokio::task::spawn_blocking(|| -> Result<(), String> { panic!("planner") });
        assert!(error_of(failed.await).is_some_and(|error| error.contains("planner")));
        let invalid = tokio::task::spawn_blocking(|| Err("part.nc:1: G41".to_owned()));
        assert_eq!(error_of(invalid.await).as_deref(), Some("part.nc:1: G41"));
        assert_eq!(error_of(tokio::task::spawn_blocking(|| Ok(())).await), None);
    }
}
