//! The SAEs as burn modules, and their training.

#[path = "../shared/reference.rs"]
mod reference;
#[path = "../shared/mod.rs"]
mod shared;

#[cfg(all(feature = "cli", feature = "gpu"))]
mod gpu;
mod model;
mod train;
