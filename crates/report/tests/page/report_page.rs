//! Report pages: contents, escaping, decimation, and robustness to invalid values.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use crate::report_common::{
    NO_FEEDFORWARD, POSITION_CYCLE, assert_self_contained, assert_well_formed, ballbar, between, column,
    empty_axis, figure, figures, five_axes, points, report_run, without_scripts,
};
use virtual_axes_core::assess::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};
use virtual_axes_core::config::AxisKind;
use virtual_axes_nc::offline::CycleError;
use virtual_axes_report::{Report, ReportRun, Section, Table, TableColumn, ToolPath};

static BALLBAR: LazyLock<[SignalRecording; 2]> =
    LazyLock::new(|| [ballbar(&[], POSITION_CYCLE, false), ballbar(&NO_FEEDFORWARD, POSITION_CYCLE, false)]);

fn page(title: &str, runs: Vec<ReportRun>) -> String {
    let mut bytes = Vec::new();
    let report = Report { title, runs, ..Report::default() };
    report.write(&mut bytes).expect("memory can be written");
    String::from_utf8(bytes).expect("UTF-8")
}

fn two_runs() -> Vec<ReportRun<'static>> {
    let [with, without] = &*BALLBAR;
    vec![report_run("cascade", with), report_run("cascade-noff", without)]
}

/// Returns a run of one axis whose signals all equal `values`.
fn run_of(values: &[f64]) -> SignalRecording {
    let x = AxisTrace {
        psec: values.to_vec(),
        position: values.to_vec(),
        following_error: values.to_vec(),
        delay_compensated_following_error: values.to_vec(),
        velocity: values.to_vec(),
        current: values.to_vec(),
        current_setpoint: values.to_vec(),
        friction_current: values.to_vec(),
        gravity_current: values.to_vec(),
        load_current: values.to_vec(),
        ..empty_axis("x", AxisKind::Linear)
    };
    let reference: Vec<[f64; 3]> = values.iter().map(|&v| [v, 2.0 * v, 0.0]).collect();
    let position = values.iter().map(|&v| [v, 2.1 * v, 1e-6]).collect();
    let tool =
        ToolTrace { reference, position, contour_error: values.to_vec(), orientation_error: values.to_vec() };
    let circle = CircleTrace {
        plane: ["x", "y"].map(str::to_owned),
        radius: 0.1,
        counterclockwise: false,
        angle: values.to_vec(),
        deviation: values.to_vec(),
    };
    let time = (0..values.len()).map(|i| i as f64 * 0.006).collect();
    SignalRecording { time, axes: vec![x], tool: Some(tool), circles: vec![circle] }
}

/// Returns noise in −1 … 1 (xorshift generator).
fn noise(length: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as f64 / u64::MAX as f64 * 2.0 - 1.0
    };
    std::iter::repeat_with(next).take(length).collect()
}

#[test]
fn untrusted_names_are_escaped() {
    let hostile = "</title><script>alert(1)</script><img src=x onerror=alert(2)> \" ' &amp;";
    let mut recording = run_of(&[0.0, 1e-3, 2e-3]);
    recording.axes[0].name = hostile.to_owned();
    recording.circles[0].plane[0] = hostile.to_owned();
    let mut standing = AxisTrace { moves: false, ..empty_axis(hostile, AxisKind::Rotary) };
    standing.psec = vec![0.0; 3];
    recording.axes.push(standing);
    let table = Table {
        caption: hostile.to_owned(),
        columns: vec![TableColumn::new(hostile, hostile); 2],
        rows: vec![vec![hostile.to_owned(); 2]],
        ..Table::default()
    };
    let run = || ReportRun {
        title: hostile,
        facts: vec![(hostile.to_owned(), hostile.to_owned())],
        recording: &recording,
        program: None,
    };
    let mut bytes = Vec::new();
    let report = Report {
        title: hostile,
        description: hostile,
        verdict: vec![hostile.to_owned()],
        sections: vec![Section {
            paragraphs: vec![hostile.to_owned()],
            tables: vec![table.clone()],
            ..Section::new(hostile)
        }],
        tables: vec![table],
        notes: vec![hostile.to_owned()],
        runs: vec![run(), run()],
        provenance: vec![(hostile.to_owned(), hostile.to_owned())],
        ..Report::default()
    };
    report.write(&mut bytes).expect("memory can be written");
    let page = String::from_utf8(bytes).expect("UTF-8");
    assert_well_formed(&page);
    let count = figures(&page).len();
    assert_eq!(page.matches("<script").count(), count + 2);
    let page = without_scripts(&page);
    for tag in ["<script", "<img", "alert(1)</script>", "onerror=alert(2)>", "&amp;amp;amp;"] {
        assert!(!page.contains(tag), "{tag}");
    }
    // All occurrences are escaped.
    let escaped = "&lt;/title&gt;&lt;script&gt;alert(1)&lt;/script&gt;&lt;img src=x onerror=alert(2)&gt; &quot; &#39; &amp;amp;";
    assert_eq!(page.matches("alert(2)").count(), page.matches(escaped).count());
    assert!(page.matches(escaped).count() > 20);
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    assert_eq!(page("ballbar", two_runs()), page("ballbar", two_runs()));
}

