//! Path time: time along the accepted trajectories, which passes at the feed override.

use crate::units::Nanoseconds;

/// Longest span of path time, ns: 2⁶², 146 years.
const LONGEST: f64 = (1_u64 << 62) as f64;

/// Path time, in ns of the position grid and a fraction of 1 ns from 0 to below 1.
///
/// The fraction keeps setpoints smooth: rounding to 1 ns at 0.5 m/s and a position cycle of 2 ms would be a jerk of
/// 0.06 m/s³.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct PathTime {
    pub ns: Nanoseconds,
    pub fraction: f64,
}

impl PathTime {
    /// Creates the path time of instant `k` of the position grid.
    pub fn of_instant(k: i64, period: Nanoseconds) -> Self {
        Self::from(k.saturating_mul(period))
    }

    /// Returns the path time `ns` ≥ 0 nanoseconds later.
    pub fn after(self, ns: f64) -> Self {
        let ns = ns.min(LONGEST);
        let whole = ns as Nanoseconds;
        let fraction = self.fraction + (ns - whole as f64);
        let carry = fraction >= 1.0;
        let fraction = if carry { fraction - 1.0 } else { fraction };
        Self { ns: self.ns.saturating_add(whole + Nanoseconds::from(carry)), fraction }
    }

    /// Returns the last instant of the position grid at or before this time.
    pub fn instant(self, period: Nanoseconds) -> i64 {
        self.ns.div_euclid(period)
    }

    /// Returns the path time counted from `ns`.
    pub fn relative_to(self, ns: Nanoseconds) -> Self {
        Self { ns: self.ns.saturating_sub(ns), fraction: self.fraction }
    }

    /// Returns the time since `ns`, ns.
    pub fn since(self, ns: Nanoseconds) -> f64 {
        self.ns.saturating_sub(ns) as f64 + self.fraction
    }
}

impl From<Nanoseconds> for PathTime {
    fn from(ns: Nanoseconds) -> Self {
        Self { ns, fraction: 0.0 }
    }
}

/// Instant at which plans are evaluated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlanInstant {
    /// Position cycle, the time of stops and streams.
    pub k: i64,
    /// Path time, the time of trajectories.
    pub path: PathTime,
}
