//! The thread that owns the simulation, and the only place that reads the wall clock.
//!
//! In real time position instant k is computed and released when the wall clock reaches it; an
//! instant that comes late is computed at once and counted, none is left out. In `fast` the thread
//! runs as fast as its frames are taken while something is asked of the axes, and at real pace
//! when nothing is; a stream of set-points alone goes at real pace too, since its sender does.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tokio::sync::{mpsc, oneshot, watch};
use tracing::{info, warn};

use super::stream::{Setpoints, StreamHealth, StreamLog};
use crate::config::TimeMode;
use crate::machine::{AxisSample, MachineParameters};
use crate::simulation::{MotionEnd, Simulation, Tolerances};
use crate::trajectory::{JointSet, MotionId, Rejection, StreamEnd, Trajectory};
use crate::units::Nanoseconds;

/// Commands that wait for the next position instant; a sender of more waits.
pub const COMMAND_QUEUE: usize = 64;

/// What the ROS side asks of the simulation; takes effect at the next position instant.
#[derive(Debug)]
pub enum Command {
    /// Run a trajectory.
    Offer {
        /// Its name here.
        id: MotionId,
        /// The trajectory, checked as far as it can be without the state of the axes.
        trajectory: Arc<Trajectory>,
        /// How far it may stray.
        tolerances: Option<Box<Tolerances>>,
    },
    /// Call a motion off, and say whether there was one.
    Cancel(MotionId, oneshot::Sender<bool>),
    /// Put loads (N or N·m) on axes for a while.
    Load {
        /// Place of the axis, and load.
        loads: Vec<(usize, f64)>,
        /// How long, ns.
        hold: Nanoseconds,
    },
    /// Take the set-points of a stream over, where no trajectory moves.
    Stream(Setpoints),
    /// Take changed parameters over.
    Adopt(Arc<MachineParameters>),
    /// Back to rest at home.
    Reset(oneshot::Sender<()>),
    /// End the thread.
    Shutdown,
}

/// An accepted trajectory.
#[derive(Debug, Clone, Copy)]
pub struct Accepted {
    /// When its time 0 is, ns.
    pub start: Nanoseconds,
    /// Whether that was over when it came.
    pub joined_late: bool,
}

/// What the simulation answers.
#[derive(Debug)]
pub enum Report {
    /// A trajectory has been accepted or refused at a time (ns).
    Decided(MotionId, Nanoseconds, Result<Accepted, Rejection>),
    /// A motion has ended.
    Ended(MotionEnd),
    /// Joints were taken away from a stream at a time (ns).
    StreamEnded(Nanoseconds, StreamEnd, JointSet),
}

/// The samples of one position instant.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Position instant.
    pub instant: i64,
    /// Its time, ns.
    pub time: Nanoseconds,
    /// One per axis.
    pub samples: Vec<AxisSample>,
    /// How often the axes have been reset before it.
    pub resets: u64,
}

/// How the thread fares; read by the diagnostics.
#[derive(Debug, Clone, Default)]
pub struct Health {
    /// Time of the last position instant, ns.
    pub time: Nanoseconds,
    /// Whether a trajectory or a stop moves the set-points.
    pub moving: bool,
    /// Whether something is asked of the axes.
    pub busy: bool,
    /// Position periods since the start.
    pub periods: u64,
    /// Periods that were released later than the next one was due.
    pub missed: u64,
    /// Frames that the ROS side did not take in time.
    pub dropped: u64,
    /// Largest lateness of a release since the start, s.
    pub max_lateness: f64,
    /// Sum of all latenesses, s.
    pub total_lateness: f64,
    /// How the stream of set-points fares.
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
    /// Position instants at which it stood outside its stroke.
    pub outside: u64,
}

/// The thread's ends of the channels.
pub struct Channels {
    /// Commands in.
    pub commands: mpsc::Receiver<Command>,
    /// Frames out; bounded.
    pub frames: mpsc::Sender<Frame>,
    /// Reports out: at most two for each accepted command.
    pub reports: mpsc::UnboundedSender<Report>,
    /// Health out.
    pub health: watch::Sender<Health>,
}

/// The next instant of the grid of `period` ns through the Unix epoch.
pub fn grid_origin(period: Nanoseconds) -> Nanoseconds {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let now = Nanoseconds::try_from(since_epoch.as_nanos()).unwrap_or(Nanoseconds::MAX / 2);
    (now.div_euclid(period) + 1) * period
}

