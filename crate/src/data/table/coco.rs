//! COCO keypoints: <https://cocodataset.org/#format-data>, "Keypoint Detection", and its results,
//! <https://cocodataset.org/#format-results>.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error as _, SeqAccess, Visitor};
use serde_json::Value;

use super::rows::{NonMaxU32, Points, Raw, Row, Sequences};
use crate::data::names::{cleaned, last_number};
use crate::data::reading::{Layout, Notice};
use crate::error::{Error, Result};

#[derive(Deserialize)]
struct File {
    images: Vec<Image>,
    annotations: Annotations,
    #[serde(default)]
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: Value,
    file_name: Option<String>,
    #[serde(default)]
    width: Value,
    #[serde(default)]
    height: Value,
}

#[derive(Deserialize)]
struct Annotation {
    image_id: Value,
    #[serde(default)]
    category_id: Value,
    /// (x, y, v) a keypoint; v = 0: not labelled, 1: hidden by something, 2: visible. Detectors write
    /// how sure they are.
    keypoints: Option<Numbers>,
    /// Tells the instances of one image apart.
    track_id: Option<Value>,
    #[serde(default)]
    attributes: Value,
}

impl Annotation {
    /// The name of its track, in the annotation or among the attributes, as CVAT writes it.
    fn track(&self) -> Option<String> {
        let track = self.track_id.as_ref();
        let track = track.or_else(|| self.attributes.get("track_id"))?;
        (!track.is_null())
            .then(|| id(track))
            .filter(|track| !track.is_empty())
    }

    /// Whether any keypoint is at a place.
    fn shows_something(&self) -> bool {
        let points = self.keypoints.as_ref().map(|numbers| &numbers.0[..]);
        points
            .unwrap_or_default()
            .chunks_exact(3)
            .any(|p| p[2] != 0.0 && !p[0].is_nan() && !p[1].is_nan())
    }
}

#[derive(Deserialize)]
struct Category {
    id: Value,
    #[serde(default)]
    name: String,
    keypoints: Option<Vec<String>>,
}

impl Category {
    /// The names of its keypoints.
    fn names(&self) -> &[String] {
        self.keypoints.as_deref().unwrap_or_default()
    }
}

/// Annotations whose errors say which one it is.
struct Annotations(Vec<Annotation>);

impl<'de> Deserialize<'de> for Annotations {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Annotations(Vec::new()))
    }
}

impl<'de> Visitor<'de> for Annotations {
    type Value = Self;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of annotations")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Self, A::Error> {
        loop {
            match list.next_element() {
                Ok(Some(annotation)) => self.0.push(annotation),
                Ok(None) => return Ok(self),
                Err(e) => {
                    return Err(A::Error::custom(format!(
                        "annotation {}: {e}",
                        self.0.len()
                    )));
                }
            }
        }
    }
}

/// Numbers, flat or in lists of lists; NaN for null.
#[derive(Default)]
struct Numbers(Vec<f64>);

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut numbers = Vec::new();
        Take(&mut numbers).deserialize(deserializer)?;
        Ok(Self(numbers))
    }
}

/// Puts numbers into a list.
struct Take<'a>(&'a mut Vec<f64>);

impl<'de> DeserializeSeed<'de> for Take<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Take<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("numbers")
    }

    fn visit_f64<E: serde::de::Error>(self, number: f64) -> Result<(), E> {
        self.0.push(number);
        Ok(())
    }

    fn visit_i64<E: serde::de::Error>(self, number: i64) -> Result<(), E> {
        self.visit_f64(number as f64)
    }

    fn visit_u64<E: serde::de::Error>(self, number: u64) -> Result<(), E> {
        self.visit_f64(number as f64)
    }

    fn visit_unit<E: serde::de::Error>(self) -> Result<(), E> {
        self.visit_f64(f64::NAN)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        while list.next_element_seed(Take(self.0))?.is_some() {}
        Ok(())
    }
}

/// An id as text: 1, 1.0 and "1" are the same.
fn id(value: &Value) -> String {
    match value {
        Value::String(text) => text.trim().to_owned(),
        Value::Number(number) => match number.as_f64() {
            Some(number) if number.fract() == 0.0 && number.abs() < 9e15 => {
                (number as i64).to_string()
            }
            _ => number.to_string(),
        },
        other => other.to_string(),
    }
}

/// The side of an image, where the file gives one.
fn side(value: &Value) -> Result<Option<u32>, String> {
    let number = match value {
        Value::Null => return Ok(None),
        Value::String(text) => text.trim().parse().ok(),
        other => other.as_f64(),
    };
    match number {
        Some(0.0) => Err("has a side of 0".to_owned()),
        Some(side) if side.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&side) => {
            Ok(Some(side as u32))
        }
        _ => Err(format!(
            "has a side of {value}; expected a whole number of pixels"
        )),
    }
}

