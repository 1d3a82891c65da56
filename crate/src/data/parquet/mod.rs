//! Parquet files, as the table that pandas or polars would write of them.

mod columns;
mod episodes;
mod pages;
mod thrift;

use bytes::Bytes;
use parquet::basic::Compression;
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader as _, SerializedFileReader};

use super::arrays::listed;
use super::export::{Export, ExportWriter};
use super::reading::Notice;
use crate::error::{Error, Result};
use crate::memory;
use columns::{Column, unreadable};
pub use episodes::{VideoEpisode, read_video_episodes};
use pages::CheckedPages;
use thrift::{check_footer, check_pages};

/// The first and the last bytes of a Parquet file.
pub const PARQUET_MAGIC: &[u8; 4] = b"PAR1";

/// Rows that are unpacked at a time.
const ROWS: usize = 1024;
/// Bytes that a table may come to however small the file is, and for a byte of the file.
const SMALL: u64 = 40 << 20;
const FOR_BYTE: u64 = 20;
/// What a cell comes to: its text, and its part of a point.
const CELL: u64 = 40;
/// Bytes that a page may unpack to however small the file is.
const PAGE: u64 = 16 << 20;

/// What LeRobot calls the sequence and the frame of a row, and what it counts besides.
const EPISODE: &str = "episode_index";
const FRAME: &str = "frame_index";
const COUNTED: [&str; 3] = ["index", "task_index", "timestamp"];

/// The table of a Parquet file. A list becomes a column for each of its values, `name_0`, `name_1`,
/// …; what is neither numbers nor text is left out and named. Numbers are those of the file, with
/// every digit.
///
/// Of LeRobot's data `episode_index` becomes the sequence, `episode_000003`, as its files of videos
/// are called, and `frame_index` the frame.
///
/// # Errors
/// When the bytes are no whole Parquet file, when a column is damaged, or when the file declares
/// more than fits into memory.
pub fn export_parquet(bytes: Vec<u8>) -> Result<Export> {
    let file = File::open(Bytes::from(bytes))?;
    let (mut columns, left_out) = file.columns();
    let mut notices = Vec::new();
    if !left_out.is_empty() {
        notices.push(Notice::from(format!(
            "left out {} column(s) that hold neither numbers nor text: {}",
            left_out.len(),
            left_out.join(", ")
        )));
    }
    let is_lerobot = is_lerobot(&columns);
    if is_lerobot {
        let counted = columns.extract_if(.., |column| COUNTED.contains(&column.name.as_str()));
        let counted: Vec<String> = counted.map(|column| column.name).collect();
        notices.push(Notice::from(format!(
            "read as LeRobot's data: `{EPISODE}` is the sequence, `{FRAME}` the frame; not \
             needed: {}",
            listed(&counted)
        )));
    }
    if columns.is_empty() {
        return Err(Error::input(
            "the Parquet file has no column of numbers or text",
        ));
    }
    file.check(&columns)?;
    file.measure(&mut columns)?;
    file.check(&columns)?;
    let mut export = file.table(&columns, is_lerobot)?.finish(None)?;
    export.notices = notices;
    Ok(export)
}

/// An episode of LeRobot as the files of its videos are called.
fn episode(number: &str) -> String {
    match number {
        "" => String::new(),
        number => format!("episode_{number:0>6}"),
    }
}

/// The error of more than a file of so many bytes may hold.
fn too_much(what: &str, size: u64) -> Error {
    Error::input(format!(
        "the Parquet file declares more {what} than one of {size} bytes may hold; is it damaged? \
         If it is not, write it \
         as CSV"
    ))
}

/// Whether these are columns as LeRobot has them.
fn is_lerobot(columns: &[Column]) -> bool {
    let has = |name: &str| {
        columns
            .iter()
            .any(|column| !column.is_list && column.name == name)
    };
    has(EPISODE) && has(FRAME) && !has("sequence") && !has("frame")
}

fn header(columns: &[Column], is_lerobot: bool) -> Vec<String> {
    let mut names = Vec::new();
    for column in columns {
        match column.name.as_str() {
            EPISODE if is_lerobot => names.push("sequence".to_owned()),
            FRAME if is_lerobot => names.push("frame".to_owned()),
            name if column.is_list => {
                names.extend((0..column.width).map(|i| format!("{name}_{i}")))
            }
            name => names.push(name.to_owned()),
        }
    }
    names
}

/// A file whose declarations can be believed, as far as they were checked.
struct File {
    bytes: Bytes,
    reader: SerializedFileReader<Bytes>,
}

impl File {
    fn open(bytes: Bytes) -> Result<Self> {
        let cut = || Error::input("not a whole Parquet file; was it cut short?");
        let end = bytes
            .len()
            .checked_sub(8)
            .filter(|_| bytes.starts_with(PARQUET_MAGIC));
        let end = end.ok_or_else(cut)?;
        let (length, magic) = bytes[end..].split_at(4);
        let length = u32::from_le_bytes(length.try_into().map_err(|_| cut())?) as usize;
        let start = end.checked_sub(length).filter(|_| magic == PARQUET_MAGIC);
        check_footer(&bytes[start.ok_or_else(cut)?..end])?;
        let reader = SerializedFileReader::new(bytes.clone()).map_err(|e| unreadable(&e))?;
        Ok(Self { bytes, reader })
    }

    /// The columns that can be read, and the names of the others with what they are.
    fn columns(&self) -> (Vec<Column>, Vec<String>) {
        columns::columns(self.reader.metadata().file_metadata().schema_descr())
    }

