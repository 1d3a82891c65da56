//! How a frame becomes a model's input, and its outputs keypoints.

use std::fmt;

use super::decode::{Found, MapDecoding, point};
use super::graph::{Element, Graph, Port, list};
use super::settings::{Channels, Columns, Decoding, InputSize, Layout, OutputKind, Settings, Unit};
use crate::checkpoint::SaeConfig;
use crate::data::{Filter, Frame, MAX_SIDE};
use crate::error::{Error, Reason, Result};

/// The metadata that `tracklens export` writes.
const CONFIG_KEY: &str = "tracklens.config";

/// The metadata with the settings of a model, as JSON.
const SETTINGS_KEY: &str = "tracklens.detector";

/// The output of an exported encoder that is the latent space.
const LATENT: &str = "keypoints";

/// Everything that is needed to run a model on frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub(super) input: Input,
    pub(super) output: Output,
    /// Keypoints, where the graph says how many.
    pub(super) keypoints: Option<usize>,
}

/// How a frame becomes the input.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Input {
    pub name: String,
    /// Width and height; `None` for those of each frame.
    pub size: Option<[usize; 2]>,
    pub layout: Layout,
    pub channels: Channels,
    pub element: Element,
    /// Of the channels in their order.
    mean: Vec<f32>,
    std: Vec<f32>,
}

/// What the outputs are.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Output {
    /// The latent points of an encoder that was exported here.
    Latent(Box<SaeConfig>),
    HeatMaps {
        name: String,
        decoding: MapDecoding,
    },
    Points {
        name: String,
        columns: Columns,
        unit: Unit,
    },
    SimCc {
        names: [String; 2],
        decoding: MapDecoding,
    },
}

/// What a model leaves open, by the names of the settings.
#[derive(Default)]
struct Open(Vec<(&'static str, &'static str)>);

impl Open {
    /// `found`, or a note that it is missing and a value to go on with.
    fn need<T>(&mut self, found: Option<T>, key: &'static str, what: &'static str, any: T) -> T {
        found.unwrap_or_else(|| {
            self.0.push((key, what));
            any
        })
    }

    fn check(self) -> Result<()> {
        if self.0.is_empty() {
            return Ok(());
        }
        let what: Vec<&str> = self.0.iter().map(|(_, what)| *what).collect();
        let missing = self.0.iter().map(|(key, _)| (*key).to_owned()).collect();
        Err(
            Error::input(format!("the model does not say {}", what.join(", ")))
                .because(Reason::DetectorSettings { missing }),
        )
    }
}

impl Plan {
    /// The plan of a model with what is known beside its graph: `settings` go before those in its
    /// metadata.
    ///
    /// # Errors
    /// When the graph and the settings contradict each other, or leave something open
    /// ([`Reason::DetectorSettings`] names it).
    pub fn new(graph: &Graph, settings: &Settings) -> Result<Self> {
        settings.validate()?;
        let own = match graph.metadata.get(SETTINGS_KEY) {
            Some(json) => Settings::from_json(json.as_bytes())
                .map_err(|e| e.at(format!("metadata `{SETTINGS_KEY}`")))?,
            None => Settings::default(),
        };
        let settings = settings.clone().or(own);
        let mut open = Open::default();
        if settings.output.is_none()
            && let Some(plan) = Self::of_export(graph)?
        {
            return Ok(plan);
        }
        let input = Input::new(graph, &settings, &mut open)?;
        let (output, keypoints) = Output::new(graph, &settings, input.layout, &mut open)?;
        open.check()?;
        Ok(Self {
            input,
            output,
            keypoints,
        })
    }

    /// The plan of an encoder that `tracklens export` wrote.
    fn of_export(graph: &Graph) -> Result<Option<Self>> {
        let config = graph.metadata.get(CONFIG_KEY);
        let latent = graph.outputs.iter().any(|output| output.name == LATENT);
        let Some(config) = config.filter(|_| latent) else {
            return Ok(None);
        };
        let config: SaeConfig = serde_json::from_str(config).map_err(|e| {
            Error::input(format!(
                "the metadata `{CONFIG_KEY}` is not a configuration this version understands: {e}"
            ))
        })?;
        config.validate()?;
        Ok(Some(Self {
            input: Input {
                name: graph.input.name.clone(),
                size: config.input_size,
                layout: Layout::ChannelsFirst,
                channels: Channels::Rgb,
                element: Element::Float,
                mean: vec![0.0],
                std: vec![1.0],
            },
            keypoints: Some(config.keypoints),
            output: Output::Latent(Box::new(config)),
        }))
    }
}

