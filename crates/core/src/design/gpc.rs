//! Generalized predictive control (GPC) in RST form.

use nalgebra::{DMatrix, DVector};

use super::polynomial::product;
use super::{DesignError, PredictionModel};
use crate::control::{MAX_PREVIEW, Rst};

/// Weight λ of the control increments in the GPC criterion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControlWeight {
    /// λ, s².
    Absolute(f64),
    /// Relative weight λ_rel = λ / trace(GᵀG).
    Relative(f64),
}

/// Tuning of a generalized predictive controller (Prévost table 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpcTuning {
    /// N1, first period of the prediction horizon.
    pub n1: usize,
    /// N2, last period of the prediction horizon.
    pub n2: usize,
    /// Nu, periods of the control horizon.
    pub nu: usize,
    /// Weight λ of the control increments.
    pub weight: ControlWeight,
}

impl GpcTuning {
    fn check(&self) -> Result<(), DesignError> {
        let max = MAX_PREVIEW as usize;
        let within = |name, value: usize, last: usize| {
            let error = DesignError::OutOfRange {
                name,
                value: value as f64,
                allowed: match name {
                    "n2" => format!("lie in 1 … {last}"),
                    _ => format!("lie in 1 … n2 = {last}"),
                },
            };
            if (1..=last).contains(&value) { Ok(()) } else { Err(error) }
        };
        within("n2", self.n2, max)?;
        within("n1", self.n1, self.n2)?;
        within("nu", self.nu, self.n2)?;
        let (name, value) = match self.weight {
            ControlWeight::Absolute(value) => ("lambda", value),
            ControlWeight::Relative(value) => ("lambda_rel", value),
        };
        if value.is_finite() && value >= 0.0 {
            return Ok(());
        }
        Err(DesignError::OutOfRange { name, value, allowed: "be finite and not negative".to_owned() })
    }
}

/// Designs the RST controller that minimizes the GPC criterion over the receding horizon (Prévost section 5, eq. 9).
///
/// ```text
/// 1 = Eⱼ Δ A + q⁻ʲ Fⱼ      Eⱼ B = Gⱼ + q⁻ʲ Hⱼ      k = first row of (GᵀG + λI)⁻¹ Gᵀ,  j = N1 … N2
/// R = Σ kⱼ Fⱼ              S = Δ (1 + q⁻¹ Σ kⱼ Hⱼ)     T = Σ kⱼ qʲ
/// ```
///
/// ```
/// use virtual_axes_core::design::{GpcTuning, PredictionModel, ControlWeight, gpc};
///
/// let model = PredictionModel::new(vec![1.0, -0.8], vec![0.0, 0.4], 0.006)?;
/// let rst = gpc(&model, &GpcTuning { n1: 1, n2: 4, nu: 1, weight: ControlWeight::Absolute(0.1) })?;
/// assert!((rst.r()[0] - 2.98449263).abs() < 1e-8 && (rst.r()[1] + 1.93600542).abs() < 1e-8);
/// assert_eq!((rst.t_first(), rst.preview()), (1, 4));
/// # Ok::<(), virtual_axes_core::design::DesignError>(())
/// ```
///
/// # Errors
/// [`DesignError::OutOfRange`] with the name of the parameter, [`DesignError::Singular`] if GᵀG + λI is singular,
/// [`DesignError::Rst`] if the polynomials do not form a controller.
pub fn gpc(model: &PredictionModel, tuning: &GpcTuning) -> Result<Rst, DesignError> {
    tuning.check()?;
    let GpcTuning { n1, n2, nu, weight } = *tuning;
    // B = q⁻¹ B': Eⱼ B' is the response of θ(k + j) to the control increments from u(k + j − 1) backwards.
    let b = &model.b()[1..];
    let delta_a = product(&[1.0, -1.0], model.a());
    let order = delta_a.len() - 1;
    let mut f: Vec<Vec<f64>> = Vec::with_capacity(n2);
    let mut e = Vec::with_capacity(n2);
    // 1 = E₀ΔA + F₀ with E₀ = 0, F₀ = 1; each step divides by ΔA once more.
    let mut remainder = vec![0.0; order];
    remainder[0] = 1.0;
    for _ in 0..n2 {
        let quotient = remainder[0];
        e.push(quotient);
        for i in 0..order {
            let next = remainder.get(i + 1).copied().unwrap_or(0.0);
            remainder[i] = next - quotient * delta_a[i + 1];
        }
        f.push(remainder.clone());
    }
    // Eⱼ has the first j coefficients of e, so that the first j coefficients of Eⱼ B' are the step response.
    let step = product(&e, b);
    let rows = n2 - n1 + 1;
    let g = DMatrix::from_fn(rows, nu, |row, column| match (n1 + row).checked_sub(column + 1) {
        Some(lag) => step[lag],
        None => 0.0,
    });
    let lambda = match weight {
        ControlWeight::Absolute(lambda) => lambda,
        // trace(GᵀG)
        ControlWeight::Relative(lambda) => lambda * g.norm_squared(),
    };
    let gains = first_row(&g, lambda).ok_or(DesignError::Singular { n1, n2, nu, lambda })?;
    let mut r = vec![0.0; order];
    let mut past = vec![0.0; b.len().saturating_sub(1)];
    for (gain, j) in gains.iter().zip(n1..=n2) {
        for (sum, f) in r.iter_mut().zip(&f[j - 1]) {
            *sum += gain * f;
        }
        let response = product(&e[..j], b);
        for (sum, h) in past.iter_mut().zip(&response[j..]) {
            *sum += gain * h;
        }
    }
    past.insert(0, 1.0);
    let s = product(&[1.0, -1.0], &past);
    Ok(Rst::new(&r, &s, gains.as_slice(), n1 as i64)?)
}

/// Computes the first row of (GᵀG + λI)⁻¹ Gᵀ; `None` if the matrix is singular.
///
/// Uses the QR decomposition of G stacked on √λ I: forming GᵀG would lose half of the digits.
fn first_row(g: &DMatrix<f64>, lambda: f64) -> Option<DVector<f64>> {
    let (rows, size) = g.shape();
    let mut stacked = g.clone().resize_vertically(rows + size, 0.0);
    for column in 0..size {
        stacked[(rows + column, column)] = lambda.sqrt();
    }
    let (q, r) = stacked.qr().unpack();
    // Pivots of GᵀG + λI within rounding error count as 0.
    let smallest = r.diagonal().iter().fold(f64::INFINITY, |m, d| m.min(d * d));
    let is_regular = smallest > size as f64 * f64::EPSILON * g.norm_squared();
    if !is_regular {
        return None;
    }
    let mut first = DVector::zeros(size);
    first[0] = 1.0;
    Some(q.rows(0, rows) * r.tr_solve_upper_triangular(&first)?)
}
