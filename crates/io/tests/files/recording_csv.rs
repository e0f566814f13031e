//! Recordings of one axis from CSV.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io::{self, Read};
use std::sync::LazyLock;

use proptest::prelude::*;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_identify::recording::{Finding, RawRecording};
use virtual_axes_io::files::{
    Columns, FileError, RecordingFormat, RecordingOptions, TraceCsvWriter, read_recording,
    read_recording_stream,
};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Returns the default machine: x with a screw of 20 mm, 2.64 N·m/A; a with a gear ratio of 180, 0.88 N·m/A.
fn mill() -> &'static MachineConfig {
    static MILL: LazyLock<MachineConfig> =
        LazyLock::new(|| Parameters::embedded_default().expect("shipped").machine_config().expect("valid"));
    &MILL
}

/// Returns a machine with a linear motor of 70 N/A on x.
fn linear() -> MachineConfig {
    let text = include_str!("../../../../config/linear_motor_center.yaml");
    Parameters::from_yaml(text, "linear").expect("shipped").machine_config().expect("valid")
}

fn axis<'a>(machine: &'a MachineConfig, name: &str) -> &'a AxisConfig {
    machine.axes().iter().find(|axis| axis.name() == name).expect("it has one")
}

fn options(texts: &[&str]) -> RecordingOptions {
    let columns = Columns::read(None, texts, "--column").expect("a mapping");
    RecordingOptions { columns, ..RecordingOptions::default() }
}

type Outcome = Result<(RawRecording, Vec<Finding>), FileError>;

/// Reads CSV whatever its content.
fn read_recording_csv(
    input: impl Read,
    name: &str,
    axis: &AxisConfig,
    options: &RecordingOptions,
) -> Outcome {
    let options = RecordingOptions { format: Some(RecordingFormat::Csv), ..options.clone() };
    read_recording_stream(input, name, axis, &options)
}

fn read(bytes: impl AsRef<[u8]>, texts: &[&str]) -> Outcome {
    read_recording_csv(bytes.as_ref(), "r.csv", axis(mill(), "x"), &options(texts))
}

#[track_caller]
fn good(text: &str, texts: &[&str]) -> RawRecording {
    let (recording, findings) = read(text, texts).expect("good");
    assert_eq!(findings, [], "no findings");
    recording
}

#[track_caller]
fn error(bytes: impl AsRef<[u8]>, texts: &[&str]) -> String {
    read(bytes, texts).expect_err("must be rejected").to_string()
}

/// Returns the value of a channel of an axis, recorded as `number` in `unit`.
fn value(axis: &AxisConfig, channel: &str, number: &str, unit: &str) -> Result<f64, FileError> {
    let mapping = format!("{channel}=it{unit}");
    let text = match channel {
        "time" => format!("it,position\n{number},0\n"),
        "position" => format!("time,it\n0,{number}\n"),
        _ => format!("time,position,it\n0,0,{number}\n"),
    };
    let (found, _) = read_recording_csv(text.as_bytes(), "r.csv", axis, &options(&[&mapping]))?;
    let channel = match channel {
        "time" => Some(found.time),
        "psec" => found.psec,
        "position" => found.position,
        "velocity" => found.velocity,
        "current" => found.current,
        "velocity_feedforward" => found.velocity_feedforward,
        _ => found.torque_feedforward,
    };
    Ok(channel.expect("it is there")[0])
}

#[test]
fn an_error_with_a_unit_has_one_line() {
    for text in ["position=act [m\0m]", "position=act [1\0 mm]"] {
        let text = Columns::default().set(text, "--column").expect_err("must be rejected").to_string();
        assert!(!text.contains(char::is_control), "{text:?}");
    }
}

#[test]
fn an_error_with_a_column_has_one_line() {
    let text = error("{time: p1\u{c}osition: \"#2\"}\n0 0\n", &[]);
    assert!(!text.contains(char::is_control) && text.contains("the nearest is"), "{text:?}");
}

