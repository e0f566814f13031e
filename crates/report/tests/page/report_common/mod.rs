//! Recordings of simulated runs and helpers to parse pages.

pub mod charts;

use serde_json::Value;
use virtual_axes_core::assess::{AxisTrace, CircleTrace, SignalRecording, ToolTrace};
use virtual_axes_core::config::AxisKind;
use virtual_axes_report::ReportRun;

use virtual_axes_verification::fixtures::machines::{self, AXES, Ballbar, machine};

/// Names and kinds of the default machine's axes.
const JOINTS: [(&str, AxisKind); AXES] = [
    ("x", AxisKind::Linear),
    ("y", AxisKind::Linear),
    ("z", AxisKind::Linear),
    ("a", AxisKind::Rotary),
    ("c", AxisKind::Rotary),
];

/// Position cycle of the default machine in ticks of the current cycle.
pub const POSITION_CYCLE: u64 = 48;
/// Number of ticks between two points of a circle.
const CIRCLE_TICKS: u64 = 4;

/// Parameters that disable the feedforward of X and Y.
pub const NO_FEEDFORWARD: [(&str, f64); 4] = [
    ("x.feedforward.velocity", 0.0),
    ("y.feedforward.velocity", 0.0),
    ("x.feedforward.torque_kg_m2", 0.0),
    ("y.feedforward.torque_kg_m2", 0.0),
];

/// Returns an axis without samples.
pub fn empty_axis(name: &str, kind: AxisKind) -> AxisTrace {
    let none = Vec::new;
    AxisTrace {
        name: name.to_owned(),
        kind,
        moves: true,
        psec: none(),
        position: none(),
        following_error: none(),
        delay_compensated_following_error: none(),
        velocity: none(),
        current: none(),
        current_setpoint: none(),
        friction_current: none(),
        gravity_current: none(),
        load_current: none(),
        saturation: none(),
    }
}

/// Records every `every`-th tick of a motion; `nearest` returns the point of the path that is nearest to the
/// tool tip.
pub fn record(
    changes: &[(&str, f64)],
    duration: f64,
    psec: impl Fn(f64) -> [f64; AXES],
    nearest: impl Fn([f64; 3]) -> [f64; 3],
    every: u64,
) -> SignalRecording {
    let mut machine = machine(changes);
    let mut axes = JOINTS.map(|(name, kind)| empty_axis(name, kind)).to_vec();
    let mut tool = ToolTrace::default();
    let mut recording = SignalRecording::default();
    machines::run(&mut machine, duration, psec, |time, machine| {
        if !machine.tick().is_multiple_of(every) {
            return;
        }
        recording.time.push(time);
        let mut tip = [0.0; 3];
        for (i, axis) in axes.iter_mut().enumerate() {
            let s = machine.axis(i).sample();
            axis.psec.push(s.psec);
            axis.position.push(s.position);
            axis.following_error.push(s.following_error());
            axis.delay_compensated_following_error.push(s.delay_compensated_following_error());
            axis.velocity.push(s.velocity);
            axis.current.push(s.current);
            axis.current_setpoint.push(s.current_setpoint);
            axis.friction_current.push(s.friction_current);
            axis.gravity_current.push(s.gravity_current);
            axis.load_current.push(s.load_current);
            axis.saturation.push(f64::from(u8::from(s.saturated)));
            if i < 3 {
                tip[i] = s.position;
            }
        }
        let reference = nearest(tip);
        let error = (0..3).map(|i| (tip[i] - reference[i]).powi(2)).sum::<f64>().sqrt();
        tool.reference.push(reference);
        tool.position.push(tip);
        tool.contour_error.push(error);
    });
    for axis in &mut axes {
        let first = axis.psec.first().copied();
        axis.moves = axis.psec.iter().any(|p| Some(*p) != first);
    }
    recording.axes = axes;
    recording.tool = Some(tool);
    recording
}

/// Records the ballbar trial, counterclockwise and, unless `one_way`, clockwise.
pub fn ballbar(changes: &[(&str, f64)], every: u64, one_way: bool) -> SignalRecording {
    let trial = Ballbar::paper();
    let radius = trial.radius;
    let nearest = |tip: [f64; 3]| {
        let angle = tip[1].atan2(tip[0] + radius);
        [radius * (angle.cos() - 1.0), radius * angle.sin(), 0.0]
    };
    let mut recording = record(changes, trial.duration(), |t| trial.psec(t), nearest, every);
    // A few ticks are sufficient to plot a circle.
    let finer = record(changes, trial.duration(), |t| trial.psec(t), nearest, CIRCLE_TICKS);
    recording.circles.push(circle(&finer, trial, true));
    if !one_way {
        let backwards = |t: f64| {
            let [x, y, z, a, c] = trial.psec(t);
            [x, -y, z, a, c]
        };
        let other = record(changes, trial.duration(), backwards, nearest, CIRCLE_TICKS);
        recording.circles.push(circle(&other, trial, false));
    }
    recording
}

/// Returns the circle at steady feed.
fn circle(recording: &SignalRecording, trial: Ballbar, counterclockwise: bool) -> CircleTrace {
    let window = trial.window();
    let tool = recording.tool.as_ref().expect("it has a tool");
    let steady = recording.time.iter().zip(&tool.position).filter(|(t, _)| window.contains(t));
    let (angle, deviation) =
        steady.map(|(_, p)| (p[1].atan2(p[0] + trial.radius), trial.radial_deviation(p[0], p[1]))).unzip();
    CircleTrace {
        plane: ["x", "y"].map(str::to_owned),
        radius: trial.radius,
        counterclockwise,
        angle,
        deviation,
    }
}

