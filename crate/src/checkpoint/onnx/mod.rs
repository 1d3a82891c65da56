//! An encoder as an ONNX model, for every program that runs such models.

mod proto;

use prost::Message as _;
use proto::{
    Attribute, Dimension, Entry, Extent, Graph, IR_VERSION, Model, Node, OPSET, OperatorSet, Shape,
    TensorType, Type, ValueInfo,
};

use super::{BATCH_NORM_EPSILON, Checkpoint, TEMPERATURE, Tensor};
use crate::error::Result;

const FLOAT: i32 = 1;
const INT64: i32 = 7;

impl Checkpoint {
    /// The encoder as an ONNX model (operator set 17).
    ///
    /// The input `image` is batch x 3 x height x width, RGB in [0, 1]; batch is free, and so are
    /// height and width unless the configuration fixes the input size. Of the outputs, `keypoints`
    /// is batch x N x 2: (x, y) in the latent space, as `tracklens extract` writes them;
    /// `keypoints_ndc` is the same points placed in the image, -1 and +1 at its outer edges. The
    /// model's metadata holds the configuration under `tracklens.config` and the checkpoint's own
    /// metadata.
    ///
    /// # Errors
    /// When a tensor is missing.
    pub fn to_onnx(&self) -> Result<Vec<u8>> {
        let mut builder = Builder::default();
        let maps = self.add_layers(&mut builder)?;
        let temperature = match self.config.trained_temperature {
            true => builder.weight(TEMPERATURE, self.tensor(TEMPERATURE)?),
            false => builder.float("temperature", self.config.temperature as f32),
        };
        builder.add_soft_argmax(&maps, &temperature, self.config.cell_positions());
        let [width, height] = match self.config.input_size {
            Some(size) => size.map(|side| Extent::Value(side as i64)),
            None => ["width", "height"].map(|name| Extent::Parameter(name.to_owned())),
        };
        let points = |name: &str, what: &str| {
            let shape = [
                batch(),
                Extent::Value(self.config.keypoints as i64),
                Extent::Value(2),
            ];
            value(name, &shape, what)
        };
        let mut metadata = self.metadata.clone();
        metadata.insert(super::tensors::CONFIG_KEY.to_owned(), self.config_json()?);
        let model = Model {
            ir_version: IR_VERSION,
            producer_name: "tracklens".to_owned(),
            producer_version: env!("CARGO_PKG_VERSION").to_owned(),
            doc_string: format!("Encoder of a {} spatial autoencoder", self.config.name()),
            graph: Some(Graph {
                name: self.config.name(),
                node: builder.nodes,
                initializer: builder.constants,
                input: vec![value(
                    "image",
                    &[batch(), Extent::Value(3), height, width],
                    "RGB in [0, 1]",
                )],
                output: vec![
                    points(
                        "keypoints",
                        "(x, y); -1 and +1 at the centres of the border cells of the last feature map",
                    ),
                    points(
                        "keypoints_ndc",
                        "(x, y); -1 and +1 at the outer edges of the image, y down",
                    ),
                ],
            }),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPSET,
            }],
            metadata_props: metadata
                .into_iter()
                .map(|(key, value)| Entry { key, value })
                .collect(),
        };
        Ok(model.encode_to_vec())
    }

    /// The layers from `image` to the feature maps, whose name is returned.
    fn add_layers(&self, builder: &mut Builder) -> Result<String> {
        let mut last = "image".to_owned();
        for layer in self.config.encoder_layers() {
            let name = &layer.name;
            let mut add = |builder: &mut Builder,
                           suffix: &str,
                           op: &str,
                           more: Vec<String>,
                           with: Vec<Attribute>| {
                let inputs = [vec![last.clone()], more].concat();
                last = builder.node(op, &inputs, format!("{name}{suffix}"), with);
            };
            let mut weights = Vec::new();
            let bias = layer.norm.is_none().then_some("bias");
            for part in ["weight"].into_iter().chain(bias) {
                let tensor = format!("{name}.{part}");
                weights.push(builder.weight(&tensor, self.tensor(&tensor)?));
            }
            let [kernel, stride, padding] =
                [layer.kernel, layer.stride, layer.padding].map(|v| v as i64);
            let window = |kernel, stride, padding| {
                vec![
                    ints("kernel_shape", &[kernel; 2]),
                    ints("strides", &[stride; 2]),
                    ints("pads", &[padding; 4]),
                ]
            };
            add(
                builder,
                "",
                "Conv",
                weights,
                window(kernel, stride, padding),
            );
            if layer.pool {
                add(builder, ".pool", "MaxPool", Vec::new(), window(2, 2, 1));
            }
            if let Some(norm) = &layer.norm {
                let mut parts = Vec::new();
                for part in ["weight", "bias", "running_mean", "running_var"] {
                    let tensor = format!("{norm}.{part}");
                    parts.push(builder.weight(&tensor, self.tensor(&tensor)?));
                }
                add(
                    builder,
                    ".norm",
                    "BatchNormalization",
                    parts,
                    vec![float("epsilon", BATCH_NORM_EPSILON as f32)],
                );
            }
            if layer.norm.is_some() {
                add(builder, ".relu", "Relu", Vec::new(), Vec::new());
            }
        }
        Ok(last)
    }
}

