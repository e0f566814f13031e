//! Drawing of charts as SVG: panels, series, error bars, bands, guides, legend and text description.

use super::chart::{AxisRange, Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
use super::decimate::{PixelPoint, line, separate_points, step_corners};
use super::html::{Caption, Html};
use super::markers::Marker;
use super::plot_area::{BELOW, PlotArea};
use super::scale::{Extent, Scale, is_drawable};
use super::shade::{band_descriptions, shade};
use super::svg::{Anchor, Svg};
use super::text::number;

/// Size in pixels; the page scales the plot to its width.
const WIDTH: f64 = 920.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = WIDTH - 16.0;
const TOP: f64 = 8.0;
/// Height of a single panel, height of one of several panels, and gap between panels, pixels.
const HEIGHT_ALONE: f64 = 330.0;
const HEIGHT: f64 = 154.0;
const GAP: f64 = 16.0;
/// Approximate distance between ticks, pixels. Low panels have closer ticks, so that they have at least
/// three.
const X_TICKS: f64 = 90.0;
const Y_TICKS_ALONE: f64 = 36.0;
const Y_TICKS: f64 = 28.0;
/// Margin at the ends of the range, as a fraction of it. Lines may end at the side, markers must not be cut.
const X_MARGIN: f64 = 0.03;
const Y_MARGIN: f64 = 0.06;
/// Number of points above which markers are small.
const MANY: usize = 300;
/// Relative size of small markers.
const SMALL: f64 = 0.5;
/// Half the width of the end caps of an error bar, pixels.
const CAP: f64 = 3.5;
/// Tolerance for rounding at the ends of a range, as a fraction of it.
const SLACK: f64 = 1e-9;
/// Distance of a guide's label from its line and from the edge of the panel, and height of its text, pixels.
const LABEL_GAP: f64 = 5.0;
const TEXT_HEIGHT: f64 = 15.0;
/// Width reserved for a label, pixels.
const LABEL_WIDTH: f64 = 160.0;
/// Number of rows for labels of vertical guides, so that labels of close guides do not overlap.
const LABEL_ROWS: usize = 3;

impl ChartAxis {
    /// Converts a value to the unit of the axis, or to its common logarithm on a logarithmic axis.
    pub(super) fn coordinate(&self, value: f64) -> f64 {
        let value = value / self.unit.size;
        if self.is_logarithmic { value.log10() } else { value }
    }

    /// Converts a value to a coordinate of the axis; returns `None` if it cannot be drawn.
    pub(super) fn shown(&self, value: f64) -> Option<f64> {
        Some(self.coordinate(value)).filter(|v| is_drawable(*v))
    }

    /// Returns the scale of the axis for `values`, SI units.
    fn scale(&self, values: impl Iterator<Item = f64>, margin: f64, steps: f64) -> Scale {
        let least = self.unit.least_range;
        let fixed = match self.range {
            AxisRange::Within(from, to) if from < to => self.shown(from).zip(self.shown(to)),
            _ => None,
        };
        let scale = match fixed {
            Some((min, max)) => Scale::within(Extent { min, max }, least, steps),
            None => {
                let extent = Extent::of(values.map(|v| self.coordinate(v)));
                let zero = (self.range == AxisRange::WithZero || extent.is_none()).then_some(0.0);
                let extent = Extent::join(extent, Extent::of(zero)).unwrap_or(Extent { min: 0.0, max: 0.0 });
                Scale::within(extent.at_least(least).with_margin(margin), least, steps)
            }
        };
        if self.is_logarithmic { scale.of_logarithms() } else { scale }
    }
}

impl ChartSeries {
    /// Returns the half length of the error bar of a point, SI units.
    fn error(&self, index: usize) -> Option<f64> {
        self.errors.get(index).copied().filter(|e| *e > 0.0 && e.is_finite())
    }

    /// Returns y and the ends of the error bars of the points whose x is shown, SI units.
    fn heights(&self, is_shown: impl Fn(f64) -> bool) -> impl Iterator<Item = f64> {
        let points = self.points.iter().enumerate().filter(move |(_, point)| is_shown(point[0]));
        points.flat_map(|(i, &[_, y])| {
            let error = self.error(i).unwrap_or(0.0);
            [y, y - error, y + error]
        })
    }
}

/// Returns true if a value lies in a range, within the rounding tolerance.
fn holds(extent: &Extent, value: f64) -> bool {
    let slack = SLACK * extent.span();
    (extent.min - slack..=extent.max + slack).contains(&value)
}

impl Chart {
    /// Appends the chart to a page.
    pub(super) fn append_to(&self, html: &mut Html) {
        let areas = self.areas();
        let outside: usize = areas.iter().map(|(panel, area)| self.count_outside(panel, area)).sum();
        let mut notes: Vec<String> = Some(self.note.clone()).filter(|n| !n.is_empty()).into_iter().collect();
        if outside > 0 {
            let verb = if outside == 1 { "value lies" } else { "values lie" };
            notes.push(format!("{} {verb} outside the plot", number(outside as f64, 0)));
        }
        let caption = Caption { title: self.title.clone(), note: notes.join("; "), legend: self.legend() };
        html.figure("strip", &caption, &self.title, |id, title| self.draw(&areas, id, title));
    }

    /// Returns each panel with its plot area.
    fn areas(&self) -> Vec<(&Panel, PlotArea)> {
        let series = || self.panels.iter().flat_map(|panel| &panel.series);
        let across = series().flat_map(|s| s.points.iter().map(|p| p[0]));
        let marked = self.bands.iter().flat_map(|b| [b.from, b.to]).chain(self.lines.iter().map(|g| g.at));
        let margin = if series().any(|s| s.style.is_points()) { X_MARGIN } else { 0.0 };
        let horizontal = self.x.scale(across.chain(marked), margin, (RIGHT - LEFT) / X_TICKS);
        let (height, ticks) =
            if self.panels.len() > 1 { (HEIGHT, Y_TICKS) } else { (HEIGHT_ALONE, Y_TICKS_ALONE) };
        let area = |(i, panel): (usize, &Panel)| {
            let top = TOP + i as f64 * (height + GAP);
            let marked =
                panel.bands.iter().flat_map(|b| [b.from, b.to]).chain(panel.lines.iter().map(|g| g.at));
            let is_shown = |x: f64| self.x.shown(x).is_some_and(|x| holds(&horizontal.extent, x));
            let upwards = panel.series.iter().flat_map(|s| s.heights(is_shown)).chain(marked);
            let vertical = panel.y.scale(upwards, Y_MARGIN, height / ticks);
            PlotArea { left: LEFT, right: RIGHT, top, bottom: top + height, horizontal, vertical }
        };
        self.panels.iter().enumerate().map(|one| (one.1, area(one))).collect()
    }

    /// Converts a pair of values to the units of the axes; returns `None` if one of them cannot be drawn.
    fn shown(&self, panel: &Panel, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        Some([self.x.shown(x)?, panel.y.shown(y)?])
    }

    /// Converts a pair of values to pixels; returns `None` if it lies outside the plot area.
    fn to_pixels(&self, panel: &Panel, area: &PlotArea, point: [f64; 2]) -> Option<PixelPoint> {
        let shown = self.shown(panel, point)?;
        let is_inside = holds(&area.horizontal.extent, shown[0]) && holds(&area.vertical.extent, shown[1]);
        is_inside.then(|| area.to_pixels(shown))
    }

    /// Counts the pairs that lie above or below the plot area.
    fn count_outside(&self, panel: &Panel, area: &PlotArea) -> usize {
        let points = panel.series.iter().flat_map(|series| &series.points);
        let shown = points.filter_map(|point| self.shown(panel, *point));
        shown.filter(|[x, y]| holds(&area.horizontal.extent, *x) && !holds(&area.vertical.extent, *y)).count()
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

    fn draw(&self, areas: &[(&Panel, PlotArea)], id: &str, title: &str) -> String {
        let bottom = areas.last().map_or(TOP, |(_, area)| area.bottom);
        let mut svg = Svg::new(WIDTH, bottom + BELOW);
        for (i, (panel, area)) in areas.iter().enumerate() {
            let label = (i + 1 == areas.len()).then(|| self.x.unit.label(&self.x.quantity));
            // Zero at the edge of the panel needs no line.
            let has_zero = |axis: &ChartAxis, scale: Scale| scale.extent.min < 0.0 && !axis.is_logarithmic;
            let zero = [has_zero(&self.x, area.horizontal), has_zero(&panel.y, area.vertical)];
            area.draw(&mut svg, label.as_deref(), &panel.y.unit.label(&panel.y.quantity), zero);
            shade(&mut svg, area, &self.bands, &self.x, false);
            shade(&mut svg, area, &panel.bands, &panel.y, true);
            let drawn: Vec<PixelPoint> =
                panel.series.iter().flat_map(|series| self.series(&mut svg, panel, area, series)).collect();
            if drawn.is_empty() {
                let middle = area.bottom - (area.bottom - area.top) / 2.0;
                svg.text("tick", [(LEFT + RIGHT) / 2.0, middle], Anchor::Middle, "no values");
            }
            self.draw_vertical_guides(&mut svg, area);
            panel.draw_horizontal_guides(&mut svg, area, &drawn);
        }
        svg.finish(id, title, &self.description())
    }

    /// Draws a series and returns its points in pixels.
    fn series(&self, svg: &mut Svg, panel: &Panel, area: &PlotArea, series: &ChartSeries) -> Vec<PixelPoint> {
        let points: Vec<Option<PixelPoint>> =
            series.points.iter().map(|point| self.to_pixels(panel, area, *point)).collect();
        self.error_bars(svg, panel, area, series, &points);
        let class = series.style.class();
        match series.style {
            SeriesStyle::Points(group) => {
                let markers: Vec<PixelPoint> = points.iter().copied().flatten().collect();
                let kept = separate_points(&markers);
                let (class, size) =
                    if kept.len() > MANY { (format!("{class} many"), SMALL) } else { (class, 1.0) };
                let mark = Marker::for_group(group);
                let strokes: Vec<_> = kept.into_iter().flat_map(|i| mark.strokes(markers[i], size)).collect();
                svg.path(&class, &strokes);
            }
            style => {
                let corners =
                    if let SeriesStyle::Steps(_) = style { step_corners(&points) } else { points.clone() };
                let parts = line(&corners);
                // A casing keeps the line visible among many markers.
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
        area: &PlotArea,
        series: &ChartSeries,
        points: &[Option<PixelPoint>],
    ) {
        let Extent { min, max } = area.vertical.extent;
        let bars: Vec<(PixelPoint, [f64; 2])> = points
            .iter()
            .enumerate()
            .filter_map(|(i, point)| {
                let (pixel, error) = ((*point)?, series.error(i)?);
                let end = |y: f64| Some(area.y()(panel.y.shown(y)?.clamp(min, max)));
                let y = series.points[i][1];
                Some((pixel, [end(y - error)?, end(y + error)?]))
            })
            .collect();
        let middles: Vec<PixelPoint> = bars.iter().map(|(middle, _)| *middle).collect();
        let strokes: Vec<Vec<PixelPoint>> = separate_points(&middles)
            .into_iter()
            .flat_map(|i| {
                let ([x, _], [low, high]) = bars[i];
                let cap = |y: f64| vec![[x - CAP, y], [x + CAP, y]];
                [vec![[x, low], [x, high]], cap(low), cap(high)]
            })
            .collect();
        svg.path(&series.style.error_class(), &strokes);
    }

    /// Draws the marked values of x.
    fn draw_vertical_guides(&self, svg: &mut Svg, area: &PlotArea) {
        let marked = guides(&self.lines, &self.x, &area.horizontal);
        for (i, (value, label)) in marked.enumerate() {
            let x = area.x()(value);
            svg.line("guide", [x, area.top], [x, area.bottom]);
            let y = area.top + TEXT_HEIGHT * (1 + i % LABEL_ROWS) as f64;
            if x - area.left > LABEL_WIDTH {
                svg.text("tick halo", [x - LABEL_GAP, y], Anchor::End, label);
            } else {
                svg.text("tick halo", [x + LABEL_GAP, y], Anchor::Start, label);
            }
        }
    }

    /// Returns the text alternative: the range of each series, bands and marked values.
    fn description(&self) -> String {
        let mut sentences: Vec<String> = Vec::new();
        for panel in &self.panels {
            let y = &panel.y;
            let mut parts: Vec<String> = panel
                .series
                .iter()
                .map(|series| {
                    let drawable = series.points.iter().filter(|point| self.shown(panel, **point).is_some());
                    let heights = drawable.map(|[_, height]| *height);
                    let count = if series.style.is_points() {
                        format!(", {} points,", number(heights.clone().count() as f64, 0))
                    } else {
                        String::new()
                    };
                    match Extent::of(heights) {
                        Some(Extent { min, max }) => {
                            let [min, max] = [min, max].map(|v| y.unit.format(v));
                            format!("{}{count} from {min} to {max}", series.label)
                        }
                        None => format!("{}: no values", series.label),
                    }
                })
                .collect();
            parts.extend(panel.lines.iter().filter_map(|guide| guide.description(y)));
            parts.extend(band_descriptions(&panel.bands, y));
            sentences.push(format!("{} over {}: {}.", y.quantity, self.x.quantity, parts.join("; ")));
        }
        let marked: Vec<String> = self.lines.iter().filter_map(|guide| guide.description(&self.x)).collect();
        let marked: Vec<String> = marked.into_iter().chain(band_descriptions(&self.bands, &self.x)).collect();
        if !marked.is_empty() {
            sentences.push(format!("{}: {}.", self.x.quantity, marked.join("; ")));
        }
        sentences.join(" ")
    }
}

/// Returns the marked values inside a range, in the unit of their axis, with their labels.
fn guides<'a>(
    lines: &'a [Guide],
    axis: &'a ChartAxis,
    scale: &'a Scale,
) -> impl Iterator<Item = (f64, &'a str)> {
    let shown = lines.iter().filter_map(|guide| Some((axis.shown(guide.at)?, guide.label.as_str())));
    shown.filter(|(value, _)| holds(&scale.extent, *value))
}

impl Guide {
    /// Returns a text such as "mean at 95.1 kg".
    fn description(&self, axis: &ChartAxis) -> Option<String> {
        axis.shown(self.at)
            .map(|_| format!("{} at {}", self.label, axis.unit.format(self.at)).trim().to_owned())
    }
}

impl Panel {
    /// Draws the marked values of y; each label is at the side with fewer points.
    fn draw_horizontal_guides(&self, svg: &mut Svg, area: &PlotArea, drawn: &[PixelPoint]) {
        let mut occupied: Vec<(bool, f64)> = Vec::new();
        for (value, label) in guides(&self.lines, &self.y, &area.vertical) {
            let y = area.y()(value);
            svg.line("guide", [area.left, y], [area.right, y]);
            let is_at_top = y - area.top < TEXT_HEIGHT + LABEL_GAP;
            let base = if is_at_top { y + TEXT_HEIGHT } else { y - LABEL_GAP };
            let near = || drawn.iter().filter(|p| (base - TEXT_HEIGHT..=base).contains(&p[1]));
            let at_left = near().filter(|p| p[0] < area.left + LABEL_WIDTH).count();
            let at_right = near().filter(|p| p[0] > area.right - LABEL_WIDTH).count();
            let covers = |is_left: bool| {
                occupied.iter().any(|(left, other)| *left == is_left && (other - base).abs() < TEXT_HEIGHT)
            };
            let is_left = if covers(false) != covers(true) { covers(false) } else { at_left < at_right };
            occupied.push((is_left, base));
            let (x, anchor) = if is_left {
                (area.left + LABEL_GAP, Anchor::Start)
            } else {
                (area.right - LABEL_GAP, Anchor::End)
            };
            svg.text("tick halo", [x, base], anchor, label);
        }
    }
}
