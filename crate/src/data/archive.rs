//! What is in a ZIP archive, from its end: the archive itself need not be in memory.

use std::cell::Cell;
use std::io;

use rawzip::{CompressionMethod, ErrorKind, ReaderAt, ZipArchive};
use serde::Serialize;

use super::archive_name::decoded;
use crate::error::{Error, Result};

/// The first bytes of a ZIP archive that is not empty.
pub const ZIP_MAGIC: &[u8; 4] = b"PK\x03\x04";

/// The largest number of entries of an archive.
pub const MAX_ENTRIES: u64 = 200_000;

/// The largest size of an unpacked entry, in bytes.
pub const MAX_ENTRY: u64 = 8 << 30;

/// How many times its packed size an entry may unpack to, where that is more than [`RATIO_FROM`].
pub const MAX_RATIO: u64 = 400;

/// Entries of at most so many bytes unpacked may be packed however well.
pub const RATIO_FROM: u64 = 64 << 20;

/// The largest directory of an archive, in bytes; more than [`MAX_ENTRIES`] entries with long names
/// need.
const MAX_DIRECTORY: u64 = 64 << 20;

/// Bytes from the end that hold the whole directory of most archives.
pub const TAIL: u64 = 256 << 10;

/// A file in an archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ArchiveEntry {
    /// Its path in the archive, `/` between the parts.
    pub path: String,
    /// Where its local header begins.
    pub offset: u64,
    /// The bytes it takes in the archive, without headers.
    pub packed: u64,
    /// The bytes it unpacks to.
    pub size: u64,
    /// Whether it is packed, by DEFLATE; otherwise it is stored as it is.
    pub deflated: bool,
    /// The checksum of the unpacked bytes.
    pub crc32: u32,
    /// Why it cannot be unpacked; empty otherwise.
    pub problem: String,
}

/// The directory of a ZIP archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ArchiveIndex {
    /// The files, in the order of the directory.
    Entries(Vec<ArchiveEntry>),
    /// The directory begins before what was given; it takes the bytes from here to the end.
    Needs(u64),
}

/// The end of an archive; what is asked for before it is remembered.
struct Tail<'a> {
    bytes: &'a [u8],
    start: u64,
    missing: Cell<Option<u64>>,
}

impl ReaderAt for &Tail<'_> {
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
        let Some(from) = offset.checked_sub(self.start) else {
            self.missing
                .set(Some(self.missing.get().map_or(offset, |m| m.min(offset))));
            return Err(io::ErrorKind::UnexpectedEof.into());
        };
        let there = self.bytes.get(from as usize..).unwrap_or_default();
        let count = there.len().min(buffer.len());
        buffer[..count].copy_from_slice(&there[..count]);
        Ok(count)
    }
}

impl ArchiveIndex {
    /// Reads the directory of an archive of `size` bytes from the last ones, `tail`. [`TAIL`] bytes
    /// are enough for most, and are what is asked for when there are none; otherwise the answer is
    /// how many more are needed.
    ///
    /// An entry that cannot be unpacked (encrypted, packed by another method than DEFLATE, or
    /// beyond [`MAX_ENTRY`] or [`MAX_RATIO`]) is listed with its problem.
    ///
    /// # Errors
    /// When the directory is missing or damaged, has more than [`MAX_ENTRIES`] entries, or entries
    /// share bytes of the archive, which is how small archives unpack to enormous ones.
    pub fn read(tail: &[u8], size: u64) -> Result<Self> {
        if tail.is_empty() && size > 0 {
            return Ok(Self::Needs(size.saturating_sub(TAIL)));
        }
        let tail = Tail {
            bytes: tail,
            start: size.saturating_sub(tail.len() as u64),
            missing: Cell::new(None),
        };
        let failed = |error: &rawzip::Error| match tail.missing.get() {
            Some(start) if size - start <= MAX_DIRECTORY => Ok(Self::Needs(start)),
            Some(start) => Err(Error::input(format!(
                "the directory of the ZIP archive has {} MB; expected at most {} MB",
                (size - start) >> 20,
                MAX_DIRECTORY >> 20
            ))),
            None => Err(broken(error)),
        };
        let mut buffer = vec![0; rawzip::MAX_CENTRAL_DIRECTORY_RECORD_SIZE];
        let archive: ZipArchive<&Tail> = match ZipArchive::with_max_search_space(1 << 17)
            .locate_in_reader(&tail, &mut buffer, size)
        {
            Ok(archive) => archive,
            Err((_, error)) => return failed(&error),
        };
        if archive.entries_hint() > MAX_ENTRIES {
            return Err(too_many(archive.entries_hint()));
        }
        let mut found = Vec::new();
        let mut entries = archive.entries(&mut buffer);
        loop {
            match entries.next_entry() {
                Ok(Some(entry)) if entry.is_dir() => {}
                Ok(Some(entry)) => {
                    found.push(ArchiveEntry::new(&entry));
                    if found.len() as u64 > MAX_ENTRIES {
                        return Err(too_many(found.len() as u64));
                    }
                }
                Ok(None) => break,
                Err(error) => return failed(&error),
            }
        }
        check_places(&found, size)?;
        Ok(Self::Entries(found))
    }
}

