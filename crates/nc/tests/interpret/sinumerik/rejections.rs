//! Rejected blocks: the message names word and remedy.

use std::io::Cursor;

use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};

use super::options;
use crate::common::{error, steps};

#[test]
fn blocks_that_change_the_geometry_are_rejected_with_a_remedy() {
    let cases = [
        ("G1 X1", "feed missing"),
        (
            "POCKET4(50,0,1,-5,10)",
            "POCKET4 is not supported: the cycle of a circular pocket is not simulated: post its motions",
        ),
        ("G0 X1\nBSPLINE X2 Y3", "BSPLINE is not supported: post lines and arcs"),
        ("TRANSMIT", "TRANSMIT is not supported"),
        (
            "E_HEAD(0,0,1)",
            "E_HEAD is not supported: a program of steps of ShopMill or ShopTurn: convert it to G code",
        ),
        ("ORIVIRT1", "ORIVIRT1 is not supported: post the direction A3= B3= C3="),
        ("@100 K1350", "@100 K1350: commands @ of Sinumerik 810 to 880 are not supported: program IF, GOTOF"),
        ("R1=ISFILE(\"PART.SPF\")", "ISFILE: files of the control are not simulated: write TRUE or FALSE"),
        (
            "F100 G1 X1\nG1 X0\nGOTOS",
            "GOTOS has started the program again 1000 times, without an end: program M30",
        ),
        ("G143 X1", "G143 is not supported: the side of the approach"),
        ("G291", "G291 is not supported: the ISO mode is read with --dialect fanuc"),
        ("CHANGE_TOOL(1)", "CHANGE_TOOL is not supported: neither a word of the control nor a subprogram"),
        ("G0 X=NOTHING", "NOTHING has no value: add DEF REAL NOTHING"),
        ("G0 X=$AA_FOO[X]", "$AA_FOO is not supported"),
        ("GOTOF NOWHERE", "no label and no block number NOWHERE behind this block"),
        ("IF R1==1\nG0 X1", "ENDIF is missing for the structure that line 1 opens"),
        ("LOOP\nG0 X1", "ENDIF, ENDLOOP, ENDFOR, ENDWHILE or UNTIL is missing"),
        ("ENDFOR", "ENDFOR without the start of its structure"),
        ("WHILE TRUE\nENDIF\nENDWHILE", "ENDIF within a structure that ENDWHILE ends"),
        ("G0 X1 X2", "two words X in one block"),
        ("G0 G1 X1 F1", "G0 and G1 exclude each other in one block"),
        ("G2 X1 F100", "a circle requires its center I J, CR= or AR="),
        ("G2 X1 I1 CR=2 F100", "word CR excludes I, J and K"),
        ("G0 X=DC(5)", "word X: DC, ACP and ACN require a rotary axis"),
        ("G4", "G4 requires F, the dwell in s"),
        ("G4 S10", "G4 S requires a turning spindle"),
        ("CYCLE81(10,0,2)", "CYCLE81 requires DP or DPR"),
        ("CYCLE84(10,0,2,-5)", "CYCLE84 requires MPIT or PIT"),
        ("HOLES2(0,0,10,0,0,4)", "HOLES2 requires a modal cycle"),
        ("SCALE X0", "a frame with the scale 0"),
        ("DEF FOO A", "DEF FOO: not a type"),
        ("DEF REAL A[2]\nA[2]=1", "A[2]: the index must be between 0 and 1"),
        ("R1=\"text\"", "a number is required"),
        ("STEP_(1,2)\nM30\nPROC STEP_(REAL A_)\nRET", "the call has more values"),
        ("LOOP\nR1=R1+1\nENDLOOP", "endless loop"),
        ("G0 ä", "invalid character"),
        ("X1 Q5 G0", "Q is not supported: it has no effect in this block"),
        ("G331 Z-5 S100", "feed missing"),
    ];
    for (text, expected) in cases {
        let error = match steps(&format!("{text}\n"), options()) {
            Ok(steps) => panic!("{text}: {steps:?}"),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(expected), "{text}: {error}");
        assert!(error.starts_with("part.nc:") && !error.contains('\n'), "{error}");
    }
}

