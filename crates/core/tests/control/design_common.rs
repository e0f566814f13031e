//! Models and closed loops for the tests of controller designs, independent of the library.

use nalgebra::Complex;
use proptest::prelude::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{ControlWeight, GpcTuning, PredictionModel, gpc};
use virtual_axes_core::machine::prediction_model;

/// Position cycle of the default machine, s.
pub const TSP: f64 = 0.006;

pub fn model(a: &[f64], b: &[f64]) -> PredictionModel {
    PredictionModel::new(a.to_vec(), b.to_vec(), TSP).expect("a model")
}

/// Returns names and prediction models of the axes of the default machine.
pub fn axes() -> Vec<(String, PredictionModel)> {
    let config =
        Parameters::embedded_default().and_then(|p| p.machine_config()).expect("the machine is valid");
    let periods = config.periods();
    let model = |axis| prediction_model(axis, &periods).expect("a model");
    config.axes().iter().map(|axis| (axis.name().to_owned(), model(axis))).collect()
}

pub fn relative(n1: usize, n2: usize, nu: usize, lambda: f64) -> GpcTuning {
    GpcTuning { n1, n2, nu, weight: ControlWeight::Relative(lambda) }
}

/// Returns the controller with R and T multiplied by `factor`.
pub fn scaled_gain(rst: &Rst, factor: f64) -> Rst {
    let times = |p: &[f64]| p.iter().map(|c| c * factor).collect::<Vec<_>>();
    Rst::new(&times(rst.r()), rst.s(), &times(rst.t()), rst.t_first()).expect("a controller")
}

/// Returns the model with an additional delay of `periods` position cycles.
pub fn delayed(of: &PredictionModel, periods: usize) -> PredictionModel {
    let mut b = vec![0.0; periods];
    b.extend(of.b());
    model(of.a(), &b)
}

/// Evaluates Σ cᵢ q⁻ⁱ at q = e^{jx}.
pub fn at(polynomial: &[f64], x: f64) -> Complex<f64> {
    polynomial.iter().enumerate().map(|(i, c)| Complex::from_polar(*c, -x * i as f64)).sum()
}

/// Evaluates L = B R / (A S) at the angle x.
pub fn open_loop(model: &PredictionModel, rst: &Rst, x: f64) -> Complex<f64> {
    at(model.b(), x) * at(rst.r(), x) / (at(model.a(), x) * at(rst.s(), x))
}

/// Generates models with real or complex poles and zeros inside the unit circle, some with an integrator.
pub fn models() -> impl Strategy<Value = PredictionModel> {
    let roots = |last: f64| prop::collection::vec((-last..last, 0.0..1.0_f64, any::<bool>()), 0..3);
    (roots(0.95), roots(0.9), any::<bool>(), 0_usize..3, 0.01..10.0_f64).prop_map(
        |(poles, zeros, integrating, dead, gain)| {
            let mut a = vec![1.0];
            let mut b = vec![gain];
            for (polynomial, roots) in [(&mut a, poles), (&mut b, zeros)] {
                for (size, turn, pair) in roots {
                    *polynomial = match pair {
                        false => times(polynomial, &[1.0, -size]),
                        true => times(polynomial, &[1.0, -2.0 * size * (3.0 * turn).cos(), size * size]),
                    };
                }
            }
            if integrating {
                a = times(&a, &[1.0, -1.0]);
            }
            let mut delayed = vec![0.0; dead + 1];
            delayed.extend(b);
            model(&a, &delayed)
        },
    )
}

pub fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Designs a GPC controller for an axis.
pub fn gpc_controller(model: &PredictionModel, tuning: GpcTuning) -> Rst {
    gpc(model, &tuning).expect("a controller")
}
