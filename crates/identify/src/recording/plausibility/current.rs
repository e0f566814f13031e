//! Plausibility of the current: magnitude, column and sign.

use super::super::ConditioningError;
use super::super::current_lag::MovingSamples;
use super::super::filtered_section::FilteredSection;
use super::super::regression::{LeastSquares, correlation};
use super::super::spans::{CURRENT, POSITION, VELOCITY};
use super::{PlausibilityCheck, SAME};
use virtual_axes_core::statistics::{median, quantile};
use virtual_axes_core::units::Rounded;

/// Largest permitted current relative to the current limit of the motor; recordings can contain peak instead
/// of RMS values.
const CURRENTS: f64 = 5.0;
/// Largest current of the motor of an axis, A: the limit where the user has stated none.
const LARGEST: f64 = 1000.0;
/// Smallest contribution to R² of a significant effect.
const EFFECT: f64 = 0.05;
/// Smallest contribution of the acceleration to R² that determines the sign of the current.
const INERTIAL: f64 = 0.01;
/// Fewest samples in motion that determine the sign of the current.
const FEWEST_MOVING: usize = 10;
/// R² below which the current is unrelated to the motion.
const EXPLAINED: f64 = 0.5;
/// Smallest share of moving samples in each direction that separates friction from gravity.
const BOTH_WAYS: f64 = 0.05;

impl PlausibilityCheck<'_> {
    pub(super) fn check_current_magnitude(&self) -> Result<(), ConditioningError> {
        let Some(current) = self.columns[CURRENT].as_deref() else { return Ok(()) };
        let largest = quantile(&mut current.iter().map(|i| i.abs()).collect::<Vec<_>>(), 0.99).unwrap_or(0.0);
        let (limit, allowed, what) = match self.stated.current {
            true => {
                let limit = self.axis.motor.max_current;
                (limit, CURRENTS * limit, "the limit of the motor is")
            }
            false => (LARGEST, LARGEST, "that of an axis at most"),
        };
        if largest <= allowed {
            return Ok(());
        }
        let looks_like = if largest * 1e-3 <= allowed {
            "it is likely in mA; give --column current=COLUMN[mA]"
        } else {
            ""
        };
        let (largest, limit) = (Rounded(largest), Rounded(limit));
        let reason = format!("the current reaches {largest} A, {what} {limit} A");
        self.error(reason, looks_like)
    }

    pub(super) fn check_current_column(&self) -> Result<(), ConditioningError> {
        let (Some(current), Some(smooth)) = (self.columns[CURRENT].as_deref(), &self.smooth_current) else {
            return Ok(());
        };
        let recorded = self.columns[VELOCITY].as_deref().map(|v| ("velocity", correlation(current, v)));
        let candidates = [
            ("position", correlation(current, self.column(POSITION))),
            ("velocity", correlation(smooth, &self.velocity)),
        ];
        for (signal, correlation) in candidates.into_iter().chain(recorded) {
            if correlation.abs() > SAME {
                let reason = format!(
                    "the current is a multiple of the {signal} (correlation {correlation:.5}); its column likely contains a \
                     {signal}"
                );
                return self.error(reason, "");
            }
        }
        Ok(())
    }

    /// Returns the reason why the sign of the current is inverted, if the signs of the friction and of the inertia part are
    /// wrong; gravity does not matter.
    pub(super) fn inverted_current(&self, parts: &[FilteredSection]) -> Option<String> {
        self.smooth_current.as_ref()?;
        let mut moving = MovingSamples::new(parts, self.axis.kind, 0, 0);
        if moving.indices.len() < FEWEST_MOVING {
            // Moves that are shorter than the filter: blurred, but the signs remain.
            moving = MovingSamples::with_ends(parts, self.axis.kind);
        }
        let currents: Option<Vec<f64>> =
            moving.indices.iter().map(|&(p, n)| Some(parts[p].smooth_current.as_ref()?[n])).collect();
        let currents = currents.unwrap_or_default();
        if currents.len() < FEWEST_MOVING {
            return None;
        }
        let whole = LeastSquares::new(moving.columns.clone()).fit(&currents);
        let without = |left_out: &[usize]| {
            let kept = (0..moving.columns.len()).filter(|n| !left_out.contains(n));
            LeastSquares::new(kept.map(|n| moving.columns[n].clone()).collect()).fit(&currents).r2
        };
        let speeds = &moving.columns[1];
        let forward = speeds.iter().filter(|v| **v > 0.0).count() as f64 / speeds.len().max(1) as f64;
        let common = median(&mut speeds.iter().map(|v| v.abs()).collect::<Vec<_>>()).unwrap_or(0.0);
        let friction = whole.coefficients[1] * common + whole.coefficients[2];
        let believed = |left_out: &[usize]| whole.r2 - without(left_out) > EFFECT;
        let friction_sign = if (BOTH_WAYS..=1.0 - BOTH_WAYS).contains(&forward) && believed(&[1, 2]) {
            friction.signum()
        } else {
            0.0
        };
        let is_inertial = whole.r2 - without(&[0]) > INERTIAL;
        let inertia_sign = if is_inertial { whole.coefficients[0].signum() } else { 0.0 };
        let turned = friction_sign + inertia_sign < 0.0;
        (turned && whole.r2 > EXPLAINED).then(|| match friction_sign < 0.0 {
            true => format!("opposes the motion (friction {friction:.2} A in positive direction)"),
            false => {
                let (slope, unit) = (Rounded(whole.coefficients[0]), self.unit());
                format!("opposes the acceleration ({slope} A per {unit}/s²)")
            }
        })
    }
}
