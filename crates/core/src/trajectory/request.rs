//! Trajectory request: joints and points before validation against a machine.

use super::rejection::{Rejection, RejectionCode};
use super::spline::SplineDegree;
use crate::units::{Nanoseconds, Rounded, seconds};

/// Start of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// Start at the next position cycle (stamp 0).
    Now,
    /// Start at an absolute time, ns, rounded up to a position cycle.
    At(Nanoseconds),
}

/// Values of one point; an empty slice is a field that is not given.
#[derive(Debug, Clone, Copy, Default)]
pub struct TrajectoryPoint<'a> {
    /// Positions, m or rad, one per joint.
    pub positions: &'a [f64],
    /// Velocities, m/s or rad/s, one per joint or none.
    pub velocities: &'a [f64],
    /// Accelerations, m/s² or rad/s², one per joint or none; they require velocities.
    pub accelerations: &'a [f64],
    /// Efforts, one per joint or none; checked for size and NaN, otherwise ignored.
    pub effort: &'a [f64],
}

/// Joints and points of a requested trajectory, in row-major storage (no allocation per point).
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryRequest {
    pub(super) start: Start,
    pub(super) joints: Vec<String>,
    pub(super) times: Vec<Nanoseconds>,
    pub(super) positions: Vec<f64>,
    /// Velocities: empty if no point has any, else one per position, zero for points without velocities.
    pub(super) velocities: Vec<f64>,
    /// Accelerations: empty if no point has any, else one per position, zero for points without
    /// accelerations.
    pub(super) accelerations: Vec<f64>,
    /// Spline degree allowed by the fields of each point.
    pub(super) degrees: Vec<SplineDegree>,
}

impl TrajectoryRequest {
    /// Creates a request without points: a controlled stop of `joints`, or of all joints if empty.
    pub fn new(start: Start, joints: Vec<String>) -> Self {
        Self {
            start,
            joints,
            times: Vec::new(),
            positions: Vec::new(),
            velocities: Vec::new(),
            accelerations: Vec::new(),
            degrees: Vec::new(),
        }
    }

    /// Reserves memory for `points` more points.
    pub fn reserve(&mut self, points: usize) {
        self.times.reserve(points);
        self.degrees.reserve(points);
        self.positions.reserve(points.saturating_mul(self.joints.len()));
    }

    /// Returns the start of the trajectory.
    pub fn start(&self) -> Start {
        self.start
    }

    /// Returns the request with another start.
    #[must_use]
    pub fn with_start(self, start: Start) -> Self {
        Self { start, ..self }
    }

    /// Returns the request without interpolation: between two points, the setpoint is the second one; before the first,
    /// the commanded state.
    #[must_use]
    pub fn without_interpolation(mut self) -> Self {
        self.degrees.fill(SplineDegree::Step);
        self
    }

    /// Returns time (ns from the start) and positions (m or rad) of the first point.
    pub fn first_point(&self) -> Option<(Nanoseconds, &[f64])> {
        let columns = self.positions.len() / self.times.len().max(1);
        Some((*self.times.first()?, self.positions.get(..columns)?))
    }

    /// Returns the joint names, in the order of the columns.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Returns the number of points.
    pub fn points(&self) -> usize {
        self.times.len()
    }

    /// Returns point `index` and its time, ns from the start; `None` beyond the last point. Efforts are
    /// not stored.
    pub fn point(&self, index: usize) -> Option<(Nanoseconds, TrajectoryPoint<'_>)> {
        let degree = *self.degrees.get(index)?;
        let columns = self.joints.len();
        let cells = index * columns..(index + 1) * columns;
        let mut row =
            TrajectoryPoint { positions: self.positions.get(cells.clone())?, ..TrajectoryPoint::default() };
        if degree >= SplineDegree::Cubic {
            row.velocities = self.velocities.get(cells.clone())?;
        }
        if degree >= SplineDegree::Quintic {
            row.accelerations = self.accelerations.get(cells)?;
        }
        Some((*self.times.get(index)?, row))
    }

