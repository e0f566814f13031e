//! Submission of setpoints to the simulation as trajectories, shortly before they are due.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::simulation::Simulation;
use crate::trajectory::{
    JointLimits, MotionId, Rejection, Start, Trajectory, TrajectoryPoint, TrajectoryRequest,
    ValidationContext,
};
use crate::units::{Nanoseconds, SECOND_NS, seconds};

use super::definition::{Trial, TrialError};
use super::setpoints::{GridSource, Requests, SetpointSource};

/// Number of setpoints per trajectory of a grid: few enough for memory, many enough for speed.
const CHUNK: usize = 512;
/// Position cycles before its start at which a trajectory is submitted: more than the preview of any
/// controller.
const LEAD: i64 = 256;
/// Number of rows that are kept as rapid traverse or feed: those submitted before they are due, and a chunk.
const KEPT: usize = 2048;
/// Longest time between arrival and start of a trajectory, ns; a later stamp belongs to another clock.
const LONGEST_WAIT: Nanoseconds = 86_400 * SECOND_NS;

/// Submitter of the remaining setpoints of a trial.
pub(super) struct TrajectorySubmitter<'a> {
    limits: Vec<JointLimits>,
    period: Nanoseconds,
    allow_nonzero_end_velocity: bool,
    source: PendingSource<'a>,
    start: Option<Vec<f64>>,
    sent: u64,
    /// True for each of the last rows that is reached at rapid traverse.
    rapid: VecDeque<bool>,
    /// Instant of the first row in `rapid`.
    first_rapid: i64,
}

enum PendingSource<'a> {
    Grid {
        source: Box<dyn GridSource + 'a>,
        names: Vec<String>,
        /// Instant of the next row.
        next: i64,
        /// Row at `next`; `None` after the last one.
        row: Option<Vec<f64>>,
    },
    Requests {
        requests: Box<Requests<'a>>,
        /// Next trajectory with its arrival time from the start, ns.
        pending: Option<(Nanoseconds, TrajectoryRequest)>,
        /// Arrival time of the first trajectory, ns.
        origin: Nanoseconds,
    },
}

impl<'a> TrajectorySubmitter<'a> {
    pub(super) fn new(
        setpoints: SetpointSource<'a>,
        limits: &[JointLimits],
        trial: &Trial<'_>,
    ) -> Result<Self, TrialError> {
        let mut rapid = VecDeque::new();
        let (source, start) = match setpoints {
            SetpointSource::Grid(mut source) => {
                let indices = source.joints().to_vec();
                let mut row = vec![0.0; indices.len()];
                let given = source.next(&mut row).map_err(TrialError::Source)?;
                rapid.push_back(source.is_rapid());
                let mut start = vec![0.0; limits.len()];
                for (&index, &value) in indices.iter().zip(&row) {
                    if let Some(joint) = start.get_mut(index) {
                        *joint = value;
                    }
                }
                let names = indices.iter().filter_map(|&p| limits.get(p)).map(|j| j.name.clone()).collect();
                (
                    PendingSource::Grid { source, names, next: 0, row: given.then_some(row) },
                    given.then_some(start),
                )
            }
            SetpointSource::Requests(mut requests) => {
                let first = requests.next().transpose().map_err(TrialError::Source)?;
                let start = first.as_ref().and_then(|(_, request)| start_of(request, limits));
                let origin = first.as_ref().map_or(0, |(time, _)| *time);
                let pending = first.map(|(_, request)| (0, shifted(request, origin)));
                (PendingSource::Requests { requests, pending, origin }, start)
            }
        };
        Ok(TrajectorySubmitter {
            limits: limits.to_vec(),
            period: trial.machine.periods().position,
            allow_nonzero_end_velocity: trial.allow_nonzero_end_velocity,
            source,
            start,
            sent: 0,
            rapid,
            first_rapid: 0,
        })
    }

    /// Returns true if the setpoints at an instant are reached at rapid traverse; those after the last ones as those.
    pub(super) fn is_rapid(&self, instant: i64) -> bool {
        let index = usize::try_from(instant - self.first_rapid).unwrap_or(0);
        self.rapid.get(index).or(self.rapid.back()).is_some_and(|is_rapid| *is_rapid)
    }

    /// Returns the setpoints at time 0, m or rad per joint, or `None` if the first ones are later.
    pub(super) fn start(&self) -> Option<&[f64]> {
        self.start.as_deref()
    }

    /// Returns true if all setpoints have been submitted.
    pub(super) fn is_empty(&self) -> bool {
        match &self.source {
            PendingSource::Grid { row, .. } => row.is_none(),
            PendingSource::Requests { pending, .. } => pending.is_none(),
        }
    }

