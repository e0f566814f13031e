//! JSON output of `virtual_axes run`.

use serde_json::{Map, Value, json};
use virtual_axes_io::files::{figures_json, part_program_json};
use virtual_axes_report::runs::SimulatedRun;

use crate::input::CommandInput;

/// Returns the runs of a command as a JSON object.
pub fn object(input: &CommandInput, machine: &str, runs: &[SimulatedRun]) -> Value {
    json!({
        "input": input.name(),
        "description": input.description(),
        "machine": machine,
        "runs": runs.iter().map(run).collect::<Vec<_>>(),
    })
}

fn run(run: &SimulatedRun) -> Value {
    let mut object = Map::new();
    object.insert("controller".to_owned(), json!(run.controller));
    object.insert("changes".to_owned(), json!(run.changes));
    object.extend(figures_json(&run.outcome.figures));
    if let Some(program) = &run.part_program {
        object.insert("part_program".to_owned(), part_program_json(&program.figures));
    }
    Value::Object(object)
}
