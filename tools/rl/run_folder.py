"""The folder of a run: what is in it, written so that a run can end at any moment and go on."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import platform
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, BinaryIO

import filelock
import torch

from protocol import BAD_INPUT, IO_FAILED, MISMATCH, RunConfig, RunError, difference

SCHEMA = "tracklens/rl-run/1"
PACKAGES = [
    "torch", "stable-baselines3", "gymnasium", "panda-gym", "pybullet", "numpy", "tracklens",
]  # fmt: skip

Header = dict[str, Any]


class RunFolder:
    """A run's files; one process at a time works on them.

    - `config.json`: what the run depends on, and the versions of what it was started with
    - `log.jsonl`: a line an evaluation
    - `state.pt`: what the run goes on from, the replay buffer included
    - `model.zip`, `model_best.zip`: the agent after the last step, and at the evaluation with the
      highest return, as Stable-Baselines3 writes them
    - `summary.json`: the result, of a run that ended or was cancelled
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.json"
        self.log = path / "log.jsonl"
        self.state = path / "state.pt"
        self.model = path / "model.zip"
        self.best_model = path / "model_best.zip"
        self.summary = path / "summary.json"

    @contextmanager
    def locked(self, *, is_held: bool = False) -> Iterator[None]:
        """Makes the folder and keeps other processes off it, unless who started this does so."""
        lock = self.path / "lock"
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            with nullcontext() if is_held else filelock.FileLock(lock, timeout=0):
                for left_over in self.path.glob(".tracklens-*.tmp"):
                    left_over.unlink()
                yield
        except filelock.Timeout as error:
            raise RunError(f"another process works on {self.path} ({lock})", IO_FAILED) from error

    def start(self, config: RunConfig, about: dict[str, Any]) -> None:
        """Begins a run, or checks that a started one is the same. `about` is what may change; an
        evaluation of the encoder stays until another one is given."""
        if self.config.exists():
            started = read_json(self.config)
            differs = difference(started, config.to_json())
            if differs:
                raise RunError(
                    f"{self.path} is another run: {differs}. Name another folder for a new run",
                    MISMATCH,
                )
            encoder, before = about["encoder"], started.get("encoder")
            if encoder and before and encoder["evaluation"] is None:
                about = {**about, "encoder": {**encoder, "evaluation": before["evaluation"]}}
        write_json(self.config, describe(config, about))

    def append(self, line: dict[str, Any]) -> None:
        """Adds an evaluation to the log."""
        with told(self.log), open(self.log, "a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
            file.flush()
            os.fsync(file.fileno())

    def evaluations(self) -> list[dict[str, Any]]:
        """The log."""
        if not self.log.exists():
            return []
        return [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()]

    def save(self, header: Header, tensors: dict[str, Any]) -> None:
        """Replaces the state. With the log as it is now it is what the run goes on from."""
        log = self.log.read_bytes() if self.log.exists() else b""
        header = {**header, "log": {"bytes": len(log), "sha256": hashlib.sha256(log).hexdigest()}}
        with whole(self.state) as file:
            torch.save({"header": json.dumps(header), **tensors}, file)

    def restore(self, config: RunConfig) -> tuple[Header, dict[str, Any]] | None:
        """The state, with the log as it was then; None when the run has none yet.

        What the log has beyond is of steps that are done again; it is dropped.
        """
        if not self.state.exists():
            # A run that ended before it was first saved has one line at most.
            if len(self.evaluations()) > 1:
                raise RunError(
                    f"{self.state} is missing, without which the run cannot go on; restore it, or "
                    "start again in another folder",
                    BAD_INPUT,
                )
            self.log.unlink(missing_ok=True)
            return None
        tensors = read_state(self.state)
        header = json.loads(tensors.pop("header"))
        differs = difference(header["config"], config.to_json())
        if differs:
            raise RunError(f"{self.state} is of another run: {differs}", MISMATCH)
        length, digest = header["log"]["bytes"], header["log"]["sha256"]
        log = self.log.read_bytes()[:length] if self.log.exists() else b""
        if hashlib.sha256(log).hexdigest() != digest:
            raise RunError(
                f"{self.state} with its replay buffer does not belong to {self.log}: the log is "
                "not the one that it was saved with. One of them is of another run or was changed; "
                "restore it, or start again in another folder",
                BAD_INPUT,
            )
        if self.log.exists():
            os.truncate(self.log, length)
        return header, tensors


def describe(config: RunConfig, about: dict[str, Any]) -> dict[str, Any]:
    """What config.json holds."""
    return {
        "schema": SCHEMA,
        "versions": {name: version(name) for name in PACKAGES},
        "target": f"{platform.machine()}-{platform.system().lower()}",
        **about,
        **config.to_json(),
    }


def version(package: str) -> str | None:
    """Of an installed package."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def read_json(path: Path) -> dict[str, Any]:
    """An object in a file."""
    try:
        read = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunError(f"cannot read {path}: {error}", BAD_INPUT) from error
    if not isinstance(read, dict):
        raise RunError(f"{path} holds no JSON object", BAD_INPUT)
    return read


def read_state(path: Path) -> dict[str, Any]:
    """Reads a state; nothing that a file asks for is run."""
    try:
        with zipfile.ZipFile(path) as archive:
            damaged = archive.testzip()
        if damaged is None:
            return torch.load(path, map_location="cpu", weights_only=True, mmap=False)
        what = f"the checksum of {damaged} differs"
    except (OSError, ValueError, RuntimeError, zipfile.BadZipFile) as error:
        what = str(error)
    raise RunError(
        f"{path} is damaged ({what}); restore it, or start again in another folder", BAD_INPUT
    )


@contextmanager
def whole(path: Path) -> Iterator[BinaryIO]:
    """A file that is there in whole or, when writing fails, as it was before."""
    temporary = path.with_name(f".tracklens-{path.name}.tmp")
    try:
        with told(path):
            with open(temporary, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Says what failed to be written. PyTorch hides the reason behind an error of its own."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        reason = error if isinstance(error, OSError) else error.__context__
        if not isinstance(reason, OSError):
            raise
        raise RunError(
            f"cannot write {path}: {reason.strerror}. Nothing that was saved is lost; when it can "
            "be written, the same command with --resume goes on",
            IO_FAILED,
        ) from error


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Writes an object."""
    with whole(path) as file:
        file.write((json.dumps(value, indent=2) + "\n").encode())
