//! Recordings of LinuxCNC's halsampler.

use super::recording_columns::{Recorded, summary};
use virtual_axes_io::files::RecordingFormat;

/// Line of the manual page <https://linuxcnc.org/docs/2.9/html/man/man1/halsampler.1.html>: output for the configuration
/// string "ffbs".
const MANUAL: &str = "123.55 33.4 0 -12\n";

/// Lines as `sampler_usr.c` prints them with the option `-t`: `"%ld "` for the sample number, `"%f "` for each pin.
pub(crate) const TAGGED: &str = "overrun\n4711 0.100000 0.098500 1.250000 \n4712 0.200000 0.197000 1.500000 \n4713 0.300000 0.295500 1.750000 \n";

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
    let mapping = ["psec=#2[mm]", "position=#3[mm]", "current=#4"];
    let recorded = Recorded::new("halsampler", TAGGED).columns(&mapping).rate(1000.0);
    let columns: Vec<String> = recorded.inspect().columns.iter().map(summary).collect();
    assert_eq!(columns, ["time [samples]", "-", "-", "-"]);
    let found = recorded.good("x");
    assert_eq!(found.time, [0.0, 0.001, 0.002]);
    assert_eq!(found.current, Some(vec![1.25, 1.5, 1.75]));
    let with_gap = format!("{TAGGED}overrun\n4720 1.000000 0.985000 3.500000 \n");
    let (found, findings) =
        Recorded::new("halsampler", with_gap).columns(&mapping).rate(1.0).read("x").expect("good");
    assert_eq!(found.time, [0.0, 1.0, 2.0, 9.0]);
    assert!(findings.iter().any(|finding| finding.code == "overrun"), "{findings:?}");
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
