//! Files as they are found: encodings, ends of lines, padding, text before the program, and formats of other controls.

use std::io::Cursor;

use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions, is_g_code};
use virtual_axes_nc::motion::ProgramStep;

use crate::common::{millimeters, steps};

/// Returns the end of the last motion of a file, mm, and the line of its motion.
fn last(file: Vec<u8>) -> ([f64; 3], usize) {
    let steps = Interpreter::new(Cursor::new(file), "part", InterpreterOptions::default());
    let steps: Vec<_> = steps.collect::<Result<_, _>>().unwrap_or_else(|error| panic!("{error}"));
    let motion = steps.iter().rev().find_map(|step| match step {
        ProgramStep::Motion(motion) => Some(motion),
        ProgramStep::Event { .. } => None,
    });
    motion.map(|motion| (millimeters(&motion.end), motion.line)).expect("a motion")
}

#[test]
fn a_program_is_the_same_in_each_encoding() {
    let text = "%\nO0100 (TEIL)\nN10 G21 G90 (weg)\n\nG1 X5. Y-2. F500.\nM30\n%\n";
    let expected = ([5.0, -2.0, 0.0], 5);
    let utf16 = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<_>>();
    let code_page: Vec<u8> = text.bytes().map(|byte| if byte == b'w' { 0xe4 } else { byte }).collect();
    for file in [
        text.as_bytes().to_vec(),
        format!("\u{feff}{text}").into_bytes(),
        text.replace('\n', "\r\n").into_bytes(),
        text.replace('\n', "\r").into_bytes(),
        utf16(u16::to_le_bytes),
        utf16(u16::to_be_bytes),
        [vec![0xff, 0xfe], utf16(u16::to_le_bytes)].concat(),
        [vec![0xfe, 0xff], utf16(u16::to_be_bytes)].concat(),
        code_page,
        [vec![0; 100], text.as_bytes().to_vec(), vec![0x1a; 3], vec![0; 50]].concat(),
        [vec![0x7f; 20], text.as_bytes().to_vec()].concat(),
    ] {
        assert_eq!(last(file.clone()), expected, "{:?}", String::from_utf8_lossy(&file));
        assert!(is_g_code(&file));
    }
}

#[test]
fn text_before_the_percent_sign_is_no_program() {
    let text = "\n  PART 4711, REV B\nPOSTED FOR MILL\n\n%\nO0100\nG21\nG0 X7. Y1.\nM30\n%\n";
    assert_eq!(last(text.as_bytes().to_vec()), ([7.0, 1.0, 0.0], 8));
    // Lines of a program before a percent sign are executed.
    assert_eq!(last(b"G21\nG0 X7. Y1.\n%\n".to_vec()), ([7.0, 1.0, 0.0], 2));
}

#[test]
fn remarks_and_forms_of_words_are_read_in_each_place() {
    for (dialect, text, expected) in [
        (Dialect::Fanuc, "N10 G0 X1 (x) Y2 (y)\nG54 ; work\n", [1.0, 2.0, 0.0]),
        (Dialect::Fanuc, "g 01 x 1 0 f 1 0 0\ny.5\nz-.5\n", [10.0, 0.5, -0.5]),
        (Dialect::Fanuc, "/1 G0 X4.\n/9G0Y+2.\nN7/G0 Z3.;\n", [4.0, 2.0, 3.0]),
        (Dialect::Haas, "G00 X+0001.500 Y-00.250\n", [1.5, -0.25, 0.0]),
        (Dialect::Mach3, "M6 T1 'change\nG0 X10. Y-.25\n", [10.0, -0.25, 0.0]),
        (Dialect::Grbl, "G21G90\nG0X1Y1\n\n;end\nG1X2F100 ; cut\n", [2.0, 1.0, 0.0]),
        (Dialect::LinuxCnc, "G91.1\nG0 X1\nG2 X3 I1 J0 F100\nG90.1\nG3 X1 I2 J0\n", [1.0, 0.0, 0.0]),
        (Dialect::Okuma, "/G0 X4\nN5 /2 G0 Y1 (A)\n", [4.0, 1.0, 0.0]),
    ] {
        let options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        let steps = steps(text, options).unwrap_or_else(|error| panic!("{dialect}: {error}"));
        let end = steps.iter().rev().find_map(|step| match step {
            ProgramStep::Motion(motion) => Some(millimeters(&motion.end)),
            ProgramStep::Event { .. } => None,
        });
        let end = end.expect("a motion");
        assert!(
            end.iter().zip(expected).all(|(end, expected)| (end - expected).abs() < 1e-9),
            "{text}: {end:?}"
        );
    }
}

#[test]
fn other_formats_are_named_in_one_error() {
    for (text, format) in [
        ("0 BEGIN PGM 100 MM\n1 L X+0 R0 FMAX\n", "a conversational program of Heidenhain (Klartext)"),
        ("BEGIN PGM PART MM\nTOOL CALL 5 Z S2000\n", "a conversational program of Heidenhain (Klartext)"),
        ("%4711 G71 *\nN10 G30 G17 X+0 Y+0 Z-40 *\n", "a program of Heidenhain in DIN/ISO"),
        ("$$ cls\nPARTNO/BRACKET\nGOTO/1,2,3\n", "a cutter location file (APT, CLS)"),
        ("TOOL PATH/PLANAR_MILL,TOOL,T10\nGOTO/1,2,3\n", "a cutter location file (APT, CLS)"),
    ] {
        let options = InterpreterOptions { reports_all_errors: true, ..InterpreterOptions::default() };
        let error = steps(text, options).expect_err(text).to_string();
        let expected = format!(
            "part.nc:1: {format} is not supported: post the program again as G code, in one of the dialects "
        );
        assert!(error.starts_with(&expected), "{text:?}: {error}");
        assert!(is_g_code(text.as_bytes()), "{text:?}");
    }
}
