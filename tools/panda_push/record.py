"""Records image sequences of the PandaPush task with the positions of its objects in the image.

The protocol is that of Cramer, Reiher and Trimpe (L4DC 2024), as their published code carries it out; README.md beside
this file tells where that differs from the paper's text. Run `python record.py --help` for the options.
"""

from __future__ import annotations

import argparse
import csv
import importlib.metadata
import json
import os
import shutil
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from itertools import islice
from pathlib import Path

try:
    import h5py
    import numpy as np
    import pybullet
    from numpy.typing import NDArray
    from PIL import Image

    from scene import (
        ANTIALIAS,
        LINK_SITES,
        OBJECTS,
        ROBOTS,
        SITES,
        Camera,
        Environment,
        FloatArray,
        eight_bit,
    )
except ModuleNotFoundError as error:
    requirements = Path(__file__).with_name("requirements.txt")
    sys.exit(
        f"error: the package {error.name} is missing; "
        f"install what is needed with `{sys.executable} -m pip install -r {requirements}`"
    )

ACTION_STD = 1.0

PUSH_NOISE = 0.3
"""Standard deviation of what is added to the actions of a push."""
STEP = 0.05
"""How far the end effector goes in a step at most, in metres: an action of 1."""
BEHIND = 0.08
"""From here the cube is pushed: metres from its middle."""
PUSHED = 0.1
"""So far a push goes beyond where the cube was, in metres."""
PUSH_SPEED = 0.7
"""The longest action of a push."""
AWAY = (-0.35, 0.25, 0.05), (0.3, 0.55, 0.55)
"""Two corners of the box of places between pushes, on one side of the table, in metres."""
NEAR_EDGE = 0.75, 0.95
"""So far from the middle of the image, along x or y, a place between pushes is; its edge is at 1."""
HEIGHT = 0.02
"""Of the end effector above the table while it pushes, in metres."""


@dataclass
class Sequence:
    """Successive frames of one episode."""

    episode: int
    frames: list[FloatArray] = field(default_factory=list)
    sites: list[FloatArray] = field(default_factory=list)


@dataclass
class Statistics:
    """What it took to record the sequences."""

    episodes: int = 0
    successes: int = 0
    rendered: int = 0
    dropped: int = 0
    """Frames of sequences that the end of their episode cut short."""


Actions = Iterator[NDArray[np.float32]]
"""The actions of an episode, one after the other."""


def random_walk(environment: Environment, noise: np.random.Generator) -> Actions:
    """The paper's policy: the action does a random walk.

    It is drawn once an episode from the action space, then moved by Gaussian noise before every step, the first one
    included, and clipped to the action space.
    """
    space = environment.action_space
    action = space.sample()
    while True:
        moved = action + noise.normal(scale=ACTION_STD, size=space.shape)
        action = np.clip(moved, space.low, space.high).astype(np.float32)
        yield action


def pushes(environment: Environment, noise: np.random.Generator) -> Actions:
    """Pushes the cube to and fro, so that arm and cube move in every episode.

    The end effector starts at a place that is drawn at the side of the table. It goes above a place beside the cube,
    down, through the cube towards the middle of the table, and away to another place that is drawn; then again. Noise
    is added to every action.
    """
    space = environment.action_space
    start_away(environment, noise)
    while True:
        cube = environment.sim.get_base_position("object")
        turn = noise.normal(scale=0.5)
        x, y = -cube[:2] / max(np.linalg.norm(cube[:2]), 1e-6)
        direction = np.array(
            [x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), 0.0]
        )
        start, end = cube - BEHIND * direction, cube + PUSHED * direction
        above = start + [0, 0, 2 * BEHIND]
        away = place_away(environment.camera, noise)
        for goal, speed in ((above, 1.0), (start, 1.0), (end, PUSH_SPEED), (away, 1.0)):
            goal = np.array([*goal[:2], max(goal[2], HEIGHT)])
            for _ in range(10):
                way = goal - environment.robot.get_ee_position()
                if np.linalg.norm(way) < STEP / 2:
                    break
                moved = np.clip(way / STEP, -speed, speed)
                moved += noise.normal(scale=PUSH_NOISE * speed, size=space.shape)
                yield np.clip(moved, space.low, space.high).astype(np.float32)


