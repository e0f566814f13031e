//! Report pages: contents, escaping, decimation, and robustness to invalid values.

use std::sync::LazyLock;

use crate::report_common::{
    NO_FEEDFORWARD, POSITION_CYCLE, ballbar, between, empty_axis, five_axes, picture, pictures, points,
    report_run,
};
use virtual_axes_core::assess::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};
use virtual_axes_core::config::AxisKind;
use virtual_axes_report::{Report, ReportRun, Section, Table, TableColumn};

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

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric())
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
    };
    let run = || ReportRun {
        title: hostile,
        facts: vec![(hostile.to_owned(), hostile.to_owned())],
        recording: &recording,
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
    };
    report.write(&mut bytes).expect("memory can be written");
    let page = String::from_utf8(bytes).expect("UTF-8");
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
    for forbidden in ["http:", "https:", "src=", "url(", "@import", "<link", "<script", "href"] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
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
            let bad = words(&page).find(|w| ["nan", "inf", "infinity"].contains(&w.to_lowercase().as_str()));
            let position = bad.and_then(|word| page.find(word)).unwrap_or(0);
            assert_eq!(
                bad,
                None,
                "{values:?}: …{}",
                &page[position.saturating_sub(200)..].chars().take(300).collect::<String>()
            );
            let most = pictures(&page).iter().map(|p| p.matches("<text").count()).max();
            assert!(most.unwrap_or(0) < 40, "{most:?} texts in a plot of {values:?}");
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
    let units = ["(mm)", "(°)", "(µm)", "(mdeg)", "(m/min)", "(rpm)", "(A)"];
    for picture in pictures(&page) {
        let labels = between(picture, "<text class=\"label\"", "</text>");
        if picture.contains("class=\"nominal\"") {
            // A polar plot has the directions of the axes and rings with units.
            assert!(labels.len() == 4 && picture.contains("µm</text>"), "{labels:?}");
        } else {
            let named =
                labels.iter().filter(|l| l.contains("Time (s)") || units.iter().any(|u| l.contains(u)));
            assert_eq!(named.count(), 2, "{labels:?}");
        }
        assert!(picture.contains("<title") && picture.contains("<desc"));
        assert!(!between(picture, "<desc", "</desc>")[0].is_empty());
    }
    for unit in units {
        assert!(page.contains(&format!("{unit}</text>")), "{unit} is missing");
    }
}

