//! Pages of charts: contents, escaping, decimation, and robustness to invalid values.

use crate::report_common::charts::{axis, example, noise, validation};
use crate::report_common::{between, picture, pictures, points};
use proptest::prelude::*;
use virtual_axes_report::{
    Band, BandClass, Chart, ChartAxis, ChartSeries, DisplayUnit, Document, Guide, Notice, NoticeLevel, Panel,
    Section, SeriesStyle, Table, TableColumn,
};

fn page(document: &Document) -> String {
    let mut bytes = Vec::new();
    document.write(&mut bytes).expect("memory can be written");
    String::from_utf8(bytes).expect("UTF-8")
}

fn page_of(charts: Vec<Chart>) -> String {
    let section = Section { charts, ..Section::new("Charts") };
    page(&Document { title: "charts".to_owned(), sections: vec![section], ..Document::default() })
}

/// Asserts that elements are nested correctly, and that every bracket belongs to a tag.
fn assert_well_formed(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a document type");
    while let Some((text, after)) = rest.split_once('<') {
        assert!(!text.contains('>') || open.last() == Some(&"style"), "{text}");
        let (tag, after) = after.split_once('>').expect("tags end");
        assert!(!tag.contains('<'), "{tag}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.trim_matches('/').split(' ').next().unwrap_or_default();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "{tag}");
        } else if name != "meta" && !tag.ends_with('/') {
            open.push(name);
        }
        rest = after;
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "{open:?} {rest}");
}

/// Returns left, top, width and height of the plot area of a plot with one panel, pixels.
fn area(picture: &str) -> [f64; 4] {
    let area = between(picture, "<rect class=\"area\"", "/>")[0];
    ["x", "y", "width", "height"]
        .map(|name| between(area, &format!(" {name}=\""), "\"")[0].parse().expect("a number"))
}

#[test]
fn the_page_is_well_formed_and_self_contained() {
    let page = page(&example());
    // The page is kept for inspection.
    std::fs::write(concat!(env!("CARGO_TARGET_TMPDIR"), "/document.html"), &page)
        .expect("the folder is writable");
    assert_well_formed(&page);
    for forbidden in ["http:", "https:", "src=", "url(", "@import", "<link", "<script", "href"] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    for wanted in ["<html lang=\"en\">", "charset=\"utf-8\"", "name=\"viewport\"", "<h2>Delays</h2>"] {
        assert!(page.contains(wanted), "{wanted}");
    }
    // Values with equal names share a row; table numbers have a minus sign (U+2212).
    assert!(page.contains("off.csv, both.csv") && page.contains("<td class=\"number\">−0.4</td>"));
    for level in ["Note", "Warning", "Missing"] {
        assert!(page.contains(&format!("<strong>{level}</strong>")), "{level}");
    }
}

#[test]
fn the_same_document_gives_the_same_bytes() {
    assert_eq!(page(&example()), page(&example()));
}

#[test]
fn untrusted_text_is_escaped() {
    let hostile = "</title><script>alert(1)</script><img src=x onerror=alert(2)> \" ' &amp;";
    let text = || hostile.to_owned();
    let chart = |points: Vec<[f64; 2]>| {
        let panel = Panel {
            bands: vec![Band::interval(hostile, 0.0, 1.0)],
            lines: vec![Guide::new(0.5, hostile)],
            ..Panel::new(
                axis(hostile, DisplayUnit::AMPERE),
                vec![ChartSeries::new(hostile, SeriesStyle::Points(0), points)],
            )
        };
        Chart {
            note: text(),
            bands: vec![Band::interval(hostile, 0.0, 1.0)],
            lines: vec![Guide::new(0.5, hostile)],
            ..Chart::new(hostile, axis(hostile, DisplayUnit::SECOND), vec![panel])
        }
    };
    let table = Table {
        caption: text(),
        columns: vec![TableColumn::new(hostile, hostile); 2],
        rows: vec![vec![text(); 2]],
    };
    let page = page(&Document {
        title: text(),
        description: text(),
        facts: vec![(text(), text())],
        sections: vec![Section {
            heading: text(),
            paragraphs: vec![text()],
            notices: vec![Notice::new(NoticeLevel::Warning, hostile)],
            tables: vec![table],
            charts: vec![chart(vec![[0.0, 1.0]]), chart(Vec::new())],
        }],
    });
    assert_well_formed(&page);
    let escaped = "&lt;/title&gt;&lt;script&gt;alert(1)&lt;/script&gt;&lt;img src=x onerror=alert(2)&gt; &quot; &#39; &amp;amp;";
    assert_eq!(page.matches("alert(2)").count(), page.matches(escaped).count());
    assert!(page.matches(escaped).count() > 30);
}

