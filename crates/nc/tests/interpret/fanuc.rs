//! Programs in the manner of Fanuc and Haas: their motions follow from closed forms.

use virtual_axes_core::config::{MachineConfig, Parameters};
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, TipTransform, Tool};
use virtual_axes_nc::motion::{Feed, MotionKind, ProgramEvent, ProgramMotion};

use crate::common::{events, millimeters, motions, steps};

fn options(dialect: Dialect) -> InterpreterOptions {
    let mut options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
    for (number, length, radius) in [(1, 0.050, 0.005), (2, 0.040, 0.002)] {
        options.tools.insert(number, Tool { length, radius, name: None });
    }
    options
}

/// Returns X, Y and Z at the end of each motion, mm.
fn ends(dialect: Dialect, text: &str) -> Vec<[f64; 3]> {
    motions(text, options(dialect)).iter().map(|motion| millimeters(&motion.end)).collect()
}

fn assert_ends(dialect: Dialect, text: &str, expected: &[[f64; 3]]) {
    let found = ends(dialect, text);
    let differs = |(found, expected): (&[f64; 3], &[f64; 3])| {
        found.iter().zip(expected).any(|(found, expected)| (found - expected).abs() > 1e-6)
    };
    let is_wrong = found.len() != expected.len() || found.iter().zip(expected).any(differs);
    assert!(!is_wrong, "{text}\nfound {found:?}\nexpected {expected:?}");
}

/// Returns the duration of all dwells, s.
fn dwells(dialect: Option<Dialect>, text: &str) -> f64 {
    let options = InterpreterOptions { dialect, ..InterpreterOptions::default() };
    let dwell = |(_, event)| if let ProgramEvent::Dwell(time) = event { time } else { 0.0 };
    events(text, options).into_iter().map(dwell).sum()
}

#[test]
fn loops_and_jumps_of_macro_b_drill_a_row_of_holes() {
    let text = "%\nO0010(ROW)\nG21G90G0X0Y0Z5.\n#1=0\nWHILE[#1LT3]DO1\nG0X[#1*10.]\nG1Z-2.F100.\nG0Z5.\n#1=#1+1\nEND1\n\
                N5#2=#2+1\nG0Y[#2*4.]\nIF[#2NE2]GOTO5\nIF[#2EQ2]THEN#3=7.\nG0X#3\nM30\n%\n";
    let mut expected = vec![[0.0, 0.0, 5.0]];
    for hole in 0..3 {
        let x = 10.0 * f64::from(hole);
        if hole > 0 {
            expected.push([x, 0.0, 5.0]);
        }
        expected.extend([[x, 0.0, -2.0], [x, 0.0, 5.0]]);
    }
    expected.extend([[20.0, 4.0, 5.0], [20.0, 8.0, 5.0], [7.0, 8.0, 5.0]]);
    assert_ends(Dialect::Fanuc, text, &expected);
}

#[test]
fn decimal_digits_of_four_bits_are_converted() {
    // 0x0024 is 36, 0x1999 is 6553; ADP adds the decimal point that numbers here need not have.
    let text = "O1\nG21 G90\nG0 X[BIN[36]] Y[BCD[24]]\nX[BIN[6553]/10] Y[BIN[BCD[57]]] Z[ADP[5]]\nM30\n";
    assert_ends(Dialect::Fanuc, text, &[[24.0, 36.0, 0.0], [199.9, 57.0, 5.0]]);
    for (word, expected) in [
        ("BIN[26]", "BIN[26]: must be decimal digits of four bits"),
        ("BCD[1.5]", "BCD[1.5]: must be an integer from 0 to 99999999"),
        ("PRM[1220,1]", "PRM: a parameter of the control, which a simulation lacks: write a number"),
    ] {
        let error = steps(&format!("O1\nG0 X[{word}]\n"), options(Dialect::Fanuc)).unwrap_err().to_string();
        assert!(error.contains(expected), "{word}: {error}");
    }
}

#[test]
fn variables_without_value_are_told_from_zero() {
    let text = "O1\nG0 X1. Y1.\nG65 P9000 A5. B0\nG65 P9000 B3.\nM30\nO9000\nIF[#1EQ#0]GOTO9\nG0 X#1 Y#2 Z#3\nM99\n\
                N9 G0 X[#1+2.] Y#2\nM99\n";
    assert_ends(Dialect::Fanuc, text, &[[1.0, 1.0, 0.0], [5.0, 0.0, 0.0], [2.0, 3.0, 0.0]]);
}

#[test]
fn macro_functions_are_those_of_the_control() {
    let text = "O1\nG0 X[FIX[-1.5]] Y[FUP[1.2]] Z[-7.MOD4.]\nX[ATAN[1.]/[1.]] Y[ATAN[1.,0.]] Z[POW[2.,3.]]\n\
                X[6AND3] Y[6OR3] Z[6XOR3]\nX[ROUND[2.5]] Y[ABS[-3.]] Z[SQRT[16.]]\nM30\n";
    let expected = [[-1.0, 2.0, -3.0], [45.0, 90.0, 8.0], [2.0, 7.0, 5.0], [3.0, 3.0, 4.0]];
    assert_ends(Dialect::Fanuc, text, &expected);
}

#[test]
fn subprograms_repeat_and_return_to_lines() {
    // P30020 calls program 20 three times, L twice; M99 P jumps to a line of the caller.
    let text =
        "O1\nG91\nM98 P30020\nM98 P20 L2\nM98 P21\nG0 X100.\nN7 G0 Y1.\nM30\nO20\nG0 X1.\nM99\nO21\nM99 P7\n";
    let mut expected: Vec<_> = (1..=5).map(|x| [f64::from(x), 0.0, 0.0]).collect();
    expected.push([5.0, 1.0, 0.0]);
    assert_ends(Dialect::Fanuc, text, &expected);
    // M97 of Haas calls the lines from a number on.
    let text = "O1\nG91 G0\nM97 P100 L2\nM30\nN100 X2.\nM99\n";
    assert_ends(Dialect::Haas, text, &[[2.0, 0.0, 0.0], [4.0, 0.0, 0.0]]);
}

