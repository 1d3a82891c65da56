//! Standard output, and the command line of this process.

use std::fmt;
use std::io::Write as _;

use comfy_table::CellAlignment;
use comfy_table::presets::UTF8_HORIZONTAL_ONLY;

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
