"""Time of extraction in PyTorch eager, with the layers of `train_step_torch.py`.

`extract_torch.py [--threads N]` prints a line of JSON for every encoder and size: the median of 15 frames after two that
are not counted, one frame at a time on N threads.
"""

import argparse
import json
import statistics
import time

import torch
from torch import nn
from train_step_torch import SpatialSoftArgmax, basic_encoder, keynet_encoder


def dsae_encoder(points):
    def layer(inputs, outputs, kernel, stride=1):
        conv = nn.Conv2d(inputs, outputs, kernel, stride, bias=False)
        return conv, nn.BatchNorm2d(outputs), nn.ReLU()

    return nn.Sequential(*layer(3, 64, 7, 2), *layer(64, 32, 5), *layer(32, points, 5))


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--threads", type=int, default=1)
    arguments = arguments.parse_args()
    torch.set_num_threads(arguments.threads)
    for name, encoder in (("basic", basic_encoder(16)), ("keynet", keynet_encoder(30)), ("dsae", dsae_encoder(16))):
        model = nn.Sequential(encoder, SpatialSoftArgmax()).eval()
        for side in (128, 256):
            image = torch.rand(1, 3, side, side)
            times = []
            with torch.inference_mode():
                for _ in range(17):
                    start = time.perf_counter()
                    model(image)
                    times.append(time.perf_counter() - start)
            print(json.dumps({"name": f"{name} {side}", "median_ms": statistics.median(times[2:]) * 1e3}))


if __name__ == "__main__":
    main()
