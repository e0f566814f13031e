//! Hands setpoints to the simulation as trajectories, shortly before they are due.

use std::sync::Arc;

use crate::simulation::Simulation;
use crate::trajectory::{Context, JointLimits, MotionId, Rejection, Request, Row, Start, Trajectory};
use crate::units::{Nanoseconds, SECOND_NS, seconds};

use super::setpoints::{GridSource, Requests, Setpoints};
use super::{Trial, TrialError};

/// Setpoints of one trajectory of a grid: few enough to cost no memory, many enough to cost no time.
const CHUNK: usize = 512;
/// Instants before its start at which a chunk is handed over: more than any controller looks ahead.
const LEAD: i64 = 256;
/// How far ahead of its arrival a trajectory may start, ns: beyond, its stamp is of another clock.
const LONGEST_WAIT: Nanoseconds = 86_400 * SECOND_NS;

/// What is still to be handed over.
pub(super) struct Supply<'a> {
    limits: Vec<JointLimits>,
    period: Nanoseconds,
    allow_nonzero_end_velocity: bool,
    source: Source<'a>,
    start: Option<Vec<f64>>,
    sent: u64,
}

enum Source<'a> {
    Grid {
        source: Box<dyn GridSource + 'a>,
        names: Vec<String>,
        /// Instant of the next row.
        next: i64,
        /// The row of `next`; none behind the last one.
        row: Option<Vec<f64>>,
    },
    Requests {
        requests: Box<Requests<'a>>,
        /// The next one, with its time from the start.
        pending: Option<(Nanoseconds, Request)>,
        /// Arrival of the first, ns.
        origin: Nanoseconds,
    },
}

impl<'a> Supply<'a> {
    pub(super) fn new(
        setpoints: Setpoints<'a>,
        limits: &[JointLimits],
        trial: &Trial<'_>,
    ) -> Result<Self, TrialError> {
        let (source, start) = match setpoints {
            Setpoints::Grid(mut source) => {
                let places = source.joints().to_vec();
                let mut row = vec![0.0; places.len()];
                let given = source.next(&mut row).map_err(TrialError::Source)?;
                let mut start = vec![0.0; limits.len()];
                for (&place, &value) in places.iter().zip(&row) {
                    if let Some(joint) = start.get_mut(place) {
                        *joint = value;
                    }
                }
                let names = places.iter().filter_map(|&p| limits.get(p)).map(|j| j.name.clone()).collect();
                (Source::Grid { source, names, next: 0, row: given.then_some(row) }, given.then_some(start))
            }
            Setpoints::Requests(mut requests) => {
                let first = requests.next().transpose().map_err(TrialError::Source)?;
                let start = first.as_ref().and_then(|(_, request)| start_of(request, limits));
                let origin = first.as_ref().map_or(0, |(time, _)| *time);
                let pending = first.map(|(_, request)| (0, shifted(request, origin)));
                (Source::Requests { requests, pending, origin }, start)
            }
        };
        Ok(Supply {
            limits: limits.to_vec(),
            period: trial.machine.periods().position,
            allow_nonzero_end_velocity: trial.allow_nonzero_end_velocity,
            source,
            start,
            sent: 0,
        })
    }

    /// Where the first setpoints are at time 0, m or rad for each joint; none if they are later.
    pub(super) fn start(&self) -> Option<&[f64]> {
        self.start.as_deref()
    }

    /// Whether everything has been handed over.
    pub(super) fn is_empty(&self) -> bool {
        match &self.source {
            Source::Grid { row, .. } => row.is_none(),
            Source::Requests { pending, .. } => pending.is_none(),
        }
    }

    /// Hands over what is due at the next instant.
    pub(super) fn offer_due(&mut self, simulation: &mut Simulation) -> Result<(), TrialError> {
        loop {
            let now = simulation.next_instant();
            let time = simulation.time_of(now);
            let (due, request) = match &mut self.source {
                Source::Grid { source, names, next, row } => {
                    if row.is_none() || *next > now + LEAD {
                        return Ok(());
                    }
                    let first = *next;
                    let request = chunk(source.as_mut(), names, next, row, self.period)?;
                    (first * self.period, request)
                }
                Source::Requests { requests, pending, origin } => {
                    let Some((due, request)) = pending.take_if(|(due, _)| *due <= time) else {
                        return Ok(());
                    };
                    let next = requests.next().transpose().map_err(TrialError::Source)?;
                    *pending =
                        next.map(|(at, request)| (at.saturating_sub(*origin), shifted(request, *origin)));
                    check_wait(&request, due)?;
                    (due, request)
                }
            };
            self.offer(simulation, request, due)?;
        }
    }

    fn offer(
        &mut self,
        simulation: &mut Simulation,
        request: Request,
        due: Nanoseconds,
    ) -> Result<(), TrialError> {
        let context = Context {
            joints: &self.limits,
            period: self.period,
            max_points: usize::MAX,
            allow_nonzero_end_velocity: self.allow_nonzero_end_velocity,
        };
        let rejected = |rejection| TrialError::Rejected { time: seconds(due), rejection };
        let trajectory = Arc::new(Trajectory::new(request, &context).map_err(rejected)?);
        self.sent += 1;
        simulation.offer(MotionId(self.sent), trajectory).map_err(rejected)?;
        Ok(())
    }
}

/// The next rows of a grid as a trajectory that starts at the instant of the first.
fn chunk(
    source: &mut dyn GridSource,
    names: &[String],
    next: &mut i64,
    row: &mut Option<Vec<f64>>,
    period: Nanoseconds,
) -> Result<Request, TrialError> {
    let first = *next;
    let mut request = Request::new(Start::At(first * period), names.to_vec());
    request.reserve(CHUNK);
    while let Some(positions) = row
        && *next - first < CHUNK as i64
    {
        let time = *next * period;
        request
            .push(time - first * period, Row { positions, ..Row::default() })
            .map_err(|rejection| TrialError::Rejected { time: seconds(time), rejection })?;
        *next += 1;
        if !source.next(positions).map_err(TrialError::Source)? {
            *row = None;
        }
    }
    Ok(request)
}

/// Stamps of one clock as times from `origin`.
fn shifted(request: Request, origin: Nanoseconds) -> Request {
    match request.start() {
        Start::Now => request,
        Start::At(stamp) => request.starting(Start::At(stamp.saturating_sub(origin))),
    }
}

/// Positions of the first point, if that is at time 0; joints that it does not name are at home.
fn start_of(request: &Request, limits: &[JointLimits]) -> Option<Vec<f64>> {
    let (time, positions) = request.first_point()?;
    if time != 0 {
        return None;
    }
    let mut start = vec![0.0; limits.len()];
    for (column, &position) in positions.iter().enumerate() {
        let place = match request.joints().get(column) {
            Some(name) => limits.iter().position(|joint| joint.name == *name)?,
            None => column,
        };
        *start.get_mut(place)? = position;
    }
    Some(start)
}

/// Refuses a stamp that nobody would wait for.
fn check_wait(request: &Request, due: Nanoseconds) -> Result<(), TrialError> {
    let Start::At(stamp) = request.start() else { return Ok(()) };
    let wait = stamp.saturating_sub(due);
    if wait <= LONGEST_WAIT {
        return Ok(());
    }
    let (found, limit) = (seconds(wait), seconds(LONGEST_WAIT));
    let rejection = Rejection::new(
        crate::trajectory::Code::InvalidTime,
        format!("the trajectory starts {found} s after it arrives; {limit} s are allowed"),
    );
    Err(TrialError::Rejected { time: seconds(due), rejection: rejection.numbers(found, limit) })
}
