//! Scatter plots of a search in a report.

use virtual_axes_report::{PointGroup, PointStyle, Report, Scatter};

fn page(scatters: &[Scatter]) -> String {
    let mut bytes = Vec::new();
    let report = Report { title: "search", description: "", runs: Vec::new(), ..Report::default() };
    report.write_with(scatters, &mut bytes).expect("memory can be written");
    String::from_utf8(bytes).expect("UTF-8")
}

fn scatter(points: Vec<[f64; 2]>) -> Scatter {
    let group = |label: &str, style, points| PointGroup { label: label.to_owned(), style, points };
    Scatter {
        title: "Cost <&>".to_owned(),
        note: String::new(),
        x: "Cost (µm)".to_owned(),
        y: "Modulus margin".to_owned(),
        groups: vec![
            group("tunings", PointStyle::Dots, points.clone()),
            group("front", PointStyle::Steps, points.clone()),
            group("best", PointStyle::Run(1), points.into_iter().take(1).collect()),
        ],
    }
}

#[test]
fn points_are_drawn_in_their_style_and_text_is_escaped() {
    let text = page(&[scatter(vec![[1.0, 0.5], [2.0, 0.6], [3.0, 0.8]])]);
    // Three dots and the sample of the legend.
    assert_eq!(text.matches("<circle class=\"dot\"").count(), 4);
    assert_eq!(text.matches("<circle class=\"mark run-2\"").count(), 2);
    assert!(text.contains("Cost &lt;&amp;&gt;") && !text.contains("<&>"));
    assert!(text.contains("best at 1.00, 0.50"));
}

#[test]
fn a_pareto_front_is_a_step_plot() {
    let text = page(&[scatter(vec![[1.0, 0.5], [2.0, 0.6]])]);
    let (_, path) = text.split_once("<path class=\"line solid front\" d=\"M1 6h32").expect("the legend");
    let (_, path) = path.split_once("<path class=\"line solid front\" d=\"").expect("the line");
    // Horizontal to the next point first, then vertical.
    let path = path.split('"').next().unwrap_or_default();
    let (_, steps) = path.split_once('l').expect("a line");
    let (across, up) = steps.split_once(" 0 0-").expect("level, then upright");
    assert!(across.parse::<f64>().is_ok_and(|x| x > 0.0) && up.parse::<f64>().is_ok(), "{path}");
}

#[test]
fn undrawable_points_are_omitted() {
    let hostile = vec![[f64::NAN, 1.0], [1.0, f64::INFINITY], [1e300, -1e300], [2.0, 2.0]];
    for points in [hostile, Vec::new()] {
        let text = page(&[scatter(points)]);
        assert!(!text.contains("NaN") && !text.contains("inf\""), "{text}");
    }
    assert!(!page(&[]).contains("Search"));
}
