//! Encodings of text files: each gives the same content.

use super::recording_columns::Recorded;
use super::{recording_halsampler, recording_sinumerik_edge};
use virtual_axes_core::config::Parameters;
use virtual_axes_core::simulation::joint_limits;
use virtual_axes_identify::recording::RawRecording;
use virtual_axes_io::files::{FileKind, Input, PsecCsvReader, RecordingFormat, read_psec_yaml};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Recording with units of Western Europe.
const CSV: &str = "Zeit [s];Lage Istwert [µm];Winkel [°]\n0,000;1000,0;0\n0,001;1500,5;0\n";
const TWINCAT: &str = include_str!("../data/twincat_scope_all_times.csv");
const TRACE: &str = include_str!("../data/sinumerik_trace_motion.xml");

/// Returns a text in UTF-8 with a mark, UTF-16 of both byte orders, UTF-16 without mark, and Windows-1252 if all of its
/// characters are those of Latin-1.
fn encoded(text: &str) -> Vec<(&'static str, Vec<u8>)> {
    let utf16 = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
    let latin: Option<Vec<u8>> = text.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect();
    let mut found = vec![
        ("UTF-8 with mark", ["\u{feff}".as_bytes(), text.as_bytes()].concat()),
        ("UTF-16LE", [vec![0xff, 0xfe], utf16(u16::to_le_bytes)].concat()),
        ("UTF-16BE", [vec![0xfe, 0xff], utf16(u16::to_be_bytes)].concat()),
        ("UTF-16LE without mark", utf16(u16::to_le_bytes)),
    ];
    found.extend(latin.map(|bytes| ("Windows-1252", bytes)));
    found
}

/// Format, text, columns, axis and joint of a recording.
type Example<'a> = (RecordingFormat, &'a str, &'a [&'a str], &'a str, Option<&'a str>);

#[test]
fn a_recording_of_each_format_is_the_same_in_each_encoding() {
    let recordings: [Example<'_>; 5] = [
        (
            RecordingFormat::Csv,
            CSV,
            &["time=Zeit [s]", "position=Lage Istwert [µm][µm]", "delimiter=;", "decimal_comma=true"],
            "x",
            None,
        ),
        (RecordingFormat::Halsampler, recording_halsampler::TAGGED, &["position=#3[mm]"], "x", None),
        (RecordingFormat::SinumerikEdge, recording_sinumerik_edge::EXCERPT, &[], "x", Some("X1")),
        (RecordingFormat::TwinCatScope, TWINCAT, &["position=var_REAL64[mm]"], "x", None),
        (RecordingFormat::SinumerikTrace, TRACE, &["position=#8[deg]"], "c", None),
    ];
    for (format, text, columns, axis, joint) in recordings {
        let recorded = |bytes: &[u8]| {
            let recorded = Recorded::new("encoding", bytes).columns(columns);
            let recorded =
                if format == RecordingFormat::SinumerikTrace { recorded } else { recorded.rate(500.0) };
            match joint {
                Some(joint) => recorded.joint(joint),
                None => recorded,
            }
        };
        let plain = recorded(text.as_bytes());
        let (columns, wanted) = (plain.inspect().columns, plain.good(axis));
        assert!(wanted.position.as_ref().is_some_and(|values| !values.is_empty()));
        for (encoding, bytes) in encoded(text) {
            let found = recorded(&bytes);
            let seen = found.inspect();
            assert_eq!((seen.format, &seen.columns), (format, &columns), "{encoding}");
            let found = RawRecording { name: wanted.name.clone(), ..found.good(axis) };
            assert_eq!(found, wanted, "{format} {encoding}");
        }
    }
    // 1000 µm are 1 mm.
    let csv = Recorded::new("encoding", encoded(CSV).pop().expect("Latin").1);
    let columns = ["position=Lage Istwert [µm][µm]", "time=Zeit [s]", "delimiter=;", "decimal_comma=true"];
    let position = csv.columns(&columns).good("x").position.expect("a position");
    assert!((position[0] - 1e-3).abs() < 1e-15 && (position[1] - 1.5005e-3).abs() < 1e-15, "{position:?}");
}

#[test]
fn setpoints_are_the_same_in_each_encoding() {
    let limits =
        joint_limits(&Parameters::embedded_default().expect("shipped").machine_config().expect("valid"), "");
    let folder = TestFolder::new("encodings");
    for (encoding, bytes) in encoded("time,x\n0,0\n0.006,0.001\n") {
        let input = Input::open(&folder.file("s.csv", &bytes)).expect("setpoints");
        assert_eq!(input.kind(), FileKind::PsecCsv, "{encoding}");
        let mut psec =
            PsecCsvReader::new(input.into_reader(), "s.csv", 6_000_000, &limits).expect("setpoints");
        let (mut row, mut found) = ([0.0], Vec::new());
        while psec.next(&mut row).expect("valid") {
            found.push(row[0]);
        }
        assert_eq!(found, [0.0, 0.001], "{encoding}");
    }
    let yaml = "# Länge in m\njoint_names: [x]\npoints:\n- {positions: [0.25], time_from_start: {sec: 1}}\n";
    for (encoding, bytes) in encoded(yaml) {
        let input = Input::open(&folder.file("s.yaml", &bytes)).expect("setpoints");
        assert_eq!(input.kind(), FileKind::PsecYaml, "{encoding}");
        let requests = read_psec_yaml(input.text().expect("text"), "s.yaml").expect("a trajectory");
        let point = requests[0].point(0).map(|(_, point)| format!("{point:?}")).expect("a point");
        assert!(point.contains("0.25"), "{encoding} {point}");
    }
}
