//! What a chart shows: pairs of values, on one or several areas with a common x axis.

use super::html::run_class;
use super::markers::Mark;
use super::unit::DisplayUnit;

/// A picture of pairs of values; all axes are linear.
///
/// Values are in SI and are labeled in the unit of their axis; a [`DisplayUnit`] of size 1 shows them as
/// given. What is not finite, or beyond ±1e12 of the unit, is not drawn, and breaks a line. Long series are
/// thinned to what can be seen, peaks and lonely points kept.
///
/// ```
/// use virtual_axes::report::{Band, BandClass, Chart, ChartAxis, Document, Guide, Panel};
/// use virtual_axes::report::{Section, ChartSeries, SeriesStyle, DisplayUnit};
///
/// let time = [0.0, 0.1, 0.2, 0.3];
/// let measured = ChartSeries::from_xy("measured", SeriesStyle::Measured, &time, &[0.0, 1e-6, 2e-6, 1e-6]);
/// let simulated = ChartSeries::from_xy("simulated", SeriesStyle::Simulated, &time, &[0.0, 2e-6, 2e-6, 0.0]);
/// let deviation = Panel::new(ChartAxis::new("Deviation", DisplayUnit::MICROMETER), vec![measured, simulated]);
/// let current = ChartSeries::from_xy("measured", SeriesStyle::Measured, &time, &[0.0, 4.0, 1.5, 1.5]);
/// let current = Panel {
///     lines: vec![Guide::new(1.5, "friction")],
///     ..Panel::new(ChartAxis::new("Current", DisplayUnit::AMPERE), vec![current])
/// };
/// let chart = Chart {
///     bands: vec![Band::new(BandClass::Accelerating, 0.0, 0.1)],
///     ..Chart::new("A line", ChartAxis::new("Time", DisplayUnit::SECOND), vec![deviation, current])
/// };
/// let section = Section { charts: vec![chart], ..Section::new("Validation") };
/// let document = Document { title: "X axis".into(), sections: vec![section], ..Document::default() };
/// let mut page = Vec::new();
/// document.write(&mut page)?;
/// assert!(String::from_utf8_lossy(&page).contains("Deviation (µm)"));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// What must be said about it; can be empty.
    pub note: String,
    /// Across, the same for all panels.
    pub x: ChartAxis,
    /// Areas below each other.
    pub panels: Vec<Panel>,
    /// Intervals of x, shaded in all panels.
    pub bands: Vec<Band>,
    /// Values of x, marked by an upright line in all panels.
    pub lines: Vec<Guide>,
}

/// One area of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Upwards.
    pub y: ChartAxis,
    /// Drawn in this order.
    pub series: Vec<ChartSeries>,
    /// Intervals of y, shaded.
    pub bands: Vec<Band>,
    /// Values of y, marked by a level line.
    pub lines: Vec<Guide>,
}

/// What stands along an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAxis {
    /// The quantity, without its unit.
    pub quantity: String,
    /// In which it is labeled; values are in SI.
    pub unit: DisplayUnit,
    /// What is shown of it.
    pub range: AxisRange,
}

/// What is shown of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisRange {
    /// All values, bands and lines.
    All,
    /// The same with zero.
    WithZero,
    /// From a value to a larger one, SI, and no more: a line is broken where it lies outside, and the
    /// chart says how many values lie above or below. A range of x is a window: what lies beside it
    /// does not count, nor for the range of y.
    Within(f64, f64),
}

/// Pairs of values that are drawn alike.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartSeries {
    /// As in the legend, where series of the same label and style stand once; empty: not in it.
    pub label: String,
    /// How they are drawn.
    pub style: SeriesStyle,
    /// x and y, SI.
    pub points: Vec<[f64; 2]>,
    /// How far the error bar of each point reaches up and down, SI; what is missing or not positive
    /// has none.
    pub errors: Vec<f64>,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesStyle {
    /// A pale, broad line: what was asked for.
    Commanded,
    /// The first of the lines.
    Measured,
    /// The second, dashed: what a model says.
    Simulated,
    /// One of six lines that differ in color and dash, by its number; measured and simulated are the
    /// first two of them.
    Line(usize),
    /// A staircase in one of the six styles: each value holds until the next x.
    Steps(usize),
    /// Points of a group, by its number: color and shape differ. Thousands are drawn small.
    Points(usize),
}

