//! Robustness of tunings on deviating plants, and the control activity.

use virtual_axes_core::assess::AxisAssessor;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters, Value, ValueSource};
use virtual_axes_core::machine::{Activity, AxisSample, deviating_plant_model, prediction_model};
use virtual_axes_core::trial::Figures;
use virtual_axes_identify::tune::{Cost, NoProgress, PlantDeviation, analyze_robustness};
use virtual_axes_verification::fixtures::tuning::{CIRCLE, machine, workload};

fn with(parameters: &Parameters, changes: &[(&str, f64)]) -> Parameters {
    let mut changed = parameters.clone();
    for (key, value) in changes {
        changed.set(key, Value::Double(*value), &ValueSource::named("test")).expect(key);
    }
    changed
}

#[test]
fn a_deviating_model_equals_the_model_of_a_machine_with_that_plant() {
    let nominal = machine(&["x"]);
    let model = |parameters: &Parameters, of: fn(&AxisConfig, &_) -> Result<_, _>| {
        let config = parameters.machine_config().expect("a machine");
        of(&config.axes()[0], &config.periods()).expect("a model")
    };
    let deviating = with(&nominal, &[("x.deviation.inertia", 1.3), ("x.deviation.torque_constant", 0.7)]);
    // The velocity loop divides its torque by the nominal Kt: a smaller Kt acts like a smaller Kv.
    let such = with(
        &nominal,
        &[
            ("x.motor.inertia_kg_m2", 0.028 * 1.3),
            ("x.motor.torque_constant_nm_a", 2.64 * 0.7),
            ("x.velocity_loop.gain", 5.0 * 0.7),
        ],
    );
    let (found, expected) = (model(&deviating, deviating_plant_model), model(&such, prediction_model));
    assert_eq!(found.a().len(), expected.a().len());
    for (a, b) in found.a().iter().chain(found.b()).zip(expected.a().iter().chain(expected.b())) {
        assert!((a - b).abs() < 1e-9, "{a} and {b}");
    }
    // The model of the controller design does not contain the deviation.
    assert_eq!(model(&deviating, prediction_model), model(&nominal, prediction_model));
    assert_eq!(model(&nominal, deviating_plant_model), model(&nominal, prediction_model));
}

#[test]
fn each_deviation_equals_a_separate_run() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(CIRCLE, &config);
    let cost = Cost::default();
    let found = analyze_robustness(&parameters, &workload, &cost, 0.3, &NoProgress).expect("runs");
    // The deviating plants are compared by errors and currents.
    let without_energy = |mut figures: Figures| {
        figures.dc_link = None;
        figures.axes.iter_mut().for_each(|axis| axis.energy = None);
        figures
    };
    let figures_of = |config: &MachineConfig| {
        without_energy(workload.run(config, false, false, |_| Ok(())).expect("a run").figures)
    };
    assert_eq!(found.nominal.figures, figures_of(&config));
    assert_eq!(found.nominal.deviation, PlantDeviation::NONE);
    assert_eq!(found.single.len(), 6);
    for (index, (name, factor)) in [
        ("inertia", 0.7),
        ("inertia", 1.3),
        ("friction", 0.7),
        ("friction", 1.3),
        ("torque_constant", 0.7),
        ("torque_constant", 1.3),
    ]
    .into_iter()
    .enumerate()
    {
        let keys = [format!("x.deviation.{name}"), format!("y.deviation.{name}")];
        let changed = with(&parameters, &[(&keys[0], factor), (&keys[1], factor)]);
        let config = changed.machine_config().expect("a machine");
        let figures = figures_of(&config);
        assert_eq!(found.single[index].figures, figures, "{name} × {factor}");
        assert_ne!(figures, found.nominal.figures, "{name} × {factor}");
    }
    // Friction is outside the linear loop.
    assert_eq!(found.single[2].margins, found.nominal.margins);
    assert_ne!(found.single[1].margins, found.nominal.margins);
    let combined = PlantDeviation::combined(0.3);
    assert!(combined.contains(&found.worst.deviation));
    assert_eq!(
        combined.map(|d| (d.inertia + d.friction + d.torque_constant) * 10.0).iter().sum::<f64>().round(),
        240.0
    );
}

#[test]
fn control_activity_is_the_rms_of_changes_per_position_cycle() {
    let mut assessor = AxisAssessor::default();
    let sample = |current_setpoint: f64| AxisSample { current_setpoint, ..AxisSample::default() };
    // The first value is no change; values between position cycles do not count.
    let activity = Activity { peak_current: 100.0, ..Activity::default() };
    for current in [10.0, 13.0, 9.0, 9.0, 9.0] {
        assessor.observe(&sample(current), &activity);
    }
    // √((3² + 4²) / 4)
    assert_eq!(assessor.report(1.0).control_activity, 2.5);
    let mut once = AxisAssessor::default();
    once.observe(&sample(5.0), &activity);
    assert_eq!(once.report(1.0).control_activity, 0.0);
}