#[test]
fn native_programs_are_detected() {
    // Without the dialect, LinuxCNC rejects these blocks.
    for text in [
        "N10 MSG(\"A\")\nR1=5\nG0 X=R1\nMCALL\nCYCLE832()",
        "%_N_A_MPF\n;$PATH=/_N_MPF_DIR\nG0 X=AC(5)\nG0 SUPA Z0 D0",
    ] {
        assert!(steps(text, InterpreterOptions::default()).is_ok(), "{}", error(text));
    }
}

#[test]
fn all_words_are_reported_at_once() {
    let text = "N10 G0 X1\nN20 POCKET3(1,2,3)\nN30 BSPLINE\nN40 FFWON\nN50 G141 X5\nN60 POCKET3(4,5,6)\nN70 TOOL_HOME\nN80 G0 X=NOTHING\nN90 M30\n";
    let options = InterpreterOptions { reports_all_errors: true, ..options() };
    let mut steps = Interpreter::new(Cursor::new(text), "part.mpf", options);
    let found: Vec<_> = steps.by_ref().collect();
    assert!(found.iter().all(Result::is_ok), "{found:?}");
    let report = steps.report();
    let mut errors: Vec<_> =
        report.errors.iter().map(|(text, found)| (found.first_line, found.count, text.as_str())).collect();
    errors.sort_unstable();
    let starts = [
        "POCKET3 is not supported",
        "BSPLINE is not supported",
        "G141 is not supported",
        "TOOL_HOME is not supported",
        "NOTHING has no value",
    ];
    let places: Vec<_> = errors.iter().map(|(line, count, _)| (*line, *count)).collect();
    assert_eq!(places, [(2, 2), (3, 1), (5, 1), (7, 1), (8, 1)], "{errors:?}");
    assert!(errors.iter().zip(starts).all(|((_, _, text), start)| text.starts_with(start)), "{errors:?}");
    assert_eq!(report.without_effect.keys().map(String::as_str).collect::<Vec<_>>(), ["FFWON"]);
}

#[test]
fn a_rejection_has_no_errors_as_consequences() {
    for (text, expected) in [
        ("G0 X5 Y5 Z5\nG1 Z4 F100\nG33 Z-30 K1.5 SF=0\nG0 Z20\nM30\n", "G33 is not supported"),
        ("IF ISFILE(\"A.SPF\")\nG0 X5\nELSE\nG0 X6\nENDIF\nG0 X7\nM30\n", "ISFILE: files of the control"),
        ("IF ISFILE(\"A.SPF\") GOTOF A\nG0 X5\nA: G0 X7\nM30\n", "ISFILE: files of the control"),
    ] {
        let options = InterpreterOptions { reports_all_errors: true, ..options() };
        let mut steps = Interpreter::new(Cursor::new(text), "part.mpf", options);
        assert!(steps.by_ref().all(|step| step.is_ok()), "{text}");
        let errors: Vec<_> = steps.report().errors.keys().collect();
        assert!(matches!(&errors[..], [error] if error.starts_with(expected)), "{text}: {errors:?}");
    }
}

#[test]
fn errors_of_loops_and_files_end_a_report_of_all() {
    // Each of these would repeat its error without end.
    for text in [
        "LOOP\nPOCKET3\nENDLOOP\n",
        "IF R1==0\nG0 X1\n",
        "AGAIN\n%_N_AGAIN_SPF\nAGAIN\nRET\n",
        "STEP_(1)\nG0 X1\n%_N_STEP__SPF\nG0 X2\n",
    ] {
        let options = InterpreterOptions { reports_all_errors: true, repeated_lines: 1000, ..options() };
        let mut steps = Interpreter::new(Cursor::new(text), "part.mpf", options);
        let count = steps.by_ref().count();
        assert!(count < 2000 && !steps.report().errors.is_empty(), "{text}: {count}");
    }
}
