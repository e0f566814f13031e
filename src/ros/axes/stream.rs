//! Intake of streamed setpoints (`psec_stream`): submission to the simulation, counters and log messages.

use tracing::warn;

use super::throttle::Throttle;
use crate::validation::StreamSetpoints;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::{Rejection, RejectionCode, StreamCounts};
use virtual_axes_core::units::Nanoseconds;

/// State and counters of the setpoint stream, for the diagnostics.
#[derive(Debug, Clone, Copy, Default)]
pub struct StreamHealth {
    /// True if a stream is active, in motion or not.
    pub is_active: bool,
    /// True if streamed setpoints arrive and are ignored after a stop.
    pub is_inhibited: bool,
    /// Delay of streamed setpoints, ns.
    pub delay: Nanoseconds,
    /// Number of rejected setpoints since the start.
    pub rejected: u64,
    /// Number of setpoints since the start that arrived while a trajectory or a stop commanded the joint, or after a
    /// stop.
    pub ignored: u64,
    /// Number of messages since the start that arrived after a later message of their publisher.
    pub reordered: u64,
    /// Counters of the simulation.
    pub counts: StreamCounts,
}

/// Submits streamed setpoints to the simulation, counts rejected, ignored and reordered ones, and logs at a limited
/// rate.
#[derive(Debug, Default)]
pub struct StreamIntake {
    rejected: u64,
    ignored: u64,
    reordered: u64,
    gaps: u64,
    throttle: Throttle<StreamWarning>,
}

/// Kind of a log message.
#[derive(Debug, Clone, Copy, PartialEq)]
enum StreamWarning {
    Rejection(RejectionCode),
    Gap,
}

impl StreamIntake {
    /// Submits `setpoints` for the next position cycle.
    pub fn submit(&mut self, simulation: &mut Simulation, setpoints: &StreamSetpoints) {
        let now = simulation.time_of(simulation.next_instant());
        self.reordered += u64::from(setpoints.is_reordered);
        self.rejected += setpoints.unlisted_rejections;
        for rejection in &setpoints.rejected {
            self.count_rejection(rejection, now);
        }
        for &(index, position) in &setpoints.positions {
            match simulation.submit_setpoint_stamped(index, position, setpoints.sent) {
                Ok(true) => {}
                Ok(false) => self.ignored += 1,
                Err(rejection) => self.count_rejection(&rejection, now),
            }
        }
    }

    fn count_rejection(&mut self, rejection: &Rejection, now: Nanoseconds) {
        self.rejected += 1;
        if self.throttle.is_due(StreamWarning::Rejection(rejection.code), now) {
            warn!("streamed setpoint rejected: {rejection}");
        }
    }

    /// Logs a gap of the stream; called after each position cycle.
    pub fn check_gaps(&mut self, simulation: &Simulation) {
        let gaps = simulation.stream_counts().gaps;
        let now = simulation.time_of(simulation.next_instant());
        if gaps > self.gaps && self.throttle.is_due(StreamWarning::Gap, now) {
            warn!("gap in the stream during motion; the axes hold the last setpoints");
        }
        self.gaps = gaps;
    }

    /// Returns state and counters for the diagnostics.
    pub fn health(&self, simulation: &Simulation) -> StreamHealth {
        StreamHealth {
            is_active: simulation.is_streaming(),
            is_inhibited: simulation.is_stream_inhibited(),
            delay: simulation.stream_delay(),
            rejected: self.rejected,
            ignored: self.ignored,
            reordered: self.reordered,
            counts: simulation.stream_counts(),
        }
    }
}
