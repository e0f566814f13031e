//! Recordings of one axis from CSV.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::io::{self, Read};
use std::sync::LazyLock;

use proptest::prelude::*;
use virtual_axes_core::config::{AxisConfig, MachineConfig, Parameters};
use virtual_axes_core::machine::AxisSample;
use virtual_axes_identify::recording::{Finding, RawRecording};
use virtual_axes_io::files::{
    AxisRecordingError, Columns, RecordingOptions, TraceCsv, read_recording, read_recording_csv,
};
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Screws of 20 mm on x, 2.64 N·m/A; a gear of 180 on a, 0.88 N·m/A.
fn mill() -> &'static MachineConfig {
    static MILL: LazyLock<MachineConfig> =
        LazyLock::new(|| Parameters::embedded_default().expect("shipped").machine_config().expect("valid"));
    &MILL
}

/// A linear motor of 70 N/A on x.
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

type Outcome = Result<(RawRecording, Vec<Finding>), AxisRecordingError>;

fn read(bytes: impl AsRef<[u8]>, texts: &[&str]) -> Outcome {
    read_recording_csv(bytes.as_ref(), "r.csv", axis(mill(), "x"), &options(texts))
}

#[track_caller]
fn good(text: &str, texts: &[&str]) -> RawRecording {
    let (recording, findings) = read(text, texts).expect("good");
    assert_eq!(findings, [], "nothing to say");
    recording
}

#[track_caller]
fn error(bytes: impl AsRef<[u8]>, texts: &[&str]) -> String {
    read(bytes, texts).expect_err("must be refused").to_string()
}

