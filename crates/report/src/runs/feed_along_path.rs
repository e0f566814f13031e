//! Feed along the path of a part program: programmed and reached feed, and contour error.

use crate::{AxisRange, Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, SeriesStyle};
use virtual_axes_nc::offline::CycleError;

/// Largest number of intervals that are kept; twice as many would not be visible in a plot.
const MOST: usize = 4096;

/// Value with its path position, m.
type PathValue = [f64; 2];

/// Consecutive position cycles along the path.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FeedInterval {
    /// Lowest and highest reached feed, m/s, with their path positions.
    reached: [PathValue; 2],
    /// Highest programmed feed, m/s, with its path position; NaN at rapid traverse and where rotary axes move alone.
    programmed: PathValue,
    /// Largest contour error, m, with its path position.
    error: PathValue,
}

impl FeedInterval {
    /// Returns the union of two intervals, with all extremes.
    fn joined(self, next: Self) -> Self {
        let least = |a: PathValue, b: PathValue| if b[1] < a[1] { b } else { a };
        let most = |a: PathValue, b: PathValue| if b[1] > a[1] || a[1].is_nan() { b } else { a };
        Self {
            reached: [least(self.reached[0], next.reached[0]), most(self.reached[1], next.reached[1])],
            programmed: most(self.programmed, next.programmed),
            error: most(self.error, next.error),
        }
    }
}

/// Feed and contour error along the path, in constant memory: of longer programs intervals are joined, which keep their
/// extremes.
#[derive(Debug, Clone, Default)]
pub struct FeedAlongPath {
    intervals: Vec<FeedInterval>,
    /// Position cycles per interval, a power of two; 0 before the first one.
    cycles: usize,
    /// Last position cycles, fewer than an interval has.
    open: Option<(FeedInterval, usize)>,
}

impl FeedAlongPath {
    /// Adds a position cycle.
    pub fn add(&mut self, cycle: &CycleError) {
        let &CycleError {
            path_position: path,
            programmed_feed: programmed,
            reached_feed: reached,
            contour_error: error,
        } = cycle;
        let finite = if programmed.is_finite() { programmed } else { f64::NAN };
        let added =
            FeedInterval { reached: [[path, reached]; 2], programmed: [path, finite], error: [path, error] };
        self.cycles = self.cycles.max(1);
        let (interval, count) = match self.open.take() {
            Some((open, count)) => (open.joined(added), count + 1),
            None => (added, 1),
        };
        if count < self.cycles {
            self.open = Some((interval, count));
            return;
        }
        self.intervals.push(interval);
        if self.intervals.len() == MOST {
            self.intervals =
                self.intervals.chunks(2).map(|pair| pair[0].joined(pair[pair.len() - 1])).collect();
            self.cycles *= 2;
        }
    }

    /// Returns a chart over the path position.
    pub fn chart(&self) -> Chart {
        let intervals = || self.intervals.iter().copied().chain(self.open.map(|(open, _)| open));
        let series = |label: &str, style, points: Vec<PathValue>| ChartSeries {
            label: label.to_owned(),
            style,
            points,
            errors: Vec::new(),
        };
        let reached = intervals().flat_map(|interval| {
            let [least, most] = interval.reached;
            if least[0] <= most[0] { [least, most] } else { [most, least] }
        });
        let feeds = vec![
            series("programmed", SeriesStyle::Commanded, intervals().map(|at| at.programmed).collect()),
            series("reached", SeriesStyle::Measured, reached.collect()),
        ];
        let error = series("", SeriesStyle::Line(0), intervals().map(|at| at.error).collect());
        let axis =
            |quantity: &str, unit| ChartAxis { range: AxisRange::WithZero, ..ChartAxis::new(quantity, unit) };
        let panels = vec![
            Panel::new(axis("Feed", DisplayUnit::METER_PER_MINUTE), feeds),
            Panel::new(axis("Contour error", DisplayUnit::MICROMETER), vec![error]),
        ];
        let path = ChartAxis::new("Path position", DisplayUnit::MILLIMETER);
        Chart {
            note: "speed of the tool tip; no programmed feed at rapid traverse".to_owned(),
            ..Chart::new("Feed along the path", path, panels)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_intervals_keep_every_extreme() {
        let mut feed = FeedAlongPath::default();
        let cycles = 10 * MOST + 7;
        for k in 0..cycles {
            let reached = if k == 12_345 {
                0.5
            } else if k == 30_001 {
                0.01
            } else {
                0.1
            };
            let programmed = if k % 2 == 0 { f64::INFINITY } else { 0.2 };
            let contour_error = if k == 777 { 9e-6 } else { 1e-6 };
            feed.add(&CycleError {
                path_position: 1e-5 * k as f64,
                programmed_feed: programmed,
                reached_feed: reached,
                contour_error,
            });
        }
        assert!(feed.intervals.len() < MOST && feed.cycles == 16);
        let chart = feed.chart();
        let points = |panel: usize, series: usize| chart.panels[panel].series[series].points.clone();
        let reached = points(0, 1);
        assert!(reached.contains(&[1e-5 * 12_345.0, 0.5]) && reached.contains(&[1e-5 * 30_001.0, 0.01]));
        assert!(points(1, 0).contains(&[1e-5 * 777.0, 9e-6]));
        assert!(points(0, 0).iter().all(|point| point[1] == 0.2));
        assert!(reached.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
    }

    #[test]
    fn a_short_program_has_each_cycle() {
        let mut feed = FeedAlongPath::default();
        let cycle = |[path_position, programmed_feed, reached_feed, contour_error]: [f64; 4]| CycleError {
            path_position,
            programmed_feed,
            reached_feed,
            contour_error,
        };
        feed.add(&cycle([0.0, 0.1, 0.05, 0.0]));
        feed.add(&cycle([1e-3, f64::INFINITY, 0.4, 1e-6]));
        let chart = feed.chart();
        assert_eq!(chart.panels[1].series[0].points, [[0.0, 0.0], [1e-3, 1e-6]]);
        assert!(chart.panels[0].series[0].points[1][1].is_nan());
    }
}
