//! What `torch.save` writes: a ZIP archive of stored entries, `…/data.pkl` with everything but the
//! values of the tensors, which are in `…/data/0` and so on.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::io::Write as _;

use rawzip::{
    CompressionMethod, ZipArchive, ZipArchiveEntryWayfinder, ZipArchiveWriter, ZipSliceArchive,
};

use serde_json::Value;

use super::choice::{Choice, WEIGHTS, Wanted};
use super::contents::Contents;
use super::element::{Element, count, is_counter};
use super::json::ToJson;
use crate::checkpoint::Tensor;
use crate::error::{Error, Result};
use crate::pickle::{Fault, Id, MOST_VALUES, Node, Pickle};

/// Entries saved with the weights that are of no use without the script.
const STATES: [&str; 3] = ["optimizer", "scheduler", "scaler"];
/// A pickle of a checkpoint has tens of kilobytes; this bounds the memory that a made-up one takes.
const LARGEST_PICKLE: usize = 16 << 20;
/// Dictionaries within each other, down to the weights.
const DEPTH: usize = 8;
/// The weights of a policy in the archive that Stable-Baselines3 saves.
const POLICY: &str = "policy.pth";

/// Whether the bytes begin as `torch.save` began them before 1.6: with a pickle of a magic number.
pub fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.")
}

/// The error of a pickle of `size` bytes.
fn unreadable(fault: Fault, size: usize) -> Error {
    Error::input(match fault {
        Fault::TooManyValues => format!(
            "the pickle has more than {MOST_VALUES} values besides the weights; save only model.state_dict()"
        ),
        Fault::At { position, code } => format!(
            "the pickle cannot be read at byte {position} of {size} (code 0x{code:02x}); the file is damaged or torch.save \
             did not write it"
        ),
    })
}

/// Reads the policy in an archive of Stable-Baselines3; `None` where it is none.
pub fn read_policy(bytes: &[u8], wanted: Wanted) -> Result<Option<Contents>> {
    if !bytes.starts_with(b"PK\x03\x04") {
        return Ok(None);
    }
    let Ok(archive) = Archive::open(bytes, |path| Some(path.to_owned())) else {
        return Ok(None);
    };
    if !archive.has(POLICY) {
        return Ok(None);
    }
    let policy = archive.entry(POLICY)?;
    read(policy, wanted).map(Some).map_err(|e| e.at(POLICY))
}

pub fn read(bytes: &[u8], wanted: Wanted) -> Result<Contents> {
    if is_legacy(bytes) {
        return Legacy::read(bytes)?.contents(wanted);
    }
    let archive = Archive::open(bytes, |path| {
        path.split_once('/').map(|(_, name)| name.to_owned())
    })?;
    if archive.has("byteorder") && archive.entry("byteorder")? != b"little" {
        return Err(Error::input(
            "saved on a big-endian machine; expected a little-endian file: save it again on another machine",
        ));
    }
    let stored = archive.entry("data.pkl")?;
    if stored.len() > LARGEST_PICKLE {
        return Err(Error::input(format!(
            "the pickle has {} bytes besides the weights; expected at most {LARGEST_PICKLE}: save only \
             model.state_dict()",
            stored.len()
        )));
    }
    let pickle = Pickle::read(stored).map_err(|fault| unreadable(fault, stored.len()))?;
    let storage = |key: &str| archive.entry(&format!("data/{key}"));
    contents(&pickle, wanted, bytes.len(), storage)
}

/// What PyTorch wrote before 1.6: pickles of a magic number, a version, the system and the object,
/// then one of the keys of the storages, and these one after the other.
struct Legacy<'a> {
    pickle: Pickle,
    storages: HashMap<String, &'a [u8]>,
    size: usize,
}

