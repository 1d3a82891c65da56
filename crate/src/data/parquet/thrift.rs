//! What a Parquet file declares, checked before its library believes it: sizes of pages, lists and
//! dictionaries, the depth of the schema, pages that need a dictionary which is not there.
//!
//! Declarations are in Thrift's compact protocol.

use crate::error::{Error, Result};

/// Structs within each other, in a declaration and in the schema.
const DEEPEST: usize = 32;
/// The fewest bytes of a struct in a list; the library makes room for each before it reads any.
const SMALLEST: u64 = 3;

/// Something in a declaration.
#[derive(Clone, Copy)]
enum Part {
    Integer(i64),
    /// The end of a struct.
    End,
}

/// A declaration that is read from its beginning.
struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Compact<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    fn left(&self) -> u64 {
        (self.bytes.len() - self.at) as u64
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        let is_there = bytes <= self.left();
        self.at += usize::try_from(bytes).ok().filter(|_| is_there)?;
        Some(())
    }

    /// Reads a struct; `path` holds the fields that lead to it. None where it is cut or too deep.
    fn read_struct(
        &mut self,
        path: &mut Vec<i16>,
        visit: &mut impl FnMut(&[i16], Part),
    ) -> Option<()> {
        if path.len() >= DEEPEST {
            return None;
        }
        let mut id = 0_i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                visit(path, Part::End);
                return Some(());
            }
            id = match head >> 4 {
                0 => i16::try_from(self.integer()?).ok()?,
                delta => id.checked_add(i16::from(delta))?,
            };
            path.push(id);
            match head & 0xf {
                // A boolean is its type.
                1 | 2 => visit(path, Part::Integer(i64::from(head & 0xf == 1))),
                kind => self.read_value(kind, path, visit)?,
            }
            path.pop();
        }
    }

    fn read_value(
        &mut self,
        kind: u8,
        path: &mut Vec<i16>,
        visit: &mut impl FnMut(&[i16], Part),
    ) -> Option<()> {
        match kind {
            1..=3 => self.pass(1),
            4..=6 => {
                let value = self.integer()?;
                visit(path, Part::Integer(value));
                Some(())
            }
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            9 | 10 => self.read_list(path, visit),
            12 => self.read_struct(path, visit),
            // Parquet has neither maps nor identifiers.
            _ => None,
        }
    }

    fn read_list(
        &mut self,
        path: &mut Vec<i16>,
        visit: &mut impl FnMut(&[i16], Part),
    ) -> Option<()> {
        let head = self.byte()?;
        let kind = head & 0xf;
        let size = match head >> 4 {
            0xf => self.varint()?,
            size => u64::from(size),
        };
        let smallest = if kind == 12 { SMALLEST } else { 1 };
        if size.checked_mul(smallest)? > self.left() {
            return None;
        }
        for _ in 0..size {
            self.read_value(kind, path, visit)?;
        }
        Some(())
    }
}

fn damaged(what: &str) -> Error {
    Error::input(format!("{what}; is the file damaged?"))
}

/// Checks the declarations at the end of a file.
///
/// # Errors
/// When they are cut short, declare more than can follow, or their schema is no tree of few levels.
pub fn check_footer(footer: &[u8]) -> Result<()> {
    /// Of the file's declarations: the elements of its schema, and how many children one has.
    const ELEMENT: [i16; 1] = [2];
    const CHILDREN: [i16; 2] = [2, 5];
    let mut elements = Vec::new();
    let mut children = 0;
    let read =
        Compact::new(footer).read_struct(&mut Vec::new(), &mut |path, part| match (path, part) {
            (path, Part::Integer(count)) if path == CHILDREN => children = count,
            (path, Part::End) if path == ELEMENT => elements.push(std::mem::take(&mut children)),
            _ => {}
        });
    read.ok_or_else(|| damaged("the Parquet file does not say in full what it holds"))?;
    let mut open: Vec<i64> = Vec::new();
    for (number, count) in elements.iter().enumerate() {
        let is_possible = (0..=(elements.len() - number) as i64).contains(count);
        if !is_possible || open.len() >= DEEPEST {
            return Err(damaged("the columns of the Parquet file are no tree"));
        }
        open.push(*count);
        // A column, or a group that is complete, is one child less to come.
        while open.last() == Some(&0) {
            open.pop();
            if let Some(above) = open.last_mut() {
                *above -= 1;
            }
        }
    }
    match open.is_empty() {
        true => Ok(()),
        false => Err(damaged("the columns of the Parquet file are no tree")),
    }
}

/// What the header of a page declares.
#[derive(Default)]
struct PageHeader {
    /// 0 and 3 hold values, 2 a dictionary.
    kind: i64,
    unpacked: i64,
    packed: i64,
    values: i64,
    encoding: i64,
    /// Bytes of definition and repetition levels.
    levels: [i64; 2],
}

