"""Time of the same affine tracking errors in numpy: centred second moments, vectorised over all N x K pairs.

Prints one line of JSON, the median of 101 runs on one thread; `--check` compares with numpy.linalg.lstsq.
"""

import json
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

T, N, K = 2500, 32, 3


def affine_errors(z, x):
    """K x N mean squared distances left by the best affine maps; z is T x N x 2, x is T x K x 2."""
    t = z.shape[0]
    zc = z - z.mean(axis=0)
    xc = x - x.mean(axis=0)
    own = np.einsum("tni,tnj->nij", zc, zc)
    cross = (zc.reshape(t, -1).T @ xc.reshape(t, -1)).reshape(N, 2, K, 2).transpose(0, 2, 1, 3)
    maps = np.linalg.solve(own[:, None], cross)
    total = np.einsum("tki,tki->k", xc, xc)
    explained = np.einsum("nkij,nkij->nk", maps, cross)
    return ((total[None] - explained) / t).T


def main():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (T, K, 2))
    z = 0.5 * x[:, np.arange(N) % K] + 0.1 * rng.uniform(-1, 1, (T, N, 2))
    if "--check" in sys.argv:
        errors = affine_errors(z, x)
        for n in range(N):
            design = np.concatenate([z[:, n], np.ones((T, 1))], axis=1)
            for k in range(K):
                solved = np.linalg.lstsq(design, x[:, k], rcond=None)[0]
                left = ((design @ solved - x[:, k]) ** 2).sum(axis=1).mean()
                assert abs(left - errors[k, n]) < 1e-10
    times = []
    for _ in range(101):
        start = time.perf_counter()
        affine_errors(z, x)
        times.append((time.perf_counter() - start) * 1e3)
    print(json.dumps({"name": "metric_t2500_n32_k3", "median_ms": round(sorted(times)[50], 4)}))


if __name__ == "__main__":
    main()
