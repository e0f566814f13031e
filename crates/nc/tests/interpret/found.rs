//! Files as they are found: encodings, ends of lines, padding, text before the program, and formats of other controls.

use std::io::Cursor;

use virtual_axes_nc::interpret::{
    DetectedDialect, Dialect, Interpreter, InterpreterOptions, Tool, is_g_code,
};
use virtual_axes_nc::motion::ProgramStep;

use crate::common::{millimeters, report, steps};

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
    // Jumps and subprograms begin there too.
    let text = "PART 4711\n%\nO0100\nN5 M98 P7\nM30\nO7\nG0 X2. Y3.\nM99\n%\n";
    assert_eq!(last(text.as_bytes().to_vec()), ([2.0, 3.0, 0.0], 7));
    let options = InterpreterOptions {
        dialect: Some(Dialect::Sinumerik),
        reports_all_errors: true,
        ..InterpreterOptions::default()
    };
    let found = Interpreter::new(Cursor::new("9\n%N\nC\nC\n"), "part", options).take(100);
    assert!(found.count() < 10, "an end");
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
        (
            "%PM\n\nN9000 (PHILIPS SYSTEM 3000)\nN10 G54\n",
            "a program of Philips (Heidenhain) controls 532 and 3000",
        ),
        ("%PM\nN9001\nN1 G17 T1 M6\n", "a program of Philips (Heidenhain) controls 532 and 3000"),
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

#[test]
fn words_of_other_controls_are_named_in_one_error() {
    for (text, line, format) in [
        (
            "G21 G90\nG0 X0\nIF [#100 == 5] THEN\nG0 X5\nENDIF\n",
            3,
            "a program of EdingCNC with SUB, IF or WHILE",
        ),
        ("G21\nGOSUB POCKET\n", 2, "a program of EdingCNC with SUB, IF or WHILE"),
        ("G21\nG1 X{5+5} F100\n", 2, "a program of RepRapFirmware with expressions or conditions"),
        (
            "M106 S255\nwhile iterations < 3\n",
            2,
            "a program of RepRapFirmware with expressions or conditions",
        ),
        ("%L UP\nN10 $IF V.P.A == 1\nN20 $ENDIF\n", 2, "a program of ISG (TwinCAT CNC)"),
        ("N10 G0 X0\n#VAR\n", 2, "a program of ISG (TwinCAT CNC)"),
        ("(PGM, NAME=\"PART\")\nG0 X0\n", 1, "a program of Acramatic"),
        ("G90\nRAPID X0 Y0 Z1\n", 2, "a conversational program of Anilam"),
    ] {
        let options = InterpreterOptions { reports_all_errors: true, ..InterpreterOptions::default() };
        let error = steps(text, options).expect_err(text).to_string();
        let expected = format!("part.nc:{line}: {format} is not supported: post the program again as G code");
        assert!(error.starts_with(&expected), "{text:?}: {error}");
    }
    for text in [
        "G21\nN1 T{$TOOL1} M6\n",
        "G21\nG0 X{{x}} Y0\n",
        "G21\n{% for hole in holes %}\nG0 X1\n{% endfor %}\n",
    ] {
        let error = steps(text, InterpreterOptions::default()).expect_err(text).to_string();
        assert_eq!(error, "part.nc:2: a template with {…} is not supported: expand it first", "{text:?}");
    }
    // Words of supported controls.
    for (text, dialect) in [
        ("IF [#1 EQ #0] THEN #1=0\nG0 X1.\nM30\n", Dialect::Fanuc),
        ("G0 X1 (TEXT X{5})\nM2\n", Dialect::LinuxCnc),
        ("G0 R1=0\nWHILE R1<2\nR1=R1+1\nX=R1\nENDWHILE\nM30\n", Dialect::Sinumerik),
    ] {
        let options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        assert!(steps(text, options).is_ok(), "{text}");
    }
}

