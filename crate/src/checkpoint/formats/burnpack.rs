//! burn's `.bpk`: a header of ten bytes, a description in CBOR, then the tensors, aligned.

use std::collections::BTreeMap;

use minicbor::data::Type;
use minicbor::decode::Error as CborError;
use minicbor::{Decoder, Encoder};

use super::choice::{Choice, Wanted};
use super::contents::Contents;
use super::element::{Element, count, is_counter};
use crate::checkpoint::Tensor;
use crate::error::{Error, Result};

/// "BURN" as a little-endian number.
pub const MAGIC: &[u8] = b"NRUB";
const VERSION: u16 = 1;
/// Magic, version (u16) and size of the description (u32).
const HEADER: usize = 10;
/// Tensors, and the first byte after the description, start at multiples of it.
const ALIGNMENT: usize = 256;

/// What the file says about a tensor.
#[derive(Default)]
struct Entry<'a> {
    /// Empty for types that need more than a name, such as quantised ones.
    dtype: &'a str,
    shape: Vec<usize>,
    /// From the start of the data.
    start: usize,
    end: usize,
}

pub fn read(bytes: &[u8], wanted: Wanted) -> Result<Contents> {
    let damaged = |what: &dyn std::fmt::Display| {
        Error::input(format!(
            "not a complete .bpk file ({} bytes: {what}); was the download or the copy cut short?",
            bytes.len()
        ))
    };
    let Some(&[_, _, _, _, a, b, c, d, e, f]) = bytes.first_chunk::<HEADER>() else {
        return Err(damaged(&"the header is cut"));
    };
    let version = u16::from_le_bytes([a, b]);
    if version > VERSION {
        return Err(Error::input(format!(
            "a .bpk file of version {version}; expected at most {VERSION}: save it with burn 0.22"
        )));
    }
    let end = HEADER.saturating_add(u32::from_le_bytes([c, d, e, f]) as usize);
    let description = bytes
        .get(HEADER..end)
        .ok_or_else(|| damaged(&"the description is cut"))?;
    let (entries, metadata) = describe(description)
        .map_err(|_| damaged(&"the description is not CBOR as burn writes it"))?;
    let data = bytes
        .get(end.next_multiple_of(ALIGNMENT)..)
        .unwrap_or_default();
    let choice = Choice::of(entries.keys().copied(), wanted)?;
    let (mut tensors, mut left_out) = (BTreeMap::new(), BTreeMap::new());
    for (name, entry) in entries {
        let Some(name) = choice.name(name) else {
            continue;
        };
        let element = match entry.dtype {
            "F64" => Element::F64,
            "F32" | "Flex32" => Element::F32,
            "F16" => Element::F16,
            "BF16" => Element::Bf16,
            _ if is_counter(name) => continue,
            other => {
                let what = if other.is_empty() {
                    "quantised or boolean"
                } else {
                    other
                };
                left_out.insert(name.to_owned(), what.to_owned());
                continue;
            }
        };
        let stored = data
            .get(entry.start..entry.end)
            .ok_or_else(|| damaged(&format_args!("tensor `{name}` is cut")))?;
        if count(&entry.shape).and_then(|n| n.checked_mul(element.size())) != Some(stored.len()) {
            return Err(Error::input(format!(
                "tensor `{name}` has {} bytes for shape {:?} of {}; the file is damaged",
                stored.len(),
                entry.shape,
                entry.dtype
            )));
        }
        let data = element.floats(stored);
        let shape = entry.shape;
        tensors.insert(name.to_owned(), Tensor { shape, data });
    }
    let contents = Contents {
        tensors,
        metadata,
        left_out,
    };
    Ok(contents.chosen(&choice))
}

type Described<'a> = (BTreeMap<&'a str, Entry<'a>>, BTreeMap<String, String>);

