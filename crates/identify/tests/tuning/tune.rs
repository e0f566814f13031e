//! Tuning search: as good as a brute-force grid, within the margins, independent of the number of threads.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;
use virtual_axes_core::config::{MachineConfig, Parameters, Value, ValueSource};
use virtual_axes_core::design::{ControlWeight, GpcTuning, gpc, margins};
use virtual_axes_core::machine::prediction_model;
use virtual_axes_core::trial::{self, GridRows, Measures, SetpointSource, Trial};
use virtual_axes_identify::tune::{
    Cost, CostTerm, MarginLimits, NoProgress, Progress, SearchResult, TuneError, Tuning, TuningCandidate,
    TuningProblem, Workload, find_contrasts, pareto_front, tune_cascade, tune_gpc,
};
use virtual_axes_verification::fixtures::tuning::{
    CIRCLE, CORNER, THERE_AND_BACK, machine, program, setpoints, workload,
};

const MICROMETER: f64 = 1e-6;

fn set(parameters: &mut Parameters, key: &str, value: Value) {
    parameters.set(key, value, &ValueSource::named("test")).expect(key);
}

/// Returns the machine with a predictive controller on each of `joints`, set key by key.
fn with_gpc(parameters: &Parameters, joints: &[&str], tuning: (i64, i64, i64, f64)) -> MachineConfig {
    let (n1, n2, nu, lambda_rel) = tuning;
    let mut tuned = parameters.clone();
    for joint in joints {
        let key = |name: &str| format!("{joint}.position_loop.{name}");
        // N2 is set first if it grows and last if it shrinks, so that it is never below the others.
        set(&mut tuned, &key("gpc.n2"), Value::Integer(60));
        set(&mut tuned, &key("gpc.n1"), Value::Integer(n1));
        set(&mut tuned, &key("gpc.nu"), Value::Integer(nu));
        set(&mut tuned, &key("gpc.n2"), Value::Integer(n2));
        set(&mut tuned, &key("gpc.lambda_rel"), Value::Double(lambda_rel));
        set(&mut tuned, &key("controller"), Value::Text("gpc".to_owned()));
    }
    tuned.machine_config().expect("a machine")
}

/// Returns the largest delay-compensated following error of the first axis, µm; none if a limit is reached.
fn following_error(config: &MachineConfig, scenario: &str) -> Option<f64> {
    let program = program(scenario, config);
    let trial = Trial {
        machine: config,
        program: Some(Arc::clone(&program)),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::ALL,
    };
    let outcome = trial::run(&trial, setpoints(&program, config), |_| Ok(())).expect("a run");
    let report = outcome.figures.axes[0].report;
    (report.saturation_time == 0.0).then_some(report.max_delay_compensated_following_error / MICROMETER)
}

