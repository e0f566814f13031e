//! Plot of the tool path in the workpiece frame with magnified error.

use virtual_axes_core::assess::ToolTrace;

use super::decimate::{PixelPoint, steps};
use super::scale::{Extent, RoundNumber, Scale, is_drawable};
use super::svg::{Anchor, Svg};
use super::text::number;
use super::unit::DisplayUnit;

/// Names of the coordinates.
const NAMES: [&str; 3] = ["X", "Y", "Z"];
/// Size in pixels.
const WIDTH: f64 = 460.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = WIDTH - 14.0;
const TOP: f64 = 10.0;
const BELOW: f64 = 48.0;
/// Limits of the aspect ratio (height over width) of the plot area, which follows the path.
const ASPECT: [f64; 2] = [0.35, 1.0];
/// Margin around the path, as a fraction of its range.
const MARGIN: f64 = 0.04;
/// Approximate number of tick intervals.
const STEPS: f64 = 5.0;
/// Largest magnified error, as a fraction of the extent of the path.
const SHARE: f64 = 0.15;
/// Error below which the magnification does not increase, m; smaller errors are noise.
const LEAST_ERROR: f64 = 1e-7;
/// Range below which a coordinate is stationary, m.
const STANDSTILL: f64 = 1e-6;
/// Paths have separate ranges if a common range exceeds the longest one by more than this fraction of the
/// path.
const SEPARATE: f64 = 0.3;
/// Maximum number of lines from the path to the magnified points.
const WHISKERS: usize = 100;

/// Number of classes of the contour error, equally wide up to the largest error.
const ERROR_CLASSES: usize = 4;

/// Returns the CSS class of the path in a class of the contour error.
fn error_class(class: usize) -> String {
    format!("line solid error-{class}")
}

/// Projection plane that is common to the plots of several runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathView {
    /// Indices of the horizontal and the vertical coordinate.
    plane: [usize; 2],
    /// True if the third coordinate moves as well.
    is_projection: bool,
}

/// Plot of the path of one run.
#[derive(Debug)]
pub(super) struct PathPlot<'a> {
    pub view: PathView,
    pub tool: &'a ToolTrace,
    /// Magnification of the error.
    pub magnification: RoundNumber,
    /// Ranges of the horizontal and the vertical coordinate, m.
    pub range: [Extent; 2],
    /// Largest contour error of the plots of all runs, m, which the classes of color divide.
    pub largest_error: f64,
    /// CSS class of the run.
    pub class: String,
}

impl PathView {
    /// Returns the plane of the two coordinates with the largest range within a run; `None` if no coordinate
    /// moves.
    pub(super) fn from_traces(tools: &[&ToolTrace]) -> Option<PathView> {
        let error = |axis: usize| {
            let errors = tools.iter().flat_map(|t| errors(t).map(move |e| e[axis]));
            // Noise must not determine the plane.
            Extent::of(errors).map_or(0.0, |e| e.peak()).max(LEAST_ERROR)
        };
        // Stationary coordinates come last, sorted by error.
        let mut order: Vec<(usize, bool, f64)> = (0..3)
            .map(|axis| match largest_span(tools, axis) {
                e if e > STANDSTILL => (axis, true, e),
                _ => (axis, false, error(axis)),
            })
            .collect();
        order.sort_by(|a, b| b.1.cmp(&a.1).then(b.2.total_cmp(&a.2)));
        let [(first, moves, _), (second, ..), (_, third_moves, _)] = order.try_into().ok()?;
        moves.then(|| PathView { plane: [first.min(second), first.max(second)], is_projection: third_moves })
    }

    /// Returns the name of the plane, for example "X–Y".
    pub(super) fn name(&self) -> String {
        format!("{}–{}", NAMES[self.plane[0]], NAMES[self.plane[1]])
    }

    /// Returns the largest error in the plane, m.
    pub(super) fn error(&self, tool: &ToolTrace) -> f64 {
        let [u, v] = self.plane;
        Extent::of(errors(tool).map(|e| e[u].hypot(e[v]))).map_or(0.0, |e| e.max)
    }

    /// Returns the magnification that makes `error` (m) visible on the paths of `tools`.
    pub(super) fn magnification(&self, tools: &[&ToolTrace], error: f64) -> RoundNumber {
        let spans = self.plane.map(|axis| largest_span(tools, axis));
        let wanted = SHARE * spans[0].max(spans[1]) / error.max(LEAST_ERROR);
        RoundNumber::down(wanted.max(1.0))
    }

