//! Simulation with its commands, frames and reports, independent of the clock that paces it.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::arc_pool::ArcPool;
use super::clock_follower::first_instant;
use super::commands::{Accepted, COMMAND_QUEUE, Command, PlannedSetpoints, SampleFrame, SimulationReport};
use super::health::{AxisHealth, ClockHealth, Health};
use super::program_monitor::ProgramMonitor;
use super::stream::StreamIntake;
use virtual_axes_core::simulation::Simulation;
use virtual_axes_core::trajectory::{MotionId, Rejection, RejectionCode, Trajectory};
use virtual_axes_core::units::{Nanoseconds, seconds};

/// Largest number of unread reports on stream ends. Later ends are merged into the next report.
const MAX_STREAM_ENDS: usize = 64;

/// Activity of the axes of a managed node; other nodes are always active.
enum Activity {
    /// Motions are accepted and samples published.
    Active,
    /// The axes stop. Resolves when the setpoints are at rest.
    Stopping(oneshot::Sender<()>),
    /// No motion is accepted and no sample published.
    Inactive,
}

/// Simulation with its reports.
pub(super) struct Axes {
    simulation: Simulation,
    reports: mpsc::UnboundedSender<SimulationReport>,
    health: watch::Sender<Health>,
    stream: StreamIntake,
    /// Number of resets.
    resets: u64,
    /// Accepted motions that have not ended, with their start times, ns.
    motions: Vec<(MotionId, Nanoseconds)>,
    frames: ArcPool<SampleFrame>,
    /// Active stops, whose ends are not reported.
    stops: Vec<MotionId>,
    /// Figures of the part programs whose ends are not reported, the active one last.
    programs: Vec<ProgramMonitor>,
    activity: Activity,
    /// Counter of the unread reports on stream ends.
    stream_ends: Arc<()>,
}

impl Axes {
    pub(super) fn new(
        simulation: Simulation,
        reports: mpsc::UnboundedSender<SimulationReport>,
        health: watch::Sender<Health>,
    ) -> Self {
        health.send_modify(|h| h.axes = vec![AxisHealth::default(); simulation.samples().len()]);
        let (stream, frames) = (StreamIntake::default(), ArcPool::default());
        let (motions, stops, stream_ends) = (Vec::new(), Vec::new(), Arc::new(()));
        let programs = Vec::new();
        let activity = Activity::Active;
        Axes {
            simulation,
            reports,
            health,
            stream,
            resets: 0,
            motions,
            frames,
            stops,
            programs,
            activity,
            stream_ends,
        }
    }

    pub(super) fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Returns the time of the next position cycle, ns.
    pub(super) fn next_time(&self) -> Nanoseconds {
        self.simulation.time_of(self.simulation.next_instant())
    }

    /// Computes the next position cycle.
    pub(super) fn step(&mut self) -> Arc<SampleFrame> {
        let Axes { simulation, stream, resets, motions, frames, programs, activity, .. } = self;
        let is_published = !matches!(activity, Activity::Inactive);
        let instant = simulation.next_instant();
        simulation.step();
        stream.check_gaps(simulation);
        let time = simulation.time_of(instant);
        let track = |track: &mut ProgramMonitor| {
            let error = simulation.contour_error(track.motion);
            track.update(time, simulation.path_place(), simulation.samples(), error)
        };
        let place = programs.last_mut().and_then(track);
        frames.acquire(|frame| {
            frame.is_published = is_published;
            frame.instant = instant;
            frame.time = simulation.time_of(instant);
            frame.samples.clear();
            frame.samples.extend_from_slice(simulation.samples());
            frame.program = place;
            frame.feed_rate = simulation.feed_rate();
            frame.resets = *resets;
            frame.motions.clone_from(motions);
        })
    }

    /// Reports ended motions and counts the last computed instant as released.
    pub(super) fn finish_cycle(&mut self, lateness: Duration, is_missed: bool, is_dropped: bool) {
        self.report_ends();
        if !self.simulation.is_busy() {
            self.finish_deactivation();
        }
        let Axes { simulation, stream, .. } = self;
        self.health.send_modify(|h| {
            h.update(simulation, lateness, is_missed, is_dropped);
            h.stream = stream.health(simulation);
        });
    }

