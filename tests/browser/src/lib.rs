//! Tests of the page in a real browser are in `tests/page.rs`; this crate has nothing else.
