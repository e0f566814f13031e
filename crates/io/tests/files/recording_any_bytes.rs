//! Recordings of all formats with arbitrary changes.

use proptest::prelude::*;
use virtual_axes_io::files::{
    Columns, FileError, RecordingFormat, RecordingOptions, inspect_recording_stream, read_recording_stream,
};

use super::recording_columns::axis;

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

/// Allowed memory independent of the input, and per byte of it: the bounds of the fuzz targets.
const FREE_MEMORY: u64 = 48 << 20;
const MEMORY_PER_BYTE: u64 = 1000;

/// Reads and lists a recording; checks errors, memory and the channels of an accepted recording.
fn check(bytes: &[u8], options: &RecordingOptions) -> Result<(), TestCaseError> {
    let is_one_line = |error: &FileError| {
        let text = error.to_string();
        text.starts_with("r") && text.len() <= 2000 && !text.contains(char::is_control)
    };
    let y = axis("y");
    let mut outcome = None;
    let memory = allocation_counter::measure(|| {
        outcome = Some((
            inspect_recording_stream(bytes, "r", options),
            read_recording_stream(bytes, "r", y, options),
        ));
    });
    prop_assert!(
        memory.bytes_max <= FREE_MEMORY + MEMORY_PER_BYTE * bytes.len() as u64,
        "{}",
        memory.bytes_max
    );
    let (columns, recording) = outcome.expect("measured");
    match columns {
        Err(error) => prop_assert!(is_one_line(&error), "{error}"),
        Ok(columns) => prop_assert!(!columns.columns.is_empty()),
    }
    match recording {
        Err(error) => prop_assert!(is_one_line(&error), "{error}"),
        Ok((found, _)) => {
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
    Ok(())
}

#[test]
fn many_columns_cost_little_time_and_memory() {
    let word = "geschwindigkeitssollwertistpo;";
    let line = word.repeat(2180) + "\n";
    let begin = std::time::Instant::now();
    check(line.repeat(120).as_bytes(), &RecordingOptions::default()).expect("rejected");
    check(("pos;".repeat(15_000) + "time\n").as_bytes(), &RecordingOptions::default()).expect("rejected");
    let axes: Vec<String> = (0..900).map(|k| format!("x{} axis{} pos", k % 100, k / 10)).collect();
    check((axes.join(";") + ";time\n").as_bytes(), &RecordingOptions::default()).expect("rejected");
    let signal = "{\"Address\":\"ENC_POS|1\"},".repeat(9000);
    let json = format!("{{\"Header\":{{\"SignalListHFData\":[{signal}{{}}]}}}}");
    check(json.as_bytes(), &RecordingOptions::default()).expect("rejected");
    let trace = "<traceSession><traceData><dataFrame><dataSignal id=\"f1\" interval=\"1e-6\" \
                 name=\"/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 1]\"/><rec time=\"0\" f1=\"1\"/><rec time=\"9\"/>\
                 </dataFrame></traceData></traceSession>";
    check(trace.as_bytes(), &RecordingOptions::default()).expect("rejected");
    let error = read_recording_stream(trace.as_bytes(), "r", axis("x"), &RecordingOptions::default());
    assert_eq!(
        error.expect_err("too many samples").to_string(),
        "r: not a recording of the format sinumerik-trace: 2 rec and the interval of the position give 9.0e6 samples, \
         more than 100200; record with less time at rest"
    );
    assert!(begin.elapsed().as_secs() < 20, "{:?}", begin.elapsed());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

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
        let options = RecordingOptions {
            columns: Columns::read(None, mapping, "--column").expect("a mapping"),
            rate_hz: Some(500.0),
            format: is_forced.then_some(format),
            joint: joint.map(str::to_owned),
            ..RecordingOptions::default()
        };
        check(&bytes, &options)?;
    }

    #[test]
    fn no_header_causes_a_panic(
        header in prop_oneof![
            "\\PC{0,40}",
            "(pos|Pos|vel|ist|soll|x|A|1|_| |\\.|\\[mm\\]|\\(|\\)|/|current|cmd|in|per|min|s){0,8}",
        ],
    ) {
        let text = format!("{header};{header};time\n0;0;0\n");
        check(text.as_bytes(), &RecordingOptions::default())?;
    }
}