#[test]
fn the_tuning_is_as_good_as_any_of_the_grid_by_brute_force() {
    let parameters = machine(&["x"]);
    let config = parameters.machine_config().expect("a machine");
    let model = prediction_model(&config.axes()[0], &config.periods()).expect("a model");
    // The grid, written out.
    let mut grid = Vec::new();
    for n2 in 1..=24 {
        for nu in 1..=n2.min(8) {
            for decade in [1e-4, 1e-3, 1e-2, 1e-1] {
                grid.extend([1.0, 2.0, 5.0].map(|digit| (n2, nu, digit * decade)));
            }
        }
    }
    assert_eq!(grid.len(), 12 * (36 + 16 * 8));
    let keeping: Vec<_> = grid
        .into_iter()
        .filter(|&(n2, nu, lambda_rel)| {
            let tuning = GpcTuning { n1: 1, n2, nu, weight: ControlWeight::Relative(lambda_rel) };
            let design = gpc(&model, &tuning).ok().and_then(|rst| margins(&model, &rst).ok());
            design.is_some_and(|margins| margins.modulus >= 0.5 && margins.delay >= 0.005)
        })
        .collect();
    assert!(keeping.len() > 300, "only {} keep the margins", keeping.len());
    let cost = |&(n2, nu, lambda_rel): &(usize, usize, f64)| {
        following_error(&with_gpc(&parameters, &["x"], (1, n2 as i64, nu as i64, lambda_rel)), THERE_AND_BACK)
    };
    let best =
        keeping.par_iter().filter_map(cost).min_by(f64::total_cmp).expect("one that does not saturate");

    let workload = workload(THERE_AND_BACK, &config);
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
    let found = tune_gpc(&problem, &MarginLimits::default()).expect("a tuning");
    assert!(found.best.cost <= best, "{} found, {best} on the grid", found.best.cost);
    // A single axis has no contour: the cost is its largest delay-compensated following error.
    let Tuning::Gpc { n1, n2, nu, lambda_rel } = found.best.tuning else { panic!("{}", found.best.tuning) };
    let again = with_gpc(&parameters, &["x"], (n1 as i64, n2 as i64, nu as i64, lambda_rel));
    assert_eq!(following_error(&again, THERE_AND_BACK), Some(found.best.cost));
    let rst = gpc(&model, &GpcTuning { n1, n2, nu, weight: ControlWeight::Relative(lambda_rel) })
        .expect("a design");
    let kept = margins(&model, &rst).expect("stable");
    assert!(kept.modulus >= 0.5 && kept.delay >= 0.005, "{kept:?}");
}

#[test]
fn the_tuning_for_a_corner_is_as_good_as_a_grid_of_later_horizons_and_finer_weights() {
    // A grid that the search does not have: N1 from 3, where the best λ is ten times lower than with N1 = 2.
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let models =
        [0, 1].map(|axis| prediction_model(&config.axes()[axis], &config.periods()).expect("a model"));
    let path = workload(include_str!("../../../../config/scenarios/corner-90.yaml"), &config);
    let horizons = (4..=7).flat_map(|n2| (3..=4).map(move |n1| (n1, n2)));
    let weights = |(n1, n2)| (0..24).map(move |k| (n1, n2, 2, 2e-3 * 10_f64.powf(f64::from(k) / 15.0)));
    let keeping = |&(n1, n2, nu, lambda_rel): &(usize, usize, usize, f64)| {
        let tuning = GpcTuning { n1, n2, nu, weight: ControlWeight::Relative(lambda_rel) };
        models.iter().all(|model| {
            let design = gpc(model, &tuning).ok().and_then(|rst| margins(model, &rst).ok());
            design.is_some_and(|margins| margins.modulus >= 0.5 && margins.delay >= 0.005)
        })
    };
    let grid: Vec<_> = horizons.flat_map(weights).filter(keeping).collect();
    assert!(grid.len() > 50, "only {} keep the margins", grid.len());
    let contour_error = |&(n1, n2, nu, lambda_rel): &(usize, usize, usize, f64)| {
        let tuned = with_gpc(&parameters, &["x", "y"], (n1 as i64, n2 as i64, nu as i64, lambda_rel));
        let figures = path.run(&tuned, false, false, |_| Ok(())).expect("a run").figures;
        figures.contour.expect("a contour").max / MICROMETER
    };
    let best = grid.par_iter().map(contour_error).min_by(f64::total_cmp).expect("a run");
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &path, &cost, &NoProgress).expect("a tuning problem");
    let found = tune_gpc(&problem, &MarginLimits::default()).expect("a tuning").best;
    // The search refines λ to 2 %, the grid has steps of 17 %.
    assert!(found.cost <= best, "{} with {}, {best} on the grid", found.cost, found.tuning);
}

/// Runs a search with a number of threads.
fn with_threads(threads: usize, search: impl Fn() -> SearchResult + Sync) -> SearchResult {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    // `install` uses the pool only from another thread.
    let search = &search;
    std::thread::scope(|scope| scope.spawn(|| pool.install(search)).join().expect("a search"))
}