    /// Returns the ranges of the path and its magnified points, m; `None` if no point can be drawn.
    pub(super) fn range(&self, tool: &ToolTrace, magnification: RoundNumber) -> Option<[Extent; 2]> {
        let points = || self.points(tool, magnification);
        let along = |i: usize| Extent::of(points().flat_map(move |(r, p)| [r[i], p[i]]));
        Some([along(0)?, along(1)?])
    }

    /// Returns points of the path and magnified points, in the plane, m.
    fn points<'a>(
        &self,
        tool: &'a ToolTrace,
        magnification: RoundNumber,
    ) -> impl Iterator<Item = (PixelPoint, PixelPoint)> + 'a {
        let (plane, magnification) = (self.plane, magnification.value());
        tool.reference.iter().zip(&tool.position).filter_map(move |(r, p)| {
            let reference = plane.map(|axis| r[axis]);
            let shown = plane.map(|axis| r[axis] + magnification * (p[axis] - r[axis]));
            let drawable = reference.iter().chain(&shown).all(|v| is_drawable(*v));
            drawable.then_some((reference, shown))
        })
    }
}

/// Returns the largest range of a coordinate within one run, m. Offsets between runs are ignored, because a
/// different tool length shifts the whole path.
fn largest_span(tools: &[&ToolTrace], axis: usize) -> f64 {
    let span =
        |tool: &ToolTrace| Extent::of(tool.reference.iter().map(|p| p[axis])).map_or(0.0, |e| e.span());
    tools.iter().map(|tool| span(tool)).fold(0.0, f64::max)
}

/// Returns ranges of equal length for several runs: one common range, or, if the paths are far apart, a range
/// around the middle of each path.
pub(super) fn at_one_scale(own: &[[Extent; 2]]) -> Vec<[Extent; 2]> {
    let along = |i: usize| own.iter().map(move |range| range[i]);
    let spans = [0, 1].map(|i| along(i).map(|e| e.span()).fold(0.0, f64::max));
    let common = [0, 1].map(|i| {
        let all = along(i).fold(None, |all, e| Extent::join(all, Some(e)));
        all.filter(|all| all.span() - spans[i] <= SEPARATE * spans[0].max(spans[1]))
    });
    let range = |own: &[Extent; 2]| [0, 1].map(|i| common[i].unwrap_or_else(|| own[i].at_least(spans[i])));
    own.iter().map(range).collect()
}

/// Returns position − reference, m.
fn errors(tool: &ToolTrace) -> impl Iterator<Item = [f64; 3]> {
    tool.reference.iter().zip(&tool.position).map(|(r, p)| [p[0] - r[0], p[1] - r[1], p[2] - r[2]])
}

