//! Generalized predictive control against the model page and against a least-squares formulation.

use crate::design_common::{axes, gpc_controller, models, relative};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use virtual_axes_core::control::Rst;
use virtual_axes_core::design::{ControlWeight, DesignError, GpcTuning, PredictionModel, gpc};

fn assert_near(found: &[f64], wanted: &[f64], tolerance: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?}, expected {wanted:?}");
    for (f, w) in found.iter().zip(wanted) {
        assert!((f - w).abs() <= tolerance, "{found:?}, expected {wanted:?}");
    }
}

#[test]
fn gpc_reproduces_the_check_vector_of_the_model_page() {
    let model = PredictionModel::new(vec![1.0, -0.8], vec![0.0, 0.4], 0.006).expect("a model");
    let tuning = GpcTuning { n1: 1, n2: 4, nu: 1, weight: ControlWeight::Absolute(0.1) };
    let rst = gpc(&model, &tuning).expect("a controller");
    assert_near(rst.r(), &[2.98449263, -1.93600542], 5e-9);
    assert_near(rst.s(), &[1.0, -1.0], 1e-15);
    assert_near(rst.t(), &[0.12799, 0.23038, 0.31229, 0.37782], 5e-6);
    assert_eq!(rst.t_first(), 1);
}

/// Known signals at position cycle k: past θ and Ω*, newest first, and setpoints from k + 1 on.
#[derive(Debug)]
struct Situation {
    angles: Vec<f64>,
    speeds: Vec<f64>,
    setpoints: Vec<f64>,
}

impl Situation {
    /// Computes θ(k + 1) … θ(k + n) of A Δθ = B ΔΩ* for `increments` of Ω* from k on by the difference equation.
    fn response(&self, model: &PredictionModel, increments: &[f64], n: usize) -> Vec<f64> {
        // Oldest first, k at the end.
        let mut angles: Vec<f64> = self.angles.iter().rev().copied().collect();
        let mut speeds: Vec<f64> = self.speeds.iter().rev().copied().collect();
        let present = angles.len();
        let back = |signal: &[f64], lag: usize| {
            let lagged = |lag: usize| signal[signal.len() - lag];
            lagged(lag) - lagged(lag + 1)
        };
        for step in 0..n {
            speeds.push(speeds[speeds.len() - 1] + increments.get(step).copied().unwrap_or(0.0));
            let mut difference = 0.0;
            for (lag, c) in model.b().iter().enumerate().skip(1) {
                difference += c * back(&speeds, lag);
            }
            for (lag, c) in model.a().iter().enumerate().skip(1) {
                difference -= c * back(&angles, lag);
            }
            angles.push(angles[angles.len() - 1] + difference);
        }
        angles[present..].to_vec()
    }

    /// Computes the first increment of Ω* that minimizes Σ (θ* − θ)² + λ Σ ΔΩ*² over the horizons: least squares of the
    /// residuals, whose derivatives are the responses to single increments. λ_rel uses the same responses.
    fn first_increment(&self, model: &PredictionModel, tuning: &GpcTuning) -> f64 {
        let GpcTuning { n1, n2, nu, weight } = *tuning;
        let free = self.response(model, &[], n2)[n1 - 1..].to_vec();
        let forced = unit_responses(model, tuning);
        let lambda = match weight {
            ControlWeight::Absolute(lambda) => lambda,
            ControlWeight::Relative(lambda) => lambda * sum_of_squares(&forced),
        };
        // The residuals e = w − J ΔΩ* are smallest for Jᵀ e = 0; e and ΔΩ* are the unknowns of one system.
        let (rows, all) = (n2 - n1 + 1, n2 - n1 + 1 + nu);
        let derivative = |row: usize, column: usize| match row.checked_sub(rows) {
            None => forced[column][row],
            Some(moved) => f64::from(u8::from(moved == column)) * lambda.sqrt(),
        };
        let system = DMatrix::from_fn(all + nu, all + nu, |row, column| match (row < all, column < all) {
            (true, true) => f64::from(u8::from(row == column)),
            (true, false) => derivative(row, column - all),
            (false, true) => derivative(column, row - all),
            (false, false) => 0.0,
        });
        let wanted = DVector::from_fn(all + nu, |row, _| {
            if row < rows { self.setpoints[n1 - 1 + row] - free[row] } else { 0.0 }
        });
        system.full_piv_lu().solve(&wanted).expect("λ > 0")[all]
    }

    /// Computes ΔΩ*(k) of S Ω* = −R θ + T θ*.
    fn rst_increment(&self, rst: &Rst) -> f64 {
        let setpoint = |ahead: i64| self.setpoints[usize::try_from(ahead - 1).expect("T reads ahead")];
        let t: f64 = rst.t().iter().zip(rst.t_first()..).map(|(c, ahead)| c * setpoint(ahead)).sum();
        let r: f64 = rst.r().iter().zip(&self.angles).map(|(c, angle)| c * angle).sum();
        let s: f64 = rst.s()[1..].iter().zip(&self.speeds).map(|(c, speed)| c * speed).sum();
        t - r - s - self.speeds[0]
    }
}

/// Returns the responses of θ over the horizon to a unit of each increment.
fn unit_responses(model: &PredictionModel, tuning: &GpcTuning) -> Vec<Vec<f64>> {
    let rest = Situation { angles: vec![0.0; 12], speeds: vec![0.0; 12], setpoints: Vec::new() };
    let response = |moved: usize| {
        let mut increments = vec![0.0; tuning.nu];
        increments[moved] = 1.0;
        rest.response(model, &increments, tuning.n2)[tuning.n1 - 1..].to_vec()
    };
    (0..tuning.nu).map(response).collect()
}