/// The numbers by the id, each of which is there once.
fn by_id<'a, T>(
    all: &'a [T],
    id_of: impl Fn(&T) -> &Value,
    what: &str,
) -> Result<HashMap<String, &'a T>> {
    let mut found = HashMap::with_capacity(all.len());
    for one in all {
        let id = id(id_of(one));
        if found.insert(id.clone(), one).is_some() {
            return Err(Error::input(format!(
                "two {what} have the id {id}; expected one"
            )));
        }
    }
    Ok(found)
}

/// Which person or animal an annotation shows, and in which image.
#[derive(PartialEq, Eq, Hash)]
struct Instance {
    image: String,
    category: String,
    track: Option<String>,
}

impl Instance {
    fn of(annotation: &Annotation) -> Self {
        Self {
            image: id(&annotation.image_id),
            category: id(&annotation.category_id),
            track: annotation.track(),
        }
    }
}

pub fn read(text: &str, stem: &str) -> Result<Raw> {
    let text = without_nan(text);
    let is_results = text.trim_start().starts_with('[');
    let file = parse(&text, is_results)?;
    let mut reader = Reader::new(&file, stem, is_results)?;
    for (i, annotation) in file.annotations.0.iter().enumerate() {
        let added = reader.add(i, annotation);
        added.map_err(|e| e.at(format!("annotation {i}")))?;
    }
    reader.finish()
}

fn parse(text: &str, is_results: bool) -> Result<File> {
    let file = match is_results {
        true => serde_json::from_str(text).map(|annotations| File {
            images: Vec::new(),
            annotations,
            categories: Vec::new(),
        }),
        false => serde_json::from_str(text),
    };
    file.map_err(|e| {
        Error::input(format!(
            "not COCO keypoints: {e}; expected JSON with `images`, `annotations` and \
             `categories`, or a list of results"
        ))
    })
}

/// Makes rows of annotations.
struct Reader<'a> {
    /// The name of the file, which is the sequence of results.
    stem: &'a str,
    /// Whether the file is a list of results, without images and categories.
    is_results: bool,
    images: HashMap<String, &'a Image>,
    categories: HashMap<String, &'a Category>,
    /// Whether a keypoint is called after its category too.
    has_several_categories: bool,
    /// The instances of which an annotation shows something.
    shown: HashSet<Instance>,
    /// The instances so far, each with the number of its annotation.
    seen: HashMap<Instance, usize>,
    /// The number of annotations without keypoints.
    without: usize,
    /// The number of annotations that show nothing, beside another one of their image.
    empty: usize,
    sequences: Sequences,
    points: Points,
    sizes: Vec<[u32; 2]>,
    rows: Vec<Row>,
}

impl<'a> Reader<'a> {
    fn new(file: &'a File, stem: &'a str, is_results: bool) -> Result<Self> {
        let with_keypoints = |category: &&Category| !category.names().is_empty();
        // What shows nothing is no second instance of its image.
        let shown = file.annotations.0.iter().filter(|a| a.shows_something());
        Ok(Self {
            stem,
            is_results,
            images: by_id(&file.images, |image| &image.id, "images")?,
            categories: by_id(&file.categories, |category| &category.id, "categories")?,
            has_several_categories: file.categories.iter().filter(with_keypoints).count() > 1,
            shown: shown.map(Instance::of).collect(),
            seen: HashMap::new(),
            without: 0,
            empty: 0,
            sequences: Sequences::default(),
            points: Points::default(),
            sizes: Vec::new(),
            rows: Vec::new(),
        })
    }

    /// Adds the keypoints of the annotation with the number `i`.
    fn add(&mut self, i: usize, annotation: &Annotation) -> Result<()> {
        let Some(Numbers(numbers)) = &annotation.keypoints else {
            self.without += 1;
            return Ok(());
        };
        let instance = Instance::of(annotation);
        let image = self.images.get(&instance.image).copied();
        if image.is_none() && !self.is_results {
            return Err(Error::input(format!(
                "there is no image with the id {}",
                instance.image
            )));
        }
        let other = self.seen.get(&instance).copied();
        let has_other = other.is_some() || self.shown.contains(&instance);
        if has_other && !annotation.shows_something() {
            self.empty += 1;
            return Ok(());
        }
        if let Some(other) = other {
            return Err(Error::input(format!(
                "its image has annotation {other} of the same category; expected one, or a \
                 `track_id` in each that says which is which over time"
            )));
        }
        let names = self.names(&instance, numbers.len())?;
        let (sequence, frame) = self.place(&instance, image)?;
        let sequence = self.sequences.number(sequence).map_err(Error::input)?;
        let size = image.map(|image| self.size(image)).transpose()?.flatten();
        for (k, name) in names.iter().enumerate() {
            let [x, y, v] = match numbers.get(3 * k..3 * k + 3) {
                Some(point) => [point[0], point[1], point[2]],
                None => [f64::NAN, f64::NAN, 0.0],
            };
            self.rows.push(Row {
                line: i as u32,
                sequence,
                frame,
                point: self.points.number(&cleaned(name)),
                xy: if v == 0.0 { [f64::NAN; 2] } else { [x, y] },
                confidence: v,
                size,
            });
        }
        self.seen.insert(instance, i);
        Ok(())
    }