#[test]
fn the_result_is_independent_of_the_number_of_threads() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(CORNER, &config);
    let cost: Cost = "contour=1,rms=0.5,activity=10".parse().expect("a cost");
    // High margins leave few designs to run.
    let limits = MarginLimits { modulus: 0.75, delay: 0.01 };
    let search = |seed: Option<u64>| {
        let problem =
            TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
        match seed {
            None => tune_gpc(&problem, &limits).expect("a tuning"),
            Some(seed) => tune_cascade(&problem, &limits, seed).expect("a tuning"),
        }
    };
    for seed in [None, Some(7)] {
        let one = with_threads(1, || search(seed));
        assert!(one.tried.len() > 20, "only {} tried", one.tried.len());
        assert_eq!(one, with_threads(2, || search(seed)));
        assert_eq!(one, with_threads(5, || search(seed)));
    }
}

#[test]
fn the_cascade_is_tuned_within_the_margins() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(CIRCLE, &config);
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
    let limits = MarginLimits { modulus: 0.7, delay: 0.02 };
    let found = tune_cascade(&problem, &limits, 1).expect("a tuning");
    // The feedforward lag of the present machine costs ΔR ≈ v²/(R Kp) Tsp/2: 167 µm here.
    assert!(problem.present().cost > 150.0, "{}", problem.present().cost);
    assert!(found.best.cost < problem.present().cost / 5.0, "{}", found.best.cost);
    let Tuning::Cascade(axes) = &found.best.tuning else { panic!("{}", found.best.tuning) };
    assert_eq!(axes.iter().map(|(joint, _)| joint.as_str()).collect::<Vec<_>>(), ["x", "y"]);
    for ((_, gains), axis) in axes.iter().zip(config.axes()) {
        let model = prediction_model(axis, &config.periods()).expect("a model");
        // 1 (m/min)/mm is 16.667 s⁻¹.
        let kp = gains.gain * 1000.0 / 60.0;
        let rst = virtual_axes_core::control::Rst::new(&[kp], &[1.0], &[kp], 0).expect("a controller");
        let kept = margins(&model, &rst).expect("stable");
        assert!(kept.modulus >= 0.7 && kept.delay >= 0.02, "{kept:?}");
    }
    assert!(found.tried.iter().all(|c| !c.is_saturated && c.cost >= found.best.cost));
}

#[test]
fn saturated_tunings_are_rejected() {
    let mut parameters = machine(&["x"]);
    // The move needs more current than the limit with any controller.
    set(&mut parameters, "x.motor.max_current_a", Value::Double(2.0));
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(THERE_AND_BACK, &config);
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
    assert!(problem.present().is_saturated);
    let limits = MarginLimits { modulus: 0.85, delay: 0.02 };
    let error = tune_gpc(&problem, &limits).expect_err("no tuning");
    assert!(matches!(error, TuneError::Saturated { runs } if runs > 0), "{error}");
    assert!(error.to_string().contains("saturates"), "{error}");
}

