//! Times of a part program by operation and tool as text.

use virtual_axes_core::text::escaped;
use virtual_axes_nc::offline::OperationSummary;
use virtual_axes_report::runs::{operations_table, tools_table};

use super::text_table;

/// Largest number of operations in the table; the JSON output of `run` contains all.
const OPERATIONS: usize = 12;

/// Returns tables of the operations and the tools, each after an empty line, if there are several.
pub fn operations_text(operations: &OperationSummary) -> String {
    let parts = [
        (operations_table(operations, OPERATIONS, escaped), &[0, 1, 2][..]),
        (tools_table(operations), &[0][..]),
    ];
    let parts = parts.into_iter().filter(|(table, _)| !table.rows.is_empty());
    parts.map(|(table, left)| format!("\n{}", text_table::aligned(&table, left))).collect()
}