#[test]
fn subprograms_may_follow_the_end_of_the_program() {
    let expected = [[5.0, 0.0, 0.0], [5.0, 2.0, 0.0]];
    let after = "%\nO1\nM98 P10\nG0 Y2.\nM30\n%\n\n(SUBPROGRAM)\nO10\nG0 X5.\nM99\n";
    assert_ends(Dialect::Fanuc, after, &expected);
    let enclosed = "%\nO1\nM98 P10\nG0 Y2.\nM30\n%\n%\nO10\nG0 X5.\nM99\n%\n% REST\n";
    assert_ends(Dialect::Fanuc, enclosed, &expected);
}

#[test]
fn a_modal_macro_follows_each_motion() {
    let text = "O1\nG66 P50 Z-3.\nG0 X1.\nG0 X2.\nG67\nG0 X3.\nM30\nO50\nG1 Z#26 F100.\nG0 Z0\nM99\n";
    let expected = [
        [1.0, 0.0, 0.0],
        [1.0, 0.0, -3.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 0.0, -3.0],
        [2.0, 0.0, 0.0],
    ];
    assert_ends(Dialect::Fanuc, text, &[&expected[..], &[[3.0, 0.0, 0.0]]].concat());
}

#[test]
fn dwells_have_the_unit_of_the_dialect() {
    let text = "G21 G90\nG0 Z5.\nG82 X1. Z-1. R1. P500 F100\nG80\nG4 X1.5\nG4 U0.5\nG4 P250\nM30\n";
    assert!((dwells(Some(Dialect::Fanuc), text) - 2.75).abs() < 1e-12);
    assert!((dwells(None, text) - 2.75).abs() < 1e-12, "detected by G4 X and U");
    assert!((dwells(Some(Dialect::Fanuc), "G4 P0.4\n") - 0.4).abs() < 1e-12, "s with a decimal point");
    assert!((dwells(Some(Dialect::Haas), "G4 P2.\nG4 P500\n") - 2.5).abs() < 1e-12);
    assert!((dwells(Some(Dialect::LinuxCnc), "G4 P2.\nG4 P500\n") - 502.0).abs() < 1e-12);
}

#[test]
fn references_and_machine_coordinates_have_each_form() {
    let text = "O1\nG54 G90 G0 X5. Y6. Z7.\nG91 G28 Z0\nG28 X0 Y0\nG90 X1. Y2. Z3.\nG28 U0 W0\nG53 X-10.\nG53 G0 Z-1.\n\
                G30 P2 Z5.\nG0 X4.\nM30\n";
    let mut options = options(Dialect::Fanuc);
    options.work_offsets[0][..3].copy_from_slice(&[0.1, 0.2, 0.3]);
    options.references[1][2] = 0.05;
    options.axes[6..].fill(false);
    let found: Vec<_> = motions(text, options).iter().map(|motion| millimeters(&motion.end)).collect();
    let expected = [
        [105.0, 206.0, 307.0],
        [105.0, 206.0, 0.0],
        [0.0, 0.0, 0.0],
        [101.0, 202.0, 303.0],
        [0.0, 202.0, 0.0],
        [-10.0, 202.0, 0.0],
        [-10.0, 202.0, -1.0],
        [-10.0, 202.0, 305.0],
        [-10.0, 202.0, 50.0],
        [104.0, 202.0, 50.0],
    ];
    for (found, expected) in found.iter().zip(&expected) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
    }
    assert_eq!(found.len(), expected.len());
}

#[test]
fn additional_work_offsets_and_tool_data_are_set_by_the_program() {
    let text = "O1\nG90 G10 L20 P3 X10. Y20.\nG10 L2 P2 Z5.\nG10 L10 P7 R30.\nG54.1 P3 G0 X1. Y1.\nG55 Z1.\n\
                G43 H7 Z0\nG49 Z0\n#5241=4.\nX0\n#5242=#5241*2\nY0\nM30\n";
    let expected = [
        [11.0, 21.0, 0.0],
        [11.0, 21.0, 6.0],
        [11.0, 21.0, 35.0],
        [11.0, 21.0, 5.0],
        [4.0, 21.0, 5.0],
        [4.0, 8.0, 5.0],
    ];
    assert_ends(Dialect::Fanuc, text, &expected);
    // The external work offset is 0 before, too.
    assert_ends(Dialect::Fanuc, "O1\nG90 G10 L2 P0 X0. Y0. Z0. B0.\nG0 X5.\nM30\n", &[[5.0, 0.0, 0.0]]);
    let text = "%\nO2\nG154 P2 G0 X1.\nG111 X2.\nG110 X3.\nM30\n%";
    let mut options = options(Dialect::Haas);
    options.work_offsets[10][0] = 0.1;
    let x: Vec<_> = motions(text, options).iter().map(|motion| (motion.end[0] * 1e3).round()).collect();
    assert_eq!(x, [101.0, 102.0, 3.0]);
}

