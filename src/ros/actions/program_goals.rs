//! Goals of `~/run_program`: validation, start and results.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::{mpsc, oneshot, watch};
use tracing::warn;

use super::goals::GoalState;
use super::planning::{Planning, ProgramState};
use super::program_text::ProgramText;
use super::server::GoalHandler;
use crate::ros::axes::{Command, MotionIds, ProgramRunFigures};
use crate::ros::publication::RunningProgram;
use crate::ros::results::{Origin, TrajectoryResults, goal_name};
use crate::ros_interface::{NodeAction, RUN_PROGRAM};
use crate::validation::GoalId;
use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::simulation::{MotionEnd, MotionOutcome};
use virtual_axes_core::text::BuiltinFiles;
use virtual_axes_core::trajectory::{MotionId, Rejection, check_feed_override};
use virtual_axes_core::units::{Nanoseconds, seconds};
use virtual_axes_io::messages::{ProgramErrorCode, RunProgramFeedback, RunProgramGoal, RunProgramResult};

/// Largest number of goals that have not ended.
const MAX_ACTIVE_PROGRAMS: usize = 8;

/// Execution of the goals of `~/run_program`.
pub struct ProgramGoals {
    /// Built-in part programs.
    pub builtin: &'static BuiltinFiles,
    /// Folder of the files that can be run.
    pub program_folder: Option<PathBuf>,
    /// Machine.
    pub machine: Arc<MachineConfig>,
    /// Names of the joints, with prefix.
    pub joints: Vec<String>,
    /// Sender of commands to the simulation.
    pub commands: mpsc::Sender<Command>,
    /// Results of the trajectories.
    pub results: Arc<TrajectoryResults>,
    /// Counter of motion ids.
    pub ids: MotionIds,
    /// Sender of the goals that have feedback.
    pub running_out: watch::Sender<Arc<[RunningProgram]>>,
    /// Programs that have not ended.
    pub programs: HashMap<GoalId, ActiveProgram>,
    /// Counter of the planners, which end after their programs.
    pub planners: Arc<()>,
}

/// Program that has not ended.
pub struct ActiveProgram {
    motion: MotionId,
    state: Arc<ProgramState>,
}

fn rejected(code: ProgramErrorCode, text: String) -> RunProgramResult {
    RunProgramResult { error_code: code as i32, error_string: text, ..RunProgramResult::default() }
}

/// Length of the longest path of a file or name of a program, bytes: that of Linux.
const MAX_PATH: usize = 4096;

/// Opens the program of a goal.
async fn open(
    goal: RunProgramGoal,
    builtin: &BuiltinFiles,
    folder: Option<&Path>,
    active: usize,
) -> Result<ProgramText, (ProgramErrorCode, String)> {
    let invalid = |text: String| Err((ProgramErrorCode::InvalidGoal, text));
    if active >= MAX_ACTIVE_PROGRAMS {
        return invalid(format!(
            "{active} programs are active or being ended; at most {MAX_ACTIVE_PROGRAMS} are allowed"
        ));
    }
    if let Err(error) = check_feed_override(goal.feed_override) {
        return invalid(error.to_string());
    }
    match (goal.path.is_empty(), goal.program.is_empty()) {
        (true, true) => invalid("the goal has no program: set path or program".to_owned()),
        (false, false) => invalid("the goal has path and program: set one of them".to_owned()),
        (false, true) if goal.path.len() > MAX_PATH => {
            invalid(format!("the path has {} bytes; at most {MAX_PATH} are allowed", goal.path.len()))
        }
        (true, false) => Ok(ProgramText::from_text(goal.program)),
        (false, true) => {
            let opened = ProgramText::open(goal.path, builtin, folder).await;
            opened.map_err(|text| (ProgramErrorCode::FileError, text))
        }
    }
}

impl GoalHandler for ProgramGoals {
    type Goal = RunProgramGoal;
    type Result = RunProgramResult;
    type Feedback = RunProgramFeedback;

    const ACTION: NodeAction = RUN_PROGRAM;

