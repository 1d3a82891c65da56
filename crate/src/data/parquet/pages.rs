//! Pages of a column, which are looked at before they are decoded: the library slices them by the
//! numbers and the lengths that they declare.

use parquet::basic::{Encoding, Type as Physical};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};

use super::columns::Column;

/// Values of a block of deltas; writers take 128 or 256.
const MOST_IN_BLOCK: u64 = 1 << 16;

/// Passes on the pages of a column that hold what they declare.
pub struct CheckedPages {
    pages: Box<dyn PageReader>,
    physical: Physical,
    /// The levels of definition and repetition of a value.
    levels: [i16; 2],
}

impl CheckedPages {
    pub fn new(pages: Box<dyn PageReader>, column: &Column) -> Self {
        Self {
            pages,
            physical: column.physical,
            levels: column.levels(),
        }
    }

    fn check(&self, page: &Page) -> Option<()> {
        match page {
            Page::DictionaryPage {
                buf, num_values, ..
            } => self.check_values(Encoding::PLAIN, buf, u64::from(*num_values)),
            Page::DataPage {
                buf,
                num_values,
                encoding,
                ..
            } => {
                let count = u64::from(*num_values);
                let (definition, values) = self.divided(buf)?;
                let defined = match self.levels[0] {
                    0 => count,
                    level => defined(definition, count, level)?,
                };
                self.check_values(*encoding, values, defined)
            }
            Page::DataPageV2 {
                buf,
                num_values,
                encoding,
                num_nulls,
                def_levels_byte_len,
                rep_levels_byte_len,
                ..
            } => {
                let levels = def_levels_byte_len.checked_add(*rep_levels_byte_len)?;
                let values = buf.get(levels as usize..)?;
                let count = num_values.checked_sub(*num_nulls)?;
                self.check_values(*encoding, values, u64::from(count))
            }
        }
    }

    /// The definition levels of a page of version 1 and its values, which stand behind the levels.
    fn divided<'a>(&self, mut page: &'a [u8]) -> Option<(&'a [u8], &'a [u8])> {
        let mut part = || {
            let (length, rest) = page.split_first_chunk()?;
            let (levels, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            page = rest;
            Some(levels)
        };
        let [definition, repetition] = self.levels;
        if repetition > 0 {
            part()?;
        }
        let levels = if definition > 0 { part()? } else { &[] };
        Some((levels, page))
    }

    /// Checks `count` values.
    fn check_values(&self, encoding: Encoding, values: &[u8], count: u64) -> Option<()> {
        match (encoding, self.physical) {
            (Encoding::PLAIN, Physical::BYTE_ARRAY) => texts(values, count),
            (Encoding::DELTA_BINARY_PACKED, _) => {
                let in_block = varint(values)?.0;
                (in_block <= MOST_IN_BLOCK).then_some(())
            }
            // The bytes of all values stand together by their place in a value.
            (Encoding::BYTE_STREAM_SPLIT, Physical::FLOAT | Physical::INT32) => {
                (count <= values.len() as u64 / 4).then_some(())
            }
            (Encoding::BYTE_STREAM_SPLIT, _) => (count <= values.len() as u64 / 8).then_some(()),
            _ => Some(()),
        }
    }
}

impl PageReader for CheckedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.pages.get_next_page()?;
        match page.as_ref().is_none_or(|page| self.check(page).is_some()) {
            true => Ok(page),
            false => Err(ParquetError::General(
                "a page does not hold what it declares".to_owned(),
            )),
        }
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.pages.skip_next_page()
    }

    fn at_record_boundary(&mut self) -> Result<bool> {
        self.pages.at_record_boundary()
    }
}

impl Iterator for CheckedPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

/// Checks that there are `count` texts, each behind its length.
fn texts(mut bytes: &[u8], count: u64) -> Option<()> {
    for _ in 0..count {
        let (length, rest) = bytes.split_first_chunk()?;
        bytes = rest.get(u32::from_le_bytes(*length) as usize..)?;
    }
    Some(())
}

/// A number of 7 bits a byte, and what follows.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0;
    for (at, byte) in bytes.iter().enumerate().take(9) {
        value |= u64::from(byte & 0x7f) << (7 * at);
        if *byte < 0x80 {
            return Some((value, &bytes[at + 1..]));
        }
    }
    None
}

/// How many of `count` definition levels are `most`, which is that of a value that is there. Levels
/// are runs, or groups of 8 in as many bits as `most` has.
fn defined(mut levels: &[u8], count: u64, most: i16) -> Option<u64> {
    let most = u64::from(most.cast_unsigned());
    let width = u64::from(u64::BITS - most.leading_zeros());
    let (mut left, mut defined) = (count, 0);
    while left > 0 {
        let (head, rest) = varint(levels)?;
        let length = head >> 1;
        if head & 1 == 0 {
            // Levels of lists are small: one byte.
            let (level, rest) = rest.split_first()?;
            let run = length.min(left);
            defined += if u64::from(*level) == most { run } else { 0 };
            (left, levels) = (left - run, rest);
        } else {
            let bytes = usize::try_from(length.checked_mul(width)?).ok()?;
            let (group, rest) = rest.split_at_checked(bytes)?;
            let run = length.checked_mul(8)?.min(left);
            let bit = |at: u64| group[(at / 8) as usize] >> (at % 8) & 1;
            let level =
                |at: u64| (0..width).fold(0, |all, i| all | u64::from(bit(at * width + i)) << i);
            defined += (0..run).filter(|at| level(*at) == most).count() as u64;
            (left, levels) = (left - run, rest);
        }
        if length == 0 {
            return None;
        }
    }
    Some(defined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_counted_in_runs_and_groups() {
        // Twelve of 1, then eight of one bit each.
        assert_eq!(defined(&[12 << 1, 1, 3, 0b1010_0001], 20, 1), Some(15));
        assert_eq!(defined(&[12 << 1, 1, 3, 0b1010_0001], 15, 1), Some(13));
        // Two bits each: 3, 2, 3, 0, 0, 0, 0, 3.
        assert_eq!(defined(&[3, 0b0011_1011, 0b1100_0000], 8, 3), Some(3));
        for cut in [&[][..], &[12 << 1], &[3], &[0, 1], &[12 << 1, 1]] {
            assert_eq!(defined(cut, 20, 1), None, "{cut:?}");
        }
    }

    #[test]
    fn texts_have_the_lengths_that_they_declare() {
        let two = [&3_u32.to_le_bytes()[..], b"abc", &0_u32.to_le_bytes()].concat();
        assert!(texts(&two, 2).is_some());
        assert!(texts(&two, 3).is_none());
        assert!(texts(&two[..6], 1).is_none());
    }
}
