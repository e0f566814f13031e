//! Section of the refinement in closed loop: changes of the parameters and their correlations.

use super::super::document::Section;
use super::super::table::{Table, TableColumn};
use super::super::text::{listed, number};
use super::format::{columns, digits, percent};
use super::{IdentificationPage, Step};
use virtual_axes_identify::identify::summary::RefinementSummary;
use virtual_axes_identify::identify::{RefinedParameter, RefinedValue};

pub(super) fn section(page: &IdentificationPage) -> Section {
    let mut section = page.step("Refinement in closed loop", Step::Refinement);
    let Some(refinement) = &page.summary.refinement else {
        section.paragraphs.push(
            "The refinement was not run; the values are those of the preceding steps, or of the machine \
             file."
                .to_owned(),
        );
        return section;
    };
    section.paragraphs.push(text(page, refinement));
    let pairs: Vec<String> = refinement
        .correlated_pairs
        .iter()
        .map(|(a, b, rho)| format!("{a} with {b} ({})", number(*rho, 3)))
        .collect();
    section.paragraphs.push(if pairs.is_empty() {
        "No two parameters are strongly correlated.".to_owned()
    } else {
        format!(
            "Strongly correlated parameters, with their coefficient of correlation: {}. Their combined \
             effect is more accurate than each of them.",
            listed(&pairs)
        )
    });
    let heads = [
        ("parameter", ""),
        ("initial", ""),
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

fn text(page: &IdentificationPage, refinement: &RefinementSummary) -> String {
    let unit = page.error_unit().symbol;
    let of = |value: f64, unit: &str| format!("{}\u{a0}{unit}", digits(value, 3));
    let current = refinement.current_rms_a.map_or_else(String::new, |current| {
        let [before, after] = [current.before, current.after].map(|value| of(value, "A"));
        format!(", the RMS of the current deviation from {before} to {after}")
    });
    format!(
        "All parameters below are adjusted jointly to minimize the deviation of the simulated axis from the \
         recorded positions{}, weighted by the residuals. The RMS of the position deviation changes from {} \
         to {}{current}.",
        if refinement.current_rms_a.is_some() { " and currents" } else { "" },
        of(refinement.position_rms.before, unit),
        of(refinement.position_rms.after, unit)
    )
}

fn row(page: &IdentificationPage, refined: &RefinedValue) -> Vec<String> {
    let unit = match refined.parameter {
        RefinedParameter::Inertia | RefinedParameter::TorqueFeedforward => {
            page.inertia_unit().symbol.to_owned()
        }
        RefinedParameter::FrictionA
        | RefinedParameter::FrictionC
        | RefinedParameter::Coulomb
        | RefinedParameter::Breakaway => "A".to_owned(),
        RefinedParameter::FrictionB | RefinedParameter::FrictionD => page.exponent_unit().to_owned(),
        RefinedParameter::Viscous => format!("A/({})", page.velocity_unit().symbol),
        RefinedParameter::Weight => "N".to_owned(),
        RefinedParameter::TiltSine | RefinedParameter::TiltCosine => "N·m".to_owned(),
        RefinedParameter::VelocityFeedforward => String::new(),
        RefinedParameter::PositionGain => "1/s".to_owned(),
        RefinedParameter::VelocityGain => "N·m·s".to_owned(),
        RefinedParameter::VelocityIntegralTime => "s".to_owned(),
    };
    vec![
        refined.parameter.to_string(),
        digits(refined.before, 5),
        digits(refined.value, 5),
        digits(refined.error, 2),
        unit,
        percent((refined.value - refined.before) / refined.before.abs()),
        if refined.is_at_bound { "yes" } else { "" }.to_owned(),
    ]
}

/// Creates the lower triangle of the correlation matrix.
fn correlations(refinement: &RefinementSummary) -> Table {
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
