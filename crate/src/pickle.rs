//! Python's pickle: read without calling anything.
//!
//! Classes and functions stay names, and what they would make of their arguments stays name and
//! arguments, so that a file can neither run code nor fail because a class is not known here.
//! Protocols 2 to 5 are read as far as PyTorch and numpy go, protocol 0 as far as PyTables goes.

use std::collections::HashMap;
use std::fmt;
use std::ops::Range;

/// The index of a value in its [`Pickle`]. Values may hold each other in circles.
pub type Id = usize;

/// Values that a pickle may have. The pickle of a checkpoint has a few thousand; a byte makes a
/// value that takes 40.
pub const MOST_VALUES: usize = 1 << 19;
/// Bytes of class names for each byte of the pickle, since a pickle may put one name together many
/// times.
const NAMES: usize = 16;

/// A value.
#[derive(Debug)]
pub enum Node {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    /// A list, tuple or set.
    List(Vec<Id>),
    /// A dictionary of any kind.
    Dict(Vec<(Id, Id)>),
    /// `module.name` of a class or function.
    Global(String),
    /// What a class or function would make of its arguments, with the state it would be given then.
    Object {
        /// A [`Node::Global`].
        class: Id,
        arguments: Id,
        state: Option<Id>,
    },
    /// What the pickle says of something stored outside of it.
    Persistent(Id),
    /// Where bytes lie in the pickle.
    Bytes(Range<usize>),
    /// Numbers of more than 64 bits, and what objects make.
    Other,
}

/// Why a pickle cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It has more than [`MOST_VALUES`].
    TooManyValues,
    /// It makes no sense at this byte, or has an opcode that is not read here.
    At { position: usize, code: u8 },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyValues => write!(f, "the pickle has more than {MOST_VALUES} values"),
            Self::At { position, code } => write!(
                f,
                "the pickle cannot be read at byte {position} (code 0x{code:02x})"
            ),
        }
    }
}

/// A pickle's values.
#[derive(Debug)]
pub struct Pickle {
    nodes: Vec<Node>,
    root: Id,
}

/// Whether the bytes may be a pickle of protocol 2 or later.
pub fn is_pickle(bytes: &[u8]) -> bool {
    matches!(bytes, [0x80, 2..=5, ..])
}

impl Pickle {
    /// Reads a pickle.
    ///
    /// # Errors
    /// When it is damaged, asks for what is not read here, or is too large.
    pub fn read(bytes: &[u8]) -> Result<Self, Fault> {
        Self::read_first(bytes).map(|(pickle, _)| pickle)
    }

    /// Reads a pickle that other bytes may follow, and says how many bytes it has.
    ///
    /// # Errors
    /// As [`Pickle::read`].
    pub fn read_first(bytes: &[u8]) -> Result<(Self, usize), Fault> {
        let mut machine = Machine {
            input: bytes,
            position: 0,
            is_text: bytes.first() != Some(&0x80),
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
            names_left: bytes.len().saturating_mul(NAMES),
        };
        let root = machine.run().ok_or_else(|| {
            if machine.nodes.len() >= MOST_VALUES {
                return Fault::TooManyValues;
            }
            let position = machine.position.saturating_sub(1);
            let code = bytes.get(position).copied().unwrap_or_default();
            Fault::At { position, code }
        })?;
        let pickle = Self {
            nodes: machine.nodes,
            root,
        };
        Ok((pickle, machine.position))
    }

    /// All that the pickle says of things stored outside of it.
    pub fn persistent(&self) -> impl Iterator<Item = &[Id]> {
        self.nodes.iter().filter_map(|node| match node {
            Node::Persistent(id) => self.items(*id),
            _ => None,
        })
    }

    /// The value that was saved.
    pub fn root(&self) -> Id {
        self.root
    }

    /// A value.
    pub fn node(&self, id: Id) -> &Node {
        self.nodes.get(id).unwrap_or(&Node::None)
    }

    /// The entries of a dictionary; none for anything else.
    pub fn entries(&self, id: Id) -> &[(Id, Id)] {
        match self.node(id) {
            Node::Dict(entries) => entries,
            _ => &[],
        }
    }

    /// The value under a key of a dictionary.
    pub fn get(&self, dict: Id, key: &str) -> Option<Id> {
        let mut entries = self.entries(dict).iter().rev();
        entries
            .find(|(found, _)| self.text(*found) == Some(key))
            .map(|(_, value)| *value)
    }