impl Input {
    fn new(graph: &Graph, settings: &Settings, open: &mut Open) -> Result<Self> {
        let port = &graph.input;
        let shape = port.shape.clone().unwrap_or_else(|| vec![None; 4]);
        let layout = settings.layout.or_else(|| layout_of(&shape));
        let layout = open.need(
            layout,
            "layout",
            "whether the channels of its input are first or last (layout)",
            Layout::ChannelsFirst,
        );
        let [channels, height, width] = match layout {
            Layout::ChannelsFirst => [1, 2, 3],
            Layout::ChannelsLast => [3, 1, 2],
        }
        .map(|at| shape.get(at).copied().flatten());
        if let Some(batch) = shape.first().copied().flatten().filter(|batch| *batch != 1) {
            return Err(Error::input(format!(
                "the model takes {batch} images at a time; expected a batch of 1, or a free one: export it again with \
                 that (`dynamic_axes` of `torch.onnx.export`)"
            )));
        }
        let channels = match (channels, settings.channels) {
            (Some(1), None | Some(Channels::Gray)) => Channels::Gray,
            (Some(3) | None, Some(channels @ (Channels::Rgb | Channels::Bgr))) => channels,
            (None, Some(Channels::Gray)) => Channels::Gray,
            // Nearly all models; an option says when it is not so.
            (Some(3) | None, None) => Channels::Rgb,
            (Some(count), None) => {
                return Err(Error::input(format!(
                    "the input {port} of the model has {count} channels; expected an image of 3 channels, or 1"
                )));
            }
            (Some(count), Some(channels)) => {
                return Err(Error::mismatch(format!(
                    "the channels are said to be {channels}, and the input {port} of the model has {count}"
                )));
            }
        };
        let size = size_of(port, [width, height], settings.input_size)?;
        let size = open.need(
            size,
            "inputSize",
            "the size of its input (input_size)",
            InputSize::Frame,
        );
        let bytes = port.element != Element::Float;
        let normal = |numbers: &Option<Vec<f32>>| numbers.clone();
        let (mean, std) = match (normal(&settings.mean), normal(&settings.std)) {
            (None, None) if bytes => (vec![0.0], vec![1.0]),
            (Some(_), _) | (_, Some(_)) if bytes => {
                return Err(Error::mismatch(format!(
                    "a mean or a std is given, and the input {port} of the model takes pixels of 0 to 255 as they are"
                )));
            }
            (Some(mean), std) => (mean, std.unwrap_or_else(|| vec![1.0])),
            (None, Some(std)) => (vec![0.0], std),
            (None, None) => open.need(
                None,
                "normalization",
                "how pixels are scaled (mean, std)",
                (vec![0.0], vec![1.0]),
            ),
        };
        Ok(Self {
            name: port.name.clone(),
            size: match size {
                InputSize::Fixed(size) => Some(size),
                InputSize::Frame => None,
            },
            layout,
            channels,
            element: port.element,
            mean,
            std,
        })
    }

    /// The values of the input, in its layout, and their width and height.
    pub fn values(&self, frame: &Frame) -> (Vec<f32>, [usize; 2]) {
        let own = [frame.width() as usize, frame.height() as usize];
        let size = self.size.unwrap_or(own);
        let planes = frame.to_planar(Some(size), Filter::BilinearAntialias);
        let plane = size[0] * size[1];
        let of = |values: &[f32], channel: usize| values[channel.min(values.len() - 1)];
        let byte = self.element != Element::Float;
        let value = |value: f32, channel: usize| match byte {
            true => (value * 255.0).round().clamp(0.0, 255.0),
            false => (value - of(&self.mean, channel)) / of(&self.std, channel),
        };
        let channels: Vec<Vec<f32>> = match self.channels {
            Channels::Gray => {
                let gray = |i: usize| {
                    0.299 * planes[i] + 0.587 * planes[plane + i] + 0.114 * planes[2 * plane + i]
                };
                vec![(0..plane).map(|i| value(gray(i), 0)).collect()]
            }
            Channels::Rgb | Channels::Bgr => {
                let order = match self.channels {
                    Channels::Bgr => [2, 1, 0],
                    _ => [0, 1, 2],
                };
                let one = |channel: usize| {
                    let values = &planes[channel * plane..][..plane];
                    values.iter().map(|v| value(*v, channel)).collect()
                };
                order.map(one).into()
            }
        };
        let values = match self.layout {
            Layout::ChannelsFirst => channels.concat(),
            Layout::ChannelsLast => (0..plane)
                .flat_map(|i| channels.iter().map(move |channel| channel[i]))
                .collect(),
        };
        (values, size)
    }

