//! In step with the wall clock.

use tokio::sync::mpsc;

use super::axes::Axes;
use super::wall::PaceClock;
use super::{ClockSource, Command, Frame};

/// Runs until told to shut down; a frame that nobody takes in time is dropped and counted.
pub(super) fn run(mut axes: Axes, mut commands: mpsc::Receiver<Command>, frames: &mpsc::Sender<Frame>) {
    let clock = PaceClock::new(axes.simulation());
    axes.tell_clock(|clock| clock.source = ClockSource::Wall);
    loop {
        let lateness = clock.wait_for(axes.simulation().next_instant());
        loop {
            match commands.try_recv() {
                Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => return,
                Ok(command) => axes.obey(command),
                Err(mpsc::error::TryRecvError::Empty) => break,
            }
        }
        let taken = frames.try_send(axes.step()).is_ok();
        axes.released(lateness, lateness > clock.period, !taken);
    }
}
