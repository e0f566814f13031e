//! Section of the recordings: contents, and segmentation into standstill, constant velocity and acceleration
//! (Prévost fig. 4).

use virtual_axes_identify::identify::summary::RecordingSummary;
use virtual_axes_identify::identify::{Agreement, ConditionedRecording, MotionSegment, SegmentKind};
use virtual_axes_identify::recording::{SignalSpan, Signals};

use super::figures;
use super::page::IdentificationPage;
use crate::{
    Band, BandClass, Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle, Table,
    TableColumn,
};

pub(super) fn section(page: &IdentificationPage) -> Section {
    let (found, recordings) = (page.found, &page.found.recordings);
    let agreements = found.identification.agreements.iter().map(Some).chain(std::iter::repeat(None));
    let charts = recordings.iter().zip(agreements).map(|(recorded, a)| chart(page, &recorded.signals, a));
    let text = "Velocity and acceleration are derivatives of the position after a zero-phase low-pass \
                filter; its cut-off frequency is at −3 dB. Shaded intervals are the segments of the motion \
                (Prévost fig. 4); parts that are too short or not steady belong to none.";
    Section {
        paragraphs: vec![text.to_owned()],
        notices: recordings
            .iter()
            .flat_map(|recorded| &recorded.findings)
            .map(|finding| page.notice(finding))
            .collect(),
        tables: vec![table(page, &found.summary.recordings)],
        charts: charts.collect(),
        ..Section::new("Recordings")
    }
}

/// Creates a section with the notices and the table of one recording.
pub(super) fn single_recording(
    page: &IdentificationPage,
    recorded: &ConditionedRecording,
    recording: &RecordingSummary,
) -> Section {
    Section {
        notices: recorded.findings.iter().map(|finding| page.notice(finding)).collect(),
        tables: vec![table(page, std::slice::from_ref(recording))],
        ..Section::default()
    }
}

/// Lists recordings with their sections and the parts of their motion.
fn table(page: &IdentificationPage, recordings: &[RecordingSummary]) -> Table {
    let mut table = figures::recordings(
        recordings.iter().map(|recording| (page.file_name(&recording.name).to_owned(), recording)),
    );
    table.columns.push(TableColumn::new("spans", ""));
    table
        .columns
        .extend(["static", "constant velocity", "accelerating"].map(|name| TableColumn::new(name, "s")));
    for (row, recording) in table.rows.iter_mut().zip(recordings) {
        row.push(recording.spans.to_string());
        row.extend(recording.segments_s.map(|duration| format!("{duration:.1}")));
    }
    table
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
            format!("Recording {}", page.file_name(&signals.name)),
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
