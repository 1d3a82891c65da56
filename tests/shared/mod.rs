//! What several test files need.
#![allow(dead_code, reason = "every test file uses its own part")]

use std::path::PathBuf;

use safetensors::SafeTensors;

/// A file of `tests/golden`.
pub fn golden(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/golden")
        .join(name);
    std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A golden file that is too large for the repository: `None`, with a word about it, unless the
/// environment variable `TRACKLENS_GOLDEN` names the folder that holds it.
pub fn large_golden(name: &str) -> Option<Vec<u8>> {
    let Some(folder) = std::env::var_os("TRACKLENS_GOLDEN") else {
        println!(
            "skipped: {name} is too large for the repository; TRACKLENS_GOLDEN names no folder with it"
        );
        return None;
    };
    let path = PathBuf::from(folder).join(name);
    Some(std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// Shape and values of an f32 tensor.
pub fn tensor(file: &SafeTensors, name: &str) -> (Vec<usize>, Vec<f32>) {
    let view = file.tensor(name).unwrap_or_else(|e| panic!("{name}: {e}"));
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    (
        view.shape().to_vec(),
        view.data().chunks_exact(4).map(float).collect(),
    )
}
