//! What a model's file says of it, checked before anything runs.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fmt;

use prost::Message as _;
use serde::Serialize;

use super::operators::OPERATORS;
use super::proto;
use crate::error::{Error, Result};

/// The newest operator set whose operators mean what the runtime computes.
const NEWEST_OPSET: i64 = 26;

/// The domains of ONNX's own operators.
const DOMAINS: [&str; 2] = ["", "ai.onnx"];

/// Where a tensor's values are, if not in the file.
const EXTERNAL: i32 = 1;

/// The constants of a node's attribute, which need no operator.
const CONSTANT: &str = "Constant";

/// A model's file without its weights.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Graph {
    /// Version of the operator set.
    pub opset: i64,
    /// The image.
    pub input: Port,
    /// What comes out, in order.
    pub outputs: Vec<Port>,
    /// Names of the operators.
    pub operators: BTreeSet<String>,
    /// Texts by key.
    pub metadata: BTreeMap<String, String>,
}

/// An input or an output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Port {
    /// Its name.
    pub name: String,
    /// What its values are.
    pub element: Element,
    /// Its extents, where the file says them; `None` for one that is free.
    pub shape: Option<Vec<Option<usize>>>,
}

/// What the values of a tensor are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Element {
    /// Floats of 16, 32 or 64 bits; all are computed in 32.
    Float,
    /// Unsigned bytes.
    Byte,
    /// 32-bit integers.
    Integer,
    /// Something else, which neither goes in nor comes out here.
    Other,
}

impl Graph {
    /// Whether the bytes are an ONNX model, by the fields that every one has.
    pub fn is_onnx(bytes: &[u8]) -> bool {
        proto::Model::decode(bytes)
            .is_ok_and(|model| model.ir_version.is_some() && model.graph.is_some())
    }

    /// Reads a model's file.
    ///
    /// # Errors
    /// When it is no ONNX model, its operator set is too new, it has operators that do not run
    /// (named), weights in another file, or no image as its only input.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        let model = proto::Model::decode(bytes).map_err(|e| {
            Error::input(format!(
                "not an ONNX model, or a damaged one: {e}; expected what `torch.onnx.export` writes"
            ))
        })?;
        let graph = model.graph.as_ref().ok_or_else(|| {
            Error::input("not an ONNX model: there is no graph in it; expected what `torch.onnx.export` writes")
        })?;
        let opset = opset(&model)?;
        let mut operators = Operators::default();
        operators.visit(graph);
        operators.check(opset)?;
        let metadata = model.metadata_props.iter();
        Ok(Self {
            opset,
            input: image_of(graph)?,
            outputs: outputs_of(graph)?,
            operators: operators.known,
            metadata: metadata
                .map(|entry| (entry.key.clone(), entry.value.clone()))
                .collect(),
        })
    }
}

fn opset(model: &proto::Model) -> Result<i64> {
    let own = |set: &&proto::OperatorSet| DOMAINS.contains(&set.domain.as_str());
    let version = model.opset_import.iter().find(own).map(|set| set.version);
    let version = version
        .ok_or_else(|| Error::input("the model names no operator set of ONNX; export it again"))?;
    match version {
        1..=NEWEST_OPSET => Ok(version),
        _ => Err(Error::input(format!(
            "the model uses operator set {version}; expected 1 to {NEWEST_OPSET}: export it with \
             `torch.onnx.export(…, opset_version=17)`, or convert it with `onnx.version_converter`"
        ))),
    }
}

/// The operators and tensors of a graph and of those in its attributes.
#[derive(Default)]
struct Operators {
    known: BTreeSet<String>,
    unknown: BTreeSet<String>,
    external: Option<String>,
}

impl Operators {
    fn visit(&mut self, graph: &proto::Graph) {
        graph.initializer.iter().for_each(|tensor| self.see(tensor));
        for node in &graph.node {
            let own = DOMAINS.contains(&node.domain.as_str());
            let name = match own {
                true => node.op_type.clone(),
                false => format!("{}.{}", node.domain, node.op_type),
            };
            let runs =
                own && (node.op_type == CONSTANT || OPERATORS.contains(&node.op_type.as_str()));
            match runs {
                true => self.known.insert(name),
                false => self.unknown.insert(name),
            };
            for attribute in &node.attribute {
                attribute.tensor.iter().for_each(|tensor| self.see(tensor));
                let graphs = attribute.graph.iter().chain(&attribute.graphs);
                graphs.for_each(|graph| self.visit(graph));
            }
        }
    }

