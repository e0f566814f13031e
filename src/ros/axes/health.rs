//! Counters and state of the axes' thread, published as diagnostics.

use std::time::Duration;

use super::stream::StreamHealth;
use virtual_axes_core::named_values;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::units::Nanoseconds;

/// Counters and state of the axes' thread since the start.
#[derive(Debug, Clone, Default)]
pub struct Health {
    /// Time of the last position cycle, ns.
    pub time: Nanoseconds,
    /// True while a trajectory or a stop moves the setpoints.
    pub is_moving: bool,
    /// True while commands are active, or the axes settle or move.
    pub is_busy: bool,
    /// True during a feed hold.
    pub is_feed_hold: bool,
    /// Feed override in effect.
    pub feed_rate: f64,
    /// Number of position cycles.
    pub periods: u64,
    /// Number of position cycles that were released later than the next one was due.
    pub missed: u64,
    /// Number of missed position cycles that were computed but not published.
    pub unpublished: u64,
    /// Number of frames dropped because the queue of frames was full.
    pub dropped: u64,
    /// Largest release delay, s.
    pub max_lateness: f64,
    /// Sum of all release delays, s.
    pub total_lateness: f64,
    /// State of the clock that paces the thread.
    pub clock: ClockHealth,
    /// State of the setpoint stream.
    pub stream: StreamHealth,
    /// Counters of each axis.
    pub axes: Vec<AxisHealth>,
}

/// Counters of one axis since the start.
#[derive(Debug, Clone, Copy, Default)]
pub struct AxisHealth {
    /// Number of position cycles in which a controller output was saturated.
    pub saturated: u64,
    /// Number of position cycles at which the friction law was extrapolated.
    pub extrapolated: u64,
    /// Number of position cycles at which the axis was outside its travel limits.
    pub outside: u64,
}

/// State of the clock that paces the thread.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockHealth {
    /// Source of the clock.
    pub source: ClockSource,
    /// Delay of the position cycles relative to the clock, ns.
    pub behind: Nanoseconds,
    /// True if the thread waited for a slow subscriber at its last wait.
    pub is_blocked: bool,
    /// Number of clock jumps since the start.
    pub jumps: u64,
}

named_values! {
    /// Source of the clock that paces the thread, with its name in the diagnostics.
    #[derive(Default)]
    pub enum ClockSource {
        /// No time has been received yet.
        #[default]
        None = "none",
        /// Wall clock.
        Wall = "wall",
        /// `/clock` published by this node.
        Own = "own",
        /// `/clock` published by another node.
        Followed = "followed",
    }
}

impl Health {
    /// Counts a position cycle that has been released `lateness` after it was due.
    pub fn update(&mut self, simulation: &Simulation, lateness: Duration, is_missed: bool, is_dropped: bool) {
        let lateness = lateness.as_secs_f64();
        self.time = simulation.time_of(simulation.next_instant() - 1);
        self.is_moving = simulation.is_moving();
        self.is_busy = simulation.is_busy() || simulation.is_in_motion();
        self.is_feed_hold = simulation.is_feed_hold();
        self.feed_rate = simulation.feed_rate();
        self.periods += 1;
        self.missed += u64::from(is_missed);
        self.dropped += u64::from(is_dropped);
        self.max_lateness = self.max_lateness.max(lateness);
        self.total_lateness += lateness;
        for (index, (axis, sample)) in self.axes.iter_mut().zip(simulation.samples()).enumerate() {
            axis.outside += u64::from(simulation.is_outside_travel_limits(index));
            axis.saturated += u64::from(sample.saturated);
            axis.extrapolated += u64::from(sample.friction_extrapolated);
        }
    }
}
