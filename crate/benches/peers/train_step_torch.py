"""Time of the same training step in PyTorch eager: forward, backward and Adam on 8 snippets of 3 frames.

`train_step_torch.py --json NAME [--threads N] [--steps N]` prints one line of JSON, the median after two steps that
are not counted.
"""

import argparse
import json
import time

import torch
from torch import nn

SNIPPETS, FRAMES, INPUT, TARGET = 8, 3, 128, 64
SIGMA = 0.1
VELOCITY_WEIGHT = 0.1


def conv_norm(inputs, outputs, kernel=3, stride=1):
    """Convolution without bias, batch norm, ReLU."""
    conv = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(outputs), nn.ReLU())


def grid(n):
    return torch.linspace(-1, 1, n)


class SpatialSoftArgmax(nn.Module):
    def forward(self, maps):
        batch, points, height, width = maps.shape
        attention = maps.flatten(2).softmax(2).view(batch, points, height, width)
        y = (attention.sum(3) * grid(height)).sum(2)
        x = (attention.sum(2) * grid(width)).sum(2)
        return torch.stack((y, x), 2)


class GaussianMaps(nn.Module):
    def __init__(self, size, trained):
        super().__init__()
        self.size = size
        self.std = nn.Parameter(torch.tensor([SIGMA])) if trained else SIGMA

    def forward(self, latent):
        y, x = ((grid(self.size) - latent[..., i, None]) ** 2 for i in (0, 1))
        return torch.exp(-(y[..., :, None] + x[..., None, :]) / self.std**2)


def basic_encoder(points):
    def block(inputs, outputs):
        return (
            *conv_norm(inputs, outputs),
            nn.Conv2d(outputs, outputs, 3, padding=1, bias=False),
            nn.MaxPool2d(2, 2, 1),
            nn.BatchNorm2d(outputs),
            nn.ReLU(),
        )

    return nn.Sequential(*block(3, 32), *block(32, 64), *block(64, 128), nn.Conv2d(128, points, 1))


def basic_decoder(points, trained):
    return nn.Sequential(
        GaussianMaps(TARGET, trained),
        conv_norm(points, 64),
        conv_norm(64, 32),
        conv_norm(32, 16),
        nn.Conv2d(16, 3, 1),
    )


def keynet_encoder(points):
    layers = [conv_norm(3, 32, kernel=7), conv_norm(32, 32)]
    for inputs, outputs in ((32, 64), (64, 128), (128, 256)):
        layers += [conv_norm(inputs, outputs, stride=2), conv_norm(outputs, outputs)]
    return nn.Sequential(*layers, nn.Conv2d(256, points, 1))


def keynet_decoder(points, trained):
    def upsample():
        return nn.Upsample(scale_factor=2, mode="bilinear", align_corners=False)

    return nn.Sequential(
        GaussianMaps(TARGET // 4, trained),
        conv_norm(points, 256),
        conv_norm(256, 256),
        upsample(),
        conv_norm(256, 128),
        conv_norm(128, 128),
        upsample(),
        conv_norm(128, 64),
        conv_norm(64, 64),
        nn.Conv2d(64, 3, 1),
    )


FAMILIES = {"basic": (basic_encoder, basic_decoder, 16), "keynet": (keynet_encoder, keynet_decoder, 30)}


class Autoencoder(nn.Module):
    def __init__(self, name):
        super().__init__()
        family, *extensions = name.split("-")
        encoder, decoder, points = FAMILIES[family]
        self.encoder = nn.Sequential(encoder(points), SpatialSoftArgmax())
        self.decoder = decoder(points, "std" in extensions)
        self.background = nn.Parameter(torch.zeros(3, TARGET, TARGET)) if "bg" in extensions else 0.0
        self.velocity = "vel" in extensions

    def loss(self, images, targets):
        latent = self.encoder(images)
        loss = nn.functional.mse_loss(self.decoder(latent) + self.background, targets)
        if self.velocity:
            points = latent.view(SNIPPETS, FRAMES, -1)
            change = points[:, 2] - 2 * points[:, 1] + points[:, 0]
            loss = loss + VELOCITY_WEIGHT * change.square().mean()
        return loss


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--json", required=True, metavar="NAME")
    arguments.add_argument("--threads", type=int)
    arguments.add_argument("--steps", type=int, default=7)
    arguments = arguments.parse_args()
    if arguments.threads:
        torch.set_num_threads(arguments.threads)
    torch.manual_seed(0)
    model = Autoencoder(arguments.json)
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-3)
    images = torch.rand(SNIPPETS * FRAMES, 3, INPUT, INPUT)
    targets = torch.rand(SNIPPETS * FRAMES, 3, TARGET, TARGET)
    times = []
    for step in range(arguments.steps + 2):
        start = time.perf_counter()
        optimizer.zero_grad()
        loss = model.loss(images, targets)
        loss.backward()
        optimizer.step()
        loss.item()
        if step >= 2:
            times.append((time.perf_counter() - start) * 1e3)
    median = sorted(times)[len(times) // 2]
    print(json.dumps({"name": f"train_step_{arguments.json}", "median_ms": round(median, 2)}))


if __name__ == "__main__":
    main()
