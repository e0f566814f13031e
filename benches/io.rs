//! Throughput of each reader and writer relative to a raw read or write of the same file.
//!
//!     cargo bench --no-default-features --bench io
//!     cargo bench --no-default-features --bench io -- MCAP
//!
//! A round runs every case once, so that the background load of the computer affects all of them. The first table shows
//! medians over the rounds and their ratio to the raw bytes. The figures of Criterion follow.

use std::fs::{self, File};
use std::hint::black_box;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::files::{
    McapTrajectories, OutputFile, PsecCsvReader, RecordingOptions, encode_cdr, psec_writer, read_psec_yaml,
    read_recording, trace_writer,
};
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::{DriveStates, MotorCurrents, Sampled};

/// Rounds of the first table.
const ROUNDS: usize = 11;
/// Number of setpoints: one hour at 6 ms.
const INSTANTS: i64 = 600_000;
/// Number of setpoints in YAML, which has a limited length: ten minutes.
const YAML_INSTANTS: i64 = 100_000;
/// Ticks of a trace: ten seconds at 125 µs.
const TICKS: i64 = 80_000;
/// Block size of a raw read or write, bytes.
const BLOCK: usize = 1 << 20;

/// Case: a reader or writer of a file.
struct Case {
    name: &'static str,
    /// Bytes per run.
    bytes: u64,
    /// Name of the reference case.
    against: Option<&'static str>,
    run: Box<dyn FnMut()>,
}

/// Temporary folder that is removed at the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        // The folder contains only temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Returns a position with all digits, within the travel limits of `axis`, m or rad.
fn position(axis: usize, time: Nanoseconds) -> f64 {
    let turn = (axis + 3) as f64 * 1e-10 * time as f64;
    0.05 * (1.0 - turn.cos())
}

fn sample(axis: usize, time: Nanoseconds) -> AxisSample {
    let p = position(axis, time);
    AxisSample {
        psec: p,
        delayed_psec: p - 1.1e-4,
        position: p - 1.3e-4,
        velocity: p.sin() / 7.0,
        current: 1.0 + p / 3.0,
        current_setpoint: 1.0 + p / 3.1,
        voltage: 17.0 * p,
        velocity_setpoint: 31.0 * p,
        velocity_feedforward: 29.0 * p,
        torque_feedforward: p / 9.0,
        friction_current: 0.9 + p / 11.0,
        gravity_current: 0.25,
        load_current: 0.0,
        effort: 300.0 * p,
        controller: "cascade",
        ..AxisSample::default()
    }
}

fn read_raw(path: &Path) -> u64 {
    let mut file = File::open(path).expect("it was written");
    let mut block = vec![0; BLOCK];
    let mut sum = 0;
    loop {
        let read = file.read(&mut block).expect("a file");
        if read == 0 {
            return sum;
        }
        sum += read as u64;
    }
}

fn write_raw(path: &Path, bytes: &[u8]) {
    let mut file = OutputFile::create(path).expect("a folder");
    for block in bytes.chunks(BLOCK) {
        file.write_all(block).expect("room");
    }
    file.finish().expect("a file");
}

fn write_psec(path: &Path, names: &[String], instants: i64, period: Nanoseconds, rows: &[[f64; 5]]) {
    let mut writer = psec_writer(path, names).expect("a file");
    for (k, row) in (0..instants).zip(rows.iter().cycle()) {
        writer.row(k * period, row).expect("room");
    }
    writer.finish().expect("a file");
}

fn write_trace(path: &Path, names: &[String], tick: Nanoseconds, rows: &[[AxisSample; 5]]) {
    let mut writer = trace_writer(path, names).expect("a file");
    for (k, row) in (0..TICKS).zip(rows) {
        writer.row(k * tick, row).expect("room");
    }
    writer.finish().expect("a file");
}

/// Returns the number of bytes of the messages of a trace, without the MCAP container.
fn message_bytes(names: &[String], row: &[AxisSample; 5]) -> u64 {
    let mut bytes = Vec::new();
    let mut sum = 0;
    encode_cdr(&JointState::of(0, row, names), &mut bytes).expect("a message");
    sum += bytes.len();
    encode_cdr(&MotorCurrents::of(0, row, names), &mut bytes).expect("a message");
    sum += bytes.len();
    encode_cdr(&DriveStates::of(0, row, names), &mut bytes).expect("a message");
    (sum + bytes.len()) as u64 * TICKS as u64
}

