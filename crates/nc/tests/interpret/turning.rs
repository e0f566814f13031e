//! Turning programs are rejected by one sentence, and programs for mills with some of their words are not.

use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions};

/// Returns the errors of a program, all at once.
fn errors(text: &str, dialect: Option<Dialect>) -> Vec<String> {
    let options = InterpreterOptions { dialect, reports_all_errors: true, ..InterpreterOptions::default() };
    let mut interpreter = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
    let mut errors: Vec<_> =
        interpreter.by_ref().filter_map(|step| step.err().map(|error| error.to_string())).collect();
    errors.extend(interpreter.report().errors.keys().cloned());
    errors
}

#[test]
fn turning_programs_are_rejected_by_one_sentence() {
    for (line, word, text) in [
        // Roughing and finishing of a contour.
        (
            7,
            "G71, G72 or G70 with a contour",
            "%\nO0001 (SHAFT)\nG18 G21 G40 G99\nG50 S3000\nT0101\nG96 S200 M3\nG71 P10 Q20 U0.4 W0.1 F0.25\n\
             N10 G0 X20.\nG1 Z-15.\nN20 X42.\nG70 P10 Q20\nM30\n%\n",
        ),
        // Facing by single lines.
        (
            3,
            "a tool with its offset",
            "O2\nG50 S2500\nT0303 M8\nG97 S800 M3\nG0 X50. Z2.\nG1 Z0 F0.2\nX-1.\nM30\n",
        ),
        (2, "the speed limit", "G21\nG92 S1500\nG96 S180 M3\nG0 X30 Z1\nG1 Z-20 F0.2\nM2\n"),
        // Thread.
        (3, "G76 with P and Q", "O3\nT0404\nG76 P010060 Q100 R50\nG76 X17.4 Z-20. P1300 Q400 F2.\nM30\n"),
        // Increments along a contour.
        (1, "a tool with its offset", "N1 T0202\nN2 G0 X40. Z2.\nN3 G1 Z-5. U-2. F0.1\nN4 W-10.\nN5 M30\n"),
        // LinuxCNC.
        (1, "G96", "G7 G18 G21 G96 S200 D2000\nM3\nG0 X20 Z1\nG95 G1 Z-10 F0.1\nM2\n"),
        // LinuxCNC, with X as radius and no surface speed.
        (1, "G7 or G8", "G8 G18 G21 G95\nM3 S800\nG0 X10 Z1\nG1 Z-10 F0.1\nM2\n"),
        (4, "G33", "G18 G21\nM3 S800\nG95 G0 X10 Z1\nG33 Z-10 K1\nG0 X12\nM2\n"),
        // LinuxCNC: contour cycles by the number of a subprogram, threading with a drive line.
        (
            2,
            "G71, G72 or G70 with a contour",
            "G21\nG71 Q100 X20 Z1 D0.5 I0.2\nO100 SUB\nG0 X5\nG1 Z-5\nO100 ENDSUB\nM2\n",
        ),
        (
            2,
            "G76, a threading cycle",
            "G20\nG76 P0.05 Z-1 I-.075 J.008 K.045 Q29.5 H3 R2 E.05 L2\nG0 Y1\nM2\n",
        ),
        // Inches, with dots in all words.
        (4, "G71, G72", "O5\nG20\nT0101\nG71P100Q200U.02W.005F.012\nN100G0X1.\nN200Z-1.\nM30\n"),
    ] {
        let found = errors(text, None);
        let [error] = &found[..] else { panic!("{text}: {found:?}") };
        assert!(
            error.starts_with(&format!("part.nc:{line}: a turning program, by {word}"))
                && error.ends_with("only programs for milling are supported"),
            "{text}: {error}"
        );
    }
    // Of Okuma, by its extension.
    let text = "N1 G140\nN2 G0 X400 Z300\nN3 G50 S2000\nN4 T010101\nN5 G96 S180 M3\nN6 SB=1500 M13\nN7 G1 X50 Z-0.2\nM2\n";
    let mut interpreter =
        Interpreter::new(std::io::Cursor::new(text), "SHAFT.MIN", InterpreterOptions::default());
    let error = interpreter.next().expect("a step").expect_err("a turning program").to_string();
    assert!(error.starts_with("SHAFT.MIN:3: a turning program, by the speed limit G50 S"), "{error}");
    // A is the angle of a line.
    let text = "FLAN=318\nG50 S800 M90\nG96 G0 X=FLAN+5 Z10 S300 M3\nG1 X300 F0.2\nX=FLAN A-150\nM2\n";
    let [error] = &errors(text, Some(Dialect::Okuma))[..] else { panic!("{text}") };
    assert!(error.starts_with("part.nc:2: a turning program, by the speed limit G50 S"), "{error}");
    for (line, word, text) in [
        // Thread and facing without a cycle.
        (2, "G96", "G18 G90 G95\nG96 S200 M4\nG0 X54 Z2\nG1 Z-40 F0.25\nG33 Z-50 K1.5 SF=0\nM30\n"),
        (3, "CYCLE95", "G18 G90 DIAMON\nT1 D1\nCYCLE95(\"KONTUR\",2,0.1,0.2,,0.3,0.2,0.15,9)\nM30\n"),
        (2, "the speed limit", "G18 G90 G95\nLIMS=3000\nG96 S200 M3\nG0 X40 Z2\nM30\n"),
    ] {
        let found = errors(text, Some(Dialect::Sinumerik));
        let [error] = &found[..] else { panic!("{text}: {found:?}") };
        // The first word of the kind decides.
        let line = if text.contains("DIAMON") { 1 } else { line };
        let word = if text.contains("DIAMON") { "DIAMON" } else { word };
        assert!(error.starts_with(&format!("part.nc:{line}: a turning program, by {word}")), "{error}");
    }
}

