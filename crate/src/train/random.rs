//! Random streams that depend on the seed and their purpose only.

use rand::SeedableRng;
use rand::rngs::StdRng;

/// What random numbers are drawn for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    Split,
    Order,
    Noise,
}

/// The stream of `seed` for `purpose` in `epoch`; no two of them share a state.
pub(super) fn stream(seed: u64, purpose: Purpose, epoch: usize) -> StdRng {
    let mut state = [0; 32];
    for (part, value) in state.chunks_exact_mut(8).zip([seed, purpose as u64, epoch as u64]) {
        part.copy_from_slice(&value.to_le_bytes());
    }
    StdRng::from_seed(state)
}