impl PathPlot<'_> {
    /// Returns the remark of the figure: magnification and projection.
    pub(super) fn note(&self) -> String {
        let projection = if self.view.is_projection { ", projected on the plane" } else { "" };
        format!("error × {}{projection}", number(self.magnification.value(), 0))
    }

    /// Returns CSS class and label of each class of the contour error.
    pub(super) fn error_legend(&self) -> Vec<(String, String)> {
        let largest = self.tool.contour_error.iter().copied().fold(0.0, f64::max);
        let limit = |class: usize| self.largest_error * class as f64 / ERROR_CLASSES as f64;
        let label = |class: usize| {
            format!("contour error up to {}", DisplayUnit::MICROMETER.format(limit(class + 1)))
        };
        // Classes that the path does not reach are not in the legend.
        (1..ERROR_CLASSES)
            .filter(|&class| largest > limit(class))
            .map(|class| (error_class(class), label(class)))
            .collect()
    }

    /// Returns the parts of the magnified path by class of their contour error, without the lowest class, which has
    /// the color of the run.
    fn colored(
        &self,
        kept: &[usize],
        point: impl Fn(usize) -> PixelPoint,
    ) -> Vec<(String, Vec<Vec<PixelPoint>>)> {
        let class = |pair: &[usize]| {
            let errors = pair[0]..=pair[1];
            let error = errors.filter_map(|i| self.tool.contour_error.get(i)).copied().fold(0.0, f64::max);
            let share = error / self.largest_error.max(f64::MIN_POSITIVE);
            ((share * ERROR_CLASSES as f64) as usize).min(ERROR_CLASSES - 1)
        };
        let mut lines: Vec<Vec<Vec<PixelPoint>>> = vec![Vec::new(); ERROR_CLASSES];
        let mut last = None;
        for pair in kept.windows(2) {
            let class = class(pair);
            match lines[class].last_mut().filter(|_| last == Some(class)) {
                Some(line) => line.push(point(pair[1])),
                None => lines[class].push(vec![point(pair[0]), point(pair[1])]),
            }
            last = Some(class);
        }
        let classes = lines.into_iter().enumerate().skip(1).filter(|(_, lines)| !lines.is_empty());
        classes.map(|(class, lines)| (error_class(class), lines)).collect()
    }

    /// Draws the plot as SVG.
    pub(super) fn draw(&self, id: &str, title: &str) -> String {
        let [across, up] = self.range.map(|e| e.in_unit(&DisplayUnit::MILLIMETER).with_margin(MARGIN));
        let least = DisplayUnit::MILLIMETER.least_range;
        let width = across.span().max(up.span() / ASPECT[1]).max(least);
        let aspect = (up.span() / width).clamp(ASPECT[0], ASPECT[1]);
        // Both coordinates have one scale.
        let (across, up) = (across.at_least(width), up.at_least(width * aspect));
        let bottom = TOP + (RIGHT - LEFT) * aspect;
        let horizontal = Scale::within(across, least, STEPS);
        let vertical = Scale::within(up, least, STEPS * aspect.max(0.6));
        let (x, y) = (horizontal.onto(LEFT, RIGHT), vertical.onto(bottom, TOP));

        let mut svg = Svg::new(WIDTH, bottom + BELOW);
        svg.rectangle("area", [LEFT, TOP], [RIGHT, bottom]);
        for (value, label) in horizontal.ticks() {
            svg.line("grid", [x(value), TOP], [x(value), bottom]);
            svg.text("tick", [x(value), bottom + 20.5], Anchor::Middle, &label);
        }
        for (value, label) in vertical.ticks() {
            svg.line("grid", [LEFT, y(value)], [RIGHT, y(value)]);
            svg.text("tick", [LEFT - 9.0, y(value) + 4.5], Anchor::End, &label);
        }
        let [first, second] = self.view.plane.map(|axis| format!("{} (mm)", NAMES[axis]));
        svg.text("label", [(LEFT + RIGHT) / 2.0, bottom + BELOW - 7.0], Anchor::Middle, &first);
        svg.upward_text("label", [14.0, (TOP + bottom) / 2.0], &second);

        let to_pixels =
            |p: PixelPoint| [x(p[0] / DisplayUnit::MILLIMETER.size), y(p[1] / DisplayUnit::MILLIMETER.size)];
        let points: Vec<(PixelPoint, PixelPoint)> = self
            .view
            .points(self.tool, self.magnification)
            .map(|(r, p)| (to_pixels(r), to_pixels(p)))
            .collect();
        let kept = steps(points.len(), |i, j, within| {
            let far = |a: PixelPoint, b: PixelPoint| (a[0] - b[0]).hypot(a[1] - b[1]) >= within;
            !far(points[i].0, points[j].0) && !far(points[i].1, points[j].1)
        });
        let every = kept.len().div_ceil(WHISKERS).max(1);
        let whiskers: Vec<_> = kept.iter().step_by(every).map(|&i| vec![points[i].0, points[i].1]).collect();
        svg.path("reference", &[kept.iter().map(|&i| points[i].0).collect()]);
        svg.path(&format!("whisker {}", self.class), &whiskers);
        svg.path(&format!("line solid {}", self.class), &[kept.iter().map(|&i| points[i].1).collect()]);
        for (class, lines) in self.colored(&kept, |i| points[i].1) {
            svg.path(&class, &lines);
        }
        let note = format!("error × {}", number(self.magnification.value(), 0));
        svg.text("label", [LEFT, bottom + BELOW - 7.0], Anchor::Start, &note);
        if let Some((start, _)) = points.first() {
            svg.circle("start", *start, 4.0);
        }
        let error = DisplayUnit::MICROMETER.format(self.view.error(self.tool));
        let description = format!(
            "{} path of the tool with the error magnified {} times; the largest error in this plane is {error}.",
            self.view.name(),
            number(self.magnification.value(), 0)
        );
        svg.finish(id, title, &description)
    }
}
