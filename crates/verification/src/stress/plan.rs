//! A trajectory at random: which machine, from where, what it is asked for and what loads it meets.

use super::curve::{self, Point};
use super::fleet::Fleet;
use super::random::Random;
use super::shape::{Reach, extent};
use virtual_axes_core::trajectory::{Rejection, Request, Row, Start};
use virtual_axes_core::units::Nanoseconds;

/// Kinds of trajectories.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// From rest to rest within velocity, acceleration and jerk, a setpoint in each position period.
    Move,
    /// Several points with velocities: cubic polynomials.
    Cubic,
    /// Several points with velocities and accelerations: quintic polynomials.
    Quintic,
    /// A random walk within velocity and acceleration.
    Walk,
    /// Streamed setpoints whose velocity goes in steps.
    Stream,
    /// A random walk that is stopped on its way.
    Stop,
    /// At rest under loads.
    Hold,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 7] =
        [Kind::Move, Kind::Cubic, Kind::Quintic, Kind::Walk, Kind::Stream, Kind::Stop, Kind::Hold];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Move => "move",
            Kind::Cubic => "cubic",
            Kind::Quintic => "quintic",
            Kind::Walk => "walk",
            Kind::Stream => "stream",
            Kind::Stop => "stop",
            Kind::Hold => "hold",
        }
    }
}

/// How often each kind comes, in the order of [`Kind::ALL`].
const SHARES: [f64; 7] = [0.25, 0.15, 0.15, 0.2, 0.12, 0.08, 0.05];
/// Ticks that the lengths of trajectories are drawn in.
const UNIT_TICKS: usize = 768;
/// Fewest position periods of motion.
const FEWEST: usize = 6;
/// How often acceleration and jerk are beyond what the machine file allows, which only the motor minds.
const SHARP: f64 = 0.1;
/// How far beyond.
const SHARPER: f64 = 8.0;
/// How often an axis moves.
const MOVES: f64 = 0.5;
/// How often there are loads on something that moves.
const LOADED: f64 = 0.35;
/// How often a load may be larger than the motor.
const OVERLOADED: f64 = 0.05;

/// A load that acts for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Position period from which on it acts.
    pub at: usize,
    /// Place of the axis.
    pub axis: usize,
    /// N or N·m.
    pub value: f64,
    /// For how many position periods.
    pub periods: usize,
}

/// What a trajectory asks for.
#[derive(Debug, Clone)]
pub enum Ask {
    /// A trajectory.
    Follow(Request),
    /// One that is stopped before this position period.
    Stop(Request, usize),
    /// Of each axis that moves its place and a position for each position period, m or rad; the last one holds.
    Stream(Vec<(usize, Vec<f64>)>),
    /// Nothing.
    Rest,
}

/// A trajectory at random.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Its number.
    pub number: u64,
    /// Place of its machine in the fleet.
    pub variant: usize,
    /// Its kind.
    pub kind: Kind,
    /// Where the axes are at rest at first, m or rad.
    pub start: Vec<f64>,
    /// What is asked for.
    pub ask: Ask,
    /// Loads, the earliest first.
    pub loads: Vec<Load>,
    /// Position periods that are run.
    pub periods: usize,
}

