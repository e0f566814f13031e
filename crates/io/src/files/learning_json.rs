//! JSON of iterative learning.

use serde_json::{Value, json};
use virtual_axes_core::config::{AxisKind, MachineConfig};
use virtual_axes_core::trial::Figures;
use virtual_axes_core::units::seconds;
use virtual_axes_identify::learn::{
    LearningAxis, LearningEnd, LearningIteration, LearningOptions, LearningResult,
};

use super::figures_json;

/// Returns the result of learning as a JSON object. `name` and `description` are those of the path, `others` the figures of
/// the programmed and of the learned setpoints on other machines, by their parameters.
pub fn learning_json(
    (name, description): (&str, &str),
    (machine, controller): (&MachineConfig, &str),
    options: &LearningOptions,
    found: &LearningResult,
    others: &[(String, [Figures; 2])],
) -> Value {
    let axis = |axis: &LearningAxis| {
        let deviating = axis.deviating.iter().map(|plant| {
            json!({
                "inertia": plant.deviation.inertia,
                "torque_constant": plant.deviation.torque_constant,
                "factor": plant.contraction.map(|c| c.factor),
                "frequency_hz": plant.contraction.map(|c| c.frequency),
            })
        });
        json!({
            "axis": axis.name,
            "bandwidth_hz": axis.filter.bandwidth(),
            "factor": axis.filter.nominal().factor,
            "frequency_hz": axis.filter.nominal().frequency,
            "deviating_plants": deviating.collect::<Vec<_>>(),
        })
    };
    let iteration = |(number, run): (usize, &LearningIteration)| {
        let axes = run.axes.iter().map(|error| {
            let (name, unit) = named_axis(machine, error.index);
            json!({
                "axis": name,
                "unit": unit,
                "max_error": error.max,
                "rms_error": error.rms,
                "max_compensation": error.compensation,
            })
        });
        json!({
            "iteration": number,
            "learning_axes": axes.collect::<Vec<_>>(),
            "figures": Value::Object(figures_json(&run.figures)),
        })
    };
    let on = |(name, [programmed, learned]): &(String, [Figures; 2])| {
        let [programmed, learned] =
            [programmed, learned].map(|figures| json!({ "figures": Value::Object(figures_json(figures)) }));
        json!({ "parameters": name, "programmed": programmed, "learned": learned })
    };
    let end = match &found.end {
        LearningEnd::Complete => "complete",
        LearningEnd::Diverged => "diverged",
        LearningEnd::Limit(_) => "limit",
    };
    json!({
        "input": name,
        "description": description,
        "machine": machine.name(),
        "controller": controller,
        "gain": options.tuning.gain,
        "encoder_step": options.encoder_step,
        "deviation": options.deviation,
        "delay_s": seconds(machine.periods().position) * found.delay as f64,
        "convergence": found.axes.iter().map(axis).collect::<Vec<_>>(),
        "iterations": found.iterations.iter().enumerate().map(iteration).collect::<Vec<_>>(),
        "best": found.best,
        "on": others.iter().map(on).collect::<Vec<_>>(),
        "end": end,
        "message": learning_end_text(&found.end),
    })
}

/// Returns the reason for an early end of the iterations.
pub fn learning_end_text(end: &LearningEnd) -> Option<String> {
    match end {
        LearningEnd::Complete => None,
        LearningEnd::Diverged => Some(
            "the largest error grew in two successive iterations: learning ended; reduce the bandwidth or the gain"
                .to_owned(),
        ),
        LearningEnd::Limit(excess) => Some(format!("learning ended: {excess}")),
    }
}

/// Returns name and unit of an axis, m or rad.
fn named_axis(machine: &MachineConfig, index: usize) -> (&str, &'static str) {
    let unit = |kind| if kind == AxisKind::Linear { "m" } else { "rad" };
    machine.axes().get(index).map_or(("", ""), |axis| (axis.name(), unit(axis.kind())))
}