#[test]
fn values_are_plotted_in_the_unit_of_the_axis() {
    // 2…4 ms over −30…30 µm, with round ticks at the corners of the area.
    let series =
        vec![ChartSeries::new("a", SeriesStyle::Measured, vec![[2e-3, -3e-5], [3e-3, 1.5e-5], [4e-3, 3e-5]])];
    let y = axis("Deviation", DisplayUnit::MICROMETER).within(-3e-5, 3e-5);
    let page =
        page_of(vec![Chart::new("One", axis("Time", DisplayUnit::MILLISECOND), vec![Panel::new(y, series)])]);
    let picture = picture(&page, "One");
    assert!(picture.contains(">Time (ms)</text>") && picture.contains(">Deviation (µm)</text>"));
    let [left, top, width, height] = area(picture);
    let line = points(between(picture, "<path class=\"line run-1\" d=\"", "\"")[0]);
    let expected = [[left, top + height], [left + 0.5 * width, top + 0.25 * height], [left + width, top]];
    assert_eq!(line.len(), 3);
    for (point, wanted) in line.iter().zip(expected) {
        // Coordinates are written in tenths of a pixel.
        assert!(
            (point[0] - wanted[0]).abs() < 0.11 && (point[1] - wanted[1]).abs() < 0.11,
            "{point:?} {wanted:?}"
        );
    }
    assert!(picture.contains("a from −30.0\u{a0}µm to 30.0\u{a0}µm"), "the description contains the range");
    assert!(!page.contains("outside the plot"));
}

#[test]
fn every_chart_has_labels_with_units() {
    let page = page(&example());
    let pictures = pictures(&page);
    assert_eq!(pictures.len(), 5);
    for (picture, labels) in pictures.iter().zip([2, 2, 2, 2, 4]) {
        assert_eq!(picture.matches("<text class=\"label\"").count(), labels);
        assert!(picture.contains("<title") && !between(picture, "<desc", "</desc>")[0].is_empty());
        let ids = between(picture, " id=\"", "\"");
        assert_eq!(between(picture, "aria-labelledby=\"", "\""), [ids.join(" ")]);
    }
    for unit in ["(m/min)", "(A)", "(kg)", "(m/s²)", "(ms)", "(µm²)", "(µm)", "Time (s)"] {
        assert!(page.contains(&format!("{unit}</text>")), "{unit} is missing");
    }
}

#[test]
fn panels_are_aligned_with_their_bands() {
    let page = page_of(vec![validation(8000)]);
    let picture = picture(&page, "Measured");
    let lines: Vec<_> =
        between(picture, "<path class=\"line run-1\" d=\"", "\"").into_iter().map(points).collect();
    assert_eq!(lines.len(), 3);
    let [left, _, width, _] = area(picture);
    for line in &lines {
        let (first, last) = (line[0][0], line[line.len() - 1][0]);
        assert!((first - left).abs() < 0.05 && (last - left - width).abs() < 0.05, "{first}…{last}");
    }
    // Each class is in each panel, and once in the legend.
    for class in ["static", "constant", "accelerating"] {
        assert_eq!(picture.matches(&format!("<path class=\"band {class}\"")).count(), 3, "{class}");
        assert_eq!(page.matches(&format!("<rect class=\"band {class}\"")).count(), 1, "{class}");
    }
    for label in ["measured", "simulated", "constant velocity"] {
        assert_eq!(page.matches(&format!("</svg>{label}</span>")).count(), 1, "{label}");
    }
    // The first constant velocity is from 0.67 to 2.4 s of 7.999.
    let band = points(between(picture, "<path class=\"band constant\" d=\"", "\"")[0]);
    let at = |t: f64| left + width * t / 7.999;
    assert!((band[0][0] - at(0.67)).abs() < 0.2 && (band[1][0] - at(2.4)).abs() < 0.2, "{band:?}");
}

