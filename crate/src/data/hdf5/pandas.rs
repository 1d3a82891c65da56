//! Data frames as pandas' `to_hdf` stores them, in its `fixed` and its `table` format, as `to_csv`
//! writes them: DeepLabCut keeps its labels and analyses as `df_with_missing`.

use std::collections::HashMap;
use std::rc::Rc;

use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, Hdf5File};

use super::errors::{broken, unreadable};
use super::records::{Field, Records};
use super::scalar::{Scalar, bytes, numbers};
use crate::data::export::{Export, number_text};
use crate::error::{Error, Result};
use crate::memory;
use crate::pickle::{Id, Node, Pickle};

/// What DeepLabCut calls its frame.
const KEY: &str = "df_with_missing";
/// Rows above the columns, or fields before them.
const MOST_LEVELS: usize = 16;
/// What the rows above DeepLabCut's columns are called, with and without several animals.
const LEVELS: [&str; 4] = ["scorer", "individuals", "bodyparts", "coords"];

/// The data frame of a file as a table; `None` where there is none.
///
/// # Errors
/// When there are several, or the one that is there cannot be read.
pub fn export(file: &Hdf5File) -> Result<Option<Export>> {
    let root = file.root_group().map_err(|e| broken(&e))?;
    let (groups, _) = root.member_names().map_err(|e| broken(&e))?;
    let mut frames = Vec::new();
    for name in groups {
        let group = root.group(&name).map_err(|e| unreadable(&name, &e))?;
        if let Some(kind) = text_attribute(&group, "pandas_type") {
            frames.push((name, group, kind));
        }
    }
    let at = frames.iter().position(|(name, ..)| name == KEY);
    let (name, group, kind) = match (at, frames.len()) {
        (Some(at), _) => frames.swap_remove(at),
        (None, 0) => return Ok(None),
        (None, 1) => frames.swap_remove(0),
        (None, _) => {
            let names: Vec<String> = frames
                .iter()
                .map(|(name, ..)| format!("`{name}`"))
                .collect();
            return Err(Error::input(format!(
                "the file holds several data frames ({}); expected one, or one of them called `{KEY}`",
                names.join(", ")
            )));
        }
    };
    let frame = match kind.as_str() {
        "frame" => Frame::fixed(&group),
        "frame_table" => Frame::table(&group),
        other => Err(Error::input(format!(
            "pandas stored it as `{other}`; expected a data frame, as DataFrame.to_hdf stores it"
        ))),
    };
    frame
        .and_then(|frame| frame.export())
        .map(Some)
        .map_err(|e| e.at(format!("`{name}`")))
}

/// A data frame.
struct Frame {
    columns: Axis,
    index: Axis,
    blocks: Vec<Block>,
    /// For each column its block and the place in a row of it, where there is one that can be read.
    cells: Vec<Option<(usize, usize)>>,
}

/// The labels of columns or rows.
struct Axis {
    /// What the levels are called; nothing where they have no name.
    names: Vec<String>,
    /// For each column or row a label on each level.
    labels: Vec<Vec<String>>,
}

/// Values of several columns, which pandas keeps together where they are of one type.
enum Block {
    /// Row by row.
    Numbers {
        width: usize,
        values: Vec<f64>,
    },
    Records {
        records: Rc<Records>,
        field: Field,
    },
}

impl Block {
    fn text(&self, row: usize, at: usize) -> String {
        match self {
            Self::Numbers { width, values } => values
                .get(row * width + at)
                .map_or_else(String::new, |number| number_text(*number)),
            Self::Records { records, field } => records.text(row, *field, at),
        }
    }
}

impl Frame {
    /// The `fixed` format: labels and values as arrays.
    fn fixed(group: &Group) -> Result<Self> {
        let file = group.storage().len();
        let columns = Axis::of_arrays(group, "axis0")?;
        let index = Axis::of_arrays(group, "axis1")?;
        let places = columns.places();
        let mut cells = vec![None; columns.labels.len()];
        let mut blocks = Vec::new();
        // Every block has a column.
        for number in 0..columns.labels.len() {
            let name = format!("block{number}_values");
            let Ok(dataset) = group.dataset(&name) else {
                break;
            };
            let items = Axis::of_arrays(group, &format!("block{number}_items"))?;
            let width = items.labels.len();
            // Objects, which pandas pickles, are no positions: their columns stay empty.
            if Scalar::of(dataset.dtype()).is_none() {
                continue;
            }
            let values = numbers(&dataset, &name, file)?;
            if values.len() != index.labels.len() * width {
                return Err(Error::input(format!(
                    "`{name}` holds {} values for {} rows of {width} columns; is the file damaged?",
                    values.len(),
                    index.labels.len()
                )));
            }
            for (at, label) in items.labels.iter().enumerate() {
                if let Some(column) = places.get(label) {
                    cells[*column] = Some((blocks.len(), at));
                }
            }
            blocks.push(Block::Numbers { width, values });
        }
        Ok(Self {
            columns,
            index,
            blocks,
            cells,
        })
    }

