//! Invalid programs: one line with file, line, word and what is allowed.

use std::io::Cursor;

use virtual_axes_nc::interpret::{Dialect, IgnoredCodes, Interpreter, InterpreterOptions};

use crate::common::{error, events, motions, steps};

#[test]
fn invalid_words_are_rejected_with_their_line() {
    for (program, expected) in [
        (
            "G0 X1\nG34 Z1",
            "part.nc:2: G34 is not supported in the dialect linuxcnc: skip it with --ignore G34",
        ),
        (
            "G16",
            "part.nc:1: G16 is not supported in the dialect linuxcnc: known in --dialect fanuc or haas or mach3",
        ),
        // The manual of LinuxCNC calls the behavior of these cycles undefined.
        (
            "G87 X1 Y1 Z-1 R1",
            "part.nc:1: G87 is not supported in the dialect linuxcnc: LinuxCNC leaves the motion of G87",
        ),
        (
            "G88 X1 Y1 Z-1 R1",
            "part.nc:1: G88 is not supported in the dialect linuxcnc: LinuxCNC leaves the motion of G88",
        ),
        ("G51 X2", "part.nc:1: G51 is not supported in the dialect linuxcnc: known in --dialect fanuc"),
        (
            "F#<_hal[plasmac.cut-feed-rate]>",
            "part.nc:1: word F: #<_hal[plasmac.cut-feed-rate]> is a value of the running control, which a simulation lacks",
        ),
        (
            "G0 X#<_ini[axis_x]max_limit>",
            "part.nc:1: word X: #<_ini[axis_x]max_limit> is a value of the running control",
        ),
        ("G0 X#<_depth>", "part.nc:1: word X: #<_depth> has no value: set it before it is used"),
        ("M200", "part.nc:1: M200 is not supported in the dialect linuxcnc: skip it with --ignore M200"),
        ("M97", "part.nc:1: M97 is not supported in the dialect linuxcnc: known in --dialect haas"),
        ("G33 Z1", "part.nc:1: G33 and G33.1 require K above 0, the pitch per revolution"),
        ("G33 Z1 K1", "part.nc:1: G33 and G33.1 require a turning spindle"),
        ("G41.1 X1", "part.nc:1: G41.1 and G42.1 require D, the diameter of the tool"),
        ("M61", "part.nc:1: M61 requires Q, the tool in the spindle"),
        ("G1.05 X1", "part.nc:1: G1.05 is not a G code"),
        ("M-1", "part.nc:1: M-1 is not an M code"),
        ("X1", "part.nc:1: X1: axis word without G0, G1, G2 or G3"),
        ("G0 X1 X2", "part.nc:1: two words X in one line"),
        ("G0 G1 X1", "part.nc:1: G0 and G1 exclude each other in one line"),
        ("M3 M4", "part.nc:1: M3 and M4 exclude each other in one line"),
        ("G0 X1 P5", "part.nc:1: word P has no effect in this line with G0: remove it, or program the code"),
        (
            "N2 L100\nX1\nM17",
            "part.nc:1: word L has no effect in this line without a code: remove it, or program the code that it \
             belongs to; the subprograms of Fadal format 1 are not supported",
        ),
        (
            "F1 G1 X1 R2",
            "part.nc:1: word R has no effect in this line with G1: remove it, or program the code that it belongs to; \
             a rounded corner is ,R",
        ),
        ("H5", "part.nc:1: word H has no effect in this line without a code"),
        ("G0 X1E5", "part.nc:1: word E: the letter E is not supported, the extruder of a printer or"),
        ("G0 X1 N5", "part.nc:1: word N: the line number stands at the start of the line"),
        ("N", "part.nc:1: word N: a line number of digits is required"),
        ("G0 X1 O5", "part.nc:1: O5: an O-word stands at the start of the line"),
        ("G0 X", "part.nc:1: word X: end of the line: a number, parameter or expression is required"),
        ("G0 X1.2.3", "part.nc:1: .3: a word is required, a letter with a value"),
        ("G0 X.", "part.nc:1: word X: .: not a number"),
        ("G0 Xµ", "part.nc:1: invalid character 'µ' outside of a comment"),
        ("G0 (a (b) X1", "part.nc:1: comment within a comment: remove the inner parenthesis"),
        ("G0 (a", "part.nc:1: comment without closing parenthesis"),
        ("G1 X1", "part.nc:1: feed missing: program F above 0, also after a change between G93, G94 and G95"),
        ("F0 G1 X1", "part.nc:1: feed missing: program F above 0"),
        ("G93 F1 G1 X1\nX2", "part.nc:2: feed missing: G93 requires F in each line with G1, G2 or G3"),
        (
            "G95 F1 G1 X1",
            "part.nc:1: G95 (feed per revolution) requires a turning spindle: program S with M3 or M4",
        ),
        ("F-5", "part.nc:1: word F: -5 is invalid, must be between 0 and 1e9"),
        ("T1.5", "part.nc:1: word T: 1.5 is a tool with an offset, as Fagor and Mazak have it: program T1"),
        ("G4", "part.nc:1: G4 requires P, the dwell in s"),
        ("G91 G53 G0 X1", "part.nc:1: G53 requires G90 with G0 or G1"),
        ("G92", "part.nc:1: G92 requires at least one axis word"),
        ("G0 G92 X1", "part.nc:1: G92 and G0 both use the axis words: program them in two lines"),
        ("G10 L2 P12 X1", "part.nc:1: G10 requires P, the coordinate system 1 to 9, or 0 for the active one"),
        ("G10 P1", "part.nc:1: G10 requires L2 or L20, or L1 or L10 to L13 for tools"),
        ("G10 L1 Z1", "part.nc:1: G10 of a tool requires P, its number"),
        ("G10 L99 P1 X1", "part.nc:1: G10 requires L2 or L20"),
        ("G10 L20 P1", "part.nc:1: G10 L20 requires at least one axis word"),
        ("O1 if [0]\nO1 elseif [1] X5\nO1 endif", "part.nc:2: O1 elseif: X5: an expression in brackets"),
        ("O1 if [0]\nO1 else X5\nO1 endif", "part.nc:2: O1 else: X5: an expression in brackets"),
        ("G43.4 H1", "part.nc:1: G43.4 requires a machine with kinematics; program G43"),
        ("G43.1 X1", "part.nc:1: G43.1: only Z is supported"),
        ("G5.3", "part.nc:1: G5.3 without G5.2"),
        ("G0 X99999999999", "part.nc:1: word X: more than 10000 m from the machine zero"),
    ] {
        let message = error(program);
        assert!(message.starts_with(expected), "{program:?}: {message}");
        assert!(!message.contains('\n'), "{message:?}");
    }
}

