"""Writes space.json: errors of points in space, by numpy alone.

    pip install numpy==2.2.6
    python3 make_space.py

For keypoints and objects of two and three coordinates: the error of every pair under the best
affine map, by `lstsq` over the frames that show both; the same with one sequence held out after the
other; and positions in the image of a camera, by the formulas of OpenCV's documentation.
"""

import json
from pathlib import Path

import numpy

rng = numpy.random.default_rng(16)
T, N, K, LENGTH = 90, 4, 2, 30


def seen(z, x):
    return ~numpy.isnan(z).any(1) & ~numpy.isnan(x).any(1)


def design(z):
    return numpy.column_stack([z, numpy.ones(len(z))])


def fit(z, x):
    return numpy.linalg.lstsq(design(z), x, rcond=None)[0]


def errors(keypoints, truth):
    """K x N"""
    out = numpy.empty((K, N))
    for k in range(K):
        for n in range(N):
            both = seen(keypoints[:, n], truth[:, k])
            z, x = keypoints[both, n], truth[both, k]
            out[k, n] = ((design(z) @ fit(z, x) - x) ** 2).sum(1).mean()
    return out


def held_out(keypoints, truth):
    """The error of every object; each sequence under the best map of the others."""
    fold = numpy.arange(T) // LENGTH
    out = []
    for k in range(K):
        left, frames = 0.0, 0
        for f in range(T // LENGTH):
            best = None
            for n in range(N):
                both = seen(keypoints[:, n], truth[:, k]) & (fold != f)
                z, x = keypoints[both, n], truth[both, k]
                matrix = fit(z, x)
                error = ((design(z) @ matrix - x) ** 2).sum(1).mean()
                if best is None or error < best[0]:
                    best = (error, n, matrix)
            _, n, matrix = best
            both = seen(keypoints[:, n], truth[:, k]) & (fold == f)
            z, x = keypoints[both, n], truth[both, k]
            left += ((design(z) @ matrix - x) ** 2).sum()
            frames += both.sum()
        out.append(left / frames)
    return out


def case(z_axes, x_axes, unit):
    t = numpy.arange(T)[:, None, None]
    phase = rng.uniform(0, 6, (1, K, x_axes))
    speed = rng.uniform(0.2, 1.9, (1, K, x_axes))
    truth = numpy.sin(speed * t + phase) * unit + rng.uniform(-3, 3, (1, K, x_axes)) * unit
    keypoints = rng.normal(size=(T, N, z_axes))
    for k in range(K):
        matrix = rng.normal(size=(x_axes, z_axes)) / unit
        keypoints[:, k] = truth[:, k] @ matrix + rng.normal(scale=0.05, size=(T, z_axes))
    keypoints += rng.uniform(-1, 1, (1, N, z_axes))
    truth[rng.random((T, K)) < 0.1] = numpy.nan
    keypoints[rng.random((T, N)) < 0.05] = numpy.nan
    return {
        "keypoints": keypoints,
        "truth": truth,
        "errors": errors(keypoints, truth),
        "held_out": held_out(keypoints, truth),
    }


def rotation(axis, angle):
    axis = numpy.array(axis) / numpy.linalg.norm(axis)
    cross = numpy.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return numpy.eye(3) + numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross


def camera():
    width, height = 640, 480
    k1, k2, p1, p2, k3 = distortion = [-0.2, 0.05, 0.001, -0.002, 0.01]
    intrinsics = numpy.array([[520.0, 0.5, 319.5], [0, 515.0, 239.5], [0, 0, 1]])
    turn, shift = rotation([1, 2, -1], 0.7), numpy.array([0.1, -0.2, 3.0])
    world = rng.uniform(-1, 1, (25, 3))
    x, y, z = (world @ turn.T + shift).T
    x, y = x / z, y / z
    r = x**2 + y**2
    radial = 1 + k1 * r + k2 * r**2 + k3 * r**3
    u = x * radial + 2 * p1 * x * y + p2 * (r + 2 * x**2)
    v = y * radial + p1 * (r + 2 * y**2) + 2 * p2 * x * y
    px = intrinsics @ numpy.stack([u, v, numpy.ones_like(u)])
    ndc = (2 * px[:2].T + 1) / [width, height] - 1
    file = {
        "image_size": [width, height],
        "intrinsics": intrinsics,
        "rotation": turn,
        "translation": shift,
        "distortion": distortion,
    }
    return {"file": file, "world": world, "ndc": ndc}


def plain(value):
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, numpy.ndarray)):
        return [plain(item) for item in value]
    value = float(value) if isinstance(value, numpy.floating) else value
    return None if isinstance(value, float) and numpy.isnan(value) else value


cases = [case(3, 3, 1.0), case(2, 3, 0.4), case(3, 2, 1.0), case(3, 3, 250.0)]
text = json.dumps(plain({"length": LENGTH, "cases": cases, "camera": camera()}))
Path(__file__).with_name("space.json").write_text(text + "\n")