#[test]
fn rotation_scaling_and_mirroring_act_about_their_centers() {
    // 90° about (10, 0): (20, 0) becomes (10, 10).
    assert_ends(
        Dialect::Fanuc,
        "G68 X10. Y0 R90.\nG0 X20. Y0\nG69\nX20. Y0\nM30\n",
        &[[10.0, 10.0, 0.0], [20.0, 0.0, 0.0]],
    );
    // P2000 is a factor of 2 about (1, 1); then I, J and K.
    assert_ends(Dialect::Fanuc, "G51 X1. Y1. P2000\nG0 X3. Y4.\nG50\nM30\n", &[[5.0, 7.0, 0.0]]);
    assert_ends(
        Dialect::Haas,
        "G51 X0 Y0 Z0 P3.\nG0 X1. Y1. Z-1.\nG50\nG0 X1.\nM30\n",
        &[[3.0, 3.0, -3.0], [1.0, 3.0, -3.0]],
    );
    assert_ends(
        Dialect::Fanuc,
        "G51.1 X5.\nG0 X6. Y1.\nG50.1 X0\nG0 X6.\nM30\n",
        &[[4.0, 1.0, 0.0], [6.0, 1.0, 0.0]],
    );
    assert_ends(
        Dialect::Haas,
        "G101 X0\nG0 X6. Y1.\nG100 X0\nG0 X6.\nM30\n",
        &[[-6.0, 1.0, 0.0], [6.0, 1.0, 0.0]],
    );
}

#[test]
fn a_mirrored_arc_turns_the_other_way_and_a_scaled_one_keeps_its_center() {
    let arc =
        |text: &str| match motions(text, options(Dialect::Fanuc)).last().map(|motion| motion.kind.clone()) {
            Some(MotionKind::Arc(arc)) => arc,
            other => panic!("{other:?}"),
        };
    let plain = arc("G0 X10. Y0\nG3 X0 Y10. I-10. J0 F100.\nM30\n");
    let mirrored = arc("G51.1 X0\nG0 X10. Y0\nG3 X0 Y10. I-10. J0 F100.\nM30\n");
    assert!((plain.sweep + mirrored.sweep).abs() < 1e-12);
    let turned = arc("G68 X0 Y0 R90.\nG0 X20. Y5.\nG3 X10. Y15. I-10. J0 F100.\nM30\n");
    assert!(
        (turned.center[0] + 0.005).abs() < 1e-12 && (turned.center[1] - 0.010).abs() < 1e-12,
        "{turned:?}"
    );
    // Different factors make an ellipse: half axes 20 and 10 mm.
    let chords =
        motions("G51 X0 Y0 I2. J1.\nG0 X10. Y0\nG3 X10. Y0 I-10. J0 F100.\nM30\n", options(Dialect::Haas));
    assert!(chords.len() > 100);
    for motion in &chords[1..] {
        let [x, y, _] = millimeters(&motion.end);
        assert!(((x / 20.0).powi(2) + (y / 10.0).powi(2) - 1.0).abs() < 1e-9, "{x} {y}");
    }
}

#[test]
fn polar_coordinates_have_radius_and_angle() {
    let text = "G17 G90 G16\nG0 X10. Y30.\nY150.\nG91 Y30.\nG15 G90\nX1. Y1.\nM30\n";
    let at =
        |radius: f64, angle: f64| [radius * angle.to_radians().cos(), radius * angle.to_radians().sin(), 0.0];
    assert_ends(Dialect::Fanuc, text, &[at(10.0, 30.0), at(10.0, 150.0), at(10.0, 180.0), [1.0, 1.0, 0.0]]);
}

#[test]
fn corners_are_rounded_and_chamfered() {
    // Right angle at (20, 0): an arc of 5 mm from (15, 0) to (20, 5), then a chamfer of 3 mm at (20, 20).
    let text = "G90 G1 X20. ,R5. F500.\nY20. ,C3.\nX0\nM30\n";
    let expected =
        [[15.0, 0.0, 0.0], [20.0, 5.0, 0.0], [20.0, 17.0, 0.0], [17.0, 20.0, 0.0], [0.0, 20.0, 0.0]];
    assert_ends(Dialect::Haas, text, &expected);
    let found = motions(text, options(Dialect::Haas));
    let MotionKind::Arc(arc) = &found[1].kind else { panic!("{:?}", found[1]) };
    assert!((arc.center[0] - 0.015).abs() < 1e-12 && (arc.center[1] - 0.005).abs() < 1e-12);
    let error = steps("G1 X2. ,R5. F500.\nY20.\nM30\n", options(Dialect::Haas)).expect_err("too short");
    assert_eq!(
        error.to_string(),
        "part.nc:2: the corner of 5 mm does not fit between the motions of lines 1 and 2"
    );
}

#[test]
fn boring_and_tapping_cycles_follow_their_sequences() {
    // G76 shifts by Q at the depth, rises and shifts back.
    let expected = [
        [5.0, 0.0, 10.0],
        [5.0, 0.0, 2.0],
        [5.0, 0.0, -8.0],
        [5.5, 0.0, -8.0],
        [5.5, 0.0, 10.0],
        [5.0, 0.0, 10.0],
    ];
    let text = "G90 G0 Z10.\nG98 G76 X5. Z-8. R2. Q0.5 P100 F80.\nG80\nM30\n";
    assert_ends(Dialect::Fanuc, text, &[&[[0.0, 0.0, 10.0]], &expected[..]].concat());
    let text = "S500 M3\nG90 G0 Z10.\nG99 G84 X5. Z-8. R2. F625.\nG80\nM30\n";
    let expected = [[0.0, 0.0, 10.0], [5.0, 0.0, 10.0], [5.0, 0.0, 2.0], [5.0, 0.0, -8.0], [5.0, 0.0, 2.0]];
    assert_ends(Dialect::Fanuc, text, &expected);
    let spindle: Vec<f64> = events(text, options(Dialect::Fanuc))
        .into_iter()
        .filter_map(
            |(_, event)| if let ProgramEvent::Spindle(speed) = event { Some(speed.signum()) } else { None },
        )
        .collect();
    assert_eq!(spindle, [1.0, -1.0, 1.0]);
    // G87 passes the hole with a shift and bores upward.
    let text = "G90 G0 Z10.\nG98 G87 X5. Z-3. R-12. Q0.5 F80.\nG80\nM30\n";
    let expected = [
        [0.0, 0.0, 10.0],
        [5.0, 0.0, 10.0],
        [5.5, 0.0, 10.0],
        [5.5, 0.0, -12.0],
        [5.0, 0.0, -12.0],
        [5.0, 0.0, -3.0],
        [5.5, 0.0, -3.0],
        [5.5, 0.0, 10.0],
        [5.0, 0.0, 10.0],
    ];
    assert_ends(Dialect::Fanuc, text, &expected);
}

