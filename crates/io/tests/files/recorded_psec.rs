//! Setpoints of several axes from recordings of controls.

use std::io::Read;

use super::recording_columns::axis;
use super::{recording_halsampler, recording_sinumerik_edge, recording_sinumerik_trace, recording_twincat};
use virtual_axes_core::config::AxisConfig;
use virtual_axes_io::files::RecordedPsec;
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Reads the setpoints as CSV, with the codes of the findings.
fn read(text: &str, columns: &[&str], rate: Option<f64>) -> Result<(String, Vec<&'static str>), String> {
    let folder = TestFolder::new("recorded_psec");
    let axes: Vec<AxisConfig> = ["x", "y", "c"].map(|name| axis(name).clone()).to_vec();
    let columns: Vec<String> = columns.iter().map(|column| (*column).to_owned()).collect();
    let file = folder.file("log", text);
    let read = RecordedPsec::open(&file, &axes, &columns, rate).map_err(|error| error.to_string());
    let (mut recorded, findings) = read?;
    let mut csv = String::new();
    recorded.read_to_string(&mut csv).expect("UTF-8");
    Ok((csv, findings.iter().map(|finding| finding.code).collect()))
}

/// Returns the rows of numbers below a header.
#[track_caller]
fn rows(csv: &str, header: &str) -> Vec<Vec<f64>> {
    let (found, rows) = csv.split_once('\n').expect("a header");
    assert_eq!(found, header);
    rows.lines().map(|row| row.split(',').map(|field| field.parse().expect("a number")).collect()).collect()
}

#[test]
fn pins_of_a_halsampler_log_are_setpoints_with_their_bits() {
    let text = recording_halsampler::TAGGED;
    let (csv, _) = read(text, &["y=#3[mm]", "x=#2[mm]"], Some(1000.0)).expect("setpoints");
    let numbers: Vec<Vec<f64>> = text
        .lines()
        .enumerate()
        .map(|(row, line)| {
            let mm: Vec<f64> =
                line.split_whitespace().skip(1).map(|field| field.parse().expect("a number")).collect();
            vec![row as f64 / 1000.0, mm[1] * 1e-3, mm[0] * 1e-3]
        })
        .collect();
    assert_eq!(rows(&csv, "time,y,x"), numbers);
    // Samples are missing at an overrun.
    let lost = format!("{text}overrun\n510 1.002000 -0.994200 1 \n");
    let (csv, findings) = read(&lost, &["x=#2[mm]"], Some(1000.0)).expect("setpoints");
    assert_eq!((rows(&csv, "time,x")[6][0], findings), (0.014, vec!["overrun"]));
}

#[test]
fn commanded_positions_of_sinumerik_edge_are_detected() {
    let (csv, findings) = read(recording_sinumerik_edge::EXCERPT, &[], None).expect("setpoints");
    let rows = rows(&csv, "time,x,y");
    assert_eq!(rows.len(), 6);
    assert_eq!(rows[0], [0.0, -61.889124 * 1e-3, 451.439545 * 1e-3]);
    // The counter of cycles shows the missing rows.
    assert_eq!(rows[4], [0.044, -61.889124 * 1e-3, 454.713145 * 1e-3]);
    assert_eq!(findings, ["detected-columns", "detected-columns"]);
}

#[test]
fn the_axis_of_a_sinumerik_trace_is_named() {
    let unnamed = read(recording_sinumerik_trace::MOTION, &[], None).expect_err("axis 7");
    assert!(unnamed.contains("name the column of each axis"), "{unnamed}");
    let (csv, _) = read(recording_sinumerik_trace::MOTION, &["c=#10[deg]"], None).expect("setpoints");
    let psec = rows(&csv, "time,c");
    // Degrees of the signal f10, every 2 ms.
    let wanted =
        [176.794340_f64, 176.711420, 176.627290, 176.541950, 176.455390, 176.367630, 176.278650, 176.188460];
    assert_eq!(psec.len(), wanted.len());
    for (row, (psec, wanted)) in psec.iter().zip(wanted).enumerate() {
        assert!((psec[0] - 0.002 * row as f64).abs() < 1e-9, "{psec:?}");
        assert!((psec[1] - wanted.to_radians()).abs() < 1e-12, "{psec:?}");
    }
}

#[test]
fn channels_of_twincat_scope_are_setpoints() {
    let text = recording_twincat::axes();
    let (csv, _) = read(&text, &["x=Axis 1 SetPos[mm]"], None).expect("setpoints");
    let rows = rows(&csv, "time,x");
    assert_eq!(rows[..3], [[0.0, 0.0], [0.001, 1e-3], [0.002, 2.0 * 1e-3]]);
    let twice = read(&text, &["x=#2[mm]", "y=#2[mm]"], None).expect("one column for two axes");
    assert!(twice.0.starts_with("time,x,y\n0,0,0\n"), "{}", twice.0);
}

#[test]
fn commanded_positions_in_the_header_of_a_csv_file_are_setpoints() {
    let text = "datetime;Y Commanded (in);Y Actual (in);X1_CommandPosition [mm]\n2024-03-01 10:00:00.000;1;1.01;5\n\
                2024-03-01 10:00:00.004;2;1.99;6\n";
    let (csv, findings) = read(text, &[], None).expect("setpoints");
    assert_eq!(rows(&csv, "time,x,y"), [[0.0, 5e-3, 0.0254], [0.004, 6e-3, 0.0508]]);
    assert_eq!(findings, ["detected-columns", "detected-columns"]);
    // A mapping without a unit takes that of the header.
    let (csv, _) = read(text, &["y=Y Actual (in)"], None).expect("setpoints");
    assert!((rows(&csv, "time,y")[0][1] - 1.01 * 0.0254).abs() < 1e-15, "{csv}");
    let error = read("time,pos_x,cmd_pos_x\n0,1,1\n", &[], None).expect_err("no unit");
    assert!(
        error.contains("does not state the unit of column cmd_pos_x; give it by --column 'x=cmd_pos_x[mm]'")
    );
}

#[test]
fn csv_of_commanded_positions_is_told_from_other_text() {
    let folder = TestFolder::new("recorded_psec_detection");
    for (text, wanted) in [
        ("Unnamed: 0,time,pos_x,cmd_pos_x\n0,0,1,1\n", true),
        ("Zeit;x_soll [mm]\n0;0\n", true),
        ("time,x\n0,0\n", false),
        ("time,x position [mm]\n0,0\n", false),
        ("joint_names: [x, y]\npoints: []\n", false),
        ("N10 G1 X5 Y5\n", false),
        ("", false),
    ] {
        assert_eq!(RecordedPsec::detects(&folder.file("log", text)), wanted, "{text}");
    }
}

#[test]
fn invalid_mappings_are_rejected() {
    let error = |columns: &[&str]| read("0 1 2\n1 2 3\n", columns, Some(10.0)).expect_err("invalid");
    for (columns, reason) in [
        (&["q=#2"][..], "--column: \"q\" is no axis of the machine"),
        (&["x=#2", "x=#3"], "--column: x is given twice"),
        (&["x=#0"], "--column: x=#0: a column number must be an integer of at least 1"),
        (&["x"], "--column: x=: the column is missing"),
        (&["x=#2[deg]"], "--column: the unit of position is [deg], must be one of m, mm, um"),
        (&["x=#9"], "there is no column \"#9\""),
        (&["time=#1[s]"], "no column is known as the commanded position of an axis of the machine"),
    ] {
        let found = error(columns);
        assert!(found.contains(reason), "{found}");
    }
}
