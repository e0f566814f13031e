//! How the thread of the simulation fares, counted for the diagnostics.

use std::time::Duration;

use super::super::stream::StreamHealth;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::units::Nanoseconds;

/// How the thread fares; read by the diagnostics.
#[derive(Debug, Clone, Default)]
pub struct Health {
    /// Time of the last position instant, ns.
    pub time: Nanoseconds,
    /// Whether a trajectory or a stop moves the setpoints.
    pub moving: bool,
    /// Whether something is asked of the axes.
    pub busy: bool,
    /// Position periods since the start.
    pub periods: u64,
    /// Periods that were released later than the next one was due.
    pub missed: u64,
    /// Of those, the ones that came too late to be published.
    pub unpublished: u64,
    /// Frames that the ROS side did not take in time.
    pub dropped: u64,
    /// Largest lateness of a release since the start, s.
    pub max_lateness: f64,
    /// Sum of all latenesses, s.
    pub total_lateness: f64,
    /// The clock that it keeps step with.
    pub clock: ClockHealth,
    /// How the stream of setpoints fares.
    pub stream: StreamHealth,
    /// Periods with an axis at a limit, and with friction beyond its fitted range, per axis.
    pub axes: Vec<AxisHealth>,
}

/// Counts of one axis since the start.
#[derive(Debug, Clone, Copy, Default)]
pub struct AxisHealth {
    /// Position periods in which it was at a limit.
    pub saturated: u64,
    /// Position instants at which its friction law was extrapolated.
    pub extrapolated: u64,
    /// Position instants at which it stood outside its travel limits.
    pub outside: u64,
}

/// The clock that the thread keeps step with.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockHealth {
    /// Whose it is.
    pub source: ClockSource,
    /// How far the position instants are behind it, ns.
    pub behind: Nanoseconds,
    /// Whether a slow subscriber is being waited for, as of the last wait.
    pub held_back: bool,
    /// How often it has jumped since the start.
    pub jumps: u64,
}

/// Whose clock it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ClockSource {
    /// There is no time yet.
    #[default]
    None,
    /// The wall clock.
    Wall,
    /// This node's own `/clock`.
    Own,
    /// `/clock` of somebody else.
    Others,
}

impl ClockSource {
    /// Its name in the diagnostics.
    pub fn name(self) -> &'static str {
        match self {
            ClockSource::None => "none",
            ClockSource::Wall => "wall",
            ClockSource::Own => "own",
            ClockSource::Others => "followed",
        }
    }
}

impl Health {
    /// Notes a position instant that has been released.
    pub(super) fn update(
        &mut self,
        simulation: &Simulation,
        lateness: Duration,
        missed: bool,
        dropped: bool,
    ) {
        let lateness = lateness.as_secs_f64();
        self.time = simulation.time_of(simulation.next_instant() - 1);
        self.moving = simulation.is_moving();
        self.busy = simulation.is_busy() || simulation.is_in_motion();
        self.periods += 1;
        self.missed += u64::from(missed);
        self.dropped += u64::from(dropped);
        self.max_lateness = self.max_lateness.max(lateness);
        self.total_lateness += lateness;
        for (place, (axis, sample)) in self.axes.iter_mut().zip(simulation.samples()).enumerate() {
            axis.outside += u64::from(simulation.is_outside_travel_limits(place));
            axis.saturated += u64::from(sample.saturated);
            axis.extrapolated += u64::from(sample.friction_extrapolated);
        }
    }
}
