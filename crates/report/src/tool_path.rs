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

/// Signal over time in bounded memory: groups of equally many values, each with its first, lowest, highest and last one.
#[derive(Debug, Clone, Default)]
struct Envelope {
    groups: Vec<[TimeValue; 4]>,
    /// Binary logarithm of the number of values of a group.
    level: u32,
    /// Number of values of the last group.
    count: usize,
}

impl Envelope {
    fn add(&mut self, value: TimeValue) {
        match self.groups.last_mut() {
            Some(last) if self.count < 1 << self.level => {
                *last = Self::joined(*last, [value; 4]);
                self.count += 1;
            }
            _ => {
                if self.groups.len() == MOST / 2 {
                    self.groups = self.groups.chunks(2).map(|pair| Self::joined(pair[0], pair[1])).collect();
                    self.level += 1;
                }
                self.groups.push([value; 4]);
                self.count = 1;
            }
        }
    }

    fn joined(a: [TimeValue; 4], b: [TimeValue; 4]) -> [TimeValue; 4] {
        let least = if b[1][1] < a[1][1] || a[1][1].is_nan() { b[1] } else { a[1] };
        let most = if b[2][1] > a[2][1] || a[2][1].is_nan() { b[2] } else { a[2] };
        [a[0], least, most, b[3]]
    }

    fn points(&self) -> Vec<TimeValue> {
        let mut points = self.groups.concat();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        points.dedup_by_key(|point| point[0]);
        points
    }
}

/// Path of the tool tip with contour error, feed and source line.
#[derive(Debug, Clone, Default)]
pub struct ToolPath {
    points: Vec<CycleError>,
    contour_error: Envelope,
    reached_feed: Envelope,
    /// Programmed feed, m/s; NaN at rapid traverse and where rotary axes move alone.
    programmed_feed: Envelope,
    /// Position cycles of the worst lines, which replace those of the same time.
    pub(crate) worst: Vec<CycleError>,
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
        let programmed = Some(cycle.programmed_feed).filter(|feed| feed.is_finite());
        self.contour_error.add([cycle.time, cycle.contour_error]);
        self.reached_feed.add([cycle.time, cycle.reached_feed]);
        self.programmed_feed.add([cycle.time, programmed.unwrap_or(f64::NAN)]);
        self.points.push(*cycle);
        if self.points.len() == MOST {
            self.points = thinned(&self.points);
        }
    }

    /// Returns the source lines of the points.
    pub fn lines(&self) -> BTreeSet<usize> {
        self.points.iter().map(|point| point.line).filter(|line| *line > 0).collect()
    }

    /// Returns the contour error against the programmed path over time.
    pub(crate) fn errors(&self, run: usize, label: &str) -> ChartSeries {
        let mut points = self.contour_error.points();
        replace(&mut points, self.worst.iter().map(|cycle| [cycle.time, cycle.contour_error]), |point| {
            point[0]
        });
        ChartSeries::new(label, SeriesStyle::Line(run), points).of_run(run)
    }

    /// Returns programmed and reached feed over time.
    pub(crate) fn feeds(&self, run: usize, label: &str) -> [ChartSeries; 2] {
        let programmed = self.programmed_feed.points();
        [
            ChartSeries::new("programmed", SeriesStyle::Commanded, programmed).of_run(run),
            ChartSeries::new(label, SeriesStyle::Line(run), self.reached_feed.points()).of_run(run),
        ]
    }

    /// Returns at most `most` points and those of the worst lines.
    fn points(&self, most: usize) -> Vec<CycleError> {
        let mut points = self.points.clone();
        while points.len() > most {
            points = thinned(&points);
        }
        replace(&mut points, self.worst.iter().copied(), |point| point.time);
        points
    }
}

/// Inserts values in the order of their times; they replace those of the same time.
fn replace<T>(values: &mut Vec<T>, others: impl Iterator<Item = T>, time: impl Fn(&T) -> f64) {
    for other in others {
        let place = values.partition_point(|value| time(value) < time(&other));
        match values.get_mut(place) {
            Some(value) if time(value) == time(&other) => *value = other,
            _ => values.insert(place, other),
        }
    }
}

