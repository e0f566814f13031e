//! Layout of a report page: facts, figures, search, tool and axes.

use std::io;

use super::html::Html;
use super::page::Page;
use super::report::Report;
use super::scatter::Scatter;
use super::{axes, scatter, tool};

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
        page.facts();
        page.tables();
        scatter::section(&mut page.html, scatters);
        tool::sections(&mut page);
        axes::sections(&mut page);
        page.html.end()
    }
}
