//! Section of the refinement in closed loop: changes of the parameters and their correlations.

use virtual_axes_identify::identify::summary::RefinementSummary;
use virtual_axes_identify::identify::{RefinedParameter, RefinedValue};

use super::figures;
use super::page::{IdentificationPage, percent};
use super::step::Step;
use crate::text::{capital, digits, listed, number};
use crate::{Section, Table, TableColumn};

pub(super) fn section(page: &IdentificationPage) -> Section {
    let mut section = page.step("Refinement in closed loop", Step::Refinement);
    let Some(refinement) = &page.found.summary.refinement else {
        section.paragraphs.push(
            "The refinement was not run; the values are those of the preceding steps, or of the initial \
             machine."
                .to_owned(),
        );
        return section;
    };
    let signals = match refinement.current_rms_a {
        Some(_) => "positions and currents, weighted by the residuals",
        None => "positions",
    };
    section.paragraphs.push(format!(
        "All parameters below are adjusted jointly to minimize the deviation of the simulated axis from the recorded {signals}. {}.",
        capital(&figures::refinement(refinement, page.error_unit().symbol))
    ));
    let pairs: Vec<String> = refinement
        .correlated_pairs
        .iter()
        .map(|(a, b, rho)| format!("{a} with {b} ({})", number(*rho, 3)))
        .collect();
    section.paragraphs.push(if pairs.is_empty() {
        "No two refined parameters are strongly correlated.".to_owned()
    } else {
        format!(
            "Strongly correlated parameters, with their coefficient of correlation: {}. Their combined \
             effect is more accurate than each of them.",
            listed(&pairs)
        )
    });
    let columns = [
        ("parameter", ""),
        ("initial", ""),
        ("refined", ""),
        ("±", ""),
        ("unit", ""),
        ("change", "%"),
        ("at its bound", ""),
    ];
    let rows = refinement.parameters.iter().map(|refined| row(page, refined)).collect();
    section.tables.push(Table { rows, ..Table::new("Refined parameters", &columns) });
    if refinement.parameters.len() > 1 {
        section.tables.push(correlations(refinement));
    }
    section
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
        RefinedParameter::PositionGain
        | RefinedParameter::VelocityGain
        | RefinedParameter::VelocityIntegralTime => {
            let key = format!(".{}", refined.parameter);
            let value = page.found.summary.values.iter().find(|value| value.key.contains(&key));
            value.map_or("", |value| value.unit).to_owned()
        }
    };
    let size = refined.parameter.unit_size();
    vec![
        refined.parameter.to_string(),
        digits(refined.before / size, 5),
        digits(refined.value / size, 5),
        digits(refined.error / size, 2),
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
    Table { columns: heads, rows: rows.collect(), ..Table::new("Coefficients of correlation", &[]) }
}