impl ArchiveEntry {
    fn new(entry: &rawzip::ZipFileHeaderRecord) -> Self {
        let path =
            decoded(entry.file_path().as_bytes(), entry.flags().is_utf8()).replace('\\', "/");
        let (packed, size) = (entry.compressed_size_hint(), entry.uncompressed_size_hint());
        let method = entry.compression_method();
        let problem = if entry.flags().is_encrypted() {
            "it is encrypted; expected an archive without a password".to_owned()
        } else if ![CompressionMethod::STORE, CompressionMethod::DEFLATE].contains(&method) {
            format!(
                "it is packed by {method:?}; expected DEFLATE or no packing, as most programs do"
            )
        } else if size > MAX_ENTRY {
            format!(
                "it unpacks to {} GB; expected at most {} GB",
                size >> 30,
                MAX_ENTRY >> 30
            )
        } else if size > RATIO_FROM && size / MAX_RATIO > packed {
            format!(
                "it unpacks to {} MB, {} times its packed size, as a ZIP bomb does; expected at most {MAX_RATIO} times",
                size >> 20,
                size / packed.max(1)
            )
        } else {
            String::new()
        };
        Self {
            path: path.trim_start_matches('/').to_owned(),
            offset: entry.local_header_offset(),
            packed,
            size,
            deflated: method == CompressionMethod::DEFLATE,
            crc32: entry.crc32(),
            problem,
        }
    }
}

/// No two entries share bytes, and none lies beyond the end.
fn check_places(entries: &[ArchiveEntry], size: u64) -> Result<()> {
    let mut places: Vec<&ArchiveEntry> = entries.iter().collect();
    places.sort_by_key(|entry| entry.offset);
    for (i, entry) in places.iter().enumerate() {
        let end = entry.offset.saturating_add(entry.packed);
        let limit = places.get(i + 1).map_or(size, |next| next.offset);
        if end > limit {
            return Err(Error::input(match places.get(i + 1) {
                Some(next) => format!(
                    "the entries `{}` and `{}` of the ZIP archive share bytes, as in a ZIP bomb; expected every entry in a \
                     place of its own",
                    entry.path, next.path
                ),
                None => format!(
                    "the entry `{}` lies beyond the end of the ZIP archive; is the file complete?",
                    entry.path
                ),
            }));
        }
    }
    Ok(())
}

fn too_many(entries: u64) -> Error {
    Error::input(format!(
        "the ZIP archive has {entries} entries; expected at most {MAX_ENTRIES}"
    ))
}

fn broken(error: &rawzip::Error) -> Error {
    let what = match error.kind() {
        ErrorKind::MissingEndOfCentralDirectory => {
            "its directory, at the end, is missing".to_owned()
        }
        _ => error.to_string(),
    };
    Error::input(format!(
        "not a whole ZIP archive ({what}); was it cut short?"
    ))
}
