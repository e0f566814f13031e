//! Generalized predictive control against the model page and against a second formulation.

use virtual_axes::design::{GpcTuning, PredictionModel, Weight, gpc};

fn assert_near(found: &[f64], wanted: &[f64], tolerance: f64) {
    assert_eq!(found.len(), wanted.len(), "{found:?} against {wanted:?}");
    for (f, w) in found.iter().zip(wanted) {
        assert!((f - w).abs() <= tolerance, "{found:?} against {wanted:?}");
    }
}

#[test]
fn the_check_vector_of_the_model_page() {
    let model = PredictionModel::new(vec![1.0, -0.8], vec![0.0, 0.4], 0.006).expect("a model");
    let tuning = GpcTuning { n1: 1, n2: 4, nu: 1, weight: Weight::Absolute(0.1) };
    let rst = gpc(&model, &tuning).expect("a controller");
    assert_near(rst.r(), &[2.98449263, -1.93600542], 5e-9);
    assert_near(rst.s(), &[1.0, -1.0], 1e-15);
    assert_near(rst.t(), &[0.12799, 0.23038, 0.31229, 0.37782], 5e-6);
    assert_eq!(rst.t_first(), 1);
}
