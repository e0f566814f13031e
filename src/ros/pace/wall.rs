//! Wall clock as a sequence of position cycles, and the timer of an idle machine in `fast`.

use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use virtual_axes_core::config::TimeMode;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::units::Nanoseconds;

/// Largest number of late ticks of the idle timer that are made up for; earlier ones are skipped.
const CATCH_UP: u32 = 10;

/// Returns the time of position cycle 0, ns since the Unix epoch: the next multiple of `period` (ns).
///
/// With `use_sim_time` the origin is preliminary; the first `/clock` message sets the time.
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

/// Returns the wall-clock time since the Unix epoch.
pub(super) fn since_epoch() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Schedule of the position cycles on the monotonic clock.
///
/// The wall clock is read once at construction, so that setting it later neither stops nor accelerates the axes.
pub(super) struct PaceClock {
    /// Due time of instant 0.
    start: Instant,
    pub(super) period: Duration,
}

impl PaceClock {
    /// Creates the schedule of `simulation`, whose origin is at most one period after the wall-clock time `wall`.
    pub(super) fn new(simulation: &Simulation, wall: impl FnOnce() -> Duration) -> Self {
        let origin = Duration::from_nanos(u64::try_from(simulation.time_of(0)).unwrap_or(0));
        let period = Duration::from_nanos(u64::try_from(simulation.period()).unwrap_or(1));
        // The origin is more than a period ahead only if the wall clock has been set back since.
        let start = Instant::now() + origin.saturating_sub(wall()).min(period);
        PaceClock { start, period }
    }

    fn due(&self, k: i64) -> Instant {
        let nanoseconds = self.period.as_nanos() * u128::try_from(k).unwrap_or(0);
        self.start + Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
    }

    /// Sleeps until instant `k` is due and returns its lateness.
    pub(super) fn wait_for(&self, k: i64) -> Duration {
        let due = self.due(k);
        let now = Instant::now();
        if now < due {
            thread::sleep(due - now);
        }
        self.lateness_of(k)
    }

    /// Returns the lateness of instant `k`, 0 if it is not yet due.
    pub(super) fn lateness_of(&self, k: i64) -> Duration {
        Instant::now().saturating_duration_since(self.due(k))
    }

    /// Returns the last instant that is due.
    pub(super) fn newest_due(&self) -> i64 {
        let passed = Instant::now().saturating_duration_since(self.start).as_nanos();
        i64::try_from(passed / self.period.as_nanos().max(1)).unwrap_or(i64::MAX)
    }
}

/// Timer of the position cycles of an idle machine in `fast`, at wall-clock rate.
#[derive(Debug, Default)]
pub(super) struct IdleTimer {
    due: Option<tokio::time::Instant>,
}

impl IdleTimer {
    /// Returns the time of the next tick: `period` after the previous tick, or from now after a stop.
    pub(super) fn next_tick(&mut self, period: Duration) -> tokio::time::Instant {
        let now = tokio::time::Instant::now();
        let earliest = now.checked_sub(period * CATCH_UP).unwrap_or(now);
        let due = self.due.map_or(now, |due| due.max(earliest)) + period;
        self.due = Some(due);
        due
    }

    /// Stops the timer; the next tick starts it again.
    pub(super) fn stop(&mut self) {
        self.due = None;
    }
}
