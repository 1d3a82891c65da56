//! What a chunk unpacks to, looked at before it is unpacked: the library makes room for what its
//! bytes declare.

use std::io::Read;

use serde_json::Value;

use crate::error::{Error, Result};

/// How bytes are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Packed {
    packing: Packing,
    /// Bytes of a checksum behind them.
    checksum: usize,
}

impl Packed {
    /// How a list of codecs packs; None where it does not.
    ///
    /// # Errors
    /// When it packs twice.
    fn of(codecs: &[&Value]) -> Result<Option<Self>> {
        let names = || codecs.iter().filter_map(|codec| name(codec));
        let found: Vec<Packing> = names().filter_map(Packing::of).collect();
        let checksum = if names().next_back() == Some("crc32c") {
            4
        } else {
            0
        };
        match found[..] {
            [] => Ok(None),
            [packing] => Ok(Some(Self { packing, checksum })),
            _ => Err(Error::input(
                "its chunks are packed twice, which is not read",
            )),
        }
    }

    fn fits(self, bytes: &[u8], most: u64) -> bool {
        let packed = bytes.len().checked_sub(self.checksum);
        packed.is_some_and(|length| self.packing.fits(&bytes[..length], most))
    }
}

/// A way to pack bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packing {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
}

impl Packing {
    fn of(name: &str) -> Option<Self> {
        Some(match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "gzip" => Self::Gzip,
            "zlib" => Self::Zlib,
            "zstd" => Self::Zstd,
            "blosc" => Self::Blosc,
            _ => return None,
        })
    }

    /// Whether `bytes` unpack to `most` bytes at most.
    fn fits(self, bytes: &[u8], most: u64) -> bool {
        match self {
            Self::Gzip => ends(flate2::read::GzDecoder::new(bytes), most),
            Self::Zlib => ends(flate2::read::ZlibDecoder::new(bytes), most),
            Self::Zstd => zstd_size(bytes).is_some_and(|size| size <= most.next_multiple_of(BLOCK)),
            // Bytes 4 to 7 of its header.
            Self::Blosc => {
                let size = bytes.get(4..8).and_then(|size| size.try_into().ok());
                bytes.len() >= 16
                    && size.is_some_and(|size| u64::from(u32::from_le_bytes(size)) <= most)
            }
        }
    }
}

/// Whether a reader ends after `most` bytes; one that fails ends there.
fn ends(reader: impl Read, most: u64) -> bool {
    let read = std::io::copy(
        &mut reader.take(most.saturating_add(1)),
        &mut std::io::sink(),
    );
    read.is_ok_and(|bytes| bytes <= most)
}

/// What a block of Zstandard unpacks to at most.
const BLOCK: u64 = 128 << 10;

/// The bytes that the library makes room for to unpack frames of Zstandard: what they declare, or
/// as much as so many blocks can be. None where they are no such frames.
fn zstd_size(mut bytes: &[u8]) -> Option<u64> {
    fn take<'a>(bytes: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = bytes.split_at_checked(count)?;
        *bytes = rest;
        Some(taken)
    }
    fn number(bytes: &[u8]) -> u64 {
        let digits = bytes.iter().rev();
        digits.fold(0, |number, byte| number << 8 | u64::from(*byte))
    }
    let mut all = 0_u64;
    while !bytes.is_empty() {
        let magic = number(take(&mut bytes, 4)?);
        if magic & 0xffff_fff0 == 0x184d_2a50 {
            let skipped = number(take(&mut bytes, 4)?);
            take(&mut bytes, skipped as usize)?;
            continue;
        }
        if magic != 0xfd2f_b528 {
            return None;
        }
        let descriptor = take(&mut bytes, 1)?[0];
        let is_single = descriptor & 0x20 != 0;
        take(&mut bytes, usize::from(!is_single))?;
        take(&mut bytes, [0, 1, 2, 4][usize::from(descriptor & 3)])?;
        let digits = match descriptor >> 6 {
            0 => usize::from(is_single),
            flag => 1 << flag,
        };
        let declared = number(take(&mut bytes, digits)?) + if digits == 2 { 256 } else { 0 };
        let mut of_blocks = 0_u64;
        loop {
            let head = number(take(&mut bytes, 3)?);
            let size = head >> 3;
            let stored = match head >> 1 & 3 {
                0 | 2 => size,
                // A byte that is repeated.
                1 => 1,
                _ => return None,
            };
            take(&mut bytes, stored as usize)?;
            of_blocks += BLOCK;
            if head & 1 == 1 {
                break;
            }
        }
        // A checksum.
        take(&mut bytes, if descriptor & 4 == 4 { 4 } else { 0 })?;
        all = all.saturating_add(if digits == 0 { of_blocks } else { declared });
    }
    Some(all)
}

