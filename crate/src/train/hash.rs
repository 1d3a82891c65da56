//! SHA-256 as text.

use sha2::{Digest, Sha256};

/// The digits of a SHA-256.
pub(super) fn hex(hash: Sha256) -> String {
    let digits = hash.finalize().into_iter().map(|b| format!("{b:02x}"));
    digits.collect()
}
