//! Pages of charts: contents, escaping, decimation, and robustness to invalid values.

use crate::report_common::charts::{axis, example, noise, validation};
use crate::report_common::{
    assert_self_contained, assert_well_formed, column, figure, figures, points, without_scripts,
};
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

#[test]
fn the_page_is_well_formed_and_self_contained() {
    let page = page(&example());
    // The page is kept for inspection.
    std::fs::write(concat!(env!("CARGO_TARGET_TMPDIR"), "/document.html"), &page)
        .expect("the folder is writable");
    assert_well_formed(&page);
    assert_self_contained(&page);
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
        ..Table::default()
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
            ..Section::default()
        }],
        ..Document::default()
    });
    assert_well_formed(&page);
    // Texts in the data of a chart do not end the script.
    assert_eq!(figure(&page, "")["panels"][0]["series"][0]["label"], hostile);
    assert_eq!(page.matches("</script>").count(), 4);
    let page = without_scripts(&page);
    let escaped = "&lt;/title&gt;&lt;script&gt;alert(1)&lt;/script&gt;&lt;img src=x onerror=alert(2)&gt; &quot; &#39; &amp;amp;";
    assert_eq!(page.matches("alert(2)").count(), page.matches(escaped).count());
    assert!(page.matches(escaped).count() >= 19);
}

#[test]
fn values_are_plotted_in_the_unit_of_the_axis() {
    let series =
        vec![ChartSeries::new("a", SeriesStyle::Measured, vec![[2e-3, -3e-5], [3e-3, 1.5e-5], [4e-3, 3e-5]])];
    let y = axis("Deviation", DisplayUnit::MICROMETER).within(-3e-5, 3e-5);
    let page =
        page_of(vec![Chart::new("One", axis("Time", DisplayUnit::MILLISECOND), vec![Panel::new(y, series)])]);
    let chart = figure(&page, "One");
    assert_eq!(points(&chart, 0, "a"), [[2.0, -30.0], [3.0, 15.0], [4.0, 30.0]]);
    let y = &chart["panels"][0]["y"];
    assert_eq!((&chart["x"]["label"], &y["label"]), (&"Time (ms)".into(), &"Deviation (µm)".into()));
    assert_eq!((&y["from"], &y["to"]), (&(-30.0).into(), &30.0.into()));
}

#[test]
fn every_chart_has_labels_with_units() {
    let page = page(&example());
    assert_eq!(figures(&page).len(), 5);
    let labels: String = figures(&page).into_iter().map(|(_, chart)| chart.to_string()).collect();
    for unit in ["(m/min)", "(A)", "(kg)", "(m/s²)", "(ms)", "(µm²)", "(µm)", "Time (s)"] {
        assert!(labels.contains(&format!("{unit}\"")), "{unit} is missing");
    }
}

#[test]
fn panels_have_the_bands_of_their_chart() {
    let chart = figure(&page_of(vec![validation(8000)]), "Measured");
    assert_eq!(chart["panels"].as_array().map(Vec::len), Some(3));
    let bands = chart["bands"].as_array().expect("bands");
    let classes: Vec<&str> = bands.iter().filter_map(|band| band["class"].as_str()).collect();
    assert_eq!(classes, ["constant", "static", "accelerating"]);
    // The first constant velocity is from 0.67 to 2.4 s.
    assert_eq!(column(&bands[0]["ends"][0]), [0.67, 2.4]);
}

#[test]
fn an_error_bar_has_the_length_of_the_error() {
    let series = ChartSeries::new("a", SeriesStyle::Points(0), vec![[0.0, 1.0], [1.0, 3.0]])
        .with_errors(vec![0.5, f64::NAN]);
    let y = axis("Length", DisplayUnit::MILLIMETER).within(0.0, 4.0);
    let chart = Chart::new("Bars", axis("Time", DisplayUnit::SECOND), vec![Panel::new(y, vec![series])]);
    let chart = figure(&page_of(vec![chart]), "Bars");
    let errors = column(&chart["panels"][0]["series"][0]["errors"]);
    assert!(errors[0] == 500.0 && errors[1].is_nan(), "{errors:?}");
}

#[test]
fn nan_breaks_lines() {
    let points_of = vec![[0.0, 1.0], [1.0, 2.0], [2.0, f64::NAN], [3.0, 1.0]];
    let series = ChartSeries::new("a", SeriesStyle::Measured, points_of);
    let panel = Panel::new(axis("v", DisplayUnit::NONE), vec![series]);
    let page = page_of(vec![Chart::new("Gap", axis("x", DisplayUnit::NONE), vec![panel])]);
    let chart = figure(&page, "Gap");
    assert!(chart["panels"][0]["series"][0]["y"][2].is_null());
    assert_eq!(points(&chart, 0, "a").len(), 4);
}

#[test]
fn a_single_peak_among_many_samples_is_kept() {
    const LONG: usize = 1_000_000;
    let mut values = vec![0.0; LONG];
    values[345_678] = 3e-6;
    let time: Vec<f64> = (0..LONG).map(|i| i as f64 * 1e-3).collect();
    let series = ChartSeries::from_xy("a", SeriesStyle::Measured, &time, &values);
    let panel = Panel::new(axis("Deviation", DisplayUnit::MICROMETER), vec![series]);
    let page = page_of(vec![Chart::new("Spike", axis("Time", DisplayUnit::SECOND), vec![panel])]);
    let drawn = points(&figure(&page, "Spike"), 0, "a");
    assert!(
        drawn.contains(&[345.678, 3.0]) && drawn.contains(&[0.0, 0.0]) && drawn.contains(&[999.999, 0.0])
    );
}

#[test]
fn the_page_size_of_long_series_is_bounded() {
    const LONG: usize = 300_000;
    const MOST_BYTES: usize = 8_000_000;
    let (x, y) = (noise(LONG, 1), noise(LONG, 2));
    let series = |i: usize| {
        let style = if i.is_multiple_of(2) { SeriesStyle::Line(i) } else { SeriesStyle::Points(i) };
        ChartSeries::from_xy("a", style, &x, &y).with_errors(vec![0.1; if i == 1 { LONG } else { 0 }])
    };
    let panel = Panel::new(axis("v", DisplayUnit::NONE), (0..8).map(series).collect());
    let bands = (0..LONG).map(|i| Band::new(BandClass::Static, i as f64, i as f64 + 0.3)).collect();
    let chart = Chart { bands, ..Chart::new("Noise", axis("x", DisplayUnit::NONE), vec![panel]) };
    let length = page_of(vec![chart.clone(), chart]).len();
    println!("{length} bytes for noise");
    assert!(length < MOST_BYTES, "{length}");
}

#[test]
fn empty_documents_and_charts_are_valid() {
    let empty = page(&Document::default());
    assert_well_formed(&empty);
    // A page without figures has no script.
    assert!(!empty.contains("<script"));
    let panel = |series| Panel::new(axis("v", DisplayUnit::AMPERE), series);
    let none = ChartSeries::new("nothing", SeriesStyle::Measured, Vec::new());
    let page = page_of(vec![
        Chart::new("No panels", axis("x", DisplayUnit::SECOND), Vec::new()),
        Chart::new("No series", axis("x", DisplayUnit::SECOND), vec![panel(Vec::new())]),
        Chart::new("No points", axis("x", DisplayUnit::SECOND), vec![panel(vec![none])]),
    ]);
    assert_well_formed(&page);
    assert_eq!(figure(&page, "No points")["panels"][0]["series"][0]["label"], "nothing");
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
        assert_self_contained(&page);
    }
}
