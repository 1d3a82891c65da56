//! NPZ files: numpy arrays (`.npy`) in a ZIP archive, read and written.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek, SeekFrom, Write};
use std::sync::{Mutex, PoisonError};

use zip::read::ZipFile;
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::arrays::{ArrayFile, ArrayInfo, Values, Y_FIRST};
use super::npy::{self, Header, NpyArray, damaged};
use super::points;
use super::reading::{AxisOrder, Parsed, TableOptions};
use super::recording::Recording;
use crate::error::{Error, ErrorKind, Result};
use crate::memory;
use crate::track::{GroundTruth, KeypointTrack};

impl Recording {
    /// Frames, and points if there are any, of an NPZ file; `array` names the array of frames, where
    /// it is another one than `images` or `frames`.
    ///
    /// `np.savez` stores arrays as they are: frames are then read one by one from the file.
    /// `np.savez_compressed` packs them: they are unpacked into memory as a whole.
    ///
    /// # Errors
    /// When the file is no whole NPZ file, or its arrays do not hold frames and points; the message
    /// names the array.
    pub fn from_npz(
        reader: impl Read + Seek + Send + 'static,
        array: Option<&str>,
        options: &TableOptions,
    ) -> Result<Self> {
        Self::new(Box::new(Npz::open(reader, array)?), array, options)
    }

    /// As [`Recording::from_npz`], from the arrays of a file that is not in memory. Frames are not
    /// read through it then: [`Recording::frame_place`] says where they lie.
    ///
    /// # Errors
    /// As [`Recording::from_npz`].
    pub fn from_arrays(arrays: Vec<NpyArray>, options: &TableOptions) -> Result<Self> {
        Self::new(Box::new(Npz::of(arrays)?), None, options)
    }
}

/// Parses a ground truth from the array `keypoints` or `sites` of an NPZ file; an array `names`
/// names the objects. `name` is the file's, for messages.
///
/// # Errors
/// When there is no such array or it does not hold points; the message gives its shape and type.
pub fn parse_npz_ground_truth(
    bytes: &[u8],
    name: &str,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    Npz::open(Cursor::new(bytes), None)
        .and_then(|file| points::ground_truth(&file, options))
        .map_err(|e| e.at(name))
}

/// Parses keypoints of a detector, as [`parse_npz_ground_truth`].
///
/// # Errors
/// As [`parse_npz_ground_truth`].
pub fn parse_npz_keypoints(
    bytes: &[u8],
    name: &str,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    Npz::open(Cursor::new(bytes), None)
        .and_then(|file| points::keypoints(&file, options))
        .map_err(|e| e.at(name))
}

/// Parses a ground truth from arrays, as [`parse_npz_ground_truth`].
///
/// # Errors
/// As [`parse_npz_ground_truth`].
pub fn ground_truth_of_arrays(
    arrays: Vec<NpyArray>,
    options: &TableOptions,
) -> Result<Parsed<GroundTruth>> {
    points::ground_truth(&Npz::of(arrays)?, options)
}

/// Parses keypoints from arrays, as [`parse_npz_keypoints`].
///
/// # Errors
/// As [`parse_npz_keypoints`].
pub fn keypoints_of_arrays(
    arrays: Vec<NpyArray>,
    options: &TableOptions,
) -> Result<Parsed<KeypointTrack>> {
    points::keypoints(&Npz::of(arrays)?, options)
}

/// An NPZ file, whose elements lie in `A` where they are not in memory.
struct Npz<A> {
    archive: A,
    /// Arrays of frames, of points and of their names.
    arrays: BTreeMap<String, Member>,
    /// The names of other arrays.
    unused: Vec<String>,
    /// Arrays that are not needed and cannot be read, and why.
    left_out: Vec<String>,
}

/// Where elements lie that are not in memory.
trait Archive: Send + Sync {
    /// `length` bytes of an entry as it is, from `start`.
    fn read(&self, position: usize, start: u64, length: u64) -> Result<Vec<u8>>;

    /// Reads an entry from its beginning to its end and compares its checksum.
    fn verify(&self, position: usize) -> Result<()>;
}

impl<R: Read + Seek + Send> Archive for Mutex<ZipArchive<R>> {
    fn read(&self, position: usize, start: u64, length: u64) -> Result<Vec<u8>> {
        // A thread that panicked while it held the archive left nothing half done: every read seeks
        // first.
        let mut archive = self.lock().unwrap_or_else(PoisonError::into_inner);
        let mut entry = archive.by_index_seek(position).map_err(|e| broken(&e))?;
        let mut bytes = vec![0; length as usize];
        entry
            .seek(SeekFrom::Start(start))
            .and_then(|_| entry.read_exact(&mut bytes))
            .map_err(|e| damaged(&e))?;
        Ok(bytes)
    }

