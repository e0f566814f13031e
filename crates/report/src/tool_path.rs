//! Path of the tool of a run in bounded memory, with errors, and feed and source line of part programs.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};
use virtual_axes_core::assess::ToolTrace;
use virtual_axes_core::text::cut;
use virtual_axes_core::units::{METER_PER_MINUTE, MICROMETER, MILLIMETER};
use virtual_axes_nc::offline::CycleError;

use super::chart::{ChartSeries, SeriesStyle};
use super::extent::{Extent, is_drawable, peak};
use super::figure_json::rounded;

/// Largest number of points of a path; of longer paths, points that show least are dropped.
const MOST: usize = 16_384;
/// Largest number of points of all paths of a page.
const MOST_OF_PAGE: usize = 12_000;
/// Size of the texts of lines of a page above which they are cut, bytes.
const TEXT_BYTES: usize = 700_000;
/// Largest magnified error, as a fraction of the extent of the path.
const SHARE: f64 = 0.15;
/// Error below which the magnification does not increase, m; smaller errors are noise.
const LEAST_ERROR: f64 = 1e-7;

/// Value with its time, s.
type TimeValue = [f64; 2];

/// Point of a path; stands also for dropped points beside it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PathPoint {
    /// Position cycle with the largest contour error.
    at: CycleError,
    /// Lowest and highest reached feed, m/s.
    reached: [TimeValue; 2],
    /// Highest programmed feed, m/s; NaN at rapid traverse and where rotary axes move alone.
    programmed: TimeValue,
}

impl PathPoint {
    fn is_rapid(&self) -> bool {
        self.at.programmed_feed == f64::INFINITY
    }

    /// Returns the point with the larger error, with all extremes of the feed of both.
    fn joined(self, next: Self) -> Self {
        let least = |a: TimeValue, b: TimeValue| if b[1] < a[1] { b } else { a };
        let most = |a: TimeValue, b: TimeValue| if b[1] > a[1] || a[1].is_nan() { b } else { a };
        Self {
            at: if next.at.contour_error > self.at.contour_error { next.at } else { self.at },
            reached: [least(self.reached[0], next.reached[0]), most(self.reached[1], next.reached[1])],
            programmed: most(self.programmed, next.programmed),
        }
    }
}

/// Path of the tool tip with contour error, feed and source line.
#[derive(Debug, Clone, Default)]
pub struct ToolPath {
    points: Vec<PathPoint>,
    /// Texts of source lines.
    pub texts: BTreeMap<usize, String>,
}

impl ToolPath {
    /// Creates the path of a recording, which has no lines and feeds.
    pub(crate) fn from_trace(time: &[f64], tool: &ToolTrace) -> Self {
        let mut path = ToolPath::default();
        let mut cycle =
            CycleError { programmed_feed: f64::NAN, reached_feed: f64::NAN, ..CycleError::default() };
        let pairs = tool.reference.iter().zip(&tool.position).zip(&tool.contour_error).zip(time);
        for (index, (((&reference, &tip), &contour_error), &time)) in pairs.enumerate() {
            let step = if index == 0 { 0.0 } else { distance(reference, cycle.reference) };
            let path_position = cycle.path_position + if is_drawable(step) { step } else { 0.0 };
            cycle = CycleError { time, tip, reference, contour_error, path_position, ..cycle };
            path.add(&cycle);
        }
        path
    }

    /// Adds a position cycle.
    pub fn add(&mut self, cycle: &CycleError) {
        let feed = cycle.programmed_feed;
        let programmed = if feed.is_finite() { feed } else { f64::NAN };
        let reached = [[cycle.time, cycle.reached_feed]; 2];
        self.points.push(PathPoint { at: *cycle, reached, programmed: [cycle.time, programmed] });
        if self.points.len() == MOST {
            self.points = thinned(&self.points);
        }
    }

    /// Returns the source lines of the points.
    pub fn lines(&self) -> BTreeSet<usize> {
        self.points.iter().map(|point| point.at.line).filter(|line| *line > 0).collect()
    }

    /// Returns programmed and reached feed over time.
    pub(crate) fn feeds(&self, run: usize, label: &str) -> [ChartSeries; 2] {
        let reached = self.points.iter().flat_map(|point| {
            let [least, most] = point.reached;
            if least[0] <= most[0] { [least, most] } else { [most, least] }
        });
        let programmed = self.points.iter().map(|point| point.programmed).collect();
        [
            ChartSeries::new("programmed", SeriesStyle::Commanded, programmed).of_run(run),
            ChartSeries::new(label, SeriesStyle::Line(run), reached.collect()).of_run(run),
        ]
    }
}