/// Drops about a quarter of the points: of the pairs of neighbors that are closest to a straight line, the point with the
/// smaller error. Points between rapid traverse and feed stay.
fn thinned(points: &[CycleError]) -> Vec<CycleError> {
    let cost = |pair: usize| {
        let (i, j) = (2 * pair, 2 * pair + 1);
        if points[i].is_rapid != points[j].is_rapid {
            return f64::INFINITY;
        }
        let dropped = if points[i].contour_error < points[j].contour_error { i } else { j };
        match (points.get(dropped.wrapping_sub(1)), points.get(dropped + 1)) {
            (Some(a), Some(b)) => from_line(points[dropped].tip, a.tip, b.tip),
            _ => f64::INFINITY,
        }
    };
    let mut costs: Vec<(f64, usize)> = (0..points.len() / 2).map(|pair| (cost(pair), pair)).collect();
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    costs.truncate(costs.len() / 2);
    let dropped: BTreeSet<usize> = costs.into_iter().map(|(_, pair)| pair).collect();
    let pairs = points.chunks(2).enumerate();
    let kept = pairs.flat_map(|(number, pair)| match pair {
        [a, b] if dropped.contains(&number) => vec![if b.contour_error > a.contour_error { *b } else { *a }],
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
            let along = |axis| Extent::of(path.points.iter().map(|point| point.reference[axis]));
            (0..3).filter_map(|axis| Some(along(axis)?.span())).fold(0.0, f64::max)
        };
        let paths: Vec<&RunPath> = paths.iter().filter(|run| span(&run.path) > 0.0).collect();
        let extent = paths.iter().map(|run| span(&run.path)).fold(0.0, f64::max);
        let most = (MOST_OF_PAGE / paths.len().max(1)).max(MOST / 16);
        let thinned: Vec<Vec<CycleError>> = paths.iter().map(|run| run.path.points(most)).collect();
        let points = || thinned.iter().flatten();
        let error = peak(points().map(|point| point.contour_error)).max(LEAST_ERROR);
        let magnification = round_down((SHARE * extent / error).max(1.0));
        let note = if points().any(|point| point.is_rapid) {
            "mm; color: contour error; dashed: rapid traverse"
        } else {
            "mm; color: contour error"
        };
        let runs: Vec<Value> = paths.iter().zip(&thinned).map(|(run, points)| run.json(points)).collect();
        let lines: BTreeSet<usize> = points().map(|point| point.line).collect();
        let texts = paths.iter().flat_map(|run| &run.path.texts).filter(|(line, _)| lines.contains(line));
        let texts = bounded(texts.map(|(line, text)| (*line, text.clone())).collect());
        let json = json!({ "form": "path", "magnification": magnification, "runs": runs, "texts": texts });
        (!paths.is_empty()).then_some((note, json))
    }

    fn json(&self, points: &[CycleError]) -> Value {
        let column = |value: &dyn Fn(&CycleError) -> f64| -> Vec<Value> {
            points.iter().map(|point| rounded(value(point))).collect()
        };
        let columns =
            |value: &dyn Fn(&CycleError, usize) -> f64| [0, 1, 2].map(|i| column(&|point| value(point, i)));
        let lines: Vec<usize> = points.iter().map(|point| point.line).collect();
        let has_lines = lines.iter().any(|line| *line > 0);
        json!({
            "title": self.title,
            "run": self.run,
            "time": column(&|point| point.time),
            "path": column(&|point| point.path_position / MILLIMETER),
            "reference": columns(&|point, i| point.reference[i] / MILLIMETER),
            "deviation": columns(&|point, i| ((point.tip[i] - point.reference[i]) * 1e9).round() * 1e-6),
            "error": column(&|point| point.contour_error / MICROMETER),
            "feed": if has_lines { column(&|point| point.reached_feed / METER_PER_MINUTE) } else { Vec::new() },
            "rapid": if has_lines { column(&|point| f64::from(u8::from(point.is_rapid))) } else { Vec::new() },
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
                (cycle.programmed_feed, cycle.is_rapid) = (f64::INFINITY, true);
            }
            path.add(&cycle);
        }
        assert!(path.points.len() < MOST && path.points.len() > MOST / 2, "{}", path.points.len());
        assert!(path.points.iter().any(|point| *point == cycle(777, 9e-6)));
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
        let near = |point: &CycleError| distance(point.tip, [5000.0, 0.0, 0.0]) <= 1.0;
        assert!(thin.iter().any(near) && thin[0] == points[0]);
    }

    #[test]
    fn the_feed_keeps_the_ends_of_plateaus() {
        // Trapezoids of 1000 cycles on a straight path.
        let feed = |k: usize| (k % 1000).min(1000 - k % 1000).min(200) as f64;
        let count = 30 * MOST;
        let mut path = ToolPath::default();
        for k in 0..count {
            path.add(&CycleError { reached_feed: feed(k), tip: [k as f64, 0.0, 0.0], ..cycle(k, 1e-6) });
        }
        let [_, reached] = path.feeds(0, "reached");
        assert!(reached.points.len() <= 2 * MOST, "{}", reached.points.len());
        for pair in reached.points.windows(2) {
            let middle = ((pair[0][0] + pair[1][0]) / 2e-3).round() as usize;
            let drawn = (pair[0][1] + pair[1][1]) / 2.0;
            assert!((drawn - feed(middle)).abs() < 40.0, "{pair:?}: {}", feed(middle));
        }
    }

    #[test]
    fn cycles_of_worst_lines_are_kept() {
        let mut path = ToolPath::default();
        for k in 0..3 * MOST {
            path.add(&CycleError { tip: [k as f64, 0.0, 0.0], ..cycle(k, 1e-6) });
        }
        path.worst = vec![cycle(777, 9e-6), cycle(778, 8e-6)];
        let points = path.points(1000);
        assert!(points.len() <= 1002 && path.worst.iter().all(|worst| points.contains(worst)));
        assert!(points.windows(2).all(|pair| pair[0].time < pair[1].time));
        let errors = path.errors(0, "").points;
        assert!(errors.contains(&[0.777, 9e-6]) && errors.contains(&[0.778, 8e-6]));
    }

    #[test]
    fn magnifications_are_round() {
        let found = [1.0, 1.99, 2.0, 4.9, 5.0, 99.0, 300.0, 5e5].map(round_down);
        assert_eq!(found, [1.0, 1.0, 2.0, 2.0, 5.0, 50.0, 200.0, 5e5]);
    }
}
