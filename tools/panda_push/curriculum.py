"""Trains the example's checkpoint: a KeyNet SAE that sees the target before it learns the arm.

Among whole recordings a small SAE finds the cube in a few epochs and loses sight of the target, which makes up less than a
tenth of what there is to reconstruct. Here it first sees scenes: the arm at rest, cube and target placed anew in every
frame, drawn at first with a plate about as conspicuous as the cube. README.md tells the stages.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import struct
import subprocess
import sys
from collections import defaultdict
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import record
from record import Sequence, np
from scene import Environment, FloatArray

ROOT = Path(__file__).resolve().parents[2]
SIZE = 128
"""Side of the frames of scenes; the SAE sees 64 x 64."""
SCENES = 12
"""Scenes a sequence."""
SNIPPET = 3
"""Frames a snippet, which a training sees at a time."""
AGGREGATE = "encoder.aggregate_conv"
SAE = [
    "--arch=keynet-vel-std-bg",
    "--encoder-channels=8,16,32,64",
    "--decoder-channels=32,16,8",
    "--input-size=64",
    "--target-size=64",
    "--batch=4",
]

Rows = list[list[str]]


@dataclass(frozen=True)
class Scenes:
    """Sequences of unrelated scenes."""

    sequences: int
    seed: int
    plate: float = 1.0
    """Side of the target's plate, in those of the task."""
    cube: bool = True

    def record(self, folder: Path) -> None:
        """Draws the scenes into an empty folder."""
        with (
            closing(Environment(SIZE, self.plate)) as environment,
            record.png_store(folder, (self.sequences, SCENES, SIZE)) as frames,
            record.truth_store(folder) as truth,
        ):
            for first in range(0, self.sequences * SCENES, SCENES):
                sequence = Sequence(first // SCENES)
                for scene in range(first, first + SCENES):
                    environment.reset(seed=self.seed + scene)
                    if not self.cube:
                        below = np.array([0.0, 0.0, -5.0])
                        environment.sim.set_base_pose("object", below, np.array([0.0, 0.0, 0.0, 1.0]))
                    sequence.frames.append(environment.frame())
                    sequence.sites.append(environment.sites())
                frames(sequence)
                truth(sequence)


SOURCES = {
    "conspicuous": Scenes(sequences=80, seed=800_000, plate=1.6),
    "scenes": Scenes(sequences=160, seed=700_000),
    "without-cube": Scenes(sequences=80, seed=500_000, cube=False),
}


@dataclass(frozen=True)
class Part:
    """Sequences of a stage: `count` of a source, from the first on."""

    source: str
    count: int
    still: bool = False
    """Every frame becomes a sequence in which nothing moves."""
    starts: bool = False
    """Only the first snippet of sequences that start an episode."""


@dataclass(frozen=True)
class Stage:
    """A training on its own mixture of sequences, from the weights of the one before."""

    number: int
    parts: list[Part]
    """Without any: the recording as it is."""
    epochs: int
    options: list[str]
    redrawn: tuple[int, ...] = ()
    """Keypoints that are drawn anew before: they follow cube and target at once, or share the target with others. The R^2 of
    a linear fit from their positions to the target's was 0.03 or more before stage 7, 0.05 or more before stages 10 and 12, on
    first frames of the recording; before stage 8 they were chosen among those of stage 7 by eye."""


RECORDING = "recording"
SPLIT = ["--split=0.6,0.1", "--seed=0"]
"""Of the whole recording. Earlier stages see sequences of its training part only."""
STAGES = [
    Stage(1, [Part("conspicuous", 80)], 18, [
        "--background=mean", "--velocity-weight=0", "--learning-rate=2e-3", "--split=0.9,0.1", "--seed=0"]),
    Stage(2, [Part("scenes", 160)], 6, [
        "--velocity-weight=0", "--learning-rate=1e-3", "--split=0.9,0.1", "--seed=0"]),
    Stage(3, [Part("scenes", 1000, still=True), Part(RECORDING, 600, starts=True)], 6, [
        "--learning-rate=1e-3", "--split=0.9,0.1", "--seed=0"]),
    Stage(4, [Part("scenes", 1000, still=True), Part(RECORDING, 600)], 4, [
        "--learning-rate=1e-3", "--split=0.95,0.05", "--seed=0"]),
    Stage(5, [Part("scenes", 500, still=True), Part("without-cube", 960, still=True), Part(RECORDING, 600)], 3, [
        "--learning-rate=1e-3", "--split=0.95,0.05", "--seed=1"]),
    Stage(6, [Part("scenes", 960, still=True), Part("without-cube", 960, still=True), Part(RECORDING, 100)], 5, [
        "--learning-rate=2e-3", "--split=0.95,0.05", "--seed=1"]),
    Stage(7, [Part("scenes", 1900, still=True), Part(RECORDING, 80)], 4, [
        "--learning-rate=2e-3", "--split=0.95,0.05", "--seed=1"],
        redrawn=(3, 5, 8, 10, 11, 12, 17, 18, 19, 22, 24, 25, 27, 28, 29)),
    Stage(8, [Part("scenes", 1900, still=True), Part(RECORDING, 80)], 4, [
        "--learning-rate=2e-3", "--split=0.95,0.05", "--seed=2"],
        redrawn=(3, 5, 8, 10, 17, 18, 19, 22, 24, 25, 27, 28)),
    Stage(9, [], 5, ["--learning-rate=1e-3", *SPLIT]),
    Stage(10, [], 7, ["--learning-rate=5e-4", *SPLIT], redrawn=(0, 3, 8, 10, 11, 12, 15, 17, 18, 22, 23, 25, 27, 28)),
    Stage(11, [], 5, ["--learning-rate=2e-4", *SPLIT]),
    Stage(12, [], 3, ["--learning-rate=3e-4", *SPLIT],
        redrawn=(0, 2, 3, 5, 9, 10, 11, 12, 15, 16, 18, 19, 20, 22, 23, 24, 25, 27, 28)),
]  # fmt: skip


@cache
def read_truth(folder: Path) -> dict[int, dict[int, Rows]]:
    """The rows object, x, y of a recording by sequence and frame."""
    rows: dict[int, dict[int, Rows]] = defaultdict(lambda: defaultdict(list))
    with open(folder / "ground_truth.csv", encoding="utf-8", newline="") as file:
        for sequence, frame, *rest in list(csv.reader(file))[1:]:
            rows[int(sequence)][int(frame)].append(rest)
    return rows


def assemble(stage: Stage, folders: dict[str, Path], training: set[str], out: Path) -> None:
    """Writes the data folder of a stage. Frames are copies: tracklens reads a file once, however
    many links lead to it."""
    count = 0
    out.mkdir()
    with open(out / "ground_truth.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["sequence", "frame", "object", "x", "y"])

        def add(source: Path, frames: list[tuple[int, Rows]]) -> None:
            nonlocal count
            folder = out / f"seq_{count:05}"
            folder.mkdir()
            for t, (frame, rows) in enumerate(frames):
                shutil.copyfile(source / f"frame_{frame:03}.png", folder / f"frame_{t:03}.png")
                table.writerows([count, t, *row] for row in rows)
            count += 1

        for part in stage.parts:
            last = count + part.count
            for sequence, by_frame in sorted(read_truth(folders[part.source]).items()):
                source = folders[part.source] / f"seq_{sequence:04}"
                is_start = sequence % 2 == 0
                if part.source == RECORDING and (source.name not in training or (part.starts and not is_start)):
                    continue
                frames = sorted(by_frame.items())
                if part.still:
                    groups = [[frame] * SNIPPET for frame in frames]
                else:
                    groups = [frames[:SNIPPET] if part.starts else frames]
                for group in groups[: last - count]:
                    add(source, group)


def redraw(file: Path, keypoints: tuple[int, ...], out: Path) -> None:
    """Draws keypoints anew, as PyTorch draws layers: their rows of the encoder's last convolution, their channels of the
    decoder's first."""
    data = file.read_bytes()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    body = bytearray(data[8 + length :])
    rng = np.random.default_rng(0)
    drawn = list(keypoints)

    def tensor(name: str) -> FloatArray:
        start, end = header[name]["data_offsets"]
        return np.frombuffer(bytes(body[start:end]), "<f4").reshape(header[name]["shape"]).copy()

    def put(name: str, values: FloatArray) -> None:
        start, end = header[name]["data_offsets"]
        body[start:end] = values.astype("<f4").tobytes()

    weight, bias = tensor(f"{AGGREGATE}.weight"), tensor(f"{AGGREGATE}.bias")
    bound = 1 / np.sqrt(weight.shape[1])
    weight[drawn] = rng.uniform(-bound, bound, weight[drawn].shape)
    bias[drawn] = rng.uniform(-bound, bound, len(drawn))
    put(f"{AGGREGATE}.weight", weight)
    put(f"{AGGREGATE}.bias", bias)
    (first,) = (
        name
        for name, entry in header.items()
        if name.startswith("decoder.") and len(entry["shape"]) == 4 and entry["shape"][1] == len(bias)
    )
    channels = tensor(first)
    bound = 1 / np.sqrt(channels[0].size)
    channels[:, drawn] = rng.uniform(-bound, bound, channels[:, drawn].shape)
    put(first, channels)
    out.write_bytes(data[: 8 + length] + bytes(body))


def curriculum(options: argparse.Namespace) -> None:
    """All stages, one after the other."""
    out: Path = options.out.absolute()
    out.mkdir(parents=True)
    training = set(json.loads(options.run.read_text(encoding="utf-8"))["training_sequences"])
    folders = {RECORDING: options.recording.absolute()}
    for name, scenes in SOURCES.items():
        folders[name] = out / name
        folders[name].mkdir()
        print(f"recording {name}", file=sys.stderr, flush=True)
        if options.trial:
            scenes = replace(scenes, sequences=2)
        scenes.record(folders[name])
    weights: Path | None = None
    for stage in STAGES:
        data, run = folders[RECORDING], out / f"stage-{stage.number}"
        if stage.parts:
            data = out / f"data-{stage.number}"
            assemble(stage, folders, training, data)
        epochs = 1 if options.trial else stage.epochs
        command = [options.tracklens, "train", f"--data={data}", f"--out={run}", f"--epochs={epochs}"]
        command += [*SAE, *stage.options, f"--threads={options.threads}"]
        if weights and stage.redrawn:
            redrawn = out / f"redrawn-{stage.number}.safetensors"
            redraw(weights, stage.redrawn, redrawn)
            weights = redrawn
        if weights:
            command.append(f"--weights={weights}")
        print(f"stage {stage.number} of {len(STAGES)}", file=sys.stderr, flush=True)
        subprocess.run(command, check=True)
        weights = run / "checkpoint_final.safetensors"
    print(f"the checkpoint is {run / 'checkpoint_best.safetensors'}", file=sys.stderr)


def main() -> int:
    """Runs the command."""
    parser = argparse.ArgumentParser(
        description="Trains the example's checkpoint, in stages (about 75 minutes on two cores)."
    )
    parser.add_argument("--recording", type=Path, required=True, metavar="DIR", help="1000 sequences, by record.py")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to make; must not exist")
    parser.add_argument("--tracklens", default="tracklens", metavar="BIN", help="the command (default: that in PATH)")
    parser.add_argument("--threads", type=record.whole(1), default=1, metavar="N", help="of a training (default 1)")
    parser.add_argument(
        "--run",
        type=Path,
        default=ROOT / "docs/example-run/stage-12/config.json",
        metavar="JSON",
        help="config.json of a run: only its training sequences are used (default: that of the example's)",
    )
    parser.add_argument("--trial", action="store_true", help="few scenes, one epoch a stage: whether all of it runs")
    options = parser.parse_args()
    if options.out.exists():
        print(f"error: {options.out} exists already; name a folder that does not", file=sys.stderr)
        return 1
    try:
        curriculum(options)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ncancelled", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
