//! Iterative learning: runs, convergence, limits, deviating plants.

use virtual_axes_core::config::{MachineConfig, Parameters, Value, ValueSource, parse_assignment};
use virtual_axes_core::design::LearningTuning;
use virtual_axes_core::trial::{GridRows, Measures, SetpointSource, Trial, run, run_compensated};
use virtual_axes_identify::learn::{
    LearningEnd, LearningError, LearningOptions, LearningResult, SetpointQuantity, learn,
};
use virtual_axes_identify::tune::{NoProgress, Workload};
use virtual_axes_verification::fixtures::tuning::{CIRCLE, CORNER, machine, workload};

const OPTIONS: LearningOptions = LearningOptions {
    iterations: 6,
    tuning: LearningTuning { gain: 0.5, bandwidth: None },
    encoder_step: 0.0,
    acceleration_excess: 0.5,
    deviation: 0.3,
};

fn with(parameters: &Parameters, changes: &[(&str, f64)]) -> MachineConfig {
    let mut changed = parameters.clone();
    for axis in ["x", "y"] {
        for (key, value) in changes {
            let key = format!("{axis}.{key}");
            changed.set(&key, Value::Double(*value), &ValueSource::named("test")).expect("a parameter");
        }
    }
    changed.machine_config().expect("a machine")
}

/// Default machine with X and Y.
fn plane(changes: &[(&str, f64)]) -> MachineConfig {
    with(&machine(&["x", "y"]), changes)
}

const WITHOUT_FRICTION: [(&str, f64); 3] = [("friction.c", 0.0), ("friction.a", 0.0), ("friction.i0", 0.0)];

fn learned(config: &MachineConfig, path: &str, options: &LearningOptions) -> LearningResult {
    learn(config, &workload(path, config), options, false, false, &NoProgress).expect("learned")
}

#[test]
fn without_friction_the_error_contracts_at_least_by_the_reported_factor() {
    let config = plane(&WITHOUT_FRICTION);
    let found = learned(&config, CIRCLE, &OPTIONS);
    assert_eq!(found.iterations.len(), 7);
    for (place, axis) in found.axes.iter().enumerate() {
        let factor = axis.filter.nominal().factor;
        let rms: Vec<f64> = found.iterations.iter().map(|run| run.axes[place].rms).collect();
        // e(j+1) = Q (1 − L T) e(j) + (1 − Q) (1 − T) r, the last term at most 0.02 e(0) on this circle.
        for pair in rms.windows(2) {
            assert!(pair[1] <= factor * pair[0] + 0.02 * rms[0], "{}: {rms:?}", axis.name);
        }
        assert!(rms[6] < 0.05 * rms[0], "{rms:?}");
    }
    assert!(found.iterations[6].error() < 0.1 * found.iterations[0].error());
}

#[test]
fn results_are_deterministic_and_begin_with_the_plain_run() {
    let config = plane(&[]);
    let (first, second) = (learned(&config, CIRCLE, &OPTIONS), learned(&config, CIRCLE, &OPTIONS));
    assert_eq!(first, second);
    let plain = workload(CIRCLE, &config).run(&config, false, false, |_| Ok(())).expect("a run");
    assert_eq!(first.iterations[0].figures, plain.figures);
    assert_eq!(first.iterations[first.best].figures, first.outcomes[1].figures);
    // The motion starts and ends at the programmed positions.
    let (count, last) = (2, first.psec.len() - 2);
    assert_eq!(first.psec[..count], first.programmed[..count]);
    assert_eq!(first.psec[last..], first.programmed[last..]);
    assert_eq!(first.psec.len(), first.programmed.len());
}

#[test]
fn contour_errors_are_those_against_the_programmed_setpoints() {
    let config = plane(&[]);
    let found = learned(&config, CIRCLE, &OPTIONS);
    let trial = Trial {
        machine: &config,
        program: None,
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::ALL,
    };
    let rows = |psec| SetpointSource::Grid(Box::new(GridRows::new(&[0, 1], psec)));
    let plain = run(&trial, rows(&found.programmed), |_| Ok(())).expect("a run").figures;
    let same = run_compensated(&trial, rows(&found.programmed), &found.programmed, |_| Ok(()));
    assert_eq!(same.expect("a run").figures, plain);
    let compensated = run_compensated(&trial, rows(&found.psec), &found.programmed, |_| Ok(()));
    let [contour, path] = [compensated.expect("a run").figures, found.iterations[found.best].figures.clone()]
        .map(|figures| figures.contour.expect("a contour").max);
    // The chord of the circle lies inside by (v Tsp)²/(8 R) = 6.25 µm at 10 m/min.
    assert!((contour - path).abs() < 6.5e-6, "{contour} and {path}");
    assert!(contour < 0.5 * plain.contour.expect("a contour").max);
    // Setpoints without a known path learn against their own polyline.
    let setpoints = Workload::read("rows", None, rows(&found.programmed), || Ok(())).expect("rows");
    let of_rows = learn(&config, &setpoints, &OPTIONS, false, false, &NoProgress).expect("learned");
    for (of_rows, of_path) in of_rows.programmed.iter().zip(&found.programmed) {
        assert!((of_rows - of_path).abs() < 1e-15, "{of_rows} and {of_path}");
    }
    assert!(of_rows.iterations[of_rows.best].error() < 0.5 * of_rows.iterations[0].error());
}

