//! The command `virtual_axes psec campaign`.

use std::fs;

use crate::command_common::{assert_rejected, json, printed, run};
use serde_json::Value;
use virtual_axes_verification::fixtures::folder::TestFolder;

/// Returns times and positions of a CSV file of one joint, s and m or rad.
fn rows(path: &str, joint: &str) -> Vec<(f64, f64)> {
    let text = fs::read_to_string(path).expect("readable");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(format!("time,{joint}").as_str()));
    let numbers = lines.map(|line| line.split_once(',').expect("two columns"));
    numbers.map(|(t, x)| (t.parse().expect("a time"), x.parse().expect("a position"))).collect()
}

#[test]
fn the_timetable_agrees_with_the_file() {
    let folder = TestFolder::new("campaign_timetable");
    let file = folder.path("z.csv");
    let timetable = json(&["psec", "campaign", "--axis", "z", "--out", &file, "--json"]);
    let rows = rows(&file, "z");
    assert_eq!(timetable["axis"], "z");
    let parts = timetable["parts"].as_array().expect("a list");
    let names: Vec<&str> = parts.iter().filter_map(|part| part["part"].as_str()).collect();
    assert_eq!(names, ["off", "velocity", "both"]);
    assert_eq!(parts[1]["set"][0], "z.feedforward.velocity=1");
    assert_eq!(parts[1]["set"][1], "z.feedforward.torque_kg_m2=0");
    assert_eq!(parts[2]["set"][1], "z.feedforward.torque_kg_m2=0.00203");
    assert_eq!(parts[0]["speeds_m_min"].as_array().map(Vec::len), Some(12));
    let number = |part: &Value, key: &str| part[key].as_f64().expect("a number");
    for (i, part) in parts.iter().enumerate() {
        let (from, to) = (number(part, "from_s"), number(part, "to_s"));
        assert!((number(part, "duration_s") - (to - from)).abs() < 1e-9);
        // Three seconds at rest between two parts, a second at their ends.
        let rests = if i == 0 { 0.0..1.0 } else { from - 4.0..from + 1.0 };
        let moved = rows.iter().find(|(t, z)| rests.contains(t) && *z != 0.0);
        assert_eq!(moved, None, "{part}");
        assert!(rows.iter().any(|(t, z)| *t > from && *t < to && *z > 0.1), "{part}");
        if let Some(next) = parts.get(i + 1) {
            assert!((number(next, "from_s") - to - 3.006).abs() < 1e-9, "{next}");
        }
    }
    assert_eq!(rows.last().map(|row| row.0), Some(number(&parts[2], "to_s")));
    let (low, high) = (timetable["range_mm"][0].as_f64(), timetable["range_mm"][1].as_f64());
    assert_eq!((low, high, timetable["start_mm"].as_f64()), (Some(-225.0), Some(225.0), Some(0.0)));
}

#[test]
fn a_single_part_equals_the_part_of_the_whole_campaign() {
    let folder = TestFolder::new("campaign_parts");
    let whole = folder.path("whole.csv");
    let timetable = json(&["psec", "campaign", "--axis", "a", "--out", &whole, "--json"]);
    let whole = rows(&whole, "a");
    for (i, part) in ["off", "velocity", "both"].into_iter().enumerate() {
        let alone = folder.path("part.csv");
        printed(&["psec", "campaign", "--axis", "a", "--part", part, "--out", &alone]);
        let alone: Vec<f64> = rows(&alone, "a").into_iter().map(|row| row.1).collect();
        let from = timetable["parts"][i]["from_s"].as_f64().expect("a number");
        let same: Vec<f64> =
            whole.iter().filter(|(t, _)| *t > from - 0.003).take(alone.len()).map(|row| row.1).collect();
        assert!(alone == same, "{part}");
    }
}

#[test]
fn all_formats_give_equal_figures() {
    let folder = TestFolder::new("campaign_formats");
    let mut figures = Vec::new();
    for extension in ["csv", "yaml", "mcap"] {
        let file = folder.path(&format!("c.{extension}"));
        let machine = ["--machine", "linear_motor_center"];
        let campaign = ["psec", "campaign", "--axis", "c", "--part", "velocity", "--out", &file];
        let text = printed(&[&campaign[..], &machine].concat());
        assert!(text.contains("before velocity: c.feedforward.velocity=1"), "{text}");
        let found = json(&[&["run", &file, "--json"], &machine[..]].concat());
        figures.push(found["runs"][0]["axes"].clone());
        let moving = figures[0].as_object().expect("axes").iter().filter(|(_, axis)| axis["moves"] == true);
        assert_eq!(moving.map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["c"]);
    }
    assert!(figures.iter().all(|found| *found == figures[0]), "{figures:?}");
    assert!(figures[0]["c"]["saturation_s"] == 0.0);
}

#[test]
fn range_and_feed_limits_are_kept() {
    let folder = TestFolder::new("campaign_range");
    let file = folder.path("x.csv");
    let text =
        printed(&["psec", "campaign", "--axis", "x", "--range", "50,150", "--max-feed", "6", "--out", &file]);
    assert!(text.contains("x starts and ends at 55.000 mm; move it there before the start"), "{text}");
    let rows = rows(&file, "x");
    assert!(rows.iter().all(|(_, x)| (0.055..=0.145).contains(x)));
    let fastest = rows.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs() / 0.006).fold(0.0, f64::max);
    assert!((fastest * 60.0 - 6.0).abs() < 1e-5, "{fastest}");
}

#[test]
fn impossible_campaigns_are_rejected_in_one_line_without_a_file() {
    let folder = TestFolder::new("campaign_rejected");
    let file = folder.path("x.csv");
    for (more, words) in [
        (&["--axis", "w"][..], &["--axis w", "x, y, z, a, c"][..]),
        (&["--axis", "x", "--range", "-100,100"], &["200 mm", "338 mm", "12.52 m/min"]),
        (&["--axis", "x", "--range", "0,400"], &["0,400 mm", "-355", "355"]),
        (&["--axis", "x", "--max-feed", "29"], &["29 m/min", "28.5"]),
        (&["--axis", "a", "--max-feed", "-1"], &["-1 rpm", "14.25"]),
        (&["--axis", "x", "--set", "x.limits.jerk_m_s3=0"], &["x.limits.jerk_m_s3"]),
    ] {
        let output = run(&[&["psec", "campaign", "--out", &file], more].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(output.stdout.is_empty());
        assert_eq!(message.lines().count(), 1, "{message}");
        for word in words {
            assert!(message.contains(word), "{word} is missing in: {message}");
        }
        assert!(folder.names().is_empty());
    }
    // Messages of the argument parser.
    for wrong in [&["--range", "5"][..], &["--range", "a,b"], &["--part", "torque"]] {
        assert_rejected(&[&["psec", "campaign", "--axis", "x", "--out", &file], wrong].concat(), &wrong[..1]);
        assert!(folder.names().is_empty());
    }
}
