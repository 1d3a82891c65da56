//! Points of a table that have a third coordinate.

use std::collections::HashSet;

use super::rows::Raw;
use crate::data::reading::TableOptions;
use crate::error::{Error, Reason, Result};
use crate::track::MOST_AXES;

/// Whether the points of a table, each with its name and whether it has a z, are read in space.
///
/// # Errors
/// When some have a z and others have not, and where points in space are not compiled in.
pub fn are_in_space<'a>(
    points: impl Iterator<Item = (&'a str, bool)>,
    options: &TableOptions,
) -> Result<bool> {
    let (mut with, mut without) = (None, None);
    for (name, has_z) in points {
        let found = if has_z { &mut with } else { &mut without };
        found.get_or_insert(name);
    }
    match (with, without) {
        (None, _) => Ok(false),
        _ if options.xy_only => Ok(false),
        (Some(with), _) if MOST_AXES == 2 => Err(Error::input(format!(
            "`{with}` has three coordinates, x, y and z; expected points in the image: project them with the camera \
             first, or delete the columns z to score x and y alone"
        ))
        .because(Reason::InSpace)),
        (Some(_), None) => Ok(true),
        (Some(with), Some(without)) => Err(Error::input(format!(
            "`{with}` has three coordinates, x, y and z, and `{without}` two; expected as many of every point: give \
             each a z, or score x and y alone (--xy-only)"
        ))),
    }
}

/// Checks that no point has x and y throughout and a z nowhere.
pub fn check_heights(raw: &Raw) -> Result<()> {
    let (mut high, mut flat) = (HashSet::new(), None);
    for (row, z) in raw.rows.iter().zip(&raw.heights) {
        if z.is_finite() {
            high.insert(row.point);
        }
    }
    for row in &raw.rows {
        if row.xy.iter().all(|v| v.is_finite()) && !high.contains(&row.point) {
            flat.get_or_insert(row);
        }
    }
    match flat.filter(|_| !raw.heights.is_empty()) {
        Some(row) => Err(Error::input(format!(
            "`{}` has x and y and nowhere a z; expected three coordinates of every point of a table with a column for \
             z, or score x and y alone (--xy-only)",
            raw.points[row.point as usize]
        ))
        .at(raw.place(row))),
        None => Ok(()),
    }
}