/// and Z-20. are levels of the line with G90, and R-3. and Z-4. of the one with G91 count from Z-5 and from R.
#[test]
fn lines_with_g91_keep_the_levels_of_a_canned_cycle() {
    let hole = |x: f64, above: f64, retract: f64, bottom: f64| {
        [[x, 0.0, above], [x, 0.0, retract], [x, 0.0, bottom], [x, 0.0, retract]]
    };
    for (dialect, times) in [(Dialect::Fanuc, "K2"), (Dialect::Haas, "L2")] {
        let text = format!(
            "O1\nG21 G90 G0 Z10.\nG99 G81 X5. Y0 Z-20. R-5. F100.\nG91 X10. {times}\nG80\n\
             G99 G81 X10. Z-4. R-3.\nX10.\nG90 X50.\nM30\n"
        );
        let mut expected = vec![[0.0, 0.0, 10.0]];
        expected.extend(hole(5.0, 10.0, -5.0, -20.0));
        for x in [15.0, 25.0] {
            expected.extend([[x, 0.0, -5.0], [x, 0.0, -20.0], [x, 0.0, -5.0]]);
        }
        expected.extend(hole(35.0, -5.0, -8.0, -12.0));
        for x in [45.0, 50.0] {
            expected.extend([[x, 0.0, -8.0], [x, 0.0, -12.0], [x, 0.0, -8.0]]);
        }
        assert_ends(dialect, &text, &expected);
    }
}

