//! Independent C reference of benches/peers: reproduces the model page, and the library agrees with it.
//!
//! The C program has its own parameter table and discretizes the motor by a series.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

use serde_json::Value;
use virtual_axes_core::assess::{AxisAssessor, AxisReport};
use virtual_axes_core::units::{DEGREE, REVOLUTION, RPM, seconds};
use virtual_axes_verification::fixtures::machines::*;

const MICROMETER: f64 = 1e-6;
const JOINTS: [&str; AXES] = ["x", "y", "z", "a", "c"];
/// Position tolerance, m or rad: the order of operations causes less than 1e-14, a friction error of 1e-12 A less than
/// this.
const ROUNDING: f64 = 1e-12;

/// Path of the C program, built once without -ffast-math, so that only the order of operations differs.
static PROGRAM: LazyLock<PathBuf> = LazyLock::new(|| {
    let program = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scalar");
    let status = Command::new("gcc")
        .args(["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-o"])
        .arg(&program)
        .arg(peers("scalar.c"))
        .arg("-lm")
        .status()
        .expect("gcc is installed (Debian: apt-get install gcc)");
    assert!(status.success(), "gcc: {status}");
    program
});

fn peers(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../benches/peers").join(file)
}

/// Setpoints of some joints on the position grid.
struct Setpoints {
    name: &'static str,
    joints: Vec<&'static str>,
    rows: Vec<Vec<f64>>,
}

impl Setpoints {
    fn new(
        name: &'static str,
        joints: &[&'static str],
        duration: f64,
        psec: impl Fn(f64) -> Vec<f64>,
    ) -> Self {
        let periods = (duration / TSP).ceil() as u32;
        Setpoints {
            name,
            joints: joints.to_vec(),
            rows: (0..periods).map(|k| psec(f64::from(k) * TSP)).collect(),
        }
    }

    /// Runs the program on these setpoints with `input` on stdin; returns its output.
    fn run(&self, input: &str, arguments: &[&str]) -> String {
        let mut text = self.joints.join(" ") + "\n";
        for row in &self.rows {
            for value in row {
                write!(text, "{value:?} ").expect("a String takes everything");
            }
            text.push('\n');
        }
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("scalar-{}.txt", self.name));
        fs::write(&file, text).expect("the folder is there");
        let mut child = Command::new(&*PROGRAM)
            .arg(peers("mikron_ucp710.txt"))
            .arg(&file)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        // The pipe closes after this statement; the program ends at the end of its input.
        child.stdin.take().expect("it is piped").write_all(input.as_bytes()).expect("the program reads");
        let output = child.wait_with_output().expect("the program ends");
        assert!(output.status.success(), "{}: {}", self.name, output.status);
        String::from_utf8(output.stdout).expect("it is text")
    }

    fn figures(&self, arguments: &[&str]) -> Value {
        let output: Value = serde_json::from_str(&self.run("run 1\n", arguments)).expect("it is JSON");
        output["machines"][0].clone()
    }

    fn positions(&self) -> Vec<Vec<f64>> {
        let number = |word: &str| word.parse().expect("a number");
        self.run("", &["--positions"]).lines().map(|l| l.split_whitespace().map(number).collect()).collect()
    }
}

#[track_caller]
fn figure(figures: &Value, path: &str) -> f64 {
    figures.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("no {path} in {figures}"))
}

#[test]
fn c_reference_reproduces_lines_and_rotations_of_the_model_page() {
    let line = |acceleration| RestToRestProfile::new(0.200, 10.0 * M_MIN, acceleration, 50.0);
    let turn = RestToRestProfile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * REVOLUTION, 50.0 * REVOLUTION);
    for (joint, profile, unit, error, current) in [
        ("x", line(2.5), MICROMETER, 218.9, 14.40),
        ("y", line(2.5), MICROMETER, 230.5, 12.40),
        ("z", line(2.1), MICROMETER, 102.7, 11.50),
        ("c", turn, 1e-3 * DEGREE, 35.4, 1.76),
        ("a", turn, 1e-3 * DEGREE, 35.0, 2.37),
    ] {
        let setpoints = Setpoints::new(joint, &[joint], profile.duration() + 0.5, |t| vec![profile.at(t)]);
        let figures = setpoints.figures(&[]);
        let largest = figure(&figures, &format!("/axes/{joint}/max_delay_compensated_following_error"));
        assert_near(joint, largest / unit, error, error / 100.0);
        let peak = figure(&figures, &format!("/axes/{joint}/peak_current"));
        assert_near(joint, peak, current, current / 100.0);
    }
}

