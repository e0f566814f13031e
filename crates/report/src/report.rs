//! Contents of a report that compares runs.

use virtual_axes_core::assess::SignalRecording;

use super::table::Table;

/// Contents of a page with tables and plots of one or several runs.
#[derive(Debug, Clone)]
pub struct Report<'a> {
    /// Heading, and title of the browser window.
    pub title: &'a str,
    /// Description of the trial in one or two sentences; can be empty.
    pub description: &'a str,
    /// Runs to compare. Line styles repeat after six runs.
    pub runs: Vec<ReportRun<'a>>,
}

/// One run of a report.
#[derive(Debug, Clone)]
pub struct ReportRun<'a> {
    /// Name that distinguishes the run from the others, for example its controller.
    pub title: &'a str,
    /// Names and values: machine, controller, changed parameters. Values with equal names share a row.
    pub facts: Vec<(String, String)>,
    /// Tables of figures. Tables with equal columns and equal first cells are compared row by row.
    pub tables: Vec<Table>,
    /// Signals to plot.
    pub recording: &'a SignalRecording,
}
