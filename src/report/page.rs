//! The page: head, facts, tables, and the frame around the plots.

use std::fmt::Write as _;

use super::text::{Text, cell, is_number};
use super::{Report, ReportRun, Scatter, Table, axes, scatter, tool};

/// Colours for light, dark and paper, and the layout.
const STYLE: &str = include_str!("style.css");
/// Nothing is loaded and no script runs, whatever text a run brings along.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'";
/// Styles of runs that the page has.
const RUN_STYLES: usize = 6;

/// A page that is being written.
#[derive(Debug)]
pub(super) struct Page<'a> {
    pub runs: &'a [ReportRun<'a>],
    html: String,
    pictures: usize,
}

/// What stands above a picture.
#[derive(Debug, Default)]
pub(super) struct Caption {
    /// What is shown.
    pub title: String,
    /// What must be said about it.
    pub note: String,
    /// Style and meaning of its lines.
    pub legend: Vec<(String, String)>,
}

/// Style of a run's lines.
pub(super) fn run_class(run: usize) -> String {
    format!("run-{}", run % RUN_STYLES + 1)
}

/// Appends to the page; writing to a text cannot fail.
macro_rules! put {
    ($page:expr, $($argument:tt)*) => {{
        let _ = write!($page.html, $($argument)*);
    }};
}

/// The whole page.
pub(super) fn page(report: &Report, scatters: &[Scatter]) -> String {
    let mut page = Page { runs: &report.runs, html: String::new(), pictures: 0 };
    let title = Text(report.title);
    put!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<h1>{title}</h1>\n"
    );
    if !report.description.is_empty() {
        put!(page, "<p class=\"description\">{}</p>\n", Text(report.description));
    }
    put!(page, "</header>\n");
    page.facts();
    page.tables();
    scatter::section(&mut page, scatters);
    tool::sections(&mut page);
    axes::sections(&mut page);
    put!(
        page,
        "</main>\n<footer>{} {}</footer>\n</body>\n</html>\n",
        env!("CARGO_PKG_NAME"),
        env!("CARGO_PKG_VERSION")
    );
    page.html
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

    /// Begins a section.
    pub(super) fn open_section(&mut self, class: &str, heading: &str) {
        put!(self, "<section class=\"{class}\">\n<h2>{}</h2>\n", Text(heading));
    }

    /// Ends it.
    pub(super) fn close_section(&mut self) {
        put!(self, "</section>\n");
    }

    /// A paragraph.
    pub(super) fn paragraph(&mut self, text: &str) {
        put!(self, "<p>{}</p>\n", Text(text));
    }

    /// Begins a row of `count` pictures side by side.
    pub(super) fn open_row(&mut self, count: usize) {
        // Four are better legible as two by two.
        let columns = match count {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        };
        put!(self, "<div class=\"row of-{columns}\">\n");
    }

    /// Ends it.
    pub(super) fn close_row(&mut self) {
        put!(self, "</div>\n");
    }

    /// A picture that `draw` makes from an id and a title.
    pub(super) fn figure(
        &mut self,
        class: &str,
        caption: &Caption,
        title: &str,
        draw: impl FnOnce(&str, &str) -> String,
    ) {
        self.pictures += 1;
        put!(
            self,
            "<figure class=\"{class}\">\n<figcaption><span class=\"title\">{}</span>",
            Text(&caption.title)
        );
        if !caption.note.is_empty() {
            put!(self, " <span class=\"note\">{}</span>", Text(&caption.note));
        }
        if !caption.legend.is_empty() {
            put!(self, " <span class=\"legend\">");
            for (class, label) in &caption.legend {
                put!(self, "<span class=\"key\">{}{}</span> ", swatch(class), Text(label));
            }
            put!(self, "</span>");
        }
        let picture = draw(&format!("p{}", self.pictures), title);
        put!(self, "</figcaption>\n<div class=\"picture\">{picture}</div>\n</figure>\n");
    }

    /// What each run was; what is the same in all stands once.
    fn facts(&mut self) {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in self.runs.iter().flat_map(|run| &run.facts) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        put!(
            self,
            "<section class=\"facts\">\n<h2>What was run</h2>\n<div class=\"table\"><table>\n<thead><tr><td></td>"
        );
        for (i, run) in self.runs.iter().enumerate() {
            put!(self, "<th scope=\"col\">{}{}</th>", self.run_swatch(i), Text(run.title));
        }
        put!(self, "</tr></thead>\n<tbody>\n");
        for name in names {
            let values: Vec<String> = self.runs.iter().map(|run| fact(run, name)).collect();
            put!(self, "<tr><th scope=\"row\">{}</th>", Text(name));
            match values.split_first() {
                Some((first, rest)) if rest.iter().all(|value| value == first) => {
                    put!(self, "<td class=\"same\" colspan=\"{}\">{}</td>", values.len(), Text(first));
                }
                _ => values.iter().for_each(|value| put!(self, "<td>{}</td>", Text(value))),
            }
            put!(self, "</tr>\n");
        }
        put!(self, "</tbody>\n</table></div>\n</section>\n");
    }

    fn run_swatch(&self, run: usize) -> String {
        if self.is_comparison() { swatch(&format!("line {}", run_class(run))) } else { String::new() }
    }

    /// The figures: row by row where the runs have the same rows, else one table after the other.
    fn tables(&mut self) {
        let runs = self.runs;
        let most = runs.iter().map(|run| run.tables.len()).max().unwrap_or(0);
        if most == 0 {
            return;
        }
        self.open_section("figures", "Figures");
        for place in 0..most {
            let tables: Vec<(usize, &Table)> =
                runs.iter().enumerate().filter_map(|(i, run)| Some((i, run.tables.get(place)?))).collect();
            if tables.windows(2).all(|pair| are_comparable(pair[0].1, pair[1].1)) {
                self.table(&tables);
            } else {
                tables.iter().for_each(|one| self.table(&[*one]));
            }
        }
        self.close_section();
    }

    /// One table; the rows of several runs stand below each other.
    fn table(&mut self, tables: &[(usize, &Table)]) {
        let Some((_, first)) = tables.first().filter(|(_, table)| !table.rows.is_empty()) else { return };
        put!(self, "<div class=\"table\"><table>\n<caption>{}</caption>\n<thead><tr>", Text(&first.caption));
        let name_runs = self.is_comparison();
        for (i, column) in first.columns.iter().enumerate() {
            let class = if i > 0 && is_numeric(tables, i) { " class=\"number\"" } else { "" };
            put!(self, "<th scope=\"col\"{class}>{}", Text(&column.name));
            if !column.unit.is_empty() {
                put!(self, " <span class=\"unit\">{}</span>", Text(&column.unit));
            }
            put!(self, "</th>");
            if i == 0 && name_runs {
                put!(self, "<th scope=\"col\">run</th>");
            }
        }
        put!(self, "</tr></thead>\n");
        for (r, row) in first.rows.iter().enumerate() {
            put!(self, "<tbody>\n");
            for (n, (run, table)) in tables.iter().enumerate() {
                put!(self, "<tr>");
                if n == 0 {
                    let head = row.first().map_or("", String::as_str);
                    put!(self, "<th scope=\"rowgroup\" rowspan=\"{}\">{}</th>", tables.len(), Text(head));
                }
                if name_runs {
                    let title = self.runs.get(*run).map_or("", |run| run.title);
                    put!(
                        self,
                        "<th scope=\"row\" class=\"run\">{}{}</th>",
                        self.run_swatch(*run),
                        Text(title)
                    );
                }
                for i in 1..first.columns.len() {
                    let text = table.rows.get(r).and_then(|row| row.get(i)).map_or("", String::as_str);
                    let class = if is_numeric(tables, i) { " class=\"number\"" } else { "" };
                    put!(self, "<td{class}>{}</td>", Text(&cell(text)));
                }
                put!(self, "</tr>\n");
            }
            put!(self, "</tbody>\n");
        }
        put!(self, "</table></div>\n");
    }
}

