"""Writes ../data/onnx/: small keypoint detectors as ONNX models, with random weights, what onnxruntime finds with them on
the frames of panda_push (expected.json), and models that have to be refused (bad/).

    pip install -r requirements.txt
    python3 make_models.py
"""

import json
from pathlib import Path

import numpy
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from PIL import Image

FOLDER = Path(__file__).resolve().parent.parent / "data"
OUT = FOLDER / "onnx"
OPSET = 17
IMAGENET = ([0.485, 0.456, 0.406], [0.229, 0.224, 0.225])


class Builder:
    """Nodes and weights of a graph, one layer after the other."""

    def __init__(self, seed):
        self.random = numpy.random.default_rng(seed)
        self.nodes, self.weights, self.count = [], [], 0

    def name(self):
        self.count += 1
        return f"value_{self.count}"

    def weight(self, values, dtype=numpy.float32):
        name = self.name()
        self.weights.append(numpy_helper.from_array(numpy.asarray(values, dtype), name))
        return name

    def node(self, op, *inputs, out=None, **attributes):
        out = out or self.name()
        self.nodes.append(helper.make_node(op, list(inputs), [out], **attributes))
        return out

    def drawn(self, *shape):
        fan = numpy.prod(shape[1:]) if len(shape) > 1 else shape[0]
        return self.random.normal(0, (2 / fan) ** 0.5, shape)

    def conv(self, x, inputs, outputs, kernel, stride=1, group=1, out=None):
        weight = self.weight(self.drawn(outputs, inputs // group, kernel, kernel))
        bias = self.weight(self.random.normal(0, 0.1, outputs))
        return self.node("Conv", x, weight, bias, out=out, kernel_shape=[kernel] * 2, strides=[stride] * 2,
                         pads=[kernel // 2] * 4, group=group)

    def norm(self, x, channels):
        random = self.random
        parts = [random.uniform(0.5, 1.5, channels), random.normal(0, 0.1, channels), random.normal(0, 0.1, channels),
                 random.uniform(0.5, 1.5, channels)]
        return self.node("BatchNormalization", x, *map(self.weight, parts), epsilon=1e-5)

    def relu(self, x):
        return self.node("Relu", x)

    def smooth(self, x, channels, out, size=9, sigma=2.0):
        """Every channel blurred, so that a map has one clear peak."""
        row = numpy.exp(-((numpy.arange(size) - size // 2) ** 2) / (2 * sigma**2))
        kernel = numpy.outer(row, row) / row.sum() ** 2
        weight = self.weight(numpy.repeat(kernel[None, None], channels, 0))
        return self.node("Conv", x, weight, out=out, kernel_shape=[size] * 2, pads=[size // 2] * 4, group=channels)

    def model(self, inputs, outputs, metadata=None, opset=OPSET, element=TensorProto.FLOAT, domain=None):
        values = [helper.make_tensor_value_info(name, element, shape) for name, shape in inputs]
        results = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs]
        graph = helper.make_graph(self.nodes, "detector", values, results, self.weights)
        imports = [helper.make_opsetid("", opset)] + ([helper.make_opsetid(domain, 1)] if domain else [])
        model = helper.make_model(graph, opset_imports=imports, ir_version=8, producer_name="make_models")
        if metadata:
            helper.set_model_props(model, {"tracklens.detector": json.dumps(metadata)})
        return model


def heat_maps():
    """A residual network with a transposed convolution before its maps, as SimpleBaseline's; ImageNet's normalisation."""
    b, keypoints = Builder(1), 5
    x = b.relu(b.norm(b.conv("image", 3, 8, 7, stride=2), 8))
    x = b.node("MaxPool", x, kernel_shape=[3, 3], strides=[2, 2], pads=[1] * 4)
    for inputs, outputs, stride in ((8, 8, 1), (8, 16, 2)):
        y = b.relu(b.norm(b.conv(x, inputs, outputs, 3, stride), outputs))
        y = b.norm(b.conv(y, outputs, outputs, 3), outputs)
        shortcut = x if stride == 1 else b.norm(b.conv(x, inputs, outputs, 1, stride), outputs)
        x = b.relu(b.node("Add", y, shortcut))
    x = b.node("ConvTranspose", x, b.weight(b.drawn(16, 8, 4, 4)), kernel_shape=[4, 4], strides=[2, 2], pads=[1] * 4)
    x = b.relu(b.norm(x, 8))
    b.smooth(b.conv(x, 8, keypoints, 1), keypoints, "heatmaps", size=5, sigma=1.0)
    model = b.model([("image", ["batch", 3, 96, 128])], [("heatmaps", ["batch", keypoints, 24, 32])])
    return model, {"mean": IMAGENET[0], "std": IMAGENET[1]}


def any_size():
    """A fully convolutional network for images of any size, with weights and maps of 16 bits, and a soft-argmax."""
    b, keypoints = Builder(2), 4
    x = b.node("Cast", b.relu(b.conv("image", 3, 8, 5, stride=4)), to=TensorProto.FLOAT16)
    weight = b.weight(b.drawn(keypoints, 8, 3, 3), numpy.float16)
    x = b.node("Conv", x, weight, kernel_shape=[3, 3], pads=[1] * 4)
    x = b.node("Cast", x, to=TensorProto.FLOAT)
    b.smooth(x, keypoints, "maps")
    extents = ["batch", keypoints, "rows", "columns"]
    model = b.model([("image", ["batch", 3, "height", "width"])], [("maps", extents)])
    return model, {"input_size": "frame", "mean": [0.5], "std": [0.5], "decode": "softargmax", "temperature": 0.05}


def simcc():
    """Profiles along x and y with two bins a pixel, from blue, green and red, as RTMPose; its metadata says so."""
    b, keypoints, (width, height) = Builder(6), 6, (48, 64)
    x = b.relu(b.norm(b.conv("input", 3, 8, 5, stride=4), 8))
    x = b.relu(b.conv(x, 8, keypoints, 3, stride=2))
    cells = width // 8 * (height // 8)
    x = b.node("Reshape", x, b.weight([0, keypoints, cells], numpy.int64))
    for name, side in (("simcc_x", width), ("simcc_y", height)):
        bins = 2 * side
        row = numpy.exp(-(numpy.arange(-6, 7) ** 2) / 8)
        weight = numpy.stack([numpy.convolve(row, numpy.sqrt(20 / cells) * b.random.normal(size=bins), "same") for _ in range(cells)])
        y = b.node("MatMul", x, b.weight(weight))
        b.node("Add", y, b.weight(numpy.convolve(row, b.random.normal(size=bins), "same")), out=name)
    settings = {"channels": "bgr", "mean": [0.485, 0.456, 0.406], "std": [0.229, 0.224, 0.225], "output": "simcc",
                "output_names": ["simcc_x", "simcc_y"]}
    outputs = [("simcc_y", ["batch", keypoints, 2 * height]), ("simcc_x", ["batch", keypoints, 2 * width])]
    return b.model([("input", ["batch", 3, height, width])], outputs, settings), {}


def points():
    """A regressor of (y, x, confidence) from channels that are last, as MoveNet: [1, 1, K, 3], fractions of the image."""
    b, keypoints = Builder(4), 7
    x = b.node("Mul", b.node("Transpose", "pixels", perm=[0, 3, 1, 2]), b.weight(1 / 255))
    for inputs, outputs in ((3, 8), (8, 16), (16, 16)):
        x = b.node("HardSwish", b.conv(x, inputs, outputs, 3, stride=2))
    x = b.node("Flatten", b.node("GlobalAveragePool", x))
    x = b.node("Gemm", x, b.weight(8 * b.drawn(keypoints * 3, 16)), b.weight(b.random.normal(0, 1, keypoints * 3)), transB=1)
    x = b.node("Reshape", b.node("Sigmoid", x), b.weight([-1, 1, keypoints, 3], numpy.int64))
    b.node("Identity", x, out="points")
    model = b.model([("pixels", ["batch", 64, 64, 3])], [("points", ["batch", 1, keypoints, 3])])
    return model, {"mean": [0.0], "std": [1 / 255], "unit": "fraction", "columns": "yxc"}


MODELS = {"heatmaps": heat_maps, "any-size": any_size, "simcc": simcc, "points": points}


def resized(pixels, width, height):
    """A triangle filter as wide as the shrinking, pixel centres at half-integers: torchvision's antialiased bilinear."""
    def matrix(source, target):
        scale = source / target
        centres = (numpy.arange(target) + 0.5) * scale
        reach = max(scale, 1.0)
        weights = numpy.maximum(1 - abs(numpy.arange(source) + 0.5 - centres[:, None]) / reach, 0)
        return weights / weights.sum(1, keepdims=True)
    rows = numpy.einsum("yr,rcv->ycv", matrix(pixels.shape[0], height), pixels)
    return numpy.einsum("xc,ycv->yxv", matrix(pixels.shape[1], width), rows)


def image(pixels, model, settings):
    """A frame (rows x columns x RGB in [0, 1]) as the model's input."""
    shape = [extent.dim_value for extent in model.graph.input[0].type.tensor_type.shape.dim]
    last = shape[3] == 3
    height, width = shape[1:3] if last else shape[2:]
    pixels = resized(pixels, width, height) if width else pixels
    pixels = (pixels - numpy.array(settings["mean"])) / numpy.array(settings["std"])
    if settings.get("channels") == "bgr":
        pixels = pixels[..., ::-1]
    return (pixels if last else pixels.transpose(2, 0, 1))[None].astype(numpy.float32)


def ndc(cell, cells):
    return (2 * cell + 1) / cells - 1


def vertex(values, at):
    """The vertex of the parabola through a peak and its neighbours, of their logarithms where all are positive."""
    if at in (0, len(values) - 1):
        return at
    three = values[at - 1 : at + 2].astype(float)
    three = numpy.log(three) if (three > 0).all() else three
    a, b, _ = numpy.polyfit([-1, 0, 1], three, 2)
    return at - b / (2 * a)


def clear_peak(values, distance=2):
    """The place of the largest value, which no other but its neighbours comes near."""
    at = numpy.unravel_index(values.argmax(), values.shape)
    places = numpy.stack(numpy.meshgrid(*map(numpy.arange, values.shape), indexing="ij"), -1)
    others = values[abs(places - at).max(-1) > 0]
    # Two runtimes differ by 1e-6 of the values at most.
    assert values[at] - others.max() > 5e-6 * abs(values).max(), "two peaks; draw other weights"
    return at


def decoded(outputs, settings):
    """Points in ndc and confidences, or None."""
    if "simcc_x" in outputs:
        x, y = outputs["simcc_x"][0], outputs["simcc_y"][0]
        peaks = [[clear_peak(row)[0] for row in rows] for rows in (x, y)]
        points = [[ndc(vertex(a, i), len(a)), ndc(vertex(b, j), len(b))] for a, i, b, j in zip(x, peaks[0], y, peaks[1])]
        return points, numpy.minimum(x.max(1), y.max(1))
    if "points" in outputs:
        rows = outputs["points"].reshape(-1, 3).astype(float)
        return 2 * rows[:, 1::-1] - 1, rows[:, 2]
    [maps] = outputs.values()
    points = []
    for values in maps[0].astype(float):
        if settings.get("decode") == "softargmax":
            weights = numpy.exp((values - values.max()) / settings["temperature"])
            weights /= weights.sum()
            rows, columns = numpy.indices(values.shape)
            points.append([ndc((weights * columns).sum(), values.shape[1]), ndc((weights * rows).sum(), values.shape[0])])
        else:
            row, column = clear_peak(values)
            points.append([ndc(vertex(values[row], column), values.shape[1]), ndc(vertex(values[:, column], row), values.shape[0])])
    return points, maps[0].max((1, 2))


def expected(model, settings):
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    settings = settings or json.loads(metadata["tracklens.detector"])
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    frames = {}
    for path in sorted((FOLDER / "panda_push").glob("*/*.png")):
        pixels = numpy.asarray(Image.open(path).convert("RGB"), float) / 255
        outputs = session.run(names, {session.get_inputs()[0].name: image(pixels, model, settings)})
        found, confidences = decoded(dict(zip(names, outputs)), settings)
        frames[f"{path.parent.name}/{path.name}"] = {
            "points": numpy.round(found, 7).tolist(),
            "confidences": [float(f"{value:.7g}") for value in confidences],
        }
    return frames


def tiny(inputs, node=None, opset=OPSET, weights=True, **arguments):
    """A model of two nodes, as a frame for what makes it unusable."""
    b = Builder(5)
    x = b.conv(inputs[0][0], 3, 2, 3) if weights else inputs[0][0]
    b.nodes.append(node(x) if node else helper.make_node("Relu", [x], ["maps"]))
    return b.model(inputs, [("maps", [1, 2, 16, 16])], opset=opset, **arguments)


IMAGE = ("image", [1, 3, 16, 16])


def bad_models():
    one = lambda op, domain="": lambda x: helper.make_node(op, [x], ["maps"], domain=domain)
    external = tiny([IMAGE])
    weight = external.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="weights.bin")
    shapes = tiny([IMAGE])
    shapes.graph.node[0].input[1] = shapes.graph.node[0].input[2]
    missing = tiny([IMAGE])
    missing.graph.node[0].input[1] = "nowhere"
    return {
        "operator": tiny([IMAGE], one("Det")),
        "domain": tiny([IMAGE], one("FusedConv", "com.microsoft"), domain="com.microsoft"),
        "opset": tiny([IMAGE], opset=99),
        "external": external,
        "two-inputs": tiny([IMAGE, ("scale", [1])]),
        "vector": tiny([("vector", [1, 128])], weights=False),
        "channels": tiny([("image", [1, 7, 16, 16])], weights=False),
        "batch": tiny([("image", [8, 3, 16, 16])]),
        "integers": tiny([IMAGE], element=TensorProto.INT64, weights=False),
        "shapes": shapes,
        "missing": missing,
    }


def main():
    (OUT / "bad").mkdir(parents=True, exist_ok=True)
    results = {}
    for name, make in MODELS.items():
        model, settings = make()
        onnx.checker.check_model(model, full_check=True)
        onnx.save(model, OUT / f"{name}.onnx")
        results[name] = {"settings": settings, "frames": expected(model, settings)}
        flat = numpy.array([frame["points"] for frame in results[name]["frames"].values()])
        print(name, (OUT / f"{name}.onnx").stat().st_size, "bytes; spread of the points", flat.std((0, 1)), flat.std(0).mean(0))
    for name, model in bad_models().items():
        (OUT / "bad" / f"{name}.onnx").write_bytes(model.SerializeToString())
    (OUT / "expected.json").write_text(json.dumps(results).replace('"seq_', '\n"seq_') + "\n")


main()