#[test]
fn units_are_converted_to_si() {
    let (mill, linear) = (mill(), linear());
    let (x, a, lx) = (axis(mill, "x"), axis(mill, "a"), axis(&linear, "x"));
    // Axis, channel, unit, number, expected value in SI.
    let table = [
        (x, "time", "", "0.25", 0.25),
        (x, "time", "[s]", "0.25", 0.25),
        (x, "time", "[ms]", "250", 0.25),
        (x, "time", "[us]", "250", 250e-6),
        (x, "time", "[µs]", "250", 250e-6),
        (x, "time", "[ns]", "250", 250e-9),
        (x, "position", "", "0.0125", 0.0125),
        (x, "position", "[mm]", "-12.5", -0.0125),
        (x, "position", "[um]", "12.5", 12.5e-6),
        (x, "position", "[0.1 um]", "125", 12.5e-6),
        (x, "psec", "[mm]", "12.5", 0.0125),
        (a, "position", "", "1.5", 1.5),
        (a, "position", "[deg]", "90", FRAC_PI_2),
        (a, "position", "[°]", "90", FRAC_PI_2),
        (a, "psec", "[mdeg]", "90000", FRAC_PI_2),
        (x, "velocity", "[mm/s]", "30", 0.03),
        (x, "velocity", "[m/min]", "30", 0.5),
        (x, "velocity", "[mm/min]", "30", 0.0005),
        (a, "velocity", "[deg/s]", "180", PI),
        (a, "velocity", "[deg/min]", "10800", PI),
        (a, "velocity", "[°/min]", "10800", PI),
        (a, "velocity", "[rpm]", "30", PI),
        (a, "velocity", "[rev/min]", "30", PI),
        (x, "current", "", "1.5", 1.5),
        (x, "current", "[mA]", "1500", 1.5),
        (x, "current", "[-1 A]", "1.5", -1.5),
        // 5.28 N·m / 2.64 N·m/A
        (x, "current", "[N.m]", "5.28", 2.0),
        // 1000 N · 0.020 m / 2π = 3.1831 N·m
        (x, "current", "[N]", "1000", 20.0 / (TAU * 2.64)),
        (a, "current", "[Nm]", "1.76", 2.0),
        // 2 V · 35.15065 N/V = 70.3013 N
        (lx, "current", "[35.15065 N]", "2", 70.3013 / 70.0),
        (x, "velocity_feedforward", "", "100", 100.0),
        (x, "velocity_feedforward", "[rpm]", "3000", 100.0 * PI),
        // 2 m/min is 100 turns of a screw of 20 mm a minute
        (x, "velocity_feedforward", "[m/min]", "2", 100.0 * TAU / 60.0),
        (x, "velocity_feedforward", "[m/s]", "0.02", TAU),
        (x, "velocity_feedforward", "[mm/s]", "20", TAU),
        (x, "velocity_feedforward", "[mm/min]", "1200", TAU),
        (a, "velocity_feedforward", "[rpm]", "3000", 100.0 * PI),
        (lx, "velocity_feedforward", "[m/min]", "30", 0.5),
        (x, "torque_feedforward", "", "3", 3.0),
        (x, "torque_feedforward", "[A]", "2", 5.28),
        (x, "torque_feedforward", "[mA]", "2000", 5.28),
        (x, "torque_feedforward", "[N]", "1000", 20.0 / TAU),
        (lx, "torque_feedforward", "", "3", 3.0),
        (lx, "torque_feedforward", "[A]", "2", 140.0),
    ];
    for (axis, channel, unit, number, wanted) in table {
        let found = value(axis, channel, number, unit).expect("a unit of it");
        assert!((found - wanted).abs() <= 1e-14 * wanted.abs(), "{channel}{unit}: {found} for {wanted}");
    }
}

