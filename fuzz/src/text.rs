//! Fuzz targets of text inputs: machine files, parameters, scenarios, ROS arguments.

use virtual_axes::validation::args::Command;
use virtual_axes_core::config::{Parameters, ValueSource};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::scenario::Scenario;

use crate::{JOINTS, MACHINE, PARAMETERS, assert_one_line, bounded};

/// Number of samples along a scenario.
const SAMPLES: u32 = 64;
/// Largest number of planned moves.
const MAX_MOVES: usize = 40;

/// Asserts that parameters round-trip through YAML bit by bit.
fn assert_reads_back(parameters: &Parameters) {
    let text = parameters.to_yaml("", |_| None);
    let again = Parameters::from_yaml(&text, "again.yaml").expect("what was written can be read");
    let values = |p: &Parameters| format!("{:?}", p.iter().collect::<Vec<_>>());
    assert_eq!(values(&again), values(parameters));
}

/// Reads a machine file.
pub fn machine_file(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else { return };
    bounded(data.len(), || match Parameters::from_yaml(text, "my.yaml") {
        Ok(parameters) => {
            assert_reads_back(&parameters);
            let config = parameters.machine_config().expect("valid parameters are a machine");
            if let Err(error) = MachineParameters::new(&config) {
                assert_one_line(&error.to_string());
            }
        }
        Err(error) => {
            assert_one_line(&error.to_string());
            assert!(error.to_string().starts_with("my.yaml"), "{error}");
        }
    });
}

/// Overlays a parameter file, or lines of the form of `-p` and `--set`, on the default machine.
pub fn parameter_text(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else { return };
    bounded(data.len(), || {
        let mut parameters = PARAMETERS.clone();
        let source = ValueSource::named("-p");
        let results: Vec<_> = if text.starts_with('/') {
            let result = parameters.overlay_yaml(text, "over.yaml", Some("/virtual_axes"));
            vec![result.map(|_| ()).map_err(|error| error.to_string())]
        } else {
            text.lines()
                .map(|line| {
                    let before = parameters.clone();
                    let result = parameters.set_text(line, &source);
                    assert!(result.is_ok() || parameters == before, "a rejected assignment changes nothing");
                    result.map_err(|error| error.to_string())
                })
                .collect()
        };
        results.iter().filter_map(|result| result.as_ref().err()).for_each(|error| assert_one_line(error));
        let config = parameters.machine_config().expect("what is accepted is valid");
        if results.iter().any(Result::is_ok) {
            assert_reads_back(&parameters);
            if let Err(error) = MachineParameters::new(&config) {
                assert_one_line(&error.to_string());
            }
        }
    });
}

/// Plans a scenario and samples it.
pub fn scenario(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else { return };
    if text.matches("- ").count() > MAX_MOVES {
        return;
    }
    bounded(data.len(), || {
        let planned = Scenario::from_yaml(text, "my.yaml").and_then(|s| s.program(&MACHINE, None));
        let program = match planned {
            Ok(program) => program,
            Err(error) => {
                assert_one_line(&error.to_string());
                assert!(error.to_string().starts_with("my.yaml"), "{error}");
                return;
            }
        };
        let duration = program.duration();
        assert!(duration.is_finite() && duration >= 0.0);
        let mut psec = vec![0.0; JOINTS.len()];
        let mut before = 0.0;
        for sample in 0..=SAMPLES {
            let t = duration * f64::from(sample) / f64::from(SAMPLES);
            program.psec(t, &mut psec);
            // Travel limits are checked later, by validation.
            assert!(psec.iter().all(|position| position.is_finite()), "{psec:?} at {t} s");
            let progress = program.progress(t);
            assert!(progress >= before, "progress steps back at {t} s");
            before = progress;
        }
    });
}

/// Parses the arguments of the node, one per line.
pub fn ros_args(data: &[u8]) {
    let Ok(text) = str::from_utf8(data) else { return };
    bounded(data.len(), || {
        let command = match Command::parse(text.lines(), "virtual_axes") {
            Ok(command) => command,
            Err(error) => return assert!(!error.to_string().is_empty()),
        };
        let Command::Run(args) = command else { return };
        assert!(args.node().to_string().starts_with('/'));
        for name in ["psec", "/clock", "~/reset"] {
            for resolved in [args.resolve_topic(name), args.resolve_service(name)] {
                match resolved {
                    Ok(resolved) => {
                        let tokens: Vec<&str> = resolved.split('/').collect();
                        assert!(tokens[0].is_empty() && tokens.len() > 1, "{resolved}");
                        assert!(tokens[1..].iter().all(|token| !token.is_empty()), "{resolved}");
                    }
                    Err(error) => assert!(!error.to_string().is_empty()),
                }
            }
        }
        for warning in args.warnings() {
            assert!(!warning.is_empty());
        }
        assert!(args.parameters().count() <= text.lines().count());
    });
}
