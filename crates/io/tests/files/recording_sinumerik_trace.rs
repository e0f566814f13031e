//! Recordings of the trace of Sinumerik Operate.

use super::recording_columns::{Recorded, summary};
use virtual_axes_io::files::RecordingFormat;

/// Rotary axis 7 that brakes.
pub(crate) const MOTION: &str = include_str!("../data/sinumerik_trace_motion.xml");
/// Axis at rest: values without a change are left out.
const REST: &str = include_str!("../data/sinumerik_trace_rest.xml");

fn radians(degrees: &[f64]) -> Vec<f64> {
    degrees.iter().map(|degrees| degrees * (std::f64::consts::PI / 180.0)).collect()
}

#[track_caller]
fn assert_close(found: &[f64], wanted: &[f64]) {
    assert_eq!(found.len(), wanted.len(), "{found:?}");
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-12, "{found} for {wanted}");
    }
}

#[test]
fn signals_are_listed() {
    let found = Recorded::new("trace", MOTION).inspect();
    assert_eq!((found.format, found.axes()), (RecordingFormat::SinumerikTrace, vec!["7".to_owned()]));
    assert!(found.has_time());
    let columns: Vec<String> = found.columns.iter().map(summary).collect();
    assert_eq!(
        columns,
        [
            "- 7",
            "- 7",
            "- 7",
            "- 7",
            "- 7",
            "- 7",
            "current [A] 7",
            "position [mm or deg] 7",
            "position [mm or deg] 7",
            "psec [mm or deg] 7",
        ]
    );
    assert_eq!(found.columns[9].header, "/Nck/!SD/nckServoDataCmdPos2ndEnc64 [u1, 7]");
    assert!(found.columns[5].reason.contains("its unit is not in the file"), "{}", found.columns[5].reason);
}

#[test]
fn the_encoder_must_be_selected() {
    assert_eq!(
        Recorded::new("trace", MOTION).error("c"),
        "r:24: columns #8 \"/Nck/!SEMA/measPos1 [u1, 7]\", #9 \"/Nck/!SEMA/measPos2 [u1, 7]\" all fit position: select \
         one, for example by --column 'position=#8'"
    );
    // Positions every 4 ms, the other signals at the same times.
    let found = Recorded::new("trace", MOTION).columns(&["position=#9[deg]"]).good("c");
    assert_close(&found.time, &[23.882, 23.886, 23.890, 23.894]);
    assert_close(
        &found.position.expect("there"),
        &radians(&[177.009230, 176.848300, 176.683070, 176.508920]),
    );
    let psec = found.psec.expect("there");
    assert_close(&psec, &radians(&[176.711420, 176.541950, 176.367630, 176.188460]));
    assert_eq!(found.current, Some(vec![30.503235, 29.897829, 30.290344, 30.909060]));
    // The setpoint moves with its velocity of -6.8 1/min.
    let speed = (psec[1] - psec[0]) / 0.004;
    assert!((speed - -6.83 * std::f64::consts::TAU / 60.0).abs() < 0.05, "{speed}");
    // An encoder of the servo data takes precedence, at 2 ms.
    let servo = MOTION.replace("/Nck/!SD/nckServoDataFlwErr64", "/Nck/!SD/nckServoDataActPos1stEnc64");
    let found = Recorded::new("trace", servo).good("c");
    assert_close(&found.time[..3], &[23.880, 23.882, 23.884]);
    let linear = MOTION.replace("/Nck/!SEMA/measPos2", "/Nck/!SEMA/other");
    assert_close(&Recorded::new("trace", linear).good("x").position.expect("there")[..1], &[0.17695551]);
}

