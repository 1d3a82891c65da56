//! A table whose columns have other names than are expected: which of them is what.

use std::str::FromStr;

use super::decode;
use super::delimited::Start;
use super::rows::Content;
use super::tidy;
use crate::data::names::quote_list;
use crate::error::{Error, ErrorKind, Result};

/// Which column of a table is what: names that are expected, each with the one that the table has in
/// its place, as `x=px,y=py,frame=t,object=label`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Columns {
    /// None where all rows have the same.
    given: Vec<(String, Option<String>)>,
}

impl FromStr for Columns {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let pair = |pair: &str| {
            let (expected, given) = pair.split_once('=')?;
            let [expected, given] = [expected, given].map(|name| name.trim().to_owned());
            (!expected.is_empty() && !given.is_empty()).then_some((expected, Some(given)))
        };
        let given: Option<Vec<_>> = text.split(',').map(pair).collect();
        let given = given.ok_or_else(|| {
            Error::input(format!(
                "`{text}` does not say which column is what; expected e.g. x=px,y=py,frame=t,object=label"
            ))
        })?;
        Ok(Self { given })
    }
}

impl Columns {
    /// Of names that are expected, each with the column in its place; none where there is none, and
    /// all rows have the same sequence or point.
    pub fn new(given: impl IntoIterator<Item = (String, Option<String>)>) -> Self {
        Self {
            given: given.into_iter().collect(),
        }
    }

    /// The names that are expected, each with the one in its place, where there is one.
    #[cfg(any(feature = "hdf5", feature = "zarr"))]
    pub(in crate::data) fn pairs(&self) -> impl Iterator<Item = (&str, &str)> {
        let given = self.given.iter();
        given.filter_map(|(expected, given)| Some((expected.as_str(), given.as_deref()?)))
    }

    /// The table with the names that are expected of ground truth, or of keypoints. Of a table with
    /// one row a point, a column for the sequence or the point that is neither there nor given is
    /// added: all rows have the same.
    ///
    /// # Errors
    /// When the table has no column of a name that is given, or is no delimited text.
    pub fn apply(&self, bytes: &[u8], is_keypoints: bool) -> Result<Vec<u8>> {
        let (text, _) = decode(bytes)?;
        if text.trim_start().starts_with(['{', '[']) {
            return Err(Error::input(
                "the file is JSON, which has no columns to be named",
            ));
        }
        let content = match is_keypoints {
            true => Content::Keypoints,
            false => Content::GroundTruth,
        };
        let start = Start::of(&text);
        let (delimiter, _) = start.delimiter();
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .has_headers(false)
            .from_reader(start.rest.as_bytes());
        let mut writer = csv::WriterBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .from_writer(Vec::new());
        let failed = |e: csv::Error| Error::input(format!("not a readable table: {e}"));
        let mut added: Vec<&str> = Vec::new();
        for (number, record) in reader.records().enumerate() {
            let record = record.map_err(failed)?;
            if number == 0 {
                let header: Vec<&str> = record.iter().map(str::trim).collect();
                let names = self.renamed(&header)?;
                added = self.added(&names, content);
                let all = names
                    .iter()
                    .map(String::as_str)
                    .chain(added.iter().copied());
                writer.write_record(all).map_err(failed)?;
                continue;
            }
            let same = added.iter().map(|name| match *name {
                "keypoint" => "0",
                name => name,
            });
            writer
                .write_record(record.iter().chain(same))
                .map_err(failed)?;
        }
        writer
            .into_inner()
            .map_err(|e| Error::new(ErrorKind::Io, e.to_string()))
    }

    /// The names of the header, those given in their place.
    fn renamed(&self, header: &[&str]) -> Result<Vec<String>> {
        let is = |a: &str, b: &str| a.eq_ignore_ascii_case(b);
        for (expected, given) in &self.given {
            let Some(given) = given else { continue };
            if !header.iter().any(|name| is(name, given)) {
                return Err(Error::input(format!(
                    "there is no column `{given}` for `{expected}`; the table has {}",
                    quote_list(header)
                )));
            }
        }
        let rename = |name: &&str| {
            let is_given = |given: &Option<String>| given.as_deref().is_some_and(|g| is(g, name));
            let found = self.given.iter().find(|(_, given)| is_given(given));
            if let Some((expected, _)) = found {
                return expected.clone();
            }
            // Another column may have the name of one that is given.
            match self.given.iter().any(|(expected, _)| is(expected, name)) {
                true => format!("other_{name}"),
                false => (*name).to_owned(),
            }
        };
        Ok(header.iter().map(rename).collect())
    }

    /// What a table with one row a point lacks.
    fn added(&self, names: &[String], content: Content) -> Vec<&'static str> {
        let has = |name: &str| names.iter().any(|found| found.eq_ignore_ascii_case(name));
        if !has("x") || !has("y") {
            return Vec::new();
        }
        let [sequence, _, point, ..] = tidy::columns(content);
        let lacking = [sequence, point].into_iter();
        lacking.filter(|name| !has(name)).collect()
    }
}