impl PageHeader {
    /// The header of a page and its length.
    fn read(bytes: &[u8]) -> Option<(Self, usize)> {
        let mut header = Self::default();
        let mut thrift = Compact::new(bytes);
        thrift.read_struct(&mut Vec::new(), &mut |path, part| {
            let Part::Integer(value) = part else { return };
            match path {
                [1] => header.kind = value,
                [2] => header.unpacked = value,
                [3] => header.packed = value,
                [5 | 7 | 8, 1] => header.values = value,
                [5, 2] | [8, 4] => header.encoding = value,
                [8, 5] => header.levels[0] = value,
                [8, 6] => header.levels[1] = value,
                _ => {}
            }
        })?;
        Some((header, thrift.at))
    }

    /// Whether its numbers can be, where a page unpacks to `most` bytes at most.
    fn is_possible(&self, most: u64) -> bool {
        let is_size = |size: i64| u64::try_from(size).is_ok_and(|size| size <= most);
        let in_page = |part: i64| (0..=self.unpacked).contains(&part);
        [self.unpacked, self.packed].into_iter().all(is_size)
            && self.levels.into_iter().all(in_page)
            && self.values >= 0
    }
}

/// Checks the headers of all pages of a column, which lie in `chunk`: a page unpacks to `most` bytes
/// at most.
///
/// # Errors
/// When a header is cut short or declares more than there can be, when there are more than `values`
/// in all, and when texts are stored as deltas, whose lengths nothing bounds.
pub fn check_pages(mut chunk: &[u8], values: u64, most: u64) -> Result<()> {
    const DICTIONARY: i64 = 2;
    /// Lengths as deltas, and what differs from the text before.
    const TEXTS_AS_DELTAS: [i64; 2] = [6, 7];
    /// Encodings that take values from a dictionary.
    const BY_DICTIONARY: [i64; 2] = [2, 8];
    let mut declared = 0_u64;
    let mut has_dictionary = false;
    while !chunk.is_empty() {
        let header = PageHeader::read(chunk).filter(|(header, _)| header.is_possible(most));
        let (header, length) =
            header.ok_or_else(|| damaged("a page does not say what it holds"))?;
        let packed = chunk
            .get(length..)
            .and_then(|rest| rest.get(header.packed as usize..));
        chunk = packed.ok_or_else(|| damaged("a page ends behind its column"))?;
        if header.kind == DICTIONARY {
            // A value takes a bit at least.
            if header.values / 8 > header.unpacked {
                return Err(damaged(
                    "a dictionary declares more values than it can hold",
                ));
            }
            has_dictionary = true;
            continue;
        }
        if BY_DICTIONARY.contains(&header.encoding) && !has_dictionary {
            return Err(damaged("a page needs a dictionary that is not there"));
        }
        if TEXTS_AS_DELTAS.contains(&header.encoding) {
            return Err(Error::input(
                "its texts are stored as deltas, which is not read; write them with a dictionary",
            ));
        }
        declared = declared.saturating_add(header.values as u64);
        if declared > values {
            return Err(damaged(&format!(
                "the pages declare more than the {values} values that the column has"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A struct of fields with small integers and what is below them.
    fn header(fields: &[(u8, u8, &[u8])]) -> Vec<u8> {
        let field =
            |(delta, kind, value): &(u8, u8, &[u8])| [&[delta << 4 | kind][..], value].concat();
        let mut bytes: Vec<u8> = fields.iter().flat_map(field).collect();
        bytes.push(0);
        bytes
    }

    /// A page of values with this encoding, 1 byte long.
    fn page(values: u8, encoding: u8) -> Vec<u8> {
        let inner = header(&[(1, 5, &[values << 1]), (1, 5, &[encoding << 1])]);
        let mut page = header(&[(1, 5, &[0]), (1, 5, &[2]), (1, 5, &[2]), (2, 12, &inner)]);
        page.push(7);
        page
    }

    #[test]
    fn pages_of_a_column_are_counted() {
        let pages = [page(3, 0), page(4, 0)].concat();
        assert!(check_pages(&pages, 7, 1 << 20).is_ok());
        for (chunk, values, part) in [
            (&pages[..], 6, "more than the 6 values"),
            (&pages[..pages.len() - 1], 7, "ends behind its column"),
            (&pages[..pages.len() - 3], 7, "does not say what it holds"),
            (&page(3, 8), 3, "a dictionary that is not there"),
        ] {
            let error = check_pages(chunk, values, 1 << 20).expect_err(part);
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    #[test]
    fn a_schema_without_an_end_is_refused() {
        // A list of schema elements, each with so many children.
        let footer = |children: &[u8]| {
            let elements = children
                .iter()
                .flat_map(|n| header(&[(4, 8, &[1, b'a']), (1, 5, &[n << 1])]));
            let list = [
                &[(children.len() as u8) << 4 | 12][..],
                &elements.collect::<Vec<_>>(),
            ]
            .concat();
            header(&[(1, 5, &[2]), (1, 9, &list)])
        };
        assert!(check_footer(&footer(&[2, 0, 1, 0])).is_ok());
        for children in [&[2, 0][..], &[60, 0, 0], &[0, 0]] {
            let found = check_footer(&footer(children));
            // What follows a complete tree is a second one, which the library refuses.
            assert_eq!(found.is_ok(), children == [0, 0], "{children:?}");
        }
        assert!(check_footer(&footer(&[1, 0])[..6]).is_err());
    }
}
