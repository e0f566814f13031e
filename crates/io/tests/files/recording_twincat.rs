//! Recordings of TwinCAT Scope.

use super::recording_columns::{Recorded, summary};
use virtual_axes_io::files::RecordingFormat;

/// Export with a time for each channel and decimal commas.
const ALL_TIMES: &str = include_str!("../data/twincat_scope_all_times.csv");
/// Export with a time for each group of channels, decimal points and scaled values.
const SHARED_TIMES: &str = include_str!("../data/twincat_scope_shared_times.csv");
/// Example of TwinCAT 2 in <https://infosys.beckhoff.com/content/1033/tcscope2/11171654667.html>.
const TWINCAT_2: &str = "Name\tScope01\nFile\nStartRecord\t128783093223690000\tDonnerstag, 5. Februar 2009\t13:08:42\n\
    EndRecord\t128783093339880000\tDonnerstag, 5. Februar 2009\t13:08:53\n\nName\tDREIECK\nNetId\t172.16.8.205.1.1\n\
    Port\t801\nSampleTime[ms]\t1\nSymbolBased\tTRUE\nSymbolName\tMAIN.DREIECK\nSymbolComment\t\nIndexGroup\t16448\n\
    IndexOffset\t608\nData-Type\tADST_REAL32\nVariableSize\t4\n\n0\t-1,03799391\n1\t-1,03599393\n2\t-1,033994\n";

fn millimeters(values: &[f64]) -> Option<Vec<f64>> {
    Some(values.iter().map(|value| value * 1e-3).collect())
}

/// Returns the export with shared times of two axes: the names of the channels are those of numerical controls.
pub(crate) fn axes() -> String {
    let names = "Name\tAxis 1 SetPos\tAxis 1 ActPos\tName\tAxis 1 ActTorque\tName\tActPos\tActVelo";
    let text = SHARED_TIMES
        .replace("Name\tvar_REAL32\tvar_REAL64\tName\tfunc_OS\tName\tfunc_scaled\tfunc_units_scaled", names);
    text.replace(
        "MAIN.var_REAL\tMAIN.var_REAL\nOffset\t0\t0\tOffset\t0\tOffset\t1\t0\nScaleFactor\t1\t1\tScaleFactor\t1\tScaleFactor\t-1\t1\n\
         Unit\t(None)\t(None)\tUnit\t(None)\tUnit\t(None)\tdV (Voltage)",
        "Axes.Axis 2.NcToPlc.ActPos\tAxes.Axis 2.NcToPlc.ActVelo\nOffset\t0\t0\tOffset\t0\tOffset\t1\t0\n\
         ScaleFactor\t1\t1\tScaleFactor\t1\tScaleFactor\t-1\t1\n\
         Unit\tmm (Length)\tmm (Length)\tUnit\tNm (Torque)\tUnit\tmm (Length)\tmm/s (Velocity)",
    )
}

#[test]
fn columns_are_listed_with_their_times() {
    let found = Recorded::new("twincat", ALL_TIMES).inspect();
    assert_eq!(found.format, RecordingFormat::TwinCatScope);
    let headers: Vec<&str> = found.columns.iter().map(|column| column.header.as_str()).collect();
    assert_eq!(
        headers,
        [
            "Name",
            "var_REAL64",
            "Name",
            "func_OS",
            "Name",
            "func_scaled",
            "Name",
            "func_units_scaled",
            "Name",
            "func_freesample"
        ]
    );
    assert_eq!(summary(&found.columns[0]), "time [ms]");
    assert!(found.has_time() && found.columns[1].channel.is_none());
    let columns: Vec<String> =
        Recorded::new("twincat", axes()).inspect().columns.iter().map(summary).collect();
    assert_eq!(
        columns,
        [
            "time [ms]",
            "psec [mm] 1",
            "position [mm] 1",
            "time [ms]",
            "current [N.m] 1",
            "time [ms]",
            "position [mm] 2",
            "velocity [mm/s] 2",
        ]
    );
}

