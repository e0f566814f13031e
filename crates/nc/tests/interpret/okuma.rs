//! Programs in the manner of Okuma posts and shops: their motions follow from hand-worked geometry.

use virtual_axes_core::config::Parameters;
use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, TipTransform, Tool};
use virtual_axes_nc::motion::ProgramEvent;

use crate::common::{events, millimeters, motions, steps};

/// Returns options with tools, G15 H1 at 100, 50, 0 mm, and travel up to 500 mm.
fn options() -> InterpreterOptions {
    let mut options = InterpreterOptions::default();
    for (number, length, radius) in [(1, 0.050, 0.005), (2, 0.040, 0.002)] {
        options.tools.insert(number, Tool { length, radius, name: None });
    }
    options.work_offsets[0][..3].copy_from_slice(&[0.1, 0.05, 0.0]);
    options.upper_limits = [0.5; 9];
    options
}

/// Compares dialect and ends of the motions, mm.
fn assert_ends(text: &str, expected: &[[f64; 3]]) {
    let dialect = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.min", options());
    assert_eq!(dialect.dialect().dialect, Dialect::Okuma, "{text}");
    let found: Vec<_> = motions(text, options()).iter().map(|motion| millimeters(&motion.end)).collect();
    let differs = |(found, expected): (&[f64; 3], &[f64; 3])| {
        found.iter().zip(expected).any(|(found, expected)| (found - expected).abs() > 1e-6)
    };
    let is_wrong = found.len() != expected.len() || found.iter().zip(expected).any(differs);
    assert!(!is_wrong, "{text}\nfound {found:?}\nexpected {expected:?}");
}

#[test]
fn a_program_of_a_post_drills_with_work_offset_tool_length_and_return_level() {
    // Z is a coordinate plus the length 50 of tool 1; G0 Z9999 ends at the upper limit 500.
    let text = "%\nO1001(PLATE)\n(T1 D=10. - DRILL)\nN10G90G80G94G17\nN15G21\nG0Z9999.\nG111T1\nS2000M3\nG17G90G94\nG15H1\n\
                M8\nG0X10.Y0.\nG0G56Z15.H1\nG71Z15.\nG17G81X10.Y0.Z-5.R2.F200.M53\nX20.\nM54\nX30.\nG80\nG0Z9999.\n\
                M9\nG30P1\nM30\n%\n";
    assert_ends(
        text,
        &[
            [0.0, 0.0, 500.0],
            [110.0, 50.0, 500.0],
            [110.0, 50.0, 65.0],
            [110.0, 50.0, 52.0],
            [110.0, 50.0, 45.0],
            [110.0, 50.0, 65.0],
            [120.0, 50.0, 65.0],
            [120.0, 50.0, 52.0],
            [120.0, 50.0, 45.0],
            [120.0, 50.0, 65.0],
            // M54 stands in a line of its own before.
            [130.0, 50.0, 65.0],
            [130.0, 50.0, 52.0],
            [130.0, 50.0, 45.0],
            [130.0, 50.0, 52.0],
            [130.0, 50.0, 500.0],
            [0.0, 0.0, 0.0],
        ],
    );
}

#[test]
fn ncyl_positions_and_stores_the_cycle() {
    for line in
        ["NCYL G81 X5 Y5 Z-3 R1 F100 M54", "N2 G81 X5 Y5 Z-3 R1 F100 M54 NCYL", "NCYLG81X5Y5Z-3R1F100M54"]
    {
        let text = format!("$PLATE.MIN%\nG90 G0 Z10\n{line}\nX8\nG80\nM2\n");
        assert_ends(
            &text,
            &[
                [0.0, 0.0, 10.0],
                [105.0, 55.0, 10.0],
                [108.0, 55.0, 10.0],
                [108.0, 55.0, 1.0],
                [108.0, 55.0, -3.0],
                [108.0, 55.0, 1.0],
            ],
        );
    }
}

/// Three holes at the radius 10 about (20, 10), counterclockwise from 30° on.
#[test]
fn a_bolt_circle_repeats_the_cycle_in_effect() {
    let text =
        "$A.MIN%\nG15 H1\nG0 X0 Y0 Z10\nNCYL G81 Z-3 R1 F100 M54\nBHC X20 Y10 I10 J30 K3\nX0 Y0\nG80\nM2\n";
    let holes = [30_f64, 150.0, 270.0].map(|angle| {
        let (sine, cosine) = angle.to_radians().sin_cos();
        [120.0 + 10.0 * cosine, 60.0 + 10.0 * sine]
    });
    let mut expected = vec![[100.0, 50.0, 10.0]];
    let mut level = 10.0;
    for [x, y] in [holes[0], holes[1], holes[2], [100.0, 50.0]] {
        let hole = [level, 1.0, -3.0, 1.0].map(|z| [x, y, z]);
        expected.extend(if level > 1.0 { &hole[..] } else { &hole[1..] });
        level = 1.0;
    }
    assert_ends(text, &expected);
}

