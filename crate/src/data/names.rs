//! What the names of files and folders say: their order, the numbers in them, which are images.

use std::borrow::Cow;

use crate::error::without_controls;

/// A name as it is kept: composed (NFC), so that `ö` is the same name however the system writes it
/// (macOS names folders in NFD), and without control characters, which a terminal would obey.
pub(crate) fn cleaned(name: &str) -> Cow<'_, str> {
    if name.is_ascii() {
        return without_controls(name);
    }
    Cow::Owned(without_controls(&composed(name)).into_owned())
}

#[cfg(not(all(feature = "web-part", target_arch = "wasm32")))]
fn composed(name: &str) -> String {
    unicode_normalization::UnicodeNormalization::nfc(name).collect()
}

/// By the browser, which has the tables already.
#[cfg(all(feature = "web-part", target_arch = "wasm32"))]
fn composed(name: &str) -> String {
    js_sys::JsString::from(name).normalize("NFC").into()
}

const IMAGE_ENDINGS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];

/// The positions of `names` in natural order (`frame_2` before `frame_10`); equal ones keep theirs.
pub(super) fn natural_order(names: &[&str]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by(|a, b| alphanumeric_sort::compare_str(names[*a], names[*b]));
    order
}

/// Every run of digits in `text` that is a number.
pub(super) fn numbers(text: &str) -> Vec<u64> {
    text.split(|c: char| !c.is_ascii_digit())
        .filter_map(|digits| digits.parse().ok())
        .collect()
}

/// The last run of digits in `text`, if it is a number.
pub(crate) fn last_number(text: &str) -> Option<u64> {
    numbers(text).last().copied()
}

/// Whether a path is one that people did not put there themselves, e.g. `.DS_Store`.
pub(crate) fn is_hidden(path: &str) -> bool {
    let file = path.rsplit('/').next().unwrap_or_default();
    file.starts_with('.') || path.split('/').any(|part| part == "__MACOSX")
}

pub(crate) fn is_image(path: &str) -> bool {
    let file = path.rsplit('/').next().unwrap_or_default();
    let ending = file.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
    !is_hidden(path) && ending.is_some_and(|e| IMAGE_ENDINGS.contains(&e.as_str()))
}

/// A file name without the ` (1)` of a copy.
pub(super) fn original(stem: &str) -> &str {
    let Some((original, number)) = stem.strip_suffix(')').and_then(|s| s.rsplit_once(" (")) else {
        return stem;
    };
    match !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()) {
        true => original,
        false => stem,
    }
}

pub(super) fn stem(file: &str) -> &str {
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

pub(super) fn quote_list(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    quoted.join(", ")
}
