"""Time of the keypoints of a step of several environments, beside PyTorch and ONNX Runtime.

    python encoder_step.py FOLDER [--environments 10] [--threads 1] [--rounds 9] [--clock wall]

FOLDER holds encoders of the paper's sizes, NAME.safetensors and the NAME.onnx that `tracklens
export` made of it; `cargo xtask bench step` makes them. Every program takes frames as an
environment renders them, uint8 [B, H, W, 3], and gives float32 [B, N, 2] in numpy. The three take
turns, so that all see the same state of the machine; a table in Markdown has the medians. On a busy
machine `--clock cpu` counts the time on the processor, all threads together.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnxruntime
import torch
import tracklens
from torch import nn

PEERS = Path(__file__).resolve().parents[2] / "crate" / "benches" / "peers"
sys.path.insert(0, str(PEERS))

from extract_torch import dsae_encoder  # noqa: E402
from train_step_torch import SpatialSoftArgmax, basic_encoder, keynet_encoder  # noqa: E402

Step = Callable[[np.ndarray], np.ndarray]

ENCODERS = {
    "basic": lambda: basic_encoder(16),
    "keynet": lambda: keynet_encoder(30),
    "dsae": lambda: dsae_encoder(16),
}
SIDES = (64, 256)
CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}


def of_torch(name: str) -> Step:
    """PyTorch eager; the frames are in its channels-last format already, in which it is fastest."""
    model = nn.Sequential(ENCODERS[name](), SpatialSoftArgmax()).eval()
    model = model.to(memory_format=torch.channels_last)

    def step(frames: np.ndarray) -> np.ndarray:
        with torch.inference_mode():
            image = torch.from_numpy(frames).permute(0, 3, 1, 2).float().div_(255)
            return model(image).flip(2).numpy()

    return step


def of_onnxruntime(path: Path, threads: int) -> Step:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Threads that wait busily would take the cores from the program whose turn is next.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])

    def step(frames: np.ndarray) -> np.ndarray:
        image = np.ascontiguousarray(frames.transpose(0, 3, 1, 2), np.float32) / 255
        return session.run(["keypoints"], {"image": image})[0]

    return step


def check(steps: dict[str, Step], frames: np.ndarray) -> None:
    """Whether ONNX Runtime finds what tracklens finds; PyTorch has weights of its own."""
    found = [steps[program](frames) for program in ("tracklens", "ONNX Runtime")]
    # As tests/onnx/check_onnx.py: float32 sums in another order.
    assert abs(found[0] - found[1]).max() < 1e-3, "the encoders differ"
    assert steps["PyTorch"](frames).shape == found[0].shape


def medians(
    steps: dict[str, Step], frames: np.ndarray, rounds: int, now: Callable[[], float]
) -> dict[str, float]:
    """Milliseconds of a step by program."""
    times: dict[str, list[float]] = {program: [] for program in steps}
    for _ in range(rounds):
        for program, step in steps.items():
            step(frames)
            start = now()
            step(frames)
            times[program].append(now() - start)
    return {program: 1e3 * statistics.median(taken) for program, taken in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--environments", type=int, default=10)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--clock", choices=CLOCKS, default="wall")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    rng = np.random.default_rng(0)
    print(
        f"A step of {arguments.environments} environments, {arguments.threads} threads, ms "
        f"({arguments.clock} time)\n"
    )
    print("| encoder | px | tracklens | PyTorch | ratio | ONNX Runtime | ratio |")
    print("|---|---|---|---|---|---|---|")
    for name in ENCODERS:
        file = arguments.folder / name
        steps = {
            "tracklens": tracklens.Encoder(
                file.with_suffix(".safetensors"), threads=arguments.threads
            ),
            "PyTorch": of_torch(name),
            "ONNX Runtime": of_onnxruntime(file.with_suffix(".onnx"), arguments.threads),
        }
        for side in SIDES:
            shape = (arguments.environments, side, side, 3)
            frames = rng.integers(0, 256, shape, np.uint8)
            check(steps, frames)
            took = medians(steps, frames, arguments.rounds, CLOCKS[arguments.clock])
            ours, eager, runtime = (took[program] for program in steps)
            peers = (f"{peer:.1f} | {peer / ours:.1f}" for peer in (eager, runtime))
            print(f"| {name} | {side} | {ours:.1f} | {' | '.join(peers)} |", flush=True)


main()