#[test]
fn g53_of_fanuc_has_no_effect_with_g91_and_may_probe() {
    assert_ends(
        Dialect::Fanuc,
        "O1\nG21 G90 G0 X10.\nG91 G53 X5.\nG90 G53 X2.\nM30\n",
        &[[10.0, 0.0, 0.0], [15.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
    );
    let mut options = options(Dialect::Fanuc);
    options.work_offsets[0][2] = 0.003;
    let found = motions("O1\nG21 G90 G0 Z0\nG53 G31 Z-5. F120. P2\nG1 Z#5063\nM30\n", options);
    let [_, probe] = &found[..] else { panic!("{found:?}") };
    assert_eq!(millimeters(&probe.end), [0.0, 0.0, -5.0]);
    assert!(matches!(probe.feed, Feed::Linear(feed) if (feed - 0.002).abs() < 1e-12), "{:?}", probe.feed);
}

#[test]
fn an_alarm_ends_the_program_and_missing_units_are_noted() {
    let report = |text: &str| {
        let options = InterpreterOptions { reports_all_errors: true, ..options(Dialect::Fanuc) };
        let mut interpreter = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
        assert!(interpreter.by_ref().all(|step| step.is_ok()));
        interpreter.report().clone()
    };
    let found = report("O1\nIF[#1EQ#0]THEN#3000=1(NO A)\nG0 X#1 Q7\nM30\n");
    let errors: Vec<_> = found.errors.keys().collect();
    let [error] = &errors[..] else { panic!("{errors:?}") };
    assert!(error.starts_with("alarm of the program: #3000=1 (NO A); #1 has no value: "), "{error}");
    let note = "lengths and feeds are in mm: no G20 or G21 stands before";
    for (line, first) in [("G0 Z0\nX1. F10.", Some(3)), ("G21\nX1.", None), ("G20\nX1.", None)] {
        let found = report(&format!("O1\n{line}\nX2.\nM30\n"));
        let note = found.assumptions.get(note);
        assert_eq!(note.map(|note| (note.first_line, note.count)), first.map(|line| (line, 1)), "{line}");
    }
}

#[test]
fn pecks_of_haas_become_smaller_down_to_the_least_one() {
    // Depth 10 mm below R: pecks of 4, 3, 2 and 2 mm, at Z −3, −6, −8 and −9.
    let text = "G90 G0 Z1.\nG99 G83 X0 Y0 Z-9. R1. I4. J1. K2. F100.\nG80\nM30\n";
    let depths: Vec<f64> = motions(text, options(Dialect::Haas))
        .iter()
        .filter(|motion| motion.kind == MotionKind::Line)
        .map(|motion| (motion.end[2] * 1e6).round() / 1e3)
        .collect();
    assert_eq!(depths, [-3.0, -6.0, -8.0, -9.0]);
}

#[test]
fn patterns_of_holes_lie_on_circles_and_in_rows() {
    let holes = |text: &str| -> Vec<[f64; 2]> {
        let found = motions(text, options(Dialect::Haas));
        let found = found.iter().filter(|motion| motion.kind == MotionKind::Line);
        found.map(|motion| [0, 1].map(|axis| (motion.end[axis] * 1e9).round() / 1e6)).collect()
    };
    let with_cycle = |pattern: &str| {
        holes(&format!("G90 G0 X10. Y20. Z5.\nG99 G81 Z-3. R1. F100. L0\n{pattern}\nG80\nM30\n"))
    };
    let circle = [[10.0, 25.0], [5.0, 20.0], [10.0, 15.0], [15.0, 20.0]];
    assert_eq!(with_cycle("G70 I5. J90. L4"), circle);
    let clockwise = [circle[0], circle[3], circle[2], circle[1]];
    assert_eq!(with_cycle("G70 I-5. J90. L4"), clockwise);
    assert_eq!(with_cycle("G70 X0 Y0 I4. L2"), [[4.0, 0.0], [-4.0, 0.0]]);
    assert_eq!(with_cycle("G71 I10. K-90. L3"), [[20.0, 20.0], [10.0, 10.0], [0.0, 20.0]]);
    assert_eq!(with_cycle("G72 I3. J90. L3"), [[10.0, 20.0], [10.0, 23.0], [10.0, 26.0]]);
    // The pattern in the line of the cycle, and holes after it.
    let in_one_line = "G90 G0 X10. Y20. Z5.\nG99 G81 Z-3. R1. F100. G70 I5. J90. L4\nX1. Y2.\nG80\nM30\n";
    assert_eq!(holes(in_one_line), [&circle[..], &[[1.0, 2.0]]].concat());
}

#[test]
fn circular_pockets_end_at_their_centers() {
    // I4 with a tool of radius 2: circles of 2 mm; K8 in steps of 2: circles of 2, 4 and 6 mm.
    let circles = |text: &str| -> Vec<f64> {
        let full = |motion: &ProgramMotion| match &motion.kind {
            MotionKind::Arc(arc) if arc.sweep.abs() > 6.0 => Some(
                ((motion.start[0] - arc.center[0]).hypot(motion.start[1] - arc.center[1]) * 1e6).round()
                    / 1e3,
            ),
            _ => None,
        };
        let found = motions(text, options(Dialect::Haas));
        assert!(millimeters(&found[found.len() - 1].end)[..2].iter().all(|value| value.abs() < 1e-9));
        found.iter().filter_map(full).collect()
    };
    assert_eq!(circles("G1 Z0.1 F100.\nG12 I4. D2 F200.\nM30\n"), [2.0]);
    assert_eq!(circles("G1 Z0.1 F100.\nG13 I4. K8. Q2. D2 F200.\nM30\n"), [2.0, 4.0, 6.0]);
}

#[test]
fn words_without_motion_are_counted() {
    let text = "%\nO7\nG05.1 Q1\nG08 P1\nG187 P3 E0.01\nM29 S500\nM88\nM88\nG0 X1. M89\nM30\n%";
    let options = InterpreterOptions { reports_all_errors: true, ..options(Dialect::Haas) };
    let mut interpreter =
        virtual_axes_nc::interpret::Interpreter::new(std::io::Cursor::new(text), "part.nc", options);
    assert_eq!(interpreter.by_ref().filter(Result::is_ok).count(), 2);
    let report = interpreter.report();
    assert!(report.errors.is_empty(), "{report:?}");
    let codes: Vec<_> =
        report.without_effect.iter().map(|(code, found)| (code.as_str(), found.count)).collect();
    assert_eq!(codes, [("G187", 1), ("G5.1", 1), ("G8", 1), ("M29", 1), ("M88", 2), ("M89", 1)]);
}

#[test]
fn alarms_and_missing_lines_are_rejected() {
    for (text, expected) in [
        ("O1\n#3000=5(TOO DEEP)\n", "part.nc:2: alarm of the program: #3000=5"),
        ("O1\nGOTO 5\n", "part.nc:2: N5: no such line in the program that runs"),
        ("O1\nWHILE[1EQ0]DO2\n", "part.nc:2: WHILE DO2 without END2"),
        ("O1\nEND1\n", "part.nc:2: END1 without DO1"),
        (
            "O1\nWHILE[#1 LT 3]DO1 #1=#1+1\nG0 X1.\nEND1\n",
            "part.nc:2: #1=#1+1: a line ends after DO1: move the rest to a line of its own",
        ),
        ("O1\nG65 A1.\n", "part.nc:2: G65 requires P, the number of the macro"),
        ("O1\nG70 I5. L4\n", "part.nc:2: G70 requires a canned cycle"),
        ("O1\nG10 L2 P0 X0. Z-1.\n", "part.nc:2: G10 L2 P0, the external work offset, is not supported"),
        ("O1\nG81 Z-1. R1. F100. L0\nG71 I5. L4\n", "part.nc:3: G71 requires K, the angle between the holes"),
        (
            "O1\nG81 Z-1. R1. F100. L0\nG70 I5. L99999\n",
            "part.nc:3: G70: 99999 holes; at most 10000 are allowed",
        ),
        (
            "O1\nG47 P0 X1. Y1. (AB)\n",
            "part.nc:2: G47 is not supported in the dialect haas: engraving of text",
        ),
        (
            "O1\nG107\nG107 A0 Y0 R2.\n",
            "part.nc:3: G107 is not supported in the dialect haas: cylindrical mapping",
        ),
        ("O1\nG150 P5 X1.\n", "part.nc:2: G150 is not supported in the dialect haas: pocket milling"),
        ("O1\nG68.2 P2 Q4 X0\n", "part.nc:2: G68.2 P2 Q4 is invalid: Q1 to Q3 are the lines of the plane"),
        (
            "O1\nG68.2 P3 Q1 X0 I0 J0 K1.\nG68.2 P3 Q2 K1.\n",
            "part.nc:3: G68.2: points on a line, or vectors of the same direction, give no plane",
        ),
    ] {
        let error = steps(text, options(Dialect::Haas)).expect_err(text).to_string();
        assert!(error.starts_with(expected), "{text:?}: {error}");
    }
}

/// Returns the default machine, whose tool table moves A and C.
fn five_axes() -> MachineConfig {
    Parameters::embedded_default().expect("the default").machine_config().expect("a machine")
}

#[test]
fn in_a_tilted_plane_z_is_along_the_tool_axis() {
    let machine = five_axes();
    let mut options =
        InterpreterOptions { dialect: Some(Dialect::Fanuc), ..InterpreterOptions::for_machine(&machine) };
    options.tools.insert(2, Tool { length: 0.04, ..Tool::default() });
    let transform = TipTransform::new(&machine);
    let text = "O1\nG21 G90 G54\nG68.2 X5. Y-3. Z2. I20. J30. K10.\nG53.1\nG43 H2 Z40.\nG1 X0 Y0 F500.\nX8. Y6.\n\
                G3 X18. Y16. I0 J10.\nG69\nM30\n";
    let found = motions(text, options);
    // Tip of the tool in the workpiece frame: p = o + Rz(I) Rx(J) Rz(K) q.
    let turn = |point: [f64; 3], axis: usize, degrees: f64| -> [f64; 3] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let [x, y, z] = point;
        if axis == 2 {
            [x * cos - y * sin, x * sin + y * cos, z]
        } else {
            [x, y * cos - z * sin, y * sin + z * cos]
        }
    };
    let workpiece = machine.kinematics().workpiece;
    let check = |motion: &ProgramMotion, point: [f64; 3]| {
        let turned = turn(turn(turn(point, 2, 10.0), 0, 30.0), 2, 20.0);
        let expected = [turned[0] + 5.0, turned[1] - 3.0, turned[2] + 2.0];
        let tip = millimeters(&transform.tip_of(&motion.end, 0.04));
        for axis in 0..3 {
            let expected = expected[axis] + 1e3 * workpiece[axis];
            assert!((tip[axis] - expected).abs() < 1e-9, "{point:?}: {tip:?}, expected {expected}");
        }
    };
    let [.., to_zero, line, arc] = &found[..] else { panic!("{} motions", found.len()) };
    check(to_zero, [0.0, 0.0, 40.0]);
    check(line, [8.0, 6.0, 40.0]);
    check(arc, [18.0, 16.0, 40.0]);
    assert!(matches!(arc.kind, MotionKind::Arc(_)), "the table turns the plane parallel to XY");
    assert!((line.end[3].abs() - 30_f64.to_radians()).abs() < 1e-9, "A tilts by J");
}

#[test]
fn tool_vectors_turn_the_tables() {
    let machine = five_axes();
    let options =
        InterpreterOptions { dialect: Some(Dialect::Fanuc), ..InterpreterOptions::for_machine(&machine) };
    let text = "O1\nG90 G54\nG43.5 H0\nG0 X0 Y0 Z10. I0 J-0.5 K0.8660254037844386\nG49\nM30\n";
    let found = motions(text, options);
    let last = found.last().expect("a motion");
    // u = (sin a sin c, −sin a cos c, cos a): a = 30°, c = 0.
    assert!((last.end[3] - 30_f64.to_radians()).abs() < 1e-9 && last.end[5].abs() < 1e-9, "{last:?}");
}

#[test]
fn references_interrupt_tool_center_point_control() {
    let machine = five_axes();
    let options =
        InterpreterOptions { dialect: Some(Dialect::Fanuc), ..InterpreterOptions::for_machine(&machine) };
    let text = "O1\nG90 G54\nG0 A20. C30.\nG43.4 H0\nG0 X10. Y-5. Z30.\nG28 G91 Z0.\nG90 G0 X1. Y2. Z30.\nG49\nM30\n";
    let found = motions(text, options);
    let lengths: Vec<_> = found.iter().map(|motion| motion.tcp_length.is_some()).collect();
    assert_eq!(lengths, [false, true, false, true]);
    assert_eq!(found[2].end[2], 0.0, "Z at its reference");
}

#[test]
fn the_forms_of_tilted_planes_agree() {
    let machine = five_axes();
    let transform = TipTransform::new(&machine);
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    // Turned by 30 degrees about X: (x, y, z) becomes (x, y cos − z sin, y sin + z cos).
    let about_x = |[x, y, z]: [f64; 3]| [x, y * cos - z * sin, y * sin + z * cos];
    let about_y = |[x, y, z]: [f64; 3]| [x * cos + z * sin, y, z * cos - x * sin];
    let about_z = |[x, y, z]: [f64; 3]| [x * cos - y * sin, x * sin + y * cos, z];
    let point = [8.0, 6.0, 40.0];
    for (lines, turned) in [
        ("G68.2 X5. Y-3. Z2. I0 J30. K0", about_x(point)),
        ("G68.2 P1 X5. Y-3. Z2. I30. J0 K0", about_x(point)),
        ("G68.2 P1 Q123 X5. Y-3. Z2. I30. J30. K30.", about_z(about_y(about_x(point)))),
        ("G68.2 P1 Q321 X5. Y-3. Z2. I30. J30. K30.", about_x(about_y(about_z(point)))),
        (
            "G68.2 P2 Q1 X5. Y-3. Z2.\nG68.2 P2 Q2 X9. Y-3. Z2.\nG68.2 P2 Q3 X3. Y5.6602540378443865 Z7.",
            about_x(point),
        ),
        (
            "G68.2 P2 Q0 X1. Y2. Z3. R30.\nG68.2 P2 Q1 X5. Y-3. Z2.\nG68.2 P2 Q2 X9. Y-3. Z2.\nG68.2 P2 Q3 X5. Y0 Z2.",
            {
                let turned = about_z(point);
                [turned[0] + 1.0, turned[1] + 2.0, turned[2] + 3.0]
            },
        ),
        ("G68.2 P3 Q1 X5. Y-3. Z2. I1. J0 K0\nG68.2 P3 Q2 I0 J-0.5 K0.8660254037844386", about_x(point)),
        ("G68.2 P4 X5. Y-3. Z2. I0 J30. K0", about_x(point)),
        ("G68.2 P4 X5. Y-3. Z2. I30. J0 K30.", about_y(about_z(point))),
        ("G268 X5. Y-3. Z2. I30. J30. K30. Q123", about_z(about_y(about_x(point)))),
        ("G268 X5. Y-3. Z2. I30. J30. K30.", about_x(about_y(about_z(point)))),
    ] {
        let (dialect, turn, end) = match lines.starts_with("G268") {
            true => (Dialect::Haas, "G253", "G269"),
            false => (Dialect::Fanuc, "G53.1", "G69"),
        };
        let mut options =
            InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::for_machine(&machine) };
        options.tools.insert(2, Tool { length: 0.04, ..Tool::default() });
        let text = format!("O1\nG21 G90 G54\n{lines}\n{turn}\nG43 H2 Z40.\nG1 X8. Y6. F500.\n{end}\nM30\n");
        let found = motions(&text, options);
        let tip = millimeters(&transform.tip_of(&found.last().expect("a motion").end, 0.04));
        let workpiece = machine.kinematics().workpiece;
        for (axis, origin) in [5.0, -3.0, 2.0].into_iter().enumerate() {
            let expected = turned[axis] + origin + 1e3 * workpiece[axis];
            assert!(
                (tip[axis] - expected).abs() < 1e-9,
                "{lines}: {tip:?}, expected {expected} of axis {axis}"
            );
        }
    }
}

