//! Thread that owns the simulation, its commands, frames and reports. It paces the position cycles; the only module that reads the wall clock for them.
//!
//! In real time ([`real`]) position cycle k is computed and released when the wall clock reaches it. A late instant
//! is computed at once and counted; none is skipped. With a ROS clock ([`paced`]), published by this node in `fast` or
//! by another node, the simulation steps on the same time grid; the clock only determines the time of each step.

mod arc_pool;
mod clock_follower;
mod commands;
mod health;
mod paced;
mod program_monitor;
mod real;
mod stepper;
mod stream;
#[cfg(test)]
mod tests;
mod throttle;
mod wall;

pub use arc_pool::ArcPool;
pub use clock_follower::{ClockFollower, ClockState};
pub use commands::{
    Accepted, COMMAND_QUEUE, Clock, Command, MotionIds, PlannedSetpoints, SampleFrame, SimulationReport,
};
pub use health::{AxisHealth, ClockSource, Health};
pub use program_monitor::ProgramRunFigures;
pub use real::CooperativeTasks;
pub use throttle::Throttle;
pub use wall::origin;

use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot, watch};

use clock_follower::first_instant;
use virtual_axes_core::simulation::Simulation;

/// Channel ends of the axes' thread.
pub struct AxesChannels {
    /// Receiver of commands.
    pub commands: mpsc::Receiver<Command>,
    /// Sender of frames, bounded.
    pub frames: mpsc::Sender<Arc<SampleFrame>>,
    /// Sender of reports: at most two for each admitted trajectory, and a bounded number for streams.
    pub reports: mpsc::UnboundedSender<SimulationReport>,
    /// Sender of counters and state.
    pub health: watch::Sender<Health>,
}

/// Pacing of the thread.
pub struct Pace {
    /// Clock at the start.
    pub clock: Clock,
    /// Tasks of the inputs and outputs of every position cycle.
    pub tasks: CooperativeTasks,
    /// Runtime that drives timers and channels.
    pub runtime: Handle,
}

/// Runs the simulation until [`Command::Shutdown`] or until a channel is closed.
pub fn run(simulation: Simulation, pace: Pace, channels: AxesChannels) {
    let AxesChannels { mut commands, frames, reports, health } = channels;
    let mut axes = stepper::Axes::new(simulation, reports, health);
    let Pace { clock, mut tasks, runtime } = pace;
    if matches!(clock, Clock::Wall) {
        // The start of the node has taken time since the origin of the simulation was chosen.
        axes.jump_to(first_instant(wall::now() + 1, axes.simulation().period()));
    }
    let mut next = Some(clock);
    let mut has_stepped = false;
    while let Some(clock) = next {
        next = match clock {
            Clock::Wall => real::run(&mut axes, &mut commands, &frames, &mut tasks),
            Clock::Ros(followed) => {
                let served = ServedTasks::start(tasks, &runtime);
                let run = paced::run(&mut axes, &mut commands, &frames, followed, has_stepped);
                let next = runtime.block_on(run);
                if next.is_none() {
                    // The tasks end with the frames.
                    drop(frames);
                    served.join(&runtime);
                    return;
                }
                match served.stop(&runtime) {
                    Some(stopped) => tasks = stopped,
                    None => return,
                }
                next
            }
        };
        has_stepped = true;
    }
}

/// Tasks that another thread runs, because the publication may wait for subscribers.
struct ServedTasks {
    stop: oneshot::Sender<()>,
    thread: tokio::task::JoinHandle<CooperativeTasks>,
}

impl ServedTasks {
    /// Longest time in which the thread ends.
    const TIMEOUT: Duration = Duration::from_secs(1);

    /// Runs `tasks` until a stop, or until one of them ends.
    fn start(mut tasks: CooperativeTasks, runtime: &Handle) -> Self {
        let (stop, stopped) = oneshot::channel::<()>();
        let handle = runtime.clone();
        let thread = runtime.spawn_blocking(move || {
            handle.block_on(async {
                tokio::select! {
                    () = &mut tasks.outputs => {}
                    () = &mut tasks.inputs => {}
                    Ok(()) = stopped => {}
                }
            });
            tasks
        });
        ServedTasks { stop, thread }
    }

    /// Stops the tasks and returns them; `None` if they do not stop in time, or have ended.
    fn stop(self, runtime: &Handle) -> Option<CooperativeTasks> {
        self.stop.send(()).ok()?;
        runtime.block_on(async { tokio::time::timeout(Self::TIMEOUT, self.thread).await.ok()?.ok() })
    }

    /// Waits until the tasks have ended.
    fn join(self, runtime: &Handle) {
        runtime.block_on(async { _ = tokio::time::timeout(Self::TIMEOUT, self.thread).await });
    }
}