/// The one value of a channel of that axis, recorded as `number` of `unit`.
fn value(axis: &AxisConfig, channel: &str, number: &str, unit: &str) -> Result<f64, AxisRecordingError> {
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
fn a_refusal_names_a_unit_in_one_line() {
    for text in ["position=act [m\0m]", "position=act [1\0 mm]"] {
        let text = Columns::default().set(text, "--column").expect_err("must be refused").to_string();
        assert!(!text.contains(char::is_control), "{text:?}");
    }
}

#[test]
fn a_refusal_names_a_column_in_one_line() {
    let text = error("{time: p1\u{c}osition: \"#2\"}\n0 0\n", &[]);
    assert!(!text.contains(char::is_control) && text.contains("the nearest is"), "{text:?}");
}

#[test]
fn each_unit_is_worth_what_it_is() {
    let (mill, linear) = (mill(), linear());
    let (x, a, lx) = (axis(mill, "x"), axis(mill, "a"), axis(&linear, "x"));
    // Axis, channel, unit, number, value in SI by hand.
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
fn a_unit_that_does_not_fit_is_refused_with_those_that_do() {
    let (mill, linear) = (mill(), linear());
    let (x, a, lx) = (axis(mill, "x"), axis(mill, "a"), axis(&linear, "x"));
    let said = |axis, channel, unit| value(axis, channel, "1", unit).expect_err("does not fit").to_string();
    assert_eq!(
        said(x, "position", "[deg]"),
        "--column: position in [deg]: must be in m, mm, um on the linear axis x"
    );
    assert_eq!(
        said(a, "velocity", "[m/min]"),
        "--column: velocity in [m/min]: must be in rad/s, deg/s, deg/min, rpm on the rotary axis a"
    );
    assert_eq!(
        said(x, "time", "[mm]"),
        "--column: time in [mm]: must be in s, ms, us, ns on the linear axis x"
    );
    assert_eq!(
        said(a, "current", "[N]"),
        "--column: current in [N]: must be in A, mA, N.m on the rotary axis a"
    );
    assert_eq!(
        said(lx, "current", "[N.m]"),
        "--column: current in [N.m]: must be in A, mA, N on the linear axis x"
    );
    assert_eq!(
        said(lx, "velocity_feedforward", "[rpm]"),
        "--column: velocity_feedforward in [rpm]: must be in m/s, mm/s, m/min, mm/min on the linear axis x"
    );
    assert_eq!(
        said(a, "velocity_feedforward", "[deg/s]"),
        "--column: velocity_feedforward in [deg/s]: must be in rad/s, rpm on the rotary axis a"
    );
    assert_eq!(
        said(x, "torque_feedforward", "[mm]"),
        "--column: torque_feedforward in [mm]: must be in N.m, N, A, mA on the linear axis x"
    );
}

#[test]
fn a_mapping_that_cannot_be_is_refused() {
    let said = |text: &str| Columns::read(None, &[text], "--column").expect_err("cannot be").to_string();
    assert_eq!(
        said("position"),
        "--column: \"position\" maps nothing, must be CHANNEL=COLUMN[UNIT] as in position=Pos1[mm]"
    );
    assert_eq!(
        said("positon=p"),
        "--column: there is no \"positon\"; there are time, psec, position, velocity, current, \
         velocity_feedforward, torque_feedforward, delimiter, decimal_comma, skip_lines; the nearest is position"
    );
    assert_eq!(said("time="), "--column: time=: there is no column");
    for wrong in ["#0", "#", "#x", "#-1", "#1.5"] {
        let wanted =
            format!("--column: time={wrong}: a column's number is whole and begins with 1, as in #3");
        assert_eq!(said(&format!("time={wrong}")), wanted);
    }
    let message = said("time=t[sec]");
    assert!(
        message.starts_with("--column: time=t[sec]: there is no unit \"sec\"; there are s, ms, us, ns, ")
    );
    for wrong in ["0", "nan", "inf", "1e999", "one"] {
        assert_eq!(
            said(&format!("time=t[{wrong} s]")),
            format!(
                "--column: time=t[{wrong} s]: the factor \"{wrong}\" is not a finite number other than 0"
            )
        );
    }
    assert!(said("time=t[]").contains("there is no unit \"\""));
    assert!(said("delimiter=ab").contains("must be one character"));
    assert!(said("delimiter=5").contains("must be one character"));
    assert_eq!(said("decimal_comma=yes"), "--column: decimal_comma=yes: must be true or false");
    assert_eq!(said("skip_lines=-1"), "--column: skip_lines=-1: must be a number of lines, 0 or more");
    let twice = Columns::read(None, &["time=t", "time=u"], "--column").expect_err("which?").to_string();
    assert_eq!(twice, "--column: time is given twice");
    let comma = Columns::read(None, &["delimiter=,", "decimal_comma=true"], "--column");
    assert_eq!(
        comma.expect_err("which?").to_string(),
        "--column: decimal_comma=true: a comma cannot be both between numbers and in them"
    );
}

#[test]
fn a_mapping_comes_from_yaml_and_the_command_line_goes_before_it() {
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

    let said = |text: &str| Columns::from_yaml(text, "m.yaml").expect_err("cannot be").to_string();
    let message = said("time: t\npositon: p\n");
    assert!(
        message.starts_with("m.yaml:2: unknown field positon") && message.contains("nearest is position")
    );
    // In YAML, what stands behind # is a comment.
    let message = said("time: #1\nposition: p\n");
    assert!(message.contains("there is no value") && message.contains("quotation marks"), "{message}");
    assert!(said("time: [ms]\n").contains("a text"), "{}", said("time: [ms]\n"));
    assert!(said("time: t\ntime: u\n").contains("duplicate key time"));
    assert!(said("").contains("not one mapping"));
    assert_eq!(said("time: t[mm/h]\n").find("m.yaml: time=t[mm/h]: there is no unit \"mm/h\""), Some(0));
    let missing = Columns::open("no/such.yaml".as_ref()).expect_err("not there").to_string();
    assert!(missing.starts_with("no/such.yaml: "), "{missing}");
}

#[test]
fn a_trace_of_the_project_needs_no_mapping() {
    let joints = ["x".to_owned(), "y".to_owned()];
    let mut trace = TraceCsv::new(Vec::new(), &joints).expect("in memory");
    for k in 0..3 {
        let v = f64::from(k);
        let sample = |v: f64| AxisSample {
            psec: v,
            position: 0.1 * v,
            velocity: 0.2 * v,
            current: 0.3 * v,
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
        ..RawRecording::default()
    };
    assert_eq!(good(&text, &[]), by_hand);
    let of_y = RecordingOptions { joint: Some("y".to_owned()), ..RecordingOptions::default() };
    let mill = mill();
    let (y, _) = read_recording_csv(text.as_bytes(), "r.csv", axis(mill, "x"), &of_y).expect("good");
    assert_eq!(y.psec, Some(vec![-7.0; 3]));
}

#[test]
fn plain_headers_need_no_mapping() {
    let text =
        "\u{feff}\"time\", position ,note,current,psec,velocity\r\n0,1,9,2,3,4\r\n\r\n0.5,5,9,,nan,6\r\n";
    let found = good(text, &[]);
    assert_eq!(found.time, [0.0, 0.5]);
    assert_eq!((found.position, found.velocity), (Some(vec![1.0, 5.0]), Some(vec![4.0, 6.0])));
    let (current, psec) = (found.current.expect("there"), found.psec.expect("there"));
    assert!(current[0] == 2.0 && current[1].is_nan() && psec[0] == 3.0 && psec[1].is_nan());
    assert_eq!((found.velocity_feedforward, found.torque_feedforward), (None, None));
    // Stamps may leap and repeat: that is dealt with later.
    assert_eq!(good("time,position\n3,0\n1,0\n1,0\n", &[]).time, [3.0, 1.0, 1.0]);
}

#[test]
fn what_an_oscilloscope_writes_is_read() {
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
    // No header at all.
    let found = good("0;1;2\n1;3;4\n", &["time=#1", "position=#3[mm]"]);
    assert_eq!((found.time, found.position), (vec![0.0, 1.0], Some(vec![0.002, 0.004])));
    // A line of units below the header.
    let found = good("t|p\ns|mm\n0|1\n", &["time=#1", "position=#2[mm]", "skip_lines=2", "delimiter=|"]);
    assert_eq!(found.position, Some(vec![0.001]));
}

#[test]
fn columns_that_are_not_found_are_told_with_those_there_are() {
    assert_eq!(
        error("time,Position,i\n0,0,0\n", &[]),
        "r.csv:1: there is no column \"x.position\" or \"position\" for position; there are time, Position, i; \
         the nearest is Position; time and position are needed: name a column by CHANNEL=COLUMN[UNIT]"
    );
    assert_eq!(
        error("time,y.position,y.current\n0,0,0\n", &[]),
        "r.csv:1: there is no column \"x.position\" or \"position\" for position; there are time, y.position, \
         y.current; the nearest is y.position; time and position are needed: name a column by \
         CHANNEL=COLUMN[UNIT]"
    );
    // Setpoints, not a recording.
    let message = error("time,x,y\n0,0,0\n", &[]);
    assert!(message.contains("there are time, x, y; the nearest is x"), "{message}");
    assert!(error("t,position\n0,0\n", &[]).starts_with("r.csv:1: there is no column \"time\" for time;"));
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
        "r.csv:1: 2 columns are called \"p\"; name the one of position by its number, as in #3"
    );
    assert_eq!(
        error("time,position\n0,0\n", &["psec=position"]),
        "r.csv:1: psec and position are both column #2"
    );
    let preamble = error("Trace of today\nby me\ntime;position\n0;0\n", &[]);
    assert!(preamble.ends_with("; line 3 has all that is needed: skip_lines=2"), "{preamble}");
    let bare = error("0.1,0.2\n0.2,0.3\n", &[]);
    assert!(bare.ends_with("; without a header, by numbers: time=#1, position=#2"), "{bare}");
    // A channel of a trace is not filled with a column of another origin.
    assert_eq!(good("time,x.position,current\n0,1,2\n", &[]).current, None);
}

#[test]
fn what_was_not_named_but_taken_is_said() {
    let (found, findings) = read("t,position,velocity\n1000,2,3\n", &["time=t[ms]"]).expect("good");
    assert_eq!((found.time, found.velocity), (vec![1.0], Some(vec![3.0])));
    let [finding] = findings.as_slice() else { panic!("one: {findings:?}") };
    assert_eq!(finding.code, "usual-columns");
    assert_eq!(
        finding.what,
        "r.csv: not named and taken as usual: position from column position in m, velocity from column velocity \
         in m/s"
    );
}

#[test]
fn faults_are_told_with_their_lines() {
    assert_eq!(error("", &[]), "r.csv: the file is empty");
    assert_eq!(error("\n \n", &[]), "r.csv: the file is empty");
    assert_eq!(error("time,position\n", &[]), "r.csv: no row below the header");
    assert_eq!(error("a\nb\n", &["skip_lines=2"]), "r.csv: no line after those to skip");
    assert_eq!(
        error("time,position,current\n0,0,0\n1,0", &[]),
        "r.csv:3: 2 values, 3 columns; it is the last line: the file was cut off"
    );
    assert_eq!(error("time,position,current\n0,0\n1,0,0\n", &[]), "r.csv:2: 2 values, 3 columns");
    assert_eq!(
        error("time,position\n0,049,0,00138\n", &[]),
        "r.csv:2: 4 values, 2 columns; do the numbers have decimal commas? then something else must stand \
         between them"
    );
    assert_eq!(
        error("time;position\n0;0\n0,5;1\n", &[]),
        "r.csv:3: time is \"0,5\", must be a finite number; decimal commas are told by decimal_comma=true"
    );
    assert_eq!(
        error("time;position\n0;1.234,5\n", &["decimal_comma=true"]),
        "r.csv:2: position is \"1.234,5\", must be a finite number, or nothing or NaN"
    );
    assert_eq!(
        error("time;position\n0;1.5\n", &["decimal_comma=true"]),
        "r.csv:2: position is \"1.5\", must be a finite number, or nothing or NaN; it was said that decimals \
         stand behind a comma (decimal_comma)"
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
            format!("r.csv:2: position is \"{position}\", must be a finite number, or nothing or NaN")
        );
    }
    assert_eq!(error("time,position\n0,\n1,nan\n", &[]), "r.csv: position has no value in any of 2 rows");
    assert_eq!(
        error(b"time,position\n0,0\n\xff\xfe,1\n", &[]),
        "r.csv:3: stream did not contain valid UTF-8; a recording is text in UTF-8 (CSV) or MCAP"
    );
    let utf16: Vec<u8> = "time,position\n0,0\n".bytes().flat_map(|byte| [byte, 0]).collect();
    assert_eq!(
        error(utf16, &[]),
        "r.csv:1: there are bytes of zero; a recording is text in UTF-8 (CSV) or MCAP"
    );
}

#[test]
fn a_channel_without_values_and_a_last_line_without_end_are_said() {
    let (found, findings) = read("time,position,current\n0,1,\n1,2,\n2,3,", &[]).expect("good");
    assert_eq!((found.time.len(), found.current), (3, None));
    let codes: Vec<_> = findings.iter().map(|finding| finding.code).collect();
    assert_eq!(codes, ["unended", "empty-channel"]);
    assert!(findings[0].what.starts_with("r.csv:4: "), "{}", findings[0]);
}

/// A header, then the same row for ever.
struct Endless(usize);

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let text: &[u8] = if self.0 == 0 { b"time,position\n" } else { b"0,0\n" };
        self.0 += 1;
        let whole = buffer.len() / text.len() * text.len();
        let length = if self.0 == 1 { text.len() } else { whole };
        for (k, byte) in buffer[..length].iter_mut().enumerate() {
            *byte = text[k % text.len()];
        }
        Ok(length)
    }
}