#[test]
fn invalid_arcs_and_splines_are_rejected() {
    for (line, expected) in [
        ("G2 X10", "an arc requires R, or its center I or J"),
        ("G90.1 G2 X10 I5", "an arc requires R, or its center I and J"),
        ("G2 X5 I2.5 K1", "word K is not in the plane of the arc, which has I and J"),
        ("G18 G2 X5 I2.5 J1", "word J is not in the plane of the arc, which has K and I"),
        ("G2 X10 R5 I5", "word R excludes I, J and K"),
        ("G2 Z1 R5", "an arc with R requires an end point in its plane"),
        ("G2 X0 R5", "an arc with R requires an end point that differs from its start; use I, J, K"),
        ("G2 X10 R4.99", "word R: radius 4.99 mm does not reach the end point, at least 5 mm are required"),
        (
            "G2 X10.1 I5",
            "arc with radius 5 mm at its start and 5.1 mm at its end, at most 0.0051 mm difference",
        ),
        (
            "G2 X1010 I500",
            "arc with radius 500 mm at its start and 510 mm at its end, at most 0.5 mm difference",
        ),
        ("G2 X1 I0", "arc of radius 0: check the center"),
        ("G2 X1 I33333333333333", "arc of radius 3.33333e13 mm: at most 10000000 mm; check the center"),
        ("G2 X10 I5 P1.5", "word P: 1.5 turns, an integer from 1 to 10000 is required"),
        ("G18 G5.2 L3", "splines require the plane XY (G17)"),
        ("G5 X1 Y1 I1 J1", "a spline requires P and Q"),
        ("G5.2 X1 Y1", "a control point requires P, its weight"),
        ("G5.2 P-1", "word P: weight -1, must be above 0"),
        ("G5.2 L99", "word L: order 99, must be between 2 and 16"),
        ("G91 G5.2 L3", "G5.2 requires G90"),
    ] {
        let message = error(&format!("F100\n{line}"));
        assert!(message.starts_with(&format!("part.nc:2: {expected}")), "{line}: {message}");
    }
    for (lines, expected) in [
        ("G5.2 L3\nG5.3", "part.nc:2: a NURBS of order 3 requires 3 control points, found 1"),
        ("G5.2 L3\nX1 Y1 P1\nZ1 P1", "part.nc:3: a control point has X and Y only"),
        ("G5.2 L3\nM3", "part.nc:2: M codes are not allowed between G5.2 and G5.3"),
        ("G5.2 L3\nG0 X1", "part.nc:2: only X, Y and P are allowed between G5.2 and G5.3"),
        ("G5.2 L3\nX1 Y1 P1", "part.nc:2: G5.2 without G5.3"),
    ] {
        assert_eq!(error(lines), expected);
    }
}