/// The nodes and constants of a graph, every node with one output of its own name.
#[derive(Default)]
struct Builder {
    nodes: Vec<Node>,
    constants: Vec<proto::Tensor>,
}

impl Builder {
    fn node(
        &mut self,
        op: &str,
        inputs: &[String],
        name: String,
        attribute: Vec<Attribute>,
    ) -> String {
        self.nodes.push(Node {
            input: inputs.to_vec(),
            output: vec![name.clone()],
            name: name.clone(),
            op_type: op.to_owned(),
            attribute,
        });
        name
    }

    /// A node without attributes.
    fn plain(&mut self, op: &str, inputs: &[&str], name: &str) -> String {
        let inputs: Vec<String> = inputs.iter().map(|input| (*input).to_owned()).collect();
        self.node(op, &inputs, name.to_owned(), Vec::new())
    }

    fn constant(
        &mut self,
        name: &str,
        data_type: i32,
        dims: Vec<i64>,
        raw_data: Vec<u8>,
    ) -> String {
        self.constants.push(proto::Tensor {
            dims,
            data_type,
            name: name.to_owned(),
            raw_data,
        });
        name.to_owned()
    }

    fn weight(&mut self, name: &str, tensor: &Tensor) -> String {
        let dims = tensor.shape.iter().map(|side| *side as i64).collect();
        self.constant(name, FLOAT, dims, tensor.to_le_bytes())
    }

    /// A number.
    fn float(&mut self, name: &str, value: f32) -> String {
        self.constant(name, FLOAT, Vec::new(), value.to_le_bytes().to_vec())
    }

    fn ints(&mut self, name: &str, values: &[i64]) -> String {
        let bytes = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(name, INT64, vec![values.len() as i64], bytes)
    }

