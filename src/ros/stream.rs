//! `psec_stream`: setpoints one at a time, and what becomes of them.

use tracing::warn;

use super::throttle::Throttle;
pub use crate::ingress::{ReorderFilter, StreamSetpoints};
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::{Rejection, RejectionCode, StreamCounts};
use virtual_axes_core::units::Nanoseconds;

/// What the diagnostics say about the stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct StreamHealth {
    /// Whether a stream drives, moving or not.
    pub drives: bool,
    /// Whether setpoints come that are ignored after a stop.
    pub held_off: bool,
    /// Its delay, ns.
    pub delay: Nanoseconds,
    /// Setpoints refused since the start.
    pub refused: u64,
    /// Setpoints since the start that came while a trajectory or a stop had the joint, or after a stop.
    pub ignored: u64,
    /// Messages since the start that a younger one had overtaken.
    pub overtaken: u64,
    /// What the axes counted since the start.
    pub counts: StreamCounts,
}

/// Hands setpoints to the simulation, counts those that are not taken, and tells of them now and then.
#[derive(Debug, Default)]
pub struct StreamLog {
    refused: u64,
    ignored: u64,
    overtaken: u64,
    gaps: u64,
    told: Throttle<Told>,
}

/// What the log tells about.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Told {
    Refused(RejectionCode),
    Gap,
}

impl StreamLog {
    /// Gives `setpoints` to the axes for the next position instant.
    pub fn take(&mut self, simulation: &mut Simulation, setpoints: &StreamSetpoints) {
        let now = simulation.time_of(simulation.next_instant());
        self.overtaken += u64::from(setpoints.is_reordered);
        self.refused += setpoints.unlisted_rejections;
        for rejection in &setpoints.rejected {
            self.refuse(rejection, now);
        }
        for &(place, position) in &setpoints.positions {
            match simulation.submit_setpoint_stamped(place, position, setpoints.sent) {
                Ok(true) => {}
                Ok(false) => self.ignored += 1,
                Err(rejection) => self.refuse(&rejection, now),
            }
        }
    }

    fn refuse(&mut self, rejection: &Rejection, now: Nanoseconds) {
        self.refused += 1;
        if self.told.is_due(Told::Refused(rejection.code), now) {
            warn!("setpoint of the stream refused: {rejection}");
        }
    }

    /// Tells when the stream broke off, after each position instant.
    pub fn watch(&mut self, simulation: &Simulation) {
        let gaps = simulation.stream_counts().gaps;
        if gaps > self.gaps && self.told.is_due(Told::Gap, simulation.time_of(simulation.next_instant())) {
            warn!("the stream broke off in motion; the axes hold its last setpoints");
        }
        self.gaps = gaps;
    }

    /// What the diagnostics say.
    pub fn health(&self, simulation: &Simulation) -> StreamHealth {
        StreamHealth {
            drives: simulation.is_streaming(),
            held_off: simulation.is_stream_inhibited(),
            delay: simulation.stream_delay(),
            refused: self.refused,
            ignored: self.ignored,
            overtaken: self.overtaken,
            counts: simulation.stream_counts(),
        }
    }
}
