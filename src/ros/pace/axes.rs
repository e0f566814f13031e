//! The simulation, its commands and its reports, whatever it keeps step with.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, watch};
use tracing::{info, warn};

use super::super::arc_pool::ArcPool;
use super::super::stream::StreamLog;
use super::{Accepted, AxisHealth, COMMAND_QUEUE, ClockHealth, Command, Frame, Health, Report};
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::{MotionId, Rejection, RejectionCode};
use virtual_axes_core::units::Nanoseconds;

/// Most reports on streams that are on their way; what becomes of streams meanwhile is told by the last.
const MOST_STREAM_ENDS: usize = 64;

/// The simulation with what it answers.
pub(super) struct Axes {
    simulation: Simulation,
    reports: mpsc::UnboundedSender<Report>,
    health: watch::Sender<Health>,
    stream: StreamLog,
    /// How often the axes have been reset.
    resets: u64,
    /// The accepted motions that have not ended, with the times of their starts, ns.
    motions: Vec<(MotionId, Nanoseconds)>,
    frames: ArcPool<Frame>,
    /// The stops that nobody asked a result of, while they last.
    stops: Vec<MotionId>,
    /// Shared by the reports on streams that are on their way.
    stream_ends: Arc<()>,
}

impl Axes {
    pub(super) fn new(
        simulation: Simulation,
        reports: mpsc::UnboundedSender<Report>,
        health: watch::Sender<Health>,
    ) -> Self {
        health.send_modify(|h| h.axes = vec![AxisHealth::default(); simulation.samples().len()]);
        let (stream, frames) = (StreamLog::default(), ArcPool::default());
        let (motions, stops, stream_ends) = (Vec::new(), Vec::new(), Arc::new(()));
        Axes { simulation, reports, health, stream, resets: 0, motions, frames, stops, stream_ends }
    }

    pub(super) fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Time of the position instant that is computed next, ns.
    pub(super) fn next_time(&self) -> Nanoseconds {
        self.simulation.time_of(self.simulation.next_instant())
    }

    /// Computes the next position instant.
    pub(super) fn step(&mut self) -> Arc<Frame> {
        let Axes { simulation, stream, resets, motions, frames, .. } = self;
        let instant = simulation.next_instant();
        simulation.step();
        stream.watch(simulation);
        frames.acquire(|frame| {
            frame.instant = instant;
            frame.time = simulation.time_of(instant);
            frame.samples.clear();
            frame.samples.extend_from_slice(simulation.samples());
            frame.resets = *resets;
            frame.motions.clone_from(motions);
        })
    }

    /// Tells what has become of the instant that was computed last.
    pub(super) fn released(&mut self, lateness: Duration, missed: bool, dropped: bool) {
        self.report_ends();
        let Axes { simulation, stream, .. } = self;
        self.health.send_modify(|h| {
            h.update(simulation, lateness, missed, dropped);
            h.stream = stream.health(simulation);
        });
    }

    /// Likewise of an instant that came too late to be published.
    pub(super) fn kept(&mut self, lateness: Duration) {
        self.released(lateness, true, false);
        self.health.send_modify(|h| h.unpublished += 1);
    }

    /// Tells of motions and streams that have ended, whether or not time goes on.
    pub(super) fn report_ends(&mut self) {
        if Arc::strong_count(&self.stream_ends) <= MOST_STREAM_ENDS
            && let Some((end, joints)) = self.simulation.take_stream_end()
        {
            let now = self.simulation.time_of(self.simulation.next_instant() - 1);
            let on_its_way = Arc::clone(&self.stream_ends);
            let _ = self.reports.send(Report::StreamEnded(now, end, joints, on_its_way));
        }
        for end in self.simulation.drain_finished() {
            self.motions.retain(|(id, _)| *id != end.id);
            let asked_for = self.stops.len();
            self.stops.retain(|id| *id != end.id);
            if self.stops.len() < asked_for {
                continue;
            }
            // The receiver lives as long as the node; when it is gone, so is whoever wants to know.
            let _ = self.reports.send(Report::Ended(end));
        }
    }

    /// Changes what the diagnostics say about the clock.
    pub(super) fn tell_clock(&self, change: impl FnOnce(&mut ClockHealth)) {
        self.health.send_if_modified(|h| {
            let before = h.clock;
            change(&mut h.clock);
            h.clock != before
        });
    }

    /// Goes on at `time` (ns), a position instant.
    pub(super) fn jump_to(&mut self, time: Nanoseconds) {
        self.simulation.jump_to(time);
        self.report_ends();
    }

    /// Refuses a trajectory because too many wait for the clock.
    pub(super) fn refuse_full(&self, id: MotionId) {
        let text = format!("{COMMAND_QUEUE} trajectories wait for the first /clock");
        let limit = COMMAND_QUEUE as f64;
        let rejection = Rejection::new(RejectionCode::QueueFull, text).numbers(limit + 1.0, limit);
        let _ = self.reports.send(Report::Decided(id, 0, Err(rejection)));
    }

    /// Takes a command; the next step is the first to show it.
    pub(super) fn apply(&mut self, command: Command) {
        let Axes { simulation, reports, stream, resets, motions, stops, .. } = self;
        // Between two instants, the time is that of the first.
        let now = simulation.time_of(simulation.next_instant() - 1);
        match command {
            Command::Offer { id, trajectory, tolerances } => {
                let admission = match tolerances {
                    Some(tolerances) => simulation.submit_with_tolerances(id, trajectory, *tolerances),
                    None => simulation.submit(id, trajectory),
                };
                let decision = admission.map(|admission| Accepted {
                    start: simulation.time_of(admission.start_k),
                    is_late: admission.is_late,
                });
                if let Ok(accepted) = &decision {
                    motions.push((id, accepted.start));
                }
                let _ = reports.send(Report::Decided(id, now, decision));
            }
            Command::Stop(id, trajectory) => match simulation.submit(id, trajectory) {
                Ok(_) => stops.push(id),
                Err(rejection) => warn!("the axes cannot be stopped: {rejection}"),
            },
            Command::Cancel(id, done) => {
                let _ = done.send(simulation.cancel(id));
            }
            Command::Load { loads, hold } => {
                for &(axis, load) in loads.iter() {
                    simulation.set_load(axis, load, hold);
                }
            }
            Command::Stream(setpoints) => stream.take(simulation, &setpoints),
            Command::Adopt(parameters) => {
                if let Err(error) = simulation.update_parameters(parameters) {
                    warn!("changed parameters could not be taken over: {error}");
                }
            }
            Command::Reset(done) => {
                info!("reset: at rest at home");
                simulation.reset();
                *resets += 1;
                let _ = done.send(());
            }
            // Whoever calls ends then.
            Command::Shutdown => {}
        }
    }
}