impl<'a> Legacy<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self> {
        let cut = || {
            Error::input(format!(
                "not a complete .pth file ({} bytes); was the download or the copy cut short?",
                bytes.len()
            ))
        };
        let mut rest = bytes;
        let mut next = || -> Result<Pickle> {
            if rest.is_empty() {
                return Err(cut());
            }
            let (pickle, length) =
                Pickle::read_first(rest).map_err(|fault| unreadable(fault, rest.len()))?;
            rest = &rest[length..];
            Ok(pickle)
        };
        for _ in ["magic number", "version", "system"] {
            next()?;
        }
        let pickle = next()?;
        let keys = next()?;
        let sizes: HashMap<String, usize> = pickle
            .persistent()
            .filter_map(|described| {
                let &[_, class, key, ..] = described else {
                    return None;
                };
                let Node::Global(class) = pickle.node(class) else {
                    return None;
                };
                Some((text_of(&pickle, key)?, size_of_element(class)?))
            })
            .collect();
        let mut storages = HashMap::new();
        for key in keys.items(keys.root()).ok_or_else(cut)? {
            let key = text_of(&keys, *key).ok_or_else(cut)?;
            let (number, after) = rest.split_first_chunk().ok_or_else(cut)?;
            let size = *sizes.get(&key).ok_or_else(|| {
                Error::input(format!(
                    "the storage `{key}` has elements of an unknown type; save it again with torch.save"
                ))
            })?;
            let length = usize::try_from(u64::from_le_bytes(*number)).ok();
            let length = length.and_then(|n| n.checked_mul(size)).ok_or_else(cut)?;
            let (stored, after) = after.split_at_checked(length).ok_or_else(cut)?;
            storages.insert(key, stored);
            rest = after;
        }
        Ok(Self {
            pickle,
            storages,
            size: bytes.len(),
        })
    }

    fn contents(&self, wanted: Wanted) -> Result<Contents> {
        let storage = |key: &str| {
            let missing = || {
                Error::input(format!(
                    "the storage `{key}` is missing; the file is damaged"
                ))
            };
            self.storages.get(key).copied().ok_or_else(missing)
        };
        contents(&self.pickle, wanted, self.size, storage)
    }
}

/// A text, or a number as text.
fn text_of(pickle: &Pickle, id: Id) -> Option<String> {
    match pickle.node(id) {
        Node::Text(text) => Some(text.clone()),
        Node::Int(number) => Some(number.to_string()),
        _ => None,
    }
}

/// Bytes of an element of a storage.
fn size_of_element(class: &str) -> Option<usize> {
    Some(
        match class.strip_prefix("torch.")?.strip_suffix("Storage")? {
            "ComplexDouble" => 16,
            "Double" | "Long" | "ComplexFloat" => 8,
            "Float" | "Int" => 4,
            "Half" | "BFloat16" | "Short" => 2,
            "Char" | "Byte" | "Bool" => 1,
            _ => return None,
        },
    )
}

/// The tensors that are wanted and what else the pickle says; `storage` gives the bytes under a key.
fn contents<'a>(
    pickle: &Pickle,
    wanted: Wanted,
    size: usize,
    storage: impl Fn(&str) -> Result<&'a [u8]>,
) -> Result<Contents> {
    let mut found = Found::in_all(pickle, size)?;
    if found.tensors.is_empty() {
        return Err(no_weights(pickle));
    }
    let names = found.tensors.iter().map(|(name, _)| name.as_str());
    let choice = Choice::of(names, wanted)?;
    if choice.is_everything() {
        found.keep_one_dictionary();
    }
    let mut contents = Contents::default();
    // Several tensors may lie in the same bytes, so that a small file could ask for any amount of
    // memory.
    let mut left = size.saturating_mul(8);
    // Each is checked against its sum once.
    let mut storages = HashMap::new();
    for (name, value) in &found.tensors {
        let Some(name) = choice.name(name).filter(|name| !is_counter(name)) else {
            continue;
        };
        let tensor = match View::of(pickle, *value, name)? {
            Ok(tensor) => tensor,
            Err(what) => {
                contents.left_out.insert(name.to_owned(), what);
                continue;
            }
        };
        let stored = match storages.entry(tensor.storage.clone()) {
            Entry::Occupied(stored) => *stored.get(),
            Entry::Vacant(place) => {
                let stored = storage(place.key());
                *place.insert(stored.map_err(|e| e.at(format_args!("tensor `{name}`")))?)
            }
        };
        let tensor = tensor.read(stored, name)?;
        left = left.checked_sub(4 * tensor.data.len()).ok_or_else(|| {
            Error::input(format!(
                "the tensors up to `{name}` are many times as large as the file; the file is damaged"
            ))
        })?;
        contents.tensors.insert(name.to_owned(), tensor);
    }
    if !found.is_in_root {
        let mut json = ToJson::new(pickle);
        for (key, value) in pickle.entries(pickle.root()) {
            let Some(name) = pickle.text(*key) else {
                continue;
            };
            let is_weights = found.roots.contains(name);
            if is_weights || STATES.iter().any(|state| name.contains(state)) {
                continue;
            }
            let text = match (pickle.node(*value), json.value(*value)?) {
                (_, None | Some(Value::Null)) => continue,
                (Node::Text(_), Some(Value::String(text))) => text,
                (_, Some(json)) => json.to_string(),
            };
            contents.metadata.insert(name.to_owned(), text);
        }
    }
    Ok(contents.chosen(&choice))
}

