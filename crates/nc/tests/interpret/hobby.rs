//! Programs in the manner of grbl and Mach3, comments and other texts of each control, and their detection.

use virtual_axes_nc::interpret::{Dialect, Interpreter, InterpreterOptions};
use virtual_axes_nc::motion::{Feed, MotionKind, ProgramEvent, ProgramStep};

use crate::common::{events, millimeters, motions, report};

/// Returns the detected dialect, and the ends of the motions, mm.
fn detected(text: &str) -> (Dialect, Vec<[f64; 3]>) {
    let interpreter =
        Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", InterpreterOptions::default());
    let dialect = interpreter.dialect().dialect;
    let ends = motions(text, InterpreterOptions::default());
    (dialect, ends.iter().map(|motion| millimeters(&motion.end)).collect())
}

#[test]
fn programs_run_in_their_detected_dialects() {
    use Dialect::{Fanuc, Grbl, Haas, LinuxCnc, Mach3, Marlin};
    for (dialect, text, last) in [
        // Laser of a hobby machine.
        (
            Grbl,
            "; grbl laser\n$H\nG21 G90\nM4 S0\nG0 X10 Y5\nS800 G1 X20 F1200\nM5 S0\nG0 X0 Y0\nM2\n",
            [0.0, 0.0, 0.0],
        ),
        (
            Grbl,
            "(post: grbl)\nG17 G21 G90 G94 G54\nT1\nM3 S12000\nG0 Z5\nG1 Z-1 F200\nG2 X4 Y0 I2 J0 F600\nM30\n",
            [4.0, 0.0, -1.0],
        ),
        (
            Marlin,
            ";FLAVOR:Marlin\nG21\nG90\nG28\nG29\nM106 S255\nG0 X5 F3000\nM3 P100\nG1 X7 Y1 F600\nM107\nM84\n",
            [7.0, 1.0, 0.0],
        ),
        (
            Mach3,
            "(Mach3 router post)\nG20 G90 G40 G49 G80\nG70\nM6 T1 ' quarter inch\nG0 X1. Y0\nG12 I0.5 F30\nM5 M30\n",
            [25.4, 0.0, 0.0],
        ),
        // Units and arc centers as a post of Vectric writes them, without the name of the control.
        (
            Mach3,
            "( Profile )\nN10G00G20G17G90G40G49G80\nN20G70G91.1\nN30T1M06\nN40X1.0000Y2.0000F60.0\nN50M30\n%\n",
            [25.4, 50.8, 0.0],
        ),
        (
            Mach3,
            "N10G00G21G17G90G40G49G80\nN20G71G91.1\nN30G1X1F60\nN40G3X3Y0I1J0\nN50M30\n",
            [3.0, 0.0, 0.0],
        ),
        (
            Mach3,
            "; Mach3\nG21\nG68 A0 B0 R90\nG0 X10 Y0\nG69\nG51 X2 Y3\nG0 X1 Y1\nG50\nM30\n",
            [2.0, 3.0, 0.0],
        ),
        // Start of a printer's file before the words of a mill.
        (Marlin, "M104 S210\nG28\nG90 E0\nG21\nG0 Z2\nG1 X3 F600\nG0 Z0\n", [3.0, 0.0, 0.0]),
        (LinuxCnc, "G21 G90 G64 P0.01\nM7\nM8\nG0 X1\nG1 X2 F100\nM9\nM2\n", [2.0, 0.0, 0.0]),
        (LinuxCnc, "#<r>=3\nG0 X#<r>\nM2\n", [3.0, 0.0, 0.0]),
        (
            Fanuc,
            "%\nO1234(NESTED (COMMENT) HERE)\nN10 G21\nN20 G0 X1. (OPEN\nN30 G90 G0 Y2.;\nM30\n%\n",
            [1.0, 2.0, 0.0],
        ),
        (Fanuc, "%PM\n:0097\nG0 X3. Y1.\n/2 G0 X9. Y9.\nN5 /3 G0 X4. Y1.\nM30\n%\n", [4.0, 1.0, 0.0]),
        (Fanuc, "<PART>\nO5 G21 G90\nG0 X3. M8 M3 S500\nG90 G91 X2. T5 D3\nM99\n", [5.0, 0.0, 0.0]),
        (
            Haas,
            "%\nO00042 (VF2)\nG00 G17 G20 G40 G49 G80 G90 G54\nT1 M06\nG103 P1\nG00 X1. Y0.\nM97 P5\nM30\nN5 X2.\nM99\n%\n",
            [50.8, 0.0, 0.0],
        ),
    ] {
        let (found, ends) = detected(text);
        assert_eq!(found, dialect, "{text}");
        let end = ends.last().expect("a motion");
        assert!(end.iter().zip(last).all(|(found, last)| (found - last).abs() < 1e-9), "{text}: {end:?}");
    }
}