#[test]
fn an_error_of_a_unit_lists_the_allowed_units() {
    let (mill, linear) = (mill(), linear());
    let (x, a, lx) = (axis(mill, "x"), axis(mill, "a"), axis(&linear, "x"));
    let message_of =
        |axis, channel, unit| value(axis, channel, "1", unit).expect_err("does not fit").to_string();
    assert_eq!(
        message_of(x, "position", "[deg]"),
        "--column: the unit of position is [deg], must be one of m, mm, um, in for the linear axis x"
    );
    assert_eq!(
        message_of(a, "velocity", "[m/min]"),
        "--column: the unit of velocity is [m/min], must be one of rad/s, deg/s, deg/min, rpm for the rotary axis a"
    );
    assert_eq!(
        message_of(x, "time", "[mm]"),
        "--column: the unit of time is [mm], must be one of s, ms, us, ns for the linear axis x"
    );
    assert_eq!(
        message_of(a, "current", "[N]"),
        "--column: the unit of current is [N], must be one of A, mA, N.m for the rotary axis a"
    );
    assert_eq!(
        message_of(lx, "current", "[N.m]"),
        "--column: the unit of current is [N.m], must be one of A, mA, N for the linear axis x"
    );
    assert_eq!(
        message_of(lx, "velocity_feedforward", "[rpm]"),
        "--column: the unit of velocity_feedforward is [rpm], must be one of m/s, mm/s, m/min, mm/min, in/s, in/min for the linear axis x"
    );
    assert_eq!(
        message_of(a, "velocity_feedforward", "[deg/s]"),
        "--column: the unit of velocity_feedforward is [deg/s], must be one of rad/s, rpm for the rotary axis a"
    );
    assert_eq!(
        message_of(x, "torque_feedforward", "[mm]"),
        "--column: the unit of torque_feedforward is [mm], must be one of N.m, N, A, mA for the linear axis x"
    );
}

#[test]
fn invalid_mappings_are_rejected() {
    let message_of =
        |text: &str| Columns::read(None, &[text], "--column").expect_err("must be rejected").to_string();
    assert_eq!(
        message_of("position"),
        "--column: \"position\" is not a column mapping, must be CHANNEL=COLUMN[UNIT], for example position=Pos1[mm]"
    );
    assert_eq!(
        message_of("positon=p"),
        "--column: unknown key \"positon\"; known are time, psec, position, velocity, current, \
         torque, velocity_feedforward, torque_feedforward, motor_position, wind_up, delimiter, decimal_comma, skip_lines; the nearest is position"
    );
    assert_eq!(message_of("time="), "--column: time=: the column is missing");
    for wrong in ["#0", "#", "#x", "#-1", "#1.5"] {
        let wanted = format!(
            "--column: time={wrong}: a column number must be an integer of at least 1, for example #3"
        );
        assert_eq!(message_of(&format!("time={wrong}")), wanted);
    }
    let message = message_of("time=t[sec]");
    assert!(message.starts_with("--column: time=t[sec]: unknown unit \"sec\"; known are s, ms, us, ns, "));
    for wrong in ["0", "nan", "inf", "1e999", "one"] {
        assert_eq!(
            message_of(&format!("time=t[{wrong} s]")),
            format!(
                "--column: time=t[{wrong} s]: the factor is \"{wrong}\", must be a finite number other than 0"
            )
        );
    }
    assert!(message_of("time=t[]").contains("unknown unit \"\""));
    assert!(message_of("delimiter=ab").contains("must be one character"));
    assert!(message_of("delimiter=5").contains("must be one character"));
    assert_eq!(message_of("decimal_comma=yes"), "--column: decimal_comma=yes: must be true or false");
    assert_eq!(message_of("skip_lines=-1"), "--column: skip_lines=-1: must be an integer of at least 0");
    let twice =
        Columns::read(None, &["time=t", "time=u"], "--column").expect_err("must be rejected").to_string();
    assert_eq!(twice, "--column: time is given twice");
    let comma = Columns::read(None, &["delimiter=,", "decimal_comma=true"], "--column");
    assert_eq!(
        comma.expect_err("must be rejected").to_string(),
        "--column: decimal_comma=true: a comma cannot be both the delimiter and the decimal separator"
    );
}