#[test]
fn an_error_bar_has_the_length_of_the_error() {
    let series = ChartSeries::new("a", SeriesStyle::Points(0), vec![[0.0, 1.0], [1.0, 3.0]])
        .with_errors(vec![0.5, f64::NAN]);
    let y = axis("Current", DisplayUnit::AMPERE).within(0.0, 4.0);
    let page = page_of(vec![Chart::new(
        "Bars",
        axis("Time", DisplayUnit::SECOND),
        vec![Panel::new(y, vec![series])],
    )]);
    let picture = picture(&page, "Bars");
    let [_, top, _, height] = area(picture);
    let bar = points(between(picture, "<path class=\"error run-1\" d=\"", "\"")[0]);
    // One bar with two end caps: NaN has no bar.
    assert_eq!(bar.len(), 6);
    let length = (bar[0][1] - bar[1][1]).abs();
    assert!((length - height / 4.0).abs() < 0.21, "{length} of {height}");
    assert!((bar[0][1] - (top + height * 3.5 / 4.0)).abs() < 0.11);
}

#[test]
fn values_outside_the_range_are_reported_and_not_drawn() {
    let values = [1.0, 2.0, 90.0, 1.5, -80.0, 1.0];
    let time = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
    let y = axis("Current", DisplayUnit::AMPERE).within(0.0, 4.0);
    let series = vec![ChartSeries::from_xy("a", SeriesStyle::Measured, &time, &values)];
    let page =
        page_of(vec![Chart::new("Part", axis("Time", DisplayUnit::SECOND), vec![Panel::new(y, series)])]);
    assert!(page.contains("<span class=\"note\">2 values lie outside the plot</span>"));
    let picture = picture(&page, "Part");
    let line = between(picture, "<path class=\"line run-1\" d=\"", "\"")[0];
    assert_eq!(line.matches('M').count(), 3, "{line}");
    // Points outside a window of time are not reported and do not affect the range of values.
    let series = vec![ChartSeries::from_xy("a", SeriesStyle::Measured, &time, &values)];
    let window = axis("Time", DisplayUnit::SECOND).within(2.5, 3.5);
    let page = page_of(vec![Chart::new(
        "Window",
        window,
        vec![Panel::new(axis("Current", DisplayUnit::AMPERE), series)],
    )]);
    assert!(!page.contains("outside") && !page.contains(">80</text>"));
}

#[test]
fn nan_breaks_lines_and_step_plots() {
    let points = vec![[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 1.0], [4.0, 2.0]];
    for (style, parts) in [(SeriesStyle::Measured, 2), (SeriesStyle::Steps(0), 2)] {
        let panel =
            Panel::new(axis("v", DisplayUnit::NONE), vec![ChartSeries::new("a", style, points.clone())]);
        let page = page_of(vec![Chart::new("Gap", axis("x", DisplayUnit::NONE), vec![panel])]);
        let line = between(picture(&page, "Gap"), "<path class=\"line run-1\" d=\"", "\"")[0];
        assert_eq!(line.matches('M').count(), parts, "{style:?}: {line}");
    }
}