    /// The shape of the input for images of `[width, height]`.
    pub fn shape(&self, [width, height]: [usize; 2]) -> [usize; 4] {
        let channels = match self.channels {
            Channels::Gray => 1,
            Channels::Rgb | Channels::Bgr => 3,
        };
        match self.layout {
            Layout::ChannelsFirst => [1, channels, height, width],
            Layout::ChannelsLast => [1, height, width, channels],
        }
    }
}

/// The layout that only one of both places of the channels allows.
fn layout_of(shape: &[Option<usize>]) -> Option<Layout> {
    let count = |at: usize| shape.get(at).copied().flatten();
    let is_channels = |at: usize| matches!(count(at), Some(1 | 3));
    match (is_channels(1), is_channels(3)) {
        (true, false) => Some(Layout::ChannelsFirst),
        (false, true) => Some(Layout::ChannelsLast),
        _ => None,
    }
}

/// The size of the input, from the graph and what is said of it.
fn size_of(
    port: &Port,
    sides: [Option<usize>; 2],
    said: Option<InputSize>,
) -> Result<Option<InputSize>> {
    let contradiction = |said: String| {
        Error::mismatch(format!(
            "the input size is said to be {said}, and the model takes {port}"
        ))
    };
    if let Some(InputSize::Fixed(size)) = said {
        if size.iter().any(|side| *side > MAX_SIDE as usize) {
            return Err(Error::input(format!(
                "an input of {} x {} pixels; expected at most {MAX_SIDE} a side",
                size[0], size[1]
            )));
        }
        let fits = |axis: usize| sides[axis].is_none_or(|side| side == size[axis]);
        return match fits(0) && fits(1) {
            true => Ok(Some(InputSize::Fixed(size))),
            false => Err(contradiction(format!("{} x {}", size[0], size[1]))),
        };
    }
    match (sides, said) {
        ([Some(width), Some(height)], None) => {
            size_of(port, [None; 2], Some(InputSize::Fixed([width, height])))
        }
        ([None, None], Some(InputSize::Frame)) => Ok(said),
        (_, Some(_)) => Err(contradiction("that of the frames".to_owned())),
        _ => Ok(None),
    }
}

impl Output {
    /// The output, and the number of keypoints where the graph says it.
    fn new(
        graph: &Graph,
        settings: &Settings,
        layout: Layout,
        open: &mut Open,
    ) -> Result<(Self, Option<usize>)> {
        let chosen = chosen(graph, settings)?;
        let kind = settings.output.or_else(|| kind_of(&chosen));
        let Some(kind) = kind else {
            open.0.push((
                "output",
                "which of its outputs are heat maps, points or profiles (output, output_names)",
            ));
            let decoding = decoding(settings);
            let name = String::new();
            return Ok((Self::HeatMaps { name, decoding }, None));
        };
        let wanted = match kind {
            OutputKind::SimCc => 2,
            OutputKind::HeatMaps | OutputKind::Points => 1,
        };
        // Outputs that are said to be of a kind may have any shape until they are computed.
        let said = settings.output_names.is_some() || settings.output.is_some();
        let of_kind: Vec<&Port> = match said && chosen.len() == wanted {
            true => chosen,
            false => of_kind(&chosen, kind, wanted),
        };
        if of_kind.len() != wanted || of_kind.iter().any(|port| port.element != Element::Float) {
            let outputs: Vec<Port> = of_kind.into_iter().cloned().collect();
            return Err(Error::mismatch(format!(
                "{kind} come from {wanted} output(s) of floats, and the model has {}; name those that count (output_names)",
                list(match outputs.is_empty() {
                    true => &graph.outputs,
                    false => &outputs,
                })
            ))
            .because(Reason::DetectorSettings {
                missing: vec!["outputNames".to_owned()],
            }));
        }
        let extent = |at: usize| of_kind[0].shape.as_ref()?.get(at).copied().flatten();
        let rank = of_kind[0].shape.as_ref().map(Vec::len);
        let name = of_kind[0].name.clone();
        Ok(match kind {
            OutputKind::HeatMaps => {
                let keypoints = extent(match layout {
                    Layout::ChannelsFirst => 1,
                    Layout::ChannelsLast => 3,
                });
                let decoding = decoding(settings);
                (Self::HeatMaps { name, decoding }, keypoints)
            }
            OutputKind::Points => {
                let last = rank.and_then(|rank| extent(rank.checked_sub(1)?));
                let columns = settings.columns.or(match (rank, last) {
                    (Some(3 | 4), Some(2)) => Some(Columns::Xy),
                    _ => None,
                });
                let columns = open.need(
                    columns,
                    "columns",
                    "what the numbers of a point are (columns)",
                    Columns::Xy,
                );
                let unit = open.need(
                    settings.unit,
                    "unit",
                    "the unit of its points (unit)",
                    Unit::Ndc,
                );
                let keypoints = match rank {
                    Some(3) => extent(1),
                    Some(4) => extent(2),
                    _ => None,
                };
                let output = Self::Points {
                    name,
                    columns,
                    unit,
                };
                (output, keypoints)
            }
            OutputKind::SimCc => {
                let names = [name, of_kind[1].name.clone()];
                let decoding = decoding(settings);
                (Self::SimCc { names, decoding }, extent(1))
            }
        })
    }

