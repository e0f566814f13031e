//! A trajectory as it was asked for: values only, nothing checked against a machine yet.

use super::rejection::{Code, Rejection};
use super::spline::Order;
use crate::units::{Nanoseconds, seconds};

/// When a trajectory starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At the next position period (stamp 0).
    Now,
    /// At an absolute time, ns; between two position periods it is the later one.
    At(Nanoseconds),
}

/// The values of one point, m or rad; an empty slice is a field that is not given.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row<'a> {
    /// Positions, m or rad, one per joint.
    pub positions: &'a [f64],
    /// Velocities, m/s or rad/s, one per joint or none.
    pub velocities: &'a [f64],
    /// Accelerations, m/s² or rad/s², one per joint or none; not without velocities.
    pub accelerations: &'a [f64],
    /// Efforts, one per joint or none: checked and not used.
    pub effort: &'a [f64],
}

/// A request: joints and points, in flat row-major storage (no allocation per point).
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    pub(super) start: Start,
    pub(super) joints: Vec<String>,
    pub(super) times: Vec<Nanoseconds>,
    pub(super) positions: Vec<f64>,
    /// As long as `positions` once a point has velocities, zero where one has none; else empty.
    pub(super) velocities: Vec<f64>,
    /// Likewise.
    pub(super) accelerations: Vec<f64>,
    /// The highest derivative that each point has.
    pub(super) orders: Vec<Order>,
}

impl Request {
    /// A request without points, which is a request to stop `joints`, or all of them when empty.
    pub fn new(start: Start, joints: Vec<String>) -> Self {
        Self {
            start,
            joints,
            times: Vec::new(),
            positions: Vec::new(),
            velocities: Vec::new(),
            accelerations: Vec::new(),
            orders: Vec::new(),
        }
    }

    /// Makes room for `points` more points.
    pub fn reserve(&mut self, points: usize) {
        self.times.reserve(points);
        self.orders.reserve(points);
        self.positions.reserve(points.saturating_mul(self.joints.len()));
    }

    /// When it starts.
    pub fn start(&self) -> Start {
        self.start
    }

    /// The same, starting at another time.
    #[must_use]
    pub fn starting(self, start: Start) -> Self {
        Self { start, ..self }
    }

    /// Time, ns from the start, and positions, m or rad, of the first point.
    pub fn first_point(&self) -> Option<(Nanoseconds, &[f64])> {
        let columns = self.positions.len() / self.times.len().max(1);
        Some((*self.times.first()?, self.positions.get(..columns)?))
    }

    /// Names of the joints, in the order of the columns.
    pub fn joints(&self) -> &[String] {
        &self.joints
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.times.len()
    }

    /// Point `index` and its time, ns from the start; nothing beyond the last. Efforts are not kept.
    pub fn point(&self, index: usize) -> Option<(Nanoseconds, Row<'_>)> {
        let order = *self.orders.get(index)?;
        let columns = self.joints.len();
        let cells = index * columns..(index + 1) * columns;
        let mut row = Row { positions: self.positions.get(cells.clone())?, ..Row::default() };
        if order >= Order::Cubic {
            row.velocities = self.velocities.get(cells.clone())?;
        }
        if order >= Order::Quintic {
            row.accelerations = self.accelerations.get(cells)?;
        }
        Some((*self.times.get(index)?, row))
    }

    /// Appends a point at `time` ns from the start.
    ///
    /// # Errors
    /// [`Code::WrongSize`] for an array that has neither no value nor one per joint, for positions
    /// that are not given, for accelerations without velocities; [`Code::NotFinite`].
    pub fn push(&mut self, time: Nanoseconds, row: Row<'_>) -> Result<(), Rejection> {
        self.check_sizes(row)?;
        self.check_finite(row.positions, "position")?;
        self.check_finite(row.velocities, "velocity")?;
        self.check_finite(row.accelerations, "acceleration")?;
        self.check_finite(row.effort, "effort")?;
        self.times.push(time);
        self.positions.extend_from_slice(row.positions);
        append(&mut self.velocities, row.velocities, self.positions.len());
        append(&mut self.accelerations, row.accelerations, self.positions.len());
        self.orders.push(match (row.velocities, row.accelerations) {
            ([], _) => Order::Linear,
            (_, []) => Order::Cubic,
            _ => Order::Quintic,
        });
        Ok(())
    }