#[test]
fn the_command_line_takes_precedence_over_a_mapping_file() {
    let folder = TestFolder::new("recording_columns");
    let file = folder.file(
        "map.yaml",
        "# of the oscilloscope\ntime: t[ms]\nposition: \"#2[mm]\"\ncurrent: \"[mA]\"\nvelocity: v [m/min]\n\
         delimiter: ;\ndecimal_comma: true\nskip_lines: 2\n",
    );
    let wanted = [
        "time=t[ms]",
        "position=#2[mm]",
        "current=[mA]",
        "velocity=v [m/min]",
        "delimiter=;",
        "decimal_comma=true",
        "skip_lines=2",
    ];
    let columns = Columns::read(Some(&file), &["current=i[A]"], "--column").expect("a mapping");
    let text = "Trace of today\n\nt;anything;v;i\n1500;-12,5;30;1,5\n";
    let from_file = RecordingOptions { columns, ..RecordingOptions::default() };
    let mill = mill();
    let (recording, _) =
        read_recording_csv(text.as_bytes(), "r.csv", axis(mill, "x"), &from_file).expect("good");
    let by_hand = RawRecording {
        name: "r.csv".to_owned(),
        time: vec![1.5],
        position: Some(vec![-0.0125]),
        velocity: Some(vec![0.5]),
        current: Some(vec![1.5]),
        ..RawRecording::default()
    };
    assert_eq!(recording, by_hand);
    let mut texts = wanted.to_vec();
    texts[2] = "current=i";
    assert_eq!(good(text, &texts), by_hand);

    let message_of =
        |text: &str| Columns::from_yaml(text, "m.yaml").expect_err("must be rejected").to_string();
    let message = message_of("time: t\npositon: p\n");
    assert!(
        message.starts_with("m.yaml:2: unknown field positon") && message.contains("nearest is position")
    );
    // In YAML, # starts a comment.
    let message = message_of("time: #1\nposition: p\n");
    assert!(message.contains("the value is missing") && message.contains("quotation marks"), "{message}");
    assert!(message_of("time: [ms]\n").contains("a text"), "{}", message_of("time: [ms]\n"));
    assert!(message_of("time: t\ntime: u\n").contains("duplicate key time"));
    assert!(message_of("").contains("exactly one mapping"));
    assert_eq!(message_of("time: t[mm/h]\n").find("m.yaml: time=t[mm/h]: unknown unit \"mm/h\""), Some(0));
    let missing = Columns::open("no/such.yaml".as_ref()).expect_err("not there").to_string();
    assert!(missing.starts_with("no/such.yaml: "), "{missing}");
}

#[test]
fn a_trace_of_this_package_requires_no_mapping() {
    let joints = ["x".to_owned(), "y".to_owned()];
    let mut trace = TraceCsvWriter::new(Vec::new(), &joints).expect("in memory");
    for k in 0..3 {
        let v = f64::from(k);
        let sample = |v: f64| AxisSample {
            psec: v,
            position: 0.1 * v,
            velocity: 0.2 * v,
            current: 0.3 * v,
            wind_up: 0.5 * v,
            ..AxisSample::default()
        };
        trace.row(i64::from(k) * 6_000_000, &[sample(v), sample(-7.0)]).expect("in memory");
    }
    let text = String::from_utf8(trace.finish().expect("in memory")).expect("text");
    let by_hand = RawRecording {
        name: "r.csv".to_owned(),
        time: vec![0.0, 0.006, 0.012],
        psec: Some(vec![0.0, 1.0, 2.0]),
        position: Some(vec![0.0, 0.1, 0.2]),
        velocity: Some(vec![0.0, 0.2, 0.4]),
        current: Some(vec![0.0, 0.3, 0.6]),
        // Position and wind-up.
        motor_position: Some(vec![0.0, 0.6, 1.2]),
        ..RawRecording::default()
    };
    assert_eq!(good(&text, &[]), by_hand);
    let of_y = RecordingOptions { joint: Some("y".to_owned()), ..RecordingOptions::default() };
    let mill = mill();
    let (y, _) = read_recording_csv(text.as_bytes(), "r.csv", axis(mill, "x"), &of_y).expect("good");
    assert_eq!(y.psec, Some(vec![-7.0; 3]));
}

#[test]
fn channel_names_as_headers_require_no_mapping() {
    let text =
        "\u{feff}\"time\", position ,note,current,psec,velocity\r\n0,1,9,2,3,4\r\n\r\n0.5,5,9,,nan,6\r\n";
    let found = good(text, &[]);
    assert_eq!(found.time, [0.0, 0.5]);
    assert_eq!((found.position, found.velocity), (Some(vec![1.0, 5.0]), Some(vec![4.0, 6.0])));
    let (current, psec) = (found.current.expect("there"), found.psec.expect("there"));
    assert!(current[0] == 2.0 && current[1].is_nan() && psec[0] == 3.0 && psec[1].is_nan());
    assert_eq!((found.velocity_feedforward, found.torque_feedforward), (None, None));
    // Stamps that jump or repeat are handled after reading.
    assert_eq!(good("time,position\n3,0\n1,0\n1,0\n", &[]).time, [3.0, 1.0, 1.0]);
}