impl Plan {
    /// Trajectory `number` of those of `seed`.
    ///
    /// # Errors
    /// [`Rejection`] if the library does not take its points.
    pub fn new(fleet: &Fleet, seed: u64, number: u64) -> Result<Self, Rejection> {
        let mut random = Random::new(seed, number);
        let place = random.below(fleet.variants().len());
        let variant = &fleet.variants()[place];
        let kind = drawn(&mut random);
        let unit = UNIT_TICKS / variant.ticks();
        let moving = FEWEST + random.below(unit * 5 / 4);
        let horizon = variant.axes.iter().map(|axis| axis.ahead).max().unwrap_or(0);
        let settling = 3 + random.below(unit / 2) + if kind == Kind::Stream { horizon } else { 0 };
        // What a move is rounded up to, and what its setpoints are delayed by.
        let periods = (moving + settling + 4).min(variant.longest());
        let sharper = if random.chance(SHARP) { random.between(1.0, SHARPER) } else { 1.0 };
        let count = variant.joints.len();
        let mut moves: Vec<bool> = (0..count).map(|_| random.chance(MOVES)).collect();
        let one = random.below(count);
        moves[one] = true;
        let reach = |axis: usize| Reach::new(&variant.joints[axis].limits, variant.period(), sharper);
        let mut start: Vec<f64> = (0..count).map(|axis| reach(axis).start(&mut random, 0.0, 0.0)).collect();
        let axes: Vec<usize> = (0..count).filter(|&axis| moves[axis]).collect();
        let names = axes.iter().map(|&axis| variant.joints[axis].name.clone()).collect();
        let request = Request::new(Start::Now, names);
        let rows = |random: &mut Random, start: &mut [f64], of: &dyn Fn(&Reach, &mut Random) -> Vec<f64>| {
            let column = |&axis: &usize| {
                let reach = reach(axis);
                let way = of(&reach, random);
                let (low, high) = extent(&way);
                start[axis] = reach.start(random, low, high);
                way.into_iter().map(|value| start[axis] + value).collect::<Vec<f64>>()
            };
            axes.iter().map(column).collect::<Vec<_>>()
        };
        let period = variant.period();
        let ask = match kind {
            Kind::Move => {
                let columns =
                    rows(&mut random, &mut start, &|reach, random| reach.rest_to_rest(random, moving));
                Ask::Follow(gridded(request, &columns, period)?)
            }
            Kind::Walk => {
                let columns = rows(&mut random, &mut start, &|reach, random| reach.walk(random, moving));
                Ask::Follow(gridded(request, &columns, period)?)
            }
            Kind::Stop => {
                let columns = rows(&mut random, &mut start, &|reach, random| reach.walk(random, moving));
                Ask::Stop(gridded(request, &columns, period)?, 1 + random.below(moving))
            }
            Kind::Stream => {
                let columns = rows(&mut random, &mut start, &|reach, random| reach.steps(random, moving));
                Ask::Stream(axes.iter().copied().zip(columns).collect())
            }
            Kind::Cubic | Kind::Quintic => {
                let degree = if kind == Kind::Cubic { 3 } else { 5 };
                let times = times(&mut random, moving as Nanoseconds * period);
                let mut columns = Vec::new();
                for &axis in &axes {
                    let reach = reach(axis);
                    let points = curve::points(&mut random, &reach, &times, degree);
                    let (low, high) = curve::hull(&points, &times, degree);
                    start[axis] = reach.start(&mut random, low, high);
                    columns.push((start[axis], points));
                }
                Ask::Follow(pointed(request, &times, &columns, degree)?)
            }
            Kind::Hold => Ask::Rest,
        };
        let loads = if kind == Kind::Hold || random.chance(LOADED) {
            let efforts: Vec<f64> = variant.config.axes().iter().map(|axis| axis.largest_effort()).collect();
            loads(&mut random, &efforts, periods)
        } else {
            Vec::new()
        };
        Ok(Plan { number, variant: place, kind, start, ask, loads, periods })
    }
}

fn drawn(random: &mut Random) -> Kind {
    let mut left = random.unit();
    for (kind, share) in Kind::ALL.into_iter().zip(SHARES) {
        if left < share {
            return kind;
        }
        left -= share;
    }
    Kind::Move
}

/// Times of two to six points within `duration`, ns, on no grid.
fn times(random: &mut Random, duration: Nanoseconds) -> Vec<Nanoseconds> {
    let segments = 1 + random.below(5);
    let share = duration / segments as Nanoseconds;
    let mut times = vec![0];
    for segment in 0..segments as Nanoseconds {
        // Each at least half as long as the others.
        let within = share / 2 + (share / 2) as Nanoseconds * random.below(1000) as Nanoseconds / 1000;
        times.push(segment * share + within.max(1));
    }
    times
}

/// A setpoint of each column in each position period.
fn gridded(mut request: Request, columns: &[Vec<f64>], period: Nanoseconds) -> Result<Request, Rejection> {
    let points = columns.iter().map(Vec::len).max().unwrap_or(0);
    let mut positions = vec![0.0; columns.len()];
    for k in 0..points {
        for (position, column) in positions.iter_mut().zip(columns) {
            *position = column[k.min(column.len() - 1)];
        }
        request.push(k as Nanoseconds * period, Row { positions: &positions, ..Row::default() })?;
    }
    Ok(request)
}

/// Points at `times`; each column begins at its start.
fn pointed(
    mut request: Request,
    times: &[Nanoseconds],
    columns: &[(f64, Vec<Point>)],
    degree: usize,
) -> Result<Request, Rejection> {
    for (k, &time) in times.iter().enumerate() {
        let field = |which: usize| columns.iter().map(move |(_, points)| points[k][which]);
        let positions: Vec<f64> = columns.iter().zip(field(0)).map(|((start, _), way)| start + way).collect();
        let velocities: Vec<f64> = field(1).collect();
        let accelerations: Vec<f64> = if degree == 5 { field(2).collect() } else { Vec::new() };
        request.push(
            time,
            Row {
                positions: &positions,
                velocities: &velocities,
                accelerations: &accelerations,
                effort: &[],
            },
        )?;
    }
    Ok(request)
}

/// One to three steps of load on any axes, most of them small against `efforts`.
fn loads(random: &mut Random, efforts: &[f64], periods: usize) -> Vec<Load> {
    let largest = if random.chance(OVERLOADED) { 1.5 } else { 0.5 };
    let mut loads: Vec<Load> = (0..1 + random.below(3))
        .map(|_| {
            let axis = random.below(efforts.len());
            let part = random.unit();
            Load {
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