#[test]
fn a_file_without_end_is_given_up() {
    let mill = mill();
    let options = RecordingOptions::default();
    let error = read_recording_csv(Endless(0), "r.csv", axis(mill, "x"), &options).expect_err("too long");
    assert_eq!(error.to_string(), "r.csv:10000002: more than 10000000 samples; cut it into parts");
}

#[test]
fn a_file_of_another_kind_is_told() {
    let folder = TestFolder::new("recording_kinds");
    let mill = mill();
    let said = |name: &str, text: &str, texts: &[&str]| {
        let path = folder.file(name, text);
        let error = read_recording(&path, axis(mill, "x"), &options(texts)).expect_err("no recording");
        error.to_string().replace(&*path.to_string_lossy(), name)
    };
    let end = ", not a recording (CSV with a column of time and one of positions, or MCAP)";
    let psec = "joint_names: [x]\npoints:\n- {positions: [0.0], time_from_start: {sec: 1}}\n";
    assert_eq!(said("p.yaml", psec, &[]), format!("p.yaml: it is setpoints as YAML{end}"));
    assert_eq!(
        said("p.yaml", psec, &["time=#1", "position=#2"]),
        format!("p.yaml: it is setpoints as YAML{end}")
    );
    let scenario = include_str!("../../../../config/scenarios/ballbar.yaml");
    assert_eq!(said("s.yaml", scenario, &[]), format!("s.yaml: it is a scenario{end}"));
    let machine = include_str!("../../../../config/mikron_ucp710.yaml");
    assert_eq!(said("m.yaml", machine, &[]), format!("m.yaml: it is a machine file{end}"));
    assert!(said("t.txt", "some text\nof no use\n", &[]).starts_with("t.txt:1: there is no column"));
    assert_eq!(said("e.csv", "", &[]), "e.csv: the file is empty");
    let path = folder.file("r.csv", "time,position\n0,1\n");
    let (found, _) = read_recording(&path, axis(mill, "x"), &options(&[])).expect("good");
    assert_eq!((found.name, found.position), (path.display().to_string(), Some(vec![1.0])));
    let missing = read_recording("no/such.csv".as_ref(), axis(mill, "x"), &options(&[]));
    assert!(missing.expect_err("not there").to_string().starts_with("no/such.csv: "));
    assert!(read_recording(&folder.0, axis(mill, "x"), &options(&[])).is_err(), "a folder");
}

/// Texts near to recordings.
fn scribble() -> impl Strategy<Value = Vec<u8>> {
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
    fn what_is_read_is_whole_whatever_the_bytes(
        bytes in scribble(),
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
    fn no_mapping_does_harm(text in "([a-z_]{0,9}|time|position|delimiter|skip_lines)=?[-#A-Za-z0-9. \\[\\];,°µ]{0,12}") {
        let mut columns = Columns::default();
        _ = columns.set(&text, "--column");
        _ = Columns::from_yaml(&text.replace('=', ": "), "m.yaml");
        let options = RecordingOptions { columns, ..RecordingOptions::default() };
        let mill = mill();
        _ = read_recording_csv(&b"time,position\n0,0\n"[..], "r.csv", axis(mill, "x"), &options);
    }

    #[test]
    fn numbers_come_through_bit_for_bit(
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
