"""Writes stats.json: statistics over runs by numpy, SciPy and rliable.

    pip install numpy==2.3.5 pandas==2.3.3 scipy==1.16.3 rliable==1.2.0
    python3 make_stats.py
"""

import json
from pathlib import Path

import numpy
import scipy
from rliable import library, metrics
from scipy.ndimage import gaussian_filter1d

rng = numpy.random.default_rng(7)


def window(values):
    low, high = numpy.quantile(values, [0.25, 0.75])
    inside = values[(low <= values) & (values <= high)]
    return inside.mean() if len(inside) else (low + high) / 2


samples = [rng.lognormal(-4, 1, count).round(5) for count in (1, 2, 3, 4, 5, 7, 24, 101)]
samples.append(numpy.array([0.01, 0.01, 0.01, 0.5, 0.01]))
cases = []
for values in samples:
    cases.append(
        {
            "values": values.tolist(),
            "mean": values.mean(),
            "variance": values.var(ddof=1) if len(values) > 1 else None,
            "quartiles": numpy.quantile(values, [0, 0.25, 0.5, 0.75, 1]).tolist(),
            "trimmed_mean": float(scipy.stats.trim_mean(values, 0.25)),
            "quantile_window_mean": float(window(values)),
            "profile": [float((values <= tau).mean()) for tau in (0.005, 0.01, 0.015, 0.1)],
        }
    )

a, b = rng.lognormal(-4, 1, 24).round(3), rng.lognormal(-3.6, 1, 20).round(3)
# rliable counts how often a score of the first is higher; an error is better when it is lower.
improvement = float(metrics.probability_of_improvement(-a[:, None], -b[:, None]))

strata = rng.lognormal(0, 0.3, (6, 2)).round(4)
resamples = 200
draws = rng.integers(0, 6, (resamples, 2, 6))
replicates = [
    scipy.stats.trim_mean(numpy.concatenate([strata[draw[k], k] for k in range(2)]), 0.25) for draw in draws
]

scores = rng.lognormal(-4, 0.8, (24, 3)).round(5)
_, intervals = library.get_interval_estimates(
    {"a": scores},
    lambda x: numpy.array([metrics.aggregate_iqm(x)]),
    reps=50_000,
    random_state=numpy.random.RandomState(0),
)

curve = rng.normal(size=37).cumsum().round(4)
# Drawn last, so that what is above stays as it was.
ordered = rng.normal(size=9).round(2)
pairs = [
    (ordered, (ordered + rng.normal(size=9)).round(2)),
    (numpy.array([0, 1 / 3, 1 / 3, 2 / 3, 1]), numpy.array([0.1, 0.0, 0.4, 0.4, 0.9])),
    (numpy.array([0.2, 0.1]), numpy.array([1.0, 3.0])),
]
fixture = {
    "made_with": {"numpy": numpy.__version__, "scipy": scipy.__version__, "rliable": "1.2.0"},
    "samples": cases,
    "improvement": {"a": a.tolist(), "b": b.tolist(), "probability": improvement},
    "bootstrap": {
        "strata": strata.T.tolist(),
        "resamples": resamples,
        "draws": draws.ravel().tolist(),
        "interval": numpy.quantile(replicates, [0.025, 0.975]).tolist(),
    },
    "rliable": {"strata": scores.T.tolist(), "interval": intervals["a"].ravel().tolist()},
    "rank_correlation": [
        {"a": a.tolist(), "b": b.tolist(), "rho": float(scipy.stats.spearmanr(a, b).statistic)} for a, b in pairs
    ],
    "smooth": [
        {"values": values.tolist(), "sigma": sigma, "smoothed": gaussian_filter1d(values, sigma).tolist()}
        for values, sigma in ((curve, 2.5), (curve[:3], 2.5), (curve[:1], 2.5), (curve, 0.4))
    ],
}
Path(__file__).with_name("stats.json").write_text(json.dumps(fixture) + "\n")