#[test]
fn a_retraction_to_the_travel_limit_ends_there_in_each_system() {
    let text =
        "O7\nG15 H1\nT1 M6\nG0 G56 HA Z20\nX1 Y1\nG1 Z-2 F100\nG0 Z=VPPLZ\nG15 H0\nG0 X = VPPLX-1\nM2\n";
    assert_ends(
        text,
        &[
            [0.0, 0.0, 70.0],
            [101.0, 51.0, 70.0],
            [101.0, 51.0, 48.0],
            [101.0, 51.0, 500.0],
            [499.0, 51.0, 500.0],
        ],
    );
}

#[test]
fn output_to_a_printer_moves_no_axis() {
    let text = "$A.MIN%\nPUT 'EVENT/1 X=5'\nPUT'A'\nPUT VC5,6,0\nWRITE C\nG0 X = 1 Y= 2 Z =3\nM2\n";
    assert_ends(text, &[[101.0, 52.0, 3.0]]);
}

#[test]
fn variables_conditions_and_named_lines_make_a_loop() {
    // Three steps of 4 mm, then the square root of 81 along Y.
    let text = "$LOOP.MIN%\nVC1=0\nXPOS=2\nNLOOP VC1=VC1+1\nG0 X=XPOS+VC1*4\nIF [VC1 LT 3] NLOOP\n\
                Y=SQRT[81] Z=VC[VC1-2]\nGOTO NEND\nG0 X99\nNEND M2\n";
    assert_ends(text, &[[106.0, 0.0, 0.0], [110.0, 0.0, 0.0], [114.0, 0.0, 0.0], [114.0, 59.0, 3.0]]);
}

#[test]
fn variables_without_value_are_empty_and_texts_have_no_effect() {
    let text = "$A.MIN%\nCALL OPOS PX=3\nM2\nOPOS\nIF [PY NE EMPTY] NSET\nPY=#1FH\nVUACM[1]='NO \"PY\"'\n\
                NSET IF [PX EQ EMPTY] NEND\nG0 X=PX Y=PY\nNEND RTS\n";
    assert_ends(text, &[[103.0, 81.0, 0.0]]);
}

/// A is 90°: the tool axis is −Y of the workpiece. The point X10 of G15 H1 is the zero of G15 H2.
#[test]
fn a_fixture_offset_turns_the_zero_with_the_tables() {
    let machine = Parameters::embedded_default().expect("the default").machine_config().expect("a machine");
    let transform = TipTransform::new(&machine);
    let text =
        "$A.MIN%\nG15 H1\nCALL OO88 PX=10 PA=90 PC=0 PH=1 PP=2\nG0 A90 C0\nG15 H2\nG0 X0 Y0 Z0\nZ5\nM2\n";
    let options =
        InterpreterOptions { dialect: Some(Dialect::Okuma), ..InterpreterOptions::for_machine(&machine) };
    let found = motions(text, options);
    let [_, zero, above] = &found[..] else { panic!("{} motions", found.len()) };
    let workpiece = machine.kinematics().workpiece;
    for (motion, expected) in [(zero, [10.0, 0.0, 0.0]), (above, [10.0, -5.0, 0.0])] {
        let tip = millimeters(&transform.tip_of(&motion.end, 0.0));
        for axis in 0..3 {
            let expected = expected[axis] + 1e3 * workpiece[axis];
            assert!((tip[axis] - expected).abs() < 1e-9, "{tip:?}, expected {expected} of axis {axis}");
        }
    }
}