/// The tensors of a pickle in dictionaries within each other, by the keys down to them.
#[derive(Default)]
struct Found {
    tensors: Vec<(String, Id)>,
    /// Keys of the root that lead to tensors.
    roots: HashSet<String>,
    /// Whether the root itself holds tensors.
    is_in_root: bool,
}

impl Found {
    fn in_all(pickle: &Pickle, size: usize) -> Result<Self> {
        let root = pickle.root();
        if let Some(class) = pickle.class(root) {
            return Err(Error::input(format!(
                "a whole `{class}` rather than its weights; save model.state_dict() instead"
            )));
        }
        let mut found = Self::default();
        // A key may be long and lead to many tensors.
        let mut left = size.saturating_mul(16);
        let mut visited = HashSet::from([root]);
        let mut dictionaries = vec![(root, String::new(), 0)];
        while let Some((dictionary, path, depth)) = dictionaries.pop() {
            for (key, value) in pickle.entries(dictionary) {
                let Some(key) = text_of(pickle, *key) else {
                    continue;
                };
                let is_dictionary = !pickle.entries(*value).is_empty();
                let is_tensor = pickle.class(*value).is_some_and(is_tensor);
                if !is_dictionary && !is_tensor {
                    continue;
                }
                let name = match path.as_str() {
                    "" => key,
                    path => format!("{path}.{key}"),
                };
                left = left.checked_sub(name.len()).ok_or_else(|| {
                    Error::input("the names of the tensors are many times as large as the file")
                })?;
                if is_tensor {
                    found.is_in_root |= depth == 0;
                    let first = name.split('.').next().unwrap_or_default();
                    if depth > 0 && !found.roots.contains(first) {
                        found.roots.insert(first.to_owned());
                    }
                    found.tensors.push((name, *value));
                } else if depth < DEPTH && visited.insert(*value) {
                    dictionaries.push((*value, name, depth + 1));
                }
            }
        }
        Ok(found)
    }

    /// Keeps the tensors of the first dictionary that scripts save weights in, under the names they
    /// have in there; all tensors where there is none.
    fn keep_one_dictionary(&mut self) {
        let key = WEIGHTS.iter().find(|key| self.roots.contains(**key));
        let Some(key) = key else { return };
        let inside = |name: &str| name.strip_prefix(key)?.strip_prefix('.').map(str::to_owned);
        self.tensors = self
            .tensors
            .iter()
            .filter_map(|(name, id)| Some((inside(name)?, *id)))
            .collect();
    }
}

fn no_weights(pickle: &Pickle) -> Error {
    let keys: Vec<&str> = pickle
        .entries(pickle.root())
        .iter()
        .filter_map(|(key, _)| pickle.text(*key))
        .take(8)
        .collect();
    Error::input(format!(
        "no weights under `model_state_dict` (the file holds {}); expected a checkpoint of the authors' code or a \
         state dict",
        if keys.is_empty() {
            "no names".to_owned()
        } else {
            keys.join(", ")
        }
    ))
}

fn is_tensor(class: &str) -> bool {
    class.starts_with("torch._utils._rebuild_")
}

/// A tensor as the pickle describes it: a view of a storage.
struct View {
    /// Name of the storage's entry below `data/`.
    storage: String,
    element: Element,
    /// In elements, as are the strides.
    offset: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
}

