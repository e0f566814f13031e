//! Figures of a run as a list: subject, quantity, unit and value. Tables, CSV and comparisons are made of it.

use virtual_axes_core::config::AxisUnits;
use virtual_axes_core::trial::{AxisFigures, CircleFigures, Figures, Reference};
use virtual_axes_core::units::{DEGREE, METER_PER_MINUTE, MICROMETER, MILLIDEGREE, MILLIMETER};
use virtual_axes_nc::offline::{ProgramFigures, ProgrammedErrors};

/// One figure of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figure {
    /// Axis, circle or corner; empty for the whole path.
    pub subject: String,
    /// Quantity.
    pub name: String,
    /// Unit of the value.
    pub unit: &'static str,
    /// Value in its unit; NaN for none.
    pub value: f64,
    /// Number of decimals in tables.
    pub decimals: usize,
    /// True if the value has a sign, such as a radial deviation.
    pub is_signed: bool,
}

impl Figure {
    fn new(subject: &str, name: &str, value: f64, unit: &'static str) -> Self {
        Figure {
            subject: subject.to_owned(),
            name: name.to_owned(),
            unit,
            value,
            decimals: 1,
            is_signed: false,
        }
    }

    fn with_decimals(self, decimals: usize) -> Self {
        Figure { decimals, ..self }
    }

    fn signed(self) -> Self {
        Figure { is_signed: true, ..self }
    }

    /// Returns subject and quantity.
    pub fn title(&self) -> String {
        match self.subject.as_str() {
            "" => self.name.clone(),
            subject => format!("{subject}: {}", self.name),
        }
    }

    /// Returns the value with its decimals, without a negative zero; a dash for none.
    pub fn text(&self) -> String {
        if self.value.is_nan() {
            return "–".to_owned();
        }
        rounded(self.value, self.decimals).replace('-', "−")
    }

    /// Returns the value and its difference from `base`: in percent, or in the unit of a signed value.
    pub fn compared_text(&self, base: &Figure) -> String {
        let text = self.text();
        if text == base.text() {
            return text;
        }
        if self.is_signed {
            let difference = rounded(self.value - base.value, self.decimals);
            let is_zero = difference.chars().all(|c| matches!(c, '0' | '.'));
            return if is_zero { text } else { format!("{text} ({})", with_sign(&difference)) };
        }
        match percent(base, self) {
            Some(change) => format!("{text} ({change})"),
            None => text,
        }
    }
}

/// Change above which a factor is written instead, percent.
const MOST_PERCENT: f64 = 1000.0;

/// Returns the relative change between two figures, as in "−81 %" or "× 12"; `None` for less than half a percent, and
/// if the first figure is printed as zero.
pub fn percent(from: &Figure, to: &Figure) -> Option<String> {
    let is_zero = from.text().chars().all(|c| matches!(c, '0' | '.'));
    let change = 100.0 * (to.value / from.value - 1.0);
    let factor = to.value / from.value;
    let text = match rounded(change, 0).as_str() {
        "0" => return None,
        _ if factor > MOST_PERCENT / 100.0 => format!("× {factor:.0}"),
        percent => format!("{} %", with_sign(percent)),
    };
    (!is_zero && change.is_finite()).then_some(text)
}

/// Writes a number with its sign and a typographic minus.
fn with_sign(number: &str) -> String {
    match number.strip_prefix('-') {
        Some(digits) => format!("−{digits}"),
        None => format!("+{number}"),
    }
}

fn rounded(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.starts_with('-') && text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Returns the figures of the moving axes, or of all axes if none moves.
pub fn of_axes(figures: &Figures) -> Vec<Figure> {
    let none_moves = figures.axes.iter().all(|axis| !axis.moves);
    figures.axes.iter().filter(|axis| axis.moves || none_moves).flat_map(of_axis).collect()
}

fn of_axis(axis: &AxisFigures) -> Vec<Figure> {
    let AxisUnits { error: scale, error_name: unit, .. } = AxisUnits::for_kind(axis.kind);
    let r = &axis.report;
    let new = |name: &str, value: f64, unit| Figure::new(&axis.name, name, value, unit);
    vec![
        new("following error, max", r.max_following_error / scale, unit),
        new("following error, RMS", r.rms_following_error / scale, unit),
        new("delay-compensated following error, max", r.max_delay_compensated_following_error / scale, unit),
        new("delay-compensated following error, RMS", r.rms_delay_compensated_following_error / scale, unit),
        new("peak current", r.peak_current, "A").with_decimals(2),
        new("time at a limit", r.saturation_time, "s").with_decimals(3),
        new("control activity", r.control_activity, "A").with_decimals(3),
    ]
}

/// Returns energy and power of the moving axes, or of all axes if none moves, and of the common DC link.
pub fn of_energy(figures: &Figures) -> Vec<Figure> {
    let none_moves = figures.axes.iter().all(|axis| !axis.moves);
    let axes = figures.axes.iter().filter(|axis| axis.moves || none_moves);
    let mut found: Vec<Figure> = axes
        .filter_map(|axis| Some((axis, axis.energy?)))
        .flat_map(|(axis, energy)| {
            let new = |name: &str, value: f64, unit| Figure::new(&axis.name, name, value, unit);
            let holding = energy.holding_power.unwrap_or(f64::NAN);
            [
                new("electrical input", energy.input, "J").signed(),
                new("copper loss", energy.copper_loss, "J"),
                new("mechanical work", energy.mechanical_work, "J").signed(),
                new("energy fed back", energy.returned, "J"),
                new("peak power", energy.peak_power, "W").with_decimals(0),
                new("holding power", holding, "W").with_decimals(2),
            ]
        })
        .collect();
    if let Some(link) = figures.dc_link {
        let new = |name: &str, value: f64, unit| Figure::new("DC link", name, value, unit);
        found.push(new("electrical input", link.drawn - link.returned, "J").signed());
        found.push(new("energy drawn", link.drawn, "J"));
        found.push(new("energy fed back", link.returned, "J"));
        found.push(new("peak power", link.peak_power, "W").with_decimals(0));
    }
    found
}

/// Returns the contour errors of a part program against its programmed path.
pub(super) fn of_program(figures: &ProgramFigures) -> Vec<Figure> {
    let of = |errors: Option<ProgrammedErrors>, motion: &'static str| {
        let rows = |errors: ProgrammedErrors| {
            [
                ("contour error from the programmed path, max", errors.max),
                ("contour error from the programmed path, RMS", errors.rms),
                ("share of blending, max", errors.blending),
                ("share of the drives, max", errors.drives),
            ]
        };
        let figure = move |(name, value): (&str, f64)| {
            Figure::new("", &format!("{name}{motion}"), value / MICROMETER, "µm")
        };
        errors.into_iter().flat_map(rows).map(figure)
    };
    of(figures.cuts, "").chain(of(figures.rapids, ", at rapid traverse")).collect()
}