#[test]
fn lines_and_points_differ_by_more_than_color() {
    let page = page(&Document::default());
    let dash = |number: usize| {
        between(&page, &format!(".line.run-{number} {{"), "}")
            .first()
            .map_or("", |rule| between(rule, "stroke-dasharray:", ";")[0])
            .to_owned()
    };
    let dashes: Vec<String> = (1..=6).map(dash).collect();
    for (i, one) in dashes.iter().enumerate() {
        assert!(!dashes[..i].contains(one), "line {} has the dash pattern of another one: {one}", i + 1);
    }
    let series =
        (0..4).map(|g| ChartSeries::new(format!("g{g}"), SeriesStyle::Points(g), vec![[g as f64, 1.0]]));
    let panel = Panel::new(axis("v", DisplayUnit::NONE), series.collect());
    let page = page_of(vec![Chart::new("Groups", axis("x", DisplayUnit::NONE), vec![panel])]);
    for shape in ["round", "square", "cross", "plus"] {
        assert_eq!(page.matches(&format!("class=\"points {shape} ")).count(), 2, "{shape}: plot and legend");
    }
}

#[test]
fn a_single_peak_among_many_samples_is_kept() {
    const LONG: usize = 100_000;
    let mut values = vec![0.0; LONG];
    values[34_567] = 3e-6;
    let time: Vec<f64> = (0..LONG).map(|i| i as f64 * 1e-3).collect();
    for style in [SeriesStyle::Measured, SeriesStyle::Steps(0)] {
        let panel = Panel::new(
            axis("Deviation", DisplayUnit::MICROMETER),
            vec![ChartSeries::from_xy("a", style, &time, &values)],
        );
        let page = page_of(vec![Chart::new("Spike", axis("Time", DisplayUnit::SECOND), vec![panel])]);
        let picture = picture(&page, "Spike");
        let [left, _, width, height] = area(picture);
        let line = points(between(picture, "<path class=\"line run-1\" d=\"", "\"")[0]);
        let top = line.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
        let bottom = line.iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        assert!(bottom - top > 0.8 * height, "{top}…{bottom} of {height}");
        let spike = line.iter().find(|p| p[1] == top).expect("it is present");
        assert!(((spike[0] - left) / width - 0.345_67).abs() < 1e-3, "at {}", spike[0]);
    }
}

#[test]
fn the_page_size_of_long_series_is_bounded() {
    const LONG: usize = 100_000;
    const MOST_BYTES_PER_SERIES: usize = 400_000;
    let (x, y) = (noise(LONG, 1), noise(LONG, 2));
    let sorted: Vec<f64> = (0..LONG).map(|i| i as f64).collect();
    let gaps: Vec<f64> = y.iter().enumerate().map(|(i, v)| if i % 2 == 0 { *v } else { f64::NAN }).collect();
    let styles =
        [SeriesStyle::Measured, SeriesStyle::Steps(1), SeriesStyle::Points(0), SeriesStyle::Points(2)];
    for style in styles {
        for (name, x, y) in [("over time", &sorted, &y), ("anywhere", &x, &y), ("with gaps", &x, &gaps)] {
            let series = ChartSeries::from_xy("a", style, x, y).with_errors(vec![0.1; LONG]);
            let bare = ChartSeries { errors: Vec::new(), ..series.clone() };
            let length = |series| {
                let panel = Panel::new(axis("v", DisplayUnit::NONE), vec![series]);
                page_of(vec![Chart::new("Noise", axis("x", DisplayUnit::NONE), vec![panel])]).len()
            };
            let (bare, barred) = (length(bare), length(series));
            println!("{style:?} {name}: {bare} bytes, {barred} with error bars");
            assert!(bare < MOST_BYTES_PER_SERIES && barred < 3 * MOST_BYTES_PER_SERIES, "{bare}, {barred}");
        }
    }
    let bands = (0..LONG).map(|i| Band::new(BandClass::Static, i as f64, i as f64 + 0.3)).collect();
    let chart = Chart {
        bands,
        ..Chart::new(
            "Bands",
            axis("x", DisplayUnit::NONE),
            vec![Panel::new(axis("v", DisplayUnit::NONE), Vec::new())],
        )
    };
    assert!(page_of(vec![chart]).len() < MOST_BYTES_PER_SERIES);
}

