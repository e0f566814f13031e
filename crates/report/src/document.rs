//! A page of text, tables and charts, of no run in particular.

use std::io;

use super::chart::Chart;
use super::html::Html;
use super::table::{RunTable, Table, fact, names};
use super::text::Text;

/// A page of sections, as self-contained as a [`Report`](super::Report) and in the same style.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Document {
    /// Heading, and title of the window.
    pub title: String,
    /// What it is about, in a sentence or two; can be empty.
    pub description: String,
    /// Name and value; values under one name stand together.
    pub facts: Vec<(String, String)>,
    /// In this order.
    pub sections: Vec<Section>,
}

/// A part of a page; its pieces stand in the order of the fields, and each list can be empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    /// What it is about.
    pub heading: String,
    /// Text.
    pub paragraphs: Vec<String>,
    /// What the reader must not miss.
    pub notices: Vec<Notice>,
    /// Figures.
    pub tables: Vec<Table>,
    /// Pictures.
    pub charts: Vec<Chart>,
}

/// Something that the reader must not miss.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// How much it matters.
    pub level: NoticeLevel,
    /// What is to be said.
    pub text: String,
}

/// How much a notice matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoticeLevel {
    /// Good to know.
    Note,
    /// A result is less certain than it could be.
    Warning,
    /// A result is not there.
    Missing,
}

impl NoticeLevel {
    /// Style, and what stands before the text, so that color is not all that tells it.
    fn style(self) -> (&'static str, &'static str) {
        match self {
            NoticeLevel::Note => ("note", "Note"),
            NoticeLevel::Warning => ("warning", "Warning"),
            NoticeLevel::Missing => ("missing", "Missing"),
        }
    }
}

impl Notice {
    /// A notice.
    pub fn new(level: NoticeLevel, text: impl Into<String>) -> Self {
        Notice { level, text: text.into() }
    }
}

impl Document {
    /// Writes the page, UTF-8; the same document gives the same bytes.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        out.write_all(self.page().as_bytes())
    }

    fn page(&self) -> String {
        let mut html = Html::begin(&self.title, &self.description);
        if !self.facts.is_empty() {
            let rows: Vec<_> =
                names(&self.facts).into_iter().map(|name| (name, vec![fact(&self.facts, name)])).collect();
            html.put(format_args!("<section class=\"facts\">\n"));
            html.facts(&[], &rows);
            html.close_section();
        }
        self.sections.iter().for_each(|section| section.put(&mut html));
        html.end()
    }
}

impl Section {
    /// A section without content yet.
    pub fn new(heading: impl Into<String>) -> Self {
        Section { heading: heading.into(), ..Section::default() }
    }

    fn put(&self, html: &mut Html) {
        html.open_section("part figures", &self.heading);
        self.paragraphs.iter().for_each(|text| html.paragraph(text));
        for Notice { level, text } in &self.notices {
            let (class, word) = level.style();
            html.put(format_args!(
                "<p class=\"notice {class}\"><strong>{word}</strong> {}</p>\n",
                Text(text)
            ));
        }
        self.tables.iter().for_each(|table| html.table(&[RunTable { run: None, table }]));
        self.charts.iter().for_each(|chart| chart.put(html));
        html.close_section();
    }
}