    fn verify(&self, position: usize) -> Result<()> {
        let mut archive = self.lock().unwrap_or_else(PoisonError::into_inner);
        let mut entry = archive.by_index(position).map_err(|e| broken(&e))?;
        std::io::copy(&mut entry, &mut std::io::sink()).map_err(|e| damaged(&e))?;
        Ok(())
    }
}

/// Out of reach from here.
struct Elsewhere;

impl Archive for Elsewhere {
    fn read(&self, _: usize, _: u64, _: u64) -> Result<Vec<u8>> {
        Err(Error::input(
            "the array is not in memory; read it where it lies",
        ))
    }

    fn verify(&self, _: usize) -> Result<()> {
        Ok(())
    }
}

struct Member {
    header: Header,
    elements: Elements,
}

enum Elements {
    /// At this position in the archive, as they are.
    Archive(usize),
    /// Unpacked, where the archive holds them packed: a packed stream has no way into its middle.
    Memory(Vec<u8>),
}

impl<R: Read + Seek + Send> Npz<Mutex<ZipArchive<R>>> {
    /// Arrays that hold neither frames, those of `frames` among them, nor points are not looked into,
    /// whatever they unpack to.
    fn open(reader: R, frames: Option<&str>) -> Result<Self> {
        let mut archive = ZipArchive::new(reader).map_err(|e| broken(&e))?;
        let mut arrays = BTreeMap::new();
        let (mut unused, mut left_out) = (Vec::new(), Vec::new());
        for position in 0..archive.len() {
            let mut entry = archive.by_index(position).map_err(|e| broken(&e))?;
            let Some(name) = entry.name().strip_suffix(".npy").map(str::to_owned) else {
                continue;
            };
            let holds_frames = NpyArray::holds_frames(&name) || frames == Some(name.as_str());
            if !holds_frames && !NpyArray::is_needed_whole(&name) {
                unused.push(name);
                continue;
            }
            let placed = |e: Error| e.at(format!("`{name}`"));
            let header = match Header::read(&mut entry) {
                Ok(header) => header,
                // Without names, or how sure they are, points are read all the same.
                Err(e) if !holds_frames && !NpyArray::holds_points(&name) => {
                    left_out.push(placed(e).to_string());
                    unused.push(name);
                    continue;
                }
                Err(e) => return Err(placed(e)),
            };
            let member = Member::read(&name, header, position, entry).map_err(placed)?;
            arrays.insert(name, member);
        }
        Ok(Self {
            archive: Mutex::new(archive),
            arrays,
            unused,
            left_out,
        })
    }
}

impl Member {
    /// An array of an archive. Frames that are stored as they are stay there; everything else is
    /// read here, which checks its checksum.
    fn read<R: Read + Seek>(
        name: &str,
        header: Header,
        position: usize,
        entry: ZipFile<R>,
    ) -> Result<Self> {
        let bytes = header.check(name, entry.size())?;
        if entry.compression() == CompressionMethod::Stored && !NpyArray::is_needed_whole(name) {
            let elements = Elements::Archive(position);
            return Ok(Self { header, elements });
        }
        memory::check(
            bytes,
            "unpacked array",
            "save it with np.savez, whose arrays stay in the file",
        )?;
        let mut all = Vec::new();
        // One byte more than there should be: the checksum is compared at the end of the entry.
        let read = entry.take(bytes.saturating_add(1)).read_to_end(&mut all);
        read.map_err(|e| damaged(&e))?;
        if all.len() as u64 != bytes {
            let found = match all.len() as u64 > bytes {
                true => "more".to_owned(),
                false => all.len().to_string(),
            };
            return Err(Error::input(format!(
                "expected {bytes} bytes when unpacked, found {found}; is the file damaged?"
            )));
        }
        let elements = Elements::Memory(all);
        Ok(Self { header, elements })
    }
}

impl Npz<Elsewhere> {
    fn of(given: Vec<NpyArray>) -> Result<Self> {
        let mut arrays = BTreeMap::new();
        for (position, NpyArray { name, bytes, size }) in given.into_iter().enumerate() {
            let header = Header::read(&mut &*bytes).map_err(|e| e.at(format!("`{name}`")))?;
            header.check(&name, size)?;
            let elements = match bytes.len() as u64 == size {
                true => Elements::Memory(bytes[header.length as usize..].to_vec()),
                false => Elements::Archive(position),
            };
            arrays.insert(name, Member { header, elements });
        }
        Ok(Self {
            archive: Elsewhere,
            arrays,
            unused: Vec::new(),
            left_out: Vec::new(),
        })
    }
}

impl<A: Archive> Npz<A> {
    fn bytes(&self, name: &str, start: u64, length: u64) -> Result<Vec<u8>> {
        let member = &self.arrays[name];
        match &member.elements {
            Elements::Memory(all) => Ok(all[start as usize..(start + length) as usize].to_vec()),
            Elements::Archive(position) => {
                self.archive
                    .read(*position, member.header.length + start, length)
            }
        }
    }
}