    async fn submit(
        &mut self,
        id: GoalId,
        goal: RunProgramGoal,
        _: Nanoseconds,
        active: &[GoalId],
    ) -> Result<MotionId, RunProgramResult> {
        let (start_line, feed_override) = (goal.start_line as usize, goal.feed_override);
        let active = active.len().max(Arc::strong_count(&self.planners) - 1);
        let source = match open(goal, self.builtin, self.program_folder.as_deref(), active).await {
            Ok(source) => source,
            Err((code, text)) => {
                warn!("{} rejected: {text}", goal_name(&id));
                return Err(rejected(code, text));
            }
        };
        let motion = self.ids.next();
        let state = Arc::new(ProgramState::new());
        self.programs.insert(id, ActiveProgram { motion, state: Arc::clone(&state) });
        let running =
            self.programs.iter().map(|(&id, program)| RunningProgram { id, motion: program.motion });
        // The receiver is dropped only at shutdown.
        let _ = self.running_out.send(running.collect());
        self.results.register(motion, Origin::Program { goal_id: id }, None).await;
        let (rest_out, rest) = oneshot::channel();
        if feed_override > 0.0 {
            let _ = self.commands.send(Command::SetFeedOverride(feed_override)).await;
        }
        let axes = self.machine.axes().iter().enumerate();
        let linear =
            axes.filter(|(_, axis)| axis.kind() == AxisKind::Linear).map(|(index, _)| index).collect();
        let _ = self.commands.send(Command::BeginMotion { id: motion, linear, rest: rest_out }).await;
        let (machine, commands) = (Arc::clone(&self.machine), self.commands.clone());
        let planner = Arc::clone(&self.planners);
        let planning = Planning { motion, source, start_line, machine, state, commands, rest, planner };
        tokio::spawn(planning.run());
        Ok(motion)
    }

    fn rejected(&mut self, id: &GoalId, rejection: &Rejection) -> RunProgramResult {
        self.programs.remove(id);
        rejected(ProgramErrorCode::InvalidGoal, rejection.to_string())
    }

    fn ended(
        &mut self,
        id: &GoalId,
        end: MotionEnd,
        figures: ProgramRunFigures,
        text: String,
    ) -> (GoalState, RunProgramResult) {
        let plan = self.programs.remove(id).map(|program| program.state.finish()).unwrap_or_default();
        let (state, code, text) = match (end.outcome, plan.error) {
            (MotionOutcome::Canceled, Some(error)) => {
                (GoalState::Aborted, ProgramErrorCode::ProgramError, error)
            }
            (MotionOutcome::Completed, _) => (GoalState::Succeeded, ProgramErrorCode::Successful, text),
            (MotionOutcome::Canceled, _) => (GoalState::Canceled, ProgramErrorCode::Successful, text),
            (MotionOutcome::Preempted { .. }, _) => (GoalState::Aborted, ProgramErrorCode::Preempted, text),
            _ => (GoalState::Aborted, ProgramErrorCode::Stopped, text),
        };
        if state == GoalState::Aborted {
            warn!("{}: {text}", goal_name(id));
        }
        let name = |index: &usize| self.joints.get(*index).cloned().unwrap_or_default();
        let axes = &end.report.axes;
        let result = RunProgramResult {
            error_code: code as i32,
            error_string: text,
            cycle_time: seconds(figures.cycle_time),
            programmed_time: plan.programmed_time,
            max_contour_error: end.report.max_contour_error.unwrap_or(f64::NAN),
            rms_contour_error: end.report.rms_contour_error.unwrap_or(f64::NAN),
            name: end.axis_indices.iter().map(name).collect(),
            max_synchronized_tracking_error: axes
                .iter()
                .map(|a| a.max_delay_compensated_following_error)
                .collect(),
            rms_synchronized_tracking_error: axes
                .iter()
                .map(|a| a.rms_delay_compensated_following_error)
                .collect(),
            worst_line: figures.worst_lines.iter().map(|(line, _)| *line as u32).collect(),
            worst_synchronized_tracking_error: figures.worst_lines.iter().map(|(_, error)| *error).collect(),
        };
        (state, result)
    }

    fn shut_down(&self, text: &str) -> RunProgramResult {
        rejected(ProgramErrorCode::Stopped, text.to_owned())
    }
}
