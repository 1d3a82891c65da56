//! Points as COCO keypoints, JSON.

use serde::Serialize;

use super::write::{folder_name, seen_px};
use crate::error::{Error, Result};
use crate::track::GroundTruth;

/// What a point is that is seen; 0 is one that is not.
const VISIBLE: f64 = 2.0;

#[derive(Serialize)]
struct Coco<'a> {
    images: Vec<Image>,
    annotations: Vec<Annotation>,
    categories: [Category<'a>; 1],
}

#[derive(Serialize)]
struct Image {
    id: usize,
    file_name: String,
    width: u32,
    height: u32,
}

#[derive(Serialize)]
struct Annotation {
    id: usize,
    image_id: usize,
    category_id: u32,
    /// x, y and v of every point, in pixels.
    keypoints: Vec<f64>,
    num_keypoints: usize,
    /// Left, top, width and height of what the points take.
    bbox: [f64; 4],
    area: f64,
    iscrowd: u32,
}

#[derive(Serialize)]
struct Category<'a> {
    id: u32,
    name: &'static str,
    keypoints: &'a [String],
    skeleton: [[u32; 2]; 0],
}

/// Points as COCO keypoints of one object an image: pixels of images of `[width, height]`, v = 2
/// where a point is seen and three zeros where it is not. The images are called
/// `SEQUENCE/frame_000012.png`. COCO has no place for confidences.
///
/// # Errors
/// When the name of a sequence is not that of a folder.
pub fn coco_json(points: &GroundTruth, image_size: [u32; 2]) -> Result<String> {
    let [width, height] = image_size;
    let mut images = Vec::new();
    let mut annotations = Vec::new();
    for (id, (key, frame)) in points
        .keys()
        .iter()
        .zip(points.points_ndc().outer_iter())
        .enumerate()
    {
        let folder = folder_name(&key.sequence)?;
        images.push(Image {
            id,
            file_name: format!("{folder}/frame_{:06}.png", key.frame),
            width,
            height,
        });
        let px: Vec<Option<[f64; 2]>> = frame
            .rows()
            .into_iter()
            .map(|point| seen_px([point[0], point[1]], image_size))
            .collect();
        let triple = |point: &Option<[f64; 2]>| match point {
            Some([x, y]) => [*x, *y, VISIBLE],
            None => [0.0; 3],
        };
        let [x, y] = [0, 1].map(|axis| extent(px.iter().flatten().map(|point| point[axis])));
        annotations.push(Annotation {
            id,
            image_id: id,
            category_id: 1,
            num_keypoints: px.iter().flatten().count(),
            keypoints: px.iter().flat_map(triple).collect(),
            bbox: [x[0], y[0], x[1], y[1]],
            area: x[1] * y[1],
            iscrowd: 0,
        });
    }
    let category = Category {
        id: 1,
        name: "object",
        keypoints: points.names(),
        skeleton: [],
    };
    let coco = Coco {
        images,
        annotations,
        categories: [category],
    };
    serde_json::to_string(&coco).map_err(|e| Error::input(format!("no JSON: {e}")))
}

/// Where values begin and how far they reach; nothing where there are none.
fn extent(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let low = values.clone().reduce(f64::min);
    let high = values.reduce(f64::max);
    low.zip(high)
        .map_or([0.0; 2], |(low, high)| [low, high - low])
}