#[test]
fn csv_variants_of_oscilloscopes_are_read() {
    // Semicolons, decimal commas, a preamble, units in headers, a delimiter at the end of each line.
    let text = "Messung 3;\nAchse;X\n\nZeit [ms];Istposition [mm];\"Strom; Motor [A]\";\n\
                0,0;-1,25;+2,5e-1;\n1,0;-1,5;;\n";
    let texts = [
        "time=Zeit [ms]",
        "position=Istposition [mm][mm]",
        "current=Strom; Motor [A]",
        "decimal_comma=true",
        "skip_lines=3",
    ];
    let found = good(text, &texts);
    assert_eq!((found.time, found.position), (vec![0.0, 0.001], Some(vec![-0.00125, -0.0015])));
    let current = found.current.expect("there");
    assert!(current[0] == 0.25 && current[1].is_nan());
    let tabs = "time\tposition\tcurrent\n0,5\t1,5\t\n1\t2\t3\n";
    let found = good(tabs, &["decimal_comma=true"]);
    assert_eq!((found.time, found.position), (vec![0.5, 1.0], Some(vec![1.5, 2.0])));
    // No header.
    let found = good("0;1;2\n1;3;4\n", &["time=#1", "position=#3[mm]"]);
    assert_eq!((found.time, found.position), (vec![0.0, 1.0], Some(vec![0.002, 0.004])));
    // A line of units below the header.
    let found = good("t|p\ns|mm\n0|1\n", &["time=#1", "position=#2[mm]", "skip_lines=2", "delimiter=|"]);
    assert_eq!(found.position, Some(vec![0.001]));
}

#[test]
fn an_error_of_a_missing_column_lists_the_columns() {
    assert_eq!(
        error("time,Positon,i\n0,0,0\n", &[]),
        "r.csv:1: there is no column \"x.position\" or \"position\" for position; there are time, Positon, i; \
         the nearest is Positon; time and position are required: select a column by --column CHANNEL=COLUMN[UNIT]"
    );
    assert_eq!(
        error("time,y.position,y.current\n0,0,0\n", &[]),
        "r.csv:1: the file has no columns of axis x; there are the axes y: select one by --joint"
    );
    // Setpoints, not a recording.
    let message = error("time,x,y\n0,0,0\n", &[]);
    assert!(message.contains("there are time, x, y; the nearest is x"), "{message}");
    assert!(error("k,position\n0,0\n", &[]).starts_with("r.csv:1: there is no column \"time\" for time;"));
    let message = error("time,position,current_A\n0,0,0\n", &["current=current_a[A]"]);
    assert!(
        message.starts_with(
            "r.csv:1: there is no column \"current_a\" or \"current_a[A]\" for current; there are time, position, \
             current_A; the nearest is current_A"
        ),
        "{message}"
    );
    let message = error("time,position\n0,0\n", &["current=#3"]);
    assert!(
        message.starts_with("r.csv:1: there is no column \"#3\" for current; there are time"),
        "{message}"
    );
    assert_eq!(
        error("time,p,p\n0,0,0\n", &["position=p"]),
        "r.csv:1: 2 columns have the header \"p\"; select the column of position by number, for example #3"
    );
    assert_eq!(
        error("time,position\n0,0\n", &["psec=position"]),
        "r.csv:1: psec and position both use column #2"
    );
    let preamble = error("Trace of today\nby me\ntime;position\n0;0\n", &[]);
    assert!(preamble.ends_with("; line 3 contains the required columns: set skip_lines=2"), "{preamble}");
    let bare = error("0.1,0.2\n0.2,0.3\n", &[]);
    assert!(
        bare.ends_with("; for a file without a header select columns by number: time=#1, position=#2"),
        "{bare}"
    );
    // In a trace, only trace headers are used.
    assert_eq!(good("time,x.position,current\n0,1,2\n", &[]).current, None);
}

#[test]
fn default_columns_beside_a_mapping_are_reported() {
    let (found, findings) = read("t,position,velocity\n1000,2,3\n", &["time=t[ms]"]).expect("good");
    assert_eq!((found.time, found.velocity), (vec![1.0], Some(vec![3.0])));
    let [finding] = findings.as_slice() else { panic!("one: {findings:?}") };
    assert_eq!(finding.code, "usual-columns");
    assert_eq!(
        finding.what,
        "r.csv: channels without a mapping use default columns: position from column position in m, velocity \
         from column velocity in m/s"
    );
}

