//! Short paths and small machines to tune.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::sync::Arc;

use virtual_axes::config::{MachineConfig, Parameters, Source, Value};
use virtual_axes::path::Program;
use virtual_axes::scenario::Scenario;
use virtual_axes::simulation::joints;
use virtual_axes::trial::{ProgramSource, Setpoints};
use virtual_axes::tune::Course;

/// A move of X there and back with little rest.
pub const THERE_AND_BACK: &str = "\
description: X over 5 mm and back
feed_m_min: 6
rest_s: 0.06
moves:
  - line: {x_mm: 5}
  - line: {x_mm: 0}
";

/// A small circle in X–Y.
pub const CIRCLE: &str = "\
description: A circle of 20 mm radius in X–Y
feed_m_min: 10
rest_s: 0.06
moves:
  - arc: {center: {x_mm: -20, y_mm: 0}, turns: 1}
    ramp_s: 0.2
";

/// A corner of 90° with short legs.
pub const CORNER: &str = "\
description: A corner of 90° in X–Y
feed_m_min: 6
rest_s: 0.06
moves:
  - line: {x_mm: 10}
  - line: {x_mm: 10, y_mm: 10}
";

/// The default machine with `names` only of its joints.
pub fn machine(names: &[&str]) -> Parameters {
    let mut parameters = Parameters::embedded_default().expect("the embedded machine is valid");
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    parameters.set("joints", Value::TextList(names), &Source::named("test")).expect("joints of the machine");
    parameters
}

/// Path and law of time of a scenario's text.
pub fn program(text: &str, config: &MachineConfig) -> Arc<Program> {
    let scenario = Scenario::from_yaml(text, "test.yaml").expect("a scenario");
    Arc::new(scenario.program(config, None).expect("the machine can do it"))
}

/// Its set-points.
pub fn setpoints(program: &Arc<Program>, config: &MachineConfig) -> Setpoints<'static> {
    let period = config.periods().position;
    Setpoints::Grid(Box::new(ProgramSource::new(Arc::clone(program), "test", &joints(config, ""), period)))
}

/// The scenario to be run many times.
pub fn course(text: &str, config: &MachineConfig) -> Course {
    let program = program(text, config);
    let setpoints = setpoints(&program, config);
    Course::read("test", Some(program), setpoints, || Ok(())).expect("set-points")
}