#[test]
fn the_page_is_self_contained() {
    let page = page("ballbar", two_runs());
    assert_self_contained(&page);
    for wanted in ["<html lang=\"en\">", "charset=\"utf-8\"", "name=\"viewport\"", "<title>ballbar</title>"] {
        assert!(page.contains(wanted), "{wanted}");
    }
}

#[test]
fn any_signal_gives_a_valid_page() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let cases: [&[f64]; 10] = [
        &[],
        &[0.0],
        &[1.0; 50],
        &[nan; 50],
        &[nan, 1.0, nan, -inf, 2.0, 3.0, inf],
        &[f64::MAX, f64::MIN, 0.0],
        &[1e12, -1e12, 5.0],
        &[1e-300, -1e-300, f64::MIN_POSITIVE],
        &[1e9, 1e9 + 1e-6, 1e9],
        &[-0.0, 0.0, 1e-16],
    ];
    for values in cases {
        let mut recording = run_of(values);
        for lengthen in [false, true] {
            if lengthen {
                // Lists of inconsistent lengths.
                recording.time.extend([nan, 3.0, inf, 4.0]);
                recording.axes[0].current.clear();
                recording.circles[0].angle.push(nan);
            }
            // Only the plots are checked, not the tables.
            let run = |title| report_run(title, &recording);
            let page = page("broken", vec![run("one"), run("two")]);
            assert_well_formed(&page);
            assert_self_contained(&page);
        }
    }
    assert!(
        page("none", vec![report_run("empty", &SignalRecording::default())])
            .contains("Nothing was recorded.")
    );
    assert!(page("none", Vec::new()).contains("</html>"));
}

#[test]
fn every_plot_has_labels_with_units() {
    let five = five_axes(POSITION_CYCLE);
    let mut runs = two_runs();
    runs.push(report_run("five", &five));
    let page = page("all", runs);
    let text: String = figures(&page).into_iter().map(|(_, data)| data.to_string()).collect();
    for unit in ["(mm)", "(°)", "(µm)", "(mdeg)", "(m/min)", "(rpm)", "(A)", "(s)"] {
        assert!(text.contains(&format!("{unit}\"")), "{unit} is missing");
    }
}

#[test]
fn a_single_peak_among_many_samples_is_kept() {
    let mut values = vec![0.0; 60_000];
    values[34_567] = 3e-6;
    let recording = run_of(&values);
    let page = page("spike", vec![report_run("one", &recording)]);
    let axis = figure(&page, "X axis");
    assert_eq!(axis["panels"][2]["y"]["label"], "Following error (µm)");
    let line = points(&axis, 2, "one");
    let spike = line.iter().find(|p| p[1] == 3.0).expect("it is present");
    assert!((spike[0] - 0.006 * 34_567.0).abs() < 1e-4 && line.len() < 60_000, "at {}", spike[0]);
    // The line extends from the first to the last sample.
    assert!(line[0][0] == 0.0 && (line[line.len() - 1][0] - 0.006 * 59_999.0).abs() < 1e-4);
    let path = figure(&page, "Path of the tool");
    assert!(column(&path["runs"][0]["error"]).contains(&3.0));
}