#[test]
fn omitted_values_and_records_are_those_before() {
    let found = Recorded::new("trace", REST).columns(&["position=#4[deg]", "velocity=#6[rpm]"]).good("c");
    // The record of 0.164 s is left out.
    let times = [0.160, 0.162, 0.164, 0.166, 0.168, 0.170, 0.172, 0.174, 0.176, 0.178];
    assert_close(&found.time, &times);
    let degrees = [0.0, 0.0, 0.0, -0.000086, -0.000086, 0.0, 0.0, 0.0, -0.000257, 0.0];
    assert_close(&found.position.expect("there"), &radians(&degrees));
    assert_eq!(found.current.expect("there")[2..4], [-0.811646, -0.838257]);
    // No value before the first one.
    assert!(found.velocity.expect("there")[..9].iter().all(|value| value.is_nan()));
    assert_eq!(found.psec, None);
}

#[test]
fn missing_samples_and_dropouts_are_recognized() {
    let text = MOTION.replace("f9=\"176.848300\"", "f9=\"9218868437227405312.000000\"");
    let text = text.replace("dropOuts=\"0\"", "dropOuts=\"3\"");
    let (found, findings) =
        Recorded::new("trace", text).columns(&["position=#9[deg]"]).rate(10.0).read("c").expect("good");
    assert!(found.position.expect("there")[1].is_nan());
    let codes: Vec<&str> = findings.iter().map(|finding| finding.code).collect();
    assert!(codes.contains(&"dropouts") && codes.contains(&"unused-rate"), "{findings:?}");
    // A second frame.
    let frame =
        MOTION.split_once(" <dataFrame>").expect("there").1.split_once("</traceData>").expect("there").0;
    let twice = MOTION.replace("</traceData>", &format!(" <dataFrame>{frame}</traceData>"));
    let (found, findings) =
        Recorded::new("trace", twice).columns(&["position=#9[deg]"]).read("c").expect("good");
    assert_eq!(found.time.len(), 4);
    assert!(findings.iter().any(|finding| finding.code == "frames"), "{findings:?}");
}

#[test]
fn malformed_traces_are_rejected_with_their_line() {
    let error = |text: &str| {
        Recorded::new("trace", text)
            .columns(&["position=#9[deg]"])
            .format(RecordingFormat::SinumerikTrace)
            .error("c")
    };
    let number = error(&MOTION.replace("f9=\"176.848300\"", "f9=\"many\""));
    assert_eq!(number, "r:27: f9 is \"many\", must be a finite number");
    let start = "not a recording of the format sinumerik-trace: ";
    let time = error(&MOTION.replace("<rec time=\"23.886000\"", "<rec"));
    assert_eq!(time, format!("r:27: {start}a rec has no time"));
    let back = error(&MOTION.replace("time=\"23.886000\"", "time=\"23.884000\""));
    assert_eq!(back, format!("r:27: {start}time is 23.884, must be greater than 23.884 of the last rec"));
    let id = error(&MOTION.replace("id=\"f9\"", ""));
    assert_eq!(id, format!("r:22: {start}a dataSignal has no id or no name"));
    let truncated = error(&MOTION[..MOTION.len() - 60]);
    assert!(truncated.starts_with("r:3") && truncated.contains(start), "{truncated}");
    let unclosed = error("<traceSession><traceData><dataFrame>");
    assert_eq!(unclosed, format!("r:1: {start}the file ends within the trace"));
    assert!(error("<traceSession></other>").starts_with(&format!("r:1: {start}")));
    for text in ["", "text", "<a/>", "<traceSession></traceSession>"] {
        assert_eq!(error(text), format!("r:1: {start}there is no traceData with a dataFrame"), "{text}");
    }
    let frame = "<traceSession><traceData><dataFrame></dataFrame></traceData></traceSession>";
    assert_eq!(error(frame), format!("r:1: {start}the dataFrame has no dataSignal"));
    assert!(error("<a b=\"\u{e4}\"").starts_with("r:1: "));
    let bytes = Recorded::new("trace", b"<traceSession a=\"\xe4\"/>").error("c");
    assert!(bytes.starts_with("r:1: "), "{bytes}");
}