    /// The `table` format: records with the index and blocks of columns, whose labels are pickled
    /// beside.
    fn table(group: &Group) -> Result<Self> {
        let dataset = group
            .dataset("table")
            .map_err(|e| unreadable("table", &e))?;
        let records = Records::read(&dataset, "table", group.storage().len())?;
        let columns = Axis::of_pickles(group)?;
        let places = columns.places();
        let field = records.field("index")?;
        let label = |row| vec![records.text(row, field, 0)];
        let index = Axis {
            names: vec![String::new()],
            labels: (0..records.len()).map(label).collect(),
        };
        let mut cells = vec![None; columns.labels.len()];
        let mut fields = Vec::new();
        for name in records.names().filter(|name| *name != "index") {
            let Some(field) = records.find(name)? else {
                continue;
            };
            let labels = match dataset.attribute(&format!("{name}_kind")) {
                Ok(kind) => labels(&kind.raw_data)?,
                Err(_) => None,
            };
            let labels = labels.unwrap_or_else(|| vec![vec![name.to_owned()]]);
            for (at, label) in labels.iter().take(field.count).enumerate() {
                if let Some(column) = places.get(label) {
                    cells[*column] = Some((fields.len(), at));
                }
            }
            fields.push(field);
        }
        let records = Rc::new(records);
        let block = |field| Block::Records {
            records: Rc::clone(&records),
            field,
        };
        Ok(Self {
            blocks: fields.into_iter().map(block).collect(),
            columns,
            index,
            cells,
        })
    }

    /// As `to_csv` writes it.
    fn export(&self) -> Result<Export> {
        let levels = self.columns.names.len();
        let before = self.index.names.len();
        let header = (0..levels).map(|level| {
            let mut row = match levels {
                1 => self.index.names.clone(),
                _ => vec![self.columns.level(level).to_owned()],
            };
            row.resize(before, String::new());
            row.extend(
                self.columns
                    .labels
                    .iter()
                    .map(|labels| labels[level].clone()),
            );
            Ok(row)
        });
        let rows = self
            .index
            .labels
            .iter()
            .enumerate()
            .map(|(number, labels)| {
                let cell = |cell: &Option<(usize, usize)>| {
                    cell.map_or_else(String::new, |(block, at)| {
                        self.blocks[block].text(number, at)
                    })
                };
                let mut row = labels.clone();
                row.extend(self.cells.iter().map(cell));
                Ok(row)
            });
        Export::of(header.chain(rows), None)
    }
}

impl Axis {
    /// Labels in arrays: one array, or for each level the labels and which of them are used.
    fn of_arrays(group: &Group, name: &str) -> Result<Self> {
        let file = group.storage().len();
        let dataset = |name: &str| group.dataset(name).map_err(|e| unreadable(name, &e));
        if text_attribute(group, &format!("{name}_variety")).as_deref() != Some("multi") {
            let array = dataset(name)?;
            return Ok(Self {
                names: vec![name_of(&array)],
                labels: texts(&array, name, file)?
                    .into_iter()
                    .map(|label| vec![label])
                    .collect(),
            });
        }
        let mut names = Vec::new();
        let mut labels: Vec<Vec<String>> = Vec::new();
        for level in 0..MOST_LEVELS {
            let array = format!("{name}_level{level}");
            let Ok(found) = group.dataset(&array) else {
                break;
            };
            let texts = texts(&found, &array, file)?;
            let codes = format!("{name}_label{level}");
            let codes = numbers(&dataset(&codes)?, &codes, file)?;
            if level == 0 {
                labels.resize_with(codes.len(), Vec::new);
            }
            if codes.len() != labels.len() {
                return Err(Error::input(format!(
                    "`{array}` labels {} of {} items; is the file damaged?",
                    codes.len(),
                    labels.len()
                )));
            }
            // -1 is for no label.
            let text = |code: f64| (code >= 0.0).then(|| texts.get(code as usize)).flatten();
            check_length(codes.iter().filter_map(|code| text(*code)).map(String::len))?;
            for (labels, code) in labels.iter_mut().zip(codes) {
                labels.push(text(code).cloned().unwrap_or_default());
            }
            names.push(name_of(&found));
        }
        Ok(Self { names, labels })
    }

