//! Tables of figures and tables of facts.

use super::html::{Html, run_class, swatch};
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
    /// Unit of its numbers; can be empty.
    pub unit: String,
    /// Index of the run whose figures the column contains; its heading has a sample of the run's line.
    pub run: Option<usize>,
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

    /// Appends a table. Empty tables are omitted.
    pub(super) fn table(&mut self, table: &Table) {
        if table.rows.is_empty() {
            return;
        }
        self.append(format_args!("<div class=\"table\"><table>\n"));
        if !table.caption.is_empty() {
            self.append(format_args!("<caption>{}</caption>\n", Text(&table.caption)));
        }
        self.append(format_args!("<thead><tr>"));
        for (i, column) in table.columns.iter().enumerate() {
            let class = if i > 0 && is_numeric(table, i) { " class=\"number\"" } else { "" };
            let line = column.run.map(|run| swatch(&format!("line {}", run_class(run)))).unwrap_or_default();
            self.append(format_args!("<th scope=\"col\"{class}>{line}{}", Text(&column.name)));
            if !column.unit.is_empty() {
                self.append(format_args!(" <span class=\"unit\">{}</span>", Text(&column.unit)));
            }
            self.append(format_args!("</th>"));
        }
        self.append(format_args!("</tr></thead>\n<tbody>\n"));
        for row in &table.rows {
            let head = row.first().map_or("", String::as_str);
            // A row with a name only is the heading of the rows below it.
            let class = if row.len() == 1 { " class=\"group\"" } else { "" };
            self.append(format_args!("<tr><th scope=\"row\"{class}>{}</th>", Text(head)));
            for i in 1..table.columns.len() {
                let text = row.get(i).map_or("", String::as_str);
                let class = match text {
                    _ if is_numeric(table, i) => " class=\"number\"",
                    _ if text.chars().count() > LONG => " class=\"text\"",
                    _ => "",
                };
                self.append(format_args!("<td{class}>{}</td>", Text(&cell(text))));
            }
            self.append(format_args!("</tr>\n"));
        }
        self.append(format_args!("</tbody>\n</table></div>\n"));
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

/// Returns true if all cells of a column are numbers, also with a difference in parentheses, dashes or empty.
fn is_numeric(table: &Table, column: usize) -> bool {
    let mut cells = table.rows.iter().filter_map(|row| row.get(column));
    cells.all(|cell| {
        let value = cell.split_once(" (").map_or(cell.as_str(), |(value, _)| value);
        is_number(value) || matches!(cell.trim(), "" | "-" | "–" | "—")
    })
}
