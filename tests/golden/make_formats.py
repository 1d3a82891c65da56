"""Writes the recordings in ../data/formats: the frames of ../data/panda_push at 16 x 16 px, as numpy and h5py store them.

Run with numpy 2.4.6, h5py 3.16.0 and pillow 13.0.0: python make_formats.py
"""

import csv
import pathlib

import h5py
import numpy as np
from PIL import Image

here = pathlib.Path(__file__).parent
source = here / "../data/panda_push"
out = here / "../data/formats"
out.mkdir(exist_ok=True)

folders = ["seq_0000", "seq_0001", "seq_0012"]
frames = np.empty([3, 5, 16, 16, 3], np.float32)
points = np.full([3, 5, 3, 2], np.nan)
for s, folder in enumerate(folders):
    for t in range(5):
        image = np.asarray(Image.open(source / folder / f"frame_{t:03}.png").convert("RGB"), np.float64) / 255
        # The mean of 16 x 16 blocks: floats that 8 bits do not hold.
        frames[s, t] = image.reshape(16, 16, 16, 16, 3).mean(axis=(1, 3))
objects = ["cube", "target", "eef"]
for row in csv.DictReader(open(source / "ground_truth.csv")):
    # The folders are sequences 0, 1 and 12 of a larger recording.
    for s, folder in enumerate(folders):
        if row["sequence"] in (folder, folder.removeprefix("seq_").lstrip("0") or "0") and int(row["frame"]) < 5:
            points[s, int(row["frame"]), objects.index(row["object"])] = float(row["x"]), float(row["y"])
assert np.isfinite(points).all()
# The authors record five sites; links 4 and 5 are made up here.
cube, target, eef = (points[:, :, k] for k in range(3))
sites = np.stack([cube, target, 0.5 * eef, 0.8 * eef, eef], axis=2).astype(np.float32)
integer = (frames * 255).astype(np.uint8)  # as record.py

frames.tofile(out / "frames.f32")
sites.tofile(out / "sites.f32")


def record(name, frames, sites, libver, integer, channels_first, y_first):
    """As the authors' record.py, with its attributes."""
    with h5py.File(out / name, "w", libver=libver) as file:
        file.create_dataset("images", data=frames, compression="gzip", compression_opts=9)
        file.create_dataset("keypoints", data=sites, compression="gzip", compression_opts=9)
        file.attrs["environment/id"] = "PandaPush-custom"
        file.attrs["environment/keypoints/objects"] = ["object", "target"]
        file.attrs["environment/keypoints/links"] = [4, 5, 11]
        file.attrs["save/format/integer"] = integer
        file.attrs["save/format/channels_first"] = channels_first
        file.attrs["save/format/y_first"] = y_first


record("record.hdf5", frames, sites, "earliest", False, False, False)
record("options.hdf5", np.moveaxis(integer, -1, -3), sites[..., ::-1], "latest", True, True, True)
with h5py.File(out / "plain.hdf5", "w") as file:
    file.create_dataset("frames", data=frames[0].astype(">f4"))
    file.create_dataset("sites", data=sites[0].astype(">f8"))
    file.create_dataset("names", data=["a", "b", "c", "d", "é"])
with h5py.File(out / "lzf.hdf5", "w") as file:
    file.create_dataset("images", data=integer[:1], compression="lzf")

np.savez(out / "frames.npz", frames=integer, sites=sites)
np.savez_compressed(
    out / "packed.npz",
    images=np.moveaxis(frames[0], -1, -3).astype(np.float64),
    keypoints=sites[0].astype(">f8"),
    names=np.array(["a", "b", "c", "d", "é"]),
)
np.savez(out / "points.npz", sites=sites, names=np.array(["cube", "target", "link_4", "link_5", "eef"]))