    /// The expected position under the softmax of every map, in the latent space and in the image.
    /// `first` and `step` say at which pixel the first cell of a map is and how far the next one.
    fn add_soft_argmax(&mut self, maps: &str, temperature: &str, [first, step]: [f64; 2]) {
        let cells = self.ints("cells", &[0, 0, -1]);
        let flat = self.plain("Reshape", &[maps, &cells], "flat");
        let scaled = self.plain("Div", &[&flat, temperature], "scaled");
        let attention = self.node(
            "Softmax",
            &[scaled],
            "attention.flat".into(),
            vec![int("axis", -1)],
        );
        let shape = self.plain("Shape", &[maps], "maps.shape");
        let attention = self.plain("Reshape", &[&attention, &shape], "attention");
        for (name, value) in [("zero", 0.0), ("one", 1.0), ("two", 2.0)] {
            self.float(name, value);
        }
        self.float("first_cell", (2.0 * first + 1.0) as f32);
        self.float("cell_step", step as f32);
        self.ints("last_axis", &[-1]);
        let mut points = [Vec::new(), Vec::new()];
        // The axis of the maps that counts along x or y, and the one that is summed over.
        for (name, along, across) in [("x", 3, 2), ("y", 2, 3)] {
            let named = |part: &str| format!("{name}.{part}");
            let across = self.ints(&named("across"), &[across]);
            let sums = self.node(
                "ReduceSum",
                &[attention.clone(), across],
                named("attention"),
                vec![int("keepdims", 0)],
            );
            // linspace(-1, 1, cells); a single cell is at -1.
            let cells = self.side(maps, along, &named("cells"));
            let steps = self.plain("Sub", &[&cells, "one"], &named("steps"));
            let range = self.plain("Range", &["zero", &cells, "one"], &named("range"));
            let divisor = self.plain("Max", &[&steps, "one"], &named("divisor"));
            let parts = self.plain("Div", &[&range, &divisor], &named("parts"));
            let doubled = self.plain("Mul", &[&parts, "two"], &named("doubled"));
            let places = self.plain("Sub", &[&doubled, "one"], &named("places"));
            let weighted = self.plain("Mul", &[&sums, &places], &named("weighted"));
            let latent = self.node(
                "ReduceSum",
                &[weighted, "last_axis".into()],
                name.to_owned(),
                vec![int("keepdims", 1)],
            );
            // Pixel p of W is at (2 p + 1) / W - 1, and latent z at pixel first + step (cells - 1)
            // (z + 1) / 2.
            let from_first = self.plain("Add", &[&latent, "one"], &named("from_first"));
            let pixels = self.plain("Mul", &["cell_step", &steps], &named("pixels"));
            let offset = self.plain("Mul", &[&from_first, &pixels], &named("offset"));
            let doubled = self.plain("Add", &[&offset, "first_cell"], &named("doubled_pixel"));
            let side = self.side("image", along, &named("side"));
            let share = self.plain("Div", &[&doubled, &side], &named("share"));
            points[1].push(self.plain("Sub", &[&share, "one"], &named("ndc")));
            points[0].push(latent);
        }
        for (points, name) in points.iter().zip(["keypoints", "keypoints_ndc"]) {
            self.node("Concat", points, name.to_owned(), vec![int("axis", -1)]);
        }
    }

    /// The extent of `tensor` along `axis` as a number.
    fn side(&mut self, tensor: &str, axis: i64, name: &str) -> String {
        let attributes = vec![int("start", axis), int("end", axis + 1)];
        let shape = self.node(
            "Shape",
            &[tensor.to_owned()],
            format!("{name}.shape"),
            attributes,
        );
        let number = self.plain("Squeeze", &[&shape], &format!("{name}.number"));
        self.node(
            "Cast",
            &[number],
            name.to_owned(),
            vec![int("to", FLOAT.into())],
        )
    }
}

fn batch() -> Extent {
    Extent::Parameter("batch".to_owned())
}

fn value(name: &str, shape: &[Extent], what: &str) -> ValueInfo {
    let dimension = |extent: &Extent| Dimension {
        extent: Some(extent.clone()),
    };
    ValueInfo {
        name: name.to_owned(),
        r#type: Some(Type {
            tensor_type: Some(TensorType {
                elem_type: FLOAT,
                shape: Some(Shape {
                    dim: shape.iter().map(dimension).collect(),
                }),
            }),
        }),
        doc_string: what.to_owned(),
    }
}

fn float(name: &str, value: f32) -> Attribute {
    Attribute {
        name: name.to_owned(),
        f: Some(value),
        r#type: 1,
        ..Attribute::default()
    }
}

fn int(name: &str, value: i64) -> Attribute {
    Attribute {
        name: name.to_owned(),
        i: Some(value),
        r#type: 2,
        ..Attribute::default()
    }
}

fn ints(name: &str, values: &[i64]) -> Attribute {
    Attribute {
        name: name.to_owned(),
        ints: values.to_vec(),
        r#type: 7,
        ..Attribute::default()
    }
}
