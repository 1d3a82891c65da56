//! Results as figures, tables and documents, the same for the terminal and the page. [`draw`] holds
//! what all of them are made of, [`Table`] is the one model of a table, [`evaluation`] shows one
//! evaluation and [`runs`] many.

pub mod draw;
pub mod evaluation;
pub mod runs;
mod table;

pub use table::{Cell, Column, ColumnKind, Content, Emphasis, NONE, Number, Precision, Table};
