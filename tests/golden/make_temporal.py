"""Writes temporal.json: the measures over time of the best keypoints, by numpy and SciPy.

    pip install numpy==2.3.5 scipy==1.16.3
    python3 make_temporal.py

TAP-Vid's measures follow the definitions of Doersch et al. (2022), with all frames as frames that
are evaluated, since nothing is queried.
"""

import json
from pathlib import Path

import numpy
from scipy.optimize import least_squares

rng = numpy.random.default_rng(5)
CLOSE = [0.02, 6 / 128, 0.1]
SIDE = 2.0
SIGMA = 0.05
STRETCH = 10
LAGS = 10


def there(*points):
    return numpy.all([~numpy.isnan(p).any(-1) for p in points], axis=0)


def affine(z, x):
    """A and b of the best affine map, as one 3 x 2 matrix."""
    return numpy.linalg.lstsq(numpy.column_stack([z, numpy.ones(len(z))]), x, rcond=None)[0]


def under(matrix, z):
    return numpy.column_stack([z, numpy.ones(len(z))]) @ matrix


def jitter(x, z, sequences):
    bends = []
    for s in sequences:
        off = z[s] - x[s]
        bends.append(off[2:] - 2 * off[1:-1] + off[:-2])
    return float(numpy.nanmean(numpy.linalg.norm(numpy.concatenate(bends), axis=1)))


def correlation(x, z, sequences, lag):
    v, w = [], []
    for s in sequences:
        a, b = numpy.diff(x[s], axis=0), numpy.diff(z[s], axis=0)
        if lag >= 0:
            v.append(a[: len(a) - lag]), w.append(b[lag:])
        else:
            v.append(a[-lag:]), w.append(b[:lag])
    v, w = numpy.concatenate(v), numpy.concatenate(w)
    both = there(v, w)
    v, w = v[both].ravel(), w[both].ravel()
    return float(v @ w / (numpy.linalg.norm(v) * numpy.linalg.norm(w)))