#[test]
fn a_single_peak_among_many_samples_is_kept() {
    let mut values = vec![0.0; 60_000];
    values[34_567] = 3e-6;
    let recording = run_of(&values);
    let page = page("spike", vec![report_run("one", &recording)]);
    let picture = picture(&page, "X axis: following error");
    let line = points(between(picture, "<path class=\"line run-1\" d=\"", "\"")[0]);
    let heights: Vec<f64> = line.iter().map(|p| p[1]).collect();
    let (top, bottom) = heights.iter().fold((f64::MAX, f64::MIN), |(t, b), y| (t.min(*y), b.max(*y)));
    let area: f64 = between(picture, "<rect", "/>")[0]
        .split("height=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next()?.parse().ok())
        .expect("an area");
    assert!(bottom - top > 0.8 * area, "{top}…{bottom} of {area}");
    let spike = line.iter().find(|p| p[1] == top).expect("it is present");
    // The line extends from the first to the last sample.
    let (first, last) = (line[0][0], line[line.len() - 1][0]);
    let share = (spike[0] - first) / (last - first);
    assert!((share - 34_567.0 / 59_999.0).abs() < 1e-3, "at {share}");
}

#[test]
fn the_page_size_of_a_long_run_is_bounded() {
    const LONG: usize = 60_000;
    const MOST_BYTES: usize = 2_000_000;
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
    let page = page("noise", vec![report_run("one", &recording)]);
    println!("{} bytes for noise in every signal", page.len());
    assert!(page.len() < MOST_BYTES, "{} bytes", page.len());
}

#[test]
fn runs_are_compared_at_one_scale() {
    let page = page("ballbar", two_runs());
    let ticks = |title: &str| between(picture(&page, title), "<text class=\"tick", "</text>").join(" ");
    for (one, other) in [
        ("X axis: current and its components, cascade<", "X axis: current and its components, cascade-noff<"),
        ("X–Y circle, R 150\u{a0}mm, cascade<", "X–Y circle, R 150\u{a0}mm, cascade-noff<"),
        ("X–Y path, cascade<", "X–Y path, cascade-noff<"),
    ] {
        assert_eq!(ticks(one), ticks(other), "{one}");
    }
    // 64 µm is invisible at the scale of 9980 µm: it has a second plot.
    let errors =
        pictures(&page).iter().filter(|p| p.contains(">X axis: delay-compensated following error<")).count();
    assert_eq!(errors, 2);
    assert_eq!(pictures(&page).iter().filter(|p| p.contains(">X axis: velocity<")).count(), 1);
    assert!(page.contains("Z (largest following error") && page.contains("are stationary."));
}

#[test]
fn the_circle_is_drawn_at_its_deviation() {
    let page = page("ballbar", vec![report_run("cascade", &BALLBAR[0])]);
    let polar = picture(&page, "X–Y circle");
    // Rings every 20 µm from 0 to 80 µm give the scale.
    let radii: Vec<f64> = ["<circle class=\"nominal\"", "<circle class=\"ring\""]
        .into_iter()
        .flat_map(|circle| between(polar, circle, "/>"))
        .map(|ring| between(ring, "r=\"", "\"").pop().and_then(|r| r.parse().ok()).expect("a radius"))
        .collect();
    assert_eq!(radii.len(), 5);
    let per_micrometer = (radii[4] - radii[0]) / 80.0;
    let line = points(between(polar, "<path class=\"line run-1 ccw\" d=\"", "\"")[0]);
    let center = 230.0;
    let deviation = |p: &[f64; 2]| ((p[0] - center).hypot(p[1] - center) - radii[0]) / per_micrometer;
    let (low, high) = line.iter().map(deviation).fold((f64::MAX, f64::MIN), |(l, h), d| (l.min(d), h.max(d)));
    // Extremes of the reference trial, within the resolution of a tenth of a pixel.
    assert!((low - 47.7).abs() < 1.0 && (high - 68.6).abs() < 1.0, "{low:.1}…{high:.1} µm");
}

#[test]
fn the_path_error_is_magnified_by_the_factor_of_the_caption() {
    // 100 mm along X with an error of 50 µm in +Y: the magnified error is at most 15 % of the path.
    let reference: Vec<[f64; 3]> = (0..=100).map(|i| [f64::from(i) * 1e-3, 0.0, 0.0]).collect();
    let position = reference.iter().map(|[x, ..]| [*x, 5e-5, 0.0]).collect();
    let contour_error = vec![5e-5; 101];
    let recording = SignalRecording {
        time: (0..=100).map(f64::from).collect(),
        tool: Some(ToolTrace { reference, position, contour_error, orientation_error: Vec::new() }),
        ..SignalRecording::default()
    };
    let page = page("line", vec![report_run("one", &recording)]);
    assert!(page.contains("<span class=\"note\">error × 200</span>"));
    let path = picture(&page, "X–Y path");
    let line = |before: &str| points(between(path, before, "\"")[0]);
    let (reference, tip) =
        (line("<path class=\"reference\" d=\""), line("<path class=\"line solid run-1\" d=\""));
    let per_millimeter = (reference[reference.len() - 1][0] - reference[0][0]) / 100.0;
    // SVG coordinates decrease upwards; 200 × 50 µm.
    let shown = (reference[0][1] - tip[0][1]) / per_millimeter;
    assert!((shown - 10.0).abs() < 0.1, "{shown} mm");
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
    assert!(verdict < page.find("<caption>Path</caption>").expect("a table"));
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
    assert_eq!(picture(&limited, "X axis: current").matches("class=\"at-limit\"").count(), 2);
    recording.axes[0].saturation = vec![0.0; 5];
    assert!(!page("limits", vec![report_run("one", &recording)]).contains("Limits reached"));
}

#[test]
fn the_path_is_colored_by_its_error() {
    // The error rises linearly to 80 µm: each quarter of the path is in one class.
    let reference: Vec<[f64; 3]> = (0..=100).map(|i| [f64::from(i) * 1e-3, 0.0, 0.0]).collect();
    let error = |i: usize| 80e-6 * i as f64 / 100.0;
    let position = reference.iter().enumerate().map(|(i, [x, ..])| [*x, error(i), 0.0]).collect();
    let contour_error = (0..=100).map(error).collect();
    let recording = SignalRecording {
        time: (0..=100).map(f64::from).collect(),
        tool: Some(ToolTrace { reference, position, contour_error, orientation_error: Vec::new() }),
        ..SignalRecording::default()
    };
    let page = page("line", vec![report_run("one", &recording)]);
    let path = picture(&page, "X–Y path");
    let span = |class: usize| {
        let line = points(between(path, &format!("<path class=\"line solid error-{class}\" d=\""), "\"")[0]);
        line[line.len() - 1][0] - line[0][0]
    };
    let quarter = span(2);
    assert!(quarter > 60.0, "{quarter}");
    assert!((span(1) - quarter).abs() < 8.0 && (span(3) - quarter).abs() < 8.0);
    assert!(
        page.contains("contour error up to 80.0\u{a0}µm"),
        "{}",
        between(&page, "<span class=\"legend\">", "</figcaption>")[0]
    );
}