#[test]
fn probing_moves_to_its_end() {
    let text = "O1\nG90 G21\nG65 P9832\nG65 P9810 X10. Y5. F2000.\nG65 P9811 Z-3.\nG31 Z-5. F100.\n#1=#5063\nG1 Z#1 X11.\n\
                G65 P9833\nM30\n";
    assert_ends(Dialect::Haas, text, &[[10.0, 5.0, 0.0], [10.0, 5.0, -5.0], [11.0, 5.0, -5.0]]);
    // A macro of the program itself runs.
    assert_ends(Dialect::Fanuc, "O1\nG65 P9810 X3.\nM30\nO9810\nG0 Y#24\nM99\n", &[[0.0, 3.0, 0.0]]);
    let text = "G38.2 Z-2 F50\nG0 X#5063\nG38.5 Z0\n";
    assert_ends(Dialect::LinuxCnc, text, &[[0.0, 0.0, -2.0], [-2.0, 0.0, -2.0], [-2.0, 0.0, 0.0]]);
    // #5070 is 1 if the probe has touched; nothing is touched where that is no error.
    let text = "F50\nG38.2 Z-2\nG0 X[1+#5070]\nG38.3 Z-3\nG0 X#5070\n";
    assert_ends(
        Dialect::LinuxCnc,
        text,
        &[[0.0, 0.0, -2.0], [2.0, 0.0, -2.0], [2.0, 0.0, -3.0], [0.0, 0.0, -3.0]],
    );
}