    fn see(&mut self, tensor: &proto::Tensor) {
        if self.external.is_none()
            && (tensor.data_location == EXTERNAL || !tensor.external_data.is_empty())
        {
            let location = tensor
                .external_data
                .iter()
                .find(|entry| entry.key == "location");
            self.external = Some(location.map_or_else(String::new, |entry| entry.value.clone()));
        }
    }

    fn check(&self, opset: i64) -> Result<()> {
        if !self.unknown.is_empty() {
            let names: Vec<&str> = self.unknown.iter().map(String::as_str).collect();
            return Err(Error::input(format!(
                "the model has operators that do not run here: {}; expected those of ONNX that image models use \
                 (operator set {opset} has others, too): export the model without them, or run it elsewhere and score \
                 its keypoints as a table",
                names.join(", ")
            )));
        }
        match &self.external {
            Some(location) => Err(Error::input(format!(
                "weights of the model lie in another file{}; expected all in one: \
                 `onnx.save(onnx.load(\"model.onnx\"), \"one.onnx\")` in Python puts them together",
                match location.as_str() {
                    "" => String::new(),
                    location => format!(" ({location})"),
                }
            ))),
            None => Ok(()),
        }
    }
}

/// The only input that is not a weight.
fn image_of(graph: &proto::Graph) -> Result<Port> {
    let weights: HashSet<&str> = graph.initializer.iter().map(|t| t.name.as_str()).collect();
    let given = graph
        .input
        .iter()
        .filter(|input| !weights.contains(input.name.as_str()));
    let inputs: Vec<Port> = given.map(port).collect();
    let [input] = &inputs[..] else {
        return Err(Error::input(format!(
            "the model takes {}; expected one input, an image",
            match inputs.is_empty() {
                true => "no input".to_owned(),
                false => format!("{} inputs: {}", inputs.len(), list(&inputs)),
            }
        )));
    };
    if input.element == Element::Other {
        return Err(Error::input(format!(
            "the model takes {input} of values that are neither floats, unsigned bytes nor 32-bit integers; expected an \
             image of those"
        )));
    }
    match input.shape.as_ref().is_none_or(|shape| shape.len() == 4) {
        true => Ok(input.clone()),
        false => Err(Error::input(format!(
            "the model takes {input}; expected an image: batch, channels, height and width, or the channels last"
        ))),
    }
}

fn outputs_of(graph: &proto::Graph) -> Result<Vec<Port>> {
    match graph.output.is_empty() {
        true => Err(Error::input(
            "the model has no output; expected heat maps or points",
        )),
        false => Ok(graph.output.iter().map(port).collect()),
    }
}

fn port(value: &proto::ValueInfo) -> Port {
    let tensor = value.r#type.as_ref().and_then(|t| t.tensor.as_ref());
    let extents = |shape: &proto::Shape| {
        // 0 and less are how some exporters write a free extent.
        let extent = |dim: &proto::Dimension| usize::try_from(dim.value?).ok().filter(|v| *v > 0);
        shape.dim.iter().map(extent).collect()
    };
    Port {
        name: value.name.clone(),
        element: match tensor.map(|tensor| tensor.element) {
            Some(1 | 10 | 11) => Element::Float,
            Some(2) => Element::Byte,
            Some(6) => Element::Integer,
            _ => Element::Other,
        },
        shape: tensor.and_then(|tensor| tensor.shape.as_ref()).map(extents),
    }
}

/// Inputs or outputs, one after the other.
pub(super) fn list(ports: &[Port]) -> String {
    let ports: Vec<String> = ports.iter().map(Port::to_string).collect();
    ports.join(", ")
}

impl fmt::Display for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.name)?;
        let Some(shape) = &self.shape else {
            return f.write_str(" of any shape");
        };
        let extents: Vec<String> = shape
            .iter()
            .map(|extent| extent.map_or_else(|| "?".to_owned(), |v| v.to_string()))
            .collect();
        write!(f, " [{}]", extents.join(", "))
    }
}