#[test]
fn errors_name_their_lines() {
    assert_eq!(error("", &[]), "r.csv: the file is empty");
    assert_eq!(error("\n \n", &[]), "r.csv: the file is empty");
    assert_eq!(error("time,position\n", &[]), "r.csv: no row below the header");
    assert_eq!(error("a\nb\n", &["skip_lines=2"]), "r.csv: no line after the skipped lines");
    assert_eq!(
        error("time,position,current\n0,0,0\n1,0", &[]),
        "r.csv:3: 2 values, 3 columns; this is the last line: the file is truncated"
    );
    assert_eq!(error("time,position,current\n0,0\n1,0,0\n", &[]), "r.csv:2: 2 values, 3 columns");
    assert_eq!(
        error("time,position\n0,049,0,00138\n", &[]),
        "r.csv:2: 4 values, 2 columns; if the numbers have decimal commas, the delimiter must be another \
         character"
    );
    assert_eq!(
        error("time;position\n0;0\n0,5;1\n", &[]),
        "r.csv:3: time is \"0,5\", must be a finite number; set --column decimal_comma=true for decimal commas"
    );
    assert_eq!(
        error("time;position\n0;1.234,5\n", &["decimal_comma=true"]),
        "r.csv:2: position is \"1.234,5\", must be a finite number, empty or NaN"
    );
    assert_eq!(
        error("time;position\n0;1.5\n", &["decimal_comma=true"]),
        "r.csv:2: position is \"1.5\", must be a finite number, empty or NaN; decimal_comma=true requires \
         decimal commas"
    );
    for time in ["", "nan", "inf", "1e999", "now"] {
        assert_eq!(
            error(format!("time,position\n{time},0\n"), &[]),
            format!("r.csv:2: time is \"{time}\", must be a finite number")
        );
    }
    for position in ["inf", "-1e999", "?"] {
        assert_eq!(
            error(format!("time,position\n0,{position}\n"), &[]),
            format!("r.csv:2: position is \"{position}\", must be a finite number, empty or NaN")
        );
    }
    assert_eq!(error("time,position\n0,\n1,nan\n", &[]), "r.csv: position has no value in any of 2 rows");
    assert_eq!(
        error(b"time,position\n0,0\n\xff\xfe,1\n", &[]),
        "r.csv:3: time is \"ÿþ\", must be a finite number"
    );
    assert_eq!(
        error("time,position\n0,0\0\n", &[]),
        "r.csv:2: the line contains zero bytes; a recording is text (CSV) or MCAP"
    );
}

#[test]
fn an_empty_channel_and_a_missing_last_line_break_are_reported() {
    let (found, findings) = read("time,position,current\n0,1,\n1,2,\n2,3,", &[]).expect("good");
    assert_eq!((found.time.len(), found.current), (3, None));
    let codes: Vec<_> = findings.iter().map(|finding| finding.code).collect();
    assert_eq!(codes, ["unended", "empty-channel"]);
    assert!(findings[0].what.starts_with("r.csv:4: "), "{}", findings[0]);
}

/// Reader of a header and an endless number of equal rows.
struct Endless(usize);

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let text: &[u8] = if self.0 == 0 { b"time,position\n" } else { b"0,0\n" };
        self.0 += 1;
        let rows = buffer.len() / text.len() * text.len();
        let length = if self.0 == 1 { text.len() } else { rows };
        for (k, byte) in buffer[..length].iter_mut().enumerate() {
            *byte = text[k % text.len()];
        }
        Ok(length)
    }
}

#[test]
fn an_endless_file_is_rejected() {
    let mill = mill();
    let options = RecordingOptions::default();
    let error = read_recording_csv(Endless(0), "r.csv", axis(mill, "x"), &options).expect_err("too long");
    assert_eq!(error.to_string(), "r.csv:10000002: more than 10000000 samples; split the recording");
}

