//! Recorded traces and their files.

use virtual_axes_core::statistics::{mean, median};
use virtual_axes_identify::recording::RawRecording;
use virtual_axes_io::files::{RecordingOptions, read_recording};
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::production_traces::{
    AxisOrientation, HiddenAxis, HiddenMachine, TraceRecorder, write_csv,
};

fn recorded(axis: &HiddenAxis, recorder: &TraceRecorder, seed: u64, duration: f64) -> RawRecording {
    axis.record(&axis.program(seed, duration).expect("a program"), recorder, seed).expect("a recording")
}

fn channel(values: &Option<Vec<f64>>) -> &[f64] {
    values.as_deref().expect("recorded")
}

#[test]
fn a_trace_depends_on_its_seeds_only() {
    let axis = HiddenAxis::draw(3, AxisOrientation::Vertical);
    let recorder = TraceRecorder::default();
    let trace = recorded(&axis, &recorder, 4, 4.0);
    assert_eq!(trace, recorded(&axis, &recorder, 4, 4.0));
    assert_ne!(trace, recorded(&axis, &recorder, 5, 4.0));
}

#[test]
fn samples_are_20_milliseconds_apart_and_the_first_stamp_is_off_the_grid() {
    let axis = HiddenAxis::draw(1, AxisOrientation::Horizontal);
    let (mut gaps, mut traces) = (0, 0);
    for seed in 0..20 {
        let trace = recorded(&axis, &TraceRecorder::default(), seed, 3.0);
        let mut steps: Vec<f64> = trace.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(steps.iter().all(|step| ((step / 0.02).round() * 0.02 - step).abs() <= 2.001e-4));
        gaps += steps.iter().filter(|step| **step > 0.03).count();
        traces += usize::from(steps.iter().any(|step| *step > 0.03));
        assert!((median(&mut steps).expect("steps") - 0.02).abs() < 1e-4);
        let milliseconds = trace.time[0] * 1e3;
        assert!((0.05..21.0).contains(&milliseconds));
        assert!((milliseconds - milliseconds.round()).abs() > 1e-6, "{milliseconds} ms");
    }
    assert!((1..=15).contains(&traces) && gaps >= traces, "{traces} traces, {gaps} gaps");
}

#[test]
fn the_weight_is_visible_as_mean_current() {
    for seed in 0..5 {
        let axis = HiddenAxis::draw(seed, AxisOrientation::Vertical);
        let trace = recorded(&axis, &TraceRecorder::default(), seed, 10.0);
        let sign = if axis.is_current_inverted { -1.0 } else { 1.0 };
        let config = &axis.config;
        let holding = config.gravity.weight * config.transmission_ratio / config.motor.torque_constant;
        let found = sign * mean(channel(&trace.current)).expect("a mean");
        assert!((found - holding).abs() < 0.2 * holding, "seed {seed}: {found} A, holding {holding} A");
    }
}

#[test]
fn a_horizontal_axis_stands_still_for_most_of_the_time() {
    let still: Vec<f64> = (0..4)
        .map(|seed| {
            let axis = HiddenAxis::draw(seed, AxisOrientation::Horizontal);
            let trace = recorded(&axis, &TraceRecorder::ideal(), seed, 20.0);
            let psec = channel(&trace.psec);
            psec.windows(2).filter(|pair| (pair[1] - pair[0]).abs() < 1e-6).count() as f64 / psec.len() as f64
        })
        .collect();
    assert!(mean(&still).expect("a mean") > 0.5, "{still:?}");
}

#[test]
fn backlash_and_stribeck_friction_change_the_trace() {
    let ideal = TraceRecorder::ideal();
    let axis = HiddenAxis::draw(2, AxisOrientation::Horizontal);
    let plain = recorded(&axis, &ideal, 1, 5.0);
    let loose = recorded(&HiddenAxis { backlash: 5e-6, ..axis.clone() }, &ideal, 1, 5.0);
    let differences =
        channel(&plain.position).iter().zip(channel(&loose.position)).map(|(p, l)| (p - l).abs());
    let largest = differences.fold(0.0, f64::max);
    // Half the width, and the overshoot of the filter.
    assert!((2.4e-6..=2.8e-6).contains(&largest), "{largest} m");
    assert_eq!(plain.current, loose.current);
    let sticky = recorded(&HiddenAxis { stribeck: 0.1, ..axis }, &ideal, 1, 5.0);
    assert_ne!(plain.current, sticky.current);
}

#[test]
fn a_csv_file_is_read_back() {
    let folder = TestFolder::new("production_traces");
    let machine = HiddenMachine::draw(7);
    let program = machine.program(1, 4.0).expect("a program");
    let recordings = machine.record(&program, &TraceRecorder::default(), 1).expect("recordings");
    let path = folder.0.join("trace.csv");
    write_csv(&path, &recordings).expect("a file");
    let text = std::fs::read_to_string(&path).expect("readable");
    assert!(text.starts_with("Time [s],X commanded position [mm],X actual position [mm],"));
    for (axis, recording) in machine.axes.iter().zip(&recordings) {
        assert_eq!(recording.time, recordings[0].time);
        // The columns are detected from their headers.
        let options = RecordingOptions::default();
        let (read, _) = read_recording(&path, &axis.config, &options).expect("a recording");
        let is_near = |read: &[f64], written: &[f64], tolerance: f64| {
            read.len() == written.len() && read.iter().zip(written).all(|(r, w)| (r - w).abs() <= tolerance)
        };
        assert!(is_near(&read.time, &recording.time, 0.51e-6));
        assert!(is_near(channel(&read.psec), channel(&recording.psec), 1e-12));
        assert!(is_near(channel(&read.position), channel(&recording.position), 1e-12));
        assert!(is_near(channel(&read.velocity), channel(&recording.velocity), 0.51e-6));
        assert!(is_near(channel(&read.current), channel(&recording.current), 1e-9));
    }
}

#[test]
fn options_out_of_range_are_rejected() {
    let axis = HiddenAxis::draw(1, AxisOrientation::Vertical);
    let error = axis.program(1, f64::NAN).expect_err("not a duration").to_string();
    assert_eq!(error, "the duration in s is NaN, must be from 3 to 60");
    let program = axis.program(1, 3.0).expect("a program");
    for recorder in [
        TraceRecorder { sampling_period: 0, ..TraceRecorder::default() },
        TraceRecorder { period: 0, ..TraceRecorder::default() },
        TraceRecorder { cutoff: 240.0, ..TraceRecorder::default() },
        TraceRecorder { gap_probability: 1.5, ..TraceRecorder::default() },
        TraceRecorder { jitter: f64::NAN, ..TraceRecorder::default() },
    ] {
        let error = axis.record(&program, &recorder, 1).expect_err("out of range").to_string();
        assert!(error.contains(", must be "), "{error}");
    }
    // A recording that begins after the end of the program is empty.
    let late = TraceRecorder { start: 100.0, gap_probability: 1.0, ..TraceRecorder::default() };
    assert!(axis.record(&program, &late, 1).expect("a recording").time.is_empty());
}
