//! How a chart is drawn.

use super::chart::{AxisRange, Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
use super::decimate::{PixelPoint, dots, line, staircase};
use super::html::{Caption, Html};
use super::markers::Mark;
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::shade::{shade, told};
use super::svg::{Anchor, Svg};
use super::text::number;

/// Pixels at natural size; the page scales the picture to its width.
const WIDTH: f64 = 920.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
/// Heights of an area that stands alone and of one of several, and what is between these.
const HEIGHT_ALONE: f64 = 330.0;
const HEIGHT: f64 = 154.0;
const GAP: f64 = 16.0;
/// Pixels from tick to tick, about: a label across, a line of text upwards; a low area has them near
/// each other, since less than three say nothing.
const X_TICKS: f64 = 90.0;
const Y_TICKS_ALONE: f64 = 36.0;
const Y_TICKS: f64 = 28.0;
/// Room at the ends of the range, part of it: lines may end at the side, points must not be cut.
const X_MARGIN: f64 = 0.03;
const Y_MARGIN: f64 = 0.06;
/// More points than this are drawn small.
const MANY: usize = 300;
/// Size of the marks of many points.
const SMALL: f64 = 0.5;
/// Half the width of an error bar's ends, pixels.
const CAP: f64 = 3.5;
/// What rounding may put beyond the end of a range, part of it.
const SLACK: f64 = 1e-9;
/// Distance of a guide's label from its line and from the area's edge, and height of its text, pixels.
const LABEL_GAP: f64 = 5.0;
const TEXT_HEIGHT: f64 = 15.0;
/// Room that a label takes, pixels.
const LABEL_ROOM: f64 = 160.0;
/// Labels of upright guides stand in so many rows, so that near ones do not cover each other.
const LABEL_ROWS: usize = 3;

impl ChartAxis {
    /// A value in the unit of the axis, if it can be drawn.
    pub(super) fn shown(&self, value: f64) -> Option<f64> {
        Some(value / self.unit.size).filter(|v| is_drawable(*v))
    }

    /// The scale of an axis for some values, SI.
    fn scale(&self, values: impl Iterator<Item = f64>, margin: f64, steps: f64) -> Scale {
        let least = self.unit.least_range;
        let fixed = match self.range {
            AxisRange::Within(from, to) if from < to => self.shown(from).zip(self.shown(to)),
            _ => None,
        };
        if let Some((min, max)) = fixed {
            return Scale::within(Extent { min, max }, least, steps);
        }
        let extent = Extent::of(values.map(|v| v / self.unit.size));
        let zero = (self.range == AxisRange::WithZero || extent.is_none()).then_some(0.0);
        let extent = Extent::join(extent, Extent::of(zero)).unwrap_or(Extent { min: 0.0, max: 0.0 });
        Scale::within(extent.at_least(least).with_margin(margin), least, steps)
    }
}

impl ChartSeries {
    /// The error bar of a point, SI.
    fn error(&self, place: usize) -> Option<f64> {
        self.errors.get(place).copied().filter(|e| *e > 0.0 && e.is_finite())
    }

    /// Values of y with the ends of the error bars, SI, of the points whose x (SI) is shown.
    fn heights(&self, is_shown: impl Fn(f64) -> bool) -> impl Iterator<Item = f64> {
        let points = self.points.iter().enumerate().filter(move |(_, point)| is_shown(point[0]));
        points.flat_map(|(i, &[_, y])| {
            let error = self.error(i).unwrap_or(0.0);
            [y, y - error, y + error]
        })
    }
}

/// Whether a value lies in a range, but for rounding.
fn holds(extent: &Extent, value: f64) -> bool {
    let slack = SLACK * extent.span();
    (extent.min - slack..=extent.max + slack).contains(&value)
}

impl Chart {
    /// Its figure on a page.
    pub(super) fn put(&self, html: &mut Html) {
        let frames = self.frames();
        let outside: usize = frames.iter().map(|(panel, frame)| self.outside(panel, frame)).sum();
        let mut notes: Vec<String> = Some(self.note.clone()).filter(|n| !n.is_empty()).into_iter().collect();
        if outside > 0 {
            let verb = if outside == 1 { "value lies" } else { "values lie" };
            notes.push(format!("{} {verb} outside the picture", number(outside as f64, 0)));
        }
        let caption = Caption { title: self.title.clone(), note: notes.join("; "), legend: self.legend() };
        html.figure("strip", &caption, &self.title, |id, title| self.draw(&frames, id, title));
    }

    /// Where each panel is drawn.
    fn frames(&self) -> Vec<(&Panel, PlotArea)> {
        let series = || self.panels.iter().flat_map(|panel| &panel.series);
        let across = series().flat_map(|s| s.points.iter().map(|p| p[0]));
        let marked = self.bands.iter().flat_map(|b| [b.from, b.to]).chain(self.lines.iter().map(|g| g.at));
        let margin = if series().any(|s| s.style.is_points()) { X_MARGIN } else { 0.0 };
        let horizontal = self.x.scale(across.chain(marked), margin, (RIGHT - LEFT) / X_TICKS);
        let (height, ticks) =
            if self.panels.len() > 1 { (HEIGHT, Y_TICKS) } else { (HEIGHT_ALONE, Y_TICKS_ALONE) };
        let frame = |(i, panel): (usize, &Panel)| {
            let top = TOP + i as f64 * (height + GAP);
            let marked =
                panel.bands.iter().flat_map(|b| [b.from, b.to]).chain(panel.lines.iter().map(|g| g.at));
            let is_shown = |x: f64| self.x.shown(x).is_some_and(|x| holds(&horizontal.extent, x));
            let upwards = panel.series.iter().flat_map(|s| s.heights(is_shown)).chain(marked);
            let vertical = panel.y.scale(upwards, Y_MARGIN, height / ticks);
            PlotArea { left: LEFT, right: RIGHT, top, bottom: top + height, horizontal, vertical }
        };
        self.panels.iter().enumerate().map(|one| (one.1, frame(one))).collect()
    }

    /// A pair of values in the units of the axes, if both can be drawn.
    fn shown(&self, panel: &Panel, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.shown(x)?, panel.y.shown(y)?])
    }

    /// Where a pair of values is drawn; nowhere if it lies outside.
    fn place(&self, panel: &Panel, frame: &PlotArea, point: [f64; 2]) -> Option<PixelPoint> {
        let shown = self.shown(panel, point)?;
        let is_inside = holds(&frame.horizontal.extent, shown[0]) && holds(&frame.vertical.extent, shown[1]);
        is_inside.then(|| frame.place(shown))
    }

    /// Number of pairs that lie above or below the area.
    fn outside(&self, panel: &Panel, frame: &PlotArea) -> usize {
        let points = panel.series.iter().flat_map(|series| &series.points);
        let shown = points.filter_map(|point| self.shown(panel, *point));
        shown
            .filter(|[x, y]| holds(&frame.horizontal.extent, *x) && !holds(&frame.vertical.extent, *y))
            .count()
    }

    fn legend(&self) -> Vec<(String, String)> {
        let series = self.panels.iter().flat_map(|panel| &panel.series);
        let series = series.map(|s| (s.style.class(), s.label.clone()));
        let bands = self.bands.iter().chain(self.panels.iter().flat_map(|panel| &panel.bands));
        let bands = bands.map(|b| (format!("band {}", b.class.name()), b.label.clone()));
        let mut legend: Vec<(String, String)> = Vec::new();
        for key in series.chain(bands).filter(|(_, label)| !label.is_empty()) {
            if !legend.contains(&key) {
                legend.push(key);
            }
        }
        legend
    }

    fn draw(&self, frames: &[(&Panel, PlotArea)], id: &str, title: &str) -> String {
        let bottom = frames.last().map_or(TOP, |(_, frame)| frame.bottom);
        let mut svg = Svg::new(WIDTH, bottom + BELOW);
        for (i, (panel, frame)) in frames.iter().enumerate() {
            let label = (i + 1 == frames.len()).then(|| self.x.unit.label(&self.x.quantity));
            // At the side of the area zero needs no line.
            let zero = [frame.horizontal, frame.vertical].map(|scale| scale.extent.min < 0.0);
            frame.draw(&mut svg, label.as_deref(), &panel.y.unit.label(&panel.y.quantity), zero);
            shade(&mut svg, frame, &self.bands, &self.x, false);
            shade(&mut svg, frame, &panel.bands, &panel.y, true);
            let drawn: Vec<PixelPoint> =
                panel.series.iter().flat_map(|series| self.series(&mut svg, panel, frame, series)).collect();
            if drawn.is_empty() {
                let middle = frame.bottom - (frame.bottom - frame.top) / 2.0;
                svg.text("tick", [(LEFT + RIGHT) / 2.0, middle], Anchor::Middle, "no values");
            }
            self.upright(&mut svg, frame);
            panel.level(&mut svg, frame, &drawn);
        }
        svg.finish(id, title, &self.description())
    }

    /// Draws a series; the points that it goes through.
    fn series(
        &self,
        svg: &mut Svg,
        panel: &Panel,
        frame: &PlotArea,
        series: &ChartSeries,
    ) -> Vec<PixelPoint> {
        let points: Vec<Option<PixelPoint>> =
            series.points.iter().map(|point| self.place(panel, frame, *point)).collect();
        self.error_bars(svg, panel, frame, series, &points);
        let class = series.style.class();
        match series.style {
            SeriesStyle::Points(group) => {
                let places: Vec<PixelPoint> = points.iter().copied().flatten().collect();
                let kept = dots(&places);
                let (class, size) =
                    if kept.len() > MANY { (format!("{class} many"), SMALL) } else { (class, 1.0) };
                let mark = Mark::of(group);
                let strokes: Vec<_> = kept.into_iter().flat_map(|i| mark.strokes(places[i], size)).collect();
                svg.path(&class, &strokes);
            }
            style => {
                let corners =
                    if let SeriesStyle::Steps(_) = style { staircase(&points) } else { points.clone() };
                let parts = line(&corners);
                // Among many points a line is seen by the room about it.
                let hides = |other: &ChartSeries| other.style.is_points() && other.points.len() > MANY;
                if panel.series.iter().any(hides) {
                    svg.path("casing", &parts);
                }
                svg.path(&class, &parts);
            }
        }
        points.into_iter().flatten().collect()
    }

    fn error_bars(
        &self,
        svg: &mut Svg,
        panel: &Panel,
        frame: &PlotArea,
        series: &ChartSeries,
        points: &[Option<PixelPoint>],
    ) {
        let Extent { min, max } = frame.vertical.extent;
        let bars: Vec<(PixelPoint, [f64; 2])> = points
            .iter()
            .enumerate()
            .filter_map(|(i, point)| {
                let (place, error) = ((*point)?, series.error(i)?);
                let end = |y: f64| Some(frame.y()(panel.y.shown(y)?.clamp(min, max)));
                let y = series.points[i][1];
                Some((place, [end(y - error)?, end(y + error)?]))
            })
            .collect();
        let places: Vec<PixelPoint> = bars.iter().map(|(place, _)| *place).collect();
        let strokes: Vec<Vec<PixelPoint>> = dots(&places)
            .into_iter()
            .flat_map(|i| {
                let ([x, _], [low, high]) = bars[i];
                let cap = |y: f64| vec![[x - CAP, y], [x + CAP, y]];
                [vec![[x, low], [x, high]], cap(low), cap(high)]
            })
            .collect();
        svg.path(&series.style.error_class(), &strokes);
    }

    /// Marked values of x.
    fn upright(&self, svg: &mut Svg, frame: &PlotArea) {
        let marked = guides(&self.lines, &self.x, &frame.horizontal);
        for (i, (value, label)) in marked.enumerate() {
            let x = frame.x()(value);
            svg.line("guide", [x, frame.top], [x, frame.bottom]);
            let y = frame.top + TEXT_HEIGHT * (1 + i % LABEL_ROWS) as f64;
            if x - frame.left > LABEL_ROOM {
                svg.text("tick halo", [x - LABEL_GAP, y], Anchor::End, label);
            } else {
                svg.text("tick halo", [x + LABEL_GAP, y], Anchor::Start, label);
            }
        }
    }

    /// In words: the range of each series, and what is marked.
    fn description(&self) -> String {
        let mut told_of: Vec<String> = Vec::new();
        for panel in &self.panels {
            let y = &panel.y;
            let mut parts: Vec<String> = panel
                .series
                .iter()
                .map(|series| {
                    let drawable = series.points.iter().filter_map(|point| self.shown(panel, *point));
                    let heights = drawable.map(|[_, height]| height);
                    let count = if series.style.is_points() {
                        format!(", {} points,", number(heights.clone().count() as f64, 0))
                    } else {
                        String::new()
                    };
                    match Extent::of(heights) {
                        Some(Extent { min, max }) => {
                            let [min, max] = [min, max].map(|v| y.unit.show(v * y.unit.size));
                            format!("{}{count} from {min} to {max}", series.label)
                        }
                        None => format!("{}: no values", series.label),
                    }
                })
                .collect();
            parts.extend(panel.lines.iter().filter_map(|guide| guide.told(y)));
            parts.extend(told(&panel.bands, y));
            told_of.push(format!("{} over {}: {}.", y.quantity, self.x.quantity, parts.join("; ")));
        }
        let marked: Vec<String> = self.lines.iter().filter_map(|guide| guide.told(&self.x)).collect();
        let marked: Vec<String> = marked.into_iter().chain(told(&self.bands, &self.x)).collect();
        if !marked.is_empty() {
            told_of.push(format!("{}: {}.", self.x.quantity, marked.join("; ")));
        }
        told_of.join(" ")
    }
}

