//! Range of values that can be drawn.

/// Largest magnitude of a value that is drawn. Larger values are omitted like NaN.
const LARGEST: f64 = 1e12;

/// Returns true if a value can be drawn.
pub(super) fn is_drawable(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// Range from the smallest to the largest value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub min: f64,
    pub max: f64,
}

impl Extent {
    /// Returns the range of the drawable values; `None` if there are none.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Extent> {
        values.into_iter().filter(|v| is_drawable(*v)).fold(None, |extent, value| {
            let Extent { min, max } = extent.unwrap_or(Extent { min: value, max: value });
            Some(Extent { min: min.min(value), max: max.max(value) })
        })
    }

    /// Returns max − min.
    pub(super) fn span(&self) -> f64 {
        self.max - self.min
    }

    /// Returns the middle of the range.
    pub(super) fn middle(&self) -> f64 {
        self.min + self.span() / 2.0
    }
}

/// Returns the largest magnitude of the drawable values; 0 if there are none.
pub(super) fn peak(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().filter(|v| is_drawable(*v)).fold(0.0, |peak, v| peak.max(v.abs()))
}