def handed_over(squared, best, threshold, sequences):
    """`squared` is T x N."""
    seen = taken = 0
    for s in sequences:
        count = max((s.stop - s.start) // STRETCH, 1)
        for i in range(count):
            start = s.start + i * STRETCH
            stretch = slice(start, s.stop if i + 1 == count else start + STRETCH)
            part = squared[stretch]
            means = [numpy.nanmean(c) if (~numpy.isnan(c)).any() else numpy.inf for c in part.T]
            if not numpy.isfinite(means).any():
                continue
            seen += len(part)
            lost = not means[best] <= threshold
            others = any(m <= threshold for n, m in enumerate(means) if n != best)
            taken += len(part) * (lost and others)
    return taken / seen


def held_out(points, x, n, seconds, sequences):
    """Of maps fitted on one sequence and scored on the other."""
    sums, count = numpy.zeros(3), 0
    used = there(x, points[:, n], *(points[:, m] for m in seconds))
    for fold, scored in enumerate(sequences):
        fitted = numpy.concatenate([numpy.arange(s.start, s.stop) for i, s in enumerate(sequences) if i != fold])
        scored = numpy.arange(scored.start, scored.stop)
        fitted, scored = fitted[used[fitted]], scored[used[scored]]
        z = points[:, n]
        straight = affine(z[fitted], x[fitted])
        sums[0] += ((under(straight, z[scored]) - x[scored]) ** 2).sum()
        tries = []
        for m in seconds:
            u = points[:, m] - z
            u /= numpy.linalg.norm(u, axis=1, keepdims=True)
            inputs = numpy.column_stack([z, u])
            matrix = affine(inputs[fitted], x[fitted])
            left = lambda frames: ((under(matrix, inputs[frames]) - x[frames]) ** 2).sum()
            tries.append((left(fitted), left(scored)))
        sums[1] += min(tries)[1]

        def projective(p, frames):
            zx, zy = (z[frames] - z[fitted].mean(0)).T
            below = 1 + p[6] * zx + p[7] * zy
            return numpy.column_stack([p[0] * zx + p[1] * zy + p[2], p[3] * zx + p[4] * zy + p[5]]) / below[:, None]

        centre = under(straight, z[fitted].mean(0)[None])[0]
        start = [straight[0, 0], straight[1, 0], centre[0], straight[0, 1], straight[1, 1], centre[1], 0, 0]
        fit = least_squares(lambda p: (projective(p, fitted) - x[fitted]).ravel(), start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        sums[2] += ((projective(fit.x, scored) - x[scored]) ** 2).sum()
        count += len(scored)
    return dict(zip(["affine", "orientation", "projective"], (sums / count).tolist()))


def tap_vid(x, z):
    """Of any number of tracks, in pixels of an image of 256 x 256."""
    x, z = (x.reshape(-1, 2) * 128, z.reshape(-1, 2) * 128)
    visible, predicted = there(x), there(z)
    jaccard, accuracy = [], []
    for pixels in [1, 2, 4, 8, 16]:
        within = numpy.linalg.norm(x - z, axis=1) < pixels
        accuracy.append((within & visible).sum() / visible.sum())
        true_positives = (within & visible & predicted).sum()
        false_positives = (predicted & ~(visible & within)).sum()
        jaccard.append(true_positives / (visible.sum() + false_positives))
    return {
        "occlusion_accuracy": float((visible == predicted).mean()),
        "position_accuracy": float(numpy.mean(accuracy)),
        "average_jaccard": float(numpy.mean(jaccard)),
    }


def oks(x, z):
    similarity = numpy.full(x.shape[:2], numpy.nan)
    for t in range(len(x)):
        seen = there(x[t])
        if seen.sum() < 2:
            continue
        area = numpy.prod(x[t, seen].max(0) - x[t, seen].min(0))
        if area > 0:
            squared = ((z[t] - x[t]) ** 2).sum(-1)
            value = numpy.nan_to_num(numpy.exp(-squared / (2 * area * (2 * SIGMA) ** 2)))
            similarity[t] = numpy.where(seen, value, numpy.nan)
    counted = ~numpy.isnan(similarity).all(1)
    return numpy.nanmean(similarity, 0), float(numpy.nanmean(similarity[counted], 1).mean())


def case(name, points, truth, length, threshold):
    sequences = [slice(s, s + length) for s in range(0, len(truth), length)]
    objects, mapped = [], numpy.full_like(truth, numpy.nan)
    for k in range(truth.shape[1]):
        x = truth[:, k]
        every = numpy.full(points.shape, numpy.nan)
        errors = []
        for n in range(points.shape[1]):
            used = there(x, points[:, n])
            every[:, n] = under(affine(points[used, n], x[used]), points[:, n])
            errors.append(((every[used, n] - x[used]) ** 2).sum(1).mean())
        best = int(numpy.argmin(errors))
        z = mapped[:, k] = every[:, best]
        order = [n for n in numpy.argsort(errors) if n != best]
        lags = {lag: correlation(x, z, sequences, lag) for lag in range(-LAGS, LAGS + 1)}
        visible = there(x)
        distance = numpy.linalg.norm(z - x, axis=1)[visible]
        objects.append(
            {
                "keypoint": best,
                "jitter": jitter(x, z, sequences),
                "velocity_correlation": lags[0],
                "lag": max(sorted(lags, key=abs), key=lags.get),
                "handed_over": handed_over(((every - x[:, None]) ** 2).sum(-1), best, threshold, sequences),
                "held_out": held_out(points, x, best, order, sequences),
                "tap_vid": tap_vid(x, z),
                "pck": [float((distance <= share * SIDE).mean()) for share in CLOSE],
            }
        )
    of_objects, together = oks(truth, mapped)
    for k, value in enumerate(of_objects):
        objects[k]["oks"] = float(value)
    of_sequences = [tap_vid(truth[s], mapped[s]) for s in sequences]
    return {
        "name": name,
        "shape": [len(truth), points.shape[1], truth.shape[1]],
        "length": length,
        "threshold": threshold,
        "keypoints": [None if numpy.isnan(v) else v for v in points.ravel().tolist()],
        "truth": [None if numpy.isnan(v) else v for v in truth.ravel().tolist()],
        "objects": objects,
        "tap_vid": {key: float(numpy.mean([of[key] for of in of_sequences])) for key in of_sequences[0]},
        "oks": together,
    }


def scene(frames, noise, late=0, perspective=0.0, missing=0.0):
    """Two objects on smooth paths; two keypoints follow them, one is carried around the first, one is alone."""
    t = numpy.arange(2 * frames + 40)
    path = lambda a, b, c: numpy.stack([0.5 * numpy.sin(a * t + c), 0.4 * numpy.cos(b * t)], -1)
    first, second, alone = path(0.13, 0.21, 0), path(0.17, 0.11, 1), path(0.07, 0.19, 2)
    turn = 0.09 * t
    side = 0.1 * numpy.stack([numpy.cos(turn), numpy.sin(turn)], -1)
    keypoints = numpy.stack([first + side, first - side, numpy.roll(second, late, 0), alone], 1)
    keypoints = keypoints / (1 + perspective * keypoints[..., :1])
    truth = numpy.stack([first, second], 1)
    used = numpy.r_[20 : 20 + frames, 20 + frames : 20 + 2 * frames]
    keypoints, truth = keypoints[used], truth[used]
    keypoints = keypoints + rng.normal(0, noise, keypoints.shape)
    for points in [keypoints, truth]:
        points[rng.random(points.shape[:2]) < missing] = numpy.nan
    return keypoints.round(6), truth.round(6)


cases = [
    case("smooth", *scene(60, 0.004), 60, 0.002),
    case("late", *scene(60, 0.003, late=3), 60, 0.001),
    case("perspective, gaps", *scene(75, 0.01, perspective=0.5, missing=0.06), 75, 0.003),
    case("noise", *scene(47, 0.08, missing=0.02), 47, 0.004),
]
out = Path(__file__).parent / "temporal.json"
out.write_text(json.dumps({"close": CLOSE, "cases": cases}) + "\n")
