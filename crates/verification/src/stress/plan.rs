//! Random trajectory: machine variant, start, commands and loads.

use super::curve::{self, CurvePoint};
use super::shape::{MotionLimits, extent};
use super::test_machines::TestMachines;
use crate::random::RandomSource;
use virtual_axes_core::named_values;
use virtual_axes_core::trajectory::{Rejection, Start, TrajectoryPoint, TrajectoryRequest};
use virtual_axes_core::units::Nanoseconds;

named_values! {
    /// Kind of a random trajectory.
    #[derive(PartialOrd, Ord)]
    pub enum TrajectoryKind {
        /// Rest-to-rest motion within velocity, acceleration and jerk limits, one setpoint per position cycle.
        Move = "move",
        /// Points with velocities, interpolated by cubic polynomials.
        Cubic = "cubic",
        /// Points with velocities and accelerations, interpolated by quintic polynomials.
        Quintic = "quintic",
        /// Random walk within velocity and acceleration limits.
        Walk = "walk",
        /// Streamed setpoints with stepwise constant velocity.
        Stream = "stream",
        /// Random walk with a controlled stop.
        Stop = "stop",
        /// Standstill under loads.
        Hold = "hold",
    }
}

/// Probability of each kind, in the order of [`TrajectoryKind::ALL`].
const SHARES: [f64; 7] = [0.25, 0.15, 0.15, 0.2, 0.12, 0.08, 0.05];
/// Unit of the length of trajectories, ticks.
const UNIT_TICKS: usize = 768;
/// Smallest number of position cycles of motion.
const MIN_PERIODS: usize = 6;
/// Probability that acceleration and jerk exceed the limits of the machine file, so that the motor saturates.
const EXCESS_PROBABILITY: f64 = 0.1;
/// Largest factor of this excess.
const MAX_EXCESS: f64 = 8.0;
/// Probability that an axis moves.
const MOVE_PROBABILITY: f64 = 0.5;
/// Probability of loads during motion.
const LOAD_PROBABILITY: f64 = 0.35;
/// Probability that a load may exceed the motor torque.
const OVERLOAD_PROBABILITY: f64 = 0.05;

/// LoadStep on an axis for a number of position cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoadStep {
    /// First position cycle.
    pub at: usize,
    /// Index of the axis.
    pub axis: usize,
    /// LoadStep, N or N·m.
    pub value: f64,
    /// Duration, position cycles.
    pub periods: usize,
}

/// Commands of a random trajectory.
#[derive(Debug, Clone)]
pub enum TestCommand {
    /// Trajectory that is followed to its end.
    Follow(TrajectoryRequest),
    /// Trajectory with a controlled stop before this position cycle.
    Stop(TrajectoryRequest, usize),
    /// Streamed setpoints: axis index and one position per position cycle, m or rad; the last one is held.
    Stream(Vec<(usize, Vec<f64>)>),
    /// No command.
    Rest,
}

/// Random trajectory with its machine, start and loads.
#[derive(Debug, Clone)]
pub struct TestPlan {
    /// Number of the trajectory.
    pub number: u64,
    /// Index of the machine variant.
    pub variant: usize,
    /// Kind of the trajectory.
    pub kind: TrajectoryKind,
    /// Initial positions of the axes at rest, m or rad.
    pub start: Vec<f64>,
    /// Commands.
    pub command: TestCommand,
    /// Loads, sorted by their first position cycle.
    pub loads: Vec<LoadStep>,
    /// Simulated position cycles.
    pub periods: usize,
}

