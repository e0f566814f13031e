//! The command `virtual_axes check` with part programs.

use std::path::Path;
use std::process::{Command, Output};

use virtual_axes_verification::fixtures::folder::TestFolder;

fn check(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
        .arg("check")
        .args(arguments)
        .output()
        .expect("the command starts")
}

/// Checks a text as a part program and returns standard output or the error.
fn checked(text: &str, arguments: &[&str]) -> Result<String, String> {
    let folder = TestFolder::new("part-program");
    let file = folder.file("part.NC", text);
    let file = file.to_string_lossy();
    let output = check(&[&[&*file], arguments].concat());
    let [out, error] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    match output.status.code() {
        Some(0) => Ok(out),
        Some(2) if out.is_empty() => Err(error.strip_prefix(&*file).expect("the file").to_owned()),
        status => panic!("{status:?}: {out}{error}"),
    }
}

#[test]
fn the_summary_has_motions_time_and_extents() {
    let text = "G43 H1\nG0 X10 Z50\nG1 X40 F1800\nG3 X40 Y40 R20\nG4 P0.5\nG93 G1 A90 F30\nM2\n";
    let pi = std::f64::consts::PI;
    let summary = checked(text, &[]).expect("a valid program");
    let lines: Vec<_> = summary.lines().collect();
    let time = 1.0 + 20.0 * pi / 30.0 + 0.5 + 2.0;
    let expected = format!("part program for Mikron UCP 710: {time:.3} s at the programmed feed");
    assert!(lines[0].starts_with(&expected), "{summary}");
    // The reversal point of the arc is at X 60; the tool length of the machine is 100 mm.
    for line in [
        "motions: 1 rapid, 2 lines, 1 arcs, 0 splines; 0.0928319 m at feed, shortest",
        "    motion 30 mm",
        "x: start 0.000 mm, end 40.000 mm, range 0.000 to 60.000 mm",
        "y: start 0.000 mm, end 40.000 mm, range 0.000 to 40.000 mm",
        "z: start 0.000 mm, end 150.000 mm, range 0.000 to 150.000 mm",
        "a: start 0.000 °, end 90.000 °, range 0.000 to 90.000 °",
        "valid",
    ] {
        assert!(lines.contains(&line), "{line}\n{summary}");
    }
}

#[test]
fn words_and_positions_beyond_the_machine_are_rejected_with_their_line() {
    for (text, expected) in [
        (
            "G64 P0.1\nG16\n",
            ":2: G16 is not supported in the dialect linuxcnc: known in --dialect fanuc or haas",
        ),
        ("G0 B5\n", ":1: word B: the machine has no axis B; axes: X Y Z A C\n"),
        (
            "G64 P0.1\nM200\n",
            ":2: M200 is not supported in the dialect linuxcnc: skip it with --ignore M200\n",
        ),
        (
            "G0 X10\nG1 F100 Y-300\n",
            ":2: y at -0.3 m (-300 mm) is outside of its travel limits -0.275 m (-275 mm) to 0.275 m (275 mm)\n",
        ),
        // Only the arc leaves the travel: its ends are inside.
        ("F100 G0 X340\nG3 X340 Y100 R50\n", ":2: x at 0.39 m (390 mm) is outside of its travel limits "),
        // The tip does not leave the travel, but the axes do when the table turns.
        ("G43.4 H1\nG0 X300 Y150\nG0 C90\n", ":3: y at "),
    ] {
        let error = checked(text, &[]).expect_err(text);
        assert!(error.starts_with(expected), "{text:?}: {error}");
        // A table of the axes with their work offsets follows a travel excess.
        assert_eq!(error.lines().count() == 1, !error.contains("outside"), "{error}");
    }
    for axis in ["B", "U", "V", "W"] {
        let expected = format!(":1: word {axis}: the machine has no axis {axis}; axes: X Y Z A C\n");
        assert_eq!(checked(&format!("G1 F100 X1 {axis}0\n"), &[]), Err(expected));
    }
    assert!(checked("M100 P1\nm110\nG0 X1\n", &["--ignore", "100,M110"]).is_ok());
    assert!(checked("G0 X300\n", &[]).is_ok());
    assert!(checked("G0 X300\n", &["--machine", "linear_motor_center"]).is_err());
}

#[test]
fn shipped_programs_are_valid_on_both_machines() {
    for name in ["circle-diamond-square", "finishing-raster", "pocket", "s-path-five-axis"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("config/programs/{name}.nc"));
        for machine in ["mikron_ucp710", "linear_motor_center"] {
            let output = check(&[&file.to_string_lossy(), "--machine", machine]);
            assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
            let named = check(&[name, "--machine", machine]);
            assert_eq!(named.stdout, output.stdout, "{name}");
        }
    }
}
