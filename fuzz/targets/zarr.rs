#![no_main]

#[path = "../../tests/shared/entries.rs"]
mod entries;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| entries::run("zarr", bytes));
