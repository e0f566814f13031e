//! Layout of a report page: limits, search, tool, figures, axes, runs and provenance.

use std::io;

use super::html::Html;
use super::page::Page;
use super::report::Report;
use super::scatter::Scatter;
use super::{axes, limits, scatter, tool};

impl Report<'_> {
    /// Writes the page in UTF-8.
    ///
    /// # Errors
    ///
    /// Returns the error of `out` if it cannot be written.
    pub fn write(&self, out: &mut impl io::Write) -> io::Result<()> {
        self.write_with(&[], out)
    }

    /// Writes the page in UTF-8, with scatter plots of a search whose markers refer to the runs.
    ///
    /// # Errors
    ///
    /// Returns the error of `out` if it cannot be written.
    pub fn write_with(&self, scatters: &[Scatter], out: &mut impl io::Write) -> io::Result<()> {
        out.write_all(self.page(scatters).as_bytes())
    }

    fn page(&self, scatters: &[Scatter]) -> String {
        let mut page = Page { runs: &self.runs, html: Html::begin(self.title, self.description) };
        page.html.verdict(&self.verdict);
        limits::section(&mut page);
        scatter::section(&mut page.html, scatters);
        tool::sections(&mut page);
        self.figures(&mut page.html);
        self.sections.iter().for_each(|section| section.append_to(&mut page.html));
        axes::sections(&mut page);
        page.facts();
        if !self.provenance.is_empty() {
            let rows: Vec<_> =
                self.provenance.iter().map(|(name, value)| (name.as_str(), vec![value.clone()])).collect();
            page.html.open_section("facts", "Provenance");
            page.html.facts(&[], &rows);
            page.html.close_section();
        }
        page.html.end()
    }

    fn figures(&self, html: &mut Html) {
        if self.tables.iter().all(|table| table.rows.is_empty()) {
            return;
        }
        html.open_section("figures", "Figures");
        self.tables.iter().for_each(|table| html.table(table));
        self.notes.iter().for_each(|note| html.paragraph(note));
        html.close_section();
    }
}
