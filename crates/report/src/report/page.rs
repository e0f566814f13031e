//! The page of runs: what was run, figures, plots.

use super::html::{Html, run_class, swatch};
use super::table::{RunTable, are_comparable, fact, names};
use super::text::Text;
use super::{Report, ReportRun, Scatter, axes, scatter, tool};

/// A page of runs that is being written.
#[derive(Debug)]
pub(super) struct Page<'a> {
    pub runs: &'a [ReportRun<'a>],
    pub html: Html,
}

/// The whole page.
pub(super) fn page(report: &Report, scatters: &[Scatter]) -> String {
    let mut page = Page { runs: &report.runs, html: Html::begin(report.title, report.description) };
    page.facts();
    page.tables();
    scatter::section(&mut page.html, scatters);
    tool::sections(&mut page);
    axes::sections(&mut page);
    page.html.end()
}

impl Page<'_> {
    /// Whether runs must be told apart.
    pub(super) fn is_comparison(&self) -> bool {
        self.runs.len() > 1
    }

    /// "X axis: current", with the run's title where there are several.
    pub(super) fn of_run(&self, what: &str, run: usize) -> String {
        match self.runs.get(run) {
            Some(one) if self.is_comparison() => format!("{what}, {}", one.title),
            _ => what.to_owned(),
        }
    }

    /// What each run was.
    fn facts(&mut self) {
        let runs = self.runs;
        let heads: Vec<String> = (0..runs.len()).map(|run| self.head(run)).collect();
        let rows: Vec<_> = names(runs.iter().flat_map(|run| &run.facts))
            .into_iter()
            .map(|name| (name, runs.iter().map(|run| fact(&run.facts, name)).collect()))
            .collect();
        self.html.open_section("facts", "What was run");
        self.html.facts(&heads, &rows);
        self.html.close_section();
    }

    /// A run's title, with a piece of its line where there are several.
    fn head(&self, run: usize) -> String {
        let line =
            if self.is_comparison() { swatch(&format!("line {}", run_class(run))) } else { String::new() };
        format!("{line}{}", Text(self.runs.get(run).map_or("", |run| run.title)))
    }

    /// The figures: row by row where the runs have the same rows, else one table after the other.
    fn tables(&mut self) {
        let runs = self.runs;
        let most = runs.iter().map(|run| run.tables.len()).max().unwrap_or(0);
        if most == 0 {
            return;
        }
        self.html.open_section("figures", "Figures");
        for place in 0..most {
            let tables: Vec<RunTable> = runs
                .iter()
                .enumerate()
                .filter_map(|(i, run)| Some((i, run.tables.get(place)?)))
                .map(|(i, table)| RunTable { run: self.is_comparison().then(|| self.head(i)), table })
                .collect();
            if tables.windows(2).all(|pair| are_comparable(pair[0].table, pair[1].table)) {
                self.html.table(&tables);
            } else {
                tables.chunks(1).for_each(|one| self.html.table(one));
            }
        }
        self.html.close_section();
    }
}
