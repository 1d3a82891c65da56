//! Data sets of records with named fields (HDF5's compound types).

use hdf5_reader::{CompoundField, Dataset, Datatype, StringSize};

use super::scalar::{Scalar, bytes};
use crate::data::export::number_text;
use crate::error::{Error, Result};

/// The records of a data set.
pub struct Records {
    name: String,
    bytes: Vec<u8>,
    /// Bytes of a record.
    size: usize,
    fields: Vec<CompoundField>,
}

/// Where a field lies in a record, and what it holds: one value or a row of them.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    offset: usize,
    /// How many values.
    pub count: usize,
    value: Value,
}

#[derive(Debug, Clone, Copy)]
enum Value {
    Number(Scalar),
    /// A text of so many bytes.
    Text(usize),
}

impl Value {
    fn size(self) -> usize {
        match self {
            Self::Number(scalar) => scalar.size,
            Self::Text(size) => size,
        }
    }
}

impl Records {
    /// Reads all records of a data set; its file has `file` bytes.
    ///
    /// # Errors
    /// When its items are no records, or it cannot be read.
    pub fn read(dataset: &Dataset, name: &str, file: u64) -> Result<Self> {
        let Datatype::Compound { size, fields } = dataset.dtype() else {
            return Err(Error::input(format!(
                "`{name}` is not a table of records with named fields"
            )));
        };
        Ok(Self {
            name: name.to_owned(),
            bytes: bytes(dataset, name, file)?,
            size: (*size).max(1) as usize,
            fields: fields.clone(),
        })
    }

    /// The number of records.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.size
    }

    /// The names of the fields in their order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.fields.iter().map(|field| field.name.as_str())
    }

    /// A field of numbers or texts; `None` where there is none of this name.
    ///
    /// # Errors
    /// When it holds something else or reaches out of its record.
    pub fn find(&self, name: &str) -> Result<Option<Field>> {
        let Some(field) = self.fields.iter().find(|field| field.name == name) else {
            return Ok(None);
        };
        let (item, count) = match &field.datatype {
            Datatype::Array { base, dims } => {
                let count = dims.iter().try_fold(1, |n: u64, side| n.checked_mul(*side));
                (&**base, count.and_then(|n| usize::try_from(n).ok()))
            }
            other => (other, Some(1)),
        };
        let value = match item {
            Datatype::String {
                size: StringSize::Fixed(size),
                ..
            } => Some(Value::Text(*size as usize)),
            other => Scalar::of(other).map(Value::Number),
        };
        let offset = field.byte_offset as usize;
        let found = value.zip(count).filter(|(value, count)| {
            let end = value.size().checked_mul(*count);
            end.and_then(|n| n.checked_add(offset))
                .is_some_and(|end| end <= self.size)
        });
        let (value, count) = found.ok_or_else(|| {
            Error::input(format!(
                "the field `{name}` of `{}` holds neither numbers nor texts of a fixed length",
                self.name
            ))
        })?;
        Ok(Some(Field {
            offset,
            count,
            value,
        }))
    }

    /// As [`Records::find`], of a field that has to be there.
    ///
    /// # Errors
    /// When it is not.
    pub fn field(&self, name: &str) -> Result<Field> {
        self.find(name)?.ok_or_else(|| {
            let names: Vec<String> = self.names().map(|name| format!("`{name}`")).collect();
            Error::input(format!(
                "`{}` has no field `{name}`; it has {}",
                self.name,
                names.join(", ")
            ))
        })
    }

    fn value(&self, record: usize, field: Field, i: usize) -> &[u8] {
        let start = record * self.size + field.offset + i * field.value.size();
        self.bytes
            .get(start..start + field.value.size())
            .unwrap_or_default()
    }

    /// Value `i` of a field of numbers; NaN of a field of texts.
    pub fn number(&self, record: usize, field: Field, i: usize) -> f64 {
        match field.value {
            Value::Number(scalar) => scalar.number(self.value(record, field, i)),
            Value::Text(_) => f64::NAN,
        }
    }

    /// Value `i` of a field as text; nothing for NaN.
    pub fn text(&self, record: usize, field: Field, i: usize) -> String {
        match field.value {
            Value::Number(_) => number_text(self.number(record, field, i)),
            Value::Text(_) => {
                let bytes = self.value(record, field, i);
                let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
                String::from_utf8_lossy(&bytes[..end]).into_owned()
            }
        }
    }
}
