//! Section of the feedforward weights VFFW and TFFW: recorded feedforward over the derivatives of PSEC.

use virtual_axes_core::units::Rounded;
use virtual_axes_identify::identify::FeedforwardRegression;

use super::figures;
use super::page::{IdentificationPage, format_r_squared};
use super::step::Step;
use crate::extent::Extent;
use crate::{Chart, ChartAxis, ChartSeries, DisplayUnit, Panel, Section, SeriesStyle};

/// Velocity or torque feedforward weight.
struct Weight<'a> {
    name: &'static str,
    title: &'static str,
    equation: u32,
    found: Option<&'a FeedforwardRegression>,
    /// Unit of the weight.
    unit: &'static str,
    /// Quantity and unit of the derivative of PSEC.
    x: (&'static str, DisplayUnit),
    /// Quantity and unit of the feedforward signal.
    y: (&'static str, DisplayUnit),
    /// Weight of the identified axis.
    value: f64,
}

pub(super) fn section(page: &IdentificationPage) -> Section {
    let (found, weights) = (&page.found.identification.feedforward, page.axis().feedforward);
    let mut section = page.step("Feedforward", Step::Feedforward);
    let (speed, acceleration, torque) = if page.has_linear_motor() {
        ("m/s", "m/s²", DisplayUnit::new("N", 1.0, 1e-3))
    } else {
        ("rad/s", "rad/s²", DisplayUnit::new("N·m", 1.0, 1e-3))
    };
    let unit = |symbol| DisplayUnit::new(symbol, 1.0, 1e-3);
    let both = [
        Weight {
            name: "VFFW",
            title: "Velocity feedforward",
            equation: 6,
            found: found.velocity.as_ref(),
            unit: "",
            x: ("dPSEC/dt at the motor", unit(speed)),
            y: ("VFFWS", unit(speed)),
            value: weights.velocity,
        },
        Weight {
            name: "TFFW",
            title: "Torque feedforward",
            equation: 7,
            found: found.torque.as_ref(),
            unit: page.inertia_unit().symbol,
            x: ("d²PSEC/dt² at the motor", unit(acceleration)),
            y: ("TFFWS", torque),
            value: weights.torque,
        },
    ];
    section.paragraphs.push(
        "The weights are the ratios of the feedforward signals to the backward differences of PSEC (Prévost \
         eqs. 6 to 8)."
            .to_owned(),
    );
    section.paragraphs.extend(both.iter().map(|weight| weight.text(page)));
    section.charts.extend(both.iter().filter_map(|w| w.found.map(|found| w.chart(found))));
    section
}

impl Weight<'_> {
    fn text(&self, page: &IdentificationPage) -> String {
        let Weight { name, equation, unit, value, .. } = self;
        let identification = &page.found.identification;
        if let Some(found) = self.found {
            let unit = if unit.is_empty() { String::new() } else { format!(", in {unit}") };
            return format!("{} (eq. {equation}){unit}.", figures::regression(name, found));
        }
        if *equation == 7 && identification.feedforward.is_torque_zero {
            return "TFFW = 0: TFFWS is 0 throughout.".to_owned();
        }
        let own = format!("feedforward.{}", if *equation == 6 { "velocity" } else { "torque" });
        let refined = identification.refinement.iter().flat_map(|refinement| &refinement.parameters);
        let value = format!("{} {unit}", Rounded(*value));
        let value = value.trim_end();
        match refined.into_iter().any(|refined| refined.parameter.to_string() == own) {
            true => format!("{name}: no recording has {name}S. The refinement in closed loop gives {value}."),
            false => {
                format!("{name} was not identified: no recording has {name}S other than 0. It stays {value}.")
            }
        }
    }

    fn chart(&self, found: &FeedforwardRegression) -> Chart {
        let points = found.points.iter().map(|(x, y)| [*x, *y]).collect();
        let line = Extent::of(found.points.iter().map(|point| point.0))
            .map_or_else(Vec::new, |e| [e.min, e.max].map(|x| [x, found.value * x]).to_vec());
        let series = vec![
            ChartSeries::new("regression", SeriesStyle::Commanded, line),
            ChartSeries::new("recorded", SeriesStyle::Points(0), points),
        ];
        let axis = |(quantity, unit): (&str, DisplayUnit)| ChartAxis::new(quantity, unit);
        Chart {
            note: format!("R² {}", format_r_squared(found.r_squared)),
            ..Chart::new(self.title, axis(self.x), vec![Panel::new(axis(self.y), series)])
        }
    }
}