    /// The names of the outputs to compute.
    pub fn names(&self) -> Vec<&str> {
        match self {
            Self::Latent(_) => vec![LATENT],
            Self::HeatMaps { name, .. } | Self::Points { name, .. } => vec![name],
            Self::SimCc { names, .. } => names.iter().map(String::as_str).collect(),
        }
    }

    /// The keypoints of a frame, from the outputs in the order of [`Output::names`]: their shapes and
    /// values. `size` is that of the input.
    pub fn keypoints(
        &self,
        outputs: &[(Vec<usize>, Vec<f32>)],
        layout: Layout,
        size: [usize; 2],
    ) -> Result<Vec<Found>> {
        let (shape, values) = &outputs[0];
        let wrong = |expected: &str| {
            let names = self.names().join("`, `");
            let shapes: Vec<String> = outputs
                .iter()
                .map(|(shape, _)| format!("{shape:?}"))
                .collect();
            Error::mismatch(format!(
                "`{names}` of the model came out as {}; expected {expected}",
                shapes.join(" and ")
            ))
        };
        let at = |n: usize| move |e: Error| e.at(format!("keypoint {n}"));
        match self {
            Self::Latent(config) => {
                let count = config.keypoints;
                if shape[..] != [1, count, 2] {
                    return Err(wrong(&format!("1 x {count} x 2")));
                }
                let rows = values.chunks_exact(2).enumerate();
                rows.map(|(n, row)| point(row, Columns::Xy, Unit::Ndc, size).map_err(at(n)))
                    .collect()
            }
            Self::HeatMaps { decoding, .. } => {
                let [1, a, b, c] = shape[..] else {
                    return Err(wrong("a heat map a keypoint, [1, K, H, W]"));
                };
                let (count, plane, width) = match layout {
                    Layout::ChannelsFirst => (a, b * c, c),
                    Layout::ChannelsLast => (c, a * b, b),
                };
                if count * plane == 0 {
                    return Err(wrong("maps that are not empty"));
                }
                let one = |n: usize| match layout {
                    Layout::ChannelsFirst => decoding.map(&values[n * plane..][..plane], width),
                    Layout::ChannelsLast => {
                        let map: Vec<f32> = values.iter().skip(n).step_by(count).copied().collect();
                        decoding.map(&map, width)
                    }
                };
                (0..count).map(|n| one(n).map_err(at(n))).collect()
            }
            Self::Points { columns, unit, .. } => {
                let numbers = columns.count();
                let flat = matches!(shape[..], [1, row] | [1, row, 1, 1] if row % numbers == 0);
                let rows = match shape[..] {
                    [1, _, last] | [1, 1, _, last] | [_, last] => last == numbers,
                    _ => false,
                };
                if values.is_empty() || !(flat || rows) {
                    return Err(wrong(&format!(
                        "points of {numbers} numbers, [1, K, {numbers}]"
                    )));
                }
                let rows = values.chunks_exact(numbers).enumerate();
                rows.map(|(n, row)| point(row, *columns, *unit, size).map_err(at(n)))
                    .collect()
            }
            Self::SimCc { decoding, .. } => {
                let expected = "two profiles a keypoint, [1, K, X] and [1, K, Y]";
                let (y_shape, y_values) = outputs.get(1).ok_or_else(|| wrong(expected))?;
                let ([1, count, x], [1, y_count, y]) = (&shape[..], &y_shape[..]) else {
                    return Err(wrong(expected));
                };
                if count != y_count || count * x * y == 0 {
                    return Err(wrong(expected));
                }
                let profiles = values.chunks_exact(*x).zip(y_values.chunks_exact(*y));
                let one = |(n, (x, y))| decoding.profiles([x, y]).map_err(at(n));
                profiles.enumerate().map(one).collect()
            }
        }
    }
}

