//! In step with the wall clock.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::task::{Context, Waker};
use std::time::Duration;

use futures::future::BoxFuture;
use tokio::sync::mpsc;

use super::axes::Axes;
use super::wall::PaceClock;
use super::{ClockSource, Command, Frame};

/// Runs until told to shut down; a frame that nobody takes in time is dropped and counted.
///
/// `published` takes the frames, and has its turn after each instant: a thread of its own would have to be
/// woken each time, which takes longer than what it does.
pub(super) fn run(
    mut axes: Axes,
    mut commands: mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<Frame>>,
    mut published: BoxFuture<'static, ()>,
) {
    let clock = PaceClock::new(axes.simulation());
    axes.tell_clock(|clock| clock.source = ClockSource::Wall);
    loop {
        let lateness = clock.wait_for(axes.simulation().next_instant());
        if period(&mut axes, &mut commands, frames, lateness, lateness > clock.period).is_break() {
            return;
        }
        // It is asked again in the next period, whether or not it has been woken.
        let _ = published.as_mut().poll(&mut Context::from_waker(Waker::noop()));
    }
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
            Ok(command) => axes.obey(command),
            Err(mpsc::error::TryRecvError::Empty) => break,
        }
    }
    let taken = frames.try_send(axes.step()).is_ok();
    axes.released(lateness, missed, !taken);
    ControlFlow::Continue(())
}