    /// Reports ended motions and counts the last computed instant as missed and unpublished.
    pub(super) fn finish_unpublished_cycle(&mut self, lateness: Duration) {
        self.finish_cycle(lateness, true, false);
        self.health.send_modify(|h| h.unpublished += 1);
    }

    /// Reports motions and streams that have ended since the last call.
    pub(super) fn report_ends(&mut self) {
        if Arc::strong_count(&self.stream_ends) <= MAX_STREAM_ENDS
            && let Some((end, joints)) = self.simulation.take_stream_end()
        {
            let now = self.now();
            let unread = Arc::clone(&self.stream_ends);
            let _ = self.reports.send(SimulationReport::StreamEnded(now, end, joints, unread));
        }
        let period = self.simulation.period();
        for end in self.simulation.drain_finished() {
            self.motions.retain(|(id, _)| *id != end.id);
            let count = self.stops.len();
            self.stops.retain(|id| *id != end.id);
            if self.stops.len() < count {
                continue;
            }
            let program = self.programs.iter().position(|program| program.motion == end.id);
            let report = match program.map(|index| self.programs.remove(index)) {
                Some(program) => SimulationReport::ProgramEnded(end, program.finish(period)),
                None => SimulationReport::MotionEnded(end),
            };
            // The receiver is dropped only at shutdown.
            let _ = self.reports.send(report);
        }
    }

    /// Ends a deactivation whose stop has ended.
    fn finish_deactivation(&mut self) {
        match std::mem::replace(&mut self.activity, Activity::Inactive) {
            // The receiver is dropped after its timeout.
            Activity::Stopping(done) => _ = done.send(()),
            other => self.activity = other,
        }
    }

    /// Changes the clock's part of the diagnostics.
    pub(super) fn update_clock_health(&self, change: impl FnOnce(&mut ClockHealth)) {
        self.health.send_if_modified(|h| {
            let before = h.clock;
            change(&mut h.clock);
            h.clock != before
        });
    }

    /// Continues at the first position cycle at or after `to` after a jump of the clock from `from`, ns: logs and counts the
    /// jump and aborts all motions.
    pub(super) fn restart_at(&mut self, from: Nanoseconds, to: Nanoseconds) {
        warn!(
            "the clock jumped from {:.3} s to {:.3} s; all motions are aborted and the axes stop",
            seconds(from),
            seconds(to)
        );
        self.update_clock_health(|clock| clock.jumps += 1);
        self.jump_to(first_instant(to, self.simulation.period()));
    }

    /// Aborts all motions before a change to a clock whose time is not known yet.
    pub(super) fn prepare_clock_change(&mut self) {
        self.simulation.prepare_clock_change();
        self.report_ends();
    }

    /// Continues at the position cycle with the time `time`, ns.
    pub(super) fn jump_to(&mut self, time: Nanoseconds) {
        self.simulation.jump_to(time);
        self.report_ends();
    }

    /// Rejects a trajectory because too many wait for the first `/clock` message.
    pub(super) fn reject_queue_full(&self, id: MotionId) {
        let text = format!(
            "{COMMAND_QUEUE} trajectories already wait for the first /clock message; publish /clock or retry later"
        );
        let limit = COMMAND_QUEUE as f64;
        let rejection = Rejection::new(RejectionCode::QueueFull, text).numbers(limit + 1.0, limit);
        let _ = self.reports.send(SimulationReport::Decision(id, 0, Err(rejection)));
    }