fn sum_of_squares(columns: &[Vec<f64>]) -> f64 {
    columns.iter().flatten().map(|g| g * g).sum()
}

fn tunings() -> impl Strategy<Value = GpcTuning> {
    let horizons = (1_usize..30).prop_flat_map(|n2| (1..=n2, Just(n2), 1..=n2));
    (horizons, -4.0..0.0_f64).prop_map(|((n1, n2, nu), exponent)| relative(n1, n2, nu, 10_f64.powf(exponent)))
}

fn situations() -> impl Strategy<Value = Situation> {
    let signal = |count| prop::collection::vec(-1.0..1.0_f64, count);
    (signal(12), signal(12), signal(30)).prop_map(|(angles, speeds, setpoints)| Situation {
        angles,
        speeds,
        setpoints,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn first_increment_minimizes_the_criterion(
        model in models(),
        tuning in tunings(),
        situation in situations(),
    ) {
        // A horizon shorter than the dead time has no response.
        prop_assume!(model.b().iter().take(tuning.n2 + 1).any(|b| *b != 0.0));
        let rst = gpc(&model, &tuning).expect("a controller");
        let (found, wanted) = (situation.rst_increment(&rst), situation.first_increment(&model, &tuning));
        let size: f64 = rst.r().iter().chain(rst.t()).chain(rst.s()).map(|c| c.abs()).sum();
        prop_assert!((found - wanted).abs() <= 1e-9 * size, "{found}, expected {wanted}");
        // The same weight as absolute λ.
        let ControlWeight::Relative(lambda) = tuning.weight else { unreachable!("the tunings are relative") };
        let weight = ControlWeight::Absolute(lambda * sum_of_squares(&unit_responses(&model, &tuning)));
        let found = situation.rst_increment(&gpc(&model, &GpcTuning { weight, ..tuning }).expect("a controller"));
        prop_assert!((found - wanted).abs() <= 1e-9 * size, "{found}, expected {wanted}");
    }
}

#[test]
fn first_increment_minimizes_the_criterion_on_every_axis() {
    let wave = |count: usize, rate: f64| (0..count).map(|i| (rate * i as f64).sin()).collect();
    let situation = Situation { angles: wave(12, 0.3), speeds: wave(12, 2.0), setpoints: wave(30, 0.7) };
    for (name, model) in axes() {
        for tuning in [relative(1, 14, 12, 0.005), relative(1, 8, 6, 1e-3), relative(3, 20, 2, 0.1)] {
            let rst = gpc_controller(&model, tuning);
            let (found, wanted) = (situation.rst_increment(&rst), situation.first_increment(&model, &tuning));
            let size: f64 = rst.r().iter().chain(rst.t()).map(|c| c.abs()).sum();
            assert!((found - wanted).abs() <= 1e-10 * size, "{name}: {found}, expected {wanted}");
        }
    }
}

#[track_caller]
fn assert_rejected(tuning: GpcTuning, words: &str) {
    let model = PredictionModel::new(vec![1.0, -0.8], vec![0.0, 0.4], 0.006).expect("a model");
    assert_eq!(gpc(&model, &tuning).expect_err("rejected").to_string(), words);
}

#[test]
fn tunings_out_of_range_are_rejected_by_name() {
    let tuning = |n1, n2, nu, weight| GpcTuning { n1, n2, nu, weight };
    let light = ControlWeight::Absolute(0.1);
    assert_rejected(tuning(5, 4, 1, light), "n1 = 5 must lie in 1 … n2 = 4");
    assert_rejected(tuning(0, 4, 1, light), "n1 = 0 must lie in 1 … n2 = 4");
    assert_rejected(tuning(1, 4, 5, light), "nu = 5 must lie in 1 … n2 = 4");
    assert_rejected(tuning(1, 4, 0, light), "nu = 0 must lie in 1 … n2 = 4");
    assert_rejected(tuning(1, 0, 1, light), "n2 = 0 must lie in 1 … 200");
    assert_rejected(tuning(1, 201, 1, light), "n2 = 201 must lie in 1 … 200");
    for (weight, name) in [
        (ControlWeight::Absolute(-0.1), "lambda = -0.1"),
        (ControlWeight::Relative(-0.1), "lambda_rel = -0.1"),
        (ControlWeight::Absolute(f64::NAN), "lambda = NaN"),
        (ControlWeight::Relative(f64::INFINITY), "lambda_rel = inf"),
    ] {
        assert_rejected(tuning(1, 4, 1, weight), &format!("{name} must be finite and not negative"));
    }
}

#[test]
fn singular_matrix_is_rejected_by_name() {
    // Two cycles of dead time: only the first increment has a response within three cycles.
    let late = PredictionModel::new(vec![1.0, -0.8], vec![0.0, 0.0, 0.0, 0.4], 0.006).expect("a model");
    let of = |n2, nu, weight| gpc(&late, &GpcTuning { n1: 1, n2, nu, weight });
    for weight in [ControlWeight::Absolute(0.0), ControlWeight::Relative(0.0)] {
        assert!(of(3, 1, weight).is_ok());
        assert_eq!(of(3, 2, weight), Err(DesignError::Singular { n1: 1, n2: 3, nu: 2, lambda: 0.0 }));
        let message = of(2, 1, weight).expect_err("no response within the horizon").to_string();
        assert!(
            message.starts_with("the matrix GᵀG + λI of n1 = 1, n2 = 2, nu = 1 is singular"),
            "{message}"
        );
    }
    assert!(of(3, 2, ControlWeight::Absolute(0.1)).is_ok());
}
