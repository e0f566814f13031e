//! In step with a ROS clock: this node's own in `fast`, or that of somebody else.
//!
//! Commands are taken whether or not time goes on, so that services answer and nothing is lost while
//! a clock stands or a subscriber is slow; they show at the next position instant. Before there is a
//! time at all, trajectories are kept until it comes.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, watch};
use tracing::warn;

use super::super::clock::{ClockState, Jump, Role, first_instant};
use super::axes::Axes;
use super::wall::Pulse;
use super::{COMMAND_QUEUE, ClockSource, Command, Frame};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Whether the next position instant may be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Leave {
    /// At once.
    Now,
    /// When the idle clock ticks.
    AtTick,
    /// When the clock that is followed comes to it.
    Later,
}

fn leave(state: &ClockState, next: Nanoseconds, busy: bool) -> Leave {
    let is_due = state.newest.is_some_and(|newest| newest >= next);
    match state.role {
        _ if is_due => Leave::Now,
        Role::Leading if busy => Leave::Now,
        Role::Leading => Leave::AtTick,
        Role::Listening | Role::Following(_) => Leave::Later,
    }
}

/// Runs until told to shut down; a full queue of frames is waited for.
pub(super) async fn run(
    axes: Axes,
    mut commands: mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<Frame>>,
    mut clock: watch::Receiver<ClockState>,
) {
    let period = axes.simulation().period();
    let tick = Duration::from_nanos(period.unsigned_abs());
    let mut axes = Paced { axes, held: VecDeque::new(), known: false, jumps: 0, stepped: false };
    let mut pulse = Pulse::default();
    let mut ticks_at = None;
    loop {
        loop {
            match commands.try_recv() {
                Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => return,
                Ok(command) => axes.take(command),
                Err(mpsc::error::TryRecvError::Empty) => break,
            }
        }
        let state = *clock.borrow_and_update();
        axes.follow(&state);
        let leave = leave(&state, axes.axes.next_time(), axes.axes.simulation().is_busy());
        if leave != Leave::AtTick {
            pulse.stop();
            ticks_at = None;
        } else if ticks_at.is_none() {
            ticks_at = Some(pulse.next(tick));
        }
        let mut permit = None;
        if leave == Leave::Now {
            permit = frames.try_reserve().ok();
        }
        if permit.is_none() {
            axes.axes.tell_clock(|clock| clock.held_back = leave == Leave::Now);
            tokio::select! {
                biased;
                command = commands.recv() => match command {
                    Some(Command::Shutdown) | None => return,
                    Some(command) => axes.take(command),
                },
                changed = clock.changed() => if changed.is_err() { return },
                () = until(ticks_at), if ticks_at.is_some() => {
                    ticks_at = None;
                    // Idle, it waits for nobody: a frame that is not taken by the next tick is waited for then.
                    permit = frames.try_reserve().ok();
                }
                free = frames.reserve(), if leave == Leave::Now => match free {
                    Ok(free) => permit = Some(free),
                    Err(_) => return,
                },
            }
        }
        if let Some(permit) = permit {
            permit.send(axes.axes.step());
            axes.stepped = true;
            axes.axes.released(Duration::ZERO, false, false);
        }
    }
}

async fn until(time: Option<tokio::time::Instant>) {
    match time {
        Some(time) => tokio::time::sleep_until(time).await,
        None => std::future::pending().await,
    }
}

/// The axes, and what waits for the first time.
struct Paced {
    axes: Axes,
    /// Trajectories and stops that came before there was a time, oldest first.
    held: VecDeque<Command>,
    /// Whether there is a time.
    known: bool,
    /// Jumps of the clock that have been followed.
    jumps: u64,
    /// Whether an instant has been released.
    stepped: bool,
}

impl Paced {
    fn take(&mut self, command: Command) {
        if self.known {
            self.axes.apply(command);
            self.axes.report_ends();
            return;
        }
        match command {
            Command::Offer { id, .. } if self.held.len() >= COMMAND_QUEUE => self.axes.refuse_full(id),
            Command::Offer { .. } => self.held.push_back(command),
            // They act at once or not at all.
            Command::Load { .. } | Command::Stream(_) => {}
            Command::Cancel(id, _) => {
                // What it ends has to have been taken; the others wait on.
                let is_it = |held: &Command| matches!(held, Command::Offer { id: other, .. } if *other == id);
                if let Some(offer) =
                    self.held.iter().position(is_it).and_then(|place| self.held.remove(place))
                {
                    self.axes.apply(offer);
                }
                self.axes.apply(command);
                self.axes.report_ends();
            }
            // What came before it is stopped at its start; of several in a row one is enough.
            Command::Stop(..) if matches!(self.held.back(), Some(Command::Stop(..))) => {}
            Command::Stop(..) => self.held.push_back(command),
            // All that waits ends with it.
            Command::Reset(_) => {
                self.release();
                self.axes.apply(command);
                self.axes.report_ends();
            }
            Command::Adopt(_) | Command::Shutdown => self.axes.apply(command),
        }
    }

    fn release(&mut self) {
        for command in self.held.drain(..) {
            self.axes.apply(command);
        }
    }

    /// Keeps to the clock's own idea of time.
    fn follow(&mut self, state: &ClockState) {
        if state.jump.count != self.jumps {
            self.jumps = state.jump.count;
            self.jump(&state.jump);
        }
        if state.is_known() && !self.known {
            self.known = true;
            self.release();
            self.axes.report_ends();
        }
        let source = match state.role {
            Role::Leading => ClockSource::Own,
            Role::Listening | Role::Following(_) if state.newest.is_none() => ClockSource::None,
            Role::Listening | Role::Following(_) => ClockSource::Others,
        };
        let behind = state.newest.map_or(0, |newest| (newest - self.axes.next_time()).max(0));
        self.axes.tell_clock(|clock| {
            clock.source = source;
            clock.behind = behind;
        });
    }

    fn jump(&mut self, jump: &Jump) {
        let period = self.axes.simulation().period();
        let first = first_instant(jump.to, period);
        if self.stepped {
            let from = jump.from.unwrap_or(self.axes.next_time() - period);
            warn!(
                "the clock jumped from {:.3} s to {:.3} s; motions end, the axes come to rest",
                seconds(from),
                seconds(jump.to)
            );
            self.axes.tell_clock(|clock| clock.jumps += 1);
        }
        self.axes.jump_to(first);
    }
}
