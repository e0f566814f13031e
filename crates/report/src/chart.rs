//! Contents of a chart: pairs of values in one or several panels with a common x axis.

use super::unit::DisplayUnit;

/// A plot of pairs of values on linear or logarithmic axes.
///
/// Values are in SI units and are labeled in the unit of their axis; a [`DisplayUnit`] of size 1 shows them
/// unchanged. Values that are not finite, or beyond ±1e12 of the unit, are omitted and break a line. Long
/// series are decimated; peaks are kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title above the plot.
    pub title: String,
    /// Remark behind the title; can be empty.
    pub note: String,
    /// Horizontal axis, common to all panels.
    pub x: ChartAxis,
    /// Panels from top to bottom.
    pub panels: Vec<Panel>,
    /// Intervals of x that are shaded in all panels.
    pub bands: Vec<Band>,
    /// Values of x that are marked by a vertical line in all panels.
    pub lines: Vec<Guide>,
    /// Meaning of x.
    pub form: ChartForm,
}

/// Meaning of x of a chart.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum ChartForm {
    /// Any quantity; the chart zooms by itself.
    #[default]
    Plain,
    /// Time of the runs of the page: all charts over it zoom together, and can be plotted over the path.
    RunTime,
    /// Polar angle about the center of a circle, from the first named axis to the second; y is the radial deviation.
    Circle([String; 2]),
}

/// One panel of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Vertical axis.
    pub y: ChartAxis,
    /// Series in drawing order.
    pub series: Vec<ChartSeries>,
    /// Intervals of y that are shaded.
    pub bands: Vec<Band>,
    /// Values of y that are marked by a horizontal line.
    pub lines: Vec<Guide>,
}

/// Label, unit and range of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartAxis {
    /// Quantity, without its unit.
    pub quantity: String,
    /// Unit of the tick labels; values are in SI units.
    pub unit: DisplayUnit,
    /// Range that is shown.
    pub range: AxisRange,
    /// True for a logarithmic axis, on which values of 0 and below are omitted.
    pub is_logarithmic: bool,
}

/// Range of an axis that is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisRange {
    /// Range of all values, bands and lines.
    All,
    /// Range of all values, bands and lines, extended to zero.
    WithZero,
    /// Fixed range from a value to a larger one, SI units. Lines are broken outside of it, and the chart
    /// states how many values lie above or below. Points outside a fixed range of x are ignored, also for the
    /// range of y.
    Within(f64, f64),
}

/// Pairs of values with one style.
#[derive(Debug, Clone, PartialEq)]
pub struct ChartSeries {
    /// Label in the legend. Series with equal label and style share one entry; an empty label has no entry.
    pub label: String,
    /// Drawing style.
    pub style: SeriesStyle,
    /// Values of x and y, SI units.
    pub points: Vec<[f64; 2]>,
    /// Half length of the error bar of each point, SI units. A missing or non-positive entry draws no bar.
    pub errors: Vec<f64>,
    /// Index of the run whose signal it is; the page can hide runs.
    pub run: Option<usize>,
}

/// Drawing style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesStyle {
    /// Pale, broad line for commanded values.
    Commanded,
    /// First line style.
    Measured,
    /// Second line style, dashed, for values of a model.
    Simulated,
    /// Line style by index. Six styles differ in color and dash pattern; `Measured` and `Simulated` are the
    /// first two.
    Line(usize),
    /// Step plot in a line style by index: each value is held until the next x.
    Steps(usize),
    /// Markers by index of the group, in different colors and shapes. More than 300 points have small
    /// markers.
    Points(usize),
}

/// A shaded interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Meaning of the interval, which selects its style.
    pub class: BandClass,
    /// Label in the legend. Bands with equal label and class share one entry; an empty label has no entry.
    pub label: String,
    /// Lower end, SI units; can be infinite.
    pub from: f64,
    /// Upper end, SI units; can be infinite.
    pub to: f64,
}

/// Meaning of a shaded interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BandClass {
    /// Axis at standstill.
    Static,
    /// Motion at constant velocity.
    ConstantVelocity,
    /// Acceleration or deceleration.
    Accelerating,
    /// Accepted values, or the spread of values.
    Interval,
    /// Speed, current or voltage at its limit.
    AtLimit,
}

