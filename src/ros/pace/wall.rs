//! The wall clock.

use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use virtual_axes_core::config::TimeMode;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::units::Nanoseconds;

/// Ticks of an idle clock that are made up for when the machine is busy; beyond that, they are lost.
const CATCH_UP: u32 = 10;

/// When position instant 0 is, ns since the Unix epoch: the next one of the grid of `period` ns
/// through the epoch. A clock that is followed says so itself when it comes.
pub fn origin(mode: TimeMode, period: Nanoseconds) -> Nanoseconds {
    match mode {
        TimeMode::Real | TimeMode::Fast => grid_origin(period),
        TimeMode::SimTime => period,
    }
}

fn grid_origin(period: Nanoseconds) -> Nanoseconds {
    let now = Nanoseconds::try_from(since_epoch().as_nanos()).unwrap_or(Nanoseconds::MAX / 2);
    (now.div_euclid(period) + 1) * period
}

/// What the wall clock says, since the Unix epoch.
pub(super) fn since_epoch() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// The wall clock as position instants, as it ran when this began: it is read once, so that setting it
/// later neither stops nor hurries the axes.
pub(super) struct PaceClock {
    /// When instant 0 is due.
    start: Instant,
    pub(super) period: Duration,
}

impl PaceClock {
    /// That of the instants of `simulation`, whose origin is the next instant by `wall`, or a past one.
    pub(super) fn new(simulation: &Simulation, wall: impl FnOnce() -> Duration) -> Self {
        let origin = Duration::from_nanos(u64::try_from(simulation.time_of(0)).unwrap_or(0));
        let period = Duration::from_nanos(u64::try_from(simulation.period()).unwrap_or(1));
        // More than a period ahead it is only by a wall clock that has been set back since.
        let start = Instant::now() + origin.saturating_sub(wall()).min(period);
        PaceClock { start, period }
    }

    fn due(&self, k: i64) -> Instant {
        let nanoseconds = self.period.as_nanos() * u128::try_from(k).unwrap_or(0);
        self.start + Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
    }

    /// Sleeps until instant `k` is due, and says how late it has become.
    pub(super) fn wait_for(&self, k: i64) -> Duration {
        let due = self.due(k);
        let now = Instant::now();
        if now < due {
            thread::sleep(due - now);
        }
        self.lateness_of(k)
    }

    /// How late instant `k` is now.
    pub(super) fn lateness_of(&self, k: i64) -> Duration {
        Instant::now().saturating_duration_since(self.due(k))
    }

    /// The last instant that is due.
    pub(super) fn newest_due(&self) -> i64 {
        let passed = Instant::now().saturating_duration_since(self.start).as_nanos();
        i64::try_from(passed / self.period.as_nanos().max(1)).unwrap_or(i64::MAX)
    }
}

/// An idle clock of our own: it ticks at real pace, and need not be exact.
#[derive(Debug, Default)]
pub(super) struct Pulse {
    due: Option<tokio::time::Instant>,
}

impl Pulse {
    /// When it ticks next, `period` after the tick before, or after now when it has just begun.
    pub(super) fn next(&mut self, period: Duration) -> tokio::time::Instant {
        let now = tokio::time::Instant::now();
        let earliest = now.checked_sub(period * CATCH_UP).unwrap_or(now);
        let due = self.due.map_or(now, |due| due.max(earliest)) + period;
        self.due = Some(due);
        due
    }

    /// Begins anew with the next tick.
    pub(super) fn stop(&mut self) {
        self.due = None;
    }
}
