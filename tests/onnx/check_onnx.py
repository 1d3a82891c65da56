"""Whether onnxruntime computes from exported encoders what `tracklens extract` computes from their checkpoints, on real
frames:

    python3 check_onnx.py TRACKLENS_BINARY [CHECKPOINT ...]

Without checkpoints: one a family, and one that fixes its input size.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import onnx
import onnxruntime
from PIL import Image

TESTS = Path(__file__).resolve().parent.parent
FRAMES = TESTS / "data" / "panda_push"
GOLDEN = TESTS / "golden"
CHECKPOINTS = [
    GOLDEN / "basic-vel-std-bg-tiny.pth",
    GOLDEN / "dsae-tiny.safetensors",
    GOLDEN / "keynet-vel-std-bg-tiny.safetensors",
    TESTS.parent / "web" / "example" / "checkpoint.safetensors",
]
# As tests/library/engine.rs: two float32 implementations add the same products in another order, and peaky attention maps
# magnify it. 1e-4 is 1/80 of a pixel at 256 px.
TOLERANCE = 1e-4


def cropped_frames(folder, width, height):
    """Copies of the frames' middles, for encoders that fix their input size: extraction resizes nothing then."""
    for path in FRAMES.glob("*/*.png"):
        image = Image.open(path).convert("RGB")
        left, top = (image.width - width) // 2, (image.height - height) // 2
        (folder / path.parent.name).mkdir(parents=True, exist_ok=True)
        image.crop((left, top, left + width, top + height)).save(folder / path.parent.name / path.name)
    return folder


def images(frames):
    """Every frame as 3 x height x width in [0, 1], in order."""
    paths = sorted(frames.glob("*/*.png"))
    assert paths, "no frames"
    pixels = [numpy.asarray(Image.open(path).convert("RGB"), numpy.float32) / 255 for path in paths]
    return numpy.stack(pixels).transpose(0, 3, 1, 2)


def extracted(binary, checkpoint, frames, keypoints, table):
    """What `tracklens extract` writes: frames x N x 2, in order."""
    command = [binary, "extract", "--quiet", "--checkpoint", checkpoint, "--frames", frames, "--out", table]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    with open(table, newline="") as file:
        points = [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]
    return numpy.array(points).reshape(-1, keypoints, 2)


def placement(graph, side):
    """The affine map from a latent coordinate (first cell -1, last cell +1) to the image (outer edges -1 and +1), by the
    arithmetic of receptive fields over the graph's layers: where the first cell is centred, how far cells are apart."""
    first, step, cells = 0.5, 1, side
    for node in graph.node:
        if node.op_type not in ("Conv", "MaxPool"):
            continue
        attributes = {attribute.name: onnx.helper.get_attribute_value(attribute) for attribute in node.attribute}
        kernel, stride, pad = attributes["kernel_shape"][0], attributes["strides"][0], attributes["pads"][0]
        first += ((kernel - 1) / 2 - pad) * step
        step *= stride
        cells = (cells + 2 * pad - kernel) // stride + 1
    middle = first + step * (cells - 1) / 2
    return step * (cells - 1) / side, 2 * middle / side - 1


def check(binary, checkpoint, folder):
    path = folder / "encoder.onnx"
    subprocess.run([binary, "export", "--checkpoint", checkpoint, "--onnx", path], check=True)
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    config = json.loads({entry.key: entry.value for entry in model.metadata_props}["tracklens.config"])
    size = config["input_size"]
    extents = [extent.dim_value for extent in model.graph.input[0].type.tensor_type.shape.dim]
    assert extents == ([0, 3, *size[::-1]] if size else [0, 3, 0, 0]), extents

    frames = cropped_frames(folder / "frames", *size) if size else FRAMES
    batch = images(frames)
    expected = extracted(binary, checkpoint, frames, config["keypoints"], folder / "keypoints.csv")
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    latent, ndc = session.run(["keypoints", "keypoints_ndc"], {"image": batch})
    assert latent.shape == ndc.shape == expected.shape, (latent.shape, expected.shape)
    difference = abs(latent - expected).max()
    print(f"{Path(checkpoint).name}: {len(batch)} frames, largest difference {difference:.1e}")
    assert difference < TOLERANCE, difference

    rten = extracted(binary, path, frames, config["keypoints"], folder / "rten.csv")
    difference = abs(latent - rten).max()
    print(f"{Path(checkpoint).name}: as a model, largest difference {difference:.1e}")
    assert difference < TOLERANCE, difference

    [alone] = session.run(["keypoints"], {"image": batch[:1]})
    assert abs(alone[0] - latent[0]).max() < TOLERANCE, "a batch of one frame differs"
    if not size:
        [small] = session.run(["keypoints"], {"image": batch[:2, :, :150, 20:233]})
        assert numpy.isfinite(small).all() and abs(small).max() <= 1, "another size of frames"
    for axis, side in ((0, batch.shape[3]), (1, batch.shape[2])):
        scale, shift = placement(model.graph, side)
        error = abs(latent[..., axis] * scale + shift - ndc[..., axis]).max()
        # Both sides are a handful of float32 operations on numbers below 512.
        assert error < 1e-5, (scale, shift, error)


def main():
    binary = Path(sys.argv[1]).resolve()
    for checkpoint in sys.argv[2:] or CHECKPOINTS:
        with tempfile.TemporaryDirectory() as folder:
            check(binary, checkpoint, Path(folder))


main()