/// A value that is marked by a line across the panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// Marked value, SI units.
    pub at: f64,
    /// Label at the line; can be empty.
    pub label: String,
}

impl Chart {
    /// Creates a chart without note, bands and lines.
    pub fn new(title: impl Into<String>, x: ChartAxis, panels: Vec<Panel>) -> Self {
        let title = title.into();
        let (bands, lines, form) = (Vec::new(), Vec::new(), ChartForm::Plain);
        Chart { title, note: String::new(), x, panels, bands, lines, form }
    }
}

impl Panel {
    /// Creates a panel without bands and lines.
    pub fn new(y: ChartAxis, series: Vec<ChartSeries>) -> Self {
        Panel { y, series, bands: Vec::new(), lines: Vec::new() }
    }
}

impl ChartAxis {
    /// Creates an axis that shows all values.
    pub fn new(quantity: impl Into<String>, unit: DisplayUnit) -> Self {
        ChartAxis { quantity: quantity.into(), unit, range: AxisRange::All, is_logarithmic: false }
    }

    /// Extends the range to zero.
    pub fn with_zero(self) -> Self {
        ChartAxis { range: AxisRange::WithZero, ..self }
    }

    /// Makes the axis logarithmic.
    pub fn logarithmic(self) -> Self {
        ChartAxis { is_logarithmic: true, ..self }
    }

    /// Fixes the range, SI units.
    pub fn within(self, from: f64, to: f64) -> Self {
        ChartAxis { range: AxisRange::Within(from, to), ..self }
    }
}

impl ChartSeries {
    /// Creates a series without error bars from x and y of each point, SI units.
    pub fn new(label: impl Into<String>, style: SeriesStyle, points: Vec<[f64; 2]>) -> Self {
        ChartSeries { label: label.into(), style, points, errors: Vec::new(), run: None }
    }

    /// Creates a series without error bars from two lists, SI units. Surplus elements of the longer list are
    /// ignored.
    pub fn from_xy(label: impl Into<String>, style: SeriesStyle, x: &[f64], y: &[f64]) -> Self {
        ChartSeries::new(label, style, x.iter().zip(y).map(|(&x, &y)| [x, y]).collect())
    }

    /// Sets the half length of the error bar of each point, SI units.
    pub fn with_errors(self, errors: Vec<f64>) -> Self {
        ChartSeries { errors, ..self }
    }

    /// Assigns the series to a run, by its index.
    pub fn of_run(self, run: usize) -> Self {
        ChartSeries { run: Some(run), ..self }
    }
}

impl SeriesStyle {
    /// Returns the name of the style, and its index among the line or marker styles.
    pub(super) fn name(self) -> (&'static str, usize) {
        match self {
            SeriesStyle::Commanded => ("commanded", 0),
            SeriesStyle::Measured => ("line", 0),
            SeriesStyle::Simulated => ("line", 1),
            SeriesStyle::Line(index) => ("line", index),
            SeriesStyle::Steps(index) => ("steps", index),
            SeriesStyle::Points(index) => ("points", index),
        }
    }
}

impl Band {
    /// Creates a band that is labeled with the name of its class.
    pub fn new(class: BandClass, from: f64, to: f64) -> Self {
        let label = match class {
            BandClass::Static => "static",
            BandClass::ConstantVelocity => "constant velocity",
            BandClass::Accelerating => "accelerating",
            BandClass::Interval => "interval",
            BandClass::AtLimit => "at a limit",
        };
        Band { class, label: label.to_owned(), from, to }
    }

    /// Creates an interval with its own label.
    pub fn interval(label: impl Into<String>, from: f64, to: f64) -> Self {
        Band { class: BandClass::Interval, label: label.into(), from, to }
    }
}

impl BandClass {
    /// Returns the name of the color in the style sheet.
    pub(super) fn name(self) -> &'static str {
        match self {
            BandClass::Static => "static",
            BandClass::ConstantVelocity => "constant",
            BandClass::Accelerating => "accelerating",
            BandClass::Interval => "interval",
            BandClass::AtLimit => "at-limit",
        }
    }
}

impl Guide {
    /// Creates a marked value, SI units.
    pub fn new(at: f64, label: impl Into<String>) -> Self {
        Guide { at, label: label.into() }
    }
}
