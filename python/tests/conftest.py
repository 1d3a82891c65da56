"""What the tests share: the command, golden files, frames."""

import csv
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
GOLDEN = REPOSITORY / "tests" / "golden"
CHECKPOINTS = [
    GOLDEN / "basic-vel-std-bg-tiny.safetensors",
    GOLDEN / "basic-vel-std-bg-tiny.pth",
    GOLDEN / "dsae-tiny.safetensors",
    GOLDEN / "keynet-vel-std-bg-tiny.safetensors",
]
TINY = CHECKPOINTS[0]
# It has an input size, 64 x 64.
SIZED = REPOSITORY / "web" / "example" / "checkpoint.safetensors"


class Terminal:
    """The command `tracklens`, which `cargo xtask test --with python` builds."""

    def __init__(self):
        self.binary = os.environ["TRACKLENS_BIN"]

    def run(self, *arguments):
        """What a command that succeeds prints."""
        done = subprocess.run([self.binary, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def error(self, *arguments):
        """The message of a command that fails."""
        done = subprocess.run([self.binary, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode != 0, done.stdout
        return done.stderr

    def extract(self, checkpoint, frames, folder):
        """The keypoints of frames `[B, H, W, 3]`, float32 `[B, N, 2]`, and what was noted."""
        recording = folder / "frames.npz"
        np.savez(recording, frames=frames)
        table = self.run(
            "extract", "--quiet", "--checkpoint", checkpoint, "--frames", recording, "--out", "-"
        )
        rows = [(float(row["x"]), float(row["y"])) for row in csv.DictReader(table.splitlines())]
        return np.array(rows).reshape(len(frames), -1, 2)

    def score(self, folder, keypoints, truth, *options, names=None, sure=None, truth_sure=None):
        """The JSON of arrays, without the command that repeats it."""
        named = {
            "truth": {"keypoints": truth, "names": names, "confidence": truth_sure},
            "keypoints": {"keypoints": keypoints, "confidence": sure},
        }
        files = []
        for side, arrays in named.items():
            path = folder / f"{side}.npz"
            np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
            files += [f"--{side}", path]
        result = json.loads(self.run("score", "--json", *files, *options))
        del result["command"]
        return result


@pytest.fixture(scope="session")
def terminal():
    return Terminal()


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def tensors(path):
    """The arrays of a `.safetensors` file."""
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    header.pop("__metadata__", None)
    arrays = {}
    for name, entry in header.items():
        start, end = (8 + length + offset for offset in entry["data_offsets"])
        dtype = {"F32": "<f4", "F64": "<f8", "I64": "<i8"}[entry["dtype"]]
        arrays[name] = np.frombuffer(content[start:end], dtype).reshape(entry["shape"])
    return arrays


def moving(rng, sequences=6, frames=40, keypoints=5, objects=3):
    """Keypoints `[S, T, N, 2]` of which the first follow the objects `[S, T, K, 2]` closely."""
    truth = rng.uniform(-0.9, 0.9, (sequences, frames, objects, 2))
    points = rng.uniform(-1, 1, (sequences, frames, keypoints, 2))
    close = min(objects, keypoints) - 1
    noise = rng.normal(0, 0.01, (sequences, frames, close, 2))
    points[:, :, :close] = 0.8 * truth[:, :, :close] + 0.05 + noise
    return points, truth