#[test]
fn the_page_size_of_a_long_run_is_bounded() {
    const LONG: usize = 60_000;
    const MOST_BYTES: usize = 8_000_000;
    let mut recording =
        SignalRecording { time: (0..LONG).map(|i| i as f64 * 1e-3).collect(), ..SignalRecording::default() };
    for (i, name) in ["x", "y", "z", "a", "c"].into_iter().enumerate() {
        let signal = |n: u64| noise(LONG, 1 + 100 * i as u64 + n);
        let axis = empty_axis(name, if i < 3 { AxisKind::Linear } else { AxisKind::Rotary });
        recording.axes.push(AxisTrace {
            psec: signal(0),
            position: signal(1),
            following_error: signal(2),
            delay_compensated_following_error: signal(3),
            velocity: signal(4),
            current: signal(5),
            current_setpoint: signal(6),
            friction_current: signal(7),
            gravity_current: signal(8),
            load_current: signal(9),
            ..axis
        });
    }
    let points =
        || noise(LONG, 7).into_iter().zip(noise(LONG, 8)).map(|(x, y)| [x, y, 0.0]).collect::<Vec<_>>();
    recording.tool = Some(ToolTrace {
        reference: points(),
        position: points().into_iter().rev().collect(),
        contour_error: noise(LONG, 9),
        orientation_error: noise(LONG, 10),
    });
    let circle = |counterclockwise| CircleTrace {
        plane: ["x", "y"].map(str::to_owned),
        radius: 0.1,
        counterclockwise,
        angle: noise(LONG, 11).iter().map(|v| v * 10.0).collect(),
        deviation: noise(LONG, 12),
    };
    recording.circles = vec![circle(true), circle(false)];
    let plain = page("noise", vec![report_run("one", &recording)]);
    assert!(plain.len() < MOST_BYTES, "{} bytes", plain.len());

    let program = long_program(LONG, "#<_größe> = [\"text\"] G1 X100.123 Y100.123 (finishing pass)");
    let run = |title| ReportRun { program: Some(&program), ..report_run(title, &recording) };
    for runs in [vec![run("cascade")], vec![run("cascade"), run("gpc")]] {
        let page = page("noise", runs);
        assert!(page.len() < MOST_BYTES, "{} bytes", page.len());
        // Each line of a point has a text.
        let path = figure(&page, "Path of the tool");
        let lines = path["runs"][0]["lines"].as_array().expect("lines");
        assert!(lines.len() > 4000 && lines.iter().all(|line| path["texts"][line.to_string()].is_string()));
    }
}

/// Returns a path with noise, and one line with a text for each three cycles.
fn long_program(cycles: usize, text: &str) -> ToolPath {
    let (x, y) = (noise(cycles, 13), noise(cycles, 14));
    let mut path = ToolPath::default();
    for i in 0..cycles {
        path.add(&CycleError {
            time: i as f64 * 1e-3,
            line: 1 + i / 3,
            tip: [x[i], y[i], x[i] * y[i]],
            reference: [y[i], x[i], x[i]],
            contour_error: x[i].abs(),
            path_position: i as f64 * 1.1e-3,
            programmed_feed: 0.123_456_7,
            reached_feed: y[i].abs(),
            ..CycleError::default()
        });
        path.texts.insert(1 + i / 3, text.to_owned());
    }
    path
}

#[test]
fn runs_share_the_axes_of_their_charts() {
    let page = page("ballbar", two_runs());
    let axis = figure(&page, "X axis");
    let panels: Vec<&str> =
        axis["panels"].as_array().expect("panels").iter().filter_map(|p| p["y"]["label"].as_str()).collect();
    assert_eq!(
        panels,
        [
            "Position (mm)",
            "Velocity (m/min)",
            "Following error (µm)",
            "Delay-compensated error (µm)",
            "Current, cascade (A)",
            "Current, cascade-noff (A)"
        ]
    );
    // Both runs have the same setpoints, which are drawn once; each signal has the run that the page can hide.
    let runs: Vec<_> =
        axis["panels"][0]["series"].as_array().expect("series").iter().map(|s| s["run"].as_u64()).collect();
    assert_eq!(runs, [None, Some(0), Some(1)]);
    assert!(page.contains("<input type=\"checkbox\" checked value=\"1\">"));
    assert!(page.contains("are stationary; in parentheses: largest following error."));
}

#[test]
fn each_entry_of_a_legend_has_a_look_of_its_own() {
    for page in [page("ballbar", two_runs()), page("ballbar", vec![report_run("cascade", &BALLBAR[0])])] {
        let axis = figure(&page, "X axis");
        let panels = axis["panels"].as_array().expect("panels").iter();
        let series = panels.flat_map(|panel| panel["series"].as_array().expect("series"));
        let looks: BTreeSet<[String; 2]> =
            series.map(|s| [s["label"].to_string(), format!("{} {}", s["kind"], s["style"])]).collect();
        for i in 0..2 {
            let one: BTreeSet<&str> = looks.iter().map(|pair| pair[i].as_str()).collect();
            assert_eq!(one.len(), looks.len(), "{looks:?}");
        }
    }
}

#[test]
fn the_circle_has_its_deviation() {
    let page = page("ballbar", vec![report_run("cascade", &BALLBAR[0])]);
    let circle = figure(&page, "X–Y circle, R 150\u{a0}mm");
    assert_eq!((&circle["form"], &circle["axes"]), (&"circle".into(), &serde_json::json!(["X", "Y"])));
    let line = points(&circle, 0, "counterclockwise");
    let (low, high) = line.iter().map(|p| p[1]).fold((f64::MAX, f64::MIN), |(l, h), d| (l.min(d), h.max(d)));
    // Extremes of the reference trial.
    assert!((low - 47.7).abs() < 0.1 && (high - 68.6).abs() < 0.1, "{low:.1}…{high:.1} µm");
}