fn cases(machine: &'static MachineConfig, folder: &Path) -> Vec<Case> {
    let periods = machine.periods();
    let (period, tick) = (periods.position, periods.current);
    let limits = joint_limits(machine, "");
    let names: Vec<String> = machine.axes().iter().map(|axis| axis.name().to_owned()).collect();
    let rows: Vec<[f64; 5]> =
        (0..INSTANTS).map(|k| std::array::from_fn(|axis| position(axis, k * period))).collect();
    let samples: Vec<[AxisSample; 5]> =
        (0..TICKS).map(|k| std::array::from_fn(|axis| sample(axis, k * tick))).collect();
    let at = |name: &str| folder.join(name);
    let (psec, psec_mcap, psec_yaml) = (at("psec.csv"), at("psec.mcap"), at("psec.yaml"));
    let (trace, trace_mcap, output) = (at("trace.csv"), at("trace.mcap"), at("raw"));
    write_psec(&psec, &names, INSTANTS, period, &rows);
    write_psec(&psec_mcap, &names, INSTANTS, period, &rows);
    write_psec(&psec_yaml, &names, YAML_INSTANTS, period, &rows);
    write_trace(&trace, &names, tick, &samples);
    write_trace(&trace_mcap, &names, tick, &samples);
    let size = |path: &Path| fs::metadata(path).expect("it was written").len();
    let raw = fs::read(&psec).expect("it was written");
    let messages = message_bytes(&names, &samples[0]);
    // A point is 80 bytes of CDR: three empty sequences, five positions, two times.
    let points = 80 * INSTANTS as u64;
    let text = fs::read_to_string(&psec_yaml).expect("it was written");
    let x = &machine.axes()[0];
    let (samples, rows): (&'static [_], &'static [_]) = (samples.leak(), rows.leak());
    let names: &'static [String] = names.leak();
    let sized = |path: &Path| (path.to_owned(), size(path));
    let ((psec, psec_size), (trace, trace_size)) = (sized(&psec), sized(&trace));
    let again = |path: &Path| path.to_owned();
    let (psec_in, psec_raw, psec_out) = (again(&psec), again(&psec), again(&psec));
    let (trace_in, trace_out, bag_in, bag_out) =
        (again(&trace), again(&trace), again(&trace_mcap), again(&trace_mcap));
    let (points_in, points_out) = (again(&psec_mcap), again(&psec_mcap));
    let case = |name, bytes, against, run| Case { name, bytes, against, run };
    let (read, written) = (Some("raw bytes, read"), Some("raw bytes, written"));
    vec![
        case("raw bytes, read", psec_size, None, Box::new(move || _ = black_box(read_raw(&psec_raw)))),
        case("raw bytes, written", psec_size, None, Box::new(move || write_raw(&output, &raw))),
        case(
            "setpoints from CSV",
            psec_size,
            read,
            Box::new(move || {
                let mut source = PsecCsvReader::open(&psec_in, period, &limits).expect("setpoints");
                let mut row = [0.0; 5];
                while source.next(&mut row).expect("setpoints") {
                    black_box(&row);
                }
            }),
        ),
        case(
            "setpoints to CSV",
            psec_size,
            written,
            Box::new(move || write_psec(&psec_out, names, INSTANTS, period, rows)),
        ),
        case(
            "setpoints from MCAP",
            points,
            read,
            Box::new(move || {
                let requests = McapTrajectories::open(&points_in, None).expect("a recording");
                for request in requests {
                    black_box(request.expect("a trajectory"));
                }
            }),
        ),
        case(
            "setpoints to MCAP",
            points,
            written,
            Box::new(move || write_psec(&points_out, names, INSTANTS, period, rows)),
        ),
        case(
            "setpoints from YAML",
            text.len() as u64,
            read,
            Box::new(move || _ = black_box(read_psec_yaml(&text, "psec.yaml").expect("a trajectory"))),
        ),
        case(
            "setpoints to YAML",
            size(&psec_yaml),
            written,
            Box::new(move || write_psec(&psec_yaml, names, YAML_INSTANTS, period, rows)),
        ),
        case(
            "trace to CSV",
            trace_size,
            written,
            Box::new(move || write_trace(&trace_out, names, tick, samples)),
        ),
        case(
            "trace to MCAP",
            messages,
            written,
            Box::new(move || write_trace(&bag_out, names, tick, samples)),
        ),
        case(
            "one axis from a trace in CSV",
            trace_size,
            read,
            Box::new(move || {
                let found = read_recording(&trace_in, x, &RecordingOptions::default());
                black_box(found.expect("a recording"));
            }),
        ),
        case(
            "one axis from a trace in MCAP",
            messages,
            read,
            Box::new(move || {
                let found = read_recording(&bag_in, x, &RecordingOptions::default());
                black_box(found.expect("a recording"));
            }),
        ),
    ]
}

/// Runs the cases in turn and prints their medians.
fn ratios(cases: &mut [Case]) {
    let mut times: Vec<Vec<Duration>> = cases.iter().map(|_| Vec::with_capacity(ROUNDS)).collect();
    for _ in 0..ROUNDS {
        for (case, times) in cases.iter_mut().zip(&mut times) {
            let began = Instant::now();
            (case.run)();
            times.push(began.elapsed());
        }
    }
    let speeds: Vec<f64> = cases
        .iter()
        .zip(&mut times)
        .map(|(case, times)| {
            times.sort_unstable();
            case.bytes as f64 / times[ROUNDS / 2].as_secs_f64()
        })
        .collect();
    println!(
        "{:32} {:>9} {:>8} {:>20}",
        "median of 11 interleaved rounds", "MB", "MB/s", "ratio to raw bytes"
    );
    for (case, speed) in cases.iter().zip(&speeds) {
        let raw = cases.iter().position(|other| Some(other.name) == case.against);
        let part = raw.map_or(String::new(), |raw| format!("{:.3}", speed / speeds[raw]));
        println!("{:32} {:9.1} {:8.0} {part:>20}", case.name, case.bytes as f64 / 1e6, speed / 1e6);
    }
}

fn main() {
    // Criterion exits at an unknown option: parse before the folder is created.
    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    let folder = Folder(std::env::temp_dir().join(format!("virtual_axes_io_{}", std::process::id())));
    fs::create_dir_all(&folder.0).expect("a folder for files");
    let machine: &'static MachineConfig = Box::leak(Box::new(
        Parameters::embedded_default().and_then(|p| p.machine_config()).expect("the shipped machine"),
    ));
    let mut cases = cases(machine, &folder.0);
    // `cargo bench` passes --bench.
    let wanted: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|word| name.contains(word.as_str()));
    cases.retain(|case| case.against.is_none() || is_wanted(case.name));
    ratios(&mut cases);
    let mut group = criterion.benchmark_group("files");
    for case in &mut cases {
        group.throughput(Throughput::Bytes(case.bytes));
        group.bench_function(case.name, |bencher| bencher.iter(&mut case.run));
    }
    group.finish();
    criterion.final_summary();
}
