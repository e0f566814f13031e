//! Tables as text for the terminal, at most 80 columns wide.

use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Width, presets};
use virtual_axes_core::text::wrapped;
use virtual_axes_report::{Table, TableColumn};

/// Largest length of a line, characters.
pub const WIDTH: u16 = 80;
/// Blanks between two columns: of a table that fits with it, and of a wider one.
const GAPS: [u16; 2] = [2, 1];
/// Width of a column of text that is worth a smaller gap.
const TEXT: u16 = 16;
/// Lengths from which a word is divided anywhere: of most tables, and the smallest one of a table with many columns.
const WORDS: [u16; 2] = [24, 8];
/// Length of a word of a heading from which it is divided behind a hyphen.
const LONG_WORD: usize = 12;

/// Formats a table with the first column aligned left, the others right.
pub fn text(table: &Table) -> String {
    aligned(table, &[0])
}

/// Formats a table with the columns `left` aligned left, the others right. If the table is wider than [`WIDTH`], headings
/// and texts are wrapped between words and behind hyphens, and the gaps between the columns are smaller; numbers are not
/// wrapped.
pub fn aligned(table: &Table, left: &[usize]) -> String {
    let columns = 0..table.columns.len();
    let natural =
        columns.clone().map(|index| widest(table, index).max(heading_width(table, index)) + GAPS[0]);
    if natural.sum::<u16>() <= WIDTH + GAPS[0] {
        return arranged(table, left, Layout { gap: GAPS[0], word: WORDS[0] });
    }
    let mut table = table.clone();
    for column in &mut table.columns {
        let words = column.name.split(' ').map(|word| match word.chars().count() > LONG_WORD {
            true => word.replace('-', "-\n"),
            false => word.to_owned(),
        });
        column.name = words.collect::<Vec<_>>().join(" ");
    }
    let smallest = |index: usize, word: u16| match left.contains(&index) {
        true if word == WORDS[0] => widest(&table, index).min(TEXT).max(longest_word(&table, index, word)),
        _ => longest_word(&table, index, word),
    };
    let width = |layout: &Layout| {
        columns.clone().map(|index| smallest(index, layout.word) + layout.gap).sum::<u16>() - layout.gap
    };
    let narrow = |word| Layout { gap: GAPS[1], word };
    let wide = Layout { gap: GAPS[0], word: WORDS[0] };
    let mut layouts = std::iter::once(wide).chain((WORDS[1]..=WORDS[0]).rev().map(narrow));
    let layout = layouts.find(|layout| width(layout) <= WIDTH).unwrap_or(narrow(WORDS[1]));
    arranged(&table, left, layout)
}

/// Arrangement of a table.
#[derive(Clone, Copy)]
struct Layout {
    /// Blanks between two columns.
    gap: u16,
    /// Length from which a word is divided anywhere.
    word: u16,
}

/// Formats a table with this arrangement.
fn arranged(table: &Table, left: &[usize], layout: Layout) -> String {
    let gap = layout.gap;
    let mut out = comfy_table::Table::new();
    out.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    out.set_header(table.columns.iter().map(heading));
    out.add_rows(&table.rows);
    let texts = text_widths(table, left, layout);
    let last = table.columns.len();
    for (index, column) in out.column_iter_mut().enumerate() {
        column.set_padding((0, if index + 1 == last { 0 } else { gap }));
        column.set_cell_alignment(if left.contains(&index) {
            CellAlignment::Left
        } else {
            CellAlignment::Right
        });
        let text = texts.iter().find(|(column, _)| *column == index).map_or(0, |(_, width)| *width);
        let smallest = text.max(longest_word(table, index, layout.word));
        column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(
            smallest + if index + 1 == last { 0 } else { gap },
        )));
    }
    let lines: Vec<String> = out.lines().map(|line| line.trim_end().to_owned() + "\n").collect();
    lines.concat()
}