#[test]
fn variables_of_the_memory_are_vacant_until_set() {
    let text = "O1\nG0 X1. Y1.\nIF[#900038EQ#0]THEN#900038=3.\nIF[#98000EQ#0]THEN#999999=4.\nX#900038 Y#500001\nY[#999999*2.].\n\
                G1 X5. F[#900038*20.].\nM30\n";
    assert_ends(Dialect::Fanuc, text, &[[1.0, 1.0, 0.0], [3.0, 1.0, 0.0], [3.0, 8.0, 0.0], [5.0, 8.0, 0.0]]);
    let motions = motions(text, options(Dialect::Fanuc));
    let feed = motions.last().map(|motion| motion.feed);
    assert!(matches!(feed, Some(Feed::Linear(feed)) if (feed - 0.001).abs() < 1e-12), "60 mm/min: {feed:?}");
}

#[test]
fn codes_that_end_what_is_not_active_have_no_effect() {
    let text =
        "O1\nG0 G17 G40 G13.1 G50.2 G25\nG117 M8 M3\nG54.2 P0\nG54.4 P0\nG05.4 Q0\nG113\nX2. Y3.\nM30\n";
    assert_ends(Dialect::Fanuc, text, &[[2.0, 3.0, 0.0]]);
    // Units as posts of NX write them.
    let text = "%\nN0010 G40 G17 G90 G70\n:0030 T01 M06\nN0040 G0 X1. Y-.5\nN0050 G71 X10.\nN0060 M02\n%\n";
    assert_ends(Dialect::Fanuc, text, &[[25.4, -12.7, 0.0], [10.0, -12.7, 0.0]]);
    // The first line of posts for PathPilot.
    let text = "G90 G54 G64 G50 G17 G40 G80 G94 G91.1 G49\nG0 X2 Y3\nM30\n";
    assert_ends(Dialect::LinuxCnc, text, &[[2.0, 3.0, 0.0]]);
    for (line, remedy) in [
        ("G54.2 P1", "dynamic fixture offset"),
        ("G60 X1.", "program G0"),
        ("G66.1 P9", "program G65"),
        ("#5203=-5.", "#5203, the external work offset, is not supported: add it to the work offsets"),
        ("G100 T1 X5.", "of Brother, a tool change with motions: program T, M6 and G0"),
    ] {
        let found = steps(&format!("O1\n{line}\nM30\n"), options(Dialect::Fanuc)).map(|_| ());
        assert!(found.as_ref().is_err_and(|error| error.to_string().contains(remedy)), "{line}: {found:?}");
    }
}

#[test]
fn rigid_tapping_and_parameters_of_the_control_are_accepted() {
    let header = "O1\nG21 G90 G0 X0 Y0 Z20.\nM3 S500\n";
    let tapped = [[0.0, 0.0, 20.0], [0.0, 0.0, 5.0], [0.0, 0.0, -10.0], [0.0, 0.0, 5.0], [0.0, 0.0, 20.0]];
    for code in ["G84", "G84.2", "G84.3"] {
        let text = format!("{header}{code} Z-10. R5. F500.\nG80\nM30\n");
        assert_ends(Dialect::Fanuc, &text, &tapped);
    }
    // Parameter 1815 of axis 2: no motion, and modes stay as they are.
    let text = format!("{header}G1 X1. F500.\nG10 L50\nN1815 P2 R00100000\nN1420 R5000\nG11\nX3. Y4.\nM30\n");
    assert_ends(Dialect::Fanuc, &text, &[[0.0, 0.0, 20.0], [1.0, 0.0, 20.0], [3.0, 4.0, 20.0]]);
}