    /// What the keypoints of an instance are called, of which there are so many `numbers`.
    fn names(&self, instance: &Instance, numbers: usize) -> Result<Vec<String>> {
        if !numbers.is_multiple_of(3) {
            return Err(Error::input(format!(
                "{numbers} numbers in `keypoints`; expected three a keypoint: x, y, v"
            )));
        }
        let category = self.categories.get(&instance.category);
        let names = category.map_or(&[][..], |category| category.names());
        let count = match numbers / 3 {
            0 => names.len(),
            count => count,
        };
        if !names.is_empty() && names.len() != count {
            return Err(Error::input(format!(
                "{count} keypoints; its category has {}",
                names.len()
            )));
        }
        let category = category.filter(|_| self.has_several_categories);
        let prefixes = [
            instance.track.as_ref(),
            category.map(|category| &category.name),
        ];
        let prefix: String = prefixes.iter().flatten().map(|p| format!("{p}/")).collect();
        let name = |k: usize| match names.get(k) {
            Some(name) => format!("{prefix}{name}"),
            None => format!("{prefix}{k}"),
        };
        Ok((0..count).map(name).collect())
    }

    /// The sequence and the number of its frame.
    fn place(&self, instance: &Instance, image: Option<&'a Image>) -> Result<(&'a str, u64)> {
        let Some(image) = image else {
            let id = &instance.image;
            let number = id.parse().map_err(|_| {
                Error::input(format!(
                    "the `image_id` {id} is no whole number from 0; expected the number of the \
                     frame"
                ))
            })?;
            return Ok((self.stem, number));
        };
        let name = image.file_name.as_deref();
        place(name.ok_or_else(|| Error::input("its image has no `file_name`"))?)
            .map_err(Error::input)
    }

    /// The number of the image's size among those of the file, where it says its size.
    fn size(&mut self, image: &Image) -> Result<Option<NonMaxU32>> {
        let sides = side(&image.width).and_then(|w| Ok(w.zip(side(&image.height)?)));
        let sides = sides.map_err(|why| {
            let name = image.file_name.as_deref().unwrap_or_default();
            Error::input(format!("its image `{name}` {why}"))
        })?;
        Ok(sides.and_then(|(width, height)| {
            let size = [width, height];
            let known = self.sizes.iter().position(|s| *s == size);
            NonMaxU32::new(known.unwrap_or_else(|| {
                self.sizes.push(size);
                self.sizes.len() - 1
            }))
        }))
    }

    fn finish(self) -> Result<Raw> {
        if self.rows.is_empty() {
            return Err(Error::input(
                "no annotation has keypoints; expected `keypoints` with x, y, v for each",
            ));
        }
        let counts = [
            (self.without, "annotations without keypoints are left out"),
            (
                self.empty,
                "annotations that show no keypoint, beside another one of their image, are left out",
            ),
        ];
        let counts = counts.iter().filter(|(count, _)| *count > 0);
        let mut notices: Vec<Notice> = counts
            .map(|(count, what)| format!("{count} {what}").into())
            .collect();
        if self.is_results {
            let text = "results name images by their ids: each `image_id` is taken for the number \
                        of the frame";
            notices.push(text.to_owned().into());
        }
        Ok(Raw {
            layout: Layout::Coco,
            sequences: self.sequences.names,
            points: self.points.names,
            rows: self.rows,
            heights: Vec::new(),
            sizes: self.sizes,
            notices,
            lacks_size: false,
        })
    }
}

/// The text with null in the place of NaN and infinity, which Python writes and JSON does not know.
fn without_nan(text: &str) -> Cow<'_, str> {
    const WORDS: [&str; 3] = ["NaN", "-Infinity", "Infinity"];
    if !WORDS.iter().any(|word| text.contains(word)) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let (mut in_string, mut rest) = (false, text);
    while let Some(c) = rest.chars().next() {
        let word = WORDS
            .iter()
            .find(|word| !in_string && rest.starts_with(**word));
        let length = match (word, c) {
            (Some(word), _) => {
                out.push_str("null");
                word.len()
            }
            (None, '\\') if in_string => {
                let escaped = rest.chars().take(2).map(char::len_utf8).sum();
                out.push_str(&rest[..escaped]);
                escaped
            }
            (None, _) => {
                in_string ^= c == '"';
                out.push(c);
                c.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

/// The sequence and the number of a frame by the name of its file: the folder, and the last number
/// in the name.
fn place(file_name: &str) -> Result<(&str, u64), String> {
    let mut parts = file_name.rsplit(['/', '\\']);
    let file = parts.next().unwrap_or_default();
    let stem = file.rsplit_once('.').map_or(file, |(stem, _)| stem);
    let frame = last_number(stem).ok_or_else(|| {
        format!("its image `{file_name}` has no number; expected one that says which frame it is")
    })?;
    let folder = parts.next().filter(|folder| !folder.is_empty());
    // All images in one place are one sequence, whatever it is called.
    Ok((folder.unwrap_or("images"), frame))
}
