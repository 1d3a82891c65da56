"""Writes numpy_split.json: orders of numpy's legacy generator, as the authors' loading.py draws them.

Run with numpy 2.4.6 (any version gives the same: the legacy generator is frozen): python make_split.py
"""

import json
import pathlib

import numpy as np

cases = [(n, seed) for n in (2, 3, 10, 100) for seed in (0, 1, 42, 2**32 - 1)]
cases += [(1000, 0), (1000, 2**32 - 1), (1001, 0), (1024, 7), (1025, 7)]
lines = []
for n, seed in cases:
    np.random.seed(seed)
    order = np.random.choice(n, n, replace=False).tolist()
    lines.append(json.dumps({"count": n, "seed": seed, "order": order}, separators=(",", ":")))
pathlib.Path(__file__).with_name("numpy_split.json").write_text("[\n" + ",\n".join(lines) + "\n]\n")