#[test]
fn cycles_of_sinumerik_are_named_in_other_dialects() {
    use Dialect::{Fanuc, Grbl, Haas, LinuxCnc, Mach3, Marlin};
    for dialect in [Fanuc, Grbl, Haas, LinuxCnc, Mach3, Marlin] {
        for (line, name) in [
            ("POCKET3(50,0,1,-10,40,20,5,0,0,0,3,0,0,200,100,0,21,4)", "POCKET3"),
            ("N20 CYCLE81(10,0,2,-8)", "CYCLE81"),
            ("MCALL CYCLE83 (10, 0, 2, -8)", "CYCLE83"),
            ("slot1(10,0,2,-8)", "SLOT1"),
            ("HOLES2(0,0,20,0,60,6)", "HOLES2"),
        ] {
            let errors = report(&format!("G21 G90 G0 X1.\n{line}\nM2\n"), dialect).errors;
            let expected = format!("{name} is a cycle of Sinumerik: --dialect sinumerik");
            let [(error, found)] = &errors.iter().collect::<Vec<_>>()[..] else {
                panic!("{line}: {errors:?}")
            };
            assert!(**error == expected && found.first_line == 2, "{dialect} {line}: {error}");
        }
    }
    // Labels and words that only begin alike.
    let errors = report("G21\nC1 P0CKET\nM2\n", Dialect::Haas).errors;
    assert!(errors.keys().all(|error| !error.contains("Sinumerik")), "{errors:?}");
}

/// A control that rejects the first line of a loop has no error in its last one.
#[test]
fn an_error_of_a_loop_has_no_consequences_at_its_end() {
    for (dialect, text, expected) in [
        (Dialect::Fanuc, "#1=0\nDO1 G0 X5.\n#1=#1+1\nEND1\nM30\n", "a line ends after DO1"),
        (Dialect::Haas, "#1=0\nWHILE [#1 LT] DO2\n#1=#1+1\nG0 X1.\nEND2\nM30\n", ""),
        (Dialect::LinuxCnc, "O1 while [#<a> LT 3]\nG0 X1\nO1 break\nO1 endwhile\nM2\n", "O1 while: #<a>"),
        (
            Dialect::LinuxCnc,
            "O1 if [#<a>]\nG0 X1\nO1 elseif [1]\nG0 X3\nO1 else\nG0 X2\nO1 endif\nM2\n",
            "O1 if: #<a>",
        ),
        (Dialect::LinuxCnc, "O1 repeat [#<a>]\nG0 X1\nO1 endrepeat\nM2\n", "O1 repeat: #<a>"),
        (Dialect::LinuxCnc, "O1 do\nG0 X1\nO1 while [#<a>]\nM2\n", "O1 while: #<a>"),
        (Dialect::LinuxCnc, "#1=0\nO1 while [1/#1 LT 3]\n#1=0\nO1 endwhile\nM2\n", "O1 while"),
        (Dialect::Sinumerik, "WHILE R1<NOTHING\nG0 X1\nENDWHILE\nM30\n", "NOTHING has no value"),
        (Dialect::Sinumerik, "FOR R1=1 TO NOTHING\nG0 X1\nENDFOR\nM30\n", "NOTHING has no value"),
        (Dialect::Sinumerik, "REPEAT\nG0 X1\nUNTIL R1<NOTHING\nM30\n", "NOTHING has no value"),
    ] {
        let errors = report(text, dialect).errors;
        let [(error, found)] = &errors.iter().collect::<Vec<_>>()[..] else { panic!("{text}: {errors:?}") };
        assert!(error.contains(expected) && found.count == 1, "{text}: {error} {found:?}");
    }
    // The same loop without an error has its end.
    let errors = report("END1\nDO1 X\nEND1\nM30\n", Dialect::Fanuc).errors;
    assert!(errors.contains_key("END1 without DO1") && errors.len() == 2, "{errors:?}");
}