    /// A text.
    pub fn text(&self, id: Id) -> Option<&str> {
        match self.node(id) {
            Node::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The items of a list or tuple.
    pub fn items(&self, id: Id) -> Option<&[Id]> {
        match self.node(id) {
            Node::List(items) => Some(items),
            _ => None,
        }
    }

    /// A size or offset.
    pub fn size(&self, id: Id) -> Option<usize> {
        match self.node(id) {
            Node::Int(value) => usize::try_from(*value).ok(),
            _ => None,
        }
    }

    /// The name of the class of an object.
    pub fn class(&self, object: Id) -> Option<&str> {
        match self.node(object) {
            Node::Object { class, .. } => match self.node(*class) {
                Node::Global(name) => Some(name),
                _ => None,
            },
            _ => None,
        }
    }
}

/// The stack machine that a pickle is a program for. `None` from any of its steps: the program
/// makes no sense.
struct Machine<'a> {
    input: &'a [u8],
    position: usize,
    /// Whether it states no protocol, as the first ones do, which write numbers and texts as lines.
    is_text: bool,
    nodes: Vec<Node>,
    stack: Vec<Id>,
    /// Heights of the stack.
    marks: Vec<usize>,
    memo: HashMap<usize, Id>,
    /// Bytes that names made of two texts may still take.
    names_left: usize,
}

impl<'a> Machine<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self
            .input
            .get(self.position..self.position.checked_add(count)?)?;
        self.position += count;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u8(&mut self) -> Option<usize> {
        self.array::<1>().map(|[b]| usize::from(b))
    }

    fn u16(&mut self) -> Option<usize> {
        self.array().map(|b| usize::from(u16::from_le_bytes(b)))
    }

    fn u32(&mut self) -> Option<usize> {
        usize::try_from(u32::from_le_bytes(self.array()?)).ok()
    }

    fn u64(&mut self) -> Option<usize> {
        usize::try_from(u64::from_le_bytes(self.array()?)).ok()
    }