/// Returns the smallest width of each column of text. They share what the columns of numbers leave; the narrowest gets
/// what it needs first, and where the table would be too wide, each of the others keeps room for its longest word.
fn text_widths(table: &Table, left: &[usize], Layout { gap, word }: Layout) -> Vec<(usize, u16)> {
    let least = |index: usize| longest_word(table, index, word);
    let numbers = (0..table.columns.len()).filter(|index| !left.contains(index));
    let used: u16 = numbers.map(|index| least(index) + gap).sum();
    let mut widths: Vec<(usize, u16)> = left.iter().map(|&index| (index, widest(table, index))).collect();
    widths.sort_by_key(|(_, width)| *width);
    let shared = |is_kept: bool| {
        let (mut widths, mut spare) = (widths.clone(), WIDTH.saturating_sub(used));
        let mut count = u16::try_from(left.len()).unwrap_or(1);
        let mut kept: u16 = left.iter().map(|&index| least(index) + gap).sum();
        for (index, width) in &mut widths {
            kept = kept.saturating_sub(least(*index) + gap);
            let rest = if is_kept { kept } else { 0 };
            let share = (spare / count.max(1)).min(spare.saturating_sub(rest)).saturating_sub(gap);
            *width = (*width).min(share).max(if is_kept { least(*index) } else { 0 });
            spare = spare.saturating_sub(*width + gap);
            count = count.saturating_sub(1);
        }
        widths
    };
    let equal = shared(false);
    let total: u16 = equal.iter().map(|(index, width)| (*width).max(least(*index)) + gap).sum();
    if used + total <= WIDTH + gap { equal } else { shared(true) }
}

/// Returns the number of columns of figures with these headings, at least 1, that fit beside a column of names and one
/// of units.
pub fn columns_beside_text(headings: impl Iterator<Item = String>) -> usize {
    /// Length of a figure with its difference, such as "12974.2 (+332 %)".
    const FIGURE: usize = 16;
    /// Length of a column of names, and of a unit with its gap.
    const BESIDE: usize = 26 + 7;
    let words = headings.map(|heading| heading.split_whitespace().map(|word| word.chars().count()).max());
    let width = words.flatten().fold(FIGURE, usize::max) + 2;
    ((usize::from(WIDTH) - BESIDE) / width).max(1)
}

/// Returns the length of the longest part of a column that is not divided: a word, or a figure of some words such as
/// "12.79 of 54"; at most `word`.
fn longest_word(table: &Table, index: usize, word: u16) -> u16 {
    /// Longest figure, characters.
    const FIGURE: usize = 12;
    let heading = table.columns.get(index).map(heading).unwrap_or_default();
    let cells = table.rows.iter().filter_map(|row| row.get(index)).map(String::as_str);
    let figures = cells.clone().filter(|cell| cell.chars().count() <= FIGURE);
    longest(figures.chain(cells.chain([heading.as_str()]).flat_map(str::split_whitespace))).min(word)
}

/// Returns the length of the heading of a column on one line.
fn heading_width(table: &Table, index: usize) -> u16 {
    longest(table.columns.get(index).map(heading).as_deref().into_iter())
}

/// Returns the length of the longest cell of a column.
fn widest(table: &Table, index: usize) -> u16 {
    longest(table.rows.iter().filter_map(|row| row.get(index)).map(String::as_str))
}

fn longest<'a>(texts: impl Iterator<Item = &'a str>) -> u16 {
    let longest = texts.map(|text| text.chars().count()).max().unwrap_or(0);
    u16::try_from(longest).unwrap_or(u16::MAX).min(WIDTH / 2)
}

/// Wraps a text to lines of at most [`WIDTH`] characters; further lines are indented.
pub fn wrapped_line(text: &str) -> String {
    const INDENT: &str = "    ";
    if text.chars().count() <= usize::from(WIDTH) {
        return format!("{text}\n");
    }
    let lines = wrapped(text, usize::from(WIDTH) - INDENT.len());
    lines.join(&format!("\n{INDENT}")) + "\n"
}

/// Returns a row of comma-separated values; cells with commas, quotation marks or line breaks are quoted.
pub fn csv_row(cells: &[String]) -> String {
    let cells: Vec<String> = cells
        .iter()
        .map(|cell| match cell.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell.clone(),
        })
        .collect();
    cells.join(",") + "\n"
}

/// Returns a table as comma-separated values with its headings.
pub fn csv(table: &Table) -> String {
    let headings: Vec<String> = table.columns.iter().map(heading).collect();
    std::iter::once(&headings).chain(&table.rows).map(|row| csv_row(row)).collect()
}

fn heading(column: &TableColumn) -> String {
    match column.unit.as_str() {
        "" => column.name.clone(),
        unit => format!("{}, {unit}", column.name),
    }
}
