//! Plot area with two axes: grid, ticks and labels.

use super::decimate::PixelPoint;
use super::scale::Scale;
use super::svg::{Anchor, Svg};

/// Height of tick labels and axis label below the plot area, pixels.
pub(super) const BELOW: f64 = 44.0;
/// Distances of tick labels from the plot area, left and below, and of a text's baseline from its middle,
/// pixels.
const TICK_LEFT: f64 = 9.0;
const TICK_BELOW: f64 = 20.5;
const TEXT_MIDDLE: f64 = 4.5;
/// Distances of the axis labels, below the plot area and from the left edge of the plot, pixels.
const LABEL_BELOW: f64 = BELOW - 6.0;
const LABEL_LEFT: f64 = 14.0;

/// Rectangle in which pairs of values are drawn, with the scale of each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlotArea {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
    pub horizontal: Scale,
    pub vertical: Scale,
}

impl PlotArea {
    /// Returns the function from values of x to pixels.
    pub(super) fn x(&self) -> impl Fn(f64) -> f64 + Copy {
        self.horizontal.onto(self.left, self.right)
    }

    /// Returns the function from values of y to pixels.
    pub(super) fn y(&self) -> impl Fn(f64) -> f64 + Copy {
        self.vertical.onto(self.bottom, self.top)
    }

    /// Converts a pair of values to pixels.
    pub(super) fn to_pixels(self, [x, y]: [f64; 2]) -> PixelPoint {
        [self.x()(x), self.y()(y)]
    }

    /// Draws background, grid, ticks and axis labels. Without a label for x its ticks have no text. `zero`
    /// selects the axes whose grid line at 0 is emphasized.
    pub(super) fn draw(&self, svg: &mut Svg, x_label: Option<&str>, y_label: &str, zero: [bool; 2]) {
        let PlotArea { left, right, top, bottom, .. } = *self;
        let (x, y) = (self.x(), self.y());
        let class = |value: f64, zero: bool| if zero && value == 0.0 { "zero" } else { "grid" };
        svg.rectangle("area", [left, top], [right, bottom]);
        for (value, label) in self.vertical.ticks() {
            svg.line(class(value, zero[1]), [left, y(value)], [right, y(value)]);
            if !label.is_empty() {
                svg.text("tick", [left - TICK_LEFT, y(value) + TEXT_MIDDLE], Anchor::End, &label);
            }
        }
        for (value, label) in self.horizontal.ticks() {
            svg.line(class(value, zero[0]), [x(value), top], [x(value), bottom]);
            if x_label.is_some() && !label.is_empty() {
                svg.text("tick", [x(value), bottom + TICK_BELOW], Anchor::Middle, &label);
            }
        }
        if let Some(label) = x_label {
            svg.text("label", [right, bottom + LABEL_BELOW], Anchor::End, label);
        }
        svg.upward_text("label", [LABEL_LEFT, (top + bottom) / 2.0], y_label);
    }
}
