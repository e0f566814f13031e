//! Section of friction: friction law and measured friction currents (Prévost fig. 5).

use virtual_axes_core::config::FrictionConfig;
use virtual_axes_core::drive;
use virtual_axes_identify::identify::{FrictionFit, FrictionLaw, RefinedParameter, SteadyCurrent};

use super::figures;
use super::friction_points::friction_points;
use super::page::{IdentificationPage, format_r_squared};
use super::step::Step;
use crate::text::{capital, digits};
use crate::{Chart, ChartAxis, ChartSeries, DisplayUnit, Guide, Panel, Section, SeriesStyle};

/// Number of points of the line of the law in each direction.
const LINE_POINTS: usize = 200;
/// Exponent of the spacing of the points, which are denser near standstill, where the law is curved.
const SPACING_EXPONENT: i32 = 3;
/// Smallest difference of two laws that is shown, as a fraction of the current.
const VISIBLE: f64 = 1e-3;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let (found, summary) = (&page.found.identification, &page.found.summary);
    let mut section = page.step("Friction law", Step::Friction);
    let (Some(friction), Some(figures)) = (&found.friction, &summary.friction) else {
        let mut refined = found.refinement.iter().flat_map(|refinement| &refinement.parameters);
        let of_law = [RefinedParameter::FrictionA, RefinedParameter::Coulomb];
        section.paragraphs.push(if refined.any(|refined| of_law.contains(&refined.parameter)) {
            format!(
                "No law was fitted to currents at constant velocities. The refinement in closed loop gives \
                 {}.",
                describe(page, &page.axis().friction)
            )
        } else {
            "No friction law was identified; the values of the initial machine are kept.".to_owned()
        });
        return section;
    };
    let refined = refined(page, friction, &found.steady.levels);
    section.paragraphs.push(format!(
        "{}. V is in {}, b and d are in {}. The model uses the same law for both directions.",
        capital(&figures::friction(figures)),
        summary.speed_unit,
        page.exponent_unit()
    ));
    if refined.is_some() {
        let law = describe(page, &page.axis().friction);
        section.paragraphs.push(format!("The refinement in closed loop changes it to {law}."));
    }
    section.tables.push(figures::friction_laws(figures, summary.speed_unit));
    if found.steady.levels.is_empty() {
        let now = drive::Friction::new(page.axis().friction, page.kind(), 1.0, 1.0);
        let points = friction_points(page.found, |v| now.bound(v).copysign(v));
        if !points.is_empty() {
            section.paragraphs.push(
                "Points are means of the recorded current at similar speeds, less inertia and gravity of the model; bars are \
                 standard deviations of the samples."
                    .to_owned(),
            );
            section.charts.push(chart(page, friction, None, (&points, "standard deviation")));
        }
        return section;
    }
    section.tables.push(figures::friction_currents(figures, summary.speed_unit));
    let levels = (found.steady.levels.as_slice(), "standard error");
    section.charts.push(chart(page, friction, refined.as_ref(), levels));
    section
}

/// Formats a friction law with its values.
fn describe(page: &IdentificationPage, law: &FrictionConfig) -> String {
    let exponent = page.exponent_unit();
    format!(
        "i = a e^(bV) + c e^(dV) with a = {} A, b = {} {exponent}, c = {} A, d = {} {exponent}",
        digits(law.a, 4),
        digits(law.b, 4),
        digits(law.c, 4),
        digits(law.d, 4)
    )
}

/// Returns the law of the refined axis if it differs visibly from the fitted one at the measured speeds.
fn refined(
    page: &IdentificationPage,
    friction: &FrictionFit,
    levels: &[SteadyCurrent],
) -> Option<drive::Friction> {
    // Gear ratio 1 and torque constant 1: torque equals current.
    let law = |config| drive::Friction::new(config, page.kind(), 1.0, 1.0);
    let (fitted, now) = (law(friction.law.config), law(page.axis().friction));
    let differ = |level: &SteadyCurrent| {
        let (fitted, now) = (fitted.bound(level.velocity), now.bound(level.velocity));
        (now - fitted).abs() > VISIBLE * fitted
    };
    levels.iter().any(differ).then_some(now)
}

fn chart(
    page: &IdentificationPage,
    friction: &FrictionFit,
    refined: Option<&drive::Friction>,
    (levels, bars): (&[SteadyCurrent], &str),
) -> Chart {
    let unit = page.velocity_unit();
    let measured = |label: &str, group: usize, sign: f64| {
        let of_it: Vec<&SteadyCurrent> = levels.iter().filter(|l| l.velocity.signum() == sign).collect();
        let points = of_it.iter().map(|l| [l.velocity, l.friction]).collect();
        ChartSeries::new(label, SeriesStyle::Points(group), points)
            .with_errors(of_it.iter().map(|l| l.error).collect())
    };
    let top = levels.iter().map(|level| level.velocity.abs()).fold(0.0, f64::max);
    let line = |law: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
        let speed = |i: usize| top * (i as f64 / LINE_POINTS as f64).powi(SPACING_EXPONENT);
        let minus = (1..=LINE_POINTS).rev().map(|i| -speed(i));
        let plus = (1..=LINE_POINTS).map(speed);
        // At standstill any current within ±i0 is possible: the line has a gap.
        minus.map(|v| [v, law(v)]).chain([[0.0, f64::NAN]]).chain(plus.map(|v| [v, law(v)])).collect()
    };
    let mut series = vec![
        measured("measured, positive direction", 0, 1.0),
        measured("measured, negative direction", 1, -1.0),
        ChartSeries::new("fitted law", SeriesStyle::Simulated, line(&|v| friction.law.at(v / unit.size))),
    ];
    if let Some(law) = refined {
        let now = line(&|v: f64| law.bound(v).copysign(v));
        series.push(ChartSeries::new("refined law", SeriesStyle::Line(2), now));
    }
    let i0 = friction.law.config.i0;
    let kind = match friction.law.law {
        FrictionLaw::DoubleExponential => "double exponential",
        FrictionLaw::Linear => "linear",
    };
    let panel = Panel {
        lines: vec![Guide::new(i0, format!("i0 = {} A", digits(i0, 4))), Guide::new(-i0, "−i0")],
        ..Panel::new(ChartAxis::new("Friction current", DisplayUnit::AMPERE), series)
    };
    Chart {
        note: format!("{kind}, R² {}; bars: {bars}", format_r_squared(friction.law.r_squared)),
        ..Chart::new("Friction law", ChartAxis::new("Velocity", unit), vec![panel])
    }
}
