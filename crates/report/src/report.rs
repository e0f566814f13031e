//! Contents of a report that compares runs.

use virtual_axes_core::assess::SignalRecording;

use super::document::Section;
use super::table::Table;

/// Contents of a page with tables and plots of one or several runs.
#[derive(Debug, Clone, Default)]
pub struct Report<'a> {
    /// Heading, and title of the browser window.
    pub title: &'a str,
    /// Description of the trial in one or two sentences; can be empty.
    pub description: &'a str,
    /// Result in one line per compared run; can be empty.
    pub verdict: Vec<String>,
    /// Tables of figures, with a column per run where runs are compared.
    pub tables: Vec<Table>,
    /// Remarks below the tables, such as the sampling of the figures.
    pub notes: Vec<String>,
    /// Sections below the figures, such as that of a part program.
    pub sections: Vec<Section>,
    /// Runs to compare. Line styles repeat after six runs.
    pub runs: Vec<ReportRun<'a>>,
    /// Names and values that allow the runs to be repeated: date, version, command line, digest of the machine file.
    pub provenance: Vec<(String, String)>,
}

/// One run of a report.
#[derive(Debug, Clone)]
pub struct ReportRun<'a> {
    /// Name that distinguishes the run from the others, for example its controller.
    pub title: &'a str,
    /// Names and values: machine, controller, changed parameters. Values with equal names share a row.
    pub facts: Vec<(String, String)>,
    /// Signals to plot.
    pub recording: &'a SignalRecording,
}
