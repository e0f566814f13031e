//! Wall clock as a sequence of position cycles, and the timer of an idle machine in `fast`.

use std::sync::atomic::{AtomicI64, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tracing::warn;

use virtual_axes_core::config::TimeMode;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::units::{MILLISECOND_NS, Nanoseconds, seconds};

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
    (now().div_euclid(period) + 1) * period
}

/// Returns the wall-clock time, ns since the Unix epoch.
pub(super) fn now() -> Nanoseconds {
    Nanoseconds::try_from(since_epoch().as_nanos()).unwrap_or(Nanoseconds::MAX / 2)
}

/// Returns the wall-clock time since the Unix epoch.
pub(super) fn since_epoch() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

/// Difference of the wall clock from the time of the axes that is not a step, ns: the clocks are slewed together, and NTP
/// steps the wall clock at 0.128 s.
const MAX_DIFFERENCE: Nanoseconds = 100 * MILLISECOND_NS;
/// Longest time between two readings of the monotonic clock with a valid reading of the wall clock between them.
const MAX_READING_TIME: Duration = Duration::from_millis(5);
/// Largest number of readings for a valid one.
const MAX_READINGS: usize = 10;

/// Reads both clocks; another process may run between the readings, which are repeated then. Returns also how far they are
/// apart at most.
fn read_both(wall: impl Fn() -> Duration) -> (Instant, Duration, Duration) {
    let read = || {
        let before = Instant::now();
        let shown = wall();
        (before, shown, before.elapsed())
    };
    let mut best = read();
    for _ in 1..MAX_READINGS {
        if best.2 < MAX_READING_TIME {
            break;
        }
        let next = read();
        best = if next.2 < best.2 { next } else { best };
    }
    best
}

/// Watch for a wall clock that is set, by the monotonic clock.
pub(super) struct WallClockWatch {
    /// Time of the wall clock at `instant`, ns since the Unix epoch.
    time: Nanoseconds,
    instant: Instant,
}

impl WallClockWatch {
    /// Creates a watch that begins at the present time.
    pub(super) fn new(wall: impl Fn() -> Duration) -> Self {
        let (instant, shown, _) = read_both(wall);
        WallClockWatch { time: Nanoseconds::try_from(shown.as_nanos()).unwrap_or(0), instant }
    }

    /// Returns the expected and the present time of the wall clock, ns, if it has been set since the construction.
    pub(super) fn step(&self, wall: impl Fn() -> Duration) -> Option<(Nanoseconds, Nanoseconds)> {
        let (now, shown, took) = read_both(wall);
        let found = Nanoseconds::try_from(shown.as_nanos()).ok()?;
        let passed =
            |from: Instant, to: Instant| to.saturating_duration_since(from).as_nanos() as Nanoseconds;
        let expected = self.time + passed(self.instant, now) - passed(now, self.instant);
        let is_step = (found - expected).abs() > MAX_DIFFERENCE && took < MAX_READING_TIME;
        is_step.then_some((expected, found))
    }
}

/// Newest time from which the wall clock has been set back, ns.
static SET_BACK_FROM: AtomicI64 = AtomicI64::new(0);

/// Logs what the middleware does not receive if the wall clock has been set back, `from` one time `to` another, ns.
pub(super) fn warn_if_set_back(from: Nanoseconds, to: Nanoseconds) {
    if to < from {
        let newest = SET_BACK_FROM.fetch_max(from, Ordering::Relaxed).max(from);
        warn!(
            "the wall clock was set back: until it has passed {:.3} s again, the middleware receives neither new \
             participants nor best-effort topics such as load, and /clock with use_sim_time (it drops what comes before the \
             newest sample); start the node again to receive them now",
            seconds(newest)
        );
    }
}

/// Schedule of the position cycles on the monotonic clock.
///
/// The wall clock is read at construction and compared afterwards; setting it neither stops nor accelerates the axes.
pub(super) struct PaceClock {
    /// First instant.
    first: i64,
    /// Due time of the first instant.
    start: Instant,
    /// Time of the first instant, ns since the Unix epoch.
    time: Nanoseconds,
    pub(super) period: Duration,
}

impl PaceClock {
    /// Creates the schedule of `simulation`, whose next instant is less than a period from the wall-clock time `wall`.
    pub(super) fn new(simulation: &Simulation, wall: impl Fn() -> Duration) -> Self {
        let first = simulation.next_instant();
        let time = simulation.time_of(first);
        let period = Duration::from_nanos(u64::try_from(simulation.period()).unwrap_or(1));
        let (now, shown, _) = read_both(wall);
        let due = Duration::from_nanos(u64::try_from(time).unwrap_or(0));
        // More than a period ahead or late only if the wall clock has been set since.
        let late = Some(shown.saturating_sub(due)).filter(|late| *late < period).unwrap_or_default();
        let start = now + due.saturating_sub(shown).min(period);
        PaceClock { first, start: start.checked_sub(late).unwrap_or(start), time, period }
    }

    /// Returns the time of the wall clock, ns, if it has been set since the construction.
    pub(super) fn stepped_to(&self, wall: impl Fn() -> Duration) -> Option<Nanoseconds> {
        let watch = WallClockWatch { time: self.time, instant: self.start };
        watch.step(wall).map(|(_, found)| found)
    }

    fn due(&self, k: i64) -> Instant {
        let nanoseconds = self.period.as_nanos() * u128::try_from(k - self.first).unwrap_or(0);
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
        self.first.saturating_add(i64::try_from(passed / self.period.as_nanos().max(1)).unwrap_or(i64::MAX))
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
