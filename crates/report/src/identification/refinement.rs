//! The refinement: what it moved, and what it cannot tell apart.

use super::super::document::Section;
use super::super::table::{Table, TableColumn};
use super::super::text::{listed, number};
use super::super::unit::DisplayUnit;
use super::format::{columns, digits, percent, with_unit};
use super::{IdentificationPage, Step};
use virtual_axes_identify::identify::{Parameter, Refined, Refinement};

pub(super) fn section(page: &IdentificationPage) -> Section {
    let mut section = page.step("Refinement on the closed loop", Step::Refinement);
    let Some(refinement) = &page.identification.refinement else {
        section
            .paragraphs
            .push("There is none: the values are those of the steps, or of the machine file.".to_owned());
        return section;
    };
    section.paragraphs.push(text(page, refinement));
    let pairs: Vec<String> = refinement
        .correlated_pairs()
        .into_iter()
        .map(|(a, b, rho)| format!("{a} with {b} ({})", number(rho, 3)))
        .collect();
    section.paragraphs.push(if pairs.is_empty() {
        "No two of the parameters are hard to tell apart.".to_owned()
    } else {
        format!("Hard to tell apart, by their coefficient of correlation: {}. What they make together is told better than each of \
             them.", listed(&pairs))
    });
    let heads = [
        ("parameter", ""),
        ("before", ""),
        ("refined", ""),
        ("±", ""),
        ("unit", ""),
        ("change", "%"),
        ("at its bound", ""),
    ];
    section.tables.push(Table {
        caption: "Refined parameters".to_owned(),
        columns: columns(heads),
        rows: refinement.parameters.iter().map(|refined| row(page, refined)).collect(),
    });
    if refinement.parameters.len() > 1 {
        section.tables.push(correlations(refinement));
    }
    section
}

fn text(page: &IdentificationPage, refinement: &Refinement) -> String {
    let unit = page.error_unit();
    let of = |value: f64| with_unit(value, &unit, 3);
    let (before, after) = refinement.position;
    let current = refinement.current.map_or_else(String::new, |(before, after)| {
        let of = |value: f64| with_unit(value, &DisplayUnit::AMPERE, 3);
        format!(", of the current from {} to {}", of(before), of(after))
    });
    format!(
        "All parameters below are moved at once until the simulation of the whole axis comes nearest to the recorded \
         positions{}, each deviation weighted by what is left of it. The RMS of the deviation of position goes from {} \
         to {}{current}.",
        if refinement.current.is_some() { " and currents" } else { "" },
        of(before),
        of(after)
    )
}

fn row(page: &IdentificationPage, refined: &Refined) -> Vec<String> {
    let unit = match refined.parameter {
        Parameter::Inertia | Parameter::TorqueFeedforward => page.inertia_unit().symbol.to_owned(),
        Parameter::FrictionA | Parameter::FrictionC | Parameter::Coulomb | Parameter::Breakaway => {
            "A".to_owned()
        }
        Parameter::FrictionB | Parameter::FrictionD => page.exponent_unit().to_owned(),
        Parameter::Viscous => format!("A/({})", page.velocity_unit().symbol),
        Parameter::Weight => "N".to_owned(),
        Parameter::TiltSine | Parameter::TiltCosine => "N·m".to_owned(),
        Parameter::VelocityFeedforward => String::new(),
    };
    vec![
        refined.parameter.to_string(),
        digits(refined.before, 5),
        digits(refined.value, 5),
        digits(refined.error, 2),
        unit,
        percent((refined.value - refined.before) / refined.before.abs()),
        if refined.at_bound { "yes" } else { "" }.to_owned(),
    ]
}

/// The lower half of the matrix.
fn correlations(refinement: &Refinement) -> Table {
    let names: Vec<String> = refinement.parameters.iter().map(|p| p.parameter.to_string()).collect();
    let mut heads = vec![TableColumn::new("", "")];
    let across = names.len().saturating_sub(1);
    heads.extend(names.iter().take(across).map(|name| TableColumn::new(name.as_str(), "")));
    let rows = names.iter().zip(&refinement.correlations).enumerate().skip(1).map(|(j, (name, row))| {
        let cells = row.iter().take(across).enumerate();
        let cells = cells.map(|(k, rho)| if k < j { number(*rho, 2) } else { String::new() });
        std::iter::once(name.clone()).chain(cells).collect()
    });
    Table { caption: "Coefficients of correlation".to_owned(), columns: heads, rows: rows.collect() }
}