/// Returns a function to the nearest point of a path, which searches forward from the previous point.
fn nearest_on(psec: impl Fn(f64) -> [f64; AXES], duration: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    let step = 2e-4;
    let count = (duration / step).ceil() as u32;
    let path: Vec<[f64; 3]> = (0..=count)
        .map(|i| {
            let [x, y, z, ..] = psec(f64::from(i) * step);
            [x, y, z]
        })
        .collect();
    let last = std::cell::Cell::new(0);
    move |tip| {
        let distance = |i: usize| (0..3).map(|k| (path[i][k] - tip[k]).powi(2)).sum::<f64>();
        let from = last.get();
        let near = from..(from + 300).min(path.len());
        // The last of equally distant points: the motion continues after a rest.
        let best = near.rev().min_by(|&i, &j| distance(i).total_cmp(&distance(j))).unwrap_or(from);
        last.set(best);
        path[best]
    }
}

/// Records a motion of all five axes with different frequencies.
pub fn five_axes(every: u64) -> SignalRecording {
    let amplitudes = [0.05, -0.03, 0.02, 0.4, 1.0];
    let duration = 7.5;
    let psec = |t: f64| {
        let mut values = amplitudes;
        for (i, value) in values.iter_mut().enumerate() {
            // Cosine whose argument starts and ends at rest.
            let phase = (t / duration).clamp(0.0, 1.0);
            let turns = [1.0, 2.0, 3.0, 1.0, 2.0][i];
            let smooth = phase * phase * (3.0 - 2.0 * phase);
            *value *= (1.0 - (std::f64::consts::TAU * turns * smooth).cos()) / 2.0;
        }
        values
    };
    let mut recording = record(&[], duration, psec, nearest_on(psec, duration), every);
    if let Some(tool) = &mut recording.tool {
        let c = &recording.axes[4].delay_compensated_following_error;
        tool.orientation_error = c.iter().map(|e| e.abs()).collect();
    }
    recording
}

/// Returns a run of a report with its figures.
pub fn report_run<'a>(title: &'a str, recording: &'a SignalRecording) -> ReportRun<'a> {
    let facts = [("machine", "mikron_ucp710"), ("controller", title)];
    let facts = facts.map(|(name, value)| (name.to_owned(), value.to_owned())).to_vec();
    ReportRun { title, facts, recording, program: None }
}

/// Returns all texts between `before` and `after`.
pub fn between<'a>(text: &'a str, before: &'a str, after: &'a str) -> Vec<&'a str> {
    text.split(before).skip(1).map(|rest| rest.split_once(after).expect("it ends").0).collect()
}

/// Returns the page without its scripts and their data.
pub fn without_scripts(page: &str) -> String {
    let (first, rest) = page.split_once("<script").unwrap_or((page, ""));
    let others = rest.split("<script").filter_map(|script| Some(script.split_once("</script>")?.1));
    first.to_owned() + &others.collect::<String>()
}

/// Asserts that elements are nested correctly, and that every bracket belongs to a tag.
pub fn assert_well_formed(page: &str) {
    let page = without_scripts(page);
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a document type");
    while let Some((text, after)) = rest.split_once('<') {
        assert!(!text.contains('>') || open.last() == Some(&"style"), "{text}");
        let (tag, after) = after.split_once('>').expect("tags end");
        assert!(!tag.contains('<'), "{tag}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.trim_matches('/').split(' ').next().unwrap_or_default();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "{tag}");
        } else if !["meta", "input"].contains(&name) && !tag.ends_with('/') {
            open.push(name);
        }
        rest = after;
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "{open:?} {rest}");
}

/// Asserts that a page loads nothing, and that no text or datum is an invalid number.
pub fn assert_self_contained(page: &str) {
    let text = without_scripts(page);
    for forbidden in ["http:", "https:", "src=", "url(", "@import", "<link", "href"] {
        assert!(!text.contains(forbidden), "{forbidden}");
    }
    let bad = |word: &str| ["nan", "inf", "infinity"].contains(&word.to_lowercase().as_str());
    let mut words = text.split(|c: char| !c.is_alphanumeric());
    assert_eq!(words.find(|word| bad(word)), None);
    // The data are JSON, which has no invalid numbers.
    let _ = figures(page);
}

/// Returns titles and data of the figures of a page.
pub fn figures(page: &str) -> Vec<(&str, Value)> {
    let parts = between(page, "<figure>", "</figure>");
    let of_part = |part| {
        let data = between(part, "<script type=\"application/json\">", "</script>")[0];
        (between(part, "<span class=\"title\">", "</span>")[0], serde_json::from_str(data).expect("JSON"))
    };
    parts.into_iter().map(of_part).collect()
}

/// Returns the data of the figure whose title starts with `title`.
pub fn figure(page: &str, title: &str) -> Value {
    let found = figures(page).into_iter().find(|(found, _)| found.starts_with(title));
    found.unwrap_or_else(|| panic!("no figure {title}")).1
}

/// Returns a column of numbers; null is NaN.
pub fn column(values: &Value) -> Vec<f64> {
    values.as_array().expect("a list").iter().map(|value| value.as_f64().unwrap_or(f64::NAN)).collect()
}

/// Returns the points of a series of a chart, in the units of its axes.
pub fn points(chart: &Value, panel: usize, label: &str) -> Vec<[f64; 2]> {
    let all = chart["panels"][panel]["series"].as_array().expect("series");
    let series = all.iter().find(|series| series["label"] == label).unwrap_or_else(|| panic!("no {label}"));
    column(&series["x"]).into_iter().zip(column(&series["y"])).map(|(x, y)| [x, y]).collect()
}
