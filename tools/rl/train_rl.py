"""Trains an agent (SAC) on one of the paper's states and writes a run folder.

README.md beside this file tells the protocol; `python train_rl.py --help` the options.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

try:
    import numpy as np
    import torch
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.logger import Logger, configure
    from stable_baselines3.common.vec_env import VecEnv
    from tqdm import tqdm

    import agent
    from environment import MESHES, REWARDS, STATES, TASKS
    from protocol import (
        BAD_INPUT,
        CANCELLED,
        IO_FAILED,
        PROTOCOLS,
        WRONG_ARGUMENTS,
        Checkpoint,
        Protocol,
        RunConfig,
        RunError,
        evaluation_of,
    )
    from run_folder import RunFolder, whole, write_json
except ModuleNotFoundError as error:
    requirements = Path(__file__).with_name("requirements.txt")
    sys.exit(
        f"error: the package {error.name} is missing; "
        f"install what is needed with `{sys.executable} -m pip install -r {requirements}`"
    )

EVALUATION_ENVIRONMENTS = 2
"""As in the authors' code."""


class Cancelled(Exception):
    """Ctrl-C or a signal asked to end."""


class BetweenSteps(BaseCallback):
    """Shows the progress and ends a cancelled training, where every step is learned from."""

    def __init__(self, progress: tqdm, cancelled: list[int]) -> None:
        super().__init__()
        self.progress = progress
        self.cancelled = cancelled

    def _on_rollout_start(self) -> None:
        self.progress.update(self.model.num_timesteps - self.progress.n)
        if self.cancelled:
            raise Cancelled

    def _on_step(self) -> bool:
        return True


class Training:
    """A run at work."""

    def __init__(
        self,
        folder: RunFolder,
        config: RunConfig,
        steps: int,
        training: VecEnv,
        evaluation: VecEnv,
    ) -> None:
        self.folder = folder
        self.config = config
        self.steps = steps
        self.evaluation = evaluation
        self.agent = agent.new_agent(config, training)
        self.agent.set_logger(logger(folder.path))
        self.seconds = 0.0
        self.started = time.monotonic()
        restored = folder.restore(config)
        if restored:
            header, tensors = restored
            agent.go_on(self.agent, header, tensors)
            self.seconds = header["seconds"]

    def run(self, cancelled: list[int]) -> None:
        """Trains up to the last step, or until it is cancelled."""
        first = self.agent.num_timesteps
        if first >= self.steps:
            print(f"{self.folder.path} is complete: {first} steps", file=sys.stderr)
            return
        if first:
            print(f"going on after step {first}", file=sys.stderr)
        bar = tqdm(total=self.steps, initial=first, unit="step", disable=None, smoothing=0.05)
        with bar as progress:
            between = BetweenSteps(progress, cancelled)
            try:
                while self.agent.num_timesteps < self.steps:
                    self._learn(between)
                    progress.write(told(self._evaluate()), file=sys.stderr)
                    self._save()
            except Cancelled:
                self._save()
                self._finish(interrupted=True)
                raise
        self._finish(interrupted=False)

    def _learn(self, between: BetweenSteps) -> None:
        """Trains up to the next evaluation."""
        done, every = self.agent.num_timesteps, self.config.evaluate_every
        following = min(self.steps, done - done % every + every)
        self.agent.learn(
            following - done,
            callback=between,
            log_interval=self.config.environments,
            reset_num_timesteps=False,
        )

    def _evaluate(self) -> dict[str, Any]:
        """Episodes of the agent as it is, without exploration; their starts follow from the seed
        and the step."""
        step = self.agent.num_timesteps
        self.evaluation.seed(agent.environment_seed(self.config.seed, agent.EVALUATION, step))
        solved: list[bool] = []

        def count(local: dict[str, Any], _: dict[str, Any]) -> None:
            if local["done"]:
                solved.append(bool(local["info"]["is_success"]))

        returns, lengths = evaluate_policy(
            self.agent,
            self.evaluation,
            n_eval_episodes=self.config.episodes,
            deterministic=True,
            callback=count,
            return_episode_rewards=True,
            warn=False,
        )
        line = {
            "step": step,
            "seconds": round(self._seconds(), 3),
            "success": float(np.mean(solved)),
            "return": float(np.mean(returns)),
            "length": float(np.mean(lengths)),
            "episodes": {
                "success": solved,
                "return": [float(value) for value in returns],
                "length": [int(value) for value in lengths],
            },
        }
        best = max((one["return"] for one in self.folder.evaluations()), default=-np.inf)
        if line["return"] > best:
            self._write_model(self.folder.best_model)
        self.folder.append(line)
        for name in ["success", "return", "length"]:
            self.agent.logger.record(f"evaluation/{name}", line[name])
        self.agent.logger.dump(step)
        return line

    def _save(self) -> None:
        header, tensors = agent.capture(self.agent)
        header |= {"config": self.config.to_json(), "seconds": self._seconds()}
        self.folder.save(header, tensors)

    def _finish(self, *, interrupted: bool) -> None:
        self._write_model(self.folder.model)
        evaluations = self.folder.evaluations()
        best = max(evaluations, key=lambda line: line["return"], default=None)
        summary = {
            "interrupted": interrupted,
            "steps": self.agent.num_timesteps,
            "seconds": round(self._seconds(), 3),
            "best_step": best and best["step"],
            "last": evaluations[-1] if evaluations else None,
        }
        write_json(self.folder.summary, summary)

    def _write_model(self, path: Path) -> None:
        with whole(path) as file:
            self.agent.save(file)

    def _seconds(self) -> float:
        """Wall time over all parts of a resumed run."""
        return self.seconds + time.monotonic() - self.started