fn describe(description: &[u8]) -> Result<Described<'_>, CborError> {
    let mut cbor = Decoder::new(description);
    let (mut tensors, mut metadata) = (BTreeMap::new(), BTreeMap::new());
    fields(&mut cbor, |cbor, key| match key {
        "tensors" => fields(cbor, |cbor, name| {
            tensors.insert(name, entry(cbor)?);
            Ok(())
        }),
        "metadata" => fields(cbor, |cbor, key| {
            metadata.insert(key.to_owned(), cbor.str()?.to_owned());
            Ok(())
        }),
        _ => cbor.skip(),
    })?;
    Ok((tensors, metadata))
}

fn entry<'a>(cbor: &mut Decoder<'a>) -> Result<Entry<'a>, CborError> {
    let mut entry = Entry::default();
    fields(cbor, |cbor, key| {
        match key {
            "dtype" if cbor.datatype()? == Type::String => entry.dtype = cbor.str()?,
            "shape" => entry.shape = sizes(cbor)?,
            "data_offsets" => match sizes(cbor)?[..] {
                [start, end] => (entry.start, entry.end) = (start, end),
                _ => return Err(CborError::message("data_offsets are not two numbers")),
            },
            _ => cbor.skip()?,
        }
        Ok(())
    })?;
    Ok(entry)
}

/// Calls `each` with the decoder at the value of every key of a map.
fn fields<'a>(
    cbor: &mut Decoder<'a>,
    mut each: impl FnMut(&mut Decoder<'a>, &'a str) -> Result<(), CborError>,
) -> Result<(), CborError> {
    let Some(count) = cbor.map()? else {
        return Err(CborError::message("a map of unknown length"));
    };
    for _ in 0..count {
        let key = cbor.str()?;
        each(cbor, key)?;
    }
    Ok(())
}

fn sizes(cbor: &mut Decoder<'_>) -> Result<Vec<usize>, CborError> {
    cbor.array_iter::<u64>()?
        .map(|size| {
            usize::try_from(size?).map_err(|_| CborError::message("a size beyond this machine's"))
        })
        .collect()
}

pub fn write(contents: &Contents) -> Result<Vec<u8>> {
    let mut ranges = Vec::with_capacity(contents.tensors.len());
    let mut end = 0usize;
    for tensor in contents.tensors.values() {
        let start = end.next_multiple_of(ALIGNMENT);
        end = start + 4 * tensor.data.len();
        ranges.push((start, end));
    }
    let mut description = Vec::new();
    encode(contents, &ranges, &mut Encoder::new(&mut description))
        .map_err(|e| Error::input(format!("the checkpoint cannot be written: {e}")))?;
    let size = u32::try_from(description.len()).map_err(|_| {
        Error::input(
            "the checkpoint cannot be written: its description is longer than a .bpk file can hold",
        )
    })?;
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(size.to_le_bytes());
    bytes.extend(description);
    let data = bytes.len().next_multiple_of(ALIGNMENT);
    for (tensor, (start, _)) in contents.tensors.values().zip(ranges) {
        bytes.resize(data + start, 0);
        bytes.extend(tensor.to_le_bytes());
    }
    Ok(bytes)
}

type EncodeError = minicbor::encode::Error<std::convert::Infallible>;

fn encode(
    contents: &Contents,
    ranges: &[(usize, usize)],
    cbor: &mut Encoder<&mut Vec<u8>>,
) -> Result<(), EncodeError> {
    cbor.map(2)?
        .str("tensors")?
        .map(contents.tensors.len() as u64)?;
    for ((name, tensor), (start, end)) in contents.tensors.iter().zip(ranges) {
        cbor.str(name)?
            .map(3)?
            .str("dtype")?
            .str("F32")?
            .str("shape")?;
        cbor.array(tensor.shape.len() as u64)?;
        for side in &tensor.shape {
            cbor.u64(*side as u64)?;
        }
        cbor.str("data_offsets")?
            .array(2)?
            .u64(*start as u64)?
            .u64(*end as u64)?;
    }
    cbor.str("metadata")?.map(contents.metadata.len() as u64)?;
    for (key, value) in &contents.metadata {
        cbor.str(key)?.str(value)?;
    }
    Ok(())
}
