//! Margins of the position loops of several axes.

use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{DesignError, Margins, PredictionModel, margins};

/// What the worst axis of a tuning must keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarginLimits {
    /// Smallest modulus margin.
    pub modulus: f64,
    /// Smallest delay margin, s.
    pub delay: f64,
}

impl Default for MarginLimits {
    /// 0.5 and 5 ms.
    fn default() -> Self {
        MarginLimits { modulus: 0.5, delay: 5e-3 }
    }
}

impl MarginLimits {
    /// Any stable loop will do.
    pub const STABLE: MarginLimits = MarginLimits { modulus: 0.0, delay: 0.0 };

    /// Whether `margins` keep them.
    pub fn are_kept_by(&self, margins: &Margins) -> bool {
        margins.modulus >= self.modulus && margins.delay >= self.delay
    }
}

/// The least of each margin over the loops; none if one is unstable or is no loop.
pub(super) fn worst<'a>(
    loops: impl IntoIterator<Item = (&'a PredictionModel, Result<Rst, DesignError>)>,
) -> Option<Margins> {
    let mut worst: Option<Margins> = None;
    for (model, rst) in loops {
        let one = margins(model, &rst.ok()?).ok()?;
        worst = Some(worst.map_or(one, |w| Margins {
            modulus: w.modulus.min(one.modulus),
            phase: w.phase.min(one.phase),
            gain: w.gain.min(one.gain),
            gain_reduction: w.gain_reduction.max(one.gain_reduction),
            delay: w.delay.min(one.delay),
        }));
    }
    worst
}
