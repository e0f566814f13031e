//! Random programs and random bytes.

use std::io::Cursor;
use std::sync::LazyLock;

use proptest::prelude::*;
use virtual_axes_core::config::Parameters;
use virtual_axes_nc::interpret::{Interpreter, InterpreterOptions};
use virtual_axes_nc::motion::{Coordinates, Feed, MotionKind, ProgramStep};

/// Number of steps after which an endless program is left.
const MAX_STEPS: usize = 5000;

static OPTIONS: LazyLock<InterpreterOptions> = LazyLock::new(|| {
    let machine =
        Parameters::embedded_default().and_then(|parameters| parameters.machine_config()).expect("a machine");
    InterpreterOptions { repeated_lines: 2000, ..InterpreterOptions::for_machine(&machine) }
});

/// Interprets a text, and checks what holds for each program. Returns the number of motions.
fn check(text: &[u8]) -> usize {
    let mut before: Option<(Coordinates, Option<f64>)> = None;
    let (mut motions, mut line) = (0, 0);
    for step in Interpreter::new(Cursor::new(text), "p.nc", OPTIONS.clone()).take(MAX_STEPS) {
        match step {
            Ok(ProgramStep::Motion(motion)) => {
                motions += 1;
                assert!(motion.end.iter().all(|value| value.is_finite()), "{motion:?}");
                // A change of the tool length mode converts the position.
                if let Some((position, tcp_length)) = before.filter(|before| before.1 == motion.tcp_length) {
                    assert!(position == motion.start || tcp_length.is_some(), "{motion:?} from {position:?}");
                }
                match motion.feed {
                    Feed::Rapid => assert_eq!(motion.kind, MotionKind::Rapid),
                    Feed::Linear(feed) | Feed::Rotary(feed) | Feed::Duration(feed) => {
                        assert!(feed > 0.0 && feed.is_finite(), "{motion:?}");
                    }
                }
                if let MotionKind::Arc(arc) = &motion.kind {
                    let [first, second, _] = arc.plane.axes();
                    let [x, y] = [motion.start[first] - arc.center[0], motion.start[second] - arc.center[1]];
                    let (sin, cos) = arc.sweep.sin_cos();
                    let [dx, dy] = [
                        x * cos - y * sin - (motion.end[first] - arc.center[0]),
                        x * sin + y * cos - (motion.end[second] - arc.center[1]),
                    ];
                    assert!(dx.hypot(dy) < 0.5e-3 + 1e-9, "{motion:?}");
                }
                line = motion.line.max(1);
                before = Some((motion.end, motion.tcp_length));
            }
            Ok(ProgramStep::Event { line: at, .. }) => line = at,
            Err(error) => {
                let message = error.to_string();
                assert!(message.starts_with(&format!("p.nc:{}: ", error.line)), "{message}");
                assert!(!message.chars().any(|c| c.is_control()), "{message:?}");
                assert!(error.line <= text.split(|byte| matches!(byte, b'\n' | b'\r')).count(), "{message}");
                line = error.line;
            }
        }
    }
    assert!(line > 0, "no step and no error");
    motions
}

/// Returns a strategy of words, most of them valid.
fn word() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        6 => (-20.0..20.0_f64).prop_map(|value| format!("{value:.3}")),
        1 => (0..40_u32).prop_map(|value| value.to_string()),
        1 => Just("[1+2*#1]".to_owned()),
        1 => Just("#2".to_owned()),
        1 => Just("SIN[30]".to_owned()),
    ];
    let axis = (prop::sample::select(vec!["X", "Y", "Z", "A", "C"]), number.clone());
    let other =
        (prop::sample::select(vec!["I", "J", "K", "R", "P", "Q", "L", "F", "S", "T", "H", "B", "D"]), number);
    prop_oneof![
        8 => axis.prop_map(|(letter, value)| format!("{letter}{value}")),
        3 => other.prop_map(|(letter, value)| format!("{letter}{value}")),
        6 => prop::sample::select(vec![
            "G0", "G1", "G2", "G3", "G4", "G5.2", "G5.3", "G10", "G17", "G18", "G19", "G20", "G21", "G28", "G40", "G43",
            "G43.4", "G49", "G52", "G53", "G54", "G55", "G61", "G61.1", "G64", "G80", "G81", "G83",
            "G90", "G91", "G90.1", "G91.1",
            "G92", "G92.1", "G92.2", "G92.3", "G93", "G94", "G95", "M0", "M3", "M5", "M6", "M8", "M9", "M98", "M99",
        ]).prop_map(str::to_owned),
        1 => prop::sample::select(vec!["F500", "S1000 M3", "#1=2", "#<a>=#1", "(MSG, hello)", "(a) ;b", "%", "/"])
            .prop_map(str::to_owned),
    ]
}

/// Returns a strategy of lines: words, or O-words with few labels, so that they often match.
fn line() -> impl Strategy<Value = String> {
    let keyword = prop::sample::select(vec![
        "sub",
        "endsub",
        "call [1]",
        "call",
        "while [#1 LT 3]",
        "endwhile",
        "do",
        "while [0]",
        "if [#1 GT 1]",
        "else",
        "elseif [1]",
        "endif",
        "repeat [3]",
        "endrepeat",
        "break",
        "continue",
        "return [5]",
        "",
    ]);
    prop_oneof![
        4 => prop::collection::vec(word(), 0..5).prop_map(|words| words.join(" ")),
        2 => prop::collection::vec(-9.0..9.0_f64, 2).prop_map(|x| format!("G1 F100 X{:.3} Y{:.3}", x[0], x[1])),
        1 => (1..4_u32, keyword).prop_map(|(label, keyword)| format!("o{label} {keyword}")),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_programs_give_steps_or_one_error(lines in prop::collection::vec(line(), 1..25)) {
        check(lines.join("\n").as_bytes());
    }

    #[test]
    fn random_bytes_give_steps_or_one_error(text in prop::collection::vec(any::<u8>(), 0..200)) {
        check(&text);
    }

    #[test]
    fn random_characters_give_steps_or_one_error(text in "[GMXYZIJKRFSTPLHNOo#<>\\[\\]()0-9.+*/= \n-]{0,120}") {
        check(text.as_bytes());
    }
}

#[test]
fn damaged_programs_give_steps_or_one_error() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rs274");
    let mut motions = 0;
    for entry in std::fs::read_dir(folder).expect("the programs") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "ngc") {
            continue;
        }
        let text = std::fs::read(&path).expect("a program");
        motions += check(&text);
        for index in 0..text.len() {
            let mut damaged = text.clone();
            damaged.remove(index);
            check(&damaged);
            damaged.insert(index, b"[#-O9"[index % 5]);
            check(&damaged);
            check(&text[..index]);
        }
    }
    assert!(motions > 200, "{motions}");
}