def place_away(camera: Camera, noise: np.random.Generator) -> NDArray[np.float64]:
    """Draws a place beside the table's middle, in metres, that lies near the edge of the image."""
    nearest, farthest = NEAR_EDGE
    while True:
        place = noise.uniform(*AWAY) * [1, noise.choice([-1, 1]), 1]
        if nearest < np.abs(camera.project(place[None])).max() < farthest:
            return place


def start_away(environment: Environment, noise: np.random.Generator) -> None:
    """Puts the end effector to a place that is drawn, the gripper pointing down."""
    robot = environment.robot
    pose = robot.inverse_kinematics(
        link=LINK_SITES["eef"],
        position=place_away(environment.camera, noise),
        orientation=np.array([1.0, 0.0, 0.0, 0.0]),
    )
    robot.set_joint_angles(pose)


POLICIES: dict[str, Callable[[Environment, np.random.Generator], Actions]] = {
    "random": random_walk,
    "push": pushes,
}


def recorded(
    environment: Environment, options: argparse.Namespace, statistics: Statistics
) -> Iterator[Sequence]:
    """Records sequences without end, as many as an episode has room for."""
    length, seed = options.sequence_length, options.seed
    noise = np.random.default_rng(seed)
    environment.action_space.seed(seed)
    while True:
        statistics.episodes += 1
        environment.reset(seed=seed + statistics.episodes)
        actions = POLICIES[options.policy](environment, noise)
        sequence = Sequence(statistics.episodes)
        for action in islice(actions, options.episode_steps):
            _, _, success, _, _ = environment.step(action)
            sequence.frames.append(environment.frame())
            sequence.sites.append(environment.sites())
            statistics.rendered += 1
            statistics.successes += success
            if len(sequence.frames) == length:
                yield sequence
                sequence = Sequence(statistics.episodes)
            if success:
                break
        statistics.dropped += len(sequence.frames)


Store = Callable[[Sequence], None]
Shape = tuple[int, int, int]
"""How many sequences, frames of each, and the side of a frame."""


@contextmanager
def png_store(folder: Path, _shape: Shape) -> Iterator[Store]:
    """Stores frames as 8-bit PNG, one folder a sequence; with a palette where that loses nothing."""
    count = 0

    def store(sequence: Sequence) -> None:
        nonlocal count
        target = folder / f"seq_{count:04}"
        target.mkdir()
        for index, frame in enumerate(sequence.frames):
            image = with_palette(eight_bit(frame))
            image.save(target / f"frame_{index:03}.png", compress_level=6)
        count += 1

    yield store


def with_palette(frame: NDArray[np.uint8]) -> Image.Image:
    """An image of the same colours, by indices into a palette if there are 256 at most: half the bytes."""
    red, green, blue = np.moveaxis(frame.astype(np.uint32), -1, 0)
    colors, indices = np.unique(red << 16 | green << 8 | blue, return_inverse=True)
    if len(colors) > 256:
        return Image.fromarray(frame)
    image = Image.fromarray(indices.reshape(red.shape).astype(np.uint8), "P")
    image.putpalette(np.stack([colors >> 16, colors >> 8 & 255, colors & 255], axis=-1).astype(np.uint8).tobytes())
    return image


