//! HTML report pages with tables and plots of simulated runs and of identifications.
//!
//! [`Report`] compares one or several runs ([`runs::SimulationPage`] fills it), [`IdentificationPage`] documents the identification of an axis,
//! and [`Document`] is a page of any text, tables and [`Chart`]s. A page is one self-contained file: it
//! includes its style sheet and its plots (SVG), has no script, and loads nothing. Colors follow the light,
//! dark or print theme; lines differ by dash pattern as well. Equal input gives equal bytes. Signals are
//! decimated to the resolution of the plot and keep their peaks, so that the size of a page is independent of
//! the run length.
//!
//! ```
//! use virtual_axes_report::{Chart, ChartAxis, ChartSeries, DisplayUnit, Document, Panel, Section, SeriesStyle};
//!
//! let time = [0.0, 0.1, 0.2, 0.3];
//! let current = ChartSeries::from_xy("measured", SeriesStyle::Measured, &time, &[0.0, 4.0, 1.5, 1.5]);
//! let panel = Panel::new(ChartAxis::new("Current", DisplayUnit::AMPERE), vec![current]);
//! let chart = Chart::new("A move of X", ChartAxis::new("Time", DisplayUnit::SECOND), vec![panel]);
//! let section = Section { charts: vec![chart], ..Section::new("Validation") };
//! let document = Document { title: "X axis".into(), sections: vec![section], ..Document::default() };
//!
//! let mut page = Vec::new();
//! document.write(&mut page)?;
//! assert!(String::from_utf8_lossy(&page).contains("Current (A)"));
//! # Ok::<(), std::io::Error>(())
//! ```

#![forbid(unsafe_code)]
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used))]

mod axes;
mod chart;
mod chart_draw;
mod decimate;
mod document;
mod html;
mod identification;
mod limits;
mod markers;
mod page;
mod path_plot;
mod plot_area;
mod polar;
mod report;
mod report_page;
pub mod runs;
mod scale;
mod scatter;
mod shade;
mod strip;
mod svg;
mod table;
mod text;
mod time_plot;
mod tool;
mod unit;

pub use chart::{AxisRange, Band, BandClass, Chart, ChartAxis, ChartSeries, Guide, Panel, SeriesStyle};
pub use document::{Document, Notice, NoticeLevel, Section};
pub use identification::{IdentificationPage, ValidationRecording};
pub use report::{Report, ReportRun};
pub use scatter::{PointGroup, PointStyle, Scatter};
pub use table::{Table, TableColumn};
pub use unit::DisplayUnit;
