//! Signals over time, one strip of the page.

use super::decimate::{PixelPoint, line};
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::svg::Svg;
use super::unit::DisplayUnit;

/// Pixels at natural size; the page scales the picture to its width.
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 198.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = HEIGHT - BELOW;
/// Steps between ticks, about: a label each 90 pixels, a line of text each 35.
const TIME_STEPS: f64 = 10.0;
const VALUE_STEPS: f64 = 5.0;
/// Room above and below the lines, part of their range.
const MARGIN: f64 = 0.06;

/// One line.
#[derive(Debug, Clone)]
pub(super) struct TimeSeries<'a> {
    /// As in the legend.
    pub label: String,
    /// How the page's style draws it.
    pub class: String,
    /// s.
    pub time: &'a [f64],
    /// SI.
    pub values: &'a [f64],
}

/// A plot over time.
#[derive(Debug)]
pub(super) struct TimePlot<'a> {
    /// What stands along the vertical axis, without its unit.
    pub quantity: &'static str,
    pub unit: DisplayUnit,
    /// Whether 0 belongs into the range.
    pub from_zero: bool,
    /// Range of time, s, the same for all plots of a page.
    pub time: Extent,
    /// Drawn in this order.
    pub series: Vec<TimeSeries<'a>>,
    /// A range of values to hold besides those of the series, SI.
    pub at_least: Option<Extent>,
}

impl TimePlot<'_> {
    /// The picture; `title` says what it shows.
    pub(super) fn draw(&self, id: &str, title: &str) -> String {
        let values = self.series.iter().map(|s| Extent::of(s.values.iter().copied()));
        let values = values.fold(self.at_least, Extent::join).unwrap_or(Extent { min: 0.0, max: 0.0 });
        let values = if self.from_zero { values.including(0.0) } else { values };
        let values = values.in_unit(&self.unit).at_least(self.unit.least_range).with_margin(MARGIN);
        let vertical = Scale::within(values, self.unit.least_range, VALUE_STEPS);
        let horizontal = Scale::within(self.time, DisplayUnit::SECOND.least_range, TIME_STEPS);
        let frame = PlotArea { left: LEFT, right: RIGHT, top: TOP, bottom: BOTTOM, horizontal, vertical };
        let mut svg = Svg::new(WIDTH, HEIGHT);
        let label = DisplayUnit::SECOND.label("Time");
        frame.draw(&mut svg, Some(&label), &self.unit.label(self.quantity), [false, true]);
        for series in &self.series {
            let pairs = series.time.iter().zip(series.values);
            let points: Vec<Option<PixelPoint>> = pairs
                .map(|(&t, &v)| {
                    (is_drawable(t) && is_drawable(v)).then(|| frame.place([t, v / self.unit.size]))
                })
                .collect();
            svg.path(&series.class, &line(&points));
        }
        svg.finish(id, title, &self.description())
    }

    /// In words: the range of each line.
    fn description(&self) -> String {
        let ranges = self.series.iter().map(|s| match Extent::of(s.values.iter().copied()) {
            Some(Extent { min, max }) => {
                format!("{} from {} to {}", s.label, self.unit.show(min), self.unit.show(max))
            }
            None => format!("{}: no values", s.label),
        });
        format!("{} over time. {}.", self.quantity, ranges.collect::<Vec<_>>().join("; "))
    }
}