/// Marked values inside a range, in the unit of their axis, with their labels.
fn guides<'a>(
    lines: &'a [Guide],
    axis: &'a ChartAxis,
    scale: &'a Scale,
) -> impl Iterator<Item = (f64, &'a str)> {
    let shown = lines.iter().filter_map(|guide| Some((axis.shown(guide.at)?, guide.label.as_str())));
    shown.filter(|(value, _)| holds(&scale.extent, *value))
}

impl Guide {
    /// "mean at 95.1 kg".
    fn told(&self, axis: &ChartAxis) -> Option<String> {
        axis.shown(self.at)
            .map(|_| format!("{} at {}", self.label, axis.unit.show(self.at)).trim().to_owned())
    }
}

impl Panel {
    /// Marked values of y; the label stands at the side where fewer points are drawn.
    fn level(&self, svg: &mut Svg, frame: &PlotArea, drawn: &[PixelPoint]) {
        let mut taken: Vec<(bool, f64)> = Vec::new();
        for (value, label) in guides(&self.lines, &self.y, &frame.vertical) {
            let y = frame.y()(value);
            svg.line("guide", [frame.left, y], [frame.right, y]);
            let is_at_top = y - frame.top < TEXT_HEIGHT + LABEL_GAP;
            let base = if is_at_top { y + TEXT_HEIGHT } else { y - LABEL_GAP };
            let near = || drawn.iter().filter(|p| (base - TEXT_HEIGHT..=base).contains(&p[1]));
            let at_left = near().filter(|p| p[0] < frame.left + LABEL_ROOM).count();
            let at_right = near().filter(|p| p[0] > frame.right - LABEL_ROOM).count();
            let covers = |is_left: bool| {
                taken.iter().any(|(left, other)| *left == is_left && (other - base).abs() < TEXT_HEIGHT)
            };
            let is_left = if covers(false) != covers(true) { covers(false) } else { at_left < at_right };
            taken.push((is_left, base));
            let (x, anchor) = if is_left {
                (frame.left + LABEL_GAP, Anchor::Start)
            } else {
                (frame.right - LABEL_GAP, Anchor::End)
            };
            svg.text("tick halo", [x, base], anchor, label);
        }
    }
}