#[test]
fn filters_of_the_nominal_plant_converge_on_deviating_plants() {
    for deviation in [
        [("deviation.inertia", 0.7), ("deviation.torque_constant", 1.3), ("deviation.friction", 0.7)],
        [("deviation.inertia", 1.3), ("deviation.torque_constant", 0.7), ("deviation.friction", 1.3)],
    ] {
        let found = learned(&plane(&deviation), CIRCLE, &OPTIONS);
        assert_eq!(found.axes[0].filter, learned(&plane(&[]), CIRCLE, &OPTIONS).axes[0].filter);
        assert_eq!(found.axes[0].deviating.len(), 8);
        assert!(found.axes[0].worst_deviating().factor < 1.0);
        let errors: Vec<f64> = found.iterations.iter().map(|run| run.error()).collect();
        assert!(found.iterations[found.best].error() < 0.4 * errors[0], "{deviation:?}: {errors:?}");
    }
}

#[test]
fn compensated_setpoints_keep_velocity_and_travel_limits() {
    let plain = plane(&[]);
    // Limits that the programmed motion just reaches.
    let program = learned(&plain, CORNER, &OPTIONS).programmed;
    let x: Vec<f64> = program.iter().step_by(2).copied().collect();
    let fastest = x.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max) / 0.006;
    let limits = [("limits.velocity_m_min", 60.0 * fastest * (1.0 + 1e-10)), ("limits.travel_max_mm", 10.0)];
    let config = plane(&limits);
    let rows = Workload::read(
        "rows",
        None,
        SetpointSource::Grid(Box::new(GridRows::new(&[0, 1], &program))),
        || Ok(()),
    )
    .expect("rows");
    let found = learn(&config, &rows, &OPTIONS, false, false, &NoProgress).expect("learned");
    assert!(found.best > 0);
    for column in 0..2 {
        let psec: Vec<f64> = found.psec.iter().skip(column).step_by(2).copied().collect();
        assert!(psec.iter().all(|x| *x <= 0.01 + 1e-9));
        assert!(psec.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= fastest * 0.006 * (1.0 + 1e-9)));
    }
}

#[test]
fn an_excess_of_acceleration_names_axis_time_value_and_limit() {
    let config = plane(&[]);
    let tuning = LearningTuning { gain: 1.5, bandwidth: Some(80.0) };
    let options = LearningOptions { tuning, acceleration_excess: 0.0, ..OPTIONS };
    let error = learn(&config, &workload(CORNER, &config), &options, false, false, &NoProgress);
    let excess = match error {
        Err(LearningError::Excess(excess)) => excess,
        Ok(LearningResult { end: LearningEnd::Limit(excess), .. }) => excess,
        other => panic!("{other:?}"),
    };
    assert_eq!(excess.quantity, SetpointQuantity::Acceleration);
    assert!(excess.value > excess.limit && excess.limit >= 2.1, "{excess:?}");
    let text = excess.to_string();
    assert!(
        text.starts_with("axis ") && text.contains("the acceleration of the compensated setpoints is"),
        "{text}"
    );
}

#[test]
fn a_learning_that_diverges_keeps_the_best_run() {
    // A bandwidth far above that of friction at reversals.
    let tuning = LearningTuning { gain: 1.5, bandwidth: Some(80.0) };
    let options = LearningOptions { iterations: 30, tuning, acceleration_excess: 10.0, ..OPTIONS };
    let found = learned(&plane(&[]), CIRCLE, &options);
    assert_eq!(found.end, LearningEnd::Diverged);
    let errors: Vec<f64> = found.iterations.iter().map(|run| run.error()).collect();
    let [a, b, c] = errors[errors.len() - 3..] else { panic!("{errors:?}") };
    assert!(a < b && b < c, "{errors:?}");
    assert!(errors.iter().all(|error| *error >= errors[found.best]));
}

#[test]
fn invalid_options_and_idle_machines_are_rejected() {
    let config = plane(&[]);
    let path = workload(CIRCLE, &config);
    let text = |options: LearningOptions| {
        learn(&config, &path, &options, false, false, &NoProgress).expect_err("an error").to_string()
    };
    assert!(text(LearningOptions { iterations: 0, ..OPTIONS }).contains("1 … 1000 are allowed"));
    assert!(
        text(LearningOptions { encoder_step: -1.0, ..OPTIONS }).contains("must be finite and not negative")
    );
    let tuning = LearningTuning { gain: 2.5, bandwidth: None };
    let refused = text(LearningOptions { tuning, ..OPTIONS });
    assert!(refused.starts_with("axis x: the learning does not converge: |Q (1 − L T)| is "), "{refused}");
    let mut contour = machine(&["x", "y"]);
    let gain = Value::Double(2.0);
    contour.set("contour_control.gain", gain, &ValueSource::named("test")).expect("a parameter");
    let contour = contour.machine_config().expect("a machine");
    let error = learn(&contour, &path, &OPTIONS, false, false, &NoProgress).expect_err("an error");
    assert!(error.to_string().starts_with("contour_control.gain must be 0"), "{error}");
    let mut gantry = machine(&["x", "y"]);
    let source = ValueSource::named("test");
    let assignments = ["gantry.axes=[x, y]", "gantry.stiffness_n_um=100"]
        .map(|text| parse_assignment(text, &source).expect("an assignment"));
    gantry.set_all(assignments.into()).expect("parameters");
    let gantry = gantry.machine_config().expect("a machine");
    let error = learn(&gantry, &path, &OPTIONS, false, false, &NoProgress).expect_err("an error");
    assert!(error.to_string().starts_with("workpiece.mass_kg must be 0 and gantry.axes absent"), "{error}");
    let rest = [0.0; 40];
    let idle = SetpointSource::Grid(Box::new(GridRows::new(&[0, 1], &rest)));
    let idle = Workload::read("rest", None, idle, || Ok(())).expect("rows");
    let error = learn(&config, &idle, &OPTIONS, false, false, &NoProgress).expect_err("an error");
    assert_eq!(error.to_string(), "no axis moves: there is nothing to learn");
}
