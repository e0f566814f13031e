//! In step with the wall clock.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::task::{Context, Waker};
use std::time::Duration;

use futures::future::BoxFuture;
use tokio::sync::mpsc;
use tracing::warn;

use super::axes::Axes;
use super::wall::{PaceClock, since_epoch};
use super::{ClockSource, Command, CooperativeTasks, Frame};

/// Instants that come later than this are computed and not published: a burst of them would push out of
/// subscribers' queues what they have not read, and tell nothing of now.
pub(super) const LONGEST_BURST: Duration = Duration::from_secs(1);

/// Runs until told to shut down; a frame that nobody takes in time is dropped and counted.
pub(super) fn run(
    mut axes: Axes,
    mut commands: mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<Frame>>,
    mut tasks: CooperativeTasks,
) {
    let clock = PaceClock::new(axes.simulation(), since_epoch);
    axes.tell_clock(|clock| clock.source = ClockSource::Wall);
    loop {
        let mut lateness = clock.wait_for(axes.simulation().next_instant());
        if lateness > LONGEST_BURST {
            stood_still(&mut axes, lateness, clock.newest_due(), |k| clock.lateness_of(k));
            lateness = clock.wait_for(axes.simulation().next_instant());
        }
        poll_once(&mut tasks.input);
        if period(&mut axes, &mut commands, frames, lateness, lateness > clock.period).is_break() {
            return;
        }
        poll_once(&mut tasks.output);
    }
}

/// It is asked again in the next period, whether or not it has been woken.
fn poll_once(future: &mut BoxFuture<'static, ()>) {
    let _ = future.as_mut().poll(&mut Context::from_waker(Waker::noop()));
}

/// Computes the instants before `newest`, of which the first is due since `lateness`, and keeps them to itself.
///
/// Commands wait for the instant of now. What the axes do in between is what they would have done in time.
pub(super) fn stood_still(
    axes: &mut Axes,
    lateness: Duration,
    newest: i64,
    lateness_of: impl Fn(i64) -> Duration,
) {
    let first = axes.simulation().next_instant();
    for instant in first..newest {
        drop(axes.step());
        axes.kept(lateness_of(instant));
    }
    warn!(
        "the node stood still for {:.3} s: {} position periods were missed; they are computed, and not published",
        lateness.as_secs_f64(),
        (newest - first).max(0)
    );
}

/// One position period that has become due `lateness` ago; breaks when told to shut down.
///
/// It allocates and frees nothing but when a trajectory or another seldom command comes or a motion ends.
pub(super) fn period(
    axes: &mut Axes,
    commands: &mut mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<Frame>>,
    lateness: Duration,
    missed: bool,
) -> ControlFlow<()> {
    loop {
        match commands.try_recv() {
            Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => {
                return ControlFlow::Break(());
            }
            Ok(command) => axes.apply(command),
            Err(mpsc::error::TryRecvError::Empty) => break,
        }
    }
    let taken = frames.try_send(axes.step()).is_ok();
    axes.released(lateness, missed, !taken);
    ControlFlow::Continue(())
}
