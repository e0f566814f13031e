//! Words beyond rs274: their effect follows from the reference page.

use virtual_axes_nc::interpret::InterpreterOptions;
use virtual_axes_nc::motion::{Blend, MotionKind, PathControl, ProgramEvent};

use crate::common::{error, events, motions};

/// Returns X at the end of each motion, in whole micrometers.
fn x_of(text: &str) -> Vec<i64> {
    motions(text, InterpreterOptions::default())
        .iter()
        .map(|motion| (motion.end[0] * 1e6).round() as i64)
        .collect()
}

#[test]
fn optional_lines_can_be_skipped() {
    let text = "/G0 X1\n/ N2 G0 X2\nG0 X3\n/M2\nG0 X4\n";
    assert_eq!(x_of(text), [1000, 2000, 3000]);
    let options = InterpreterOptions { skips_optional_lines: true, ..InterpreterOptions::default() };
    assert_eq!(motions(text, options.clone()).len(), 2);
    // Neither branch nor subprogram begins or ends in a line that is skipped.
    let text = "o1 if [0]\nG0 X1\n/o1 else\nG0 X2\no1 endif\nG0 X3\n";
    assert_eq!((x_of(text), motions(text, options).len()), (vec![2000, 3000], 1));
}

#[test]
fn the_end_of_the_file_ends_the_program() {
    let end = |text| events(text, InterpreterOptions::default()).pop();
    assert_eq!(end("G0 X1"), Some((1, ProgramEvent::End)));
    assert_eq!(end(""), Some((1, ProgramEvent::End)));
    assert_eq!(end("G0 X1\r\nM30\r\nG99 nonsense"), Some((2, ProgramEvent::End)));
    assert_eq!(x_of("\u{feff}%\nO1234 (NAME)\nG0 X1\n%\nnot read"), [1000]);
    // Comments before the first sign are no text.
    assert_eq!(x_of("(part 7) (rev B)\n; of 2026\n % (start)\nG0 X1\n%\nnot read"), [1000]);
}

#[test]
fn subprograms_by_number_follow_the_main_program() {
    let text = "G91\nM98 P20 L2\nG0 X1\nM30\nO20\nG0 X5\nM98 P30\nM99\nO30\nG0 X0.5\nM99\n";
    assert_eq!(x_of(text), [5000, 5500, 10500, 11000, 12000]);
    // M98 has no parameters of its own.
    assert_eq!(x_of("#1=3\nM98 P7\nG0 X#1\nM2\nO7\n#1=[#1+1]\nM99\n"), [4000]);
}

#[test]
fn break_and_continue_end_repeat_and_do_loops() {
    let text = "o1 repeat [5]\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\no3 if [#1 GT 3]\no1 break\n\
                o3 endif\nG0 X#1\no1 endrepeat\nG0 X9\n";
    assert_eq!(x_of(text), [1000, 3000, 9000]);
    let text =
        "o1 do\n#1=[#1+1]\no2 if [#1 LT 3]\no1 continue\no2 endif\nG0 X#1\no1 while [#1 LT 4]\nG0 X9\n";
    assert_eq!(x_of(text), [3000, 4000, 9000]);
}

#[test]
fn a_subprogram_may_stand_after_its_call() {
    assert_eq!(x_of("o<a> call [2]\nM2\no<a> sub\nG0 X#1\no<a> endsub\n"), [2000]);
}

#[test]
fn offsets_are_parameters_in_millimeters() {
    let text = "G10 L2 P2 X3\nG0 X5 A90\nG28.1\nG92 X1\nT4 M6 G43.1 Z2\nG91 G20\n\
                G0 X[#5241/25.4]\nX[#5161/25.4]\nX[#5211/25.4]\nX[#5403/25.4]\nX[#5164/2540]\nX#5400\n";
    let x = x_of(text);
    let steps: Vec<i64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(steps, [3000, 5000, 4000, 2000, 900, 4 * 25_400]);
}