#[test]
fn invalid_canned_cycles_are_rejected() {
    for (line, expected) in [
        ("G81 X1 Z-1", "G81 requires R, the plane of retraction"),
        ("G81 X1 R1", "G81 requires Z, the depth"),
        ("G81 X1 Z3 R2", "G81: the plane R is below the depth Z"),
        ("G82 X1 Z-1 R1", "G82 requires P, the dwell in s"),
        ("G83 X1 Z-1 R1", "G83 requires Q above 0, the depth of a peck"),
        ("G83 X1 Z-1 R1 Q0.0001", "G83: 20000 pecks in one line; at most 10000 are allowed"),
        ("G81 X1 Z-1 R1 L0", "G81: word L: 0 repetitions, must be 1 or more"),
        ("G81 X1 Z-1 R1 L10001", "G81: 10001 repetitions in one line; at most 10000 are allowed"),
        ("G81 X1 Z-1 R1 A5", "word A: G81 moves X, Y and Z only"),
        ("G93 F1 G81 X1 Z-1 R1", "G81 requires G94 or G95"),
        ("G81 X1 Z-1 R1\nG82 X2 P1", "G82 requires R, the plane of retraction"),
        ("G76 X1 Z-1 R1", "G76 is not supported in the dialect linuxcnc: threading"),
    ] {
        let message = error(&format!("F100 G0 Z5\n{line}"));
        assert!(message.contains(&format!(": {expected}")), "{line}: {message}");
    }
}

#[test]
fn invalid_expressions_are_rejected() {
    for (word, expected) in [
        ("X[1/0]", "word X: division by zero"),
        ("X[5 MOD 0]", "word X: division by zero"),
        ("X[-8**[1/3]]", "word X: power of a negative value with a fractional exponent"),
        ("X[10**999]", "word X: **: result is not finite"),
        ("X[SQRT[-1]]", "word X: SQRT[-1]: must be 0 or positive"),
        ("X[ACOS[2]]", "word X: ACOS[2]: must be between -1 and 1"),
        ("X[LN[0]]", "word X: LN[0]: must be positive"),
        ("X EXP[1000]", "word X: expression without finite value: check divisors and powers"),
        ("X[1[1]]", "word X: [1]]: an operator or closing bracket is required"),
        ("X[1+]", "word X: ]: a number, parameter or expression is required"),
        ("X[1", "word X: expression without closing bracket"),
        ("GO1 X1", "word G: O1X1: not a number; is the letter O meant as zero?"),
        ("THIS IS TEXT", "word T: HISISTEXT: not a number"),
        ("X FOO[1]", "word X: FOO[1]: not a function; supported: ATAN EXISTS ABS ACOS"),
        ("X ATAN[1]", "word X: ATAN: a second value is required, ATAN[y]/[x]"),
        ("X EXISTS[1]", "word X: EXISTS: a named parameter in brackets is required"),
        ("X#0", "word X: #0: the number of a parameter is 1 to 5602"),
        ("X#5.5", "word X: #5.5: the number of a parameter is 1 to 5602"),
        ("X#5602", "word X: #5602 is not supported; supported: #1 to #5600"),
        ("X#<depth>", "word X: #<depth> has no value: set it before it is used"),
        ("X#<", "word X: <: a name in angle brackets is required"),
        ("#5420=1", "#5420: read only; program G92, G54 or a tool change"),
        ("#<_x>=1", "#<_x>: a value of the control, which cannot be set"),
        ("#1", "end of the line: a parameter setting requires ="),
    ] {
        let message = error(&format!("G0\n{word}"));
        assert!(message.starts_with(&format!("part.nc:2: {expected}")), "{word}: {message}");
    }
}

