//! JSON of tunings and of runs on deviating plants.
//!
//! Keys contain units; terms of the cost function have the names of `--cost` (docs/reference/json.md).

use serde_json::{Map, Value, json};
use virtual_axes_core::config::MachineConfig;
use virtual_axes_core::design::Margins;
use virtual_axes_core::trial::Figures;
use virtual_axes_core::units::{DEGREE, MILLISECOND};
use virtual_axes_identify::tune::{
    Cost, CostTerm, DeviatingRun, MarginLimits, Robustness, Tuning, TuningCandidate, TuningProblem,
    TuningResult, TuningSearch,
};

use super::figures_json;

/// Returns a run as a JSON object: `description`, cost, margins, and all terms of cost functions.
pub fn costed_run_json(
    description: Vec<(&str, Value)>,
    cost: f64,
    margins: Option<&Margins>,
    figures: &Figures,
    machine: &MachineConfig,
) -> Map<String, Value> {
    let mut object: Map<String, Value> =
        description.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    object.insert("cost".to_owned(), json!(cost));
    let margins = margins.map_or(Value::Null, |m| {
        json!({
            // Infinite margins are null in JSON.
            "modulus": m.modulus,
            "phase_deg": m.phase / DEGREE,
            "gain": m.gain,
            "delay_ms": m.delay / MILLISECOND,
        })
    });
    object.insert("margins".to_owned(), margins);
    let terms = CostTerm::ALL.map(|term| (term.name().replace('-', "_"), json!(term.of(figures, machine))));
    object.insert("terms".to_owned(), Value::Object(terms.into_iter().collect()));
    let saturation = figures.axes.iter().map(|axis| axis.report.saturation_time).fold(0.0, f64::max);
    object.insert("saturation_s".to_owned(), json!(saturation));
    object
}

/// Returns the runs on deviating plants as a JSON object. `name` and `description` are those of the path, `controller` is
/// the position controller, and `by` the relative deviation.
pub fn robustness_json(
    (name, description): (&str, &str),
    (machine, controller): (&MachineConfig, &str),
    (cost, by): (&Cost, f64),
    found: &Robustness,
) -> Value {
    let plain = |one: &DeviatingRun| -> Value {
        let deviation = json!({
            "inertia": one.deviation.inertia,
            "friction": one.deviation.friction,
            "torque_constant": one.deviation.torque_constant,
        });
        let description = vec![("deviation", deviation)];
        costed_run_json(description, one.cost, one.margins.as_ref(), &one.figures, machine).into()
    };
    json!({
        "input": name,
        "description": description,
        "machine": machine.name(),
        "controller": controller,
        "by": by,
        "cost_unit": cost.unit(&found.nominal.figures),
        "nominal": plain(&found.nominal),
        "single": found.single.iter().map(plain).collect::<Vec<_>>(),
        "worst_combination": plain(&found.worst),
    })
}

/// Returns a simulated tuning as a JSON object.
fn candidate(candidate: &TuningCandidate, machine: &MachineConfig) -> Map<String, Value> {
    let description = vec![("tuning", tuning(&candidate.tuning))];
    costed_run_json(description, candidate.cost, candidate.margins.as_ref(), &candidate.figures, machine)
}

fn tuning(tuning: &Tuning) -> Value {
    match tuning {
        Tuning::Present => json!("present"),
        Tuning::ContourGain(gain) => json!({ "contour_gain": gain }),
        Tuning::Gpc { n1, n2, nu, lambda_rel } => {
            json!({ "n1": n1, "n2": n2, "nu": nu, "lambda_rel": lambda_rel })
        }
        Tuning::Cascade(axes) => axes
            .iter()
            .map(|(joint, gains)| {
                let gains = json!({
                    "gain": gains.gain,
                    "velocity_feedforward": gains.velocity,
                    "torque_feedforward": gains.torque,
                });
                (joint.clone(), gains)
            })
            .collect::<Map<_, _>>()
            .into(),
    }
}

/// Returns the result of a search as a JSON object, the keys of `virtual_axes tune --json`. `input` is name and
/// description of the path; `seed` is that of the option, also for searches without one.
pub fn tuning_json(
    input: (&str, &str),
    search: TuningSearch,
    limits: &MarginLimits,
    seed: u64,
    problem: &TuningProblem<'_>,
    found: &TuningResult,
) -> Map<String, Value> {
    let with_figures = |one: &TuningCandidate| {
        let mut object = candidate(one, problem.config());
        object.insert("figures".to_owned(), figures_json(&one.figures).into());
        Value::Object(object)
    };
    let plain = |one: &TuningCandidate| Value::Object(candidate(one, problem.config()));
    let mut object = Map::new();
    let mut add = |name: &str, value: Value| object.insert(name.to_owned(), value);
    add("input", json!(input.0));
    add("description", json!(input.1));
    add("machine", json!(problem.config().name()));
    add(
        "controller",
        json!(match search {
            TuningSearch::Cascade(_) => "cascade",
            TuningSearch::ContourGain => "contour",
            TuningSearch::Gpc(_) | TuningSearch::Contrast => "gpc",
        }),
    );
    add("tuned_axes", json!(problem.joints()));
    let terms = problem.cost().terms().iter().map(|(term, weight)| (term.name().to_owned(), json!(weight)));
    add("cost", Value::Object(terms.collect()));
    add("cost_unit", json!(problem.cost().unit(&problem.present().figures)));
    let delay = limits.delay / MILLISECOND;
    add("limits", json!({ "modulus_margin": limits.modulus, "delay_margin_ms": delay }));
    add("seed", json!(seed));
    add("present", with_figures(problem.present()));
    add("best", with_figures(&found.best));
    if let Some(search) = &found.search {
        add("designs", json!(search.designs));
        add("runs", json!(search.runs));
        add("pareto", found.pareto().into_iter().map(plain).collect());
    }
    let also = found.elsewhere.iter().map(|path| {
        json!({ "input": path.name, "present": with_figures(&path.present), "tuned": with_figures(&path.tuned) })
    });
    add("also", also.collect());
    let contrasts =
        found.contrasts.iter().map(|c| json!({ "better": plain(&c.better), "worse": plain(&c.worse) }));
    add("contrasts", contrasts.collect());
    object
}
