//! A report: one self-contained HTML page with tables and plots of one or several runs.
//!
//! The page holds its style and its pictures (SVG), no script, and loads nothing from elsewhere.
//! Colours are the style's, for light and dark screens and for paper; lines differ by dash as well.
//! The same input gives the same bytes. Signals are thinned to what can be seen, peaks kept, so that
//! the size of the page does not grow with the length of a run.

mod axes;
mod page;
mod path_plot;
mod polar;
mod scale;
mod scatter;
mod strip;
mod svg;
mod text;
mod thin;
mod time_plot;
mod tool;

use std::io;

use crate::assess::Recording;

pub use scatter::{PointGroup, PointStyle, Scatter};

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

/// Figures of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// What the figures are of.
    pub caption: String,
    /// The first names what a row is about.
    pub columns: Vec<Column>,
    /// Cells of each row; what is missing stays empty.
    pub rows: Vec<Vec<String>>,
}

/// Head of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Column {
    /// What it holds.
    pub name: String,
    /// Unit of its numbers; can be empty.
    pub unit: String,
}

impl Column {
    /// A column of numbers in `unit`, which can be empty.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Column { name: name.into(), unit: unit.into() }
    }
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