    /// Submits the trajectories that are due at the next instant.
    pub(super) fn submit_due(&mut self, simulation: &mut Simulation) -> Result<(), TrialError> {
        loop {
            let now = simulation.next_instant();
            let time = simulation.time_of(now);
            let (due, request) = match &mut self.source {
                PendingSource::Grid { source, names, next, row } => {
                    if row.is_none() || *next > now + LEAD {
                        return Ok(());
                    }
                    let first = *next;
                    let rapid = &mut self.rapid;
                    let request = chunk(source.as_mut(), names, next, row, self.period, |is_rapid| {
                        rapid.push_back(is_rapid);
                    })?;
                    let passed = rapid.len().saturating_sub(KEPT);
                    rapid.drain(..passed);
                    self.first_rapid += passed as i64;
                    (first * self.period, request)
                }
                PendingSource::Requests { requests, pending, origin } => {
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
            self.submit(simulation, request, due)?;
        }
    }

    fn submit(
        &mut self,
        simulation: &mut Simulation,
        request: TrajectoryRequest,
        due: Nanoseconds,
    ) -> Result<(), TrialError> {
        let context = ValidationContext {
            joints: &self.limits,
            period: self.period,
            max_points: usize::MAX,
            allow_nonzero_end_velocity: self.allow_nonzero_end_velocity,
        };
        let start = match request.start() {
            Start::Now => due,
            Start::At(stamp) => stamp.max(due),
        };
        let before = match &self.source {
            PendingSource::Grid { .. } => usize::try_from(due / self.period).unwrap_or(0),
            PendingSource::Requests { .. } => 0,
        };
        let times: Vec<Nanoseconds> =
            (0..request.points()).filter_map(|index| request.point(index)).map(|(time, _)| time).collect();
        let rejected = |rejection: Rejection| {
            let offset = rejection.index.and_then(|index| times.get(index)).copied().unwrap_or(0);
            let time = seconds(start.saturating_add(offset));
            TrialError::Rejected { time, rejection: rejection.behind(before) }
        };
        let trajectory = Arc::new(Trajectory::new(request, &context).map_err(rejected)?);
        self.sent += 1;
        simulation.submit(MotionId(self.sent), trajectory).map_err(rejected)?;
        Ok(())
    }
}

/// Returns the next rows of a grid as a trajectory that starts at the instant of the first row. `on_row` receives true for
/// each row read that is reached at rapid traverse.
fn chunk(
    source: &mut dyn GridSource,
    names: &[String],
    next: &mut i64,
    row: &mut Option<Vec<f64>>,
    period: Nanoseconds,
    mut on_row: impl FnMut(bool),
) -> Result<TrajectoryRequest, TrialError> {
    let first = *next;
    let mut request = TrajectoryRequest::new(Start::At(first * period), names.to_vec());
    request.reserve(CHUNK);
    while let Some(positions) = row
        && *next - first < CHUNK as i64
    {
        let time = *next * period;
        request
            .push(time - first * period, TrajectoryPoint { positions, ..TrajectoryPoint::default() })
            .map_err(|rejection| TrialError::Rejected { time: seconds(time), rejection })?;
        *next += 1;
        if !source.next(positions).map_err(TrialError::Source)? {
            *row = None;
        } else {
            on_row(source.is_rapid());
        }
    }
    Ok(request)
}

/// Shifts an absolute start time to time from `origin`.
fn shifted(request: TrajectoryRequest, origin: Nanoseconds) -> TrajectoryRequest {
    match request.start() {
        Start::Now => request,
        Start::At(stamp) => request.with_start(Start::At(stamp.saturating_sub(origin))),
    }
}

/// Returns the positions of the first point if its time is 0; joints that it does not name are at home.
fn start_of(request: &TrajectoryRequest, limits: &[JointLimits]) -> Option<Vec<f64>> {
    let (time, positions) = request.first_point()?;
    if time != 0 {
        return None;
    }
    let mut start = vec![0.0; limits.len()];
    for (column, &position) in positions.iter().enumerate() {
        let index = match request.joints().get(column) {
            Some(name) => limits.iter().position(|joint| joint.name == *name)?,
            None => column,
        };
        *start.get_mut(index)? = position;
    }
    Some(start)
}

/// Rejects a start time too far in the future.
fn check_wait(request: &TrajectoryRequest, due: Nanoseconds) -> Result<(), TrialError> {
    let Start::At(stamp) = request.start() else { return Ok(()) };
    let wait = stamp.saturating_sub(due);
    if wait <= LONGEST_WAIT {
        return Ok(());
    }
    let (found, limit) = (seconds(wait), seconds(LONGEST_WAIT));
    let rejection = Rejection::new(
        crate::trajectory::RejectionCode::InvalidTime,
        format!("the trajectory starts {found} s after it arrives; {limit} s are allowed"),
    );
    Err(TrialError::Rejected { time: seconds(due), rejection: rejection.numbers(found, limit) })
}