/// Chamfer of a bore of 14 mm by 45° with a tool of 1 mm radius: full circles whose radius grows with the height.
#[test]
fn a_chamfer_by_macro_b_has_circles_of_growing_radius() {
    let text = "%\nO60 (CHAMFER)\nG21 G17 G90\nG52 X [ 0. ] Y [ 0. ] Z [ 0. ]\nG0 X0 Y0 Z10.\n#10= 14.\n#1= 0.\n#2= -2.\n\
                #3= 0.75\n#4= 2. / 2\n#5= 45.\nWHILE [ #1 GT #2 ] DO1\n#1= #1 - #3\nIF [ #1 LT #2 ] THEN #1= #2\n\
                #20= #10 / 2 + [ [ #1 - #2 ] * TAN[ #5 ] ] - #4\nG1 X [ 0. ] Y [ 0. ] F500.\nG1 Z#1\n\
                G1 X [ 0. ] Y [ #20 ]\nG3 I [ 0. ] J [ - #20 ]\nG1 X [ 0. ] Y [ 0. ]\nEND1\nM30\n%\n";
    let mut expected = vec![[0.0, 0.0, 10.0]];
    for z in [-0.75, -1.5, -2.0] {
        let radius = 7.0 - 1.0 + (z + 2.0);
        expected.extend([[0.0, 0.0, z], [0.0, radius, z], [0.0, radius, z], [0.0, 0.0, z]]);
    }
    assert_ends(Dialect::Fanuc, text, &expected);
    let circles: Vec<f64> = motions(text, options(Dialect::Fanuc))
        .iter()
        .filter_map(|motion| match &motion.kind {
            MotionKind::Arc(arc) => Some(arc.sweep),
            _ => None,
        })
        .collect();
    assert_eq!(circles.len(), 3);
    assert!(circles.iter().all(|sweep| (sweep - 2.0 * std::f64::consts::PI).abs() < 1e-9), "{circles:?}");
}

#[test]
fn words_of_macros_are_abbreviated_to_two_letters_and_more() {
    // WHILE, END, GOTO, THEN and functions, as a control of Fanuc completes them.
    let text = "O1\nG21G90G0X0Y0Z0\n#1=0\nWH[#1LT3]DO1\nG0X[#1*10.+1.]\n#1=#1+1\nEN1\nG0YCO[60.]\nG0Y[SQ[16.]+RO[1.4]]\n\
                IF[[#1EQ3]AN[1EQ1]]GO5\nG0X99.\nN5IF[#1EQ3]TH#2=7.\nG0Z#2\nG28XY\nM30\n";
    let expected = [
        [1.0, 0.0, 0.0],
        [11.0, 0.0, 0.0],
        [21.0, 0.0, 0.0],
        [21.0, 0.5, 0.0],
        [21.0, 5.0, 0.0],
        [21.0, 5.0, 7.0],
        [0.0, 0.0, 7.0],
    ];
    assert_ends(Dialect::Fanuc, text, &expected);
    // Haas has the whole words only.
    let error =
        steps("O1\n#1=0\nWH[#1LT3]DO1\nEN1\n", options(Dialect::Haas)).expect_err("no word").to_string();
    assert!(error.starts_with("part.nc:3: "), "{error}");
}

/// Returns the errors and assumptions of a program, all at once.
fn report(text: &str) -> (Vec<String>, Vec<String>) {
    let options = InterpreterOptions { reports_all_errors: true, ..options(Dialect::Fanuc) };
    let mut interpreter = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
    let errors: Vec<_> =
        interpreter.by_ref().filter_map(|step| step.err().map(|error| error.reason)).collect();
    let report = interpreter.report();
    (
        errors.into_iter().chain(report.errors.keys().cloned()).collect(),
        report.assumptions.keys().cloned().collect(),
    )
}

#[test]
fn a_macro_without_its_call_names_the_arguments_that_it_lacks() {
    let arguments = "a macro with arguments runs by the program that calls it, as with G65 P9010 X10";
    let (errors, assumptions) = report("O9010\nG21\nG0 X#24 Z1.\nG1 Z-1. F#9\nM99\n");
    assert!(
        assumptions.contains(&format!("word X has no effect: #24 has no value: {arguments}")),
        "{assumptions:?}"
    );
    assert_eq!(errors, [format!("feed missing: word F: #9 has no value: {arguments}")]);
    let (errors, _) = report("O9010\nIF[#24EQ#0]GOTO9\nM30\nN9#3000=100(X IS MISSING)\nM99\n");
    assert_eq!(
        errors,
        [format!("alarm of the program: #3000=100 (X IS MISSING); #24 has no value: {arguments}")]
    );
    // Common variables keep their values in the control.
    let (errors, _) = report("O1\nG21\nG1 X1. F#650\nM30\n");
    let value = "set it at the start of the program to its value in the control";
    assert_eq!(errors, [format!("feed missing: word F: #650 has no value: {value}")]);
    // With the call, words of arguments that are left out have no effect, without a note.
    let (errors, assumptions) = report("O1\nG21\nG65 P9010 Z-1. F100.\nM30\nO9010\nG1 X#24 Z#26 F#9\nM99\n");
    assert!(errors.is_empty(), "{errors:?}");
    assert!(assumptions.iter().all(|text| !text.contains("has no value")), "{assumptions:?}");
    // The alarm of a main program has the text of its comment.
    let (errors, _) = report("O1\n#3000=5(TOO DEEP)\nM30\n");
    assert_eq!(errors, ["alarm of the program: #3000=5 (TOO DEEP)"]);
}
