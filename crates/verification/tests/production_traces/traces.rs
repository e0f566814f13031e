//! Recorded traces and their files.

use virtual_axes_identify::recording::RawRecording;
use virtual_axes_io::files::{RecordingOptions, read_recording};
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::production_traces::{
    AxisOrientation, CurrentSampling, HiddenAxis, HiddenMachine, PERIODS, TraceKind, TraceRecorder, write_csv,
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
fn a_csv_file_is_read_back() {
    let folder = TestFolder::new("production_traces");
    let machine = HiddenMachine::draw(7);
    let program = machine.program(1, 4.0).expect("a program");
    let recorder = TraceRecorder { is_feedforward_recorded: true, ..TraceRecorder::default() };
    let recordings = machine.record(&program, &recorder, 1).expect("recordings");
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
        let feedforward =
            |of: &RawRecording| [of.velocity_feedforward.clone(), of.torque_feedforward.clone()];
        for (read, written) in feedforward(&read).iter().zip(&feedforward(recording)) {
            assert!(is_near(channel(read), channel(written), 0.51e-6));
        }
    }
}

#[test]
fn actual_values_are_logged_late_and_the_current_at_its_phase() {
    let axis = HiddenAxis::draw(3, AxisOrientation::Horizontal);
    let ideal = TraceRecorder { cutoff: 0.0, is_within_cycles: true, ..TraceRecorder::ideal() };
    let fine = TraceRecorder { sampling_period: 500_000, period: 500_000, ..ideal.clone() };
    let instants = |recorder: TraceRecorder| {
        let sampling = CurrentSampling::Instant(0.0);
        recorded(&axis, &TraceRecorder { current_sampling: sampling, ..recorder }, 4, 4.0)
    };
    let on_time = instants(fine.clone());
    let late = instants(TraceRecorder { delay: 3, ..fine.clone() });
    assert_eq!(channel(&late.psec), channel(&on_time.psec));
    for of in [|trace: &RawRecording| trace.position.clone(), |trace: &RawRecording| trace.current.clone()] {
        let (late, on_time) = (of(&late), of(&on_time));
        let [late, on_time] = [channel(&late), channel(&on_time)];
        assert_eq!(late[3..], on_time[..on_time.len() - 3]);
    }
    // A phase of a quarter of 2 ms is one sample of 0.5 ms later.
    let coarse = TraceRecorder { period: 2_000_000, ..ideal };
    let quarter = TraceRecorder { current_sampling: CurrentSampling::Instant(0.25), ..coarse };
    let quarter = recorded(&axis, &quarter, 4, 4.0);
    let (begin, fine) = ((quarter.time.len() / 2), channel(&on_time.current));
    let value = channel(&quarter.current)[begin];
    assert!(fine[4 * begin..].iter().skip(1).step_by(4).take(2).any(|later| *later == value));
}

#[test]
fn kinds_cover_the_traces_of_controls() {
    let kinds: Vec<TraceKind> =
        (0..200).map(|seed| TraceKind::draw(seed, PERIODS[seed as usize % 7])).collect();
    let count = |is_so: &dyn Fn(&TraceKind) -> bool| kinds.iter().filter(|kind| is_so(kind)).count();
    for (name, found) in [
        ("without torque feedforward", count(&|kind| kind.torque_feedforward == 0.0)),
        ("with recorded feedforward", count(&|kind| kind.recorder.is_feedforward_recorded)),
        ("averaged", count(&|kind| kind.recorder.current_sampling == CurrentSampling::Mean)),
        ("late", count(&|kind| kind.recorder.delay == 2)),
        ("filtered", count(&|kind| kind.recorder.cutoff > 0.0)),
    ] {
        assert!((20..=150).contains(&found), "{name}: {found} of 200");
    }
    for kind in &kinds {
        assert_eq!(kind.recorder.period % kind.recorder.sampling_period, 0, "{kind:?}");
        assert!(kind.recorder.cutoff * 2.0 * 1e-9 * (kind.recorder.sampling_period as f64) < 1.0, "{kind:?}");
    }
}
