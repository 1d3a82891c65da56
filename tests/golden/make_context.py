"""Writes context.json: linear regression with PCK by scikit-learn, min-cost assignment by SciPy.

    pip install numpy==2.3.5 scipy==1.16.3 scikit-learn==1.7.2
    python3 make_context.py
"""

import json
from pathlib import Path

import numpy
from scipy.optimize import linear_sum_assignment
from sklearn.linear_model import LinearRegression

rng = numpy.random.default_rng(11)
CLOSE = [0.02, 6 / 128, 0.1]
SIDE = 2.0


def regression(keypoints, truth, folds):
    """Per object: frames, mean squared distance, PCK. Without folds fitted and predicted on the same frames."""
    out = []
    for k in range(truth.shape[1]):
        visible = ~numpy.isnan(truth[:, k, 0])
        z, x = keypoints[visible].reshape(visible.sum(), -1), truth[visible, k]
        predicted = numpy.zeros_like(x)
        if folds is None:
            predicted = LinearRegression().fit(z, x).predict(z)
        else:
            of = numpy.array(folds)[visible]
            for fold in numpy.unique(of):
                model = LinearRegression().fit(z[of != fold], x[of != fold])
                predicted[of == fold] = model.predict(z[of == fold])
        distance = numpy.linalg.norm(predicted - x, axis=1)
        out.append(
            {
                "frames": int(visible.sum()),
                "error": float((distance**2).mean()),
                "close": [float((distance <= share * SIDE).mean()) for share in CLOSE],
            }
        )
    return out


def assignment(keypoints, truth, trajectories):
    predicted = actual = 0
    matched = numpy.zeros(len(CLOSE))
    for start, end in trajectories:
        costs = []
        for k in range(truth.shape[1]):
            x = truth[start:end, k]
            visible = ~numpy.isnan(x[:, 0])
            if visible.any():
                distance = numpy.linalg.norm(keypoints[start:end][visible] - x[visible, None], axis=2)
                costs.append(distance.mean(axis=0))
        predicted += keypoints.shape[1]
        actual += len(costs)
        if costs:
            costs = numpy.array(costs)
            pairs = linear_sum_assignment(costs)
            matched += [(costs[pairs] <= share * SIDE).sum() for share in CLOSE]
    return {
        "keypoints": predicted,
        "objects": actual,
        "precision": (matched / predicted).tolist(),
        "recall": (matched / actual).tolist(),
    }


def case(name, sequences, length, keypoints, objects, constant=False):
    frames = sequences * length
    x = rng.uniform(-0.9, 0.9, (frames, objects, 2))
    z = rng.uniform(-1, 1, (frames, keypoints, 2))
    # Some keypoints are near an object, so that some are matched at every distance.
    for n in range(min(keypoints, objects)):
        z[:, n] = x[:, (n + 1) % objects] + rng.normal(0, [0.02, 0.08, 0.2][n % 3], (frames, 2))
    if constant:
        z[:, -1] = 0.25
        z[:, -2] = z[:, 0]
    x[rng.random((frames, objects)) < 0.1] = numpy.nan
    # An object that a whole sequence does not show.
    x[:length, 0] = numpy.nan
    z, x = z.round(4), x.round(4)
    of = [(7 * (t // length)) % 3 for t in range(frames)]
    return {
        "name": name,
        "shape": [frames, keypoints, objects],
        "length": length,
        "keypoints": z.ravel().tolist(),
        "truth": [None if numpy.isnan(v) else v for v in x.ravel().tolist()],
        "folds": of,
        "regression": regression(z, x, None),
        "held_out": regression(z, x, of),
        "frames": assignment(z, x, [(t, t + 1) for t in range(frames)]),
        "sequences": assignment(z, x, [(t, t + length) for t in range(0, frames, length)]),
    }


fixture = {
    "close": CLOSE,
    "cases": [
        case("more keypoints than objects", 6, 12, 5, 3),
        case("more objects than keypoints", 6, 10, 2, 4),
        case("a keypoint at rest and one twice", 6, 12, 5, 2, constant=True),
    ],
}
Path(__file__).with_name("context.json").write_text(json.dumps(fixture) + "\n")
