//! The commands `virtual_axes tune` and `virtual_axes robustness`.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::command_common::{assert_rejected, json, printed};
use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;
use virtual_axes_verification::fixtures::tuning::{CIRCLE, CORNER};

/// Margin limits that few designs satisfy, so that the search is short.
const FEW: [&str; 4] = ["--modulus-margin", "0.7", "--delay-margin-ms", "12"];

fn text(path: &PathBuf) -> String {
    std::fs::read_to_string(path).expect("it is there")
}

#[test]
fn the_written_machine_has_the_printed_cost() {
    let folder = TestFolder::new("tune_out");
    let corner = folder.file("corner.yaml", CORNER);
    let corner = corner.to_string_lossy();
    for controller in ["gpc", "cascade"] {
        let (out, page) =
            (folder.0.join(format!("{controller}.yaml")), folder.0.join(format!("{controller}.html")));
        let (out_text, page_text) = (out.to_string_lossy(), page.to_string_lossy());
        let mut arguments = vec!["tune", &*corner, "--controller", controller, "--json"];
        arguments.extend(FEW);
        arguments.extend([
            "--set",
            "x.velocity_loop.gain=4.75",
            "--out",
            &*out_text,
            "--report",
            &*page_text,
        ]);
        let found = json(&arguments);
        assert_eq!(found["tuned_axes"], serde_json::json!(["x", "y"]));
        let again = json(&["run", &corner, "--machine", &out_text, "--json"]);
        let again = &again["runs"][0];
        // Stationary axes keep the cascade.
        let expected = if controller == "gpc" { "gpc+cascade" } else { "cascade" };
        assert_eq!(again["controller"], expected);
        // All figures are bit-identical; the cost is the largest contour error.
        let mut figures = again.as_object().expect("an object").clone();
        figures.remove("controller");
        figures.remove("changes");
        assert_eq!(&Value::Object(figures), &found["best"]["figures"]);
        assert_eq!(found["best"]["cost"], again["contour_error_um"]["max"]);
        assert!(found["best"]["cost"].as_f64() < found["present"]["cost"].as_f64());
        assert!(found["best"]["margins"]["modulus"].as_f64() >= Some(0.7));
        assert!(found["best"]["margins"]["delay_ms"].as_f64() >= Some(12.0));
        let pareto = found["pareto"].as_array().expect("a list");
        assert_eq!(pareto[0]["cost"], found["best"]["cost"]);

        let machine = text(&out);
        assert!(machine.starts_with("# Mikron UCP 710, from the machine mikron_ucp710"), "{machine}");
        let tuned = format!("        controller: {controller}  # tuned for ");
        assert_eq!(machine.matches(&tuned).count(), 2, "{machine}");
        assert!(machine.contains("gain: 4.75\n"), "{machine}");
        let page = text(&page);
        for part in ["<h2>Search</h2>", "Cost against modulus margin", "Pareto front", "initial"] {
            assert!(page.contains(part), "{part}");
        }
    }
    assert_eq!(folder.names().len(), 5);
}

#[test]
fn the_first_grid_has_the_requested_number_of_designs() {
    let folder = TestFolder::new("tune_designs");
    // Long enough for a full turn at steady feed.
    let circle = folder.file("circle.yaml", CIRCLE.replace("turns: 1", "turns: 3"));
    let circle = &*circle.to_string_lossy();
    let mut arguments = vec!["tune", circle, "--controller", "gpc", "--json"];
    arguments.extend(FEW);
    let coarse = json(&arguments);
    // The default grid is the smallest.
    assert_eq!(json(&[&arguments[..], &["--designs", "1"]].concat()), coarse);
    // More than the 1968 designs of the default grid and its refinement.
    const DESIGNS: u64 = 20_000;
    let designs = DESIGNS.to_string();
    arguments.extend(["--designs", &*designs]);
    let fine = json(&arguments);
    assert!(coarse["designs"].as_u64() < Some(DESIGNS), "{}", coarse["designs"]);
    assert!(fine["designs"].as_u64() >= Some(DESIGNS), "{}", fine["designs"]);
    assert!(fine["runs"].as_u64() > coarse["runs"].as_u64());
    // The best tuning has the figures of a complete run.
    assert_eq!(fine["best"]["figures"]["circles"].as_array().map(Vec::len), Some(1));
}

