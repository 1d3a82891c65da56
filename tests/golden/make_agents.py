"""Writes agents.json: run folders of agents as tools/rl leaves them, with short logs, and what
SciPy and rliable find in them.

    pip install numpy==2.3.5 pandas==2.3.3 scipy==1.16.3 rliable==1.2.0
    python3 make_agents.py
"""

import json
from pathlib import Path

import numpy
import scipy
from rliable import library, metrics
from scipy.ndimage import gaussian_filter1d

STEPS = list(range(1000, 13000, 1000))
SEEDS = range(5)
# The encoders: CRC-32, architecture, and tracking errors of cube, target and end effector.
ENCODERS = {
    "sharp": (101, "keynet-vel-std-bg", [0.002, 0.003, 0.04]),
    "fair": (102, "basic-vel-std-bg", [0.005, 0.012, 0.16]),
    "dim": (103, "basic", [0.021, 0.002, 0.31]),
    "blind": (104, "dsae", [0.080, 0.110, 0.52]),
}
THRESHOLDS = {"cube": 0.015, "target": 0.015, "eef": 0.1}
# How early and how well agents learn: the middle of the rise in steps, and its height.
LEARNED = {
    "full": (6500, 0.95),
    "points+robot": (3000, 1.0),
    "sharp": (4000, 0.96),
    "fair": (5500, 0.75),
    "dim": (7000, 0.45),
    "blind": (9000, 0.1),
}

rng = numpy.random.default_rng(18)


def config(state, seed, encoder):
    crc32, architecture, errors = ENCODERS.get(encoder, (None, None, None))
    objects = [
        {"name": name, "error": error, "threshold": threshold}
        for error, (name, threshold) in zip(errors or [], THRESHOLDS.items(), strict=False)
    ]
    tc = sum(one["error"] <= one["threshold"] for one in objects) / 3
    evaluation = {"tc": tc, "transform": "affine", "objects": objects}
    path = f"encoders/{encoder}/checkpoint_best.safetensors"
    return {
        "schema": "tracklens/rl-run/1",
        "versions": {"torch": "2.15.0"},
        "target": "x86_64-linux",
        "steps": STEPS[-1],
        "threads": 1,
        "checkpoint_file": "checkpoint_best.safetensors" if encoder else None,
        "encoder": encoder
        and {"path": path, "architecture": architecture, "evaluation": evaluation},
        "task": "reach",
        "reward": "sparse",
        "state": state,
        "seed": seed,
        "checkpoint": encoder and {"crc32": crc32},
        "size": 64 if encoder else None,
        "meshes": "simple" if encoder else None,
        "environments": 4,
        "evaluate_every": 1000,
        "episodes": 10,
        "learning_rate": 0.001,
        "network": [64, 64],
    }


def success(name):
    middle, height = LEARNED[name]
    middle += rng.normal(scale=800)
    rise = height / (1 + numpy.exp(-(numpy.array(STEPS) - middle) / 700))
    return (rng.binomial(10, rise) / 10).tolist()


runs, groups = {}, {}
for name in LEARNED:
    encoder = name if name in ENCODERS else None
    state = "keypoints+robot" if encoder else name
    curves = []
    for seed in SEEDS:
        curve = success(name)
        curves.append(curve)
        log = [
            {"step": step, "seconds": step / 100, "success": share, "return": 50 * (share - 1)}
            for step, share in zip(STEPS, curve, strict=True)
        ]
        runs[f"{name}/seed-{seed:02}"] = {"config": config(state, seed, encoder), "log": log}
    groups[f"{name}, {state}" if encoder else state] = numpy.array(curves)


def by_step(scores):
    return numpy.array([metrics.aggregate_iqm(scores[..., at]) for at in range(scores.shape[-1])])


expected = {}
for name, curves in groups.items():
    smoothed = numpy.clip(gaussian_filter1d(curves, 2.5, axis=1), 0, 1)
    # rliable takes runs x tasks x evaluations.
    points, intervals = library.get_interval_estimates(
        {"a": smoothed[:, None, :]}, by_step, reps=20_000, random_state=numpy.random.RandomState(0)
    )
    expected[name] = {"iqm": points["a"].tolist(), "interval": intervals["a"].T.tolist()}

names = list(ENCODERS)
final = [expected[f"{name}, keypoints+robot"]["iqm"][-1] for name in names]
limits = list(THRESHOLDS.values())
tracked = [sum(numpy.array(ENCODERS[name][2]) <= limits) / 3 for name in names]
rho = {"TC": scipy.stats.spearmanr(tracked, final).statistic}
for k, name in enumerate(THRESHOLDS):
    errors = [ENCODERS[encoder][2][k] for encoder in names]
    rho[name] = scipy.stats.spearmanr(errors, final).statistic

fixture = {
    "made_with": {"numpy": numpy.__version__, "scipy": scipy.__version__, "rliable": "1.2.0"},
    "runs": runs,
    "groups": expected,
    "rho": {name: float(value) for name, value in rho.items()},
}
Path(__file__).with_name("agents.json").write_text(json.dumps(fixture) + "\n")
