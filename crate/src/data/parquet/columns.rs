//! The columns of a Parquet file: which of them a table of text can have, and their values.

use parquet::basic::{ConvertedType, LogicalType, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::schema::types::{ColumnDescriptor, SchemaDescriptor};

use crate::data::export::number_text;
use crate::error::{Error, Result};

/// A column that a table of text can have.
pub struct Column {
    pub name: String,
    /// Its number among all that hold values.
    pub leaf: usize,
    /// Whether a row has a list of values.
    pub is_list: bool,
    /// Cells of a row: one, or as many as its longest list has.
    pub width: usize,
    /// Levels of definition of a value that is there, and of one that is missing in a list.
    defined: i16,
    place: i16,
    pub physical: Physical,
    is_unsigned: bool,
}

/// The columns that can be read, and the names of the others with what they are.
pub fn columns(schema: &SchemaDescriptor) -> (Vec<Column>, Vec<String>) {
    let (mut columns, mut left_out) = (Vec::new(), Vec::<String>::new());
    for (leaf, column) in schema.columns().iter().enumerate() {
        match Column::of(schema, leaf, column) {
            Ok(column) => columns.push(column),
            Err(why) => {
                let name = column.path().parts().first().map_or("", String::as_str);
                let text = format!("`{name}` ({why})");
                // A struct has several that hold values.
                if left_out.last() != Some(&text) {
                    left_out.push(text);
                }
            }
        }
    }
    (columns, left_out)
}

impl Column {
    fn of(
        schema: &SchemaDescriptor,
        leaf: usize,
        column: &ColumnDescriptor,
    ) -> Result<Self, &'static str> {
        let parts = column.path().parts();
        let root = schema.get_column_root(leaf);
        let is_list = column.max_rep_level() == 1;
        let is_known = match (parts.len(), is_list) {
            (1, _) => true,
            (3, true) => {
                root.get_basic_info().converted_type() == ConvertedType::LIST
                    || root.get_basic_info().logical_type_ref() == Some(&LogicalType::List)
            }
            _ => false,
        };
        if !is_known {
            return Err("of a struct");
        }
        let logical = column.logical_type_ref();
        match column.physical_type() {
            Physical::BYTE_ARRAY
                if matches!(
                    column.converted_type(),
                    ConvertedType::UTF8 | ConvertedType::ENUM
                ) || matches!(logical, Some(LogicalType::String | LogicalType::Enum)) => {}
            Physical::BYTE_ARRAY | Physical::FIXED_LEN_BYTE_ARRAY => return Err("bytes"),
            Physical::INT96 => return Err("a time"),
            Physical::INT32 | Physical::INT64 => match logical {
                None | Some(LogicalType::Integer(_)) if is_integer(column.converted_type()) => {}
                Some(LogicalType::Decimal(_)) => return Err("decimal numbers"),
                _ => return Err("a time"),
            },
            Physical::BOOLEAN | Physical::FLOAT | Physical::DOUBLE => {}
        }
        let defined = column.max_def_level();
        let is_optional = column.self_type().is_optional();
        Ok(Self {
            name: parts[0].clone(),
            leaf,
            is_list,
            width: 1,
            defined,
            place: defined - i16::from(is_list && is_optional),
            physical: column.physical_type(),
            is_unsigned: matches!(
                column.converted_type(),
                ConvertedType::UINT_8
                    | ConvertedType::UINT_16
                    | ConvertedType::UINT_32
                    | ConvertedType::UINT_64
            ),
        })
    }

    /// Where it is, for messages.
    pub fn place(&self) -> String {
        format!("column `{}`", self.name)
    }

    /// The levels of definition and repetition of a value.
    pub fn levels(&self) -> [i16; 2] {
        [self.defined, i16::from(self.is_list)]
    }

    /// The length of the longest list in the next `rows` rows.
    ///
    /// # Errors
    /// When the column is damaged.
    pub fn longest(&self, reader: &mut ColumnReader, rows: usize) -> Result<usize> {
        let mut longest = 0;
        self.visit(reader, rows, &mut |_, at, _| longest = longest.max(at + 1))?;
        Ok(longest)
    }

    /// The cells of the next `rows` rows, one row after the other; None where their texts take more
    /// bytes than are left of `budget`.
    ///
    /// # Errors
    /// When the column is damaged.
    pub fn cells(
        &self,
        reader: &mut ColumnReader,
        rows: usize,
        budget: &mut u64,
    ) -> Result<Option<Vec<String>>> {
        let mut cells = vec![String::new(); rows * self.width];
        let (mut is_whole, mut is_in_budget) = (true, true);
        self.visit(reader, rows, &mut |row, at, text| {
            let left = budget.checked_sub(text.len() as u64);
            is_in_budget &= left.is_some();
            *budget = left.unwrap_or(0);
            match cells.get_mut(row * self.width + at) {
                Some(cell) if at < self.width && is_in_budget => *cell = text,
                Some(_) if at < self.width => {}
                _ => is_whole = false,
            }
        })?;
        match is_whole {
            true => Ok(Some(cells).filter(|_| is_in_budget)),
            false => Err(damaged()),
        }
    }

    /// Calls `visit` for every value: its row, its place in the list of the row, its text, which is
    /// empty where it is missing in a list.
    fn visit(
        &self,
        reader: &mut ColumnReader,
        rows: usize,
        visit: &mut dyn FnMut(usize, usize, String),
    ) -> Result<()> {
        let unsigned = self.is_unsigned;
        match reader {
            ColumnReader::BoolColumnReader(reader) => self.values(reader, rows, visit, |value| {
                // As pandas writes it.
                if *value { "True" } else { "False" }.to_owned()
            }),
            ColumnReader::Int32ColumnReader(reader) => {
                self.values(reader, rows, visit, |value| match unsigned {
                    true => value.cast_unsigned().to_string(),
                    false => value.to_string(),
                })
            }
            ColumnReader::Int64ColumnReader(reader) => {
                self.values(reader, rows, visit, |value| match unsigned {
                    true => value.cast_unsigned().to_string(),
                    false => value.to_string(),
                })
            }
            // The same number in f64, as it would be read from an array.
            ColumnReader::FloatColumnReader(reader) => {
                self.values(reader, rows, visit, |value| number_text(f64::from(*value)))
            }
            ColumnReader::DoubleColumnReader(reader) => {
                self.values(reader, rows, visit, |value| number_text(*value))
            }
            ColumnReader::ByteArrayColumnReader(reader) => {
                self.values(reader, rows, visit, |value: &ByteArray| {
                    String::from_utf8_lossy(value.data()).into_owned()
                })
            }
            ColumnReader::Int96ColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => {
                Err(damaged())
            }
        }
    }

    fn values<T: DataType>(
        &self,
        reader: &mut ColumnReaderImpl<T>,
        rows: usize,
        visit: &mut dyn FnMut(usize, usize, String),
        text: impl Fn(&T::T) -> String,
    ) -> Result<()> {
        let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
        let read = reader.read_records(rows, Some(&mut defined), Some(&mut repeated), &mut values);
        let (records, _, levels) = read.map_err(|e| unreadable(&e))?;
        if records != rows {
            return Err(damaged());
        }
        let mut values = values.iter();
        let (mut next, mut at) = (0, 0);
        for i in 0..levels {
            if repeated.get(i).is_none_or(|level| *level == 0) {
                (next, at) = (next + 1, 0);
            }
            let level = defined.get(i).copied().unwrap_or(self.defined);
            if level == self.defined {
                let value = values.next().ok_or_else(damaged)?;
                visit(next - 1, at, text(value));
            } else if level >= self.place {
                visit(next - 1, at, String::new());
            }
            at += usize::from(level >= self.place);
        }
        Ok(())
    }
}

fn is_integer(converted: ConvertedType) -> bool {
    use ConvertedType::{INT_8, INT_16, INT_32, INT_64, NONE, UINT_8, UINT_16, UINT_32, UINT_64};
    matches!(
        converted,
        NONE | INT_8 | INT_16 | INT_32 | INT_64 | UINT_8 | UINT_16 | UINT_32 | UINT_64
    )
}

fn damaged() -> Error {
    Error::input("it does not hold as many values as it declares; is the file damaged?")
}

/// The error of a column that cannot be read.
pub fn unreadable(error: &parquet::errors::ParquetError) -> Error {
    Error::input(format!("{error}; is the file damaged?"))
}
