//! Cost of each module of the library, by layer.
//!
//!     cargo bench --no-default-features --bench layers
//!     cargo bench --no-default-features --bench layers -- machine
//!
//! The name of a group contains the unit of its rate. Readers and writers of files are in `io.rs`; scaling with length,
//! axes, machines and cores is in `growth.rs`.

mod inputs;
mod loops;
mod motion;
mod studies;

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput};
use virtual_axes_core::config::{MachineConfig, Parameters};

type Group<'a> = BenchmarkGroup<'a, WallTime>;

/// Samples per benchmark.
const SAMPLES: usize = 20;
const WARM_UP: Duration = Duration::from_millis(300);
const MEASUREMENT: Duration = Duration::from_secs(1);

/// Returns the configuration of the shipped machine.
fn shipped() -> MachineConfig {
    Parameters::embedded_default().and_then(|p| p.machine_config()).expect("the shipped machine")
}

/// Returns the position (m, rad) of an oscillating axis at position cycle `k`.
fn swing(axis: usize, k: usize) -> f64 {
    let turn = (axis + 3) as f64 * 6e-3 * k as f64;
    0.05 * (1.0 - turn.cos())
}

/// Runs a benchmark whose unit of work counts `elements`.
fn bench<T>(group: &mut Group, name: &str, elements: usize, mut work: impl FnMut() -> T) {
    group.throughput(Throughput::Elements(elements as u64));
    group.bench_function(name, |bencher| bencher.iter(&mut work));
}

fn main() {
    let criterion =
        Criterion::default().sample_size(SAMPLES).warm_up_time(WARM_UP).measurement_time(MEASUREMENT);
    let mut criterion = criterion.configure_from_args();
    loops::all(&mut criterion);
    motion::all(&mut criterion);
    studies::all(&mut criterion);
    inputs::all(&mut criterion);
    criterion.final_summary();
}