def told(line: dict[str, Any]) -> str:
    """An evaluation in words."""
    return (
        f"step {line['step']}: success {line['success']:.2f}, return {line['return']:.2f}, "
        f"length {line['length']:.1f}"
    )


def logger(folder: Path) -> Logger:
    """Writes for TensorBoard where it is installed."""
    if importlib.util.find_spec("tensorboard"):
        return configure(str(folder), ["tensorboard"])
    return Logger(folder=None, output_formats=[])


@contextmanager
def signals() -> Iterator[list[int]]:
    """The signals so far that ask to end; a second one ends at once."""
    received: list[int] = []
    handlers = {}

    def receive(number: int, _: Any) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)

    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)):
        # Under nohup SIGHUP is ignored.
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            handlers[number] = signal.signal(number, receive)
    try:
        yield received
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """An argument that is a whole number within limits, both included."""
    expected = f"{least} or more" if most is None else f"{least} to {most}"

    def parse(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = least - 1
        if number < least or (most is not None and number > most):
            raise argparse.ArgumentTypeError(f"expected a whole number, {expected}, got {text!r}")
        return number

    return parse


def number_within(least: float, most: float) -> Callable[[str], float]:
    """An argument above `least` and at most `most`."""

    def parse(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = least
        if not least < number <= most:
            raise argparse.ArgumentTypeError(
                f"expected a number above {least} and at most {most}, got {text!r}"
            )
        return number

    return parse


def layers(text: str) -> tuple[int, ...]:
    """An argument such as 256,256."""
    return tuple(whole_number(1, 4096)(part) for part in text.split(","))


SETTINGS: dict[str, tuple[Callable[[str], Any], str, str]] = {
    "steps": (whole_number(1), "N", "of the environments together"),
    "environments": (whole_number(1, 256), "N", "simulated at a time"),
    "time_limit": (whole_number(1), "T", "steps after which an episode is cut off"),
    "evaluate_every": (whole_number(1), "N", "steps between evaluations"),
    "episodes": (whole_number(1), "N", "of an evaluation"),
    "learning_starts": (whole_number(0), "N", "steps of random actions before the first update"),
    "updates_per_step": (whole_number(1), "N", "updates for each step of each environment"),
    "batch": (whole_number(1), "N", "transitions an update"),
    "buffer": (whole_number(1), "N", "transitions that the replay buffer holds"),
    "learning_rate": (number_within(0, 1), "RATE", "Adam's"),
    "discount": (number_within(0, 1), "GAMMA", "of the reward a step later"),
    "entropy": (number_within(0, 100), "COEF", "entropy coefficient that learning starts from"),
    "network": (layers, "UNITS", "of hidden layers, e.g. 256,256"),
    "size": (whole_number(16, 1024), "PX", "side of the frames that an encoder sees"),
}
"""The options that a protocol has a value for."""


OF_A_SWEEP = ["state", "seed", "checkpoint", "evaluation", "out", "resume", "threads", "lock_held"]
"""What `tracklens sweep` decides itself."""


def names(actions: list[argparse.Action]) -> list[str]:
    """Options without their dashes."""
    return [action.option_strings[-1].removeprefix("--") for action in actions]


class ShowOptions(argparse.Action):
    """Says as JSON what a sweep file may give, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Prints it."""
        own = [a for a in parser._actions if a.dest not in ["help", "options", *OF_A_SWEEP]]
        switches = [action for action in own if action.nargs == 0]
        values = [action for action in own if action.nargs != 0]
        told = {"states": list(STATES), "values": names(values), "switches": names(switches)}
        print(json.dumps(told))
        parser.exit()


def arguments() -> argparse.ArgumentParser:
    """The options of the command."""
    parser = argparse.ArgumentParser(
        description="Trains an agent (SAC) on one of the paper's states and writes a run folder.",
        epilog="Exit codes: 0 done, 1 reading or writing failed, 2 wrong arguments, 3 bad input, "
        "4 the folder is of another run, 130 cancelled.",
    )
    parser.add_argument("--state", choices=STATES, required=True, help="what the agent sees")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="RUN", help="the run folder to write"
    )
    parser.add_argument(
        "--checkpoint", type=Path, metavar="FILE", help="the encoder of the states with keypoints"
    )
    parser.add_argument(
        "--evaluation",
        type=Path,
        metavar="FILE.json",
        help="how well that encoder tracks, from `tracklens eval --json`, for reports",
    )
    parser.add_argument(
        "--task",
        choices=TASKS,
        default="reach",
        help="reach: the end effector has to come to the plate (default); "
        "push: the cube has to, the paper's task and protocol",
    )
    parser.add_argument(
        "--reward",
        choices=REWARDS,
        default="sparse",
        help="sparse: -1 a step until it is solved (default); dense: minus the distance in m",
    )
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of everything random")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with the run in RUN after what it saved last; start it where there is none",
    )
    parser.add_argument(
        "--lock-held",
        action="store_true",
        help="who starts this has the lock of RUN (tracklens sweep)",
    )
    parser.add_argument(
        "--options",
        action=ShowOptions,
        nargs=0,
        help="say as JSON what a sweep file may give, and end",
    )
    parser.add_argument(
        "--processes", action="store_true", help="an environment a process; changes no result"
    )
    parser.add_argument(
        "--threads", type=whole_number(1), default=1, metavar="N", help="of this process (1)"
    )
    protocol = parser.add_argument_group(
        "protocol", "by default that of the task; for reach and push:"
    )
    for name, (parse, value, text) in SETTINGS.items():
        reach, push = (getattr(PROTOCOLS[task], name) for task in ("reach", "push"))
        protocol.add_argument(
            option(name), type=parse, metavar=value, help=f"{text} ({shown(reach)}, {shown(push)})"
        )
    protocol.add_argument(
        "--meshes", choices=MESHES, help="of the robot in the frames (simple, paper)"
    )
    return parser