/// A shaded interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// How it is drawn.
    pub class: BandClass,
    /// As in the legend, where bands of the same label and class stand once; empty: not in it.
    pub label: String,
    /// Where it begins, SI; can be infinite.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
}

/// What a shaded interval is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BandClass {
    /// The axis stands still.
    Static,
    /// It moves at constant velocity.
    ConstantVelocity,
    /// It accelerates or brakes.
    Accelerating,
    /// Values that are accepted, or the spread of values.
    Interval,
}

/// A value that is marked by a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// SI.
    pub at: f64,
    /// What stands at the line; can be empty.
    pub label: String,
}

impl Chart {
    /// A chart of series only.
    pub fn new(title: impl Into<String>, x: ChartAxis, panels: Vec<Panel>) -> Self {
        let title = title.into();
        Chart { title, note: String::new(), x, panels, bands: Vec::new(), lines: Vec::new() }
    }
}

impl Panel {
    /// A panel of series only.
    pub fn new(y: ChartAxis, series: Vec<ChartSeries>) -> Self {
        Panel { y, series, bands: Vec::new(), lines: Vec::new() }
    }
}

impl ChartAxis {
    /// An axis that shows all values.
    pub fn new(quantity: impl Into<String>, unit: DisplayUnit) -> Self {
        ChartAxis { quantity: quantity.into(), unit, range: AxisRange::All }
    }

    /// The same with zero in its range.
    pub fn with_zero(self) -> Self {
        ChartAxis { range: AxisRange::WithZero, ..self }
    }

    /// The same with no more than from one value to another, SI.
    pub fn within(self, from: f64, to: f64) -> Self {
        ChartAxis { range: AxisRange::Within(from, to), ..self }
    }
}

impl ChartSeries {
    /// A series without error bars; x and y of each point, SI.
    pub fn new(label: impl Into<String>, style: SeriesStyle, points: Vec<[f64; 2]>) -> Self {
        ChartSeries { label: label.into(), style, points, errors: Vec::new() }
    }

    /// The same from two lists; what one has more than the other is left out.
    pub fn from_xy(label: impl Into<String>, style: SeriesStyle, x: &[f64], y: &[f64]) -> Self {
        ChartSeries::new(label, style, x.iter().zip(y).map(|(&x, &y)| [x, y]).collect())
    }

    /// With how far the error bar of each point reaches up and down, SI.
    pub fn with_errors(self, errors: Vec<f64>) -> Self {
        ChartSeries { errors, ..self }
    }
}

impl SeriesStyle {
    /// As in the page's style.
    pub(super) fn class(self) -> String {
        let number = self.number();
        match self {
            SeriesStyle::Commanded => "setpoint".to_owned(),
            SeriesStyle::Points(_) => format!("points {} {}", Mark::of(number).name(), run_class(number)),
            _ => format!("line {}", run_class(number)),
        }
    }

    /// Of its error bars.
    pub(super) fn error_class(self) -> String {
        format!("error {}", run_class(self.number()))
    }

    /// Its place among the styles.
    fn number(self) -> usize {
        match self {
            SeriesStyle::Commanded | SeriesStyle::Measured => 0,
            SeriesStyle::Simulated => 1,
            SeriesStyle::Line(number) | SeriesStyle::Steps(number) | SeriesStyle::Points(number) => number,
        }
    }

    /// Whether it is no line.
    pub(super) fn is_points(self) -> bool {
        matches!(self, SeriesStyle::Points(_))
    }
}

impl Band {
    /// A band under the name of its class.
    pub fn new(class: BandClass, from: f64, to: f64) -> Self {
        let label = match class {
            BandClass::Static => "static",
            BandClass::ConstantVelocity => "constant velocity",
            BandClass::Accelerating => "accelerating",
            BandClass::Interval => "interval",
        };
        Band { class, label: label.to_owned(), from, to }
    }

    /// An interval under a name of its own.
    pub fn interval(label: impl Into<String>, from: f64, to: f64) -> Self {
        Band { class: BandClass::Interval, label: label.into(), from, to }
    }
}

impl BandClass {
    /// As in the page's style.
    pub(super) fn name(self) -> &'static str {
        match self {
            BandClass::Static => "static",
            BandClass::ConstantVelocity => "constant",
            BandClass::Accelerating => "accelerating",
            BandClass::Interval => "interval",
        }
    }
}

impl Guide {
    /// A marked value, SI.
    pub fn new(at: f64, label: impl Into<String>) -> Self {
        Guide { at, label: label.into() }
    }
}
