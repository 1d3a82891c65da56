"""How an agent is trained: the paper's protocol and a small one, and what a run depends on."""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from environment import STATES


class RunError(Exception):
    """What went wrong, for a person, and the exit code of the command."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


IO_FAILED, WRONG_ARGUMENTS, BAD_INPUT, MISMATCH, CANCELLED = 1, 2, 3, 4, 130
"""Exit codes, those of the command `tracklens`."""


@dataclass(frozen=True)
class Protocol:
    """The settings of a training that a task comes with; every one is an option of the command."""

    steps: int
    """Steps of the environments together."""
    environments: int
    """Simulated at a time."""
    time_limit: int
    """Steps after which an episode is cut off."""
    evaluate_every: int
    """Steps between evaluations."""
    episodes: int
    """Episodes of an evaluation."""
    learning_starts: int
    """Steps of random actions before the first update."""
    updates_per_step: int
    """Updates of the networks for each step of each environment."""
    batch: int
    """Transitions an update."""
    buffer: int
    """Transitions that the replay buffer holds."""
    learning_rate: float
    """Adam's."""
    discount: float
    """Of the reward a step later."""
    entropy: float
    """The coefficient of the policy's entropy that its learning starts from."""
    network: tuple[int, ...]
    """Units of the hidden layers of the actor and of each critic."""
    size: int
    """Side of the frames that an encoder sees, in pixels."""
    meshes: str
    """Of the robot in these frames."""


PROTOCOLS = {
    # The paper's (appendix, table "Hyperparameters for RL training"). What is not in its table is
    # Stable-Baselines3's default, as there.
    "push": Protocol(
        steps=3_000_000,
        environments=10,
        time_limit=100,
        evaluate_every=10_000,
        episodes=10,
        learning_starts=100_000,
        updates_per_step=1,
        batch=256,
        buffer=1_000_000,
        learning_rate=3e-4,
        discount=0.99,
        entropy=1.0,
        network=(256, 256),
        size=256,
        meshes="paper",
    ),
    # For a machine with one core: a curve in minutes.
    "reach": Protocol(
        steps=10_000,
        environments=4,
        time_limit=50,
        evaluate_every=1_000,
        episodes=10,
        learning_starts=1_000,
        updates_per_step=1,
        batch=128,
        buffer=100_000,
        learning_rate=1e-3,
        discount=0.95,
        entropy=0.05,
        network=(64, 64),
        size=64,
        meshes="simple",
    ),
}


@dataclass(frozen=True)
class Checkpoint:
    """What tells the encoder of a run from another one."""

    crc32: int
    """Of the file."""

    @classmethod
    def of(cls, path: Path) -> Checkpoint:
        """Reads the file."""
        if path.exists() and not path.is_file():
            raise RunError(f"{path} is no file; expected a checkpoint", IO_FAILED)
        try:
            return cls(zlib.crc32(path.read_bytes()))
        except OSError as error:
            raise RunError(f"cannot read {path}: {error.strerror}", IO_FAILED) from error


def evaluation_of(path: Path) -> dict[str, Any]:
    """How well an encoder tracks, from what `tracklens eval --json` wrote: TC, the map, and of
    every object its error and threshold. A report takes the errors from here."""
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}", IO_FAILED) from error
    except ValueError as error:
        raise RunError(f"{path} is no JSON: {error}", BAD_INPUT) from error
    schema = read.get("schema") if isinstance(read, dict) else None
    if not str(schema).startswith("tracklens/evaluation/"):
        raise RunError(
            f"{path} is no evaluation; expected what `tracklens eval --json` writes", BAD_INPUT
        )
    kept = ["name", "error", "threshold"]
    objects = [{name: one[name] for name in kept} for one in read["objects"]]
    return {"tc": read["tc"], "transform": read["transform"], "objects": objects}


@dataclass(frozen=True)
class RunConfig:
    """Everything that decides what a run computes but its number of steps, so that a run can be
    given more."""

    task: str
    reward: str
    state: str
    seed: int
    checkpoint: Checkpoint | None
    """Of the states with keypoints."""
    size: int | None
    """Of the frames; None where nothing is rendered."""
    meshes: str | None
    environments: int
    time_limit: int
    evaluate_every: int
    episodes: int
    learning_starts: int
    updates_per_step: int
    batch: int
    buffer: int
    learning_rate: float
    discount: float
    entropy: float
    network: tuple[int, ...]

    @classmethod
    def new(
        cls,
        protocol: Protocol,
        *,
        task: str,
        reward: str,
        state: str,
        seed: int,
        checkpoint: Checkpoint | None,
    ) -> RunConfig:
        """A run by a protocol."""
        own = {field.name for field in fields(cls)}
        settings = {name: value for name, value in asdict(protocol).items() if name in own}
        if not STATES[state].frame:
            settings |= {"size": None, "meshes": None}
        return cls(
            task=task, reward=reward, state=state, seed=seed, checkpoint=checkpoint, **settings
        )

    def to_json(self) -> dict[str, Any]:
        """As `config.json` has it."""
        return {**asdict(self), "network": list(self.network)}

    def check_steps(self, steps: int) -> None:
        """Whether the environments, which step together, meet every number of steps."""
        for option, number in [("--steps", steps), ("--evaluate-every", self.evaluate_every)]:
            if number % self.environments:
                raise RunError(
                    f"{option} {number} is not a multiple of the {self.environments} environments, "
                    "which step together; choose one, or another number with --environments",
                    WRONG_ARGUMENTS,
                )


def difference(started: dict[str, Any], asked: dict[str, Any]) -> str | None:
    """The first setting in which two configurations differ, in words."""
    for name, value in asked.items():
        if name not in started or started[name] != value:
            return f"{name} was {started.get(name)!r} and is {value!r} now"
    return None