#[test]
fn margin_limits_of_no_design_are_rejected_with_the_best_margins() {
    let parameters = machine(&["x"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(THERE_AND_BACK, &config);
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
    let limits = MarginLimits { modulus: 0.999, delay: 0.005 };
    match tune_gpc(&problem, &limits).expect_err("no tuning") {
        TuneError::NoMargins { designs, limits: asked, modulus, .. } => {
            assert!(designs > 1900 && asked == limits && modulus > 0.8 && modulus < 0.999, "{modulus}");
        }
        error => panic!("{error}"),
    }
    let error = tune_cascade(&problem, &limits, 1).expect_err("no tuning");
    assert!(matches!(error, TuneError::NoMargins { .. }), "{error}");
}

#[test]
fn a_path_without_motion_has_nothing_to_tune() {
    let parameters = machine(&["x"]);
    let cost = Cost::default();
    let rows = Rows { left: 100 };
    let setpoints = trial::SetpointSource::Grid(Box::new(rows));
    let workload =
        virtual_axes_identify::tune::Workload::read("still", None, setpoints, || Ok(())).expect("setpoints");
    let error = TuningProblem::new(&parameters, &workload, &cost, &NoProgress)
        .map(|_| ())
        .expect_err("nothing moves");
    assert!(matches!(error, TuneError::NothingMoves), "{error}");
}

/// Source of rows of X at home.
struct Rows {
    left: usize,
}

impl trial::GridSource for Rows {
    fn joints(&self) -> &[usize] {
        &[0]
    }

    fn next(&mut self, row: &mut [f64]) -> Result<bool, trial::SourceError> {
        row.fill(0.0);
        self.left = self.left.saturating_sub(1);
        Ok(self.left > 0)
    }
}

/// Progress receiver that interrupts the search after a number of position cycles.
struct InterruptAfter(AtomicUsize);

impl Progress for InterruptAfter {
    fn check_interrupt(&self) -> io::Result<()> {
        let left = self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        left.map(|_| ()).map_err(|_| io::Error::other("enough"))
    }
}

#[test]
fn an_absolute_weight_does_not_override_the_relative_one() {
    let mut parameters = machine(&["x", "y"]);
    set(&mut parameters, "x.position_loop.gpc.lambda", Value::Double(1.0));
    let tuning = Tuning::Gpc { n1: 1, n2: 8, nu: 6, lambda_rel: 0.01 };
    let tuned = tuning.apply(&parameters, &["x".to_owned()]).expect("valid");
    assert_eq!(tuned.get("x.position_loop.gpc.lambda"), None);
    assert_eq!(tuned.get("x.position_loop.gpc.lambda_rel"), Some(Value::Double(0.01)));
    // The other axis is unchanged.
    let y = |parameters: &Parameters| {
        parameters.iter().filter(|(key, _)| key.starts_with("y.")).collect::<Vec<_>>()
    };
    assert_eq!(y(&tuned), y(&parameters));
}

#[test]
fn an_interrupted_search_returns_the_error() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(CORNER, &config);
    let cost = Cost::default();
    for cascade in [false, true] {
        let watch = InterruptAfter(AtomicUsize::new(2000));
        let problem = TuningProblem::new(&parameters, &workload, &cost, &watch).expect("a tuning problem");
        let limits = MarginLimits::default();
        let found = if cascade { tune_cascade(&problem, &limits, 1) } else { tune_gpc(&problem, &limits) };
        assert_eq!(found.expect_err("interrupted").to_string(), "enough");
    }
}

#[test]
fn contrasts_are_better_on_one_path_and_worse_on_the_other() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let (circle, corner) = (workload(CIRCLE, &config), workload(CORNER, &config));
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &circle, &cost, &NoProgress).expect("a tuning problem");
    let limits = MarginLimits { modulus: 0.7, delay: 0.0 };
    let (present, found) = find_contrasts(&problem, &corner, &limits).expect("contrasts");
    assert!(!found.is_empty());
    for pair in &found {
        assert!(pair.better.cost < problem.present().cost && pair.worse.cost > present.cost);
        assert_eq!(pair.better.tuning, pair.worse.tuning);
        assert!(pair.better.margins.is_some_and(|margins| margins.modulus >= 0.7));
    }
    assert!(found.windows(2).all(|pair| pair[0].worse.cost >= pair[1].worse.cost));
    // In the reverse order the longer path comes first.
    let problem = TuningProblem::new(&parameters, &corner, &cost, &NoProgress).expect("a tuning problem");
    let (_, other) = find_contrasts(&problem, &circle, &limits).expect("contrasts");
    for pair in &other {
        assert!(
            pair.better.cost < problem.present().cost
                && pair.worse.cost > cost_of_circle(&parameters, &circle)
        );
    }
}

fn cost_of_circle(parameters: &Parameters, circle: &virtual_axes_identify::tune::Workload) -> f64 {
    let config = parameters.machine_config().expect("a machine");
    let outcome = circle.run(&config, false, false, |_| Ok(())).expect("a run");
    outcome.figures.contour.expect("a contour").max / MICROMETER
}