#[test]
fn c_reference_reproduces_the_ballbar_of_the_model_page() {
    let trial = Ballbar::paper();
    let setpoints = Setpoints::new("ballbar", &["x", "y"], trial.duration(), |t| trial.psec(t)[..2].to_vec());
    let window = trial.window();
    let [first, last] = [window.start, window.end].map(|t| ((t / TSP).round() as u32).to_string());
    let figures = setpoints.figures(&["--circle", "0.15", &first, &last]);
    for (key, wanted, tolerance) in [("mean", 49.0, 0.2), ("min", 47.7, 1.0), ("max", 68.6, 1.0)] {
        assert_near(key, figure(&figures, &format!("/circle/{key}")) / MICROMETER, wanted, tolerance);
    }
}

/// Returns positions at position cycles and figures of the library.
fn simulate(setpoints: &Setpoints) -> (Vec<Vec<f64>>, Vec<AxisReport>) {
    let mut machine = machine(&[]);
    let mut assessors = [AxisAssessor::default(); AXES];
    let mut positions = Vec::new();
    for psec in &setpoints.rows {
        machine.advance(psec, &[]);
        for (index, assessor) in assessors.iter_mut().enumerate() {
            assessor.observe(machine.axis(index).sample(), &machine.activity(index));
        }
        positions.push(machine.axes().iter().map(|axis| axis.sample().position).collect());
    }
    let tick = seconds(machine.periods().current);
    (positions, assessors.map(|assessor| assessor.report(tick)).to_vec())
}

fn assert_library_agrees(setpoints: &Setpoints) -> Vec<AxisReport> {
    let (positions, reports) = simulate(setpoints);
    let wanted = setpoints.positions();
    assert_eq!(positions.len(), wanted.len());
    for (k, (found, wanted)) in positions.iter().zip(&wanted).enumerate() {
        for ((joint, found), wanted) in JOINTS.iter().zip(found).zip(wanted) {
            assert!((found - wanted).abs() <= ROUNDING, "{joint} at period {k}: {found} and {wanted}");
        }
    }
    let figures = setpoints.figures(&[]);
    for (joint, report) in JOINTS.iter().zip(&reports) {
        for (key, found, tolerance) in [
            ("max_following_error", report.max_following_error, ROUNDING),
            ("rms_following_error", report.rms_following_error, ROUNDING),
            ("max_delay_compensated_following_error", report.max_delay_compensated_following_error, ROUNDING),
            ("rms_delay_compensated_following_error", report.rms_delay_compensated_following_error, ROUNDING),
            // Errors of currents are about 1000 times those of positions: transmission ratio and gains.
            ("peak_current", report.peak_current, 1e3 * ROUNDING),
            ("control_activity", report.control_activity, 1e3 * ROUNDING),
            ("saturation_time", report.saturation_time, ROUNDING),
        ] {
            let wanted = figure(&figures, &format!("/axes/{joint}/{key}"));
            assert_near(&format!("{joint} {key}"), found, wanted, tolerance);
        }
    }
    reports
}

#[test]
fn five_axes_agree_with_the_c_reference() {
    let line = RestToRestProfile::new(0.200, 10.0 * M_MIN, 2.1, 50.0);
    let turn = RestToRestProfile::new(90.0 * DEGREE, 10.0 * RPM, 0.83 * REVOLUTION, 50.0 * REVOLUTION);
    // Forward and back: every axis reverses and stops twice.
    let shuttle = |profile: RestToRestProfile, pause: f64, t: f64| {
        profile.at(t) - profile.at(t - profile.duration() - pause)
    };
    let setpoints = Setpoints::new("five-axis", &JOINTS, 2.0 * turn.duration() + 0.5, |t| {
        vec![
            shuttle(line, 0.0, t),
            -shuttle(line, 0.02, t),
            shuttle(line, 0.2, t),
            shuttle(turn, 0.0, t),
            -2.0 * shuttle(turn, 0.1, t),
        ]
    });
    let reports = assert_library_agrees(&setpoints);
    assert!(reports.iter().all(|report| report.saturation_time == 0.0), "{reports:?}");
}

#[test]
fn step_into_every_limit_agrees_with_the_c_reference() {
    let setpoints = Setpoints::new("step", &JOINTS, 0.6, |t| {
        let size = if t < 0.05 { 0.0 } else { 1.0 };
        vec![0.020 * size, -0.020 * size, 0.020 * size, 10.0 * DEGREE * size, 20.0 * DEGREE * size]
    });
    let reports = assert_library_agrees(&setpoints);
    assert!(reports.iter().all(|report| report.saturation_time > 0.0), "{reports:?}");
}
