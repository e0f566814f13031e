//! Bits of every built-in scenario through the C interface and in the simulation of `virtual_axes run`.

mod c_program;

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::sync::Arc;

use c_program::{compile, folder, hexadecimal};
use virtual_axes_builtin::SCENARIOS;
use virtual_axes_core::config::{Parameters, ValueSource, parse_assignment};
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::trial::{self, Measures, ProgramSource, SetpointSource, Trial};

/// Position cycle: setpoints, and positions, velocities and currents at its start.
type Cycle = (Vec<f64>, Vec<f64>);

/// Returns the position cycles of a scenario.
fn cycles(parameters: &Parameters, name: &str) -> Vec<Cycle> {
    let config = parameters.machine_config().expect("a valid machine");
    let scenario = Scenario::load(name, SCENARIOS).expect("built in");
    let program = Arc::new(scenario.program(&config, None).expect("it can be planned"));
    let limits = joint_limits(&config, "");
    let source = ProgramSource::new(Arc::clone(&program), name, &limits, config.periods().position);
    let trial = Trial {
        machine: &config,
        program: Some(program),
        allow_nonzero_end_velocity: false,
        record: false,
        measures: Measures::AXES,
    };
    let mut cycles = Vec::new();
    let on_cycle = |tick: trial::Tick<'_>| {
        let samples: Vec<_> = tick.machine.axes().iter().map(|axis| *axis.sample()).collect();
        let of = |signal: fn(&virtual_axes_core::machine::AxisSample) -> f64| samples.iter().map(signal);
        let state = of(|s| s.position).chain(of(|s| s.velocity)).chain(of(|s| s.current));
        cycles.push((of(|s| s.psec).collect(), state.collect()));
        Ok(())
    };
    trial::run(&trial, SetpointSource::Grid(Box::new(source)), on_cycle).expect("it runs");
    cycles
}

/// Writes a number as `%la` reads it.
fn hexadecimal_text(value: f64) -> String {
    let bits = value.to_bits();
    let (sign, exponent, mantissa) = (bits >> 63, (bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    let (whole, exponent) = if exponent == 0 { (0, -1022) } else { (1, exponent as i64 - 1023) };
    format!("{}0x{whole}.{mantissa:013x}p{exponent}", if sign == 1 { "-" } else { "" })
}

#[test]
fn every_scenario_has_the_bits_of_the_simulation() {
    let program = compile("tests/replay.c", "replay", &[]);
    let file = folder().join("../../config/mikron_ucp710.yaml");
    let cascade =
        Parameters::load(&file.to_string_lossy(), virtual_axes_builtin::MACHINES).expect("a machine");
    let mut gpc = cascade.clone();
    let axes = ["x", "y", "z", "a", "c"];
    let source = ValueSource::named("test");
    let assignment =
        |axis| parse_assignment(&format!("{axis}.position_loop.controller:=gpc"), &source).expect("valid");
    gpc.set_all(axes.map(assignment).to_vec()).expect("valid");
    for (controller, parameters) in [("cascade", &cascade), ("gpc", &gpc)] {
        let machine = program.with_file_name(format!("{controller}.yaml"));
        std::fs::write(&machine, parameters.to_yaml("", |_| None)).expect("writable");
        for (name, _) in SCENARIOS {
            let expected = cycles(parameters, name);
            let mut text = String::new();
            for (psec, _) in &expected {
                for value in psec {
                    write!(text, "{} ", hexadecimal_text(*value)).expect("written to memory");
                }
            }
            let mut replay = Command::new(&program);
            let replay =
                replay.arg(&machine).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
            let mut process = replay.spawn().expect("it starts");
            let mut stdin = process.stdin.take().expect("a pipe");
            // The program reads all before it writes.
            stdin.write_all(text.as_bytes()).expect("read");
            drop(stdin);
            let output = process.wait_with_output().expect("it ends");
            assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
            let text = String::from_utf8(output.stdout).expect("numbers");
            let found: Vec<Vec<f64>> =
                text.lines().map(|line| line.split_whitespace().map(hexadecimal).collect()).collect();
            assert!(found.len() == expected.len() && found.len() > 100, "{name}: {}", found.len());
            // The state at the end of a cycle is that at the start of the next one.
            for (cycle, (found, (_, wanted))) in found.iter().zip(&expected[1..]).enumerate() {
                assert_eq!(found, wanted, "{name} with {controller}, cycle {cycle}");
            }
        }
    }
}
