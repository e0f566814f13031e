//! Recordings of all formats with arbitrary changes.

use proptest::prelude::*;
use virtual_axes_io::files::RecordingFormat;

use super::recording_columns::Recorded;

const EXCERPTS: [(RecordingFormat, &str); 6] = [
    (RecordingFormat::SinumerikTrace, include_str!("../data/sinumerik_trace_motion.xml")),
    (RecordingFormat::SinumerikTrace, include_str!("../data/sinumerik_trace_rest.xml")),
    (RecordingFormat::SinumerikEdge, super::recording_sinumerik_edge::EXCERPT),
    (RecordingFormat::TwinCatScope, include_str!("../data/twincat_scope_all_times.csv")),
    (RecordingFormat::TwinCatScope, include_str!("../data/twincat_scope_shared_times.csv")),
    (RecordingFormat::Halsampler, super::recording_halsampler::TAGGED),
];

/// Change of a text: bytes inserted, and bytes removed behind them.
fn any_change() -> impl Strategy<Value = (prop::sample::Index, Vec<u8>, usize)> {
    let piece = prop_oneof![
        prop::collection::vec(any::<u8>(), 0..4),
        "[-+0-9.,e;\t\n \"<>/\\[\\]{}=:]{0,6}".prop_map(String::into_bytes),
        prop_oneof![
            Just("1e308"),
            Just("-9223372036854775808"),
            Just("nan"),
            Just("NaN"),
            Just("null"),
            Just("overrun\n"),
            Just("Name"),
            Just("EOF\n"),
            Just("<rec time=\"1e300\"/>"),
            Just("interval=\"1e-300\""),
            Just("|1"),
            Just("[u1, "),
            Just("132959733843760000"),
        ]
        .prop_map(|text| text.as_bytes().to_vec()),
    ];
    (any::<prop::sample::Index>(), piece, prop_oneof![3 => 0_usize..8, 1 => 0_usize..2000])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn accepted_recordings_are_complete(
        excerpt in 0..EXCERPTS.len(),
        changes in prop::collection::vec(any_change(), 0..4),
        is_forced in any::<bool>(),
        mapping in prop_oneof![
            Just(&[][..]), Just(&["position=#2[mm]"][..]), Just(&["position=#9[mm]", "time=#1[ms]"][..]),
        ],
        joint in prop_oneof![Just(None), Just(Some("1")), Just(Some("7"))],
    ) {
        let (format, text) = EXCERPTS[excerpt];
        let mut bytes = text.as_bytes().to_vec();
        for (index, piece, removed) in changes {
            let begin = index.index(bytes.len() + 1);
            let end = (begin + removed).min(bytes.len());
            bytes.splice(begin..end, piece);
        }
        let mut recorded = Recorded::new("any_bytes", bytes).columns(mapping).rate(500.0);
        if is_forced {
            recorded = recorded.format(format);
        }
        if let Some(joint) = joint {
            recorded = recorded.joint(joint);
        }
        let columns = recorded.try_inspect();
        prop_assert!(columns.is_err() || columns.is_ok_and(|found| !found.columns.is_empty()));
        if let Ok((found, _)) = recorded.read("y") {
            let rows = found.time.len();
            prop_assert!(rows > 0 && found.time.iter().all(|time| time.is_finite()));
            prop_assert!(found.position.is_some());
            let channels =
                [found.psec, found.position, found.velocity, found.current, found.velocity_feedforward];
            for values in channels.into_iter().flatten() {
                prop_assert_eq!(values.len(), rows);
            }
        }
    }

    #[test]
    fn no_header_causes_a_panic(
        header in prop_oneof![
            "\\PC{0,40}",
            "(pos|Pos|vel|ist|soll|x|A|1|_| |\\.|\\[mm\\]|\\(|\\)|/|current|cmd|in|per|min|s){0,8}",
        ],
    ) {
        let text = format!("{header};{header};time\n0;0;0\n");
        let recorded = Recorded::new("any_header", text);
        _ = recorded.try_inspect();
        _ = recorded.read("x");
    }
}