fn decoding(settings: &Settings) -> MapDecoding {
    MapDecoding {
        // A temperature is of no use otherwise.
        decoding: settings.decode.unwrap_or(match settings.temperature {
            Some(_) => Decoding::SoftArgmax,
            None => Decoding::Argmax,
        }),
        temperature: settings.temperature.unwrap_or(1.0),
    }
}

/// The outputs that count.
fn chosen<'a>(graph: &'a Graph, settings: &Settings) -> Result<Vec<&'a Port>> {
    let Some(names) = &settings.output_names else {
        return Ok(graph.outputs.iter().collect());
    };
    let named = |name: &String| {
        let port = graph.outputs.iter().find(|output| output.name == *name);
        port.ok_or_else(|| {
            Error::mismatch(format!(
                "the model has no output `{name}`; its outputs are {}",
                list(&graph.outputs)
            ))
        })
    };
    names.iter().map(named).collect()
}

/// What outputs are by their shapes, where those leave one answer.
fn kind_of(outputs: &[&Port]) -> Option<OutputKind> {
    let kinds: Vec<OutputKind> = [
        (OutputKind::HeatMaps, 1),
        (OutputKind::Points, 1),
        (OutputKind::SimCc, 2),
    ]
    .into_iter()
    .filter(|(kind, count)| of_kind(outputs, *kind, *count).len() == *count)
    .map(|(kind, _)| kind)
    .collect();
    match kinds[..] {
        [kind] => Some(kind),
        _ => None,
    }
}

/// The outputs that may be of a kind by their shapes, if there are `count` of them.
fn of_kind<'a>(outputs: &[&'a Port], kind: OutputKind, count: usize) -> Vec<&'a Port> {
    let is = |port: &&&Port| {
        let Some(shape) = port.shape.as_deref() else {
            return false;
        };
        let points = matches!(shape, [_, _, Some(2 | 3)] | [_, Some(1), _, Some(2 | 3)]);
        port.element == Element::Float
            && match kind {
                OutputKind::HeatMaps => shape.len() == 4 && !points,
                OutputKind::Points => points,
                OutputKind::SimCc => shape.len() == 3 && !points,
            }
    };
    let found: Vec<&Port> = outputs.iter().filter(is).copied().collect();
    match found.len() == count {
        true => found,
        false => Vec::new(),
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Input {
            size,
            channels,
            layout,
            ..
        } = &self.input;
        match size {
            Some([width, height]) => write!(f, "{width} x {height}")?,
            None => f.write_str("the size of the frames")?,
        }
        write!(f, ", {channels}, {layout}")?;
        if self.input.element == Element::Float {
            write!(f, ", mean {:?}, std {:?}", self.input.mean, self.input.std)?;
        }
        let maps = |decoding: &MapDecoding| match decoding.decoding {
            Decoding::Argmax => "argmax".to_owned(),
            Decoding::SoftArgmax => format!("softargmax, temperature {}", decoding.temperature),
        };
        match &self.output {
            Output::Latent(config) => write!(f, "; latent points of {}", config.name()),
            Output::HeatMaps { name, decoding } => {
                write!(f, "; heat maps `{name}`, {}", maps(decoding))
            }
            Output::Points {
                name,
                columns,
                unit,
            } => write!(f, "; points `{name}`, {columns} in {unit}"),
            Output::SimCc { names, decoding } => {
                write!(
                    f,
                    "; SimCC `{}` and `{}`, {}",
                    names[0],
                    names[1],
                    maps(decoding)
                )
            }
        }
    }
}
