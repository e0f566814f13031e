//! What each fuzz target does with its bytes. Beside "no panic" it holds that what is refused is refused in
//! one short line, that what is accepted is finite and can be written and read back the same, and that
//! memory stays in proportion to the input.

mod files;
mod graph;
mod motion;
mod text;

pub use files::{psec_csv, psec_mcap, psec_yaml, recording_csv, recording_mcap};
pub use graph::{cdr_goal, cdr_joint_state, cdr_other, cdr_parameters, cdr_psec};
pub use motion::trajectory;
pub use text::{machine_file, parameter_text, ros_args, scenario};

use std::sync::LazyLock;

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::simulation::{self, Simulation};
use virtual_axes_core::trajectory::JointLimits;
use virtual_axes_core::units::Nanoseconds;

/// Longest refusal, bytes: a few quoted texts and what is allowed.
const LONGEST_REFUSAL: usize = 2000;
/// Memory that is used whatever the input is, bytes: machines, designs, buffers of readers.
const FREE_MEMORY: u64 = 48 << 20;
/// Memory per byte of input: an empty string on the wire is 4 bytes, and a rejection a few hundred.
const MEMORY_PER_BYTE: u64 = 1000;
/// Time of the first position instant, ns since the Unix epoch.
const ORIGIN: Nanoseconds = 1_700_000_000_000_000_000;

static PARAMETERS: LazyLock<Parameters> = LazyLock::new(|| Parameters::embedded_default().expect("shipped"));
static MACHINE: LazyLock<MachineConfig> = LazyLock::new(|| PARAMETERS.machine_config().expect("shipped"));
static JOINTS: LazyLock<Vec<JointLimits>> = LazyLock::new(|| simulation::joint_limits(&MACHINE, ""));

fn names() -> Vec<String> {
    JOINTS.iter().map(|joint| joint.name.clone()).collect()
}

/// The default machine at rest.
fn machine_at_rest() -> Simulation {
    Simulation::new(&MACHINE, JOINTS.clone(), ORIGIN).expect("the shipped machine can be simulated")
}

/// Steps the machine; all that it says is finite.
fn step(simulation: &mut Simulation, periods: usize) {
    for _ in 0..periods {
        simulation.step();
        for sample in simulation.samples() {
            let values = [sample.psec, sample.position, sample.velocity, sample.current, sample.effort];
            assert!(values.iter().all(|value| value.is_finite()), "{sample:?}");
        }
    }
}

/// Line and paragraph separators, and what marks or turns the direction of writing (Unicode's Bidi_Control).
const TURNS: &str = "\u{2028}\u{2029}\u{61c}\u{200e}\u{200f}\u{202a}\u{202b}\u{202c}\u{202d}\u{202e}\
    \u{2066}\u{2067}\u{2068}\u{2069}";

/// A refusal is one short line that says something.
fn refused(text: &str) {
    assert!(!text.trim().is_empty(), "a refusal without a word");
    assert!(
        text.len() <= LONGEST_REFUSAL,
        "{} bytes: {}…",
        text.len(),
        &text[..text.floor_char_boundary(200)]
    );
    assert!(!text.contains(|c: char| c.is_control() || TURNS.contains(c)), "more than a line: {text:?}");
}

/// Runs `body`, which may take memory in proportion to `input`, a length in bytes.
fn bounded(input: usize, body: impl FnOnce()) {
    bounded_beside(0, input, body);
}

/// Likewise, and `beside` bytes whatever the input is.
fn bounded_beside(beside: u64, input: usize, body: impl FnOnce()) {
    // What is made once counts for nobody.
    LazyLock::force(&JOINTS);
    let used = allocation_counter::measure(body).bytes_max;
    let allowed = beside + FREE_MEMORY + MEMORY_PER_BYTE * input as u64;
    assert!(used <= allowed, "{used} bytes for an input of {input}");
}
