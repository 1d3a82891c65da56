//! The film in a report: the sequence in which most moves, with its frames.

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::data::FrameSource;
use crate::error::Result;
use crate::evaluation::{EvaluationReport, Scoring};
use crate::metric::Settings;
use crate::report::evaluation::Film;

/// The longer side of an image, in pixels.
const SIDE: u32 = 256;
const QUALITY: u8 = 80;

/// The film of what was scored; without `frames` only in space.
///
/// # Errors
/// When a frame cannot be read any more.
pub(super) fn film(
    scoring: &Scoring,
    report: &EvaluationReport,
    settings: &Settings,
    frames: Option<&dyn FrameSource>,
) -> Result<Option<Film>> {
    let mut film = Film::of(scoring, report, settings)?;
    // In the image there is nothing to be seen without images.
    let Some(frames) = frames else {
        return Ok(film.filter(Film::is_in_space));
    };
    if let Some(film) = film.as_mut().filter(|film| !film.is_in_space()) {
        let keys = frames.index().keys().iter().enumerate();
        let of_sequence = keys.filter(|(_, key)| key.sequence == film.sequence);
        let places: BTreeMap<u64, usize> = of_sequence.map(|(i, key)| (key.frame, i)).collect();
        let image = |number: &u64| -> Result<Option<String>> {
            let Some(place) = places.get(number) else {
                return Ok(None);
            };
            let jpeg = frames.read(*place)?.to_jpeg(SIDE, QUALITY)?;
            Ok(Some(format!(
                "data:image/jpeg;base64,{}",
                STANDARD.encode(jpeg)
            )))
        };
        film.images = film.frames.iter().map(image).collect::<Result<_>>()?;
    }
    Ok(film)
}