#[test]
fn the_rotary_tolerance_has_as_many_degrees_as_millimeters() {
    let text = "G64 P0.02\nG0 X1\nG20 G64 P0.01 Q0.001\nG0 X2\n";
    let found: Vec<_> =
        motions(text, InterpreterOptions::default()).iter().map(|motion| motion.path_control).collect();
    let PathControl::Blend(Blend { tolerance, rotary_tolerance, merge_tolerance }) = found[0] else {
        panic!("{found:?}")
    };
    assert!((tolerance.expect("P") - 20e-6).abs() < 1e-18);
    assert!((rotary_tolerance.expect("P") - 0.02_f64.to_radians()).abs() < 1e-15);
    assert_eq!(merge_tolerance, None);
    let PathControl::Blend(inches) = found[1] else { panic!("{found:?}") };
    assert!((inches.rotary_tolerance.expect("P") - 0.254_f64.to_radians()).abs() < 1e-15);
    assert!((inches.merge_tolerance.expect("Q") - 25.4e-6).abs() < 1e-18);
}

#[test]
fn splines_have_their_control_points() {
    let text = "F300 G0 X1 Y0\nG5 I0 J3 P0 Q-3 X5 Y5\nG5.1 X10 Y5 I2 J4\n\
                G5.2 P2 L3\nX12 Y6 P1\nX14 Y5 P0.5\nG5.3\n";
    let found = motions(text, InterpreterOptions::default());
    let splines: Vec<_> = found[1..].iter().map(|motion| &motion.kind).collect();
    // X, Y and weight of the control points.
    let expected = [
        (4, vec![(1.0, 0.0, 1.0), (1.0, 3.0, 1.0), (5.0, 2.0, 1.0), (5.0, 5.0, 1.0)]),
        (3, vec![(5.0, 5.0, 1.0), (7.0, 9.0, 1.0), (10.0, 5.0, 1.0)]),
        (3, vec![(10.0, 5.0, 2.0), (12.0, 6.0, 1.0), (14.0, 5.0, 0.5)]),
    ];
    assert_eq!(splines.len(), expected.len());
    for (kind, (order, points)) in splines.into_iter().zip(expected) {
        let MotionKind::Nurbs(nurbs) = kind else { panic!("{kind:?}") };
        assert_eq!((nurbs.order, nurbs.control.len()), (order, points.len()));
        for (([x, y], weight), expected) in nurbs.control.iter().zip(points) {
            let error =
                (x * 1e3 - expected.0).abs() + (y * 1e3 - expected.1).abs() + (weight - expected.2).abs();
            assert!(error < 1e-12, "{nurbs:?}");
        }
    }
}

#[test]
fn a_cubic_spline_without_i_and_j_continues_in_the_direction_of_the_one_before() {
    let text = "F300 G0 X1 Y0\nG5 I0 J3 P1 Q-2 X5 Y5\nG5 X9 Y5 P0 Q3\n";
    let found = motions(text, InterpreterOptions::default());
    let MotionKind::Nurbs(nurbs) = &found[2].kind else { panic!("{found:?}") };
    let [x, y] = nurbs.control[1].0;
    assert!((x - 4e-3).abs() + (y - 7e-3).abs() < 1e-15, "{nurbs:?}");
    for between in ["", "G1 X6\n"] {
        let found = error(&format!("F300 G0 X1 Y0\n{between}G5 X9 Y5 P0 Q3\n"));
        assert!(found.ends_with("a spline requires I and J"), "{found}");
    }
    let found = error("F300 G0 X1 Y0\nG5 I0 J3 P1 Q-2 X5 Y5\nG1 X6\nG5 X9 Y5 P0 Q3\n");
    assert!(found.ends_with("a spline requires I and J"), "{found}");
}

#[test]
fn the_diameter_of_the_tool_is_a_parameter_in_millimeters() {
    // 0 without a tool; after M6 that of the tool, also one that G10 L1 sets, in inches here.
    let text = "G21 G90\nG10 L1 P2 R3\nG0 X[#5410+1]\nT2 M6\nX#5410\nG20\nG10 L1 P2 R0.25\nG21\nX#5410\nT0 M6\nX[#5410+2]\nM2\n";
    assert_eq!(x_of(text), [1000, 6000, 12_700, 2000]);
}