#[test]
fn empty_documents_and_charts_are_valid() {
    let empty = page(&Document::default());
    assert_well_formed(&empty);
    let panel = |series| Panel::new(axis("v", DisplayUnit::AMPERE), series);
    let none = ChartSeries::new("nothing", SeriesStyle::Measured, Vec::new());
    let page = page_of(vec![
        Chart::new("No panels", axis("x", DisplayUnit::SECOND), Vec::new()),
        Chart::new("No series", axis("x", DisplayUnit::SECOND), vec![panel(Vec::new())]),
        Chart::new("No points", axis("x", DisplayUnit::SECOND), vec![panel(vec![none])]),
    ]);
    assert_well_formed(&page);
    assert_eq!(page.matches(">no values</text>").count(), 2);
    assert!(page.contains("nothing: no values"));
}

/// Generates values of failed divisions or fits, and ordinary ones.
fn any_value() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE),
        Just(0.0),
        Just(-0.0),
        Just(1e12),
        Just(-1e12),
        -1e3..1e3f64,
        -1e-9..1e-9f64,
        any::<f64>()
    ]
}

fn any_style() -> impl Strategy<Value = SeriesStyle> {
    prop_oneof![
        Just(SeriesStyle::Commanded),
        Just(SeriesStyle::Measured),
        Just(SeriesStyle::Simulated),
        any::<usize>().prop_map(SeriesStyle::Line),
        any::<usize>().prop_map(SeriesStyle::Steps),
        any::<usize>().prop_map(SeriesStyle::Points)
    ]
}

fn any_axis() -> impl Strategy<Value = ChartAxis> {
    (any_value(), any_value(), any_value(), any_value(), 0..3).prop_map(|(size, least, from, to, range)| {
        let axis = ChartAxis::new("q", DisplayUnit::new("u", size, least));
        match range {
            0 => axis,
            1 => axis.with_zero(),
            _ => axis.within(from, to),
        }
    })
}

fn any_series() -> impl Strategy<Value = ChartSeries> {
    let points = prop::collection::vec(prop::array::uniform2(any_value()), 0..20);
    (any_style(), points, prop::collection::vec(any_value(), 0..25))
        .prop_map(|(style, points, errors)| ChartSeries::new("s", style, points).with_errors(errors))
}

fn any_panel() -> impl Strategy<Value = Panel> {
    let bands =
        prop::collection::vec((any_value(), any_value()).prop_map(|(a, b)| Band::interval("b", a, b)), 0..3);
    let lines = prop::collection::vec(any_value().prop_map(|v| Guide::new(v, "g")), 0..4);
    (any_axis(), prop::collection::vec(any_series(), 0..3), bands, lines)
        .prop_map(|(y, series, bands, lines)| Panel { y, series, bands, lines })
}

proptest! {
    #[test]
    fn no_value_breaks_the_page(
        x in any_axis(),
        panels in prop::collection::vec(any_panel(), 0..3),
        bands in prop::collection::vec((any_value(), any_value()), 0..4),
        lines in prop::collection::vec(any_value(), 0..4),
    ) {
        let chart = Chart {
            bands: bands.into_iter().map(|(a, b)| Band::new(BandClass::Accelerating, a, b)).collect(),
            lines: lines.into_iter().map(|v| Guide::new(v, "g")).collect(),
            ..Chart::new("Any", x, panels)
        };
        let page = page_of(vec![chart]);
        assert_well_formed(&page);
        let mut words = page.split(|c: char| !c.is_alphanumeric()).map(str::to_lowercase);
        prop_assert!(!words.any(|w| ["nan", "inf", "infinity"].contains(&w.as_str())));
        let most = pictures(&page).iter().map(|p| p.matches("<text").count()).max();
        prop_assert!(most.unwrap_or(0) < 100, "{most:?} texts");
    }
}