impl View {
    /// The tensor that an object makes; what it is instead where it is not of floating-point numbers.
    fn of(pickle: &Pickle, id: Id, name: &str) -> Result<Result<Self, String>> {
        let made = |id: Id| match (pickle.node(id), pickle.class(id)) {
            (Node::Object { arguments, .. }, Some(class)) => Some((*arguments, class)),
            _ => None,
        };
        // A parameter is made of a tensor.
        let id = match made(id) {
            Some((arguments, "torch._utils._rebuild_parameter")) => pickle
                .items(arguments)
                .and_then(|items| items.first())
                .copied(),
            _ => Some(id),
        };
        let Some((arguments, class)) = id.and_then(made) else {
            return Ok(Err("no tensor".to_owned()));
        };
        if class != "torch._utils._rebuild_tensor_v2" {
            return Ok(Err(format!("made by `{class}`")));
        }
        let damaged = || {
            Error::input(format!(
                "tensor `{name}` is not described as torch.save does; the file is damaged"
            ))
        };
        let Some(&[storage, offset, shape, strides, ..]) = pickle.items(arguments) else {
            return Err(damaged());
        };
        let Node::Persistent(storage) = pickle.node(storage) else {
            return Err(damaged());
        };
        let Some(&[_, class, key, ..]) = pickle.items(*storage) else {
            return Err(damaged());
        };
        let Node::Global(class) = pickle.node(class) else {
            return Err(damaged());
        };
        let element = match class.as_str() {
            "torch.DoubleStorage" => Element::F64,
            "torch.FloatStorage" => Element::F32,
            "torch.HalfStorage" => Element::F16,
            "torch.BFloat16Storage" => Element::Bf16,
            other => return Ok(Err(format!("in a `{other}`"))),
        };
        let sizes = |list: Id| -> Option<Vec<usize>> {
            pickle
                .items(list)?
                .iter()
                .map(|size| pickle.size(*size))
                .collect()
        };
        let (shape, strides) = sizes(shape).zip(sizes(strides)).ok_or_else(damaged)?;
        if shape.len() != strides.len() || shape.len() > 8 {
            return Err(damaged());
        }
        Ok(Ok(Self {
            storage: text_of(pickle, key).ok_or_else(damaged)?,
            element,
            offset: pickle.size(offset).ok_or_else(damaged)?,
            shape,
            strides,
        }))
    }

    fn read(self, stored: &[u8], name: &str) -> Result<Tensor> {
        let size = self.element.size();
        let available = stored.len() / size;
        let outside = || {
            Error::input(format!(
                "tensor `{name}` with shape {:?} reaches beyond its {available} stored values; the file is damaged",
                self.shape
            ))
        };
        let number = count(&self.shape)
            .filter(|n| *n <= available)
            .ok_or_else(outside)?;
        let data = match self.is_contiguous() {
            true => {
                let end = self
                    .offset
                    .checked_add(number)
                    .filter(|end| *end <= available)
                    .ok_or_else(outside)?;
                self.element.floats(&stored[self.offset * size..end * size])
            }
            false => self.gather(stored, number).ok_or_else(outside)?,
        };
        let shape = self.shape;
        Ok(Tensor { shape, data })
    }
}

impl View {
    fn is_contiguous(&self) -> bool {
        strides(&self.shape) == self.strides
    }

    /// `number` values in row-major order; `None` when one lies outside.
    fn gather(&self, stored: &[u8], number: usize) -> Option<Vec<f32>> {
        let size = self.element.size();
        let mut data = Vec::with_capacity(number);
        let mut index = vec![0usize; self.shape.len()];
        for _ in 0..number {
            let mut place = self.offset;
            for (i, stride) in index.iter().zip(&self.strides) {
                place = place.checked_add(i.checked_mul(*stride)?)?;
            }
            let start = place.checked_mul(size)?;
            data.push(
                self.element
                    .read(stored.get(start..start.checked_add(size)?)?),
            );
            for (i, side) in index.iter_mut().zip(&self.shape).rev() {
                *i += 1;
                if *i < *side {
                    break;
                }
                *i = 0;
            }
        }
        Some(data)
    }
}

/// The strides of a shape in row-major order, in elements.
fn strides(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1usize; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis].saturating_mul(shape[axis]);
    }
    strides
}

/// The entries of a ZIP archive, by their names without the folder that all are in.
struct Archive<'a> {
    zip: ZipSliceArchive<&'a [u8]>,
    entries: HashMap<String, Stored>,
}

struct Stored {
    place: ZipArchiveEntryWayfinder,
    is_stored: bool,
    crc32: u32,
}

impl<'a> Archive<'a> {
    /// `name` gives the name that an entry is known by here, by its path.
    fn open(bytes: &'a [u8], name: impl Fn(&str) -> Option<String>) -> Result<Self> {
        let damaged = |e: rawzip::Error| {
            Error::input(format!(
                "not a complete .pth file ({} bytes: {e}); was the download or the copy cut short?",
                bytes.len()
            ))
        };
        let zip = ZipArchive::from_slice(bytes).map_err(damaged)?;
        let mut entries = HashMap::new();
        for entry in zip.entries() {
            let entry = entry.map_err(damaged)?;
            let path = entry.file_path();
            let path = String::from_utf8_lossy(path.as_ref());
            let Some(name) = name(&path) else {
                continue;
            };
            let found = Stored {
                place: entry.wayfinder(),
                is_stored: entry.compression_method() == CompressionMethod::STORE,
                crc32: entry.crc32(),
            };
            entries.insert(name, found);
        }
        Ok(Self { zip, entries })
    }

