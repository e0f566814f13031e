//! HTML report pages with tables and plots of simulated runs and of identifications.
//!
//! [`Report`] compares one or several runs ([`runs::SimulationPage`] fills it), [`IdentificationPage`] documents the identification of an axis,
//! and [`Document`] is a page of any text, tables and [`Chart`]s. A page is one self-contained file: it
//! includes its style sheet, its data as JSON and plotly.js, which plots them (`page.js`), and loads nothing. Colors
//! follow the light, dark or print theme; lines differ by dash pattern as well. Equal input gives equal bytes.
//! Signals are decimated and keep their peaks, so that a page has at most 8 MB at any run length.
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
mod decimate;
mod document;
mod extent;
mod figure_json;
mod html;
pub mod identification;
pub mod limit_audit;
mod report;
pub mod runs;
mod table;
mod text;
mod tool_path;
mod unit;

pub use axes::ReportRun;
pub use chart::{
    AxisRange, Band, BandClass, Chart, ChartAxis, ChartForm, ChartSeries, Guide, Panel, SeriesStyle,
};
pub use document::{Document, Notice, NoticeLevel, Section};
pub use identification::{IdentificationPage, identification_document};
pub use report::Report;
pub use table::{Table, TableColumn};
pub use tool_path::{RunPath, ToolPath};
pub use unit::DisplayUnit;
