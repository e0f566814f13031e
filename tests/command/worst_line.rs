//! Planted faults of part programs: `virtual_axes run` reports their line and cause first.

use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::fixtures::recordings::NoiseGenerator;

use crate::command_common::json;

/// Length of a smooth line, mm.
const LENGTH: f64 = 6.0;
/// Number of smooth lines.
const COUNT: usize = 30;
/// Angle of a corner, rad.
const CORNER: f64 = 1.0;

/// Program of tangent arcs, with the line numbers of its motions.
struct SmoothProgram {
    lines: Vec<String>,
    position: [f64; 2],
    heading: f64,
}

impl SmoothProgram {
    fn new() -> Self {
        let lines = vec!["G21 G90 G54 G17 G64 P0.002 F3000".to_owned()];
        Self { lines, position: [0.0; 2], heading: 0.3 }
    }

    /// Appends an arc that is tangent to the path, with a signed radius, mm, and a length, mm; returns its line.
    fn arc(&mut self, radius: f64, length: f64, words: &str) -> usize {
        let [x, y] = self.position;
        let (sin, cos) = self.heading.sin_cos();
        let center = [x - radius * sin, y + radius * cos];
        self.heading += length / radius;
        let (sin, cos) = self.heading.sin_cos();
        self.position = [center[0] + radius * sin, center[1] - radius * cos];
        let code = if radius > 0.0 { "G3" } else { "G2" };
        self.lines.push(format!(
            "{code} X{:.6} Y{:.6} I{:.6} J{:.6} {words}",
            self.position[0],
            self.position[1],
            center[0] - x,
            center[1] - y
        ));
        self.lines.len()
    }

    /// Appends a smooth line of a wave; returns its line.
    fn wave(&mut self, index: usize, words: &str) -> usize {
        let radius = if index.is_multiple_of(2) { 150.0 } else { -150.0 };
        self.arc(radius, LENGTH, words)
    }

    /// Returns the line, cause and error, µm, of the worst lines of `virtual_axes run`.
    fn worst_lines(mut self, name: &str) -> Vec<(usize, String, f64)> {
        // A slow end: its overshoot is no fault.
        self.lines.push("F300".to_owned());
        self.wave(0, "");
        self.lines.push("M2".to_owned());
        let folder = TestFolder::new(name);
        let file = folder.file("part.nc", &(self.lines.join("\n") + "\n"));
        let result = json(&["run", file.to_str().expect("UTF-8"), "--json"]);
        let worst = result["runs"][0]["part_program"]["worst_lines"].as_array().expect("lines");
        let line = |line: &serde_json::Value| {
            let number = line["line"].as_u64().expect("a line") as usize;
            let error = line["contour_error_um"].as_f64().expect("an error");
            (number, line["cause"].as_str().expect("a cause").to_owned(), error)
        };
        worst.iter().map(line).collect()
    }
}

/// Plants a fault into smooth programs after a random line and asserts that the worst line is one of the lines that
/// `plant` returns, with the cause.
fn assert_found(
    name: &str,
    cause: &str,
    corner_every: Option<usize>,
    plant: impl Fn(&mut SmoothProgram) -> [usize; 2],
) {
    for seed in 1..=5 {
        let planted_after = 4 + (NoiseGenerator::new(seed).uniform() * (COUNT - 8) as f64) as usize;
        let mut program = SmoothProgram::new();
        let mut lines = [0; 2];
        let mut turn = CORNER;
        for index in 0..COUNT {
            program.wave(index, "");
            if index == planted_after {
                lines = plant(&mut program);
            } else if corner_every.is_some_and(|every| index % every == every - 1) {
                program.heading += turn;
                turn = -turn;
            }
        }
        let worst = program.worst_lines(&format!("{name}_{seed}"));
        println!("{name} {seed}: {lines:?} {:?}", &worst[..3]);
        assert!(
            lines.contains(&worst[0].0) && worst[0].1 == cause,
            "{name}, seed {seed}: {lines:?} {worst:?}"
        );
    }
}

#[test]
fn a_corner_without_tolerance_is_the_worst_among_tight_ones() {
    assert_found("corner", "corner", Some(6), |program| {
        // The tolerance of the line before the corner applies.
        program.lines.push("G64 P2".to_owned());
        let first = program.wave(1, "");
        program.heading += CORNER;
        let second = program.wave(0, "");
        program.lines.push("G64 P0.002".to_owned());
        program.wave(1, "");
        program.heading -= CORNER;
        [first, second]
    });
}

#[test]
fn a_reversal_is_the_worst() {
    assert_found("reversal", "reversal of x", None, |program| {
        let back = program.wave(1, "");
        program.heading += std::f64::consts::PI;
        let again = program.wave(1, "");
        program.heading += std::f64::consts::PI;
        program.wave(1, "");
        [back, again]
    });
}

#[test]
fn a_bad_arc_is_the_worst() {
    assert_found("arc", "curvature", None, |program| {
        let bad = program.arc(3.0, 2.0, "F6000");
        program.wave(0, "F3000");
        [bad, bad]
    });
}