/// What is known of the chunks of an array.
pub struct Guard {
    packed: Option<Packed>,
    shards: Option<Shards>,
    /// Bytes that a chunk has unpacked.
    size: u64,
}

/// Chunks within chunks.
struct Shards {
    /// How many there are in one.
    count: u64,
    /// Bytes of one unpacked.
    size: u64,
    packed: Option<Packed>,
    is_index_first: bool,
    /// Bytes of the checksum behind the index.
    checksum: u64,
}

impl Guard {
    /// Of an array by its description, version 2 or 3; `item` is the bytes of an element, 0 where
    /// elements have no size of their own.
    ///
    /// # Errors
    /// When its chunks are packed in a way that is not read, or are larger than `most` bytes.
    pub fn of(description: &Value, item: u64, most: u64) -> Result<Self> {
        let chunk = match description.get("chunks") {
            Some(chunks) => chunks,
            None => &description["chunk_grid"]["configuration"]["chunk_shape"],
        };
        let size = if item == 0 {
            Some(most)
        } else {
            bytes_of(chunk, item)
        };
        let size = size.filter(|size| *size <= most).ok_or_else(|| {
            Error::input(format!(
                "its chunks have shape {chunk}, which is more than {most} bytes; is the file \
                 damaged?"
            ))
        })?;
        // Version 2 has filters and a compressor, version 3 codecs.
        let lists = ["filters", "codecs"].map(|key| elements(&description[key]));
        let codecs: Vec<&Value> = lists
            .into_iter()
            .flatten()
            .chain(description.get("compressor"))
            .collect();
        let sharding = codecs
            .iter()
            .find(|codec| name(codec) == Some("sharding_indexed"));
        let packed = Packed::of(&codecs)?;
        let shards = match sharding {
            Some(_) if packed.is_some() => {
                return Err(Error::input("its shards are packed, which is not read"));
            }
            Some(sharding) => Some(Shards::of(&sharding["configuration"], size, item)?),
            None => None,
        };
        Ok(Self {
            packed,
            shards,
            size,
        })
    }

    /// Checks the bytes of a chunk.
    ///
    /// # Errors
    /// When they unpack to more than a chunk.
    pub fn check(&self, bytes: &[u8]) -> Result<()> {
        let fits = match (&self.shards, self.packed) {
            (Some(shards), _) => shards.fit(bytes).unwrap_or(false),
            (None, Some(packed)) => packed.fits(bytes, self.size),
            (None, None) => true,
        };
        match fits {
            true => Ok(()),
            false => Err(Error::input(
                "a chunk does not unpack to its size; is the file damaged?",
            )),
        }
    }
}

impl Shards {
    fn of(sharding: &Value, outer: u64, item: u64) -> Result<Self> {
        let inner = bytes_of(&sharding["chunk_shape"], item).filter(|size| *size > 0);
        let size = inner.ok_or_else(|| Error::input("its shards have no shape of chunks"))?;
        let codecs = |key: &str| elements(&sharding[key]).collect::<Vec<_>>();
        let is_known = |codec: &&Value| matches!(name(codec), Some("bytes" | "crc32c"));
        if !codecs("index_codecs").iter().all(is_known) {
            return Err(Error::input(
                "the index of its shards is packed, which is not read",
            ));
        }
        if codecs("codecs")
            .iter()
            .any(|codec| name(codec) == Some("sharding_indexed"))
        {
            return Err(Error::input("its shards hold shards, which are not read"));
        }
        let has_checksum = codecs("index_codecs")
            .iter()
            .any(|c| name(c) == Some("crc32c"));
        Ok(Self {
            count: outer / size,
            size,
            packed: Packed::of(&codecs("codecs"))?,
            is_index_first: sharding["index_location"] == "start",
            checksum: if has_checksum { 4 } else { 0 },
        })
    }