def option(name: str) -> str:
    """The option of a setting."""
    return "--" + name.replace("_", "-")


def shown(value: Any) -> str:
    """A default as one types it."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)


def chosen(options: argparse.Namespace) -> Protocol:
    """The task's protocol with what the options change."""
    names = [field.name for field in dataclasses.fields(Protocol)]
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return dataclasses.replace(PROTOCOLS[options.task], **given)


def check(options: argparse.Namespace) -> None:
    """What options ask of each other, and of the folder."""
    frames = STATES[options.state].frame
    if frames and options.checkpoint is None:
        raise RunError(f"--state {options.state} needs an encoder: --checkpoint", WRONG_ARGUMENTS)
    if not frames:
        for name in ["checkpoint", "evaluation", "size", "meshes"]:
            if getattr(options, name) is not None:
                raise RunError(
                    f"{option(name)} belongs to keypoints, and --state {options.state} has none",
                    WRONG_ARGUMENTS,
                )
    if not options.resume and os.path.lexists(options.out):
        raise RunError(
            f"{options.out} exists already; go on with its run by --resume, or name a folder "
            "that does not exist",
            IO_FAILED,
        )


def train(options: argparse.Namespace, cancelled: list[int]) -> None:
    """Carries out the command."""
    check(options)
    protocol = chosen(options)
    checkpoint = Checkpoint.of(options.checkpoint) if options.checkpoint else None
    config = RunConfig.new(
        protocol,
        task=options.task,
        reward=options.reward,
        state=options.state,
        seed=options.seed,
        checkpoint=checkpoint,
    )
    config.check_steps(protocol.steps)
    encoder = agent.load_encoder(options.checkpoint, options.threads) if checkpoint else None
    about = {
        "steps": protocol.steps,
        "threads": options.threads,
        "checkpoint_file": options.checkpoint.name if checkpoint else None,
        "encoder": encoder and about_encoder(options, encoder.architecture),
    }
    torch.set_num_threads(options.threads)
    folder = RunFolder(options.out)
    with folder.locked(is_held=options.lock_held):
        folder.start(config, about)
        venvs = [
            agent.environments(config, count, encoder, processes=options.processes)
            for count in (config.environments, EVALUATION_ENVIRONMENTS)
        ]
        try:
            Training(folder, config, protocol.steps, *venvs).run(cancelled)
        finally:
            for venv in venvs:
                venv.close()


def about_encoder(options: argparse.Namespace, architecture: str | None) -> dict[str, Any]:
    """What a report needs to know of the encoder."""
    return {
        "path": str(options.checkpoint),
        "architecture": architecture,
        "evaluation": evaluation_of(options.evaluation) if options.evaluation else None,
    }


def main(argv: list[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    options = arguments().parse_args(argv)
    try:
        with signals() as cancelled:
            train(options, cancelled)
    except RunError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.code
    except agent.encoder_errors() as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return IO_FAILED
    except (Cancelled, KeyboardInterrupt):
        print("cancelled; --resume goes on", file=sys.stderr)
        return CANCELLED
    return 0


if __name__ == "__main__":
    sys.exit(main())
