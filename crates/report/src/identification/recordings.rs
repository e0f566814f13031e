//! Section of the recordings: contents, and segmentation into standstill, constant velocity and acceleration
//! (Prévost fig. 4).

use super::super::chart::{Band, BandClass, Chart, ChartAxis, ChartSeries, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::table::Table;
use super::super::unit::DisplayUnit;
use super::format::{columns, digits, exact};
use super::{IdentificationPage, notices};
use virtual_axes_identify::identify::summary::RecordingSummary;
use virtual_axes_identify::identify::{Agreement, MotionSegment, SegmentKind};
use virtual_axes_identify::recording::{Finding, SignalSpan, Signals};

pub(super) fn section(page: &IdentificationPage) -> Section {
    let agreements = page.identification.agreements.iter().map(Some).chain(std::iter::repeat(None));
    let charts = page.inputs.iter().zip(agreements).map(|(input, a)| chart(page, input.signals, a));
    let findings = page.findings.iter().take(page.inputs.len()).flatten();
    let text = "Velocity and acceleration are derivatives of the position after a zero-phase low-pass \
                filter; its cut-off frequency is at −3 dB. Shaded intervals are the segments of the motion \
                (Prévost fig. 4); parts that are too short or not steady are not used.";
    Section {
        paragraphs: vec![text.to_owned()],
        notices: findings.map(notices::notice).collect(),
        tables: vec![table(&page.summary.recordings)],
        charts: charts.collect(),
        ..Section::new("Recordings")
    }
}

/// Creates a section with the notices and the table of one recording.
pub(super) fn single_recording(recording: &RecordingSummary, findings: &[Finding]) -> Section {
    Section {
        notices: findings.iter().map(notices::notice).collect(),
        tables: vec![table(std::slice::from_ref(recording))],
        ..Section::default()
    }
}

fn table(recordings: &[RecordingSummary]) -> Table {
    let heads = [
        ("recording", ""),
        ("samples", ""),
        ("period", "ms"),
        ("cut-off", "Hz"),
        ("current lag, compensated", "ms"),
        ("spans", ""),
        ("feedforward", ""),
        ("static", "s"),
        ("constant velocity", "s"),
        ("accelerating", "s"),
    ];
    Table {
        caption: "Recordings".to_owned(),
        columns: columns(heads),
        rows: recordings.iter().map(row).collect(),
    }
}

fn row(recording: &RecordingSummary) -> Vec<String> {
    let mut row = vec![
        recording.name.clone(),
        recording.samples.to_string(),
        exact(recording.period_ms),
        digits(recording.cutoff_hz, 3),
        digits(recording.current_lag_ms, 3),
        recording.spans.to_string(),
        recording.feedforward_names(),
    ];
    row.extend(recording.segments_s.map(|duration| format!("{duration:.1}")));
    row
}

/// Creates the plot of velocity and current over time.
fn chart(page: &IdentificationPage, signals: &Signals, agreement: Option<&Agreement>) -> Chart {
    let line = |label: &str, style, channel: &dyn Fn(&SignalSpan) -> Option<Vec<f64>>| {
        ChartSeries::new(label, style, over_time(signals, channel))
    };
    let velocity = vec![line("", SeriesStyle::Measured, &|span| Some(span.velocity.clone()))];
    let mut panels = vec![Panel::new(ChartAxis::new("Velocity", page.velocity_unit()), velocity)];
    if signals.spans.iter().any(|span| span.current.is_some()) {
        let current = vec![
            line("current, recorded", SeriesStyle::Commanded, &|span| span.current.clone()),
            line("current, filtered", SeriesStyle::Measured, &|span| span.smooth_current.clone()),
        ];
        panels.push(Panel::new(ChartAxis::new("Current", DisplayUnit::AMPERE), current));
    }
    Chart {
        bands: agreement.map_or_else(Vec::new, |agreement| bands(signals, &agreement.segments)),
        ..Chart::new(
            format!("Recording {}", signals.name),
            ChartAxis::new("Time", DisplayUnit::SECOND),
            panels,
        )
    }
}

/// Returns the points of a channel over time, with gaps between spans.
pub(super) fn over_time(
    signals: &Signals,
    channel: &dyn Fn(&SignalSpan) -> Option<Vec<f64>>,
) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    for span in &signals.spans {
        let values = channel(span).unwrap_or_default();
        let time = |i: usize| span.start + i as f64 * signals.period;
        points.extend(values.into_iter().enumerate().map(|(i, value)| [time(i), value]));
        points.push([span.start, f64::NAN]);
    }
    points
}

/// Returns the segments of the motion as bands over the time of the recording.
pub(super) fn bands(signals: &Signals, segments: &[MotionSegment]) -> Vec<Band> {
    let band = |segment: &MotionSegment| {
        let span = signals.spans.get(segment.span)?;
        let time = |i: usize| span.start + i as f64 * signals.period;
        let class = match segment.kind {
            SegmentKind::Static => BandClass::Static,
            SegmentKind::ConstantVelocity => BandClass::ConstantVelocity,
            SegmentKind::Accelerating => BandClass::Accelerating,
        };
        Some(Band::new(class, time(segment.samples.start), time(segment.samples.end)))
    };
    segments.iter().filter_map(band).collect()
}