#[test]
fn subprograms_have_names_arguments_and_repetitions() {
    let text = "$MAIN.MIN%\nG91\nCALL OSTEP DX=2 Q3\nG90\nMODIN O20\nG0 Y7\nMODOUT\nG0 Y8\nM2\n\
                OSTEP\nG0 X=DX\nRTS\nO20\nG1 Z-1 F100\nG0 Z0\nRTS\n";
    // The first step counts from the axis position 0.
    assert_ends(
        text,
        &[
            [2.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [6.0, 0.0, 0.0],
            [6.0, 57.0, 0.0],
            [6.0, 57.0, -1.0],
            [6.0, 57.0, 0.0],
            [6.0, 58.0, 0.0],
        ],
    );
}

#[test]
fn g16_selects_a_system_for_its_line_and_h0_is_that_of_the_machine() {
    let text = "O7\nG15 H1\nG0 X1 Y1\nG16 H0 X300 Y200\nX2\nG15 H0\nG0 X4 Y4\nM2\n";
    assert_ends(text, &[[101.0, 51.0, 0.0], [300.0, 200.0, 0.0], [102.0, 200.0, 0.0], [4.0, 4.0, 0.0]]);
}

#[test]
fn g11_shifts_and_turns_and_g62_mirrors() {
    // A quarter turn about (10, 0): X5 Y2 becomes (10 − 2, 5).
    let text =
        "O7\nG15 H2\nG11 X10 Y0 P90\nG0 X5 Y2\nG10\nG0 X5 Y2\nG62 X1 Y0\nG0 X5 Y2\nG62 X0 Y0\nG0 X6\nM2\n";
    assert_ends(text, &[[8.0, 5.0, 0.0], [5.0, 2.0, 0.0], [-5.0, 2.0, 0.0], [6.0, 2.0, 0.0]]);
}

#[test]
fn tools_and_offsets_are_variables() {
    // The radius 5 of tool 1, its length 50 by HA, and a work offset moved by 5 mm.
    let text = "O7\nG15 H1\nIF [VTLCN EQ 1] N5\nT1 M6\nN5 VZOFX[1]=VZOFX[1]+5\nG0 X=VTOFD[1]*2 Z=1\nG56 HA Z0\n\
                VTMNO=1\nVSLDT[1,30]\nG53\nG0 Z0\nM2\n";
    assert_ends(text, &[[115.0, 0.0, 1.0], [115.0, 0.0, 50.0], [115.0, 0.0, 0.0]]);
}

#[test]
fn dwells_are_in_seconds_by_f_and_in_milliseconds_in_cycles() {
    let text = "O7\nG15 H2\nG4 F1.5\nG4 P0.5\nG0 Z5\nG82 X0 Y0 Z-1 R1 P250 F100\nG80\nM2\n";
    let dwell = |(_, event)| if let ProgramEvent::Dwell(time) = event { time } else { 0.0 };
    let total: f64 = events(text, options()).into_iter().map(dwell).sum();
    assert!((total - 2.25).abs() < 1e-12, "{total}");
}

#[test]
fn cutter_compensation_takes_the_radius_of_the_active_tool() {
    // Left of a path along X: 5 mm in Y.
    let text = "O7\nG15 H2\nT1 M6\nG0 X0 Y-10\nG41 G1 X10 Y0 DA F500\nX40\nG40 Y-10\nM2\n";
    let ends: Vec<_> = motions(text, options()).iter().map(|motion| millimeters(&motion.end)).collect();
    assert!((ends[1][1] - 5.0).abs() < 1e-9, "{ends:?}");
    assert!((ends[2][0] - 40.0).abs() < 1e-9 && (ends[2][1] - 5.0).abs() < 1e-9, "{ends:?}");
}

#[test]
fn wrong_lines_are_rejected() {
    for (text, expected) in [
        ("$A.MIN%\nGOTO NX\n", "part.nc:2: NX: no such line in the program that runs"),
        ("$A.MIN%\nLAA X0 Y0 I10 J0\n", "part.nc:2: LAA is not supported in the dialect okuma"),
        (
            "$A.MIN%\nBHC X0 Y0 I10 J0 K4\n",
            "part.nc:2: BHC requires a canned cycle in a line before, as in NCYL G81 Z-5 R1 F100",
        ),
        ("$A.MIN%\nG81 Z-5 R1 F9\nBHC I10 J0\n", "part.nc:3: BHC requires K, the number of holes"),
        (
            "$A.MIN%\nG0 X=DIA\n",
            "part.nc:2: word X: DIA: the variable has no value: set it before it is used",
        ),
        ("$A.MIN%\nCALL OXY\n", "part.nc:2: OXY: no such subprogram in this file"),
        ("$A.MIN%\nVC1=#8G\n", "part.nc:2: #8G: a hexadecimal number is required, as in #81H"),
        (
            "$A.MIN%\nCALL OO88 PH=1 PC=90\n",
            "part.nc:2: CALL OO88 requires PP, the number of a work coordinate system, as in PP=1",
        ),
        ("$A.MIN%\nG15\n", "part.nc:2: G15 and G16 require H, the work coordinate system 0 to"),
        ("$A.MIN%\nIF VC1 N10\n", "part.nc:2: VC1 N10: IF requires a condition in brackets and a line"),
        ("$A.MIN%\nG0 X=[VC1\n", "part.nc:2: expression without closing bracket"),
    ] {
        let error = steps(text, options()).expect_err(text).to_string();
        assert!(error.starts_with(expected), "{text:?}: {error}");
    }
}