    /// Appends a point at `time` ns from the start.
    ///
    /// # Errors
    /// - [`RejectionCode::WrongSize`] for an array that is neither empty nor has one value per joint, for
    ///   missing positions, for accelerations without velocities.
    /// - [`RejectionCode::NotFinite`] for NaN and infinity.
    pub fn push(&mut self, time: Nanoseconds, row: TrajectoryPoint<'_>) -> Result<(), Rejection> {
        self.check_sizes(row)?;
        self.check_finite(row.positions, "position")?;
        self.check_finite(row.velocities, "velocity")?;
        self.check_finite(row.accelerations, "acceleration")?;
        self.check_finite(row.effort, "effort")?;
        self.times.push(time);
        self.positions.extend_from_slice(row.positions);
        append(&mut self.velocities, row.velocities, self.positions.len());
        append(&mut self.accelerations, row.accelerations, self.positions.len());
        self.degrees.push(match (row.velocities, row.accelerations) {
            ([], _) => SplineDegree::Linear,
            (_, []) => SplineDegree::Cubic,
            _ => SplineDegree::Quintic,
        });
        Ok(())
    }

    fn check_sizes(&self, row: TrajectoryPoint<'_>) -> Result<(), Rejection> {
        let (index, joints) = (self.points(), self.joints.len());
        let wrong = |text: String, found: usize| {
            Rejection::new(RejectionCode::WrongSize, text).index(index).numbers(found as f64, joints as f64)
        };
        if joints == 0 {
            return Err(wrong(
                format!("point {index}: joint_names is empty; give at least one joint"),
                row.positions.len(),
            ));
        }
        let optional = [
            ("positions", row.positions, false),
            ("velocities", row.velocities, true),
            ("accelerations", row.accelerations, true),
            ("effort", row.effort, true),
        ];
        for (name, values, may_be_empty) in optional {
            if values.len() != joints && !(may_be_empty && values.is_empty()) {
                let found = values.len();
                return Err(wrong(format!("point {index}: {found} {name} for {joints} joints"), found));
            }
        }
        if row.velocities.is_empty() && !row.accelerations.is_empty() {
            return Err(wrong(format!("point {index}: accelerations without velocities; give both"), 0));
        }
        Ok(())
    }

    fn check_finite(&self, values: &[f64], what: &str) -> Result<(), Rejection> {
        let Some(column) = values.iter().position(|value| !value.is_finite()) else {
            return Ok(());
        };
        let (index, joint, value) = (self.points(), &self.joints[column], values[column]);
        Err(Rejection::new(
            RejectionCode::NotFinite,
            format!("{joint}, point {index}: {what} is {value}, not a finite number"),
        )
        .joint(joint)
        .index(index)
        .numbers(value, 0.0))
    }

    /// Rejects times that do not increase, a negative first time, and a last time that overflows absolute
    /// nanoseconds.
    pub(super) fn check_times(&self) -> Result<(), Rejection> {
        let (Some(&first), Some(&last)) = (self.times.first(), self.times.last()) else {
            return Ok(());
        };
        if first < 0 {
            return Err(Rejection::new(
                RejectionCode::NegativeTime,
                format!("point 0: time_from_start is {} s; it must not be negative", Rounded(seconds(first))),
            )
            .index(0)
            .numbers(seconds(first), 0.0));
        }
        if let Some(i) = self.times.windows(2).position(|pair| pair[1] <= pair[0]) {
            let (before, time) = (seconds(self.times[i]), seconds(self.times[i + 1]));
            return Err(Rejection::new(
                RejectionCode::TimesNotIncreasing,
                format!(
                    "point {}: time_from_start is {time} s; it must be after {before} s of the previous \
                     point",
                    i + 1
                ),
            )
            .index(i + 1)
            .numbers(time, before));
        }
        if let Start::At(stamp) = self.start
            && stamp.checked_add(last).is_none()
        {
            return Err(Rejection::new(
                RejectionCode::InvalidTime,
                format!(
                    "point {}: {} s after the stamp exceeds 64-bit nanoseconds",
                    self.points() - 1,
                    seconds(last)
                ),
            )
            .index(self.points() - 1)
            .numbers(seconds(stamp) + seconds(last), seconds(Nanoseconds::MAX)));
        }
        Ok(())
    }
}

