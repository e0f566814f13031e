//! The command `virtual_axes design`.

use std::process::{Command, Output};

use serde_json::Value;
use virtual_axes_core::config::{self, Parameters};
use virtual_axes_core::machine::MachineParameters;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
        .arg("design")
        .args(arguments)
        .output()
        .expect("the command starts")
}

#[track_caller]
fn text(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty());
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[track_caller]
fn object(arguments: &[&str]) -> Value {
    serde_json::from_str(&text(&[arguments, &["--json"]].concat())).expect("JSON")
}

#[track_caller]
fn assert_rejected(arguments: &[&str], words: &[&str]) {
    let output = run(arguments);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(message.contains(word), "{word} is missing in: {message}");
    }
}

#[test]
fn the_default_tuning_has_its_margins_on_all_axes() {
    let object = object(&["gpc"]);
    assert_eq!(object["axes"].as_object().map(|axes| axes.len()), Some(5));
    let worst = |figure: &str| object["worst"][figure].as_f64().expect("a number");
    assert!(worst("modulus") >= 0.59 && worst("delay_ms") >= 7.2, "{}", object["worst"]);
    let y = &object["axes"]["y"];
    assert_eq!(y["tuning"].to_string(), r#"{"n1":1.0,"n2":14.0,"nu":12.0,"lambda_rel":0.005}"#);
    assert_eq!(y["t_first"], 1);
    assert_eq!(y["stable"], true);
    let table = text(&["gpc"]);
    assert!(table.lines().last().is_some_and(|line| line.starts_with("worst")), "{table}");
}

#[test]
fn options_override_the_tuning_of_the_machine() {
    let object =
        object(&["gpc", "--axis", "x,z", "--n1", "1", "--n2", "8", "--nu", "6", "--lambda-rel", "1e-3"]);
    let axes: Vec<&String> = object["axes"].as_object().expect("axes").keys().collect();
    assert_eq!(axes, ["x", "z"]);
    assert_eq!(object["axes"]["x"]["t_per_s"].as_array().map(Vec::len), Some(8));
    let set = ["gpc", "--axis", "x", "--set", "x.position_loop.gpc.n2=20"];
    let set = serde_json::from_str::<Value>(&text(&[&set[..], &["--json"]].concat())).expect("JSON");
    assert_eq!(set["axes"]["x"]["t_per_s"].as_array().map(Vec::len), Some(20));
}

#[test]
fn yaml_output_is_valid_in_a_machine_file() {
    for method in [
        &["gpc"][..],
        &["p"],
        &["pi", "--integral-time-ms", "200"],
        &["pid", "--integral-time-ms", "200", "--derivative-time-ms", "2", "--filter-time-ms", "3"],
        &["poles", "--bandwidth", "50", "--damping", "0.8", "--integrator"],
    ] {
        let yaml = text(&[method, &["--yaml"]].concat());
        let mut parameters = Parameters::embedded_default().expect("valid");
        parameters.overlay_yaml(&yaml, "design", None).expect("parameters");
        let config = parameters.machine_config().expect("a machine");
        MachineParameters::new(&config).unwrap_or_else(|error| panic!("{method:?}: {error}"));
        // All digits are kept.
        for axis in ["x", "c"] {
            // Long polynomials are wrapped.
            let printed = text(&[method, &["--axis", axis]].concat()).replace("\n    ", " ");
            for (key, name) in [("r", "R = ["), ("s", "S = ["), ("t", "T = [")] {
                let line = printed.lines().find_map(|line| line.strip_prefix(name)?.strip_suffix(']'));
                let numbers = line.expect("a polynomial").split(", ").map(|c| c.parse().expect("a number"));
                let read = parameters.get(&format!("{axis}.position_loop.rst.{key}"));
                assert_eq!(read, Some(config::Value::DoubleList(numbers.collect())), "{axis} {key}");
            }
        }
    }
}

#[test]
fn the_gain_defaults_to_that_of_the_machine() {
    let object = object(&["p", "--axis", "z", "--feedforward", "0"]);
    let z = &object["axes"]["z"];
    // 3.5 (m/min)/mm
    let gain = z["r_per_s"][0].as_f64().expect("a number");
    assert!((gain - 3500.0 / 60.0).abs() < 1e-12, "{gain}");
    assert_eq!((&z["r_per_s"], &z["s"].to_string()[..]), (&z["t_per_s"], "[1.0]"));
}

#[test]
fn placed_poles_are_closed_loop_poles() {
    let object = object(&["poles", "--axis", "x", "--pole", "0.7,0.2", "--pole", "0.1"]);
    let poles = object["axes"]["x"]["poles"].as_array().expect("poles");
    let near = |pole: &Value, re: f64, im: f64| {
        let part = |name: &str| pole[name].as_f64().expect("a number");
        (part("re") - re).hypot(part("im") - im) < 1e-5
    };
    assert!(
        near(&poles[0], 0.7, 0.2) && near(&poles[1], 0.7, -0.2) && near(&poles[2], 0.1, 0.0),
        "{poles:?}"
    );
}

#[test]
fn an_unstable_loop_is_rejected_with_its_pole_unless_forced() {
    let unstable = ["p", "--axis", "x", "--gain", "20"];
    assert_rejected(
        &unstable,
        &["axis x: the closed loop is unstable: its pole ", "use --force to accept it"],
    );
    let forced = text(&[&unstable[..], &["--force"]].concat());
    assert!(forced.contains("no margins: the closed loop is unstable"), "{forced}");
    let yaml = text(&[&unstable[..], &["--force", "--yaml"]].concat());
    assert!(yaml.contains("allow_unstable: true"), "{yaml}");
}

#[test]
fn invalid_options_are_rejected_by_name() {
    assert_rejected(
        &["gpc", "--n1", "9", "--n2", "8", "--nu", "6"],
        &["axis x: n1 = 9 must lie in 1 … n2 = 8"],
    );
    assert_rejected(&["gpc", "--nu", "15"], &["axis x: nu = 15 must lie in 1 … n2 = 14"]);
    assert_rejected(&["gpc", "--lambda-rel", "-1"], &["lambda_rel = -1 must be finite and not negative"]);
    assert_rejected(&["gpc", "--lambda", "nan"], &["lambda = NaN must be finite"]);
    assert_rejected(&["gpc", "--axis", "w"], &["--axis w: the machine has x, y, z, a, c"]);
    assert_rejected(&["pi", "--integral-time-ms", "0"], &["integral_time = 0 must be above 0"]);
    for gain in ["-1", "1e6", "nan", "1e-7", "1e-320"] {
        assert_rejected(&["p", "--gain", gain], &["--gain", "at most 600 (m/min)/mm"]);
    }
    assert_rejected(&["p", "--feedforward", "1e300"], &["velocity_feedforward = 1e300 must"]);
    assert_rejected(&["poles", "--pole", "1.5"], &["the desired pole 1.500000 has the modulus 1.5"]);
    assert_rejected(
        &["poles", "--pole", "1e300"],
        &["the desired pole 1e300 + 0j has the modulus 1e300; it must"],
    );
    assert_rejected(
        &["poles", "--bandwidth", "30", "--damping", "1e300"],
        &["damping = 1e300 must be above 0 and at most 1e9"],
    );
    assert_rejected(
        &["gpc", "--set", "x.velocity_loop.gain=-0.12345678901234567"],
        &["--set: x.velocity_loop.gain = -0.123457: must"],
    );
    assert_rejected(&["poles", "--pole", "a"], &["--pole"]);
    assert_rejected(&["poles"], &["--bandwidth <BANDWIDTH>|--pole <RE[,IM]>"]);
    assert_rejected(&["gpc", "--set", "x.no_such=1"], &["x.no_such"]);
}
