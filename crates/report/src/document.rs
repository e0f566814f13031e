//! A page of text, tables and charts.

use std::io;

use super::chart::Chart;
use super::decimate;
use super::html::Html;
use super::table::Table;
use super::text::{Text, prose};
use super::tool_path::RunPath;

/// Largest number of points in the charts of a page, so that a page has at most 8 MB.
const MOST_POINTS: usize = 140_000;

/// A self-contained page of sections.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Document {
    /// Heading, and title of the browser window.
    pub title: String,
    /// Description in one or two sentences; can be empty.
    pub description: String,
    /// Result in a few lines; can be empty.
    pub verdict: Vec<String>,
    /// Titles of the runs whose signals the page can hide.
    pub runs: Vec<String>,
    /// Names and values. Values with equal names share a row.
    pub facts: Vec<(String, String)>,
    /// Sections in their order on the page.
    pub sections: Vec<Section>,
}

/// A part of a page. Its contents are in the order of the fields; each list can be empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    /// Heading; can be empty.
    pub heading: String,
    /// Paragraphs of plain text.
    pub paragraphs: Vec<String>,
    /// Highlighted notices.
    pub notices: Vec<Notice>,
    /// Tables.
    pub tables: Vec<Table>,
    /// Tool paths of runs, in one figure beside text and tables.
    pub paths: Vec<RunPath>,
    /// Charts.
    pub charts: Vec<Chart>,
}

/// A highlighted remark.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// Severity.
    pub level: NoticeLevel,
    /// Text of the notice.
    pub text: String,
}

/// Severity of a notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoticeLevel {
    /// Information.
    Note,
    /// Result with reduced accuracy.
    Warning,
    /// Missing result.
    Missing,
}

impl NoticeLevel {
    /// Returns the CSS class and the word in front of the text, which distinguishes the levels without color.
    fn style(self) -> (&'static str, &'static str) {
        match self {
            NoticeLevel::Note => ("note", "Note"),
            NoticeLevel::Warning => ("warning", "Warning"),
            NoticeLevel::Missing => ("missing", "Missing"),
        }
    }
}

impl Notice {
    /// Creates a notice.
    pub fn new(level: NoticeLevel, text: impl Into<String>) -> Self {
        Notice { level, text: text.into() }
    }
}

impl Document {
    /// Writes the page in UTF-8. Equal documents give equal bytes.
    ///
    /// # Errors
    ///
    /// Returns the error of `out` if it cannot be written.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        out.write_all(self.page().as_bytes())
    }

    fn page(&self) -> String {
        let mut html = Html::begin(&self.title, &self.description);
        html.verdict(&self.verdict);
        html.switches(&self.runs.iter().map(String::as_str).collect::<Vec<_>>());
        html.table(&Table::of_facts(&[], &[&self.facts]));
        let most = decimate::limit(self.sections.iter().flat_map(|section| &section.charts), MOST_POINTS);
        self.sections.iter().for_each(|section| section.append_to(&mut html, most));
        html.end()
    }
}

impl Section {
    /// Creates an empty section.
    pub fn new(heading: impl Into<String>) -> Self {
        Section { heading: heading.into(), ..Section::default() }
    }

    /// Returns true if nothing stands below the heading.
    pub(super) fn is_empty(&self) -> bool {
        let Section { heading: _, paragraphs, notices, tables, paths, charts } = self;
        let has_text = !paragraphs.is_empty() || !notices.is_empty();
        !has_text && tables.iter().all(|table| table.rows.is_empty()) && paths.is_empty() && charts.is_empty()
    }

    fn append_to(&self, html: &mut Html, most: usize) {
        let class = if self.paths.is_empty() { "" } else { " class=\"overview\"" };
        html.append(format_args!("<section{class}>\n"));
        if !self.heading.is_empty() {
            html.append(format_args!("<h2>{}</h2>\n", Text(&self.heading)));
        }
        let has_text = !self.paragraphs.is_empty() || !self.notices.is_empty() || !self.tables.is_empty();
        if has_text {
            html.append(format_args!("<div>\n"));
        }
        self.paragraphs.iter().for_each(|text| html.paragraph(text));
        for Notice { level, text } in &self.notices {
            let (class, word) = level.style();
            html.append(format_args!(
                "<p class=\"notice {class}\"><strong>{word}</strong> {}</p>\n",
                prose(text)
            ));
        }
        self.tables.iter().for_each(|table| html.table(table));
        if has_text {
            html.append(format_args!("</div>\n"));
        }
        html.path(&self.paths);
        self.charts.iter().for_each(|chart| html.chart(chart, most));
        html.append(format_args!("</section>\n"));
    }
}