/// Appends `row` to `field`, which then has `len` values if any point has the field; missing values are zero.
fn append(field: &mut Vec<f64>, row: &[f64], len: usize) {
    if !row.is_empty() {
        field.resize(len - row.len(), 0.0);
        field.extend_from_slice(row);
    } else if !field.is_empty() {
        field.resize(len, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> TrajectoryRequest {
        TrajectoryRequest::new(Start::Now, vec!["x".into(), "y".into()])
    }

    #[test]
    fn a_field_first_given_at_a_later_point_is_zero_at_earlier_points() {
        let mut request = request();
        let row =
            |positions, velocities| TrajectoryPoint { positions, velocities, ..TrajectoryPoint::default() };
        request.push(0, row(&[1.0, 2.0], &[])).unwrap();
        request.push(1, row(&[3.0, 4.0], &[5.0, 6.0])).unwrap();
        request.push(2, row(&[7.0, 8.0], &[])).unwrap();
        assert_eq!(request.velocities, [0.0, 0.0, 5.0, 6.0, 0.0, 0.0]);
        assert_eq!(request.degrees, [SplineDegree::Linear, SplineDegree::Cubic, SplineDegree::Linear]);
    }

    #[test]
    fn rejections_of_sizes_and_nan_contain_the_point_index() {
        let two = [0.0, 0.0];
        let cases: [(TrajectoryPoint<'_>, RejectionCode); 6] = [
            (TrajectoryPoint::default(), RejectionCode::WrongSize),
            (TrajectoryPoint { positions: &[0.0], ..TrajectoryPoint::default() }, RejectionCode::WrongSize),
            (
                TrajectoryPoint { positions: &two, velocities: &[0.0; 3], ..TrajectoryPoint::default() },
                RejectionCode::WrongSize,
            ),
            (
                TrajectoryPoint { positions: &two, accelerations: &two, ..TrajectoryPoint::default() },
                RejectionCode::WrongSize,
            ),
            (
                TrajectoryPoint { positions: &two, effort: &[1.0], ..TrajectoryPoint::default() },
                RejectionCode::WrongSize,
            ),
            (
                TrajectoryPoint { positions: &[0.0, f64::NAN], ..TrajectoryPoint::default() },
                RejectionCode::NotFinite,
            ),
        ];
        for (row, code) in cases {
            let mut request = request();
            request.push(0, TrajectoryPoint { positions: &two, ..TrajectoryPoint::default() }).unwrap();
            let rejection = request.push(1, row).unwrap_err();
            assert_eq!((rejection.code, rejection.index), (code, Some(1)));
            assert_eq!(request.points(), 1, "a rejected point changes nothing");
        }
    }

    #[test]
    fn points_without_joints_are_rejected() {
        let mut request = TrajectoryRequest::new(Start::Now, Vec::new());
        assert_eq!(request.push(0, TrajectoryPoint::default()).unwrap_err().code, RejectionCode::WrongSize);
    }

    #[test]
    fn invalid_times_are_rejected_with_their_codes() {
        let times = |start, times: &[i64]| {
            let mut request = request();
            request.start = start;
            request.times = times.to_vec();
            request.check_times().map_err(|r| (r.code, r.index))
        };
        assert_eq!(times(Start::Now, &[-1, 3]), Err((RejectionCode::NegativeTime, Some(0))));
        assert_eq!(times(Start::Now, &[0, 3, 3]), Err((RejectionCode::TimesNotIncreasing, Some(2))));
        assert_eq!(times(Start::Now, &[0, i64::MAX]), Ok(()));
        assert_eq!(times(Start::At(1), &[0, i64::MAX]), Err((RejectionCode::InvalidTime, Some(1))));
    }
}
