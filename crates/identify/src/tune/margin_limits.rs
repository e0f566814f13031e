//! Limits of the stability margins of the position loops.

use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{DesignError, Margins, PredictionModel, margins};

/// Smallest permitted margins of the worst axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarginLimits {
    /// Smallest modulus margin.
    pub modulus: f64,
    /// Smallest delay margin, s.
    pub delay: f64,
}

impl Default for MarginLimits {
    /// Returns a modulus margin of 0.5 and a delay margin of 5 ms.
    fn default() -> Self {
        MarginLimits { modulus: 0.5, delay: 5e-3 }
    }
}

impl MarginLimits {
    /// Limits that every stable loop keeps.
    pub const STABLE: MarginLimits = MarginLimits { modulus: 0.0, delay: 0.0 };

    /// Returns true if `margins` are within the limits.
    pub fn allows(&self, margins: &Margins) -> bool {
        margins.modulus >= self.modulus && margins.delay >= self.delay
    }
}

/// Returns the smallest margins over the loops; none if a loop is unstable or has no design.
pub(super) fn worst_margins<'a>(
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
