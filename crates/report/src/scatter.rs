//! Scatter plots of the results of a search, for example a Pareto front.

use super::decimate::{separate_points, step_corners};
use super::html::{Caption, Html};
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::svg::Svg;
use super::text::rounded;

/// Size in pixels; the page scales the plot to its width.
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = HEIGHT - BELOW;
/// Approximate number of tick intervals, horizontal and vertical.
const STEPS: [f64; 2] = [9.0, 7.0];
/// Margin around the points, as a fraction of their range.
const MARGIN: f64 = 0.05;
/// Smallest range of an axis.
const LEAST_RANGE: f64 = 1e-3;
/// Radii of small points and of the markers of runs, pixels.
const DOT: f64 = 2.2;
const MARK: f64 = 6.0;

/// Scatter plot with linear axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// Title above the plot.
    pub title: String,
    /// Remark behind the title; can be empty.
    pub note: String,
    /// Label of the horizontal axis with its unit.
    pub x: String,
    /// Label of the vertical axis with its unit.
    pub y: String,
    /// Groups of points in drawing order.
    pub groups: Vec<PointGroup>,
}

/// Points with one style.
#[derive(Debug, Clone, PartialEq)]
pub struct PointGroup {
    /// Label in the legend.
    pub label: String,
    /// Drawing style.
    pub style: PointStyle,
    /// Values of x and y, in the units of the axes. Values that are not finite are omitted.
    pub points: Vec<[f64; 2]>,
}

/// Drawing style of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointStyle {
    /// Small points of no particular run.
    Dots,
    /// Step plot: each value is held until the next x.
    Steps,
    /// Large marker in the color of a run, by its index in the report.
    Run(usize),
}

impl PointStyle {
    fn class(self) -> String {
        match self {
            PointStyle::Dots => "dot".to_owned(),
            PointStyle::Steps => "line solid front".to_owned(),
            PointStyle::Run(run) => format!("mark {}", super::html::run_class(run)),
        }
    }
}

/// Appends a section with the scatter plots, unless there are none.
pub(super) fn section(html: &mut Html, scatters: &[Scatter]) {
    if scatters.is_empty() {
        return;
    }
    html.open_section("search", "Search");
    for scatter in scatters {
        let legend = scatter.groups.iter().map(|g| (g.style.class(), g.label.clone())).collect();
        let caption = Caption { title: scatter.title.clone(), note: scatter.note.clone(), legend };
        html.figure("strip", &caption, &scatter.title, |id, title| scatter.draw(id, title));
    }
    html.close_section();
}

impl PointGroup {
    fn drawable(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.points.iter().copied().filter(|point| point.iter().all(|value| is_drawable(*value)))
    }
}

impl Scatter {
    fn extent(&self, axis: usize) -> Extent {
        let points = self.groups.iter().flat_map(PointGroup::drawable);
        Extent::of(points.map(|point| point[axis])).unwrap_or(Extent { min: 0.0, max: 0.0 })
    }

    fn draw(&self, id: &str, title: &str) -> String {
        let scale = |axis: usize| {
            let extent = self.extent(axis).at_least(LEAST_RANGE).with_margin(MARGIN);
            Scale::within(extent, LEAST_RANGE, STEPS[axis])
        };
        let (horizontal, vertical) = (scale(0), scale(1));
        let area = PlotArea { left: LEFT, right: RIGHT, top: TOP, bottom: BOTTOM, horizontal, vertical };
        let mut svg = Svg::new(WIDTH, HEIGHT);
        area.draw(&mut svg, Some(&self.x), &self.y, [false, false]);
        for group in &self.groups {
            let class = group.style.class();
            let points: Vec<[f64; 2]> = group.drawable().map(|point| area.to_pixels(point)).collect();
            match group.style {
                PointStyle::Dots => {
                    separate_points(&points).into_iter().for_each(|i| svg.circle(&class, points[i], DOT));
                }
                PointStyle::Run(_) => points.iter().for_each(|point| svg.circle(&class, *point, MARK)),
                PointStyle::Steps => {
                    let points: Vec<_> = points.into_iter().map(Some).collect();
                    svg.path(&class, &[step_corners(&points).into_iter().flatten().collect()]);
                }
            }
        }
        svg.finish(id, title, &self.description())
    }

    /// Returns the text alternative: the number of points, and the coordinates of the runs.
    fn description(&self) -> String {
        let groups = self.groups.iter().map(|group| match (group.style, group.drawable().next()) {
            (PointStyle::Run(_), Some([x, y])) => {
                format!("{} at {}, {}", group.label, rounded(x), rounded(y))
            }
            _ => format!("{}: {} points", group.label, group.drawable().count()),
        });
        format!("{} over {}. {}.", self.y, self.x, groups.collect::<Vec<_>>().join("; "))
    }
}
