//! Polar plot of the radial deviation on circles, magnified about the nominal radius, like a ballbar plot.

use std::f64::consts::{FRAC_PI_4, FRAC_PI_8, PI};

use virtual_axes_core::assess::CircleTrace;

use super::decimate::steps;
use super::scale::{Extent, Scale, is_drawable};
use super::svg::{Anchor, Svg};
use super::text::{capital, number};
use super::unit::DisplayUnit;

/// Size in pixels.
const SIZE: f64 = 460.0;
const CENTER: f64 = SIZE / 2.0;
/// Radii of the smallest and the largest deviation, pixels.
const INNER: f64 = 56.0;
const OUTER: f64 = 200.0;
/// Approximate number of rings outside the innermost one.
const RINGS: f64 = 4.0;
/// Angle of the ring labels: between two spokes, and steep so that labels do not overlap, rad.
const LABEL_ANGLE: f64 = 3.0 * FRAC_PI_8;
/// Smallest range of the plot, µm.
const LEAST_RANGE: f64 = 1.0;

/// Labels and CSS classes of the two directions.
pub(super) const DIRECTIONS: [(&str, &str); 2] = [("counterclockwise", "ccw"), ("clockwise", "cw")];

/// Plot of circles of one plane and radius, in both directions.
#[derive(Debug)]
pub(super) struct PolarPlot<'a> {
    pub circles: Vec<&'a CircleTrace>,
    /// Range of the deviation, m.
    pub range: Extent,
    /// CSS class of the run.
    pub class: String,
}

/// Returns the range of the deviations of circles, including 0, the nominal radius, m.
pub(super) fn range<'a>(circles: impl IntoIterator<Item = &'a CircleTrace>) -> Extent {
    let deviations = circles.into_iter().flat_map(|c| c.deviation.iter().copied());
    Extent::of(deviations).unwrap_or(Extent { min: 0.0, max: 0.0 }).including(0.0)
}

impl PolarPlot<'_> {
    fn scale(&self) -> Scale {
        Scale::outward(self.range.in_unit(&DisplayUnit::MICROMETER), LEAST_RANGE, RINGS)
    }

    /// Returns the remark of the figure: the distance between rings.
    pub(super) fn note(&self) -> String {
        format!("rings every {} µm, the bold ring is the nominal radius", shortest(self.scale().step()))
    }

    /// Draws the plot as SVG.
    pub(super) fn draw(&self, id: &str, title: &str) -> String {
        let scale = self.scale();
        let radius = scale.onto(INNER, OUTER);
        let at = |r: f64, angle: f64| [CENTER + r * angle.cos(), CENTER - r * angle.sin()];
        let mut svg = Svg::new(SIZE, SIZE);
        svg.circle("area", [CENTER, CENTER], OUTER);
        for eighth in 0..8 {
            let angle = f64::from(eighth) * FRAC_PI_4;
            svg.line("grid", at(INNER, angle), at(OUTER, angle));
        }
        for (value, _) in scale.ticks() {
            svg.circle(if value == 0.0 { "nominal" } else { "ring" }, [CENTER, CENTER], radius(value));
        }
        let [first, second] = self.plane();
        let axes = [(format!("+{first}"), 0.0), (format!("+{second}"), 0.5)];
        let axes = axes.into_iter().chain([(format!("−{first}"), 1.0), (format!("−{second}"), 1.5)]);
        for (label, half_turns) in axes {
            let [x, y] = at(OUTER + 14.0, half_turns * PI);
            svg.text("label", [x, y + 5.0], Anchor::Middle, &label);
        }
        for (label, class) in DIRECTIONS {
            for circle in self.circles.iter().filter(|c| c.counterclockwise == (label == DIRECTIONS[0].0)) {
                let length = circle.angle.len().min(circle.deviation.len());
                let drawable = |i: &usize| is_drawable(circle.angle[*i]) && is_drawable(circle.deviation[*i]);
                let points: Vec<_> = (0..length)
                    .filter(drawable)
                    .map(|i| at(radius(circle.deviation[i] / DisplayUnit::MICROMETER.size), circle.angle[i]))
                    .collect();
                let kept = steps(points.len(), |i, j, within| {
                    (points[i][0] - points[j][0]).hypot(points[i][1] - points[j][1]) < within
                });
                let line = kept.into_iter().map(|i| points[i]).collect();
                svg.path(&format!("line {} {class}", self.class), &[line]);
            }
        }
        // Ring labels are drawn above the lines.
        for (value, label) in scale.ticks() {
            let [x, y] = at(radius(value), LABEL_ANGLE);
            svg.text("tick halo", [x, y + 4.5], Anchor::Middle, &format!("{label}\u{202f}µm"));
        }
        svg.finish(id, title, &self.description())
    }

    fn plane(&self) -> [String; 2] {
        let plane = self.circles.first().map(|c| c.plane.clone()).unwrap_or_default();
        plane.map(|name| capital(&name))
    }

    /// Returns the text alternative: the range of deviations of each direction.
    fn description(&self) -> String {
        let ranges = self.circles.iter().filter_map(|c| {
            let Extent { min, max } = Extent::of(c.deviation.iter().copied())?;
            let direction = DIRECTIONS[usize::from(!c.counterclockwise)].0;
            Some(format!(
                "{direction} from {} to {}",
                DisplayUnit::MICROMETER.format(min),
                DisplayUnit::MICROMETER.format(max)
            ))
        });
        format!("Radial deviation, positive outside: {}.", ranges.collect::<Vec<_>>().join("; "))
    }
}

/// Formats a round number with as few decimals as possible.
fn shortest(value: f64) -> String {
    let decimals = (0..6).find(|d| (value * 10f64.powi(*d)).fract().abs() < 1e-9).unwrap_or(6);
    number(value, decimals as usize)
}
