//! Real-time pacing by the wall clock.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::task::{Context, Waker};
use std::time::Duration;

use futures::future::BoxFuture;
use tokio::sync::mpsc;
use tracing::warn;

use super::commands::{Clock, Command, SampleFrame};
use super::health::ClockSource;
use super::stepper::Axes;
use super::wall::{PaceClock, since_epoch, warn_if_set_back};
use virtual_axes_core::units::Nanoseconds;

/// Tasks that the axes' thread polls once per position cycle. They must neither block nor end.
///
/// A separate thread would be woken each cycle, which takes longer than the tasks themselves.
pub struct CooperativeTasks {
    /// Reception of streamed setpoints and loads, polled before each instant.
    pub inputs: BoxFuture<'static, ()>,
    /// Publication of the frames, polled after each instant.
    pub outputs: BoxFuture<'static, ()>,
}

/// Largest lateness of a published instant. Later instants are computed and not published: a burst of old frames would
/// displace unread frames in the queues of the subscribers.
pub(super) const MAX_PUBLISHED_LATENESS: Duration = Duration::from_secs(1);

/// Runs until [`Command::SetClock`], and returns the clock, or until [`Command::Shutdown`]. A frame is dropped and counted if
/// the queue of frames is full.
pub(super) fn run(
    axes: &mut Axes,
    commands: &mut mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<SampleFrame>>,
    tasks: &mut CooperativeTasks,
) -> Option<Clock> {
    let mut clock = PaceClock::new(axes.simulation(), since_epoch);
    axes.update_clock_health(|clock| clock.source = ClockSource::Wall);
    loop {
        if let Some(to) = clock.stepped_to(since_epoch) {
            follow_step(axes, to);
            clock = PaceClock::new(axes.simulation(), since_epoch);
        }
        let mut lateness = clock.wait_for(axes.simulation().next_instant());
        if lateness > MAX_PUBLISHED_LATENESS {
            catch_up(axes, lateness, clock.newest_due(), |k| clock.lateness_of(k));
            lateness = clock.wait_for(axes.simulation().next_instant());
        }
        poll_once(&mut tasks.inputs);
        let is_missed = lateness > clock.period;
        if let ControlFlow::Break(next) = run_cycle(axes, commands, frames, lateness, is_missed) {
            return next;
        }
        poll_once(&mut tasks.outputs);
    }
}

/// Continues at the wall-clock time `to`, ns, to which the clock has been set.
pub(super) fn follow_step(axes: &mut Axes, to: Nanoseconds) {
    let from = axes.next_time();
    axes.restart_at(from, to);
    warn_if_set_back(from, to);
}

/// Polls a task without a waker; it is polled again in the next cycle in any case.
fn poll_once(future: &mut BoxFuture<'static, ()>) {
    let _ = future.as_mut().poll(&mut Context::from_waker(Waker::noop()));
}

/// Computes the instants before `newest` without publishing them; the first has been due for `lateness`.
///
/// Commands take effect at the instant `newest`. The state of the axes is the same as without the delay.
pub(super) fn catch_up(
    axes: &mut Axes,
    lateness: Duration,
    newest: i64,
    lateness_of: impl Fn(i64) -> Duration,
) {
    let first = axes.simulation().next_instant();
    for instant in first..newest {
        drop(axes.step());
        axes.finish_unpublished_cycle(lateness_of(instant));
    }
    warn!(
        "the node stalled for {:.3} s: {} position cycles were missed; they are computed but not published",
        lateness.as_secs_f64(),
        (newest - first).max(0)
    );
}

/// Runs one position cycle that has been due for `lateness`; breaks on [`Command::SetClock`], with the clock, and on
/// [`Command::Shutdown`].
///
/// Allocates and frees memory only for trajectories and other rare commands, and when a motion ends.
pub(super) fn run_cycle(
    axes: &mut Axes,
    commands: &mut mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<SampleFrame>>,
    lateness: Duration,
    is_missed: bool,
) -> ControlFlow<Option<Clock>> {
    loop {
        match commands.try_recv() {
            Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => {
                return ControlFlow::Break(None);
            }
            Ok(Command::SetClock(clock)) => return ControlFlow::Break(Some(clock)),
            Ok(command) => axes.apply(command),
            Err(mpsc::error::TryRecvError::Empty) => break,
        }
    }
    let is_sent = frames.try_send(axes.step()).is_ok();
    axes.finish_cycle(lateness, is_missed, !is_sent);
    ControlFlow::Continue(())
}
