//! Standard output, and the command line of this process.

use std::fmt;
use std::io::Write as _;

use comfy_table::CellAlignment;
use comfy_table::presets::{NOTHING, UTF8_HORIZONTAL_ONLY};
use serde::Serialize;

use crate::command_line::shell_line;
use crate::error::{Error, Result};
use crate::report::{ColumnKind, Table};

/// Writes a line to standard output, and returns when that fails. A reader may have seen enough, as
/// `head` does: then nothing more is written, and that is not an error.
macro_rules! say {
    ($($arguments:tt)*) => {
        $crate::cli::terminal::write_line(format_args!($($arguments)*))?
    };
}

pub(super) fn write_line(line: fmt::Arguments<'_>) -> Result<()> {
    match writeln!(std::io::stdout(), "{line}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::io("standard output", &e))
        }
        _ => Ok(()),
    }
}

/// Writes `value` as JSON; `what` names it in an error.
pub(super) fn say_json(value: &impl Serialize, what: &str) -> Result<()> {
    let json = serde_json::to_string_pretty(value)
        .map_err(|e| Error::input(format!("the {what} cannot be written as JSON: {e}")))?;
    say!("{json}");
    Ok(())
}

/// Writes names and values, one pair a line; a value that is empty is not shown.
pub(super) fn say_rows<const N: usize>(rows: [(&str, String); N]) -> Result<()> {
    let mut table = comfy_table::Table::new();
    table.load_preset(NOTHING);
    for (name, value) in rows {
        if !value.is_empty() {
            table.add_row([name.to_owned(), value]);
        }
    }
    say!("{table}");
    Ok(())
}

/// A table with lines between its rows, as wide as the terminal allows.
pub(super) fn drawn(table: &Table) -> comfy_table::Table {
    let mut drawn = comfy_table::Table::new();
    let labels = table.columns.iter().map(|column| &column.label);
    drawn
        .load_preset(UTF8_HORIZONTAL_ONLY)
        .set_header(labels)
        .add_rows(&table.rows);
    for (column, drawn) in table.columns.iter().zip(drawn.column_iter_mut()) {
        if column.kind == ColumnKind::Number {
            drawn.set_cell_alignment(CellAlignment::Right);
        }
    }
    drawn
}

/// How this program was called.
pub(super) fn own_command() -> Result<String> {
    let arguments: Vec<String> = std::env::args_os()
        .skip(1)
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect();
    shell_line(
        ["tracklens"]
            .into_iter()
            .chain(arguments.iter().map(String::as_str)),
    )
}
