//! Shaded intervals of a chart.

use super::chart::{Band, BandClass, ChartAxis};
use super::decimate::PixelPoint;
use super::plot_area::PlotArea;
use super::scale::Extent;
use super::svg::Svg;
use super::text::number;

/// Gap below which intervals are merged, pixels.
const MERGE_GAP: f64 = 0.5;
/// Smallest width of an interval, pixels.
const LEAST_WIDTH: f64 = 1.0;
/// Distance of the edge line of an interval of x from the top of the plot area, pixels. Its dash pattern
/// distinguishes the classes without color.
const EDGE: f64 = 2.0;

/// Returns the ordered ends of an interval, which can be infinite; `None` for NaN.
fn ends(band: &Band) -> Option<[f64; 2]> {
    let Band { from, to, .. } = *band;
    (!from.is_nan() && !to.is_nan()).then(|| [from.min(to), from.max(to)])
}

/// Returns the distinct classes and labels of bands, in order of first occurrence.
fn kinds(bands: &[Band]) -> Vec<(BandClass, &str)> {
    let mut kinds: Vec<(BandClass, &str)> = Vec::new();
    for band in bands {
        if !kinds.contains(&(band.class, &band.label)) {
            kinds.push((band.class, &band.label));
        }
    }
    kinds
}

/// Shades intervals of x, or of y if `upward` is true.
pub(super) fn shade(svg: &mut Svg, frame: &PlotArea, bands: &[Band], axis: &ChartAxis, upward: bool) {
    let scale = if upward { frame.vertical } else { frame.horizontal };
    let Extent { min, max } = scale.extent;
    let pixel = |value: f64| if upward { frame.y()(value) } else { frame.x()(value) };
    for kind in kinds(bands) {
        let mut parts: Vec<[f64; 2]> = bands
            .iter()
            .filter(|band| (band.class, band.label.as_str()) == kind)
            .filter_map(ends)
            .map(|ends| ends.map(|end| axis.coordinate(end)))
            .filter(|[from, to]| *from <= max && *to >= min)
            .map(|ends| {
                let [a, b] = ends.map(|end| pixel(end.clamp(min, max)));
                [a.min(b), a.max(b).max(a.min(b) + LEAST_WIDTH)]
            })
            .collect();
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut joined: Vec<[f64; 2]> = Vec::new();
        for [from, to] in parts {
            match joined.last_mut() {
                Some([_, end]) if from <= *end + MERGE_GAP => *end = end.max(to),
                _ => joined.push([from, to]),
            }
        }
        let corners = |[from, to]: &[f64; 2]| -> Vec<PixelPoint> {
            let ([left, right], [top, bottom]) = if upward {
                ([frame.left, frame.right], [*from, *to])
            } else {
                ([*from, *to], [frame.top, frame.bottom])
            };
            vec![[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
        };
        let class = kind.0.name();
        svg.path(&format!("band {class}"), &joined.iter().map(corners).collect::<Vec<_>>());
        if !upward {
            let edges: Vec<Vec<PixelPoint>> = joined
                .iter()
                .map(|[from, to]| vec![[*from, frame.top + EDGE], [*to, frame.top + EDGE]])
                .collect();
            svg.path(&format!("edge {class}"), &edges);
        }
    }
}

/// Returns the text alternative of bands: the ends of a single interval, or the number of intervals.
pub(super) fn band_descriptions(bands: &[Band], axis: &ChartAxis) -> Vec<String> {
    kinds(bands)
        .into_iter()
        .map(|kind| {
            let mut same = bands.iter().filter(|band| (band.class, band.label.as_str()) == kind);
            match (same.next().and_then(ends), same.count()) {
                (Some([from, to]), 0) => {
                    let [from, to] = [from, to].map(|end| describe_end(end, axis));
                    format!("{} from {from} to {to}", kind.1)
                }
                (_, more) => format!("{} {} times", kind.1, number(more as f64 + 1.0, 0)),
            }
        })
        .collect()
}

fn describe_end(value: f64, axis: &ChartAxis) -> String {
    match axis.shown(value) {
        Some(_) => axis.unit.format(value),
        None => "beyond the plot".to_owned(),
    }
}
