//! A page of text, tables and charts.

use std::io;

use super::chart::Chart;
use super::html::Html;
use super::table::{Table, fact, names};
use super::text::Text;

/// A self-contained page of sections, in the style of a [`Report`](super::Report).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Document {
    /// Heading, and title of the browser window.
    pub title: String,
    /// Description in one or two sentences; can be empty.
    pub description: String,
    /// Names and values. Values with equal names share a row.
    pub facts: Vec<(String, String)>,
    /// Sections in their order on the page.
    pub sections: Vec<Section>,
}

/// A part of a page. Its contents are in the order of the fields; each list can be empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    /// Heading.
    pub heading: String,
    /// Paragraphs of plain text.
    pub paragraphs: Vec<String>,
    /// Highlighted notices.
    pub notices: Vec<Notice>,
    /// Tables.
    pub tables: Vec<Table>,
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
        if !self.facts.is_empty() {
            let rows: Vec<_> =
                names(&self.facts).into_iter().map(|name| (name, vec![fact(&self.facts, name)])).collect();
            html.append(format_args!("<section class=\"facts\">\n"));
            html.facts(&[], &rows);
            html.close_section();
        }
        self.sections.iter().for_each(|section| section.append_to(&mut html));
        html.end()
    }
}

impl Section {
    /// Creates an empty section.
    pub fn new(heading: impl Into<String>) -> Self {
        Section { heading: heading.into(), ..Section::default() }
    }

    pub(super) fn append_to(&self, html: &mut Html) {
        html.open_section("part figures", &self.heading);
        self.paragraphs.iter().for_each(|text| html.paragraph(text));
        for Notice { level, text } in &self.notices {
            let (class, word) = level.style();
            html.append(format_args!(
                "<p class=\"notice {class}\"><strong>{word}</strong> {}</p>\n",
                Text(text)
            ));
        }
        self.tables.iter().for_each(|table| html.table(table));
        self.charts.iter().for_each(|chart| chart.append_to(html));
        html.close_section();
    }
}