    fn line(&mut self) -> Option<&'a str> {
        let rest = self.input.get(self.position..)?;
        let length = rest.iter().position(|b| *b == b'\n')?;
        let line = self.take(length + 1)?;
        std::str::from_utf8(&line[..length]).ok()
    }

    fn push(&mut self, node: Node) {
        self.stack.push(self.nodes.len());
        self.nodes.push(node);
    }

    fn push_text(&mut self, length: usize) -> Option<()> {
        let text = String::from_utf8_lossy(self.take(length)?).into_owned();
        self.push(Node::Text(text));
        Some(())
    }

    fn push_bytes(&mut self, length: usize) -> Option<()> {
        let start = self.position;
        self.take(length)?;
        self.push(Node::Bytes(start..self.position));
        Some(())
    }

    /// A little-endian number in two's complement.
    fn push_long(&mut self, length: usize) -> Option<()> {
        let digits = self.take(length)?;
        let fill = if digits.last().is_some_and(|b| *b >= 0x80) {
            0xff
        } else {
            0
        };
        self.push(match digits.len() {
            0..=8 => {
                let mut bytes = [fill; 8];
                bytes[..digits.len()].copy_from_slice(digits);
                Node::Int(i64::from_le_bytes(bytes))
            }
            _ => Node::Other,
        });
        Some(())
    }

    fn push_list(&mut self, length: usize) -> Option<()> {
        let items = self.stack.split_off(self.stack.len().checked_sub(length)?);
        self.push(Node::List(items));
        Some(())
    }

    /// What was pushed since the last mark.
    fn since_mark(&mut self) -> Option<Vec<Id>> {
        let height = self.marks.pop()?;
        (height <= self.stack.len()).then(|| self.stack.split_off(height))
    }

    fn extend_list(&mut self, added: &[Id]) -> Option<()> {
        // Other classes with an `append` are not containers that a checkpoint needs.
        if let Node::List(items) = &mut self.nodes[*self.stack.last()?] {
            items.extend(added);
        }
        Some(())
    }

    fn extend_dict(&mut self, added: &[Id]) -> Option<()> {
        if !added.len().is_multiple_of(2) {
            return None;
        }
        if let Node::Dict(entries) = &mut self.nodes[*self.stack.last()?] {
            entries.extend(added.chunks_exact(2).map(|pair| (pair[0], pair[1])));
        }
        Some(())
    }

    fn memorise(&mut self, index: usize) -> Option<()> {
        self.memo.insert(index, *self.stack.last()?);
        Some(())
    }

    fn recall(&mut self, index: usize) -> Option<()> {
        self.stack.push(*self.memo.get(&index)?);
        Some(())
    }

    /// What a class or function makes of arguments: containers and parameters are what they hold.
    fn make(&mut self) -> Option<()> {
        let (arguments, class) = (self.stack.pop()?, self.stack.pop()?);
        let (Node::Global(name), Node::List(items)) = (&self.nodes[class], &self.nodes[arguments])
        else {
            self.push(Node::Other);
            return Some(());
        };
        let node = match name.as_str() {
            "collections.OrderedDict" | "collections.defaultdict" => Node::Dict(Vec::new()),
            "torch._utils._rebuild_parameter" => {
                self.stack.push(*items.first()?);
                return Some(());
            }
            _ => Node::Object {
                class,
                arguments,
                state: None,
            },
        };
        self.push(node);
        Some(())
    }

    fn run(&mut self) -> Option<Id> {
        loop {
            if self.nodes.len() >= MOST_VALUES {
                return None;
            }
            match self.array::<1>()?[0] {
                // STOP
                b'.' => return self.stack.pop(),
                code => self.step(code)?,
            }
        }
    }

    /// Carries out an opcode; none for what protocol 2 has better codes for, and extensions.
    fn step(&mut self, code: u8) -> Option<()> {
        match code {
            // PROTO, FRAME
            0x80 => _ = self.take(1)?,
            0x95 => _ = self.take(8)?,
            // MARK, POP, POP_MARK, DUP
            b'(' => self.marks.push(self.stack.len()),
            b'0' => _ = self.stack.pop()?,
            b'1' => _ = self.since_mark()?,
            b'2' => self.stack.push(*self.stack.last()?),
            b'N' | 0x88..=0x8b | b'J' | b'K' | b'M' | b'G' => self.step_scalar(code)?,
            b'X' | b'T' | b'U' | b'B' | b'C' | 0x8c..=0x8e | 0x96 => self.step_string(code)?,
            b']' | b')' | b't' | b'l' | b'a' | b'e' | 0x85..=0x87 | 0x8f..=0x91 => {
                self.step_list(code)?;
            }
            b'}' | b'd' | b's' | b'u' => self.step_dict(code)?,
            b'c' | 0x93 => self.step_global(code)?,
            b'R' | b'b' | 0x81 | 0x92 => self.step_object(code)?,
            b'q' | b'r' | b'h' | b'j' | 0x94 => self.step_memo(code)?,
            b'I' | b'L' | b'F' | b'S' | b'V' | b'p' | b'g' if self.is_text => {
                self.step_line(code)?;
            }
            // BINPERSID
            b'Q' => {
                let id = self.stack.pop()?;
                self.push(Node::Persistent(id));
            }
            _ => return None,
        }
        Some(())
    }

    /// None, booleans and numbers.
    fn step_scalar(&mut self, code: u8) -> Option<()> {
        match code {
            // NONE, NEWTRUE, NEWFALSE
            b'N' => self.push(Node::None),
            0x88 => self.push(Node::Bool(true)),
            0x89 => self.push(Node::Bool(false)),
            // BININT, BININT1, BININT2, LONG1, LONG4, BINFLOAT
            b'J' => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Node::Int(value.into()));
            }
            b'K' => self.push_long_of(1)?,
            b'M' => self.push_long_of(2)?,
            0x8a => {
                let length = self.u8()?;
                self.push_long(length)?;
            }
            0x8b => {
                let length = self.u32()?;
                self.push_long(length)?;
            }
            b'G' => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Node::Float(value));
            }
            _ => return None,
        }
        Some(())
    }

    /// Texts and bytes.
    fn step_string(&mut self, code: u8) -> Option<()> {
        match code {
            // BINUNICODE, SHORT_BINUNICODE, BINUNICODE8, BINSTRING, SHORT_BINSTRING
            b'X' | b'T' => {
                let length = self.u32()?;
                self.push_text(length)?;
            }
            0x8c | b'U' => {
                let length = self.u8()?;
                self.push_text(length)?;
            }
            0x8d => {
                let length = self.u64()?;
                self.push_text(length)?;
            }
            // BINBYTES, SHORT_BINBYTES, BINBYTES8, BYTEARRAY8
            b'B' => {
                let length = self.u32()?;
                self.push_bytes(length)?;
            }
            b'C' => {
                let length = self.u8()?;
                self.push_bytes(length)?;
            }
            0x8e | 0x96 => {
                let length = self.u64()?;
                self.push_bytes(length)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Lists, tuples and sets.
    fn step_list(&mut self, code: u8) -> Option<()> {
        match code {
            // EMPTY_LIST, EMPTY_TUPLE, EMPTY_SET; TUPLE, LIST, FROZENSET; TUPLE1, TUPLE2,
            // TUPLE3
            b']' | b')' | 0x8f => self.push(Node::List(Vec::new())),
            b't' | b'l' | 0x91 => {
                let items = self.since_mark()?;
                self.push(Node::List(items));
            }
            0x85..=0x87 => self.push_list(usize::from(code - 0x84))?,
            // APPEND, APPENDS, ADDITEMS
            b'a' => {
                let item = self.stack.pop()?;
                self.extend_list(&[item])?;
            }
            b'e' | 0x90 => {
                let items = self.since_mark()?;
                self.extend_list(&items)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Dictionaries.
    fn step_dict(&mut self, code: u8) -> Option<()> {
        match code {
            // EMPTY_DICT, DICT, SETITEM, SETITEMS
            b'}' => self.push(Node::Dict(Vec::new())),
            b'd' => {
                let items = self.since_mark()?;
                self.push(Node::Dict(Vec::new()));
                self.extend_dict(&items)?;
            }
            b's' => {
                let (value, key) = (self.stack.pop()?, self.stack.pop()?);
                self.extend_dict(&[key, value])?;
            }
            b'u' => {
                let items = self.since_mark()?;
                self.extend_dict(&items)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Names of classes and functions.
    fn step_global(&mut self, code: u8) -> Option<()> {
        match code {
            // GLOBAL, STACK_GLOBAL
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Node::Global(format!("{module}.{name}")));
            }
            0x93 => {
                let (name, module) = (self.stack.pop()?, self.stack.pop()?);
                let (Node::Text(name), Node::Text(module)) =
                    (&self.nodes[name], &self.nodes[module])
                else {
                    return None;
                };
                let length = module.len() + 1 + name.len();
                self.names_left = self.names_left.checked_sub(length)?;
                let name = format!("{module}.{name}");
                self.push(Node::Global(name));
            }
            _ => return None,
        }
        Some(())
    }

    /// What classes and functions make.
    fn step_object(&mut self, code: u8) -> Option<()> {
        match code {
            // REDUCE, NEWOBJ, NEWOBJ_EX
            b'R' | 0x81 => self.make()?,
            0x92 => {
                self.stack.pop()?;
                self.make()?;
            }
            // BUILD: what it sets on a dictionary is not among its entries.
            b'b' => {
                let given = self.stack.pop()?;
                if let Node::Object { state, .. } = &mut self.nodes[*self.stack.last()?] {
                    *state = Some(given);
                }
            }
            _ => return None,
        }
        Some(())
    }

    /// The memo, by which values are shared.
    fn step_memo(&mut self, code: u8) -> Option<()> {
        match code {
            // BINPUT, LONG_BINPUT, MEMOIZE, BINGET, LONG_BINGET
            b'q' => {
                let index = self.u8()?;
                self.memorise(index)?;
            }
            b'r' => {
                let index = self.u32()?;
                self.memorise(index)?;
            }
            0x94 => self.memorise(self.memo.len())?,
            b'h' => {
                let index = self.u8()?;
                self.recall(index)?;
            }
            b'j' => {
                let index = self.u32()?;
                self.recall(index)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// What the first protocol writes as a line.
    fn step_line(&mut self, code: u8) -> Option<()> {
        let line = self.line()?;
        let node = match code {
            // PUT, GET
            b'p' => return self.memorise(line.parse().ok()?),
            b'g' => return self.recall(line.parse().ok()?),
            // INT, which has the booleans too, LONG, FLOAT
            b'I' if line == "00" || line == "01" => Node::Bool(line == "01"),
            b'I' => Node::Int(line.parse().ok()?),
            b'L' => Node::Int(line.trim_end_matches('L').parse().ok()?),
            b'F' => Node::Float(line.parse().ok()?),
            // STRING, in quotes, and UNICODE
            b'S' => {
                let quote = line.chars().next().filter(|c| ['\'', '"'].contains(c))?;
                Node::Text(line.strip_prefix(quote)?.strip_suffix(quote)?.to_owned())
            }
            _ => Node::Text(unescaped(line)?),
        };
        self.push(node);
        Some(())
    }

    /// A positive number of one or two bytes.
    fn push_long_of(&mut self, length: usize) -> Option<()> {
        let value = if length == 1 { self.u8()? } else { self.u16()? };
        self.push(Node::Int(i64::try_from(value).ok()?));
        Some(())
    }
}

/// A text of the first protocol, which writes what is not Latin-1 as `\uXXXX` or `\UXXXXXXXX`.
fn unescaped(line: &str) -> Option<String> {
    let mut out = String::new();
    let mut rest = line;
    while let Some((before, after)) = rest.split_once('\\') {
        out.push_str(before);
        let length = match after.as_bytes().first() {
            Some(b'u') => 4,
            Some(b'U') => 8,
            _ => {
                out.push('\\');
                rest = after;
                continue;
            }
        };
        let digits = after.get(1..=length)?;
        out.push(char::from_u32(u32::from_str_radix(digits, 16).ok()?)?);
        rest = &after[1 + length..];
    }
    out.push_str(rest);
    Some(out)
}