#[test]
fn the_text_compares_initial_and_best_tuning() {
    let folder = TestFolder::new("tune_text");
    let (corner, circle) = (folder.file("corner.yaml", CORNER), folder.file("circle.yaml", CIRCLE));
    let (corner, circle) = (corner.to_string_lossy(), circle.to_string_lossy());
    let mut arguments = vec!["tune", &*corner, "--controller", "gpc", "--also", &*circle];
    arguments.extend(FEW);
    let text = printed(&arguments);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("cost contour: ") && lines[0].contains("; modulus margin "), "{text}");
    let table = lines.iter().position(|line| line.starts_with("tuning ")).expect("a table");
    let title: Vec<&str> = lines[..table].iter().flat_map(|line| line.split_whitespace()).collect();
    assert!(title.join(" ").ends_with("corner.yaml: Mikron UCP 710 of x, y, cost contour"), "{text}");
    for start in ["initial ", "best ", "x.position_loop.gpc.lambda_rel ", "N1 ", "path "] {
        assert!(lines.iter().any(|line| line.starts_with(start)), "{start}: {text}");
    }
    assert!(text.contains(" better\n"), "{text}");
    // The output is deterministic.
    assert_eq!(printed(&arguments), text);
}

#[test]
fn a_contrast_is_found_and_reported() {
    let folder = TestFolder::new("tune_contrast");
    let (corner, circle) = (folder.file("corner.yaml", CORNER), folder.file("circle.yaml", CIRCLE));
    let page = folder.0.join("page.html");
    let (corner, circle, page_text) =
        (corner.to_string_lossy(), circle.to_string_lossy(), page.to_string_lossy());
    let mut arguments = vec!["tune", &*circle, "--controller", "gpc", "--also", &*corner, "--contrast"];
    arguments.extend(["--modulus-margin", "0.7", "--json", "--report", &*page_text]);
    let found = json(&arguments);
    let there = &found["also"][0];
    assert!(found["best"]["cost"].as_f64() < found["present"]["cost"].as_f64());
    assert!(there["tuned"]["cost"].as_f64() > there["present"]["cost"].as_f64());
    let all = found["contrasts"].as_array().expect("a list");
    assert_eq!(all[0]["better"]["tuning"], found["best"]["tuning"]);
    let worst = all.iter().filter_map(|pair| pair["worse"]["cost"].as_f64()).fold(0.0, f64::max);
    assert_eq!(Some(worst), there["tuned"]["cost"].as_f64());
    assert!(text(&page).contains("Better on "));
}

#[test]
fn deviating_plants_are_listed() {
    let folder = TestFolder::new("robustness");
    let circle = folder.file("circle.yaml", CIRCLE);
    let circle = circle.to_string_lossy();
    let text = printed(&["robustness", &circle, "--controller", "gpc"]);
    let lines: Vec<&str> = text.lines().collect();
    let starts = [
        "plant ",
        "nominal ",
        "inertia × 0.7 ",
        "inertia × 1.3 ",
        "friction × 0.7 ",
        "friction × 1.3 ",
        "Kt × 0.7 ",
        "Kt × 1.3 ",
        "worst ",
    ];
    assert!(lines[0].starts_with("cost contour: ") && lines[0].contains(" at worst; "), "{text}");
    // Headings and long names are continued in further lines.
    let mut rest = lines[4..].iter();
    for start in starts {
        assert!(rest.any(|line| line.starts_with(start)), "{start}: {text}");
    }
    let found = json(&["robustness", &circle, "--by", "0.1", "--json"]);
    let plain = json(&["run", &circle, "--json"]);
    assert_eq!(found["nominal"]["cost"], plain["runs"][0]["contour_error_um"]["max"]);
    assert_eq!(found["single"][1]["deviation"]["inertia"], 1.1);
    assert!(found["worst_combination"]["cost"].as_f64() >= found["nominal"]["cost"].as_f64());
}