/// Returns the page of 100 mm along X with errors in +Y, m.
fn line_with_errors(error: impl Fn(usize) -> f64) -> String {
    let reference: Vec<[f64; 3]> = (0..=100).map(|i| [f64::from(i) * 1e-3, 0.0, 0.0]).collect();
    let position = reference.iter().enumerate().map(|(i, [x, ..])| [*x, error(i), 0.0]).collect();
    let contour_error = (0..=100).map(&error).collect();
    let recording = SignalRecording {
        time: (0..=100).map(f64::from).collect(),
        tool: Some(ToolTrace { reference, position, contour_error, orientation_error: Vec::new() }),
        ..SignalRecording::default()
    };
    page("line", vec![report_run("one", &recording)])
}

#[test]
fn the_path_error_can_be_magnified() {
    // The magnified error is at most 15 % of the path: 50 µm × 200 are 10 mm of 100.
    let page = line_with_errors(|_| 5e-5);
    let path = figure(&page, "Path of the tool");
    assert_eq!(path["magnification"], 200.0);
    let run = &path["runs"][0];
    assert_eq!(column(&run["deviation"][1]), vec![0.05; 101]);
    assert_eq!(column(&run["reference"][0]), (0..=100).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn figures_stand_in_columns_below_the_verdict() {
    let [ballbar, _] = &*BALLBAR;
    let table = Table {
        caption: "Path".to_owned(),
        columns: vec![
            TableColumn::new("figure", ""),
            TableColumn::new("unit", ""),
            TableColumn::of_run("cascade", 0),
            TableColumn::of_run("gpc", 1),
        ],
        rows: vec![
            vec!["circle".to_owned()],
            vec!["contour error".to_owned(), "µm".to_owned(), "68.6".to_owned(), "13.2 (−81 %)".to_owned()],
        ],
        ..Table::default()
    };
    let report = Report {
        title: "ballbar",
        verdict: vec!["gpc: contour error 68.6 → 13.2 µm, −81 %".to_owned()],
        tables: vec![table, Table::default()],
        notes: vec!["in parentheses: difference from cascade".to_owned()],
        runs: vec![report_run("cascade", ballbar), report_run("gpc", ballbar)],
        provenance: vec![("command".to_owned(), "virtual_axes run ballbar".to_owned())],
        ..Report::default()
    };
    let mut bytes = Vec::new();
    report.write(&mut bytes).expect("memory can be written");
    let page = String::from_utf8(bytes).expect("UTF-8");
    let verdict = page.find("<p class=\"verdict\">gpc: contour error").expect("a verdict");
    assert!(verdict < page.find("<caption><span>Path</span></caption>").expect("a table"));
    assert!(page.contains("<th scope=\"row\" class=\"group\">circle</th>"));
    assert!(page.contains("<td class=\"number\">13.2 (−81 %)</td>"));
    assert!(page.contains("<p>in parentheses: difference from cascade</p>"));
    assert!(page.contains("<th scope=\"row\">command</th>") && page.contains("Provenance"));
    // Each run has a sample of its line in the heading of its column.
    assert!(between(&page, "<thead>", "</thead>")[0].contains("line run-2"));
}

#[test]
fn facts_of_runs_are_merged() {
    let mut runs = two_runs();
    for change in ["x.position_loop.gain=2", "y.position_loop.gain=2"] {
        runs[1].facts.push(("set".to_owned(), change.to_owned()));
    }
    let changed = page("two", runs);
    assert!(changed.contains("<td></td><td>x.position_loop.gain=2, y.position_loop.gain=2</td>"));
    // Equal values of all runs are merged.
    assert!(changed.contains("<td class=\"same\" colspan=\"2\">mikron_ucp710</td>"));
}

#[test]
fn reached_limits_are_stated_and_shaded() {
    let mut recording = run_of(&[0.0, 1.0, 2.0, 3.0, 4.0]);
    recording.axes[0].saturation = vec![0.0, 0.5, 1.0, 0.0, 0.25];
    let limited = page("limits", vec![report_run("one", &recording)]);
    let first = recording.time[1];
    let sentence = format!("at a limit of speed, current or voltage 2 times, first at {first:.3} s");
    assert!(limited.contains(&sentence), "{sentence}");
    let bands = &figure(&limited, "X axis")["bands"][0];
    assert_eq!((&bands["class"], bands["ends"].as_array().map(Vec::len)), (&"at-limit".into(), Some(2)));
    recording.axes[0].saturation = vec![0.0; 5];
    let free = page("limits", vec![report_run("one", &recording)]);
    assert!(
        !free.contains("at a limit of speed") && figure(&free, "X axis")["bands"] == serde_json::json!([])
    );
}

#[test]
fn the_path_has_its_errors() {
    let page = line_with_errors(|i| 80e-6 * i as f64 / 100.0);
    let errors = column(&figure(&page, "Path of the tool")["runs"][0]["error"]);
    assert!(errors[0] == 0.0 && errors[50] == 40.0 && errors[100] == 80.0);
}
