//! A page of runs while it is written: facts and figures of the runs, and captions that name a run.

use super::html::{Html, run_class, swatch};
use super::report::ReportRun;
use super::table::{fact, names};
use super::text::Text;

/// A page of runs while it is written.
#[derive(Debug)]
pub(super) struct Page<'a> {
    pub runs: &'a [ReportRun<'a>],
    pub html: Html,
}

impl Page<'_> {
    /// Returns true if the page has several runs, whose plots are captioned with the run.
    pub(super) fn is_comparison(&self) -> bool {
        self.runs.len() > 1
    }

    /// Returns a caption such as "X axis: current", with the title of the run if there are several runs.
    pub(super) fn caption_for_run(&self, caption: &str, run: usize) -> String {
        match self.runs.get(run) {
            Some(one) if self.is_comparison() => format!("{caption}, {}", one.title),
            _ => caption.to_owned(),
        }
    }

    /// Writes the table of machine, controller and changed parameters of each run.
    pub(super) fn facts(&mut self) {
        let runs = self.runs;
        let heads: Vec<String> = (0..runs.len()).map(|run| self.head(run)).collect();
        let rows: Vec<_> = names(runs.iter().flat_map(|run| &run.facts))
            .into_iter()
            .map(|name| (name, runs.iter().map(|run| fact(&run.facts, name)).collect()))
            .collect();
        self.html.open_section("facts", "Runs");
        self.html.facts(&heads, &rows);
        self.html.close_section();
    }

    /// Returns the title of a run as HTML, with a sample of its line if there are several runs.
    fn head(&self, run: usize) -> String {
        let line =
            if self.is_comparison() { swatch(&format!("line {}", run_class(run))) } else { String::new() };
        format!("{line}{}", Text(self.runs.get(run).map_or("", |run| run.title)))
    }
}