impl<A: Archive> ArrayFile for Npz<A> {
    fn names(&self) -> Result<Vec<String>> {
        let mut names: Vec<String> = self.arrays.keys().chain(&self.unused).cloned().collect();
        names.sort_unstable();
        Ok(names)
    }

    fn info(&self, name: &str) -> Result<Option<ArrayInfo>> {
        Ok(self
            .arrays
            .get(name)
            .map(|Member { header, .. }| header.info()))
    }

    fn read(&self, name: &str, leading: &[u64]) -> Result<Values> {
        let header = &self.arrays[name].header;
        let (start, length) = header.part(leading);
        header.values(name, &self.bytes(name, start, length)?)
    }

    fn verify(&self, name: &str) -> Result<()> {
        match self.arrays.get(name).map(|member| &member.elements) {
            Some(Elements::Archive(position)) => self.archive.verify(*position),
            Some(Elements::Memory(_)) | None => Ok(()),
        }
    }

    fn place(&self, name: &str, leading: &[u64]) -> Option<(u64, u64)> {
        let header = &self.arrays.get(name)?.header;
        let (start, length) = header.part(leading);
        Some((header.length + start, length))
    }

    fn axes(&self) -> Option<AxisOrder> {
        let header = &self.arrays.get(Y_FIRST)?.header;
        let bytes = self.bytes(Y_FIRST, 0, header.item).ok()?;
        match bytes.first()? {
            0 => Some(AxisOrder::Xy),
            _ => Some(AxisOrder::Yx),
        }
    }

    fn left_out(&self) -> &[String] {
        &self.left_out
    }

    fn strings(&self, name: &str) -> Result<Vec<String>> {
        let Some(member) = self.arrays.get(name) else {
            return Err(Error::input(format!("there is no array `{name}`")));
        };
        let header = &member.header;
        // `<U6`: 6 code points of 4 bytes; `|S6`: 6 bytes.
        let unit = match header.dtype.get(..2) {
            Some("<U") => 4,
            Some("|S") => 1,
            _ => 0,
        };
        if unit == 0 || header.shape.len() != 1 || header.item == 0 {
            return Err(Error::input(format!(
                "`{name}` ({}, shape {:?}) is no list of names; expected strings, shape [K]",
                header.dtype, header.shape
            )));
        }
        let bytes = self.bytes(name, 0, header.shape[0] * header.item)?;
        let text = |bytes: &[u8]| {
            let code = |c: &[u8]| {
                c.iter()
                    .rev()
                    .fold(0, |code, byte| code << 8 | u32::from(*byte))
            };
            let text = bytes.chunks_exact(unit).map(code).take_while(|c| *c != 0);
            text.map(|c| char::from_u32(c).unwrap_or(char::REPLACEMENT_CHARACTER))
                .collect()
        };
        Ok(bytes.chunks_exact(header.item as usize).map(text).collect())
    }

    fn point_names(&self) -> Result<Option<Vec<String>>> {
        match self.arrays.contains_key("names") {
            true => self.strings("names").map(Some),
            false => Ok(None),
        }
    }
}

/// Writes arrays into an NPZ file, one after the other, without holding one in memory.
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// A file in `writer`.
    pub fn new(writer: W) -> Self {
        Self {
            zip: ZipWriter::new(writer),
        }
    }

    /// Begins an array of numpy type `dtype` (`|u1`, `<f4`); its elements follow through
    /// [`NpzWriter::write`].
    ///
    /// # Errors
    /// When writing fails.
    pub fn array(&mut self, name: &str, dtype: &str, shape: &[usize]) -> Result<()> {
        // Not packed: so frames can be read one by one. Zip64, for arrays beyond 4 GiB.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.zip
            .start_file(format!("{name}.npy"), options)
            .map_err(|e| Error::new(ErrorKind::Io, e.to_string()))?;
        self.write(&npy::header(dtype, shape))
    }

    /// Appends bytes to the array that was begun.
    ///
    /// # Errors
    /// When writing fails.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.zip
            .write_all(bytes)
            .map_err(|e| Error::new(ErrorKind::Io, e.to_string()))
    }

    /// A whole array of `<f8`.
    ///
    /// # Errors
    /// When writing fails.
    pub fn floats(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl Iterator<Item = f64>,
    ) -> Result<()> {
        self.array(name, "<f8", shape)?;
        self.write(&values.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
    }

    /// A whole array of strings.
    ///
    /// # Errors
    /// When writing fails.
    pub fn strings(&mut self, name: &str, values: &[String]) -> Result<()> {
        let (dtype, bytes) = npy::texts(values)?;
        self.array(name, &dtype, &[values.len()])?;
        self.write(&bytes)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// When writing fails.
    pub fn finish(self) -> Result<W> {
        self.zip
            .finish()
            .map_err(|e| Error::new(ErrorKind::Io, e.to_string()))
    }
}

fn broken(error: &ZipError) -> Error {
    Error::input(format!("not a whole NPZ file ({error}); was it cut short?"))
}
