//! A report: one self-contained HTML page with tables and plots of one or several runs.
//!
//! The page holds its style and its pictures (SVG), no script, and loads nothing from elsewhere.
//! Colors are the style's, for light and dark screens and for paper; lines differ by dash as well.
//! The same input gives the same bytes. Signals are thinned to what can be seen, peaks kept, so that
//! the size of the page does not grow with the length of a run.

mod axes;
mod chart;
mod chart_draw;
mod document;
mod frame;
mod html;
mod identification;
mod marks;
mod page;
mod path_plot;
mod polar;
mod scale;
mod scatter;
mod shade;
mod strip;
mod svg;
mod table;
mod text;
mod thin;
mod time_plot;
mod tool;
mod unit;

use std::io;

use virtual_axes_core::assess::Recording;

pub use chart::{AxisRange, Band, BandClass, Chart, ChartAxis, Guide, Panel, Series, SeriesStyle};
pub use document::{Document, Notice, NoticeLevel, Section};
pub use identification::{IdentificationCheck, IdentificationPage};
pub use scatter::{PointGroup, PointStyle, Scatter};
pub use table::{Column, Table};
pub use unit::Unit;

/// What a page shows.
#[derive(Debug, Clone)]
pub struct Report<'a> {
    /// Heading, and title of the window.
    pub title: &'a str,
    /// What was run, in a sentence or two; can be empty.
    pub description: &'a str,
    /// Compared with each other where there are several; lines of more than six runs repeat styles.
    pub runs: Vec<ReportRun<'a>>,
}

/// One run of a report.
#[derive(Debug, Clone)]
pub struct ReportRun<'a> {
    /// What tells it from the others: the controller, say.
    pub title: &'a str,
    /// Name and value: machine, controller, changed parameters; values under one name stand together.
    pub facts: Vec<(String, String)>,
    /// Figures, as on the terminal. Runs whose tables have the same columns and first cells are
    /// compared row by row.
    pub tables: Vec<Table>,
    /// Signals to plot.
    pub recording: &'a Recording,
}

impl Report<'_> {
    /// Writes the page, UTF-8.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        self.write_with(&[], out)
    }

    /// Writes the page with pictures of a search, whose marks are those of the runs.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write_with(&self, scatters: &[Scatter], out: &mut impl io::Write) -> io::Result<()> {
        out.write_all(page::page(self, scatters).as_bytes())
    }
}
