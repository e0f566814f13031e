//! Recordings of Sinumerik Edge.

use super::recording_columns::{Recorded, axis, summary};
use virtual_axes_identify::recording::Severity;
use virtual_axes_io::files::RecordingFormat;

/// Excerpt of `example/example_data_ff429d74-6482-4d4f-80e1-31419d9bd56c.json` of
/// <https://github.com/max-scw/CaptureDataParser>: the signals of the axes X1 and Y1 and some others, six rows in two
/// items of the Payload, and the item between them.
pub(crate) const EXCERPT: &str = r#"{
"Header":
{
  "Version" : {
    "outputFileFormatVersion" : "1.0",
    "RecorderVersion" : "3.1.0-36"
  },
  "Format" : "DEFAULT",
  "Description" : null,
  "MachineInfo" : {
    "MachineName" : "sinumerik_adapter_840Dsl",
    "CFCard" : "SPG2001035347030"
  },
  "SignalListHFData" : [ {
    "Name" : "CYCLE",
    "Type" : "INTEGER",
    "Axis" : "Cycle",
    "Address" : "CYCLE"
  }, {
    "Name" : "VEL_FFW|1",
    "Type" : "DOUBLE",
    "Axis" : "X1",
    "Address" : "VEL_FFW|1"
  }, {
    "Name" : "VEL_FFW|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "VEL_FFW|2"
  }, {
    "Name" : "TORQUE_FFW|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "TORQUE_FFW|2"
  }, {
    "Name" : "TORQUE|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "TORQUE|2"
  }, {
    "Name" : "POWER|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "POWER|2"
  }, {
    "Name" : "CURRENT|1",
    "Type" : "DOUBLE",
    "Axis" : "X1",
    "Address" : "CURRENT|1"
  }, {
    "Name" : "CURRENT|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "CURRENT|2"
  }, {
    "Name" : "ENC_POS|1",
    "Type" : "DOUBLE",
    "Axis" : "X1",
    "Address" : "ENC_POS|1"
  }, {
    "Name" : "ENC_POS|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "ENC_POS|2"
  }, {
    "Name" : "DES_POS|1",
    "Type" : "DOUBLE",
    "Axis" : "X1",
    "Address" : "DES_POS|1"
  }, {
    "Name" : "DES_POS|2",
    "Type" : "DOUBLE",
    "Axis" : "Y1",
    "Address" : "DES_POS|2"
  } ],
  "SignalListExternalData" : [ ],
  "TimeStamp" : "2023-12-21T19:23:37.192824Z",
  "CycleTimeMs" : 2,
  "Initial" : {
    "Time" : "2023-12-22T14:25:56.836Z",
    "HFProbeCounter" : 5555962
  },
  "Metadata" : [ ]
}
,"Payload":
[{"HFData":[[5563833,-0.0,46.802686,0.0,-39.281791,912.393768,0.89209,-28.095703,-61.888574,451.09415,-61.889124,451.439545],[5563834,-0.0,49.202351,0.0,-39.764647,988.240682,0.857483,-28.603271,-61.888555,451.173584,-61.889124,451.537945],[5563835,-0.0,51.602057,0.0,-38.564607,1039.548889,0.876709,-28.326416,-61.888535,451.257598,-61.889124,451.641145],[5563836,-0.0,54.001801,0.0,-38.039146,1068.54918,0.907471,-27.557373,-61.888691,451.34624,-61.889124,451.749145]]},
{"HFTimestamp":{"Time":"2023-12-22T14:26:04.621Z","HFProbeCounter":5563855}},
{"HFData":[[5563855,-0.0,99.600143,0.0,-38.884144,2210.714483,0.919006,-28.264893,-61.889053,453.942471,-61.889124,454.713145],[5563856,-0.0,102.000125,0.0,-39.224984,2264.253482,0.922851,-28.213623,-61.889229,454.127393,-61.889124,454.917145]]}
],
"Footer":
{
  "ErrorMessages" : [ ]
}}"#;

/// Tolerance of conversions, relative.
const TOLERANCE: f64 = 1e-12;

#[track_caller]
fn assert_close(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() <= TOLERANCE * wanted.abs(), "{found} for {wanted}");
    }
}

#[test]
fn the_columns_have_axes_with_names_and_numbers() {
    let found = Recorded::new("edge", EXCERPT).inspect();
    assert_eq!((found.format, found.columns.len()), (RecordingFormat::SinumerikEdge, 12));
    assert_eq!((found.axes(), found.has_time()), (vec!["X1".to_owned(), "Y1".to_owned()], true));
    let without_period = EXCERPT.replace("\"CycleTimeMs\" : 2,", "");
    assert!(!Recorded::new("edge", without_period).inspect().has_time());
    assert_eq!(found.columns[1].axis_number.as_deref(), Some("1"));
    let columns: Vec<String> = found.columns.iter().map(summary).collect();
    assert_eq!(
        columns,
        [
            "time [samples]",
            "velocity_feedforward [mm/s or deg/s of the axis] X1",
            "velocity_feedforward [mm/s or deg/s of the axis] Y1",
            "torque_feedforward [N.m] Y1",
            "torque [N.m] Y1",
            "- Y1",
            "current [A] X1",
            "current [A] Y1",
            "position [mm or deg] X1",
            "position [mm or deg] Y1",
            "psec [mm or deg] X1",
            "psec [mm or deg] Y1",
        ]
    );
}

