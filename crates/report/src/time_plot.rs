//! Plot of signals over time.

use super::decimate::{PixelPoint, line};
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::svg::Svg;
use super::unit::DisplayUnit;

/// Size in pixels; the page scales the plot to its width.
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 198.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = HEIGHT - BELOW;
/// Approximate number of tick intervals of time and of values.
const TIME_STEPS: f64 = 10.0;
const VALUE_STEPS: f64 = 5.0;
/// Margin above and below the lines, as a fraction of their range.
const MARGIN: f64 = 0.06;

/// One signal over time.
#[derive(Debug, Clone)]
pub(super) struct TimeSeries<'a> {
    /// Label in the legend.
    pub label: String,
    /// CSS class.
    pub class: String,
    /// Sample times, s.
    pub time: &'a [f64],
    /// Values, SI units.
    pub values: &'a [f64],
}

/// Plot of several signals over time.
#[derive(Debug)]
pub(super) struct TimePlot<'a> {
    /// Quantity of the vertical axis, without its unit.
    pub quantity: &'static str,
    pub unit: DisplayUnit,
    /// True if the range of values includes 0.
    pub from_zero: bool,
    /// Range of time, s, which all plots of a page share.
    pub time: Extent,
    /// Series in drawing order.
    pub series: Vec<TimeSeries<'a>>,
    /// Smallest range of values, SI units.
    pub at_least: Option<Extent>,
    /// Time ranges that are shaded, s.
    pub shaded: Vec<[f64; 2]>,
}

impl TimePlot<'_> {
    /// Draws the plot as SVG.
    pub(super) fn draw(&self, id: &str, title: &str) -> String {
        let values = self.series.iter().map(|s| Extent::of(s.values.iter().copied()));
        let values = values.fold(self.at_least, Extent::join).unwrap_or(Extent { min: 0.0, max: 0.0 });
        let values = if self.from_zero { values.including(0.0) } else { values };
        let values = values.in_unit(&self.unit).at_least(self.unit.least_range).with_margin(MARGIN);
        let vertical = Scale::within(values, self.unit.least_range, VALUE_STEPS);
        let horizontal = Scale::within(self.time, DisplayUnit::SECOND.least_range, TIME_STEPS);
        let area = PlotArea { left: LEFT, right: RIGHT, top: TOP, bottom: BOTTOM, horizontal, vertical };
        let mut svg = Svg::new(WIDTH, HEIGHT);
        let label = DisplayUnit::SECOND.label("Time");
        area.draw(&mut svg, Some(&label), &self.unit.label(self.quantity), [false, true]);
        for [begin, end] in &self.shaded {
            let [left, right] = [*begin, *end].map(|time| area.to_pixels([time, 0.0])[0]);
            svg.rectangle("at-limit", [left, TOP], [right.max(left + 1.0), BOTTOM]);
        }
        for series in &self.series {
            let pairs = series.time.iter().zip(series.values);
            let points: Vec<Option<PixelPoint>> = pairs
                .map(|(&t, &v)| {
                    (is_drawable(t) && is_drawable(v)).then(|| area.to_pixels([t, v / self.unit.size]))
                })
                .collect();
            svg.path(&series.class, &line(&points));
        }
        svg.finish(id, title, &self.description())
    }

    /// Returns the text alternative: the range of each series.
    fn description(&self) -> String {
        let ranges = self.series.iter().map(|s| match Extent::of(s.values.iter().copied()) {
            Some(Extent { min, max }) => {
                format!("{} from {} to {}", s.label, self.unit.format(min), self.unit.format(max))
            }
            None => format!("{}: no values", s.label),
        });
        format!("{} over time. {}.", self.quantity, ranges.collect::<Vec<_>>().join("; "))
    }
}