    /// Applies a command; it takes effect in the next step.
    pub(super) fn apply(&mut self, command: Command) {
        let is_active = matches!(self.activity, Activity::Active);
        let simulation = &mut self.simulation;
        match command {
            Command::Submit { id, .. } | Command::BeginMotion { id, .. } if !is_active => {
                let text = "the node is not active; activate it with ~/change_state";
                let rejection = Rejection::new(RejectionCode::NotActive, text.to_owned());
                self.send_decision(id, Err(rejection));
            }
            // A stream has no response.
            Command::Stream(_) if !is_active => {}
            Command::Submit { id, trajectory, tolerances } => {
                let admission = match tolerances {
                    Some(tolerances) => simulation.submit_with_tolerances(id, trajectory, *tolerances),
                    None => simulation.submit(id, trajectory),
                };
                let accepted = admission.map(|admission| Accepted {
                    start: simulation.time_of(admission.start_k),
                    is_late: admission.is_late,
                });
                self.send_decision(id, accepted);
            }
            Command::BeginMotion { id, linear, rest } => self.begin_program(id, linear, rest),
            Command::ExtendMotion { id, chunk } => {
                if let Err(rejection) = simulation.extend_motion(id, chunk) {
                    warn!("part program canceled, its planned motion is not continuous: {rejection}");
                    simulation.cancel(id);
                }
            }
            Command::FinishMotion(id) => {
                simulation.finish_motion(id);
            }
            Command::Stop(id, trajectory) => self.stop(id, trajectory),
            Command::Cancel(id, done) => {
                let _ = done.send(simulation.cancel(id));
            }
            Command::SetFeedOverride(factor) => {
                if let Err(error) = simulation.set_feed_override(factor) {
                    warn!("{error}");
                }
            }
            Command::SetFeedHold(is_held) => simulation.set_feed_hold(is_held),
            Command::Load { loads, hold } => {
                for &(axis, load) in loads.iter() {
                    simulation.set_load(axis, load, hold);
                }
            }
            Command::Stream(setpoints) => self.stream.submit(simulation, &setpoints),
            Command::QueryState(time, done) => {
                let (states, is_commanded) = simulation.planned_states(time);
                let has_trajectory = simulation.has_trajectory();
                let _ = done.send(PlannedSetpoints { states, is_commanded, has_trajectory });
            }
            Command::UpdateParameters(parameters) => {
                if let Err(error) = simulation.update_parameters(parameters) {
                    warn!("changed parameters not applied: {error}");
                }
            }
            Command::Reset(done) => {
                info!("reset: at rest at home");
                simulation.reset();
                self.resets += 1;
                let _ = done.send(());
            }
            Command::Activate => self.activity = Activity::Active,
            Command::Deactivate { id, stop, done } => {
                if let Some(stop) = stop.filter(|_| simulation.is_busy()) {
                    self.stop(id, stop);
                }
                self.activity = Activity::Stopping(done);
                if !self.simulation.is_busy() {
                    self.finish_deactivation();
                }
            }
            // The caller changes the clock or ends the thread.
            Command::SetClock(_) | Command::Shutdown => {}
        }
    }

    /// Begins the motion of a part program and sends the positions at which it begins.
    fn begin_program(&mut self, id: MotionId, linear: Vec<usize>, rest: oneshot::Sender<Vec<f64>>) {
        self.programs.push(ProgramMonitor::new(id, linear));
        let positions = self.simulation.begin_motion(id);
        self.send_decision(id, Ok(Accepted { start: self.now(), is_late: false }));
        // Its planning ends with the node.
        let _ = rest.send(positions);
    }

    /// Begins a controlled stop, whose end is not reported.
    fn stop(&mut self, id: MotionId, trajectory: Arc<Trajectory>) {
        match self.simulation.submit(id, trajectory) {
            Ok(_) => self.stops.push(id),
            Err(rejection) => warn!("controlled stop rejected: {rejection}"),
        }
    }

    /// Reports the acceptance or rejection of a motion; an accepted one counts as active.
    fn send_decision(&mut self, id: MotionId, decision: Result<Accepted, Rejection>) {
        if let Ok(accepted) = &decision {
            self.motions.push((id, accepted.start));
        }
        let _ = self.reports.send(SimulationReport::Decision(id, self.now(), decision));
    }

    /// Returns the current time, ns: between two instants, the time of the first.
    fn now(&self) -> Nanoseconds {
        self.simulation.time_of(self.simulation.next_instant() - 1)
    }
}