#[test]
fn an_error_of_cutter_compensation_has_no_consequences() {
    let lead = "T2 M6 G43 H2\nG21 G90 G17 G94 F100\nG0 X0 Y-10\nG41 D2 G1 X0 Y0\n";
    // The tool of 2 mm does not fit into the groove of 1 mm, the arc of 1 mm.
    for (contour, expected) in [
        (
            "Y20\nX-1\nY19.5\nX-30\nG40 G0 Y60\nM30\n",
            "the tool radius of 2 mm does not fit into the corner between",
        ),
        (
            "Y20\nG3 X-2 Y20 I-1 J0\nG3 X-30 Y20 I-14 J0\nG1 Y0\nG40 G0 Y-60\nM30\n",
            "the tool radius of 2 mm does not fit into the arc",
        ),
        (
            "Y20\nG3 X-2 Y20 I-1 J0\nG1 Y0\nG40 G0 Y-60\nM30\n",
            "the tool radius of 2 mm does not fit into the arc",
        ),
    ] {
        for dialect in [Dialect::Fanuc, Dialect::LinuxCnc] {
            let mut options = InterpreterOptions {
                dialect: Some(dialect),
                reports_all_errors: true,
                ..InterpreterOptions::default()
            };
            options.tools.insert(2, Tool { radius: 0.002, ..Tool::default() });
            let mut interpreter =
                Interpreter::new(std::io::Cursor::new(format!("{lead}{contour}")), "part.nc", options);
            assert!(interpreter.by_ref().all(|step| step.is_ok()), "{contour}");
            let errors: Vec<_> = interpreter.report().errors.keys().collect();
            assert!(
                !errors.is_empty() && errors.iter().all(|error| error.starts_with(expected)),
                "{contour}: {errors:?}"
            );
        }
    }
}

#[test]
fn the_extension_of_linuxcnc_stands_against_comments() {
    let dialect = |name: &str, text: &str| {
        DetectedDialect::of(&mut std::io::Cursor::new(text.to_owned()), name).dialect
    };
    let text = "(CONVERTED FROM HAAS)\nG21 G90\nG4 P2\nM2\n";
    assert_eq!(dialect("part.ngc", text), Dialect::LinuxCnc);
    assert_eq!(dialect("PART.NGC", text), Dialect::LinuxCnc);
    assert_eq!(dialect("part.nc", text), Dialect::Haas);
    // Words count.
    assert_eq!(dialect("part.ngc", "(HAAS)\nO1000\nG187 P2\nG103 P1\nM97 P5\n"), Dialect::Haas);
}

#[test]
fn motions_after_a_missing_feed_start_at_its_end() {
    let text = "G21 G90 G17 G0 X0 Y0\nG1 X10\nG2 X20 Y10 R10\nG2 X30 Y0 I0 J-10\nM2\n";
    let errors = report(text, Dialect::LinuxCnc).errors;
    let [(error, found)] = &errors.iter().collect::<Vec<_>>()[..] else { panic!("{errors:?}") };
    assert!(error.starts_with("feed missing") && found.count == 3, "{errors:?}");
}

/// Lines that repeat a canned cycle whose own line has an error would have consequences of it.
#[test]
fn an_error_of_a_canned_cycle_has_no_consequences_in_its_next_lines() {
    for (dialect, cycle, expected) in [
        (Dialect::LinuxCnc, "G83 X1 Y1 Z-3 R1 Q1 F100 G187", "G187 is not supported"),
        (Dialect::LinuxCnc, "G83 X1 Y1 Z-3 R1 Q1", "feed missing"),
        (Dialect::LinuxCnc, "G81 X1 Z-3 R1 F100 V1", "word V"),
        (Dialect::Fanuc, "G83 X1. Y1. Z-3. R1. Q1. F100. G477", "G477 is not supported"),
    ] {
        let text = format!("G21 G90 G17 G0 Z5.\n{cycle}\nX5.\nX9. Y2.\nG80\nG0 Z9.\nM2\n");
        let errors = report(&text, dialect).errors;
        let [(error, found)] = &errors.iter().collect::<Vec<_>>()[..] else { panic!("{cycle}: {errors:?}") };
        assert!(error.contains(expected) && found.count == 1 && found.first_line == 2, "{cycle}: {errors:?}");
    }
    // Each later line with the code of a cycle is executed again.
    let text = "G21 G90 G17 G0 Z5\nG81 X1 Z-1 R1 F100 G187\nX3\nG81 X5 Z-1 R1 F100\nX6\nG80\nM2\n";
    let options = InterpreterOptions {
        dialect: Some(Dialect::LinuxCnc),
        reports_all_errors: true,
        ..InterpreterOptions::default()
    };
    let mut interpreter = Interpreter::new(std::io::Cursor::new(text), "part.nc", options);
    let lines: std::collections::BTreeSet<_> = interpreter
        .by_ref()
        .filter_map(|step| match step {
            Ok(ProgramStep::Motion(motion)) => Some(motion.line),
            _ => None,
        })
        .collect();
    assert_eq!(lines.into_iter().collect::<Vec<_>>(), [1, 4, 5]);
}