#[test]
fn invalid_flow_is_rejected() {
    for (program, expected) in [
        ("o1 if [1]\nG0 X1", "part.nc:2: O1: loop or condition without end"),
        ("o1 if [0]\nG0 X1", "part.nc:1: O1 if without elseif or else or endif"),
        ("o1 while [0]\no1 endif", "part.nc:1: O1 while without endwhile"),
        ("o1 endwhile", "part.nc:1: O1 endwhile without beginning"),
        ("o1 if [1]\no2 while [1]\no1 endif", "part.nc:3: O1 endif within O2, which has to end first"),
        ("o1 break", "part.nc:1: O1 break outside of this loop"),
        ("o1 if [1]\no1 continue\no1 endif", "part.nc:2: O1 continue: not a loop"),
        ("o1 call", "part.nc:1: O1: no such subprogram in this file"),
        ("o1 endsub", "part.nc:1: O1 endsub outside of a subprogram"),
        ("o1 sub\no2 sub\no1 endsub", "part.nc:1: O1 sub without endsub"),
        ("o1 call\nM2\no1 sub\nG0 X1", "part.nc:4: subprogram O1 without endsub"),
        ("o1 foo", "part.nc:1: O1 FOO: not a keyword; supported: endsub sub return call"),
        ("o1 while", "part.nc:1: O1 while: 0 expressions in brackets, expected 1"),
        ("o1 do [1]", "part.nc:1: O1 do: 1 expressions in brackets, expected 0"),
        ("o99999999999 call", "part.nc:1: O999999999…: the label is too large"),
        ("M98 P7", "part.nc:1: O7: no such subprogram in this file, and no file with its name beside it"),
        ("M98", "part.nc:1: M98 requires P, the number of the subprogram"),
        ("o1 call\nM2\no1 sub\nM99\no1 endsub", "part.nc:4: M99 within a subprogram of an O-word call"),
        ("M98 P7\nM2\nO7\nG0 X1", "part.nc:4: subprogram O7 without M99"),
    ] {
        let message = error(program);
        assert!(message.starts_with(expected), "{program:?}: {message}");
    }
}

