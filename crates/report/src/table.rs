//! Tables of figures, and facts by name.

use super::html::Html;
use super::text::{Text, cell, is_number};

/// Cells of more characters than this are text that wraps, but not word by word.
const LONG: usize = 24;

/// Figures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// What the figures are of.
    pub caption: String,
    /// The first names what a row is about.
    pub columns: Vec<TableColumn>,
    /// Cells of each row; what is missing stays empty.
    pub rows: Vec<Vec<String>>,
}

/// Head of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TableColumn {
    /// What it holds.
    pub name: String,
    /// DisplayUnit of its numbers; can be empty.
    pub unit: String,
}

impl TableColumn {
    /// A column of numbers in `unit`, which can be empty.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        TableColumn { name: name.into(), unit: unit.into() }
    }
}

/// A table with the run that it is of, as HTML, where runs must be told apart.
#[derive(Debug)]
pub(super) struct RunTable<'a> {
    pub run: Option<String>,
    pub table: &'a Table,
}

impl Html {
    /// Facts: a row for each name, with a value for each of `heads` (HTML), or with one if there are
    /// no heads. What is the same in all stands once.
    pub(super) fn facts(&mut self, heads: &[String], rows: &[(&str, Vec<String>)]) {
        self.put(format_args!("<div class=\"table\"><table>\n"));
        if !heads.is_empty() {
            self.put(format_args!("<thead><tr><td></td>"));
            heads.iter().for_each(|head| self.put(format_args!("<th scope=\"col\">{head}</th>")));
            self.put(format_args!("</tr></thead>\n"));
        }
        self.put(format_args!("<tbody>\n"));
        for (name, values) in rows {
            self.put(format_args!("<tr><th scope=\"row\">{}</th>", Text(name)));
            match values.split_first() {
                Some((first, rest)) if rest.iter().all(|value| value == first) => {
                    let columns = values.len();
                    self.put(format_args!("<td class=\"same\" colspan=\"{columns}\">{}</td>", Text(first)));
                }
                _ => values.iter().for_each(|value| self.put(format_args!("<td>{}</td>", Text(value)))),
            }
            self.put(format_args!("</tr>\n"));
        }
        self.put(format_args!("</tbody>\n</table></div>\n"));
    }

    /// One table; the rows of several runs stand below each other.
    pub(super) fn table(&mut self, tables: &[RunTable]) {
        let Some(RunTable { run, table: first }) = tables.first().filter(|t| !t.table.rows.is_empty()) else {
            return;
        };
        self.put(format_args!("<div class=\"table\"><table>\n"));
        if !first.caption.is_empty() {
            self.put(format_args!("<caption>{}</caption>\n", Text(&first.caption)));
        }
        self.put(format_args!("<thead><tr>"));
        for (i, column) in first.columns.iter().enumerate() {
            let class = if i > 0 && is_numeric(tables, i) { " class=\"number\"" } else { "" };
            self.put(format_args!("<th scope=\"col\"{class}>{}", Text(&column.name)));
            if !column.unit.is_empty() {
                self.put(format_args!(" <span class=\"unit\">{}</span>", Text(&column.unit)));
            }
            self.put(format_args!("</th>"));
            if i == 0 && run.is_some() {
                self.put(format_args!("<th scope=\"col\">run</th>"));
            }
        }
        self.put(format_args!("</tr></thead>\n"));
        for (r, row) in first.rows.iter().enumerate() {
            self.put(format_args!("<tbody>\n"));
            for (n, RunTable { run, table }) in tables.iter().enumerate() {
                self.put(format_args!("<tr>"));
                if n == 0 {
                    let (span, head) = (tables.len(), row.first().map_or("", String::as_str));
                    self.put(format_args!("<th scope=\"rowgroup\" rowspan=\"{span}\">{}</th>", Text(head)));
                }
                if let Some(run) = run {
                    self.put(format_args!("<th scope=\"row\" class=\"run\">{run}</th>"));
                }
                for i in 1..first.columns.len() {
                    let text = table.rows.get(r).and_then(|row| row.get(i)).map_or("", String::as_str);
                    let class = match text {
                        _ if is_numeric(tables, i) => " class=\"number\"",
                        _ if text.chars().count() > LONG => " class=\"text\"",
                        _ => "",
                    };
                    self.put(format_args!("<td{class}>{}</td>", Text(&cell(text))));
                }
                self.put(format_args!("</tr>\n"));
            }
            self.put(format_args!("</tbody>\n"));
        }
        self.put(format_args!("</table></div>\n"));
    }
}

/// Names in the order in which they first stand.
pub(super) fn names<'a>(facts: impl IntoIterator<Item = &'a (String, String)>) -> Vec<&'a str> {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in facts {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

/// Every value that stands under a name.
pub(super) fn fact(facts: &[(String, String)], name: &str) -> String {
    let values = facts.iter().filter(|(n, _)| n == name).map(|(_, value)| value.as_str());
    values.collect::<Vec<_>>().join(", ")
}

/// Whether two tables have the same columns and the same heads of rows.
pub(super) fn are_comparable(a: &Table, b: &Table) -> bool {
    a.columns == b.columns
        && a.rows.len() == b.rows.len()
        && a.rows.iter().zip(&b.rows).all(|(a, b)| a.first() == b.first())
}

/// Whether a column holds numbers, and nothing but a dash or nothing where there is none.
fn is_numeric(tables: &[RunTable], column: usize) -> bool {
    let mut cells = tables.iter().flat_map(|t| &t.table.rows).filter_map(|row| row.get(column));
    cells.all(|cell| is_number(cell) || matches!(cell.trim(), "" | "-" | "–" | "—"))
}
