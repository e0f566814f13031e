//! The command `virtual_axes learn`.

use crate::command_common::{assert_rejected, json, printed};
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::fixtures::tuning::CIRCLE;

#[test]
fn learned_setpoints_run_with_the_same_positions() {
    let folder = TestFolder::new("learn_out");
    let circle = folder.file("circle.yaml", CIRCLE).to_string_lossy().into_owned();
    let [out, page, trace] = ["learned.csv", "learned.html", "trace.csv"].map(|name| folder.path(name));
    let arguments = ["learn", &circle, "--iterations", "3", "--json", "--out", &out, "--report", &page];
    let found = json(&arguments);
    let runs = found["iterations"].as_array().expect("a list");
    assert_eq!(runs.len(), 4);
    let error =
        |run: &serde_json::Value| run["figures"]["contour_error_um"]["max"].as_f64().expect("a number");
    assert!(error(&runs[3]) < 0.5 * error(&runs[0]));
    assert_eq!((found["best"].as_u64(), found["end"].as_str()), (Some(3), Some("complete")));
    for axis in found["convergence"].as_array().expect("a list") {
        assert!(axis["factor"].as_f64() < Some(1.0) && axis["bandwidth_hz"].as_f64() > Some(1.0));
        assert_eq!(axis["deviating_plants"].as_array().map(Vec::len), Some(8));
    }
    // The first iteration is the run of the programmed setpoints.
    let plain = json(&["run", &circle, "--json"]);
    assert_eq!(plain["runs"][0]["contour_error_um"], runs[0]["figures"]["contour_error_um"]);
    // Columns of all axes, a row per position cycle; the command takes the file.
    let psec = std::fs::read_to_string(&out).expect("the setpoints");
    assert!(psec.starts_with("time,x,y,z,a,c\n"), "{psec}");
    printed(&["run", &out, "--trace", &trace]);
    let html = std::fs::read_to_string(&page).expect("the page");
    assert!(html.contains("Errors over the iterations") && html.contains("Iterative learning"));
    // Equal arguments give equal bytes.
    let again = json(&arguments);
    assert_eq!(again, found);
    assert_eq!(std::fs::read_to_string(&out).expect("the setpoints"), psec);
}

#[test]
fn part_programs_csv_files_and_other_machines_can_be_learned() {
    let folder = TestFolder::new("learn_inputs");
    let program =
        folder.file("move.nc", "G21 G90 G94\nG1 X10 F3000\nG1 Y10\nM2\n").to_string_lossy().into_owned();
    let psec = folder.path("psec.csv");
    printed(&["psec", &program, "--out", &psec]);
    let on = "x.position_loop.controller=gpc,y.position_loop.controller=gpc";
    for input in [&program, &psec] {
        let found = json(&["learn", input, "--iterations", "2", "--json", "--on", on]);
        let runs = found["iterations"].as_array().expect("a list");
        let error =
            |run: &serde_json::Value| run["figures"]["contour_error_um"]["rms"].as_f64().expect("a number");
        assert!(error(&runs[2]) < error(&runs[0]), "{input}");
        assert!(found["on"][0]["programmed"]["figures"]["contour_error_um"].is_object());
    }
}

#[test]
fn motions_without_a_contour_minimize_the_error_of_the_axis() {
    for (scenario, unit) in [("c-constant", "rad"), ("x-constant", "m")] {
        let found = json(&["learn", scenario, "--iterations", "3", "--json"]);
        let runs = found["iterations"].as_array().expect("a list");
        let error =
            |run: &serde_json::Value| run["learning_axes"][0]["max_error"].as_f64().expect("a number");
        assert_eq!(runs[0]["learning_axes"][0]["unit"], unit);
        let best = found["best"].as_u64().expect("an index") as usize;
        assert!(best > 0 && error(&runs[best]) < 0.7 * error(&runs[0]), "{scenario}: {}", error(&runs[best]));
        let least = runs.iter().map(error).fold(f64::INFINITY, f64::min);
        assert_eq!(error(&runs[best]), least);
    }
    let text = printed(&["learn", "c-constant", "--iterations", "2", "--quiet"]);
    assert!(text.starts_with("max error of an axis ") && text.contains(" mdeg → "), "{text}");
}

#[test]
fn invalid_arguments_are_rejected_with_what_is_allowed() {
    let rejected = |arguments: &[&str], parts: &[&str]| {
        assert_rejected(&[&["learn", "ballbar"], arguments].concat(), parts);
    };
    rejected(&["--gain", "0"], &["must be above 0 and at most 2"]);
    rejected(&["--bandwidth", "90"], &["bandwidth = 90 must lie in 1 … 83.3333 Hz"]);
    rejected(&["--iterations", "0"], &["1..=1000"]);
    rejected(&["--encoder-step", "-1"], &["must be in 0 … 1000"]);
    rejected(&["--on", "periods.position_ms=3"], &["must not change joints or periods"]);
    rejected(&["--on", "q.foo=1"], &["--on: unknown parameter q.foo"]);
    let divided = "x.position_loop.controller=rst,x.position_loop.rst.r=[0],x.position_loop.rst.s=[0],x.position_loop.rst.t=[0]";
    rejected(&["--on", divided], &["--controller, --set or --on: axis x: position_loop: s[0] = 0"]);
    rejected(&["--report", "x.txt"], &["its extension must be .html or .htm"]);
    let program =
        ["learn", "s-path-five-axis", "--controller", "gpc", "--gain", "0.8", "--acceleration-excess", "0"];
    let message =
        ["s-path-five-axis: iteration 1: axis z, ", " s: the acceleration of the compensated setpoints is "];
    assert_rejected(&program, &message);
    assert_rejected(
        &["learn", "ballbar", "--out", "a.csv", "--report", "a.csv"],
        &["both --out and --report"],
    );
}