/// A piece of a line, as in the picture.
fn swatch(class: &str) -> String {
    let shape = match class {
        "start" => "<circle class=\"start\" cx=\"17\" cy=\"6\" r=\"4\"/>".to_owned(),
        point if point == "dot" || point.starts_with("mark ") => {
            format!("<circle class=\"{point}\" cx=\"17\" cy=\"6\" r=\"4\"/>")
        }
        line => format!("<path class=\"{line}\" d=\"M1 6h32\"/>"),
    };
    format!("<svg class=\"swatch\" viewBox=\"0 0 34 12\" aria-hidden=\"true\">{shape}</svg>")
}

/// Every value that a run gives under a name.
fn fact(run: &ReportRun, name: &str) -> String {
    let values = run.facts.iter().filter(|(n, _)| n == name).map(|(_, value)| value.as_str());
    values.collect::<Vec<_>>().join(", ")
}

/// Whether two tables have the same columns and the same heads of rows.
fn are_comparable(a: &Table, b: &Table) -> bool {
    a.columns == b.columns
        && a.rows.len() == b.rows.len()
        && a.rows.iter().zip(&b.rows).all(|(a, b)| a.first() == b.first())
}

/// Whether a column holds numbers, and nothing but a dash or nothing where there is none.
fn is_numeric(tables: &[(usize, &Table)], column: usize) -> bool {
    let mut cells = tables.iter().flat_map(|(_, t)| &t.rows).filter_map(|row| row.get(column));
    cells.all(|cell| is_number(cell) || matches!(cell.trim(), "" | "-" | "–" | "—"))
}
