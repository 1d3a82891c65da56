//! What `torch.save` writes: a ZIP archive of stored entries, `…/data.pkl` with everything but the
//! values of the tensors, which are in `…/data/0` and so on.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::io::Write as _;

use rawzip::{
    CompressionMethod, ZipArchive, ZipArchiveEntryWayfinder, ZipArchiveWriter, ZipSliceArchive,
};

use serde_json::Value;

use super::contents::Contents;
use super::element::{Element, count, is_counter, not_float};
use super::pickle::{Id, Node, Pickle, ToJson};
use crate::checkpoint::Tensor;
use crate::error::{Error, Result};

/// Where training scripts put the weights in what they save; the authors' is the first.
const WEIGHTS: [&str; 4] = ["model_state_dict", "state_dict", "model", "weights"];
/// Entries saved with the weights that are of no use without the script.
const STATES: [&str; 3] = ["optimizer", "scheduler", "scaler"];
/// A pickle of a checkpoint has tens of kilobytes; this bounds the memory that a made-up one takes.
const LARGEST_PICKLE: usize = 16 << 20;

pub fn read(bytes: &[u8]) -> Result<Contents> {
    let archive = Archive::open(bytes)?;
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
    let pickle = Pickle::read(stored)?;
    let weights = weights(&pickle)?;
    let mut tensors = BTreeMap::new();
    // Several tensors may lie in the same bytes, so that a small file could ask for any amount of
    // memory.
    let mut left = bytes.len().saturating_mul(8);
    // Each is checked against its sum once.
    let mut storages = HashMap::new();
    for (key, value) in pickle.entries(weights) {
        let Some(name) = pickle.text(*key) else {
            continue;
        };
        if is_counter(name) {
            continue;
        }
        let Some(tensor) = View::of(&pickle, *value, name)? else {
            continue;
        };
        let stored = match storages.entry(tensor.storage) {
            Entry::Occupied(stored) => *stored.get(),
            Entry::Vacant(place) => *place.insert(
                archive
                    .entry(&format!("data/{}", tensor.storage))
                    .map_err(|e| e.at(format_args!("tensor `{name}`")))?,
            ),
        };
        let tensor = tensor.read(stored, name)?;
        left = left.checked_sub(4 * tensor.data.len()).ok_or_else(|| {
            Error::input(format!(
                "the tensors up to `{name}` are many times as large as the file; the file is damaged"
            ))
        })?;
        tensors.insert(name.to_owned(), tensor);
    }
    let mut metadata = BTreeMap::new();
    let mut json = ToJson::new(&pickle);
    if weights != pickle.root() {
        for (key, value) in pickle.entries(pickle.root()) {
            let Some(name) = pickle.text(*key) else {
                continue;
            };
            if *value == weights || STATES.iter().any(|state| name.contains(state)) {
                continue;
            }
            let text = match (pickle.node(*value), json.value(*value)?) {
                (_, None | Some(Value::Null)) => continue,
                (Node::Text(_), Some(Value::String(text))) => text,
                (_, Some(json)) => json.to_string(),
            };
            metadata.insert(name.to_owned(), text);
        }
    }
    Ok(Contents { tensors, metadata })
}

/// The dictionary that holds the weights.
fn weights(pickle: &Pickle) -> Result<Id> {
    let root = pickle.root();
    if let Some(class) = pickle.class(root) {
        return Err(Error::input(format!(
            "a whole `{class}` rather than its weights; save model.state_dict() instead"
        )));
    }
    let holds_tensors = |dict: Id| {
        let mut entries = pickle.entries(dict).iter();
        entries.any(|(_, value)| pickle.class(*value).is_some_and(is_tensor))
    };
    let named = WEIGHTS.iter().filter_map(|key| pickle.get(root, key));
    let mut candidates = named.chain([root]);
    candidates.find(|dict| holds_tensors(*dict)).ok_or_else(|| {
        let keys: Vec<&str> = pickle
            .entries(root)
            .iter()
            .filter_map(|(key, _)| pickle.text(*key))
            .take(8)
            .collect();
        Error::input(format!(
            "no weights under `model_state_dict` (the file holds {}); expected a checkpoint of the authors' code or a \
             state dict",
            if keys.is_empty() { "no names".to_owned() } else { keys.join(", ") }
        ))
    })
}

fn is_tensor(class: &str) -> bool {
    class.starts_with("torch._utils._rebuild_")
}

/// A tensor as the pickle describes it: a view of a storage.
struct View<'a> {
    /// Name of the storage's entry below `data/`.
    storage: &'a str,
    element: Element,
    /// In elements, as are the strides.
    offset: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
}

impl<'a> View<'a> {
    /// `None` for what is not a tensor.
    fn of(pickle: &'a Pickle, id: Id, name: &str) -> Result<Option<Self>> {
        let (Node::Object { arguments, .. }, Some(class)) = (pickle.node(id), pickle.class(id))
        else {
            return Ok(None);
        };
        if !is_tensor(class) {
            return Ok(None);
        }
        if class != "torch._utils._rebuild_tensor_v2" {
            return Err(not_float(name, &format_args!("made by `{class}`")));
        }
        let damaged = || {
            Error::input(format!(
                "tensor `{name}` is not described as torch.save does; the file is damaged"
            ))
        };
        let Some(&[storage, offset, shape, strides, ..]) = pickle.items(*arguments) else {
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
            other => return Err(not_float(name, &format_args!("in a `{other}`"))),
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
        Ok(Some(Self {
            storage: pickle.text(key).ok_or_else(damaged)?,
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

impl View<'_> {
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
    fn open(bytes: &'a [u8]) -> Result<Self> {
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
            let Some((_, name)) = path.split_once('/') else {
                continue;
            };
            let found = Stored {
                place: entry.wayfinder(),
                is_stored: entry.compression_method() == CompressionMethod::STORE,
                crc32: entry.crc32(),
            };
            entries.insert(name.to_owned(), found);
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
