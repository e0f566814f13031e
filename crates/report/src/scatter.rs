//! Points in a plane: what a search found, in two respects.

use super::decimate::{dots, staircase};
use super::html::{Caption, Html};
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::svg::Svg;
use super::text::rounded;

/// Pixels at natural size; the page scales the picture to its width.
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = HEIGHT - BELOW;
/// Steps between ticks, about.
const STEPS: [f64; 2] = [9.0, 7.0];
/// Room about the points, part of their range.
const MARGIN: f64 = 0.05;
/// A range smaller than this is drawn as large.
const LEAST_RANGE: f64 = 1e-3;
/// Radii of points and of marks.
const DOT: f64 = 2.2;
const MARK: f64 = 6.0;

/// A picture of points; its axes are linear.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// What it shows.
    pub title: String,
    /// What must be said about it; can be empty.
    pub note: String,
    /// Quantity with its unit, across.
    pub x: String,
    /// Quantity with its unit, upwards.
    pub y: String,
    /// Drawn in this order.
    pub groups: Vec<PointGroup>,
}

/// Points that are drawn alike.
#[derive(Debug, Clone, PartialEq)]
pub struct PointGroup {
    /// As in the legend.
    pub label: String,
    /// How they are drawn.
    pub style: PointStyle,
    /// x and y, in the units of the axes; what is not finite is left out.
    pub points: Vec<[f64; 2]>,
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointStyle {
    /// Small, of no run in particular.
    Dots,
    /// A staircase: each point holds until the next one.
    Steps,
    /// A large one in the color of a run, by its place in the report.
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

/// A section with the pictures, if there are any.
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
        let frame = PlotArea { left: LEFT, right: RIGHT, top: TOP, bottom: BOTTOM, horizontal, vertical };
        let mut svg = Svg::new(WIDTH, HEIGHT);
        frame.draw(&mut svg, Some(&self.x), &self.y, [false, false]);
        for group in &self.groups {
            let class = group.style.class();
            let places: Vec<[f64; 2]> = group.drawable().map(|point| frame.place(point)).collect();
            match group.style {
                PointStyle::Dots => {
                    dots(&places).into_iter().for_each(|i| svg.circle(&class, places[i], DOT));
                }
                PointStyle::Run(_) => places.iter().for_each(|place| svg.circle(&class, *place, MARK)),
                PointStyle::Steps => {
                    let places: Vec<_> = places.into_iter().map(Some).collect();
                    svg.path(&class, &[staircase(&places).into_iter().flatten().collect()]);
                }
            }
        }
        svg.finish(id, title, &self.description())
    }

    /// In words: how many points there are, and where those of the runs lie.
    fn description(&self) -> String {
        let told = self.groups.iter().map(|group| match (group.style, group.drawable().next()) {
            (PointStyle::Run(_), Some([x, y])) => {
                format!("{} at {}, {}", group.label, rounded(x), rounded(y))
            }
            _ => format!("{}: {} points", group.label, group.drawable().count()),
        });
        format!("{} over {}. {}.", self.y, self.x, told.collect::<Vec<_>>().join("; "))
    }
}
