//! Recordings of LinuxCNC's halsampler.

use super::recording_columns::{Recorded, axis, summary};
use virtual_axes_identify::recording::Finding;
use virtual_axes_io::files::{Columns, RecordingFormat, RecordingOptions, read_recording};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Line of the manual page <https://linuxcnc.org/docs/2.9/html/man/man1/halsampler.1.html>: output for the configuration
/// string "ffbs".
const MANUAL: &str = "123.55 33.4 0 -12\n";

/// Lines of `tests/limit3.1/expected` in <https://github.com/LinuxCNC/linuxcnc>, written with the option `-t` at 1 kHz: input
/// and output of a limiter, and a bit.
pub(crate) const TAGGED: &str = "496 -1.002000 -1.002000 0 \n497 -1.002000 -1.002000 0 \n498 -1.002000 -1.002000 0 \n\
    499 1.002000 -1.001900 1 \n500 1.002000 -1.001700 1 \n501 1.002000 -1.001400 1 \n";

#[test]
fn the_line_of_the_manual_page_is_read() {
    let recorded =
        Recorded::new("halsampler", MANUAL).columns(&["psec=#1[mm]", "position=#2[mm]"]).rate(1000.0);
    let found = recorded.inspect();
    assert_eq!((found.format, found.columns.len()), (RecordingFormat::Halsampler, 4));
    assert!(found.columns[1].reason.starts_with("pin 1 of the sampler; "), "{}", found.columns[1].reason);
    let recording = recorded.good("x");
    assert_eq!((recording.time, recording.psec), (vec![0.0], Some(vec![123.55 * 1e-3])));
    assert_eq!(recording.position, Some(vec![33.4 * 1e-3]));
    // Forced, one column is sufficient.
    let single = Recorded::new("halsampler", "1.500000 \n").columns(&["position=#1[mm]"]).rate(1.0);
    assert_eq!(single.format(RecordingFormat::Halsampler).good("x").position, Some(vec![1.5e-3]));
}

#[test]
fn the_sample_number_gives_the_time() {
    let mapping = ["psec=#2[mm]", "position=#3[mm]"];
    let recorded = Recorded::new("halsampler", TAGGED).columns(&mapping).rate(1000.0);
    let found = recorded.inspect();
    let columns: Vec<String> = found.columns.iter().map(summary).collect();
    assert_eq!(
        (found.format, columns),
        (RecordingFormat::Halsampler, ["time [samples]", "-", "-", "-"].map(String::from).to_vec())
    );
    let found = recorded.good("x");
    assert_eq!(found.time, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005]);
    assert_eq!(found.psec.expect("there")[2..4], [-1.002 * 1e-3, 1.002 * 1e-3]);
    assert_eq!(found.position.expect("there")[4..], [-1.0017 * 1e-3, -1.0014 * 1e-3]);
    // An overrun in front of the first line, and one with lost samples.
    let with_gap = format!("overrun\n{TAGGED}overrun\n510 1.002000 -0.994200 1 \n");
    let (found, findings) =
        Recorded::new("halsampler", with_gap).columns(&mapping).rate(1.0).read("x").expect("good");
    assert_eq!(found.time, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 14.0]);
    let overrun = findings.iter().find(|finding| finding.code == "overrun").expect("reported");
    assert!(overrun.what.ends_with("lines with \"overrun\": 1"), "{overrun}");
    let without_rate = Recorded::new("halsampler", TAGGED).columns(&mapping).error("x");
    assert!(
        without_rate.contains("give the sampling rate by --rate-hz, since column #1 counts"),
        "{without_rate}"
    );
}

#[test]
fn invalid_lines_are_rejected() {
    let error =
        |text: &str| Recorded::new("halsampler", text).columns(&["position=#2[mm]"]).rate(1000.0).error("x");
    assert_eq!(error("1.0 2.0 \n1.0 \n"), "r:2: 1 values, 2 columns");
    assert_eq!(error("1.0 2.0 \n1.0 two \n"), "r:2: #2 is \"two\", must be a number");
    let overrun = error("1.0 2.0 \noverrun\n1.0 2.0 \n");
    assert!(
        overrun
            .starts_with("r:2: not a recording of the format halsampler: samples are missing at \"overrun\""),
        "{overrun}"
    );
    let unmapped = Recorded::new("halsampler", TAGGED).rate(1000.0).error("x");
    assert!(
        unmapped.starts_with("r:1: there is no column") && unmapped.contains("for position"),
        "{unmapped}"
    );
    let forced = Recorded::new("halsampler", "\n").format(RecordingFormat::Halsampler).error("x");
    assert_eq!(forced, "r: the file is empty");
}

#[test]
fn options_of_other_formats_are_reported() {
    let folder = TestFolder::new("recording_unused_options");
    let findings = |content: &str, topics: &[&str]| -> Vec<Finding> {
        let texts = ["position=#2", "time=#1", "delimiter=;", "decimal_comma=true", "skip_lines=9"];
        let texts = if content.contains(';') { &texts[2..3] } else { &texts[..] };
        let options = RecordingOptions {
            columns: Columns::read(None, texts, "--column").expect("a mapping"),
            topics: topics.iter().map(|topic| (*topic).to_owned()).collect(),
            ..RecordingOptions::default()
        };
        let path = folder.file("r", content);
        let (_, findings) = read_recording(&path, axis("x"), &options).expect("good");
        findings.into_iter().filter(|finding| finding.code == "unused-option").collect()
    };
    let csv = "time;position\n0;1\n";
    assert_eq!(findings(csv, &[]), []);
    for (content, topics, wanted) in [
        (
            "0.5 1.5 \n0.75 1.75 \n",
            &[][..],
            "delimiter, decimal_comma, skip_lines not used: the format is halsampler",
        ),
        (csv, &["/mill"][..], "--topic not used: the format is csv"),
    ] {
        let [finding] = &findings(content, topics)[..] else { panic!("one finding") };
        assert!(finding.what.ends_with(wanted), "{finding:?}");
    }
}
