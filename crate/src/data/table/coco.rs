//! COCO keypoints: <https://cocodataset.org/#format-data>, "Keypoint Detection".

use std::collections::HashMap;

use serde::Deserialize;
use serde_json::Value;

use super::rows::{Raw, Row, Sequences};
use crate::data::names::{cleaned, last_number};
use crate::data::reading::Layout;
use crate::error::{Error, Result};

#[derive(Deserialize)]
struct File {
    images: Vec<Image>,
    annotations: Vec<Annotation>,
    #[serde(default)]
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: Value,
    file_name: String,
    width: Option<u32>,
    height: Option<u32>,
}

#[derive(Deserialize)]
struct Annotation {
    image_id: Value,
    #[serde(default)]
    category_id: Value,
    /// (x, y, v) a keypoint; v = 0: not labelled.
    keypoints: Option<Vec<f64>>,
    /// Tells the instances of one image apart.
    track_id: Option<Value>,
}

#[derive(Deserialize)]
struct Category {
    id: Value,
    name: String,
    #[serde(default)]
    keypoints: Vec<String>,
}

pub fn read(text: &str) -> Result<Raw> {
    let file: File = serde_json::from_str(text).map_err(|e| {
        Error::input(format!(
            "not COCO keypoints: {e}; expected JSON with `images`, `annotations` and `categories`"
        ))
    })?;
    let images: HashMap<String, &Image> = file
        .images
        .iter()
        .map(|image| (image.id.to_string(), image))
        .collect();
    let categories: HashMap<String, &Category> = file
        .categories
        .iter()
        .map(|category| (category.id.to_string(), category))
        .collect();
    let with_keypoints = file
        .categories
        .iter()
        .filter(|c| !c.keypoints.is_empty())
        .count();
    let mut notices = Vec::new();
    let mut without = 0;
    let mut sequences = Sequences::default();
    let mut points: Vec<String> = Vec::new();
    let mut numbers: HashMap<String, usize> = HashMap::new();
    let mut seen: HashMap<(String, String, String), usize> = HashMap::new();
    let mut rows = Vec::new();
    for (i, annotation) in file.annotations.iter().enumerate() {
        let wrong = |message: String| Error::input(message).at(format!("annotation {i}"));
        let Some(keypoints) = &annotation.keypoints else {
            without += 1;
            continue;
        };
        let id = annotation.image_id.to_string();
        let image = images
            .get(&id)
            .ok_or_else(|| wrong(format!("there is no image with the id {id}")))?;
        let category = categories.get(&annotation.category_id.to_string());
        let track = annotation.track_id.as_ref().map(|track| match track {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        });
        let key = (
            id,
            annotation.category_id.to_string(),
            track.clone().unwrap_or_default(),
        );
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
        let names = category.map(|c| c.keypoints.as_slice()).unwrap_or_default();
        if !names.is_empty() && names.len() * 3 != keypoints.len() {
            return Err(wrong(format!(
                "{} keypoints; its category has {}",
                keypoints.len() / 3,
                names.len()
            )));
        }
        let (sequence, frame) = place(&image.file_name).map_err(wrong)?;
        let sequence = sequences.number(sequence).map_err(wrong)?;
        let image_size = image
            .width
            .zip(image.height)
            .map(|(width, height)| [width, height]);
        if image_size.is_some_and(|size| size.contains(&0)) {
            return Err(wrong(format!(
                "its image `{}` has a side of 0",
                image.file_name
            )));
        }
        for (k, point) in keypoints.chunks_exact(3).enumerate() {
            let mut name = names.get(k).cloned().unwrap_or_else(|| k.to_string());
            if let Some(category) = category.filter(|_| with_keypoints > 1) {
                name = format!("{}/{name}", category.name);
            }
            if let Some(track) = &track {
                name = format!("{track}/{name}");
            }
            let name = cleaned(&name).into_owned();
            let number = *numbers.entry(name.clone()).or_insert_with(|| {
                points.push(name);
                points.len() - 1
            });
            rows.push(Row {
                line: i as u64,
                sequence,
                frame,
                point: number,
                xy: if point[2] == 0.0 {
                    [f64::NAN; 2]
                } else {
                    [point[0], point[1]]
                },
                image_size,
            });
        }
    }
    if rows.is_empty() {
        return Err(Error::input(
            "no annotation has keypoints; expected `keypoints` with x, y, v for each",
        ));
    }
    if without > 0 {
        notices.push(format!("{without} annotations without keypoints are left out").into());
    }
    Ok(Raw {
        layout: Layout::Coco,
        sequences: sequences.names,
        points,
        rows,
        notices,
        lacks_size: false,
    })
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