    /// Whether every chunk unpacks to its size; None where one lies outside.
    fn fit(&self, bytes: &[u8]) -> Option<bool> {
        let length =
            usize::try_from(self.count.checked_mul(16)?.checked_add(self.checksum)?).ok()?;
        let start = match self.is_index_first {
            true => 0,
            false => bytes.len().checked_sub(length)?,
        };
        let index = bytes.get(start..)?.get(..length - self.checksum as usize)?;
        let number = |bytes: &[u8]| {
            bytes
                .iter()
                .rev()
                .fold(0, |n: u64, b| n << 8 | u64::from(*b))
        };
        for place in index.chunks_exact(16) {
            let [start, size] = [number(&place[..8]), number(&place[8..])];
            // None is there.
            if start == u64::MAX && size == u64::MAX {
                continue;
            }
            let chunk = bytes.get(usize::try_from(start).ok()?..)?;
            let chunk = chunk.get(..usize::try_from(size).ok()?)?;
            if self
                .packed
                .is_some_and(|packed| !packed.fits(chunk, self.size))
            {
                return Some(false);
            }
        }
        Some(true)
    }
}

/// The name of a codec.
fn name(codec: &Value) -> Option<&str> {
    let name = codec.get("name").or_else(|| codec.get("id"));
    name.unwrap_or(codec).as_str()
}

/// The elements of a list; none of anything else.
fn elements(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// The bytes of an array of this shape.
fn bytes_of(shape: &Value, item: u64) -> Option<u64> {
    let mut sides = shape.as_array()?.iter();
    sides.try_fold(item, |bytes, side| bytes.checked_mul(side.as_u64()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A frame of Zstandard with one block that repeats a byte.
    fn repeated(descriptor: u8, declared: &[u8], times: u32) -> Vec<u8> {
        let head = (times << 3 | 1 << 1 | 1).to_le_bytes();
        let window: &[u8] = if descriptor & 0x20 == 0 { &[0] } else { &[] };
        [
            &[0x28, 0xb5, 0x2f, 0xfd, descriptor][..],
            window,
            declared,
            &head[..3],
            b"a",
        ]
        .concat()
    }

    #[test]
    fn what_zstandard_unpacks_to_is_in_its_headers() {
        assert_eq!(zstd_size(&repeated(0x20, &[100], 100)), Some(100));
        assert_eq!(zstd_size(&repeated(0x60, &[0, 1], 512)), Some(512));
        assert_eq!(zstd_size(&repeated(0, &[], 5)), Some(BLOCK));
        let two = [repeated(0x20, &[5], 5), repeated(0, &[], 6)].concat();
        assert_eq!(zstd_size(&two), Some(BLOCK + 5));
        assert_eq!(zstd_size(&two[..two.len() - 1]), None);
        assert_eq!(zstd_size(b"gzip"), None);
    }

    #[test]
    fn a_chunk_that_declares_more_than_its_size_is_refused() {
        let array = |id: &str| json!({"chunks": [5, 2], "compressor": {"id": id}});
        let guard = |id: &str| Guard::of(&array(id), 8, 1 << 20).expect("a guard");
        assert!(guard("zstd").check(&repeated(0, &[], 80)).is_ok());
        let two = [repeated(0, &[], 40), repeated(0, &[], 40)].concat();
        assert!(guard("zstd").check(&two).is_err());
        assert!(guard("zstd").check(&repeated(0x60, &[0, 255], 80)).is_ok());
        assert!(
            guard("zstd")
                .check(&repeated(0xa0, &[0, 0, 0, 255], 80))
                .is_err()
        );
        let blosc = |size: u32| [&[2, 1, 0, 8][..], &size.to_le_bytes(), &[0; 8]].concat();
        assert!(guard("blosc").check(&blosc(80)).is_ok());
        assert!(guard("blosc").check(&blosc(1 << 31)).is_err());
        let error = Guard::of(&array("zstd"), 8, 79).err().expect("too large");
        assert!(error.to_string().contains("shape [5,2]"), "{error}");
    }
}