#[test]
fn invalid_options_are_rejected_by_name() {
    let folder = TestFolder::new("tune_rejected");
    let corner = folder.file("corner.yaml", CORNER);
    let corner = &*corner.to_string_lossy();
    let out = folder.0.join("out.yaml");
    let out = &*out.to_string_lossy();
    let page = format!("{out}.html");
    for (options, parts) in [
        (vec!["--modulus-margin", "2"], vec!["--modulus-margin", "'2'", "must be in 0 … 1"]),
        (vec!["--modulus-margin", "nan"], vec!["--modulus-margin", "must be in 0 … 1"]),
        (vec!["--delay-margin-ms", "-1"], vec!["--delay-margin-ms", "'-1'", "must be in 0 … 1000"]),
        (vec!["--cost", "color"], vec!["--cost", "unknown term color"]),
        (vec!["--cost", "rms=-1"], vec!["--cost", "rms=-1", "a number from 0 to 1e9"]),
        (vec!["--cost", "rms=1e300"], vec!["--cost", "rms=1e300", "a number from 0 to 1e9"]),
        (vec!["--controller", "rst"], vec!["--controller", "gpc", "cascade"]),
        (vec!["--set", "x.position_loop.controller=rst"], vec!["x.position_loop"]),
        (vec!["--seed", "-1"], vec!["--seed"]),
        (vec!["--seed", "2", "--controller", "gpc"], vec!["--seed", "cascade"]),
        (vec!["--contrast"], vec!["--also"]),
        (vec!["--contrast", "--also", "corner-90", "--controller", "cascade"], vec!["--contrast", "gpc"]),
        (vec!["--designs", "10", "--controller", "cascade"], vec!["--designs", "gpc"]),
        (
            vec!["--designs", "10", "--controller", "gpc", "--contrast", "--also", "corner-90"],
            vec!["--designs", "--contrast"],
        ),
        (vec!["--designs", "0"], vec!["--designs", "'0'"]),
        (vec!["--also", "no-such"], vec!["no-such"]),
        (vec!["--out", corner], vec!["corner.yaml", "would replace an input file"]),
        (vec!["--out", &page], vec![".html", "YAML"]),
        (vec!["--out", out, "--report", out], vec!["out.yaml", "--out", "--report", "different files"]),
        (vec!["--report", out], vec!["out.yaml", ".html"]),
        (vec!["--machine", out], vec!["out.yaml"]),
        (vec!["--modulus-margin", "0.999"], vec!["corner.yaml", "0.999", "largest modulus margin"]),
        (vec!["--feed", "-3"], vec!["corner.yaml", "-3"]),
    ] {
        let mut arguments = vec!["tune", corner];
        arguments.extend(&options);
        assert_rejected(&arguments, &parts);
    }
    for by in ["-0.1", "1", "nan"] {
        assert_rejected(&["robustness", corner, "--by", by], &["--by", "must be in 0 … 0.8"]);
    }
    assert_eq!(folder.names(), ["corner.yaml"]);
}

#[test]
fn an_interrupted_search_leaves_no_file() {
    let folder = TestFolder::new("tune_interrupted");
    let out = folder.0.join("out.yaml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_virtual_axes"))
        .args(["tune", "ballbar", "--controller", "gpc", "--designs", "1000000"])
        .args(["--out", &out.to_string_lossy()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command starts");
    // The search takes longer than this.
    std::thread::sleep(Duration::from_millis(700));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &id]).status().expect("kill runs").success());
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

#[test]
fn a_feed_that_is_not_reached_is_part_of_the_verdict() {
    let folder = TestFolder::new("tune_feed");
    let corner = folder.file("corner.yaml", CORNER);
    let mut arguments = vec!["tune", corner.to_str().expect("UTF-8"), "--quiet", "--feed", "600"];
    arguments.extend(FEW);
    let verdict = printed(&[&arguments[..], &["--controller", "gpc"]].concat());
    assert!(verdict.contains("; feed 600.00 m/min not reached, at most "), "{verdict}");
}