/// Drops about a quarter of the points: of the pairs of neighbors that are closest to a straight line, the point with the
/// smaller error. Points between rapid traverse and feed stay.
fn thinned(points: &[PathPoint]) -> Vec<PathPoint> {
    let cost = |pair: usize| {
        let (i, j) = (2 * pair, 2 * pair + 1);
        if points[i].is_rapid() != points[j].is_rapid() {
            return f64::INFINITY;
        }
        let dropped = if points[i].at.contour_error < points[j].at.contour_error { i } else { j };
        match (points.get(dropped.wrapping_sub(1)), points.get(dropped + 1)) {
            (Some(a), Some(b)) => from_line(points[dropped].at.tip, a.at.tip, b.at.tip),
            _ => f64::INFINITY,
        }
    };
    let mut costs: Vec<(f64, usize)> = (0..points.len() / 2).map(|pair| (cost(pair), pair)).collect();
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    costs.truncate(costs.len() / 2);
    let dropped: BTreeSet<usize> = costs.into_iter().map(|(_, pair)| pair).collect();
    let pairs = points.chunks(2).enumerate();
    let kept = pairs.flat_map(|(number, pair)| match pair {
        [a, b] if dropped.contains(&number) => vec![a.joined(*b)],
        pair => pair.to_vec(),
    });
    kept.collect()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Returns the distance of `p` from the line segment between `a` and `b`.
fn from_line(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let along = [0, 1, 2].map(|i| b[i] - a[i]);
    let squared = along.iter().map(|v| v * v).sum::<f64>();
    let dot: f64 = (0..3).map(|i| along[i] * (p[i] - a[i])).sum();
    let part = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    distance(p, [0, 1, 2].map(|i| a[i] + part * along[i]))
}

/// Path of one run of a page.
#[derive(Debug, Clone)]
pub struct RunPath {
    /// Title of the run.
    pub title: String,
    /// Index of the run.
    pub run: usize,
    /// Path of the tool.
    pub path: ToolPath,
}

impl PartialEq for RunPath {
    fn eq(&self, other: &Self) -> bool {
        (&self.title, self.run, &self.path.points) == (&other.title, other.run, &other.path.points)
    }
}

impl RunPath {
    /// Returns note and data of the figure of the paths that are more than a point; `None` without them.
    pub(crate) fn figure(paths: &[RunPath]) -> Option<(&'static str, Value)> {
        let span = |path: &ToolPath| {
            let along = |axis| Extent::of(path.points.iter().map(|point| point.at.reference[axis]));
            (0..3).filter_map(|axis| Some(along(axis)?.span())).fold(0.0, f64::max)
        };
        let paths: Vec<&RunPath> = paths.iter().filter(|run| span(&run.path) > 0.0).collect();
        let extent = paths.iter().map(|run| span(&run.path)).fold(0.0, f64::max);
        let points = || paths.iter().flat_map(|run| &run.path.points);
        let error = peak(points().map(|point| point.at.contour_error)).max(LEAST_ERROR);
        let magnification = round_down((SHARE * extent / error).max(1.0));
        let has_rapids = points().any(PathPoint::is_rapid);
        let note = if has_rapids {
            "mm; color: contour error; dashed: rapid traverse"
        } else {
            "mm; color: contour error"
        };
        let most = (MOST_OF_PAGE / paths.len().max(1)).max(MOST / 16);
        let thinned = paths.iter().map(|run| {
            let mut points = run.path.points.clone();
            while points.len() > most {
                points = thinned(&points);
            }
            points
        });
        let thinned: Vec<Vec<PathPoint>> = thinned.collect();
        let runs: Vec<Value> = paths.iter().zip(&thinned).map(|(run, points)| run.json(points)).collect();
        let lines: BTreeSet<usize> = thinned.iter().flatten().map(|point| point.at.line).collect();
        let texts = paths.iter().flat_map(|run| &run.path.texts).filter(|(line, _)| lines.contains(line));
        let texts = bounded(texts.map(|(line, text)| (*line, text.clone())).collect());
        let json = json!({ "form": "path", "magnification": magnification, "runs": runs, "texts": texts });
        (!paths.is_empty()).then_some((note, json))
    }

    fn json(&self, points: &[PathPoint]) -> Value {
        let column = |value: &dyn Fn(&PathPoint) -> f64| -> Vec<Value> {
            points.iter().map(|point| rounded(value(point))).collect()
        };
        let columns =
            |value: &dyn Fn(&PathPoint, usize) -> f64| [0, 1, 2].map(|i| column(&|point| value(point, i)));
        let lines: Vec<usize> = points.iter().map(|point| point.at.line).collect();
        let has_lines = lines.iter().any(|line| *line > 0);
        json!({
            "title": self.title,
            "run": self.run,
            "time": column(&|point| point.at.time),
            "path": column(&|point| point.at.path_position / MILLIMETER),
            "reference": columns(&|point, i| point.at.reference[i] / MILLIMETER),
            "deviation": columns(&|point, i| ((point.at.tip[i] - point.at.reference[i]) * 1e9).round() * 1e-6),
            "error": column(&|point| point.at.contour_error / MICROMETER),
            "feed": if has_lines { column(&|point| point.at.reached_feed / METER_PER_MINUTE) } else { Vec::new() },
            "rapid": if has_lines { column(&|point| f64::from(u8::from(point.is_rapid()))) } else { Vec::new() },
            "lines": if has_lines { lines } else { Vec::new() },
        })
    }
}

/// Cuts the texts of lines until they have at most [`TEXT_BYTES`] on the page.
fn bounded(mut texts: BTreeMap<usize, String>) -> BTreeMap<usize, String> {
    // Key, quotation marks and comma; each `<` is escaped.
    let bytes = |text: &String| 12 + text.len() + 5 * text.matches(['<', '"', '\\']).count();
    let mut most = texts.values().map(|text| text.chars().count()).max().unwrap_or(0);
    while most > 8 && texts.values().map(bytes).sum::<usize>() > TEXT_BYTES {
        most -= most / 4;
        texts.values_mut().for_each(|text| *text = cut(text, most));
    }
    texts
}

/// Returns the largest number of the form 1, 2 or 5 times a power of ten that is at most `value`.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powi(value.log10().floor() as i32);
    let factor = [5.0, 2.0].into_iter().find(|factor| factor * power <= value * (1.0 + 1e-12)).unwrap_or(1.0);
    factor * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(k: usize, contour_error: f64) -> CycleError {
        let time = 1e-3 * k as f64;
        let tip = [time.cos(), time.sin(), 0.0];
        CycleError {
            time,
            tip,
            contour_error,
            reached_feed: 0.1,
            programmed_feed: 0.2,
            ..CycleError::default()
        }
    }

    #[test]
    fn a_long_path_keeps_every_peak_and_its_shape() {
        let mut path = ToolPath::default();
        for k in 0..10 * MOST + 7 {
            let mut cycle = cycle(k, if k == 777 { 9e-6 } else { 1e-6 });
            cycle.reached_feed = match k {
                12_345 => 0.5,
                30_001 => 0.01,
                _ => 0.1,
            };
            if k % 2 == 0 && k > 100_000 {
                cycle.programmed_feed = f64::INFINITY;
            }
            path.add(&cycle);
        }
        assert!(path.points.len() < MOST && path.points.len() > MOST / 2, "{}", path.points.len());
        assert!(path.points.iter().any(|point| point.at == cycle(777, 9e-6)));
        let [programmed, reached] = path.feeds(0, "reached");
        assert!(reached.points.contains(&[12.345, 0.5]) && reached.points.contains(&[1e-3 * 30_001.0, 0.01]));
        assert!(reached.points.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
        assert!(programmed.points.iter().all(|point| point[1] == 0.2 || point[1].is_nan()));
    }

    #[test]
    fn a_corner_stays_and_points_on_a_line_are_dropped() {
        let tip = |k: usize| if k < 5000 { [k as f64, 0.0, 0.0] } else { [5000.0, k as f64 - 5000.0, 0.0] };
        let points: Vec<CycleError> = (0..10_001)
            .map(|k| CycleError { tip: tip(k), time: k as f64, ..CycleError::default() })
            .collect();
        let mut path = ToolPath::default();
        points.iter().for_each(|point| path.add(point));
        let mut thin = path.points;
        for _ in 0..12 {
            thin = thinned(&thin);
        }
        assert!(thin.len() < 500, "{}", thin.len());
        let near = |point: &PathPoint| distance(point.at.tip, [5000.0, 0.0, 0.0]) <= 1.0;
        assert!(thin.iter().any(near) && thin[0].at == points[0]);
    }

    #[test]
    fn magnifications_are_round() {
        let found = [1.0, 1.99, 2.0, 4.9, 5.0, 99.0, 300.0, 5e5].map(round_down);
        assert_eq!(found, [1.0, 1.0, 2.0, 2.0, 5.0, 50.0, 200.0, 5e5]);
    }
}
