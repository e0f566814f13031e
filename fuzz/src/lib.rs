//! Bodies of the fuzz targets. In addition to "no panic" they assert that an error is one short line, that accepted
//! values are finite and round-trip through their writers, and that memory is bounded in proportion to the input.

mod files;
mod graph;
mod motion;
mod part_program;
mod sinumerik_program;
mod text;

pub use files::{psec_csv, psec_mcap, psec_yaml, recording_control, recording_csv, recording_mcap};
pub use graph::{cdr_goal, cdr_joint_state, cdr_other, cdr_parameters, cdr_psec};
pub use motion::trajectory;
pub use part_program::part_program;
pub use sinumerik_program::sinumerik_program;
pub use text::{machine_file, parameter_text, ros_args, scenario};

use std::sync::LazyLock;

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::simulation::{self, Simulation};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::Nanoseconds;

/// Largest length of an error message, bytes.
const MAX_ERROR_LENGTH: usize = 2000;
/// Allowed memory independent of the input, bytes: machines, controller designs, buffers of readers.
const FREE_MEMORY: u64 = 48 << 20;
/// Allowed memory per byte of input: an empty string is 4 bytes in CDR, a rejection a few hundred.
const MEMORY_PER_BYTE: u64 = 1000;
/// Time of the first position cycle, ns since the Unix epoch.
const ORIGIN: Nanoseconds = 1_700_000_000_000_000_000;

static PARAMETERS: LazyLock<Parameters> = LazyLock::new(|| Parameters::embedded_default().expect("shipped"));
static MACHINE: LazyLock<MachineConfig> = LazyLock::new(|| PARAMETERS.machine_config().expect("shipped"));
static JOINTS: LazyLock<Vec<JointLimits>> = LazyLock::new(|| simulation::joint_limits(&MACHINE, ""));

fn names() -> Vec<String> {
    JOINTS.iter().map(|joint| joint.name.clone()).collect()
}

/// Creates a simulation of the default machine at rest.
fn machine_at_rest() -> Simulation {
    Simulation::new(&MACHINE, JOINTS.clone(), ORIGIN).expect("the shipped machine can be simulated")
}

/// Steps the simulation and asserts that its signals are finite.
fn step(simulation: &mut Simulation, periods: usize) {
    for _ in 0..periods {
        simulation.step();
        for sample in simulation.samples() {
            let values = [sample.psec, sample.position, sample.velocity, sample.current, sample.effort];
            assert!(values.iter().all(|value| value.is_finite()), "{sample:?}");
        }
    }
}

/// Line and paragraph separators, and the bidirectional control characters (Unicode property Bidi_Control).
const SEPARATORS: &str = "\u{2028}\u{2029}\u{61c}\u{200e}\u{200f}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}\
    \u{2066}\u{2067}\u{2068}\u{2069}";

/// Asserts that an error message is one short, non-empty line.
fn assert_one_line(text: &str) {
    assert!(!text.trim().is_empty(), "empty error message");
    assert!(
        text.len() <= MAX_ERROR_LENGTH,
        "{} bytes: {}…",
        text.len(),
        &text[..text.floor_char_boundary(200)]
    );
    assert!(
        !text.contains(|c: char| c.is_control() || SEPARATORS.contains(c)),
        "more than one line: {text:?}"
    );
}

/// Runs `body` and asserts that its memory is bounded in proportion to `input`, a length in bytes.
fn bounded(input: usize, body: impl FnOnce()) {
    bounded_with_extra(0, input, body);
}

/// Runs `body` and asserts the bound of [`bounded`] plus `extra` bytes independent of the input.
fn bounded_with_extra(extra: u64, input: usize, body: impl FnOnce()) {
    // Shared data is created outside of the measurement.
    LazyLock::force(&JOINTS);
    let used = allocation_counter::measure(body).bytes_max;
    let allowed = extra + FREE_MEMORY + MEMORY_PER_BYTE * input as u64;
    assert!(used <= allowed, "{used} bytes for an input of {input}");
}
