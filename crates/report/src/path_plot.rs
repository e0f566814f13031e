//! The path of the tool in the workpiece frame, its error magnified.

use virtual_axes_core::assess::ToolTrace;

use super::decimate::{PixelPoint, steps};
use super::scale::{Extent, RoundNumber, Scale, is_drawable};
use super::svg::{Anchor, Svg};
use super::text::number;
use super::unit::DisplayUnit;

/// Names of the coordinates.
const NAMES: [&str; 3] = ["X", "Y", "Z"];
/// Pixels at natural size.
const WIDTH: f64 = 460.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = WIDTH - 14.0;
const TOP: f64 = 10.0;
const BELOW: f64 = 48.0;
/// Height of the area over its width: what the path asks for, within these.
const ASPECT: [f64; 2] = [0.35, 1.0];
/// Room about the path, part of its range.
const MARGIN: f64 = 0.04;
/// Steps between ticks, about.
const STEPS: f64 = 5.0;
/// The largest error takes this part of the path's extent.
const SHARE: f64 = 0.15;
/// Below this an error is not magnified further, m: it would be noise.
const LEAST_ERROR: f64 = 1e-7;
/// A coordinate that varies by less stands still, m.
const STANDSTILL: f64 = 1e-6;
/// Paths lie apart if a range for all is longer than the longest by more than this part of the path.
const APART: f64 = 0.3;
/// Lines from the path to the magnified point.
const WHISKERS: usize = 100;

/// What is common to the plots of some runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PathView {
    /// Coordinates across and up.
    plane: [usize; 2],
    /// Whether the third one moves as well.
    is_projection: bool,
}

/// One run's path.
#[derive(Debug)]
pub(super) struct PathPlot<'a> {
    pub view: PathView,
    pub tool: &'a ToolTrace,
    /// How much the error is magnified.
    pub magnification: RoundNumber,
    /// Coordinates across and up to show, m.
    pub range: [Extent; 2],
    /// Style of the run.
    pub class: String,
}

impl PathView {
    /// The plane of the two coordinates that move most within a run; none if nothing moves.
    pub(super) fn of(tools: &[&ToolTrace]) -> Option<PathView> {
        let error = |axis: usize| {
            let errors = tools.iter().flat_map(|t| errors(t).map(move |e| e[axis]));
            // Noise must not choose the plane.
            Extent::of(errors).map_or(0.0, |e| e.peak()).max(LEAST_ERROR)
        };
        // Those that stand still come last, that with the largest error first.
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

    /// "X–Y".
    pub(super) fn name(&self) -> String {
        format!("{}–{}", NAMES[self.plane[0]], NAMES[self.plane[1]])
    }

    /// The largest error in the plane, m.
    pub(super) fn error(&self, tool: &ToolTrace) -> f64 {
        let [u, v] = self.plane;
        Extent::of(errors(tool).map(|e| e[u].hypot(e[v]))).map_or(0.0, |e| e.max)
    }

    /// By how much to magnify so that `error` (m) is seen on the paths of `tools`.
    pub(super) fn magnification(&self, tools: &[&ToolTrace], error: f64) -> RoundNumber {
        let spans = self.plane.map(|axis| largest_span(tools, axis));
        let wanted = SHARE * spans[0].max(spans[1]) / error.max(LEAST_ERROR);
        RoundNumber::down(wanted.max(1.0))
    }

    /// Range of what is drawn of a run, m; none if nothing can be.
    pub(super) fn range(&self, tool: &ToolTrace, magnification: RoundNumber) -> Option<[Extent; 2]> {
        let points = || self.points(tool, magnification);
        let along = |i: usize| Extent::of(points().flat_map(move |(r, p)| [r[i], p[i]]));
        Some([along(0)?, along(1)?])
    }

    /// Points of the path and magnified points, in the plane.
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

/// How far a coordinate of a path goes, m: in the run where it goes farthest. Where the paths of
/// different runs lie does not count, a tool of another length moves the whole path.
fn largest_span(tools: &[&ToolTrace], axis: usize) -> f64 {
    let span =
        |tool: &ToolTrace| Extent::of(tool.reference.iter().map(|p| p[axis])).map_or(0.0, |e| e.span());
    tools.iter().map(|tool| span(tool)).fold(0.0, f64::max)
}

/// Ranges to draw several runs at one scale, from what each needs: the same for all, but where the
/// paths lie apart each about its own middle.
pub(super) fn at_one_scale(own: &[[Extent; 2]]) -> Vec<[Extent; 2]> {
    let along = |i: usize| own.iter().map(move |range| range[i]);
    let spans = [0, 1].map(|i| along(i).map(|e| e.span()).fold(0.0, f64::max));
    let common = [0, 1].map(|i| {
        let all = along(i).fold(None, |all, e| Extent::join(all, Some(e)));
        all.filter(|all| all.span() - spans[i] <= APART * spans[0].max(spans[1]))
    });
    let range = |own: &[Extent; 2]| [0, 1].map(|i| common[i].unwrap_or_else(|| own[i].at_least(spans[i])));
    own.iter().map(range).collect()
}

/// Position − reference, m.
fn errors(tool: &ToolTrace) -> impl Iterator<Item = [f64; 3]> {
    tool.reference.iter().zip(&tool.position).map(|(r, p)| [p[0] - r[0], p[1] - r[1], p[2] - r[2]])
}

impl PathPlot<'_> {
    /// What the figure must say.
    pub(super) fn note(&self) -> String {
        let projection = if self.view.is_projection { ", projected on the plane" } else { "" };
        format!("error × {}{projection}", number(self.magnification.value(), 0))
    }

    /// The picture; `title` says what it shows.
    pub(super) fn draw(&self, id: &str, title: &str) -> String {
        let [across, up] = self.range.map(|e| e.in_unit(&DisplayUnit::MILLIMETER).with_margin(MARGIN));
        let least = DisplayUnit::MILLIMETER.least_range;
        let width = across.span().max(up.span() / ASPECT[1]).max(least);
        let aspect = (up.span() / width).clamp(ASPECT[0], ASPECT[1]);
        // One scale for both: what is longer than its share gives the other more room.
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

        let place =
            |p: PixelPoint| [x(p[0] / DisplayUnit::MILLIMETER.size), y(p[1] / DisplayUnit::MILLIMETER.size)];
        let points: Vec<(PixelPoint, PixelPoint)> =
            self.view.points(self.tool, self.magnification).map(|(r, p)| (place(r), place(p))).collect();
        let kept = steps(points.len(), |i, j, within| {
            let far = |a: PixelPoint, b: PixelPoint| (a[0] - b[0]).hypot(a[1] - b[1]) >= within;
            !far(points[i].0, points[j].0) && !far(points[i].1, points[j].1)
        });
        let every = kept.len().div_ceil(WHISKERS).max(1);
        let whiskers: Vec<_> = kept.iter().step_by(every).map(|&i| vec![points[i].0, points[i].1]).collect();
        svg.path("reference", &[kept.iter().map(|&i| points[i].0).collect()]);
        svg.path(&format!("whisker {}", self.class), &whiskers);
        svg.path(&format!("line solid {}", self.class), &[kept.iter().map(|&i| points[i].1).collect()]);
        if let Some((start, _)) = points.first() {
            svg.circle("start", *start, 4.0);
        }
        let error = DisplayUnit::MICROMETER.show(self.view.error(self.tool));
        let description = format!(
            "{} path of the tool, its error magnified {} times; the largest in this plane is {error}.",
            self.view.name(),
            number(self.magnification.value(), 0)
        );
        svg.finish(id, title, &description)
    }
}
