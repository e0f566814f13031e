//! Tables of figures and tables of facts.

use super::html::{Html, swatch};
use super::text::{Text, cell, is_number, prose};

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
    /// Run and time, s, of each row, whose place the plots show at a click; can be empty.
    pub instants: Vec<(usize, f64)>,
    /// True for a table of names and values, in which equal values of a row share a cell.
    pub is_facts: bool,
}

/// Heading of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableColumn {
    /// Quantity.
    pub name: String,
    /// Unit of its numbers; can be empty.
    pub unit: String,
    /// Index of the run whose figures the column contains; its heading has a sample of the run's line.
    pub run: Option<usize>,
}

impl Table {
    /// Creates a table without rows from the names and units of its columns.
    pub fn new(caption: &str, columns: &[(&str, &str)]) -> Self {
        let columns = columns.iter().map(|&(name, unit)| TableColumn::new(name, unit)).collect();
        Table { caption: caption.to_owned(), columns, ..Table::default() }
    }

    /// Creates a table of names with the values of each run, or with a single value without titles of runs.
    pub(super) fn of_facts(titles: &[&str], facts: &[&[(String, String)]]) -> Self {
        let columns = titles.iter().enumerate().map(|(run, title)| TableColumn::of_run(*title, run));
        let mut names: Vec<&str> = facts.iter().copied().flatten().map(|(name, _)| name.as_str()).collect();
        let mut seen = std::collections::BTreeSet::new();
        names.retain(|name| seen.insert(*name));
        let value = |facts: &[(String, String)], name: &str| {
            let values = facts.iter().filter(|(n, _)| n == name).map(|(_, value)| value.as_str());
            let values: Vec<&str> = values.collect();
            let has_sentence = values.iter().any(|value| value.chars().count() > LONG);
            values.join(if has_sentence { "\n" } else { ", " })
        };
        let row = |name: &str| {
            std::iter::once(name.to_owned()).chain(facts.iter().map(|facts| value(facts, name))).collect()
        };
        Table {
            columns: std::iter::once(TableColumn::default()).chain(columns).collect(),
            rows: names.into_iter().map(row).collect(),
            is_facts: true,
            ..Table::default()
        }
    }
}

impl TableColumn {
    /// Creates a column heading; `unit` can be empty.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        TableColumn { name: name.into(), unit: unit.into(), run: None }
    }

    /// Creates the heading of the figures of a run, by its index.
    pub fn of_run(title: impl Into<String>, run: usize) -> Self {
        TableColumn { name: title.into(), unit: String::new(), run: Some(run) }
    }
}

impl Html {
    /// Appends a table. Empty tables are omitted.
    pub(super) fn table(&mut self, table: &Table) {
        if table.rows.is_empty() {
            return;
        }
        let class = if table.is_facts { "facts" } else { "figures" };
        self.append(format_args!("<div class=\"table {class}\" tabindex=\"0\"><table>\n"));
        if !table.caption.is_empty() {
            self.append(format_args!("<caption><span>{}</span></caption>\n", Text(&table.caption)));
        }
        if table.columns.len() > 1 {
            self.heads(table);
        }
        self.append(format_args!("<tbody>\n"));
        for (index, row) in table.rows.iter().enumerate() {
            let head = row.first().map_or("", String::as_str);
            // A row with a name only is the heading of the rows below it.
            let class = if row.len() == 1 { " class=\"group\"" } else { "" };
            self.append(format_args!("<tr><th scope=\"row\"{class}>"));
            match table.instants.get(index) {
                Some((run, time)) => self.append(format_args!(
                    "<button type=\"button\" data-run=\"{run}\" data-time=\"{time:.6}\">{}</button></th>",
                    Text(head)
                )),
                None => self.append(format_args!("{}</th>", Text(head))),
            }
            let is_same = row.get(2..).is_some_and(|rest| rest.iter().all(|value| *value == row[1]));
            let columns = table.columns.len().max(row.len());
            match row.get(1).filter(|_| table.is_facts && is_same) {
                Some(value) => {
                    let span = columns - 1;
                    self.append(format_args!("<td class=\"same\" colspan=\"{span}\">{}</td>", lines(value)));
                }
                None => (1..columns).for_each(|i| self.cell(table, i, row.get(i).map_or("", String::as_str))),
            }
            self.append(format_args!("</tr>\n"));
        }
        self.append(format_args!("</tbody>\n</table></div>\n"));
    }

    fn heads(&mut self, table: &Table) {
        self.append(format_args!("<thead><tr>"));
        for (i, column) in table.columns.iter().enumerate() {
            let class = if i > 0 && is_numeric(table, i) { " class=\"number\"" } else { "" };
            let line = column.run.map(swatch).unwrap_or_default();
            self.append(format_args!("<th scope=\"col\"{class}>{line}{}", Text(&column.name)));
            if !column.unit.is_empty() {
                self.append(format_args!(" <span class=\"unit\">{}</span>", Text(&column.unit)));
            }
            self.append(format_args!("</th>"));
        }
        self.append(format_args!("</tr></thead>\n"));
    }

    fn cell(&mut self, table: &Table, column: usize, text: &str) {
        let class = match text {
            _ if is_numeric(table, column) => " class=\"number\"",
            _ if !table.is_facts && text.chars().count() > LONG => " class=\"text\"",
            _ => "",
        };
        self.append(format_args!("<td{class}>{}</td>", lines(&cell(text))));
    }
}

/// Returns a cell as HTML, each of its lines in a line of its own.
fn lines(text: &str) -> String {
    text.split('\n').map(prose).collect::<Vec<_>>().join("<br>")
}

/// Returns true if all cells of a column are numbers, also with a difference in parentheses, dashes or empty.
fn is_numeric(table: &Table, column: usize) -> bool {
    let mut cells = table.rows.iter().filter_map(|row| row.get(column));
    !table.is_facts
        && cells.all(|cell| {
            let value = cell.split_once(" (").map_or(cell.as_str(), |(value, _)| value);
            is_number(value) || matches!(cell.trim(), "" | "-" | "–" | "—")
        })
}