    fn has(&self, name: &str) -> bool {
        self.entries.contains_key(name)
    }

    /// The bytes of an entry, checked against its sum.
    fn entry(&self, name: &str) -> Result<&[u8]> {
        let Some(entry) = self.entries.get(name) else {
            return Err(Error::input(format!(
                "the archive has no entry `{name}`; the file is damaged or torch.save did not write it"
            )));
        };
        if !entry.is_stored {
            return Err(Error::input(format!(
                "the archive's entry `{name}` is compressed, which torch.save does not do; save the checkpoint again \
                 with torch.save"
            )));
        }
        let found = self.zip.get_entry(entry.place).map_err(|e| {
            Error::input(format!("the archive's entry `{name}` cannot be read: {e}"))
        })?;
        let bytes = found.data();
        // torch.save can leave the sums out; they are 0 then. (rawzip's own sum would
        // bring 16 KB of tables into the page; the PNG decoder brings these anyway.)
        if entry.crc32 != 0 && crc32fast::hash(bytes) != entry.crc32 {
            return Err(Error::input(format!(
                "the archive's entry `{name}` does not have the sum it was written with; the file is damaged: copy it again"
            )));
        }
        Ok(bytes)
    }
}

/// A dictionary of the metadata's texts and `model_state_dict`, as `torch.save` would write it;
/// `torch.load` takes it with `weights_only`.
pub fn write(contents: &Contents) -> Result<Vec<u8>> {
    let failed = |e: rawzip::Error| Error::input(format!("the checkpoint cannot be written: {e}"));
    let mut bytes = Vec::new();
    let mut archive = ZipArchiveWriter::new(&mut bytes);
    let mut add = |name: &str, data: &[u8]| -> Result<(), rawzip::Error> {
        let path = format!("checkpoint/{name}");
        let (mut entry, config) = archive.new_file(&path).start()?;
        let mut writer = config.wrap(&mut entry);
        writer.write_all(data)?;
        let (_, descriptor) = writer.finish()?;
        entry.finish(descriptor)?;
        Ok(())
    };
    add("data.pkl", &program(contents)).map_err(failed)?;
    add("byteorder", b"little").map_err(failed)?;
    for (i, tensor) in contents.tensors.values().enumerate() {
        add(&format!("data/{i}"), &tensor.to_le_bytes()).map_err(failed)?;
    }
    add("version", b"3\n").map_err(failed)?;
    archive.finish().map_err(failed)?;
    Ok(bytes)
}

/// The pickle, protocol 2.
fn program(contents: &Contents) -> Vec<u8> {
    let mut out = vec![0x80, 2, b'}', b'('];
    for (key, value) in &contents.metadata {
        put_text(&mut out, key);
        put_text(&mut out, value);
    }
    put_text(&mut out, WEIGHTS[0]);
    put_ordered_dict(&mut out);
    out.push(b'(');
    for (i, (name, tensor)) in contents.tensors.iter().enumerate() {
        put_text(&mut out, name);
        out.extend(b"ctorch._utils\n_rebuild_tensor_v2\n((");
        put_text(&mut out, "storage");
        out.extend(b"ctorch\nFloatStorage\n");
        put_text(&mut out, &i.to_string());
        put_text(&mut out, "cpu");
        put_int(&mut out, tensor.data.len());
        out.extend(b"tQ");
        put_int(&mut out, 0);
        put_sizes(&mut out, &tensor.shape);
        put_sizes(&mut out, &strides(&tensor.shape));
        // requires_grad, hooks
        out.push(0x89);
        put_ordered_dict(&mut out);
        out.extend(b"tR");
    }
    out.extend(b"uu.");
    out
}

fn put_text(out: &mut Vec<u8>, text: &str) {
    out.push(b'X');
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

fn put_int(out: &mut Vec<u8>, value: usize) {
    out.extend([0x8a, 8]);
    out.extend((value as u64).to_le_bytes());
}

fn put_sizes(out: &mut Vec<u8>, sizes: &[usize]) {
    out.push(b'(');
    sizes.iter().for_each(|size| put_int(out, *size));
    out.push(b't');
}

fn put_ordered_dict(out: &mut Vec<u8>) {
    out.extend(b"ccollections\nOrderedDict\n)R");
}
