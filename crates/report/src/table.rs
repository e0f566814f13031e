//! Tables of figures and tables of facts.

use super::html::Html;
use super::text::{Text, cell, is_number};

/// Number of characters above which a cell wraps as text.
const LONG: usize = 24;

/// Table of figures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Caption above the table; can be empty.
    pub caption: String,
    /// Columns. The first one names the row.
    pub columns: Vec<TableColumn>,
    /// Cells of each row. Missing cells are empty.
    pub rows: Vec<Vec<String>>,
}

/// Heading of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableColumn {
    /// Quantity.
    pub name: String,
    /// DisplayUnit of its numbers; can be empty.
    pub unit: String,
}

impl TableColumn {
    /// Creates a column heading; `unit` can be empty.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        TableColumn { name: name.into(), unit: unit.into() }
    }
}

/// A table of one run. `run` is the run's heading as HTML, if the page compares runs.
#[derive(Debug)]
pub(super) struct RunTable<'a> {
    pub run: Option<String>,
    pub table: &'a Table,
}

impl Html {
    /// Appends facts: a row for each name, with one value for each of `heads` (HTML), or a single value
    /// without heads. Equal values of a row are merged into one cell.
    pub(super) fn facts(&mut self, heads: &[String], rows: &[(&str, Vec<String>)]) {
        self.append(format_args!("<div class=\"table\"><table>\n"));
        if !heads.is_empty() {
            self.append(format_args!("<thead><tr><td></td>"));
            heads.iter().for_each(|head| self.append(format_args!("<th scope=\"col\">{head}</th>")));
            self.append(format_args!("</tr></thead>\n"));
        }
        self.append(format_args!("<tbody>\n"));
        for (name, values) in rows {
            self.append(format_args!("<tr><th scope=\"row\">{}</th>", Text(name)));
            match values.split_first() {
                Some((first, rest)) if rest.iter().all(|value| value == first) => {
                    let columns = values.len();
                    self.append(format_args!(
                        "<td class=\"same\" colspan=\"{columns}\">{}</td>",
                        Text(first)
                    ));
                }
                _ => values.iter().for_each(|value| self.append(format_args!("<td>{}</td>", Text(value)))),
            }
            self.append(format_args!("</tr>\n"));
        }
        self.append(format_args!("</tbody>\n</table></div>\n"));
    }

    /// Appends one table. Rows of several runs are grouped by their first cell.
    pub(super) fn table(&mut self, tables: &[RunTable]) {
        let Some(RunTable { run, table: first }) = tables.first().filter(|t| !t.table.rows.is_empty()) else {
            return;
        };
        self.append(format_args!("<div class=\"table\"><table>\n"));
        if !first.caption.is_empty() {
            self.append(format_args!("<caption>{}</caption>\n", Text(&first.caption)));
        }
        self.append(format_args!("<thead><tr>"));
        for (i, column) in first.columns.iter().enumerate() {
            let class = if i > 0 && is_numeric(tables, i) { " class=\"number\"" } else { "" };
            self.append(format_args!("<th scope=\"col\"{class}>{}", Text(&column.name)));
            if !column.unit.is_empty() {
                self.append(format_args!(" <span class=\"unit\">{}</span>", Text(&column.unit)));
            }
            self.append(format_args!("</th>"));
            if i == 0 && run.is_some() {
                self.append(format_args!("<th scope=\"col\">run</th>"));
            }
        }
        self.append(format_args!("</tr></thead>\n"));
        for (r, row) in first.rows.iter().enumerate() {
            self.append(format_args!("<tbody>\n"));
            for (n, RunTable { run, table }) in tables.iter().enumerate() {
                self.append(format_args!("<tr>"));
                if n == 0 {
                    let (span, head) = (tables.len(), row.first().map_or("", String::as_str));
                    self.append(format_args!(
                        "<th scope=\"rowgroup\" rowspan=\"{span}\">{}</th>",
                        Text(head)
                    ));
                }
                if let Some(run) = run {
                    self.append(format_args!("<th scope=\"row\" class=\"run\">{run}</th>"));
                }
                for i in 1..first.columns.len() {
                    let text = table.rows.get(r).and_then(|row| row.get(i)).map_or("", String::as_str);
                    let class = match text {
                        _ if is_numeric(tables, i) => " class=\"number\"",
                        _ if text.chars().count() > LONG => " class=\"text\"",
                        _ => "",
                    };
                    self.append(format_args!("<td{class}>{}</td>", Text(&cell(text))));
                }
                self.append(format_args!("</tr>\n"));
            }
            self.append(format_args!("</tbody>\n"));
        }
        self.append(format_args!("</table></div>\n"));
    }
}

/// Returns the distinct names of facts, in order of first occurrence.
pub(super) fn names<'a>(facts: impl IntoIterator<Item = &'a (String, String)>) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in facts {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// Returns all values of a name, separated by commas.
pub(super) fn fact(facts: &[(String, String)], name: &str) -> String {
    let values = facts.iter().filter(|(n, _)| n == name).map(|(_, value)| value.as_str());
    values.collect::<Vec<_>>().join(", ")
}

/// Returns true if two tables have equal columns and equal first cells.
pub(super) fn are_comparable(a: &Table, b: &Table) -> bool {
    a.columns == b.columns
        && a.rows.len() == b.rows.len()
        && a.rows.iter().zip(&b.rows).all(|(a, b)| a.first() == b.first())
}

/// Returns true if all cells of a column are numbers, dashes or empty.
fn is_numeric(tables: &[RunTable], column: usize) -> bool {
    let mut cells = tables.iter().flat_map(|t| &t.table.rows).filter_map(|row| row.get(column));
    cells.all(|cell| is_number(cell) || matches!(cell.trim(), "" | "-" | "–" | "—"))
}