#[test]
fn lines_of_firmware_are_texts_and_commands() {
    let text = "% post\nG21 G90\nM84 S0\n% vfd enable\nG0 X1\n%( start )\nM117 2D Pocket, X5\nM0 Put tool 1\nG0 X2\nM400\n?\nG28 Z\n\
                G0 X3 Y1\n%\nG0 X99\n";
    let (found, ends) = detected(text);
    assert_eq!(found, Dialect::Marlin);
    assert_eq!(ends.iter().map(|end| end[0]).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
    let texts = events(text, InterpreterOptions::default());
    let texts: Vec<_> = texts
        .iter()
        .filter_map(|(line, event)| match event {
            ProgramEvent::Message(text) => Some((*line, text.as_str())),
            _ => None,
        })
        .collect();
    assert_eq!(texts, [(7, "2D Pocket, X5"), (8, "Put tool 1")]);
    let stops = events(text, InterpreterOptions::default());
    assert_eq!(stops.iter().filter(|(_, event)| *event == ProgramEvent::Stop).count(), 1);
}

#[test]
fn all_errors_of_a_program_are_reported_once_with_count_and_line() {
    let text = "G21 G90 G17\nG15\nG187 P1\nG0 X1\nG15 G187\nM450\nG1 X10 F500\nG12 I5\nG1 X20 Q7\nM2\n";
    let errors = report(text, Dialect::LinuxCnc).errors;
    let mut found: Vec<_> =
        errors.iter().map(|(text, found)| (found.first_line, found.count, text.as_str())).collect();
    found.sort_unstable();
    let expected = [
        (
            2,
            2,
            "G15 is not supported in the dialect linuxcnc: known in --dialect fanuc or haas or mach3 or okuma; or skip it with --ignore G15",
        ),
        (
            3,
            2,
            "G187 is not supported in the dialect linuxcnc: known in --dialect haas; or skip it with --ignore G187",
        ),
        (6, 1, "M450 is not supported in the dialect linuxcnc: skip it with --ignore M450"),
        (
            8,
            1,
            "G12 is not supported in the dialect linuxcnc: known in --dialect haas or mach3; or skip it with --ignore G12",
        ),
        (
            9,
            1,
            "word Q has no effect in this line with G1: remove it, or program the code that it belongs to",
        ),
    ];
    assert_eq!(found, expected);
}

/// Posts write all three words of an arc center: a quarter circle of 10 mm from (10, 0) to (0, 10).
#[test]
fn the_center_word_across_the_plane_is_unused() {
    let arc = "G21 G90 G17\nG0 X10 Y0\nG3 X0 Y10 I-10 J0 K0.000 F100\nM30\n";
    let run = |text: &str, dialect: Dialect| {
        let options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        let steps = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
        steps.collect::<Result<Vec<_>, _>>().map_err(|error| error.to_string())
    };
    for dialect in [Dialect::Grbl, Dialect::Mach3, Dialect::Fanuc, Dialect::Haas] {
        let steps = run(arc, dialect).expect("an arc");
        let arcs = steps.iter().filter_map(|step| match step {
            ProgramStep::Motion(motion) => match &motion.kind {
                MotionKind::Arc(arc) => Some((arc.center, arc.sweep, millimeters(&motion.end))),
                _ => None,
            },
            ProgramStep::Event { .. } => None,
        });
        let [(center, sweep, end)] = arcs.collect::<Vec<_>>()[..] else { panic!("one arc") };
        assert!(center[0].hypot(center[1]) < 1e-15, "{dialect:?}: {center:?}");
        assert!((sweep - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{dialect:?}: {sweep}");
        assert_eq!(end, [0.0, 10.0, 0.0]);
    }
    // rs274 rejects it, and so does the control that would move along the normal.
    assert!(run(arc, Dialect::LinuxCnc).expect_err("rejected").contains("word K"));
    assert!(run(&arc.replace("K0.000", "K2"), Dialect::Fanuc).expect_err("rejected").contains("word K"));
}

/// grbl has P in s; Marlin P in ms and S in s, which comes first.
#[test]
fn a_dwell_of_firmware_has_its_time_by_s_or_p() {
    for (dialect, expected) in [(Dialect::Grbl, [1.5, 2.0, 3.0]), (Dialect::Marlin, [1.5, 0.002, 3.0])] {
        let options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        let dwells: Vec<f64> =
            events("G21 G90\nM3 S500\nG4 S1.5\nG4 P2\nG4 P900 S3\nG1 X1 F100\nM2\n", options)
                .into_iter()
                .filter_map(
                    |(_, event)| if let ProgramEvent::Dwell(time) = event { Some(time) } else { None },
                )
                .collect();
        assert_eq!(dwells, expected, "{dialect}");
    }
}

#[test]
fn g0_of_marlin_moves_at_the_feed() {
    let feeds = |dialect| {
        let options = InterpreterOptions { dialect: Some(dialect), ..InterpreterOptions::default() };
        let motions = motions("G0 X1\nG0 X2 F3000\nG1 X3 F600\nG0 X4\n", options);
        motions.into_iter().map(|motion| motion.feed).collect::<Vec<_>>()
    };
    let [first, second, _, last] = feeds(Dialect::Marlin)[..] else { panic!("four motions") };
    assert!(matches!(first, Feed::Rapid), "{first:?}");
    assert!(matches!(second, Feed::Linear(feed) if (feed - 0.05).abs() < 1e-12), "{second:?}");
    assert!(matches!(last, Feed::Linear(feed) if (feed - 0.01).abs() < 1e-12), "{last:?}");
    assert!(matches!(feeds(Dialect::Grbl)[3], Feed::Rapid));
}

#[test]
fn work_offsets_of_mach3_have_numbers() {
    let text = "G21 G90\nG10 L2 P2 X10 Y20\nG59 P2\nG0 X1 Y1\nG59 P1\nG0 X1 Y2\nG59 P7\nG0 X3 Y4\nM30\n";
    let options = InterpreterOptions { dialect: Some(Dialect::Mach3), ..InterpreterOptions::default() };
    let ends: Vec<_> = motions(text, options).iter().map(|motion| millimeters(&motion.end)).collect();
    assert_eq!(ends, [[11.0, 21.0, 0.0], [1.0, 2.0, 0.0], [3.0, 4.0, 0.0]]);
}

#[test]
fn what_grbl_rejects_and_its_relatives_accept_is_noted() {
    let notes = |text: &str| -> Vec<String> {
        let options = InterpreterOptions { dialect: Some(Dialect::Grbl), ..InterpreterOptions::default() };
        let mut interpreter = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
        let errors: Vec<_> = interpreter.by_ref().filter_map(Result::err).collect();
        assert!(errors.is_empty(), "{errors:?}");
        interpreter.report().assumptions.keys().filter(|note| note.contains("grbl 1.1")).cloned().collect()
    };
    assert_eq!(
        notes("G21\nG64\nT1 M6\nG4 S2\nM2\n"),
        [
            "G4 S: grbl 1.1 requires P, the dwell in s (error 28)",
            "G64: grbl 1.1 rejects it (error 20)",
            "M6: grbl 1.1 rejects it (error 20), a sender or grblHAL changes the tool",
        ]
    );
    assert!(notes("G21\nG61\nT1\nG4 P2\nM3 S1000\nM2\n").is_empty());
}

#[test]
fn all_positions_of_an_extruder_are_one_error() {
    let text = "G28 X0 Y0\nM117 Printing\nG1 X1 F600 E0.019\nG1 X2 E0.03\nG1 X3 E0.04\nM2\n";
    let options = InterpreterOptions { reports_all_errors: true, ..InterpreterOptions::default() };
    let mut interpreter = Interpreter::new(std::io::Cursor::new(text.to_owned()), "part.nc", options);
    interpreter.by_ref().for_each(drop);
    let errors: Vec<_> = interpreter.report().errors.iter().collect();
    let [(text, found)] = &errors[..] else { panic!("{errors:?}") };
    assert!(text.starts_with("word E: the letter E is not supported, the extruder of a printer"), "{text}");
    assert_eq!((found.count, found.first_line), (3, 3));
    // The other words of the line count: an arc from its end, at its feed.
    let errors =
        report("G21\nG90\nG0 E1 X10\nG1 Y0 E2 F600\nG2 X20 Y10 R10\nG1 X0\nM2\n", Dialect::Marlin).errors;
    assert!(errors.len() == 1 && errors.keys().all(|text| text.starts_with("word E")), "{errors:?}");
}
