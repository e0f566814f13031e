//! Section of gravity: currents at standstill and the gravity model.

use virtual_axes_core::config::{AxisConfig, AxisKind};
use virtual_axes_identify::identify::summary::GravitySummary;
use virtual_axes_identify::identify::{GravityCurrent, GravitySource, Standstill};

use super::figures;
use super::page::IdentificationPage;
use super::step::Step;
use crate::extent::Extent;
use crate::text::{capital, digits};
use crate::{Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle, Table};

/// Number of points of the line of the gravity model.
const LINE_POINTS: usize = 181;
/// Parts of the gravity of a rotary axis at the position q.
const SINE: &str = "factor of sin q";
const COSINE: &str = "factor of cos q";

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = &page.found.identification;
    let mut section = page.step("Gravity", Step::Gravity);
    let Some(gravity) = &page.found.summary.gravity else {
        section
            .paragraphs
            .push("Gravity was not identified; the value of the initial machine is kept.".to_owned());
        if page.kind() == AxisKind::Rotary {
            section.tables.push(kept(page.axis()));
        }
        return section;
    };
    let method = match gravity.source {
        GravitySource::Regression => {
            "Friction changes its sign with the direction of motion, gravity does not: the current of all samples in motion shows \
             both beside the inertia."
        }
        GravitySource::Motion | GravitySource::Rest => {
            "At constant velocity and at rest the acceleration is zero (Prévost eq. 2), and the current is the sum of friction, \
             which changes its sign with the direction of motion or of approach, and gravity, which does not."
        }
    };
    section.paragraphs.push(format!("{method} {}.", capital(&figures::gravity(gravity)).replace('-', "−")));
    if !found.steady.standstills.is_empty() {
        section.charts.push(chart(page, gravity, &found.steady.standstills));
    }
    section.tables.push(table(page.kind(), gravity));
    section
}

fn chart(page: &IdentificationPage, gravity: &GravitySummary, rests: &[Standstill]) -> Chart {
    let approached = |label: &str, group: usize, sign: f64| {
        let of_it = rests.iter().filter(|rest| rest.approach == sign);
        ChartSeries::new(label, SeriesStyle::Points(group), of_it.map(|r| [r.position, r.current]).collect())
    };
    let mut series = vec![
        approached("approached in positive direction", 0, 1.0),
        approached("approached in negative direction", 1, -1.0),
        approached("no previous motion", 2, 0.0),
    ];
    series.retain(|series| !series.points.is_empty());
    let unit = page.position_unit();
    let mut x = ChartAxis::new("Position", unit);
    if let Some(extent) = Extent::of(rests.iter().map(|rest| rest.position)) {
        if extent.span() < unit.size {
            // A single position has no range of its own.
            x = x.within(extent.middle() - unit.size, extent.middle() + unit.size);
        }
        let position = |i: usize| extent.min + extent.span() * i as f64 / (LINE_POINTS - 1) as f64;
        let law =
            |law: &GravityCurrent| (0..LINE_POINTS).map(|i| [position(i), law.at(position(i))]).collect();
        series.push(ChartSeries::new("gravity of the model", SeriesStyle::Simulated, law(&gravity.model)));
        if let Some(at_rest) = &gravity.at_rest {
            series.push(ChartSeries::new(
                "from standstills only",
                SeriesStyle::Line(2),
                law(&at_rest.current),
            ));
        }
    }
    Chart {
        note: "static friction can shift the current by up to ±i0".to_owned(),
        ..Chart::new(
            "Current at standstill",
            x,
            vec![Panel::new(ChartAxis::new("Current", DisplayUnit::AMPERE), series)],
        )
    }
}

/// Returns the gravity of the initial machine of a rotary axis.
fn kept(axis: &AxisConfig) -> Table {
    let current = axis.transmission_ratio * axis.gravity.tilt / axis.motor.torque_constant;
    let (sine, cosine) = axis.gravity.phase.sin_cos();
    let row = |name: &str, factor: f64| vec![name.to_owned(), digits(current * factor, 4)];
    let rows = vec![row(SINE, cosine), row(COSINE, sine)];
    Table { rows, ..Table::new("Gravity as motor current", &[("current", ""), ("model", "A")]) }
}

fn table(kind: AxisKind, gravity: &GravitySummary) -> Table {
    let part = |name: &str, of: fn(&GravityCurrent) -> f64| {
        let pair = |pair: Option<(&GravityCurrent, &GravityCurrent)>| {
            pair.map_or_else(
                || [String::new(), String::new()],
                |(value, error)| [digits(of(value), 4), digits(of(error), 2)],
            )
        };
        let own = Some((&gravity.current, &gravity.error));
        let (motion, rest) = match gravity.source {
            GravitySource::Motion | GravitySource::Regression => {
                (own, gravity.at_rest.as_ref().map(|rest| (&rest.current, &rest.error)))
            }
            GravitySource::Rest => (None, own),
        };
        let mut row = vec![name.to_owned()];
        row.extend(pair(motion));
        row.extend(pair(rest));
        row.push(digits(of(&gravity.model), 4));
        row
    };
    let mut rows = vec![part("constant", |g| g.constant)];
    if kind == AxisKind::Rotary {
        rows.push(part(SINE, |g| g.sine));
        rows.push(part(COSINE, |g| g.cosine));
    }
    let columns =
        [("current", ""), ("in motion", "A"), ("±", "A"), ("at rest", "A"), ("±", "A"), ("model", "A")];
    Table { rows, ..Table::new("Gravity as motor current", &columns) }
}