#[test]
fn channels_are_selected_by_a_mapping() {
    let mapping = ["position=var_REAL64[mm]", "current=func_OS"];
    for text in [ALL_TIMES.to_owned(), ALL_TIMES.replace('\n', "\r\n"), format!("{ALL_TIMES}EOF\n")] {
        let found = Recorded::new("twincat", text).columns(&mapping).good("x");
        assert_eq!(found.time, [0.0, 0.001, 0.002, 0.003, 0.004, 0.005]);
        assert_eq!(found.position, millimeters(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
        // Oversampled: values at 0 and 1 ms of 0 to 1 ms.
        let current = found.current.expect("there");
        assert_eq!(current[..2], [0.0, 1.0]);
        assert!(current[2..].iter().all(|value| value.is_nan()));
    }
    // The period of the position counts; slower channels have values at some of its times.
    let slow =
        Recorded::new("twincat", ALL_TIMES).columns(&["position=#2[mm]", "velocity=#10[mm/s]"]).good("x");
    let velocity = slow.velocity.expect("there");
    assert_eq!((velocity[2], velocity[0].is_nan(), velocity[3].is_nan()), (0.002, true, true));
    let shared = Recorded::new("twincat", SHARED_TIMES).columns(&["position=#7[mm]"]).read("x");
    let (found, findings) = shared.expect("good");
    assert_eq!(found.position, millimeters(&[1.0, 0.0, -1.0, -2.0, -3.0, -4.0]));
    let scaled = findings.iter().find(|finding| finding.code == "scaled").expect("reported");
    assert!(scaled.what.contains("(ScaleFactor -1, Offset 1)"), "{scaled}");
    let old = Recorded::new("twincat", TWINCAT_2).columns(&["position=DREIECK"]).good("x");
    assert_eq!(
        (old.time, old.position),
        (vec![0.0, 0.001, 0.002], Some(vec![-1.03799391, -1.03599393, -1.033994]))
    );
}

/// A channel in several charts is exported several times, as `test space` and `test space (1)` in the export.
#[test]
fn copies_of_a_channel_are_read_once() {
    let names = "Name\tActPos\tvar_REAL64\tName\tfunc_OS\tName\tActPos (1)\tfunc_units_scaled";
    let copies = SHARED_TIMES
        .replace("Name\tvar_REAL32\tvar_REAL64\tName\tfunc_OS\tName\tfunc_scaled\tfunc_units_scaled", names);
    let recorded = Recorded::new("twincat", &copies);
    assert_eq!(recorded.inspect().columns[6].reason, "copy of column #2 with the same symbol");
    assert_eq!(recorded.good("x").position, Some(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    // Another symbol is another channel.
    let others = copies.replace("MAIN.var_REAL\tMAIN.var_REAL\n", "MAIN.other\tMAIN.var_REAL\n");
    let error = Recorded::new("twincat", others).error("x");
    assert!(error.contains("#2 \"ActPos\", #7 \"ActPos (1)\" all fit position"), "{error}");
}

#[test]
fn axes_are_selected_by_name_or_symbol() {
    let first = Recorded::new("twincat", axes()).joint("1").good("x");
    assert_eq!(first.psec, millimeters(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    assert!(first.current.is_some());
    let second = Recorded::new("twincat", axes()).joint("2").good("x");
    assert_eq!(second.position, millimeters(&[1.0, 0.0, -1.0, -2.0, -3.0, -4.0]));
    assert_eq!(second.velocity, millimeters(&[10.0, 0.0, -10.0, -20.0, -30.0, -40.0]));
    let error = Recorded::new("twincat", axes()).error("x");
    assert_eq!(
        error,
        "r:7: the file has no columns of axis x; there are the axes 1, 2: select one by --joint"
    );
}

#[test]
fn separators_repetitions_and_file_times_are_read() {
    let mapping = ["position=var_REAL64[mm]"];
    let semicolons = ALL_TIMES.replace('\t', ";");
    assert_eq!(Recorded::new("twincat", semicolons).columns(&mapping).good("x").time.len(), 6);
    let commas = SHARED_TIMES.replace('\t', ",");
    assert_eq!(Recorded::new("twincat", commas).columns(&mapping).good("x").time.len(), 6);
    // Slow channels filled with previous values, and file times.
    let head: String = TWINCAT_2.split_inclusive('\n').take(16).collect();
    let filled = format!("{head}0\t1\n0\t1\n4\t2\n4\t2\n");
    let found = Recorded::new("twincat", filled).columns(&["position=DREIECK"]).good("x");
    assert_eq!((found.time, found.position), (vec![0.0, 0.004], Some(vec![1.0, 2.0])));
    let file_times =
        format!("{head}132959733843760000\t1\n132959733843770000\t2\n132959733843780000\t \n\t\n");
    let found = Recorded::new("twincat", file_times).columns(&["position=DREIECK"]).good("x");
    assert_eq!(found.time, [0.0, 0.001, 0.002]);
    assert!(found.position.expect("there")[2].is_nan());
}

#[test]
fn malformed_exports_are_rejected() {
    let error = |text: &str| {
        Recorded::new("twincat", text)
            .columns(&["position=var_REAL64[mm]"])
            .format(RecordingFormat::TwinCatScope)
            .error("x")
    };
    assert_eq!(
        error(&ALL_TIMES.replace("\n2\t2", "\n2\ttwo")),
        "r:27: var_REAL64 is \"two\", must be a finite number or empty"
    );
    assert_eq!(
        error(&ALL_TIMES.replace("\n2\t2", "\n2.0,5\t2")),
        "r:27: Name is \"2.0,5\", must be a finite number or empty"
    );
    let surplus = error(&ALL_TIMES.replace("7\t7\n", "7\t7\t1\n"));
    assert_eq!(surplus, "r:27: 11 values, 10 columns");
    assert_eq!(error(""), "r: there are no lines of values");
    let start = "r:1: not a recording of the format twincat-scope: ";
    assert_eq!(error("time,x\n"), format!("{start}the first line must begin with \"Name\" and a separator"));
    assert_eq!(error("Name a\n"), format!("{start}a blank as separator is ambiguous; export with tabs"));
    let header: String = ALL_TIMES.lines().take(24).flat_map(|line| [line, "\n"]).collect();
    assert_eq!(error(&header), "r: there are no lines of values");
    let unmapped = Recorded::new("twincat", ALL_TIMES).error("x");
    assert!(
        unmapped.starts_with("r:7: there is no column") && unmapped.contains("for position"),
        "{unmapped}"
    );
}
