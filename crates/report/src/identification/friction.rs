//! Section of friction: friction law and measured friction currents (Prévost fig. 5).

use super::super::chart::{Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
use super::super::document::Section;
use super::super::table::Table;
use super::super::unit::DisplayUnit;
use super::format::{columns, digits, format_r_squared, percent, plain};
use super::{IdentificationPage, Step};
use virtual_axes_core::config::FrictionConfig;
use virtual_axes_core::drive;
use virtual_axes_identify::identify::{FrictionFit, FrictionLaw, LawFit, SteadyCurrent};

/// Number of points of the line of the law in each direction.
const LINE_POINTS: usize = 200;
/// Exponent of the spacing of the points, which are denser near standstill, where the law is curved.
const SPACING_EXPONENT: i32 = 3;
/// Smallest difference of two laws that is shown, as a fraction of the current.
const VISIBLE: f64 = 1e-3;

pub(super) fn section(page: &IdentificationPage) -> Section {
    let found = page.identification;
    let mut section = page.step("Friction law", Step::Friction);
    let Some(friction) = &found.friction else {
        section.paragraphs.push(if found.refinement.is_some() {
            format!(
                "No law was fitted to currents at constant velocities. The refinement in closed loop gives \
                 {}.",
                describe(page, &page.axis().friction)
            )
        } else {
            "No friction law was identified; the values of the machine file are kept.".to_owned()
        });
        return section;
    };
    let refined = refined(page, friction, &found.steady.levels);
    section.paragraphs.push(text(page, friction));
    if refined.is_some() {
        let law = describe(page, &page.axis().friction);
        section.paragraphs.push(format!("The refinement in closed loop changes it to {law}."));
    }
    if found.steady.levels.is_empty() {
        // A regression over all motion has no measured levels.
        return section;
    }
    section.tables.push(table(page, friction, &found.steady.levels));
    section.charts.push(chart(page, friction, refined.as_ref(), &found.steady.levels));
    section
}

fn text(page: &IdentificationPage, friction: &FrictionFit) -> String {
    let (law, unit) = (&friction.law, page.velocity_unit().symbol);
    let r2 = format_r_squared(law.r_squared);
    let mut text = match law.line() {
        Some((level, slope)) => format!(
            "A Coulomb level and a viscous slope are fitted, because the speeds do not determine the four \
             parameters of Prévost eq. 3: i = {} A + {} A/({unit}) · V, R² {r2}.",
            digits(level, 4),
            digits(slope, 3)
        ),
        None => format!(
            "The double exponential law of Prévost eq. 3 is fitted to both directions jointly: {}, R² {r2}.",
            describe(page, &law.config)
        ),
    };
    text += &format!(" i0 = {} A.", digits(law.config.i0, 4));
    if friction.asymmetry.is_finite() {
        text += &format!(
            " The directions differ by up to {} % of the friction; the law is the same for both.",
            percent(friction.asymmetry)
        );
    }
    text
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
    levels: &[SteadyCurrent],
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
        lines: vec![Guide::new(i0, format!("i0 = {} A", digits(i0, 4)))],
        ..Panel::new(ChartAxis::new("Friction current", DisplayUnit::AMPERE), series)
    };
    Chart {
        note: format!("{kind}, R² {}; bars: standard error", format_r_squared(friction.law.r_squared)),
        ..Chart::new("Friction law", ChartAxis::new("Velocity", unit), vec![panel])
    }
}

fn table(page: &IdentificationPage, friction: &FrictionFit, levels: &[SteadyCurrent]) -> Table {
    let unit = page.velocity_unit();
    let row = |level: &SteadyCurrent| {
        let v = level.velocity / unit.size;
        let difference = |law: &LawFit| percent((law.at(v) - level.friction) / level.friction);
        let own = friction.directions[usize::from(level.velocity < 0.0)].as_ref();
        vec![
            plain(level.velocity, &unit, 4),
            digits(level.current, 4),
            digits(level.friction, 4),
            digits(level.error, 2),
            digits(friction.law.at(v), 4),
            difference(&friction.law),
            own.map_or_else(String::new, |law| digits(law.at(v), 4)),
            own.map_or_else(String::new, difference),
            format!("{:.1}", level.duration),
        ]
    };
    let heads = [
        ("velocity", unit.symbol),
        ("current", "A"),
        ("friction current", "A"),
        ("±", "A"),
        ("law", "A"),
        ("law − friction", "%"),
        ("law of the direction", "A"),
        ("its deviation", "%"),
        ("duration", "s"),
    ];
    Table {
        caption: "Constant velocities".to_owned(),
        columns: columns(heads),
        rows: levels.iter().map(row).collect(),
    }
}