#[test]
fn costs_are_parsed_and_invalid_terms_rejected() {
    let cost: Cost = "contour=1, rms=0.5,current".parse().expect("a cost");
    assert_eq!(
        cost.terms(),
        [(CostTerm::Contour, 1.0), (CostTerm::FollowingRms, 0.5), (CostTerm::Current, 1.0)]
    );
    assert_eq!(cost.to_string(), "contour,rms=0.5,current");
    for (text, message) in [
        (
            "color",
            "unknown term color; available terms: contour, contour-rms, following, rms, current, activity",
        ),
        ("", "unknown term ; available terms: contour, contour-rms, following, rms, current, activity"),
        ("rms=-1", "rms=-1: the weight must be a number from 0 to 1e9"),
        ("rms=inf", "rms=inf: the weight must be a number from 0 to 1e9"),
        ("rms=1e10", "rms=10000000000: the weight must be a number from 0 to 1e9"),
        ("rms=much", "rms=much: the weight must be a number from 0 to 1e9"),
        ("rms=1,rms=2", "rms is given twice"),
        ("rms=0,contour=0", "all weights are 0; at least one must be above 0"),
    ] {
        assert_eq!(text.parse::<Cost>().expect_err(text).to_string(), message);
    }
}

#[test]
fn a_cost_is_the_weighted_sum_of_figures() {
    let parameters = machine(&["x", "y"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(CORNER, &config);
    let figures = workload.run(&config, false, false, |_| Ok(())).expect("a run").figures;
    let of = |text: &str| text.parse::<Cost>().expect("a cost").of(&figures, &config);
    let contour = figures.contour.expect("a contour");
    assert_eq!(of("contour"), contour.max / MICROMETER);
    assert_eq!(of("contour-rms"), contour.rms / MICROMETER);
    let worst = |value: fn(&virtual_axes_core::assess::AxisReport) -> f64| {
        f64::max(value(&figures.axes[0].report), value(&figures.axes[1].report))
    };
    assert_eq!(of("following"), worst(|r| r.max_delay_compensated_following_error) / MICROMETER);
    assert_eq!(of("rms"), worst(|r| r.rms_delay_compensated_following_error) / MICROMETER);
    assert_eq!(of("activity"), worst(|r| r.control_activity));
    // The motors of X and Y have 54 A.
    assert_eq!(of("current"), worst(|r| r.peak_current) / 54.0);
    let sum = of("contour") + 2.0 * of("rms") + 300.0 * of("current");
    assert!((of("contour=1,rms=2,current=300") - sum).abs() < 1e-9 * sum);
}

#[test]
fn the_front_contains_the_pareto_optimal_candidates() {
    let parameters = machine(&["x"]);
    let config = parameters.machine_config().expect("a machine");
    let workload = workload(THERE_AND_BACK, &config);
    let cost = Cost::default();
    let problem = TuningProblem::new(&parameters, &workload, &cost, &NoProgress).expect("a tuning problem");
    let merit = |c: &TuningCandidate| c.margins.map_or(f64::NAN, |m| m.modulus);
    // Repeating costs and margins from a multiplicative sequence.
    let all: Vec<TuningCandidate> = (0..200)
        .map(|i| {
            let mut candidate = problem.present().clone();
            candidate.cost = f64::from(i * 37 % 41);
            candidate.margins = candidate
                .margins
                .map(|m| virtual_axes_core::design::Margins { modulus: f64::from(i * 53 % 47), ..m });
            candidate
        })
        .collect();
    let on_front = pareto_front(&all, merit);
    let beats = |a: &TuningCandidate, b: &TuningCandidate| {
        a.cost <= b.cost && merit(a) >= merit(b) && (a.cost < b.cost || merit(a) > merit(b))
    };
    let expected: Vec<(f64, f64)> = {
        let unbeaten = all.iter().filter(|b| !all.iter().any(|a| beats(a, b)));
        let mut pairs: Vec<_> = unbeaten.map(|c| (c.cost, merit(c))).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.dedup();
        pairs
    };
    assert_eq!(on_front.iter().map(|c| (c.cost, merit(c))).collect::<Vec<_>>(), expected);
}

/// A rapid approach with a corner, a cut with one, and a rapid retreat: the cost is the error of the cut, whatever the
/// rapids do.
#[test]
fn the_cost_of_a_tuning_is_the_error_of_the_cuts() {
    let parameters = machine(&["x", "y"]);
    // Legs at rest at both ends, by the cosine law: end, position cycles, rapid traverse.
    let legs: [([f64; 2], usize, bool); 6] = [
        ([8e-3, 0.0], 30, true),
        ([8e-3, 6e-3], 30, true),
        ([10e-3, 6e-3], 40, false),
        ([10e-3, 8e-3], 40, false),
        ([2e-3, 8e-3], 30, true),
        ([0.0, 0.0], 30, true),
    ];
    let (mut rows, mut rapid, mut from) = (vec![0.0; 2], vec![true], [0.0; 2]);
    for (to, cycles, is_rapid) in legs {
        for k in 1..=cycles {
            let share = 0.5 * (1.0 - (std::f64::consts::PI * k as f64 / cycles as f64).cos());
            rows.extend([0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])));
            rapid.push(is_rapid);
        }
        from = to;
    }
    let workload = |rapid: &[bool]| {
        let source = SetpointSource::Grid(Box::new(GridRows::new(&[0, 1], &rows).with_rapid(rapid)));
        Workload::read("test", None, source, || Ok(())).expect("setpoints")
    };
    let cost = Cost::default();
    let cuts = workload(&rapid);
    let problem = TuningProblem::new(&parameters, &cuts, &cost, &NoProgress).expect("a tuning problem");
    let found = tune_gpc(&problem, &MarginLimits::default()).expect("a tuning").best;
    let contour = |one: &TuningCandidate| one.figures.contour.expect("a contour error");
    for one in [problem.present(), &found] {
        let rapids = contour(one).rapids.expect("rapid traverse");
        assert_eq!(one.cost, contour(one).max / MICROMETER);
        // The larger error of the rapids is not in the cost.
        assert!(rapids.max > contour(one).max, "{:?}", contour(one));
    }
    assert!(found.cost < problem.present().cost, "{} of {}", found.cost, problem.present().cost);
    // The same setpoints, all at feed: the cost is the error that was one of the rapids.
    let all = workload(&vec![false; rapid.len()]);
    let at_feed = TuningProblem::new(&parameters, &all, &cost, &NoProgress).expect("a tuning problem");
    let rapids = contour(problem.present()).rapids.expect("rapid traverse");
    assert!(contour(at_feed.present()).rapids.is_none());
    assert_eq!(at_feed.present().cost, rapids.max / MICROMETER);
    // Following errors likewise: the largest of all motions is at rapid traverse.
    for name in ["following", "rms"] {
        let cost: Cost = name.parse().expect("a term");
        let of = |workload: &Workload| {
            let problem = TuningProblem::new(&parameters, workload, &cost, &NoProgress).expect("a problem");
            let axes = problem.present().figures.axes.clone();
            (problem.present().cost, axes)
        };
        let ((cuts, axes), (whole, _)) = (of(&cuts), of(&all));
        let [at_feed, of_all] = [true, false].map(|is_cut| {
            let reports = axes.iter().map(|axis| if is_cut { axis.cuts.expect("cuts") } else { axis.report });
            let errors = reports.map(|report| match name {
                "rms" => report.rms_delay_compensated_following_error,
                _ => report.max_delay_compensated_following_error,
            });
            errors.fold(0.0, f64::max) / MICROMETER
        });
        assert_eq!((cuts, whole), (at_feed, of_all), "{name}");
        assert!(cuts < 0.8 * whole, "{name}: {cuts} of {whole}");
    }
}