#[test]
fn files_of_other_kinds_are_rejected() {
    let folder = TestFolder::new("recording_kinds");
    let mill = mill();
    let message_of = |name: &str, text: &str, texts: &[&str]| {
        let path = folder.file(name, text);
        let error = read_recording(&path, axis(mill, "x"), &options(texts)).expect_err("no recording");
        error.to_string().replace(&*path.to_string_lossy(), name)
    };
    let end = ", must be a recording (CSV with columns of time and position, or MCAP)";
    let psec = "joint_names: [x]\npoints:\n- {positions: [0.0], time_from_start: {sec: 1}}\n";
    assert_eq!(message_of("p.yaml", psec, &[]), format!("p.yaml: the file is setpoints as YAML{end}"));
    assert_eq!(
        message_of("p.yaml", psec, &["time=#1", "position=#2"]),
        format!("p.yaml: the file is setpoints as YAML{end}")
    );
    let scenario = include_str!("../../../../config/scenarios/ballbar.yaml");
    assert_eq!(message_of("s.yaml", scenario, &[]), format!("s.yaml: the file is a scenario{end}"));
    let machine = include_str!("../../../../config/mikron_ucp710.yaml");
    assert_eq!(message_of("m.yaml", machine, &[]), format!("m.yaml: the file is a machine file{end}"));
    assert!(message_of("t.txt", "some text\nof no use\n", &[]).starts_with("t.txt:1: there is no column"));
    assert_eq!(message_of("e.csv", "", &[]), "e.csv: the file is empty");
    let path = folder.file("r.csv", "time,position\n0,1\n");
    let (found, _) = read_recording(&path, axis(mill, "x"), &options(&[])).expect("good");
    assert_eq!((found.name, found.position), (path.display().to_string(), Some(vec![1.0])));
    let missing = read_recording("no/such.csv".as_ref(), axis(mill, "x"), &options(&[]));
    assert!(missing.expect_err("not there").to_string().starts_with("no/such.csv: "));
    assert!(read_recording(&folder.0, axis(mill, "x"), &options(&[])).is_err(), "a folder");
}

/// Returns a strategy of texts similar to recordings.
fn any_csv() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        Just("time,position\n".to_owned()),
        Just("time;x.position;x.current\n".to_owned()),
        "[-+0-9.,;\"nafie \t\r\n]{0,20}",
        "(-?[0-9]{1,3}(\\.[0-9]{1,3})?[,;]){1,3}[0-9]\n",
        any::<String>(),
    ];
    let text = prop::collection::vec(piece, 0..8).prop_map(|pieces| pieces.concat().into_bytes());
    prop_oneof![4 => text, 1 => prop::collection::vec(any::<u8>(), 0..200)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn accepted_recordings_are_complete_for_any_bytes(
        bytes in any_csv(),
        mapping in prop_oneof![
            Just(&[][..]),
            Just(&["time=#1", "position=#2[mm]"][..]),
            Just(&["time=#2[ms]", "position=#1", "decimal_comma=true"][..]),
            Just(&["skip_lines=1", "current=[N.m]"][..]),
        ],
    ) {
        if let Ok((found, _)) = read(bytes, mapping) {
            let rows = found.time.len();
            prop_assert!(rows > 0 && found.time.iter().all(|time| time.is_finite()));
            prop_assert!(found.position.is_some());
            let channels = [found.psec, found.position, found.velocity, found.current];
            for values in channels.into_iter().flatten() {
                prop_assert!(values.len() == rows && values.iter().all(|value| !value.is_infinite()));
            }
        }
    }

    #[test]
    fn no_mapping_causes_a_panic(text in "([a-z_]{0,9}|time|position|delimiter|skip_lines)=?[-#A-Za-z0-9. \\[\\];,°µ]{0,12}") {
        let mut columns = Columns::default();
        _ = columns.set(&text, "--column");
        _ = Columns::from_yaml(&text.replace('=', ": "), "m.yaml");
        let options = RecordingOptions { columns, ..RecordingOptions::default() };
        let mill = mill();
        _ = read_recording_csv(&b"time,position\n0,0\n"[..], "r.csv", axis(mill, "x"), &options);
    }

    #[test]
    fn numbers_are_read_bit_for_bit(
        rows in prop::collection::vec((-1e9_f64..1e9, prop::num::f64::NORMAL), 1..50),
    ) {
        let mut text = "time,position\n".to_owned();
        for (time, position) in &rows {
            text += &format!("{time},{position}\n");
        }
        let (found, _) = read(&text, &[]).expect("good");
        let (time, position): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
        prop_assert_eq!(found.time, time);
        prop_assert_eq!(found.position, Some(position));
    }
}
