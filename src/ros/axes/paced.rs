//! Pacing by `/clock`: published by this node in `fast`, or by another node.
//!
//! Commands are received whether or not time advances, so that services respond and no command is lost while the
//! clock is paused or a subscriber is slow; they take effect at the next position cycle. Trajectories received
//! before the first time are kept until it arrives.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, watch};

use super::clock_follower::{ClockJump, ClockState, first_instant};
use super::commands::{COMMAND_QUEUE, Clock, Command, SampleFrame};
use super::health::ClockSource;
use super::stepper::Axes;
use super::wall::{self, IdleTimer, WallClockWatch, since_epoch};
use virtual_axes_core::units::Nanoseconds;

/// Condition for the computation of the next position cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StepCondition {
    /// No condition: the instant may be computed at once.
    Immediate,
    /// Next tick of the idle timer.
    IdleTick,
    /// Arrival of the followed clock at the instant.
    ClockTime,
}

/// Returns the condition of the cycle at `next`, ns; `followed` is the followed clock, `None` in `fast`.
fn step_condition(followed: Option<&ClockState>, next: Nanoseconds, is_busy: bool) -> StepCondition {
    match followed {
        None if is_busy => StepCondition::Immediate,
        None => StepCondition::IdleTick,
        Some(clock) if clock.newest.is_some_and(|newest| newest >= next) => StepCondition::Immediate,
        Some(_) => StepCondition::ClockTime,
    }
}

/// Waits for a change of the followed clock; false after its end. Without one, waits forever.
async fn changed(followed: &mut Option<watch::Receiver<ClockState>>) -> bool {
    match followed {
        Some(clock) => clock.changed().await.is_ok(),
        None => std::future::pending().await,
    }
}

/// Period of the comparison of the wall clock, which the axes do not follow, but the middleware does.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

/// Runs until [`Command::SetClock`], and returns the clock, or until [`Command::Shutdown`]; waits while the queue of frames is
/// full. `followed` is the state of the followed clock, `None` in `fast`. `has_stepped` is true after a position cycle of
/// another clock.
pub(super) async fn run(
    axes: &mut Axes,
    commands: &mut mpsc::Receiver<Command>,
    frames: &mpsc::Sender<Arc<SampleFrame>>,
    mut followed: Option<watch::Receiver<ClockState>>,
    has_stepped: bool,
) -> Option<Clock> {
    let period = axes.simulation().period();
    let tick = Duration::from_nanos(period.unsigned_abs());
    let mut axes = PacedAxes { axes, waiting: VecDeque::new(), is_time_known: false, jumps: 0, has_stepped };
    if axes.has_stepped && followed.is_some() {
        // Until its first message, the time of the new clock is not known.
        axes.axes.prepare_clock_change();
    }
    let mut idle_timer = IdleTimer::default();
    let mut ticks_at = None;
    let mut watch = WallClockWatch::new(since_epoch);
    let mut watched_at = tokio::time::Instant::now();
    loop {
        if watched_at.elapsed() >= WATCH_PERIOD {
            if let Some((from, to)) = watch.step(since_epoch) {
                wall::warn_if_set_back(from, to);
                watch = WallClockWatch::new(since_epoch);
            }
            watched_at = tokio::time::Instant::now();
        }
        loop {
            match commands.try_recv() {
                Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => return None,
                Ok(Command::SetClock(clock)) => return axes.leave(clock),
                Ok(command) => axes.receive(command),
                Err(mpsc::error::TryRecvError::Empty) => break,
            }
        }
        let state = followed.as_mut().map(|clock| *clock.borrow_and_update());
        axes.follow(state.as_ref());
        let condition =
            step_condition(state.as_ref(), axes.axes.next_time(), axes.axes.simulation().is_busy());
        if condition != StepCondition::IdleTick {
            idle_timer.stop();
            ticks_at = None;
        } else if ticks_at.is_none() {
            ticks_at = Some(idle_timer.next_tick(tick));
        }
        // A part program is planned in another thread: its setpoints do not depend on the time that this takes.
        let is_planned = !axes.axes.simulation().needs_chunk();
        let may_step = condition == StepCondition::Immediate && is_planned;
        let mut permit = None;
        if may_step {
            permit = frames.try_reserve().ok();
        }
        if permit.is_none() {
            axes.axes.update_clock_health(|clock| clock.is_blocked = may_step);
            tokio::select! {
                biased;
                command = commands.recv() => match command {
                    Some(Command::Shutdown) | None => return None,
                    Some(Command::SetClock(clock)) => return axes.leave(clock),
                    Some(command) => axes.receive(command),
                },
                is_open = changed(&mut followed) => if !is_open { return None },
                () = tokio::time::sleep_until(watched_at + WATCH_PERIOD) => {}
                () = until(ticks_at), if ticks_at.is_some() => {
                    ticks_at = None;
                    // An idle machine does not wait for space in the queue; it tries again at the next tick.
                    permit = frames.try_reserve().ok().filter(|_| is_planned);
                }
                reserved = frames.reserve(), if may_step => match reserved {
                    Ok(reserved) => permit = Some(reserved),
                    Err(_) => return None,
                },
            }
        }
        if let Some(permit) = permit {
            permit.send(axes.axes.step());
            axes.has_stepped = true;
            axes.axes.finish_cycle(Duration::ZERO, false, false);
        }
    }
}