#[test]
fn the_axis_is_selected_by_its_name_or_number() {
    let y = Recorded::new("edge", EXCERPT).good("y");
    // Cycles of 2 ms; cycles 3 to 21 are missing.
    assert_close(&y.time, &[0.0, 0.002, 0.004, 0.006, 0.044, 0.046]);
    let psec = y.psec.expect("there");
    assert_close(&psec, &[0.451439545, 0.451537945, 0.451641145, 0.451749145, 0.454713145, 0.454917145]);
    assert_close(&y.position.expect("there")[..2], &[0.45109415, 0.451173584]);
    let current = y.current.expect("there");
    assert_close(&current[..2], &[-28.095703, -28.603271]);
    // TORQUE beside CURRENT tells the torque constant; without it, it is the current.
    let torque = y.torque.expect("there");
    let without = EXCERPT.replace("\"CURRENT|2\"", "\"LOAD|2\"");
    let without = Recorded::new("edge", without).good("y");
    let constant = axis("y").motor.torque_constant;
    assert_close(&without.current.expect("there")[..1], &[torque[0] / constant]);
    assert!(without.torque.is_none());
    assert_eq!(y.torque_feedforward, Some(vec![0.0; 6]));
    // The velocity feedforward is the speed of the setpoint, in rad/s of the motor.
    let feedforward = y.velocity_feedforward.expect("there");
    let speed = feedforward[1] * axis("y").transmission_ratio;
    assert!((speed - (psec[1] - psec[0]) / 0.002).abs() < 1e-5, "{speed}");

    for joint in ["X1", "x1", "x", "1"] {
        let x = Recorded::new("edge", EXCERPT).joint(joint).good("y");
        assert_close(&x.position.expect("there")[..1], &[-0.061888574]);
    }
    assert_eq!(
        Recorded::new("edge", EXCERPT).error("c"),
        "r: the file has no columns of axis c; there are the axes X1, Y1: select one by --joint"
    );
    // Degrees of a rotary axis.
    let rotary = Recorded::new("edge", EXCERPT).joint("Y1").good("c");
    assert_close(&rotary.position.expect("there")[..1], &[451.09415_f64.to_radians()]);
    let speed = rotary.velocity_feedforward.expect("there")[0] * axis("c").transmission_ratio;
    assert!((speed - 46.802686_f64.to_radians()).abs() < 1e-9, "{speed}");
}

#[test]
fn a_mapping_and_a_sampling_rate_take_precedence() {
    let mapped = Recorded::new("edge", EXCERPT).columns(&["position=DES_POS|2[mm]", "psec=ENC_POS|2[mm]"]);
    assert_close(&mapped.good("y").position.expect("there")[..1], &[0.451439545]);
    assert_close(&Recorded::new("edge", EXCERPT).rate(1000.0).good("y").time[..2], &[0.0, 0.001]);
    let warned = |rate: f64| {
        let (_, findings) = Recorded::new("edge", EXCERPT).rate(rate).read("y").expect("good");
        findings.iter().any(|finding| finding.code == "rate-differs" && finding.severity == Severity::Warning)
    };
    assert!(warned(1000.0) && !warned(500.0));
    let without_period = EXCERPT.replace("\"CycleTimeMs\" : 2,", "");
    let error = Recorded::new("edge", &without_period).error("y");
    assert!(
        error.ends_with("give the sampling rate by --rate-hz, since column CYCLE counts samples"),
        "{error}"
    );
    assert_close(&Recorded::new("edge", &without_period).rate(500.0).good("y").time[..2], &[0.0, 0.002]);
}

#[test]
fn malformed_documents_are_rejected_with_their_line() {
    let error = |text: &str| Recorded::new("edge", text).format(RecordingFormat::SinumerikEdge).error("y");
    let start = "r:85: not a recording of the format sinumerik-edge: ";
    let short = error(&EXCERPT.replace(",451.537945]", "]"));
    assert_eq!(short, format!("{start}a row has 11 values, the header 12 signals"));
    let text = error(&EXCERPT.replace(",451.537945]", ",\"451\"]"));
    assert_eq!(text, format!("{start}invalid type: string \"451\", expected f64"));
    let cycle = error(&EXCERPT.replace("[5563834", "[null"));
    assert_eq!(cycle, format!("{start}a row has no cycle number, must be a number"));
    // Other values may be missing.
    let missing = EXCERPT.replace(",451.173584,", ",null,");
    assert!(Recorded::new("edge", missing).good("y").position.expect("there")[1].is_nan());
    let truncated = error(&EXCERPT[..EXCERPT.len() - 300]);
    assert!(truncated.starts_with("r:8") && truncated.contains("EOF while parsing"), "{truncated}");
    for (text, reason) in [
        ("", "EOF while parsing a value"),
        ("[]", "expected an object with Header and Payload"),
        ("{\"Payload\": []}", "the Payload is in front of the Header"),
        ("{\"Header\": {}}", "missing field `SignalListHFData`"),
        ("{\"Footer\": {}}", "there is no Header with SignalListHFData"),
    ] {
        let message = error(text);
        assert!(message.starts_with("r:1: ") && message.contains(reason), "{message}");
    }
    let empty = "{\"Header\": {\"SignalListHFData\": [{\"Address\": \"ENC_POS|1\"}], \"CycleTimeMs\": 2}}";
    assert_eq!(error(empty), "r: there are no rows of HFData in the Payload");
    let bytes =
        Recorded::new("edge", b"{\"Header\": \xff}").format(RecordingFormat::SinumerikEdge).error("y");
    assert!(bytes.starts_with("r:1: not a recording of the format sinumerik-edge: "), "{bytes}");
}