    /// Labels of columns as the `table` format pickles them.
    fn of_pickles(group: &Group) -> Result<Self> {
        let pickled = |name: &str| {
            let attribute = group.attribute(name).map_err(|e| unreadable(name, &e))?;
            Pickle::read_first(&attribute.raw_data)
                .map(|(pickle, _)| pickle)
                .map_err(|fault| Error::input(format!("`{name}`: {fault}")))
        };
        let axes = pickled("non_index_axes")?;
        let items = axes
            .items(axes.root())
            .and_then(|all| axes.items(*all.first()?))
            .and_then(|axis| axes.items(*axis.get(1)?))
            .ok_or_else(|| Error::input("`non_index_axes` does not name the columns"))?;
        let labels = all_labels(&axes, items)?;
        let levels = labels.first().map_or(1, Vec::len);
        if labels.iter().any(|label| label.len() != levels) || levels > MOST_LEVELS {
            return Err(Error::input(
                "`non_index_axes` names columns on different numbers of levels",
            ));
        }
        let names = pickled("info").ok().and_then(|info| {
            let mut axes = info.entries(info.root()).iter();
            let (_, columns) = axes.find(|(axis, _)| info.size(*axis) == Some(1))?;
            let names = info.items(info.get(*columns, "names")?)?;
            Some(names.iter().map(|name| text(&info, *name)).collect())
        });
        let mut names: Vec<String> = names.unwrap_or_default();
        names.resize(levels, String::new());
        Ok(Self { names, labels })
    }

    /// By its labels the number of a column.
    fn places(&self) -> HashMap<&Vec<String>, usize> {
        let places = self.labels.iter().enumerate();
        places.map(|(number, labels)| (labels, number)).collect()
    }

    /// What a level is called; where it has no name, as DeepLabCut calls it.
    fn level(&self, level: usize) -> &str {
        let name = self.names[level].as_str();
        match (name, self.names.len()) {
            ("", 3) => [LEVELS[0], LEVELS[2], LEVELS[3]][level],
            ("", 4) => LEVELS[level],
            _ => name,
        }
    }
}

/// The texts of an array, numbers as they are written.
fn texts(dataset: &Dataset, name: &str, file: u64) -> Result<Vec<String>> {
    if let Datatype::String { .. } = dataset.dtype() {
        // For its check of the size.
        bytes(dataset, name, file)?;
        return dataset.read_strings().map_err(|e| unreadable(name, &e));
    }
    let numbers = numbers(dataset, name, file)?;
    Ok(numbers.into_iter().map(number_text).collect())
}

/// What pandas notes as the name of an array; nothing where it notes a pickled None.
fn name_of(dataset: &Dataset) -> String {
    let name = dataset.attribute("name").ok();
    let text = name.map(|name| text_of(&name.raw_data));
    text.filter(|name| name != "N.").unwrap_or_default()
}

fn text_attribute(group: &Group, name: &str) -> Option<String> {
    let attribute = group.attribute(name).ok()?;
    Some(text_of(&attribute.raw_data))
}

fn text_of(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    text.trim_end_matches('\0').to_owned()
}

/// The labels of several columns, pickled; `None` where it is something else.
fn labels(bytes: &[u8]) -> Result<Option<Vec<Vec<String>>>> {
    let pickle = Pickle::read_first(bytes).ok().map(|(pickle, _)| pickle);
    let items = pickle
        .as_ref()
        .and_then(|pickle| Some((pickle, pickle.items(pickle.root())?)));
    items
        .map(|(pickle, items)| all_labels(pickle, items))
        .transpose()
}

fn all_labels(pickle: &Pickle, items: &[Id]) -> Result<Vec<Vec<String>>> {
    let length = |id: &Id| pickle.text(*id).map_or(8, str::len);
    let lengths = items.iter().map(|item| match pickle.items(*item) {
        Some(levels) => levels.iter().map(length).sum(),
        None => length(item),
    });
    check_length(lengths)?;
    Ok(items.iter().map(|item| label(pickle, *item)).collect())
}

/// Checks what labels take: many columns can share a long one.
fn check_length(lengths: impl Iterator<Item = usize>) -> Result<()> {
    let all = lengths.fold(0_u64, |all, length| all.saturating_add(length as u64));
    memory::check(all.saturating_mul(4), "labels", "is the file damaged?")
}

/// The label of one column on each level.
fn label(pickle: &Pickle, id: Id) -> Vec<String> {
    match pickle.items(id) {
        Some(levels) => levels.iter().map(|level| text(pickle, *level)).collect(),
        None => vec![text(pickle, id)],
    }
}

fn text(pickle: &Pickle, id: Id) -> String {
    match pickle.node(id) {
        Node::Text(text) => text.clone(),
        Node::Int(number) => number.to_string(),
        Node::Float(number) => number_text(*number),
        _ => String::new(),
    }
}