    fn check_sizes(&self, row: Row<'_>) -> Result<(), Rejection> {
        let (index, joints) = (self.points(), self.joints.len());
        let wrong = |text: String, found: usize| {
            Rejection::new(Code::WrongSize, text).index(index).numbers(found as f64, joints as f64)
        };
        if joints == 0 {
            return Err(wrong(
                format!("point {index} is given for no joint: joint_names is empty"),
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
            return Err(wrong(format!("point {index}: accelerations are given without velocities"), 0));
        }
        Ok(())
    }

    fn check_finite(&self, values: &[f64], what: &str) -> Result<(), Rejection> {
        let Some(column) = values.iter().position(|value| !value.is_finite()) else {
            return Ok(());
        };
        let (index, joint, value) = (self.points(), &self.joints[column], values[column]);
        Err(Rejection::new(
            Code::NotFinite,
            format!("{joint}, point {index}: {what} is {value}, not a finite number"),
        )
        .joint(joint)
        .index(index)
        .numbers(value, 0.0))
    }

    /// Refuses times that do not increase, a negative first time, and a last one that cannot be
    /// counted in absolute nanoseconds.
    pub(super) fn check_times(&self) -> Result<(), Rejection> {
        let (Some(&first), Some(&last)) = (self.times.first(), self.times.last()) else {
            return Ok(());
        };
        if first < 0 {
            return Err(Rejection::new(
                Code::NegativeTime,
                format!("point 0: time from start is negative, {} s", seconds(first)),
            )
            .index(0)
            .numbers(seconds(first), 0.0));
        }
        if let Some(i) = self.times.windows(2).position(|pair| pair[1] <= pair[0]) {
            let (before, time) = (seconds(self.times[i]), seconds(self.times[i + 1]));
            return Err(Rejection::new(
                Code::TimesNotIncreasing,
                format!(
                    "point {}: time from start {time} s is not after {before} s of the point \
                     before it",
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
                Code::InvalidTime,
                format!(
                    "point {}: {} s after the stamp cannot be counted in 64-bit nanoseconds",
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

/// Appends `row` to a field that reaches `len` values then; points that lack it have zeros there.
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

    fn request() -> Request {
        Request::new(Start::Now, vec!["x".into(), "y".into()])
    }

    #[test]
    fn a_field_given_late_does_not_shift_into_earlier_points() {
        let mut request = request();
        let row = |positions, velocities| Row { positions, velocities, ..Row::default() };
        request.push(0, row(&[1.0, 2.0], &[])).unwrap();
        request.push(1, row(&[3.0, 4.0], &[5.0, 6.0])).unwrap();
        request.push(2, row(&[7.0, 8.0], &[])).unwrap();
        assert_eq!(request.velocities, [0.0, 0.0, 5.0, 6.0, 0.0, 0.0]);
        assert_eq!(request.orders, [Order::Linear, Order::Cubic, Order::Linear]);
    }

    #[test]
    fn wrong_sizes_and_values_name_the_point() {
        let two = [0.0, 0.0];
        let cases: [(Row<'_>, Code); 6] = [
            (Row::default(), Code::WrongSize),
            (Row { positions: &[0.0], ..Row::default() }, Code::WrongSize),
            (Row { positions: &two, velocities: &[0.0; 3], ..Row::default() }, Code::WrongSize),
            (Row { positions: &two, accelerations: &two, ..Row::default() }, Code::WrongSize),
            (Row { positions: &two, effort: &[1.0], ..Row::default() }, Code::WrongSize),
            (Row { positions: &[0.0, f64::NAN], ..Row::default() }, Code::NotFinite),
        ];
        for (row, code) in cases {
            let mut request = request();
            request.push(0, Row { positions: &two, ..Row::default() }).unwrap();
            let rejection = request.push(1, row).unwrap_err();
            assert_eq!((rejection.code, rejection.index), (code, Some(1)));
            assert_eq!(request.points(), 1, "a refused point leaves no trace");
        }
    }

    #[test]
    fn points_for_no_joint_are_refused() {
        let mut request = Request::new(Start::Now, Vec::new());
        assert_eq!(request.push(0, Row::default()).unwrap_err().code, Code::WrongSize);
    }

    #[test]
    fn times_are_refused_by_their_own_codes() {
        let times = |start, times: &[i64]| {
            let mut request = request();
            request.start = start;
            request.times = times.to_vec();
            request.check_times().map_err(|r| (r.code, r.index))
        };
        assert_eq!(times(Start::Now, &[-1, 3]), Err((Code::NegativeTime, Some(0))));
        assert_eq!(times(Start::Now, &[0, 3, 3]), Err((Code::TimesNotIncreasing, Some(2))));
        assert_eq!(times(Start::Now, &[0, i64::MAX]), Ok(()));
        assert_eq!(times(Start::At(1), &[0, i64::MAX]), Err((Code::InvalidTime, Some(1))));
    }
}