impl TestPlan {
    /// Creates trajectory `number` of `seed`.
    ///
    /// # Errors
    /// [`Rejection`] if the library rejects its points.
    pub fn new(machines: &TestMachines, seed: u64, number: u64) -> Result<Self, Rejection> {
        let mut random = RandomSource::new(seed, number);
        let index = random.below(machines.variants().len());
        let variant = &machines.variants()[index];
        let kind = draw_kind(&mut random);
        let unit = UNIT_TICKS / variant.ticks();
        let moving = MIN_PERIODS + random.below(unit * 5 / 4);
        let longest_preview = variant.axes.iter().map(|axis| axis.preview).max().unwrap_or(0);
        let settling =
            3 + random.below(unit / 2) + if kind == TrajectoryKind::Stream { longest_preview } else { 0 };
        // Rounding of the duration and delay of the setpoints.
        let periods = (moving + settling + 4).min(variant.longest());
        let excess = if random.chance(EXCESS_PROBABILITY) { random.between(1.0, MAX_EXCESS) } else { 1.0 };
        let count = variant.joints.len();
        let mut moves: Vec<bool> = (0..count).map(|_| random.chance(MOVE_PROBABILITY)).collect();
        let one = random.below(count);
        moves[one] = true;
        let limits = |axis: usize| MotionLimits::new(&variant.joints[axis].limits, variant.period(), excess);
        let mut start: Vec<f64> = (0..count).map(|axis| limits(axis).start(&mut random, 0.0, 0.0)).collect();
        let axes: Vec<usize> = (0..count).filter(|&axis| moves[axis]).collect();
        let names = axes.iter().map(|&axis| variant.joints[axis].name.clone()).collect();
        let request = TrajectoryRequest::new(Start::Now, names);
        let rows = |random: &mut RandomSource,
                    start: &mut [f64],
                    of: &dyn Fn(&MotionLimits, &mut RandomSource) -> Vec<f64>| {
            let column = |&axis: &usize| {
                let limits = limits(axis);
                let displacements = of(&limits, random);
                let (low, high) = extent(&displacements);
                start[axis] = limits.start(random, low, high);
                displacements.into_iter().map(|value| start[axis] + value).collect::<Vec<f64>>()
            };
            axes.iter().map(column).collect::<Vec<_>>()
        };
        let period = variant.period();
        let command = match kind {
            TrajectoryKind::Move => {
                let columns =
                    rows(&mut random, &mut start, &|limits, random| limits.rest_to_rest(random, moving));
                TestCommand::Follow(gridded(request, &columns, period)?)
            }
            TrajectoryKind::Walk => {
                let columns = rows(&mut random, &mut start, &|limits, random| limits.walk(random, moving));
                TestCommand::Follow(gridded(request, &columns, period)?)
            }
            TrajectoryKind::Stop => {
                let columns = rows(&mut random, &mut start, &|limits, random| limits.walk(random, moving));
                TestCommand::Stop(gridded(request, &columns, period)?, 1 + random.below(moving))
            }
            TrajectoryKind::Stream => {
                let columns = rows(&mut random, &mut start, &|limits, random| limits.steps(random, moving));
                TestCommand::Stream(axes.iter().copied().zip(columns).collect())
            }
            TrajectoryKind::Cubic | TrajectoryKind::Quintic => {
                let degree = if kind == TrajectoryKind::Cubic { 3 } else { 5 };
                let times = times(&mut random, moving as Nanoseconds * period);
                let mut columns = Vec::new();
                for &axis in &axes {
                    let limits = limits(axis);
                    let points = curve::points(&mut random, &limits, &times, degree);
                    let (low, high) = curve::hull(&points, &times, degree);
                    start[axis] = limits.start(&mut random, low, high);
                    columns.push((start[axis], points));
                }
                TestCommand::Follow(pointed(request, &times, &columns, degree)?)
            }
            TrajectoryKind::Hold => TestCommand::Rest,
        };
        let loads = if kind == TrajectoryKind::Hold || random.chance(LOAD_PROBABILITY) {
            let efforts: Vec<f64> = variant.config.axes().iter().map(|axis| axis.max_effort()).collect();
            loads(&mut random, &efforts, periods)
        } else {
            Vec::new()
        };
        Ok(TestPlan { number, variant: index, kind, start, command, loads, periods })
    }
}

fn draw_kind(random: &mut RandomSource) -> TrajectoryKind {
    let mut left = random.unit();
    for (kind, share) in TrajectoryKind::ALL.into_iter().zip(SHARES) {
        if left < share {
            return kind;
        }
        left -= share;
    }
    TrajectoryKind::Move
}

/// Draws the times of two to six points within `duration`, ns, independent of the position cycle.
fn times(random: &mut RandomSource, duration: Nanoseconds) -> Vec<Nanoseconds> {
    let segments = 1 + random.below(5);
    let share = duration / segments as Nanoseconds;
    let mut times = vec![0];
    for segment in 0..segments as Nanoseconds {
        // Each segment is at least half as long as the others.
        let within = share / 2 + (share / 2) as Nanoseconds * random.below(1000) as Nanoseconds / 1000;
        times.push(segment * share + within.max(1));
    }
    times
}

/// Adds one point per position cycle with a position of each column.
fn gridded(
    mut request: TrajectoryRequest,
    columns: &[Vec<f64>],
    period: Nanoseconds,
) -> Result<TrajectoryRequest, Rejection> {
    let points = columns.iter().map(Vec::len).max().unwrap_or(0);
    let mut positions = vec![0.0; columns.len()];
    for k in 0..points {
        for (position, column) in positions.iter_mut().zip(columns) {
            *position = column[k.min(column.len() - 1)];
        }
        request.push(
            k as Nanoseconds * period,
            TrajectoryPoint { positions: &positions, ..TrajectoryPoint::default() },
        )?;
    }
    Ok(request)
}

/// Adds points at `times`; each column is relative to its start.
fn pointed(
    mut request: TrajectoryRequest,
    times: &[Nanoseconds],
    columns: &[(f64, Vec<CurvePoint>)],
    degree: usize,
) -> Result<TrajectoryRequest, Rejection> {
    for (k, &time) in times.iter().enumerate() {
        let field = |which: usize| columns.iter().map(move |(_, points)| points[k][which]);
        let positions: Vec<f64> =
            columns.iter().zip(field(0)).map(|((start, _), displacements)| start + displacements).collect();
        let velocities: Vec<f64> = field(1).collect();
        let accelerations: Vec<f64> = if degree == 5 { field(2).collect() } else { Vec::new() };
        request.push(
            time,
            TrajectoryPoint {
                positions: &positions,
                velocities: &velocities,
                accelerations: &accelerations,
                effort: &[],
            },
        )?;
    }
    Ok(request)
}

/// Draws one to three load steps on random axes, most of them small relative to `efforts`.
fn loads(random: &mut RandomSource, efforts: &[f64], periods: usize) -> Vec<LoadStep> {
    let largest = if random.chance(OVERLOAD_PROBABILITY) { 1.5 } else { 0.5 };
    let mut loads: Vec<LoadStep> = (0..1 + random.below(3))
        .map(|_| {
            let axis = random.below(efforts.len());
            let part = random.unit();
            LoadStep {
                at: random.below(periods),
                axis,
                value: random.sign() * largest * part * part * efforts[axis],
                periods: 1 + random.below(periods),
            }
        })
        .collect();
    loads.sort_by_key(|load| load.at);
    loads
}