async fn until(time: Option<tokio::time::Instant>) {
    match time {
        Some(time) => tokio::time::sleep_until(time).await,
        None => std::future::pending().await,
    }
}

/// Axes with the commands that wait for the first time.
struct PacedAxes<'a> {
    axes: &'a mut Axes,
    /// Trajectories and stops received before the first time, oldest first.
    waiting: VecDeque<Command>,
    /// True after the first time has been received.
    is_time_known: bool,
    /// Number of clock jumps that have been applied.
    jumps: u64,
    /// True after the first position cycle.
    has_stepped: bool,
}

impl PacedAxes<'_> {
    /// Continues at the time of the wall clock, for which commands do not wait.
    fn leave(mut self, clock: Clock) -> Option<Clock> {
        self.axes.restart_at(self.axes.next_time(), wall::now());
        self.apply_waiting();
        self.axes.report_ends();
        Some(clock)
    }

    fn receive(&mut self, command: Command) {
        if self.is_time_known {
            self.axes.apply(command);
            self.axes.report_ends();
            return;
        }
        match command {
            Command::Submit { id, .. } | Command::BeginMotion { id, .. }
                if self.waiting.len() >= COMMAND_QUEUE =>
            {
                self.axes.reject_queue_full(id);
            }
            Command::Submit { .. } | Command::BeginMotion { .. } => self.waiting.push_back(command),
            // Loads and streamed setpoints are valid only at their reception.
            Command::Load { .. } | Command::Stream(_) => {}
            Command::Cancel(id, _) => {
                // A motion must be submitted before it can be canceled; other commands continue to wait.
                let is_canceled = |waiting: &Command| match waiting {
                    Command::Submit { id: other, .. } | Command::BeginMotion { id: other, .. } => {
                        *other == id
                    }
                    _ => false,
                };
                if let Some(submission) =
                    self.waiting.iter().position(is_canceled).and_then(|index| self.waiting.remove(index))
                {
                    self.axes.apply(submission);
                }
                self.axes.apply(command);
                self.axes.report_ends();
            }
            // A stop affects the trajectories before it; consecutive stops are equivalent to one.
            Command::Stop(..) if matches!(self.waiting.back(), Some(Command::Stop(..))) => {}
            Command::Stop(..) => self.waiting.push_back(command),
            // A reset ends all waiting commands.
            Command::Reset(_) => {
                self.apply_waiting();
                self.axes.apply(command);
                self.axes.report_ends();
            }
            // Of a motion that has not begun.
            Command::ExtendMotion { .. } | Command::FinishMotion(_) => {}
            Command::SetFeedOverride(_)
            | Command::SetFeedHold(_)
            | Command::QueryState(..)
            | Command::UpdateParameters(_)
            | Command::Activate
            | Command::Deactivate { .. }
            | Command::SetClock(_)
            | Command::Shutdown => self.axes.apply(command),
        }
    }

    fn apply_waiting(&mut self) {
        for command in self.waiting.drain(..) {
            self.axes.apply(command);
        }
    }

    /// Applies a new state of the followed clock, `None` in `fast`: jumps, first time and diagnostics.
    fn follow(&mut self, followed: Option<&ClockState>) {
        if let Some(clock) = followed
            && clock.jump.count != self.jumps
        {
            self.jumps = clock.jump.count;
            self.jump(&clock.jump);
        }
        let newest = followed.and_then(|clock| clock.newest);
        let source = match followed {
            None => ClockSource::Own,
            Some(_) if newest.is_none() => ClockSource::None,
            Some(_) => ClockSource::Followed,
        };
        if source != ClockSource::None && !self.is_time_known {
            self.is_time_known = true;
            self.apply_waiting();
            self.axes.report_ends();
        }
        let behind = newest.map_or(0, |newest| (newest - self.axes.next_time()).max(0));
        self.axes.update_clock_health(|clock| {
            clock.source = source;
            clock.behind = behind;
        });
    }

    fn jump(&mut self, jump: &ClockJump) {
        let period = self.axes.simulation().period();
        if self.has_stepped {
            let from = jump.from.unwrap_or(self.axes.next_time() - period);
            self.axes.restart_at(from, jump.to);
        } else {
            self.axes.jump_to(first_instant(jump.to, period));
        }
    }
}
