//! Search of the gain of cross-coupled control.

use virtual_axes_core::config::{Parameters, Value};
use virtual_axes_identify::tune::{
    Cost, MarginLimits, NoProgress, TuneError, Tuning, TuningProblem, tune_contour_gain,
};
use virtual_axes_verification::fixtures::tuning::{CIRCLE, THERE_AND_BACK, machine, workload};

const KEY: &str = "contour_control.gain";

/// Returns true if the machine accepts a gain, (m/min)/mm.
fn is_accepted(parameters: &Parameters, gain: f64) -> bool {
    let tuned = Tuning::ContourGain(gain).apply(parameters, &[]).expect("a gain in range");
    let config = tuned.machine_config().expect("a machine");
    virtual_axes_core::machine::MachineParameters::new(&config).is_ok()
}

#[test]
fn the_tuned_gain_lowers_the_contour_error_and_is_below_the_stability_limit() {
    let parameters = machine(&["x", "y"]);
    let circle = workload(CIRCLE, &parameters.machine_config().expect("a machine"));
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &circle, &cost, &NoProgress).expect("a problem");
    for limits in [MarginLimits::default(), MarginLimits::STABLE] {
        let found = tune_contour_gain(&problem, &limits).expect("a gain");
        let Tuning::ContourGain(gain) = found.best.tuning else { panic!("{}", found.best.tuning) };
        println!("{limits:?}: gain {gain}, {:.2} µm of {:.2} µm", found.best.cost, problem.present().cost);
        assert!(gain > 0.0 && found.best.cost < 0.8 * problem.present().cost);
        assert!(is_accepted(&parameters, gain));
        assert!(limits.allows(&found.best.margins.expect("margins")));
        // A run by itself gives the same cost, and no gain of a coarser grid is better.
        let again = problem.run(&found.best.tuning, None).expect("a run");
        assert_eq!(again.cost, found.best.cost);
        for k in 0..10 {
            let tuning = Tuning::ContourGain(f64::from(k) * 0.5);
            let margins = problem.margins(&tuning);
            if margins.is_some_and(|margins| limits.allows(&margins)) {
                let other = problem.run(&tuning, margins).expect("a run");
                assert!(
                    other.is_saturated || other.cost > 0.99 * found.best.cost,
                    "{tuning}: {}",
                    other.cost
                );
            }
        }
        let tuned = found.best.tuning.apply(&parameters, problem.joints()).expect("in range");
        assert_eq!(tuned.get(KEY), Some(Value::Double(gain)));
    }
}

#[test]
fn the_margins_end_where_the_machine_rejects_a_gain() {
    let parameters = machine(&["x", "y"]);
    let circle = workload(CIRCLE, &parameters.machine_config().expect("a machine"));
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &circle, &cost, &NoProgress).expect("a problem");
    let has_margins = |gain: f64| problem.margins(&Tuning::ContourGain(gain)).is_some();
    let mut rejected = 0;
    for k in 0..200 {
        let gain = 0.1 * f64::from(k);
        assert_eq!(has_margins(gain), is_accepted(&parameters, gain), "{gain}");
        rejected += usize::from(!has_margins(gain));
    }
    assert!((20..180).contains(&rejected), "{rejected}");
}

#[test]
fn a_path_of_one_axis_has_no_contour_gain() {
    let parameters = machine(&["x", "y"]);
    let line = workload(THERE_AND_BACK, &parameters.machine_config().expect("a machine"));
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &line, &cost, &NoProgress).expect("a problem");
    let error = tune_contour_gain(&problem, &MarginLimits::default()).expect_err("one axis");
    assert!(matches!(error, TuneError::NoContour), "{error}");
}
