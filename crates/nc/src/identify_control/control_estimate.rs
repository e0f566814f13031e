//! Value with its interval.

/// Multiple of the standard deviation of an interval of 95 %.
pub(super) const COVERAGE: f64 = 2.0;

/// Value with the half width of its interval of 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ControlEstimate {
    pub value: f64,
    pub half_width: f64,
    /// Number of motions that it is from.
    pub count: usize,
}

impl ControlEstimate {
    /// Returns the median of values; the interval is that of the mean, and at least `relative` of the value.
    pub fn of(mut values: Vec<f64>, relative: f64) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        let count = values.len();
        let value = match count {
            0 => return None,
            _ if count % 2 == 1 => values[count / 2],
            _ => f64::midpoint(values[count / 2 - 1], values[count / 2]),
        };
        let square = values.iter().map(|x| (x - value).powi(2)).sum::<f64>() / (count.max(2) - 1) as f64;
        let half_width = (COVERAGE * (square / count as f64).sqrt()).max(relative * value.abs());
        Some(Self { value, half_width, count })
    }

    /// Adds the relative half widths of the limits by which it is divided; a limit of which a bound is known has none.
    pub fn divided_by(self, limits: &[Self]) -> Self {
        let of = |limit: &Self| limit.half_width / limit.value;
        let relative = limits.iter().map(of).filter(|part| part.is_finite()).fold(0.0, f64::max);
        Self { half_width: self.half_width.hypot(relative * self.value), ..self }
    }
}
