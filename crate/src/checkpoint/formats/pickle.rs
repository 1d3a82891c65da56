//! Python's pickle as far as `torch.save` goes: read without calling anything.
//!
//! Classes and functions stay names, and what they would make of their arguments stays name and
//! arguments, so that a file can neither run code nor fail because a class is not known here.

use std::collections::HashMap;

use serde_json::{Map, Value};

use crate::error::{Error, Result};

/// The index of a value in its [`Pickle`]. Values may hold each other in circles.
pub type Id = usize;

/// Values that a pickle may have. The pickle of a checkpoint has a few thousand; a byte makes a
/// value that takes 40.
const MOST_VALUES: usize = 1 << 19;
/// Bytes of class names for each byte of the pickle, since a pickle may put one name together many
/// times.
const NAMES: usize = 16;
/// What the JSON of one value may cost: a byte of text costs 1, a value [`VALUE`].
const MOST_OF_ONE: usize = 1 << 19;
/// What the JSON of all values of a pickle may cost.
const MOST_OF_ALL: usize = 1 << 22;
const VALUE: usize = 16;

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
    /// Bytes, numbers of more than 64 bits, and what objects make.
    Other,
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

/// Whether the bytes begin as `torch.save` began them before 1.6: with a pickle of a magic number.
pub fn is_legacy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.")
}

impl Pickle {
    /// Reads a pickle.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        Self::read_first(bytes).map(|(pickle, _)| pickle)
    }

    /// Reads a pickle that other bytes may follow, and says how many bytes it has.
    pub fn read_first(bytes: &[u8]) -> Result<(Self, usize)> {
        let mut machine = Machine {
            input: bytes,
            position: 0,
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
            names_left: bytes.len().saturating_mul(NAMES),
        };
        let root = machine.run().ok_or_else(|| {
            if machine.nodes.len() >= MOST_VALUES {
                return Error::input(format!(
                    "the pickle has more than {MOST_VALUES} values besides the weights; save only model.state_dict()"
                ));
            }
            let position = machine.position.saturating_sub(1);
            let code = bytes.get(position).copied().unwrap_or_default();
            Error::input(format!(
                "the pickle cannot be read at byte {position} of {} (code 0x{code:02x}); the file is damaged or torch.save \
                 did not write it",
                bytes.len()
            ))
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

    /// `left` ends what repeats itself, `depth` what holds itself.
    fn json_within(&self, id: Id, depth: usize, left: &mut usize) -> Option<Value> {
        let depth = depth.checked_sub(1)?;
        pay(left, VALUE)?;
        let mut paid = |text: &str| pay(left, text.len()).map(|()| text.to_owned());
        Some(match self.node(id) {
            Node::None | Node::Other => Value::Null,
            Node::Bool(value) => (*value).into(),
            Node::Int(value) => (*value).into(),
            Node::Float(value) => (*value).into(),
            Node::Text(text) => paid(text)?.into(),
            Node::List(items) => items
                .iter()
                .map(|item| self.json_within(*item, depth, left))
                .collect::<Option<Vec<_>>>()?
                .into(),
            Node::Dict(entries) => {
                let mut map = Map::new();
                for (key, value) in entries {
                    let key = match self.node(*key) {
                        Node::Text(text) => {
                            pay(left, text.len())?;
                            text.clone()
                        }
                        Node::Int(number) => number.to_string(),
                        _ => continue,
                    };
                    map.insert(key, self.json_within(*value, depth, left)?);
                }
                map.into()
            }
            Node::Global(name) => paid(name)?.into(),
            Node::Object { state, .. } => {
                let inner =
                    state.and_then(|state| self.get(state, "_content").or(self.get(state, "_val")));
                match inner {
                    Some(inner) => self.json_within(inner, depth, left)?,
                    None => paid(self.class(id)?)?.into(),
                }
            }
            Node::Persistent(_) => Value::Null,
        })
    }
}

/// Takes `cost` from what is left; `None`, and nothing taken, when there is less.
fn pay(left: &mut usize, cost: usize) -> Option<()> {
    *left = left.checked_sub(cost)?;
    Some(())
}

/// Values of a [`Pickle`] as JSON, within a budget for all of them: values that share their parts
/// make JSON of any size from a small file.
pub struct ToJson<'a> {
    pickle: &'a Pickle,
    left: usize,
}

impl<'a> ToJson<'a> {
    pub fn new(pickle: &'a Pickle) -> Self {
        Self {
            pickle,
            left: MOST_OF_ALL,
        }
    }

    /// A value as JSON, OmegaConf's containers as what they contain; `None` when it is larger than
    /// a configuration.
    ///
    /// # Errors
    /// When the values so far are larger than those of any checkpoint.
    pub fn value(&mut self, id: Id) -> Result<Option<Value>> {
        let most = MOST_OF_ONE.min(self.left);
        let mut left = most;
        let value = self.pickle.json_within(id, 64, &mut left);
        self.left -= most - left;
        if value.is_none() && most < MOST_OF_ONE {
            return Err(Error::input(format!(
                "the values saved with the weights make more than {MOST_OF_ALL} bytes; the file is damaged, or save only \
                 model.state_dict()"
            )));
        }
        Ok(value)
    }
}

/// The stack machine that a pickle is a program for. `None` from any of its steps: the program
/// makes no sense.
struct Machine<'a> {
    input: &'a [u8],
    position: usize,
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

    fn push_other(&mut self, length: usize) -> Option<()> {
        self.take(length)?;
        self.push(Node::Other);
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

    /// Texts, and bytes, which no checkpoint needs.
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
                self.push_other(length)?;
            }
            b'C' => {
                let length = self.u8()?;
                self.push_other(length)?;
            }
            0x8e | 0x96 => {
                let length = self.u64()?;
                self.push_other(length)?;
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
                pay(&mut self.names_left, module.len() + 1 + name.len())?;
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

    /// A positive number of one or two bytes.
    fn push_long_of(&mut self, length: usize) -> Option<()> {
        let value = if length == 1 { self.u8()? } else { self.u16()? };
        self.push(Node::Int(i64::try_from(value).ok()?));
        Some(())
    }
}