/// Runs the simulation until it is told to shut down or the ROS side is gone.
pub fn run(mut simulation: Simulation, mode: TimeMode, mut channels: Channels) {
    let clock = PaceClock::new(&simulation);
    channels.health.send_modify(|h| h.axes = vec![AxisHealth::default(); simulation.samples().len()]);
    let mut stream = StreamLog::default();
    let mut resets = 0;
    loop {
        let lateness = match mode {
            TimeMode::Real => clock.wait_for(simulation.next_instant()),
            TimeMode::Fast | TimeMode::SimTime => {
                if !simulation.is_busy() {
                    thread::sleep(clock.period);
                }
                Duration::ZERO
            }
        };
        loop {
            match channels.commands.try_recv() {
                Ok(Command::Shutdown) | Err(mpsc::error::TryRecvError::Disconnected) => return,
                Ok(Command::Stream(setpoints)) => stream.take(&mut simulation, setpoints),
                Ok(command) => {
                    resets += u64::from(matches!(command, Command::Reset(_)));
                    obey(&mut simulation, command, &channels.reports);
                    if let Some((end, joints)) = simulation.take_stream_end() {
                        let now = simulation.time_of(simulation.next_instant() - 1);
                        let _ = channels.reports.send(Report::StreamEnded(now, end, joints));
                    }
                }
                Err(mpsc::error::TryRecvError::Empty) => break,
            }
        }
        let instant = simulation.next_instant();
        simulation.step();
        stream.watch(&simulation);
        let time = simulation.time_of(instant);
        let frame = Frame { instant, time, samples: simulation.samples().to_vec(), resets };
        let taken = match mode {
            TimeMode::Real => channels.frames.try_send(frame).is_ok(),
            TimeMode::Fast | TimeMode::SimTime => channels.frames.blocking_send(frame).is_ok(),
        };
        for end in simulation.take_ends() {
            // The receiver lives as long as the node; when it is gone, so is whoever wants to know.
            let _ = channels.reports.send(Report::Ended(end));
        }
        let missed = lateness > clock.period;
        channels.health.send_modify(|h| {
            h.update(&simulation, lateness, missed, !taken);
            h.stream = stream.health(&simulation);
        });
    }
}

fn obey(simulation: &mut Simulation, command: Command, reports: &mpsc::UnboundedSender<Report>) {
    // Between two instants, the time is that of the first.
    let now = simulation.time_of(simulation.next_instant() - 1);
    match command {
        Command::Offer { id, trajectory, tolerances } => {
            let admission = match tolerances {
                Some(tolerances) => simulation.offer_within(id, trajectory, *tolerances),
                None => simulation.offer(id, trajectory),
            };
            let decision = admission.map(|admission| Accepted {
                start: simulation.time_of(admission.start_k),
                joined_late: admission.joined_late,
            });
            let _ = reports.send(Report::Decided(id, now, decision));
        }
        Command::Cancel(id, done) => {
            let _ = done.send(simulation.cancel(id));
        }
        Command::Load { loads, hold } => {
            for (axis, load) in loads {
                simulation.set_load(axis, load, hold);
            }
        }
        Command::Adopt(parameters) => {
            if let Err(error) = simulation.adopt(parameters) {
                warn!("changed parameters could not be taken over: {error}");
            }
        }
        Command::Reset(done) => {
            info!("reset: at rest at home");
            simulation.reset();
            let _ = done.send(());
        }
        // Taken care of by the loop.
        Command::Stream(_) | Command::Shutdown => {}
    }
}

impl Health {
    fn update(&mut self, simulation: &Simulation, lateness: Duration, missed: bool, dropped: bool) {
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
            axis.outside += u64::from(simulation.is_outside_stroke(place));
            axis.saturated += u64::from(sample.saturated);
            axis.extrapolated += u64::from(sample.friction_extrapolated);
        }
    }
}

/// The wall clock as position instants.
struct PaceClock {
    /// When instant 0 is due.
    start: Instant,
    period: Duration,
}

impl PaceClock {
    fn new(simulation: &Simulation) -> Self {
        let now_unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let origin = Duration::from_nanos(u64::try_from(simulation.time_of(0)).unwrap_or(0));
        let start = Instant::now() + origin.saturating_sub(now_unix);
        let period = Duration::from_nanos(u64::try_from(simulation.period()).unwrap_or(1));
        PaceClock { start, period }
    }

    /// Sleeps until instant `k` is due, and says how late it has become.
    fn wait_for(&self, k: i64) -> Duration {
        let nanoseconds = self.period.as_nanos() * u128::try_from(k).unwrap_or(0);
        let due = self.start + Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX));
        let now = Instant::now();
        if now < due {
            thread::sleep(due - now);
        }
        Instant::now().saturating_duration_since(due)
    }
}