    fn groups(&self) -> &[RowGroupMetaData] {
        self.reader.metadata().row_groups()
    }

    fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Bytes that its table may come to.
    fn allowed(&self) -> u64 {
        SMALL.saturating_add(FOR_BYTE.saturating_mul(self.size()))
    }

    /// Checks what the columns declare, and that their cells fit into memory.
    fn check(&self, columns: &[Column]) -> Result<()> {
        let cells = self.allowed() / CELL;
        let width: usize = columns.iter().map(|column| column.width).sum();
        let mut declared = 0_u64;
        for group in self.groups() {
            // What is negative is too much as well.
            let rows = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
            declared = declared.saturating_add(rows.saturating_mul(width as u64));
            for column in columns {
                let chunk = group.column(column.leaf);
                let values = match column.is_list {
                    true => u64::try_from(chunk.num_values()).unwrap_or(u64::MAX),
                    false => rows,
                };
                if declared.max(values) > cells {
                    return Err(too_much("values", self.size()));
                }
                let most = PAGE.saturating_add(FOR_BYTE.saturating_mul(self.size()));
                let checked = self
                    .chunk(chunk)
                    .and_then(|chunk| check_pages(chunk, values, most));
                checked.map_err(|e| e.at(column.place()))?;
            }
        }
        memory::check(declared.saturating_mul(CELL), "cells", "split the file")
    }

    /// The bytes of a column.
    fn chunk(&self, chunk: &ColumnChunkMetaData) -> Result<&[u8]> {
        let wrong = || Error::input("it does not lie in the file; is the file damaged?");
        // The unpacking of Zstandard is C.
        if cfg!(target_arch = "wasm32") && matches!(chunk.compression(), Compression::ZSTD(_)) {
            return Err(Error::input(
                "it is packed by Zstandard, which the page does not unpack; write the file with snappy \
                 (pandas: `to_parquet(…, compression=\"snappy\")`)",
            ));
        }
        if chunk.file_path().is_some() {
            return Err(Error::input(
                "it lies in another file; write the table as one file",
            ));
        }
        let start = chunk
            .dictionary_page_offset()
            .unwrap_or_else(|| chunk.data_page_offset());
        let number = |n: i64| usize::try_from(n).map_err(|_| wrong());
        let (start, length) = (number(start)?, number(chunk.compressed_size())?);
        let rest = self.bytes.get(start..).ok_or_else(wrong)?;
        rest.get(..length).ok_or_else(wrong)
    }

    /// Sets the width of lists.
    fn measure(&self, columns: &mut [Column]) -> Result<()> {
        for column in columns.iter_mut().filter(|column| column.is_list) {
            let mut width = 1;
            let own = std::slice::from_ref(&*column);
            self.batches(own, |readers, rows| {
                for reader in readers {
                    let longest = column.longest(reader, rows);
                    width = width.max(longest.map_err(|e| e.at(column.place()))?);
                }
                Ok(())
            })?;
            column.width = width;
        }
        Ok(())
    }

    /// The table of these columns.
    fn table(&self, columns: &[Column], is_lerobot: bool) -> Result<ExportWriter> {
        let mut table = ExportWriter::default();
        table.row(header(columns, is_lerobot))?;
        let allowed = self.allowed();
        self.batches(columns, |readers, rows| {
            // What is unpacked here is written below.
            let budget = allowed.saturating_sub(table.size()) / 2;
            let mut cells = self.cells(columns, readers, rows, budget)?;
            for row in 0..rows {
                let of_row = columns.iter().zip(&mut cells).flat_map(|(column, cells)| {
                    let cells = &mut cells[row * column.width..(row + 1) * column.width];
                    if is_lerobot && column.name == EPISODE {
                        cells[0] = episode(&cells[0]);
                    }
                    &*cells
                });
                table.row(of_row)?;
            }
            match table.size() > allowed {
                true => Err(too_much("text", self.size())),
                false => Ok(()),
            }
        })?;
        Ok(table)
    }

    /// The cells of the next `rows` rows by column, whose texts may take `budget` bytes.
    fn cells(
        &self,
        columns: &[Column],
        readers: &mut [ColumnReader],
        rows: usize,
        mut budget: u64,
    ) -> Result<Vec<Vec<String>>> {
        let of_column = |(column, reader): (&Column, &mut ColumnReader)| {
            let cells = column.cells(reader, rows, &mut budget);
            let cells = cells.map_err(|e| e.at(column.place()))?;
            cells.ok_or_else(|| too_much("text", self.size()))
        };
        columns.iter().zip(readers).map(of_column).collect()
    }

    /// Calls `each` for some rows after the other, with a reader of each column and the number of
    /// the rows.
    fn batches(
        &self,
        columns: &[Column],
        mut each: impl FnMut(&mut [ColumnReader], usize) -> Result<()>,
    ) -> Result<()> {
        for (number, group) in self.groups().iter().enumerate() {
            let own = self.reader.get_row_group(number);
            let own = own.map_err(|e| unreadable(&e))?;
            let open = |column: &Column| {
                let pages = CheckedPages::new(own.get_column_page_reader(column.leaf)?, column);
                let described = group.column(column.leaf).column_descr_ptr();
                Ok(get_column_reader(described, Box::new(pages)))
            };
            let readers: Result<Vec<_>, _> = columns.iter().map(open).collect();
            let mut readers = readers.map_err(|e| unreadable(&e))?;
            let rows = group.num_rows().max(0) as usize;
            for start in (0..rows).step_by(ROWS) {
                each(&mut readers, ROWS.min(rows - start))?;
            }
        }
        Ok(())
    }
}
