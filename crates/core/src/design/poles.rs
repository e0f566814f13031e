//! Poles and stability of the closed position loop.

use nalgebra::Complex;

use super::polynomial::{has_roots_within, product, roots, sum, without_integrators};
use super::{DesignError, PredictionModel};
use crate::control::Rst;

/// Smallest distance of the poles of a stable loop from the unit circle.
///
/// A pole within this distance needs 10⁶ position cycles, more than an hour, to decay by 1/e. A double pole on the
/// circle is computed with an error of up to 10⁻⁸ on either side.
pub(super) const STABILITY_MARGIN: f64 = 1e-6;

/// Computes the poles of `model` controlled by `rst`: roots in z of A S + B R, largest modulus first.
///
/// Their number is the degree of the polynomial in q⁻¹; delays and previews add poles at and near 0.
///
/// # Errors
/// [`DesignError::NoPoles`] if the roots cannot be computed.
pub fn poles(model: &PredictionModel, rst: &Rst) -> Result<Vec<Complex<f64>>, DesignError> {
    roots(&characteristic_polynomial(model, rst)).ok_or(DesignError::NoPoles)
}

/// Returns true if the poles of `model` except its integrator are stable: those of the velocity and current loop.
pub fn has_stable_poles(model: &PredictionModel) -> bool {
    has_roots_within(&without_integrators(model.a()), 1.0 - STABILITY_MARGIN)
}

/// Checks that every pole of the closed loop is inside the unit circle by more than 10⁻⁶.
///
/// # Errors
/// [`DesignError::Unstable`] with the pole of largest modulus, [`DesignError::NoPoles`] if the poles cannot be computed.
pub fn check_stable(model: &PredictionModel, rst: &Rst) -> Result<(), DesignError> {
    match poles(model, rst)?.first() {
        Some(pole) if !is_stable_pole(*pole) => {
            Err(DesignError::Unstable { re: pole.re, im: pole.im, modulus: pole.norm() })
        }
        _ => Ok(()),
    }
}

/// Returns `rst` if the closed loop is stable or `allow_unstable` is set.
///
/// # Errors
/// [`DesignError::Unstable`] or [`DesignError::NoPoles`] from [`check_stable`], unless `allow_unstable` is set.
pub fn require_stable(model: &PredictionModel, rst: Rst, allow_unstable: bool) -> Result<Rst, DesignError> {
    if !allow_unstable {
        check_stable(model, &rst)?;
    }
    Ok(rst)
}

/// Returns true if a pole counts as stable.
pub(super) fn is_stable_pole(pole: Complex<f64>) -> bool {
    pole.norm() < 1.0 - STABILITY_MARGIN
}

/// Computes the characteristic polynomial A S + B R of the closed loop.
pub(super) fn characteristic_polynomial(model: &PredictionModel, rst: &Rst) -> Vec<f64> {
    sum(&product(model.a(), rst.s()), &product(model.b(), rst.r()))
}