/// Returns contour error, orientation error and corners. `ends` adds the contour errors
/// without the overshoot at the ends of the path.
pub fn of_path(figures: &Figures, ends: bool) -> Vec<Figure> {
    let mut found = of_contour(figures, ends);
    if let Some(orientation) = figures.orientation.filter(|orientation| orientation.max > 0.0) {
        found.push(Figure::new("", "orientation error, max", orientation.max / MILLIDEGREE, "mdeg"));
        found.push(Figure::new("", "orientation error, RMS", orientation.rms / MILLIDEGREE, "mdeg"));
    }
    for corner in &figures.corners {
        let subject = format!("corner after move {}, {:.0}°", corner.index, corner.turn / DEGREE);
        let value = corner.max_contour_error / MICROMETER;
        found.push(Figure::new(&subject, "contour error, max", value, "µm"));
    }
    found
}

/// Returns the figures of circular tests after ISO 230-4: each circle, and circles in both directions.
pub fn of_circles(figures: &Figures) -> Vec<Figure> {
    let mut found = Vec::new();
    for circle in &figures.circles {
        let plane = circle.plane.join("–");
        let direction = if circle.counterclockwise { "counterclockwise" } else { "clockwise" };
        let subject = format!("circle R {} mm in {plane}, {direction}", millimeters(circle.radius));
        let new = |name: &str, value: f64| Figure::new(&subject, name, value / MICROMETER, "µm");
        found.push(Figure::new(&subject, "feed", circle.feed / METER_PER_MINUTE, "m/min").with_decimals(3));
        found.push(new("radial deviation, mean", circle.mean).signed());
        found.push(new("radial deviation, min", circle.min).signed());
        found.push(new("radial deviation, max", circle.max).signed());
        found.extend(circle.circular_deviation.map(|g| new("circular deviation G", g)));
        for (place, spike) in spike_names(circle).iter().zip(circle.reversal_spikes.into_iter().flatten()) {
            found.push(new(&format!("reversal spike at {place}"), spike).signed());
        }
    }
    for pair in &figures.bidirectional {
        let new = |name: &str, value: f64| Figure::new("both directions", name, value / MICROMETER, "µm");
        found.push(new("circular deviation G(b)", pair.circular_deviation));
        found.push(new("mean radial deviation D", pair.mean_radial_deviation).signed());
    }
    found
}

/// Returns the reversal points of a circle: +X, +Y, −X, −Y in its plane.
pub fn spike_names(circle: &CircleFigures) -> [String; 4] {
    let [first, second] = &circle.plane;
    [format!("+{first}"), format!("+{second}"), format!("−{first}"), format!("−{second}")]
}

fn of_contour(figures: &Figures, ends: bool) -> Vec<Figure> {
    let Some(contour) = &figures.contour else { return Vec::new() };
    let reference = match contour.reference {
        Reference::Path => "",
        Reference::Setpoints => " (from the polyline of setpoints)",
    };
    let parts = [
        ("contour error, max", contour.max, contour.max_within_ends),
        ("contour error, RMS", contour.rms, contour.rms_within_ends),
    ];
    let mut found = Vec::new();
    for (name, whole, within_ends) in parts {
        found.push(Figure::new("", &format!("{name}{reference}"), whole / MICROMETER, "µm"));
        if ends {
            let name = format!("{name}, without end overshoot");
            found.push(Figure::new("", &name, within_ends / MICROMETER, "µm"));
        }
    }
    if let Some(rapids) = contour.rapids {
        let new = |name: &str, value: f64| Figure::new("", name, value / MICROMETER, "µm");
        found.push(new("contour error at rapid traverse, max", rapids.max));
        found.push(new("contour error at rapid traverse, RMS", rapids.rms));
    }
    found
}

/// Returns true if a printed contour error changes when the overshoot at the ends of the path is excluded.
pub fn overshoots(figures: &Figures) -> bool {
    let differ = |a: f64, b: f64| rounded(a / MICROMETER, 1) != rounded(b / MICROMETER, 1);
    figures.contour.is_some_and(|c| differ(c.max, c.max_within_ends) || differ(c.rms, c.rms_within_ends))
}

fn millimeters(value: f64) -> String {
    // Rounded to 1 µm, so that 0.15 m is 150 and not 150.00000000000003.
    format!("{}", (value / MILLIMETER * 1e3).round() / 1e3)
}
