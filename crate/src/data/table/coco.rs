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
use crate::data::reading::Layout;
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
        (!track.is_null()).then(|| id(track))
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

pub fn read(text: &str, stem: &str) -> Result<Raw> {
    let text = without_nan(text);
    let wrong = |e: serde_json::Error| {
        Error::input(format!(
            "not COCO keypoints: {e}; expected JSON with `images`, `annotations` and `categories`, or a list of results"
        ))
    };
    let file = match text.trim_start().starts_with('[') {
        true => File {
            images: Vec::new(),
            annotations: serde_json::from_str(&text).map_err(wrong)?,
            categories: Vec::new(),
        },
        false => serde_json::from_str(&text).map_err(wrong)?,
    };
    let is_results = text.trim_start().starts_with('[');
    let images = by_id(&file.images, |image| &image.id, "images")?;
    let categories = by_id(&file.categories, |category| &category.id, "categories")?;
    let names_of = |category: &Category| category.keypoints.clone().unwrap_or_default();
    let with_keypoints = file
        .categories
        .iter()
        .filter(|c| !names_of(c).is_empty())
        .count();
    let mut raw = Raw {
        layout: Layout::Coco,
        sequences: Vec::new(),
        points: Vec::new(),
        rows: Vec::new(),
        heights: Vec::new(),
        sizes: Vec::new(),
        notices: Vec::new(),
        lacks_size: false,
    };
    let (mut without, mut empty) = (0, 0);
    let mut sequences = Sequences::default();
    let mut points = Points::default();
    let mut seen: HashMap<(String, String, String), usize> = HashMap::new();
    let annotations = &file.annotations.0;
    let key_of = |annotation: &Annotation| {
        (
            id(&annotation.image_id),
            id(&annotation.category_id),
            annotation.track().unwrap_or_default(),
        )
    };
    // What shows nothing is no second instance of its image.
    let shown = annotations.iter().filter(|a| a.shows_something());
    let shown: HashSet<_> = shown.map(key_of).collect();
    for (i, annotation) in annotations.iter().enumerate() {
        let wrong = |message: String| Error::input(message).at(format!("annotation {i}"));
        let Some(Numbers(keypoints)) = &annotation.keypoints else {
            without += 1;
            continue;
        };
        let key = key_of(annotation);
        let (image_id, category_id) = (key.0.clone(), key.1.clone());
        let image = images.get(&image_id);
        if image.is_none() && !is_results {
            return Err(wrong(format!("there is no image with the id {image_id}")));
        }
        let category = categories.get(&category_id);
        let track = annotation.track();
        let is_empty = !annotation.shows_something();
        if is_empty && (shown.contains(&key) || seen.contains_key(&key)) {
            empty += 1;
            continue;
        }
        if let Some(other) = seen.insert(key, i) {
            return Err(wrong(format!(
                "its image has annotation {other} of the same category; expected one, or a `track_id` in each that says \
                 which is which over time"
            )));
        }
        if !keypoints.len().is_multiple_of(3) {
            return Err(wrong(format!(
                "{} numbers in `keypoints`; expected three a keypoint: x, y, v",
                keypoints.len()
            )));
        }
        let names = category.map(|c| names_of(c)).unwrap_or_default();
        let count = match keypoints.len() / 3 {
            0 => names.len(),
            count => count,
        };
        if !names.is_empty() && names.len() != count {
            return Err(wrong(format!(
                "{count} keypoints; its category has {}",
                names.len()
            )));
        }
        let (sequence, frame) = match image {
            Some(image) => {
                let name = image.file_name.as_deref();
                place(name.ok_or_else(|| wrong("its image has no `file_name`".to_owned()))?)
                    .map_err(wrong)?
            }
            None => {
                let number = image_id.parse().map_err(|_| {
                    wrong(format!(
                        "the `image_id` {image_id} is no whole number from 0; expected the number of the frame"
                    ))
                })?;
                (stem, number)
            }
        };
        let sequence = sequences.number(sequence).map_err(wrong)?;
        let size = image.map_or(Ok(None), |image| {
            let sides = side(&image.width).and_then(|w| Ok(w.zip(side(&image.height)?)));
            sides.map_err(|why| {
                let name = image.file_name.as_deref().unwrap_or_default();
                wrong(format!("its image `{name}` {why}"))
            })
        })?;
        let size = size.and_then(|(width, height)| {
            let size = [width, height];
            let known = raw.sizes.iter().position(|s| *s == size);
            NonMaxU32::new(known.unwrap_or_else(|| {
                raw.sizes.push(size);
                raw.sizes.len() - 1
            }))
        });
        for k in 0..count {
            let mut name = names.get(k).cloned().unwrap_or_else(|| k.to_string());
            if let Some(category) = category.filter(|_| with_keypoints > 1) {
                name = format!("{}/{name}", category.name);
            }
            if let Some(track) = &track {
                name = format!("{track}/{name}");
            }
            let [x, y, v] = match keypoints.get(3 * k..3 * k + 3) {
                Some(point) => [point[0], point[1], point[2]],
                None => [f64::NAN, f64::NAN, 0.0],
            };
            raw.rows.push(Row {
                line: i as u32,
                sequence,
                frame,
                point: points.number(&cleaned(&name)),
                xy: if v == 0.0 { [f64::NAN; 2] } else { [x, y] },
                confidence: v,
                size,
            });
        }
    }
    if raw.rows.is_empty() {
        return Err(Error::input(
            "no annotation has keypoints; expected `keypoints` with x, y, v for each",
        ));
    }
    for (count, what) in [
        (without, "annotations without keypoints are left out"),
        (
            empty,
            "annotations that show no keypoint, beside another one of their image, are left out",
        ),
    ] {
        if count > 0 {
            raw.notices.push(format!("{count} {what}").into());
        }
    }
    if is_results {
        raw.notices.push(
            "results name images by their ids: each `image_id` is taken for the number of the frame"
                .to_owned()
                .into(),
        );
    }
    raw.sequences = sequences.names;
    raw.points = points.names;
    Ok(raw)
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
