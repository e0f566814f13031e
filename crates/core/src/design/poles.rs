//! Poles of the closed position loop.

use nalgebra::Complex;

use super::polynomial::{product, roots, sum};
use super::{DesignError, PredictionModel};
use crate::control::Rst;

/// How far inside the unit circle the poles of a stable loop lie.
///
/// A pole nearer to it needs 10⁶ periods, an hour and more, to fade by 1/e: nothing that moves a machine.
/// A double pole on the circle is computed up to 10⁻⁸ beside it, so that it is found on either side.
pub(super) const STABILITY_MARGIN: f64 = 1e-6;

/// The poles of `model` controlled by `rst`: the roots in z of A S + B R, largest modulus first.
///
/// As many as that polynomial has degrees in q⁻¹; delays and previews bring poles at and near 0.
///
/// # Errors
/// [`DesignError::NoPoles`] if the roots cannot be computed.
pub fn poles(model: &PredictionModel, rst: &Rst) -> Result<Vec<Complex<f64>>, DesignError> {
    roots(&characteristic(model, rst)).ok_or(DesignError::NoPoles)
}

/// That every pole of the closed loop lies inside the unit circle, by more than 10⁻⁶.
///
/// # Errors
/// [`DesignError::Unstable`] with the pole of largest modulus, [`DesignError::NoPoles`].
pub fn check_stable(model: &PredictionModel, rst: &Rst) -> Result<(), DesignError> {
    match poles(model, rst)?.first() {
        Some(pole) if !inside(*pole) => {
            Err(DesignError::Unstable { re: pole.re, im: pole.im, modulus: pole.norm() })
        }
        _ => Ok(()),
    }
}

/// `rst` if the closed loop is stable, or if it is wanted all the same (`force`).
///
/// # Errors
/// Those of [`check_stable`], unless forced.
pub fn accept(model: &PredictionModel, rst: Rst, force: bool) -> Result<Rst, DesignError> {
    if !force {
        check_stable(model, &rst)?;
    }
    Ok(rst)
}

/// Whether a pole counts as stable.
pub(super) fn inside(pole: Complex<f64>) -> bool {
    pole.norm() < 1.0 - STABILITY_MARGIN
}

/// A S + B R.
pub(super) fn characteristic(model: &PredictionModel, rst: &Rst) -> Vec<f64> {
    sum(&product(model.a(), rst.s()), &product(model.b(), rst.r()))
}
