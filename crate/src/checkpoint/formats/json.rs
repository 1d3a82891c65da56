//! Values of a pickle as JSON.

use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::pickle::{Id, Node, Pickle};

/// What the JSON of one value may cost: a byte of text costs 1, a value [`VALUE`].
const MOST_OF_ONE: usize = 1 << 19;
/// What the JSON of all values of a pickle may cost.
const MOST_OF_ALL: usize = 1 << 22;
const VALUE: usize = 16;

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
        let value = self.within(id, 64, &mut left);
        self.left -= most - left;
        if value.is_none() && most < MOST_OF_ONE {
            return Err(Error::input(format!(
                "the values saved with the weights make more than {MOST_OF_ALL} bytes; the file is damaged, or save only \
                 model.state_dict()"
            )));
        }
        Ok(value)
    }

    /// `left` ends what repeats itself, `depth` what holds itself.
    fn within(&self, id: Id, depth: usize, left: &mut usize) -> Option<Value> {
        let pickle = self.pickle;
        let depth = depth.checked_sub(1)?;
        pay(left, VALUE)?;
        let mut paid = |text: &str| pay(left, text.len()).map(|()| text.to_owned());
        Some(match pickle.node(id) {
            Node::None | Node::Bytes(_) | Node::Other => Value::Null,
            Node::Bool(value) => (*value).into(),
            Node::Int(value) => (*value).into(),
            Node::Float(value) => (*value).into(),
            Node::Text(text) => paid(text)?.into(),
            Node::List(items) => items
                .iter()
                .map(|item| self.within(*item, depth, left))
                .collect::<Option<Vec<_>>>()?
                .into(),
            Node::Dict(entries) => {
                let mut map = Map::new();
                for (key, value) in entries {
                    let key = match pickle.node(*key) {
                        Node::Text(text) => {
                            pay(left, text.len())?;
                            text.clone()
                        }
                        Node::Int(number) => number.to_string(),
                        _ => continue,
                    };
                    map.insert(key, self.within(*value, depth, left)?);
                }
                map.into()
            }
            Node::Global(name) => paid(name)?.into(),
            Node::Object { state, .. } => {
                let inner = state
                    .and_then(|state| pickle.get(state, "_content").or(pickle.get(state, "_val")));
                match inner {
                    Some(inner) => self.within(inner, depth, left)?,
                    None => paid(pickle.class(id)?)?.into(),
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
