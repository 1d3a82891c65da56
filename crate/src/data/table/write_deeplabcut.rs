//! Points as DeepLabCut's CSV of labels.

use super::write::{folder_name, seen_px};
use crate::data::export::Export;
use crate::error::Result;
use crate::track::GroundTruth;

/// Who set the points.
const SCORER: &str = "tracklens";

/// Points as DeepLabCut's CSV of labels, in pixels of images of `[width, height]`: a row an image,
/// `labeled-data/SEQUENCE/img000012.png`. Points all of whose names have the form
/// `individual/bodypart` are those of several individuals. Where there are confidences, there is a
/// column `likelihood`.
///
/// # Errors
/// When the name of a sequence is not that of a folder.
pub fn deeplabcut_csv(points: &GroundTruth, image_size: [u32; 2]) -> Result<Vec<u8>> {
    let coords: &[&str] = match points.confidence() {
        Some(_) => &["x", "y", "likelihood"],
        None => &["x", "y"],
    };
    let header = |name: &str, of: &dyn Fn(&str, &str) -> String| {
        let cells = points.names().iter();
        let cells = cells.flat_map(|point| coords.iter().map(|coord| of(point, coord)));
        Ok(std::iter::once(name.to_owned())
            .chain(cells)
            .collect::<Vec<String>>())
    };
    let split: Option<Vec<_>> = points
        .names()
        .iter()
        .map(|name| name.split_once('/'))
        .collect();
    let has_individuals = split.is_some();
    let part = |name: &str| match name.split_once('/') {
        Some((_, part)) if has_individuals => part.to_owned(),
        _ => name.to_owned(),
    };
    let individual = |name: &str| name.split_once('/').map_or("", |(of, _)| of).to_owned();
    let mut rows = vec![header("scorer", &|_, _| SCORER.to_owned())];
    if has_individuals {
        rows.push(header("individuals", &|name, _| individual(name)));
    }
    rows.push(header("bodyparts", &|name, _| part(name)));
    rows.push(header("coords", &|_, coord| coord.to_owned()));
    let frames = points
        .keys()
        .iter()
        .zip(points.points_ndc().outer_iter())
        .enumerate();
    let frames = frames.map(|(t, (key, frame))| {
        let folder = folder_name(&key.sequence)?;
        let mut row = vec![format!("labeled-data/{folder}/img{:06}.png", key.frame)];
        for (k, point) in frame.rows().into_iter().enumerate() {
            let px = seen_px([point[0], point[1]], image_size);
            let cell = |axis: usize| px.map_or_else(String::new, |px| px[axis].to_string());
            row.extend([cell(0), cell(1)]);
            if let Some(confidence) = points.confidence() {
                let confidence = Some(confidence[[t, k]]).filter(|c| !c.is_nan());
                row.push(confidence.map_or_else(String::new, |c| c.to_string()));
            }
        }
        Ok(row)
    });
    Export::of(rows.into_iter().chain(frames), None).map(|export| export.table)
}
