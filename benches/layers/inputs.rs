//! Benchmarks of inputs and outputs: config, scenario, messages, report, urdf.

use std::cell::LazyCell;
use std::hint::black_box;
use std::sync::Arc;

use byteorder::LittleEndian;
use criterion::{Criterion, Throughput};
use virtual_axes_core::assess::SignalRecording;
use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters};
use virtual_axes_core::scenario::Scenario;
use virtual_axes_core::trajectory::{Start, TrajectoryPoint, TrajectoryRequest};
use virtual_axes_core::trial::{self, Measures, Trial};
use virtual_axes_io::files::encode_cdr;
use virtual_axes_io::messages::sensor_msgs::msg::JointState;
use virtual_axes_io::messages::trajectory_msgs::msg::JointTrajectory;
use virtual_axes_io::messages::{self, DriveStates, MotorCurrents, Sampled};
use virtual_axes_io::urdf::urdf;
use virtual_axes_report::{Report, ReportRun};

use crate::{Group, bench, shipped, swing};
use virtual_axes_verification::fixtures::machines::{program, setpoints};

/// Length of the encapsulation header before CDR, bytes.
const CDR_HEADER: usize = 4;
/// Points of a large trajectory.
const POINTS: usize = 10_000;

pub fn all(criterion: &mut Criterion) {
    config(criterion);
    messages_as_bytes(criterion);
    report(criterion);
    let machine = shipped();
    let mut group = criterion.benchmark_group("urdf, machines");
    bench(&mut group, "URDF of a machine", 1, || urdf(black_box(&machine), ""));
    group.finish();
}

fn config(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("config, files");
    bench(&mut group, "a machine file read and checked", 1, || {
        Parameters::builtin("mikron_ucp710").and_then(|parameters| parameters.machine_config())
    });
    bench(&mut group, "a scenario read and checked", 1, || Scenario::builtin("five-axis"));
    group.finish();
}

/// Benchmarks encoding and decoding of a message.
macro_rules! both_ways {
    ($group:expr, $name:literal, $type:ty, $message:expr) => {{
        let message: $type = $message;
        let mut bytes = Vec::new();
        encode_cdr(&message, &mut bytes).expect("a message");
        $group.throughput(Throughput::Bytes(bytes.len() as u64));
        let mut buffer = Vec::new();
        bytes_of($group, concat!($name, " encoded"), || encode_cdr(black_box(&message), &mut buffer));
        bytes_of($group, concat!($name, " decoded"), || {
            cdr_encoding::from_bytes::<$type, LittleEndian>(black_box(&bytes[CDR_HEADER..]))
        });
    }};
}

fn bytes_of<T>(group: &mut Group, name: &str, mut work: impl FnMut() -> T) {
    group.bench_function(name, |bencher| bencher.iter(&mut work));
}

fn messages_as_bytes(criterion: &mut Criterion) {
    let config = shipped();
    let names: Vec<String> = config.axes().iter().map(|axis| axis.name().to_owned()).collect();
    let mut machine = Machine::new(Arc::new(MachineParameters::new(&config).expect("it can be discretized")));
    machine.advance(&[1e-3; 5], &[]);
    let samples: Vec<AxisSample> = machine.axes().iter().map(|axis| *axis.sample()).collect();
    let mut long = TrajectoryRequest::new(Start::Now, names.clone());
    for k in 0..POINTS {
        let positions: [f64; 5] = std::array::from_fn(|axis| swing(axis, k));
        let row = TrajectoryPoint { positions: &positions, ..TrajectoryPoint::default() };
        long.push(k as i64 * config.periods().position, row).expect("well formed");
    }
    let long = messages::joint_trajectory(&long);
    let group = &mut criterion.benchmark_group("messages, bytes");
    both_ways!(group, "joint state of five axes", JointState, JointState::of(1, &samples, &names));
    both_ways!(group, "motor currents of five axes", MotorCurrents, MotorCurrents::of(1, &samples, &names));
    both_ways!(group, "drive states of five axes", DriveStates, DriveStates::of(1, &samples, &names));
    both_ways!(group, "trajectory of 10 000 points", JointTrajectory, long.clone());
    bytes_of(group, "trajectory of 10 000 points converted to a request", || {
        messages::request(black_box(&long), usize::MAX)
    });
}

fn report(criterion: &mut Criterion) {
    let config = shipped();
    let recordings: LazyCell<Vec<SignalRecording>, _> = LazyCell::new(|| {
        let program = program("ballbar", &config);
        let trial = Trial {
            machine: &config,
            program: Some(Arc::clone(&program)),
            allow_nonzero_end_velocity: false,
            record: true,
            measures: Measures::ALL,
        };
        let outcome = trial::run(&trial, setpoints("ballbar", program, &config), |_| Ok(()));
        let recording = outcome.expect("a run").recording.expect("recording is enabled");
        vec![recording; 2]
    });
    let page = |runs: usize| {
        let run = |(i, recording): (usize, _)| ReportRun {
            title: ["cascade", "predictive"][i % 2],
            facts: Vec::new(),
            recording,
        };
        let runs = recordings.iter().enumerate().map(run).take(runs).collect();
        let mut page = Vec::new();
        let report = Report { title: "ballbar", runs, ..Report::default() };
        report.write(&mut page).expect("written to memory");
        page
    };
    let mut group = criterion.benchmark_group("report, position cycles shown");
    let periods = recordings.first().map_or(0, |recording| recording.time.len());
    bench(&mut group, "page of a ballbar", periods, || page(1));
    bench(&mut group, "page that compares two", 2 * periods, || page(2));
    group.finish();
}