@contextmanager
def npz_store(folder: Path, shape: Shape) -> Iterator[Store]:
    """Stores `frames` and `sites`, (x, y), as float32 in recording.npz; the frames are written as they come."""
    sequences, length, size = shape
    sites: list[list[FloatArray]] = []
    with zipfile.ZipFile(folder / "recording.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("frames.npy", "w", force_zip64=True) as member:
            header = {"descr": "<f4", "fortran_order": False, "shape": (sequences, length, size, size, 3)}
            np.lib.format.write_array_header_1_0(member, header)

            def store(sequence: Sequence) -> None:
                for frame in sequence.frames:
                    member.write(frame.astype("<f4").tobytes())
                sites.append(sequence.sites)

            yield store
        with archive.open("sites.npy", "w") as member:
            np.lib.format.write_array(member, np.array(sites, dtype="<f4"))


@contextmanager
def hdf5_store(folder: Path, shape: Shape) -> Iterator[Store]:
    """Stores `images` and `keypoints`, (x, y), as float32 in recording.hdf5: what the authors' code reads."""
    count = 0
    sequences, length, size = shape
    frame = (size, size, 3)
    with h5py.File(folder / "recording.hdf5", "w") as file:
        images = file.create_dataset(
            "images",
            shape=(sequences, length, *frame),
            dtype="f4",
            chunks=(1, 1, *frame),
            compression="gzip",
        )
        keypoints = file.create_dataset("keypoints", shape=(sequences, length, len(SITES), 2), dtype="f4")

        def store(sequence: Sequence) -> None:
            nonlocal count
            images[count] = sequence.frames
            keypoints[count] = sequence.sites
            count += 1

        yield store


@contextmanager
def truth_store(folder: Path) -> Iterator[Store]:
    """Stores where the paper's objects are in ground_truth.csv."""
    count = 0
    with open(folder / "ground_truth.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["sequence", "frame", "object", "x", "y"])

        def store(sequence: Sequence) -> None:
            nonlocal count
            for frame, sites in enumerate(sequence.sites):
                for name in OBJECTS:
                    x, y = sites[SITES.index(name)]
                    table.writerow([count, frame, name, f"{x:.7f}", f"{y:.7f}"])
            count += 1

        yield store


@contextmanager
def episode_store(folder: Path) -> Iterator[Store]:
    """Stores the episode of every sequence in sequences.csv: sequences of one episode share its target."""
    count = 0
    with open(folder / "sequences.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["sequence", "episode"])

        def store(sequence: Sequence) -> None:
            nonlocal count
            table.writerow([count, sequence.episode])
            count += 1

        yield store


FORMATS: dict[str, Callable[[Path, Shape], AbstractContextManager[Store]]] = {
    "png": png_store,
    "npz": npz_store,
    "hdf5": hdf5_store,
}


def record(options: argparse.Namespace, folder: Path) -> None:
    """Records into an empty folder."""
    statistics = Statistics()
    shape = (options.sequences, options.sequence_length, options.size)
    with ExitStack() as stack:
        environment = Environment(options.size, meshes=options.meshes)
        stack.callback(environment.close)
        stores = [
            stack.enter_context(FORMATS[options.format](folder, shape)),
            stack.enter_context(truth_store(folder)),
            stack.enter_context(episode_store(folder)),
        ]
        progress = Progress(options.sequences)
        source = recorded(environment, options, statistics)
        for _ in range(options.sequences):
            sequence = next(source)
            for store in stores:
                store(sequence)
            progress.advance()
        description = describe(options, environment.camera, statistics)
    text = json.dumps(description, indent=1) + "\n"
    (folder / "meta.json").write_text(text, encoding="utf-8")


def describe(options: argparse.Namespace, camera: Camera, statistics: Statistics) -> dict[str, object]:
    """What meta.json holds: how the recording was made, the camera, and what it took."""
    packages = ["panda-gym", "pybullet", "gymnasium", "numpy"]
    return {
        "sequences": options.sequences,
        "frames": options.sequence_length,
        "episode_steps": options.episode_steps,
        "meshes": options.meshes,
        "policy": options.policy,
        "action_std": ACTION_STD,
        "size": options.size,
        "antialias": ANTIALIAS,
        "seed": options.seed,
        "format": options.format,
        "convention": "x right, y down; NDC (edge of the image = +-1) * 0.999",
        "objects": OBJECTS,
        "sites": SITES,
        "links": LINK_SITES,
        "camera": asdict(camera),
        "view_matrix_column_major": camera.view().T.ravel().tolist(),
        "projection_matrix_column_major": camera.projection().T.ravel().tolist(),
        "statistics": asdict(statistics),
        "versions": {package: importlib.metadata.version(package) for package in packages},
    }


class Progress:
    """Says on the standard error how far the recording is: a line that changes, or a line every half minute."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.done = 0
        self.started = self.shown = time.monotonic()

    def advance(self) -> None:
        """Counts one sequence more."""
        self.done += 1
        now = time.monotonic()
        last = self.done == self.total
        terminal = sys.stderr.isatty()
        if not (terminal or last or now - self.shown >= 30):
            return
        self.shown = now
        each = (now - self.started) / self.done
        left = each * (self.total - self.done)
        line = f"{self.done} of {self.total} sequences, {each:.2f} s each, {left / 60:.1f} min left"
        print(f"\r{line}" if terminal else line, end="\n" if last or not terminal else "", file=sys.stderr, flush=True)


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """An argument that is a whole number within limits, both included."""
    expected = f"a whole number from {least} on" if most is None else f"a whole number from {least} to {most}"

    def parse(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = least - 1
        if number < least or (most is not None and number > most):
            raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
        return number

    return parse


def arguments() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = argparse.ArgumentParser(
        description="Records image sequences of the PandaPush task with the positions of its objects in the image.",
        epilog="Exit codes: 0 done, 1 recording or writing failed, 2 wrong arguments, 130 cancelled.",
    )
    parser.add_argument("--sequences", type=whole(1), required=True, metavar="N", help="how many")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="the folder to make; must not exist")
    parser.add_argument("--seed", type=whole(0), default=0, metavar="S", help="of everything random (default 0)")
    parser.add_argument("--size", type=whole(16, 1024), default=256, metavar="PX", help="side of a frame (default 256)")
    parser.add_argument(
        "--sequence-length", type=whole(1), default=10, metavar="T", help="frames of a sequence (default 10)"
    )
    parser.add_argument(
        "--episode-steps",
        type=whole(1),
        default=20,
        metavar="T",
        help="steps of an episode, at least those of a sequence (default 20)",
    )
    parser.add_argument(
        "--policy",
        choices=POLICIES,
        default="random",
        help="what the arm does: the paper's random walk (default), or pushes of the cube",
    )
    parser.add_argument(
        "--meshes",
        choices=ROBOTS,
        default="paper",
        help="of the robot: the paper's (default), or its collision meshes, which render several times as fast",
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default="png",
        help="of the frames: 8-bit PNG, a folder a sequence (default), or float32 in recording.npz or recording.hdf5",
    )
    return parser


def main() -> int:
    """Records into a folder beside the one asked for, and renames it when everything is there."""
    parser = arguments()
    options = parser.parse_args()
    if options.episode_steps < options.sequence_length:
        parser.error(
            f"an episode of {options.episode_steps} steps has no sequence of {options.sequence_length} frames; "
            "raise --episode-steps"
        )
    out: Path = options.out
    if os.path.lexists(out):
        print(f"error: {out} exists already; name a folder that does not", file=sys.stderr)
        return 1
    folder = out.absolute().with_name(f".{out.absolute().name}.partial-{os.getpid()}")
    try:
        folder.mkdir(parents=True)
        record(options, folder)
        folder.rename(out)
    except OSError as error:
        print(f"error: cannot record into {out}: {error}", file=sys.stderr)
        return 1
    except pybullet.error as error:
        print(f"error: PyBullet failed: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\ncancelled; nothing is kept", file=sys.stderr)
        return 130
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{options.sequences} sequences in {out}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