#[test]
fn mills_with_words_of_turning_are_no_turning_programs() {
    for (dialect, text) in [
        (Dialect::Sinumerik, "G18 G90 G95 S500 M3\nG0 X10 Y5 Z20\nG2 X0 Z10 CR=10 F0.1\nG17\nM30\n"),
        (Dialect::Sinumerik, "G17 G90\nS500 M3\nG96 S200\nG0 Z=20\nG0 X10 Y=R1\nM30\n"),
        // Facing at constant surface speed.
        (Dialect::Sinumerik, "G17 G90\nLIMS=3000\nG96 S200 M3\nG0 X10 Y5 Z20\nG97 S800\nM30\n"),
        // Surface speed of a boring head, tools of four digits, speed limit.
        (
            Dialect::Fanuc,
            "O1\nG21 G90\nG92 S3000\nG96 S150 M3\nT1212 M6\nG0 X10. Y5.\nG97 S800\nG0 Z-5.\nM30\n",
        ),
        // Arc of the plane ZX.
        (Dialect::LinuxCnc, "G18 G21\nG0 X10 Z0\nG3 X0 Z10 I-10 K0 F100\nM2\n"),
        // Holes with the retraction to R.
        (Dialect::Fanuc, "O2\nG21 G90 G0 X5. Z10.\nG99 G81 Z-3. R1. F100.\nX10.\nG80\nM30\n"),
        // Holes on a circle, in a row.
        (
            Dialect::Haas,
            "G21 G90 G0 Z10.\nG98 G81 Z-3. R1. F100. L0\nG70 I20. J0. L4\nG72 I5. J0. L3\nG80\nM30\n",
        ),
        (Dialect::Fanuc, "O3\nG21 G90 G0 X0 Y0 Z9.\nG73 Z-8. R1. Q2. P100 F80.\nG80\nM30\n"),
        (Dialect::Fanuc, "O4\nG21 G90 G0 X0 Y0 Z9.\nG76 Z-8. R1. Q0.2 P100 F80.\nG80\nM30\n"),
        // Scaling off, speed in the next line.
        (Dialect::Mach3, "G21 G50\nS500 M3\nG0 X1 Z1\nM30\n"),
        (Dialect::Mach3, "N10G00G21G17G90G40G49G80\nN20G71G91.1\nN30T0101M06\nN40G1X1Z1F60\nM30\n"),
        (Dialect::Haas, "O5\nG21 T0101 M06\nG0 X1. Z5.\nG28 G91 Z0\nM30\n"),
    ] {
        let found = errors(text, Some(dialect));
        assert!(found.is_empty(), "{text}: {found:?}");
    }
}