#[test]
fn endless_and_huge_programs_are_rejected() {
    let nested = format!("G0 X{}1{}", "[".repeat(40), "]".repeat(40));
    assert_eq!(error(&nested), "part.nc:1: word X: expression nested more than 32 levels deep");
    assert_eq!(error(&format!("({})", "a".repeat(5000))), "part.nc:1: the line is longer than 4096 bytes");
    let name = error(&format!("#<{}>=1", "n".repeat(200)));
    assert_eq!(name, format!("part.nc:1: <{}…>: a name has at most 100 characters", "n".repeat(100)));
    let recursion = "o1 sub\no1 call\no1 endsub\no1 call";
    assert_eq!(error(recursion), "part.nc:2: O1: subprograms call each other more than 50 levels deep");
    let loops: String = (0..60).map(|label| format!("o{label} while [1]\n")).collect();
    assert_eq!(error(&loops), "part.nc:51: O50: loops and conditions nested more than 50 levels deep");
    assert_eq!(error(&"G0".repeat(40)), "part.nc:1: more than 32 G codes in one line");
    let names: String = (0..10_001).map(|name| format!("#<n{name}>=1\n")).collect();
    assert_eq!(error(&names), "part.nc:10001: #<n10000>: the program has more than 10000 named parameters");

    let options = InterpreterOptions { repeated_lines: 1000, ..InterpreterOptions::default() };
    for endless in
        ["o1 while [1]\no1 endwhile", "o1 do\nG0 X1\no1 while [1]", "M98 P1 L4000000000\nM2\nO1\nM99"]
    {
        let error = steps(endless, options.clone()).expect_err("no end").to_string();
        assert!(error.ends_with(": endless loop: the loops of the program repeat more than 1000 lines"));
    }
    let idle = "G0 X1\no1 while [1]\n#1=[#1+1]\no1 endwhile";
    let expected = ": endless loop: 2000000 repeated lines without motion or event";
    let found = steps(idle, InterpreterOptions::default()).expect_err("no end").to_string();
    assert!(found.ends_with(expected), "{found}");
    let repeated = "o1 repeat [400]\nG91 G0 X1\no1 endrepeat";
    assert_eq!(motions(repeated, options).len(), 400, "800 lines are repeated");
}

#[test]
fn a_long_line_that_is_skipped_has_its_own_number() {
    let long = format!("({})", "x".repeat(5000));
    let expected = "the line is longer than 4096 bytes";
    assert_eq!(error(&format!("G21\nO1 if [0]\nG1 X1\n{long}")), format!("part.nc:4: {expected}"));
    assert_eq!(error(&format!("G21\nM98 P5\nM2\n{long}\nO5\nM99")), format!("part.nc:4: {expected}"));
}

#[test]
fn ignored_codes_have_no_effect() {
    let patterns = ["M100", "6", "G77-G79"].map(|pattern| pattern.parse().expect("a pattern"));
    let options =
        InterpreterOptions { ignored: IgnoredCodes::new(patterns.into()), ..InterpreterOptions::default() };
    assert_eq!(motions("G0 X1 M100\nM100 P5 Q2\nG0 X2", options.clone()).len(), 2);
    assert_eq!(motions("G0 X1\nM100 P7\nM100 P1 G0 X2", options.clone()).len(), 2, "words of the code");
    assert_eq!(
        motions("G0 X1\nX7 M100 P1\nG0 X2", options.clone()).len(),
        3,
        "words of the motion in effect"
    );
    assert_eq!(motions("G0 X1\nG78 X7 P2\nG0 X2", options.clone()).len(), 2, "words of a G code");
    assert_eq!(events("T1 M6", options.clone()).len(), 2, "selection and end, no change");
    let program = "G0 X1\nM6\nO1 repeat [3]\nM100 P5 M6\nO1 endrepeat\n";
    let mut interpreter = Interpreter::new(Cursor::new(program), "part.nc", options);
    assert!(interpreter.by_ref().all(|step| step.is_ok()));
    let codes = &interpreter.report().without_effect;
    let codes: Vec<_> = codes.iter().map(|(m, code)| (m.as_str(), code.count, code.first_line)).collect();
    assert_eq!(codes, [("M100", 3, 4), ("M6", 4, 2)]);
}

#[test]
fn axes_that_the_machine_lacks_are_rejected_unless_they_stay_at_0() {
    for dialect in [Dialect::LinuxCnc, Dialect::Fanuc, Dialect::Sinumerik] {
        let mut options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        options.axes[4] = false;
        let error = steps("G0 B1", options.clone()).expect_err("no axis B").to_string();
        assert_eq!(error, "part.nc:1: word B: the machine has no axis B; axes: X Y Z A C U V W");
        let found = steps("G0 X1 B0.", options).map(|_| ()).map_err(|error| error.to_string());
        assert!(
            found == Ok(()) || (dialect == Dialect::LinuxCnc && found == Err(error)),
            "{dialect}: {found:?}"
        );
    }
}
