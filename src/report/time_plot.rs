//! Signals over time, one strip of the page.

use super::scale::{Extent, Scale, Unit, is_drawable};
use super::svg::{Anchor, Svg};
use super::thin::extremes;

/// Pixels at natural size; the page scales the picture to its width.
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 198.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = HEIGHT - 44.0;
/// Steps between ticks, about: a label each 90 pixels, a line of text each 35.
const TIME_STEPS: f64 = 10.0;
const VALUE_STEPS: f64 = 5.0;
/// Room above and below the lines, part of their range.
const MARGIN: f64 = 0.06;

/// One line.
#[derive(Debug, Clone)]
pub(super) struct Series<'a> {
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
    pub unit: Unit,
    /// Whether 0 belongs into the range.
    pub from_zero: bool,
    /// Range of time, s, the same for all plots of a page.
    pub time: Extent,
    /// Drawn in this order.
    pub series: Vec<Series<'a>>,
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
        let horizontal = Scale::within(self.time, Unit::SECOND.least_range, TIME_STEPS);
        let (x, y) = (horizontal.onto(LEFT, RIGHT), vertical.onto(BOTTOM, TOP));

        let mut svg = Svg::new(WIDTH, HEIGHT);
        svg.rectangle("area", [LEFT, TOP], [RIGHT, BOTTOM]);
        for (value, label) in vertical.ticks() {
            let class = if value == 0.0 { "zero" } else { "grid" };
            svg.line(class, [LEFT, y(value)], [RIGHT, y(value)]);
            svg.text("tick", [LEFT - 9.0, y(value) + 4.5], Anchor::End, &label);
        }
        for (value, label) in horizontal.ticks() {
            svg.line("grid", [x(value), TOP], [x(value), BOTTOM]);
            svg.text("tick", [x(value), BOTTOM + 20.5], Anchor::Middle, &label);
        }
        svg.text("label", [RIGHT, HEIGHT - 6.0], Anchor::End, "Time (s)");
        let label = format!("{} ({})", self.quantity, self.unit.symbol);
        svg.upward_text("label", [14.0, (TOP + BOTTOM) / 2.0], &label);

        for series in &self.series {
            let length = series.time.len().min(series.values.len());
            let (time, values) = (&series.time[..length], &series.values[..length]);
            let parts = extremes(values, |i| if is_drawable(time[i]) { x(time[i]) as i64 } else { 0 });
            let place = |i: usize| [x(time[i]), y(values[i] / self.unit.size)];
            let lines: Vec<_> = parts.iter().map(|part| part.iter().map(|&i| place(i)).collect()).collect();
            svg.path(&series.class, &lines);
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
