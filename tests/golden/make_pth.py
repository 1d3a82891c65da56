"""Makes basic-vel-std-bg-tiny.pth, a checkpoint in the layout of the authors' training code, from the weights of
basic-vel-std-bg-tiny.safetensors:

    python3 -m pip install omegaconf==2.3.0 numpy safetensors
    python3 make_pth.py

It imitates torch.save (of PyTorch 2) down to the order and alignment of the archive's entries, so that no PyTorch has
to be installed; the configuration is a real OmegaConf container with the authors' values. torch.load of PyTorch 2.15 takes
the file, and what torch.save makes of that is read the same.
"""

import collections
import io
import json
import pickle
import struct
import sys
import types
import zipfile
from pathlib import Path

import numpy
from omegaconf import OmegaConf
from safetensors.numpy import load_file

FOLDER = Path(__file__).resolve().parent
NAME = "basic-vel-std-bg-tiny"

CFG = {
    "experiment": "sae-basic-vel-var-bg",
    "gpu": True,
    "training": {
        "epochs": 500,
        "batch_size": 32,
        "learning_rate": 0.001,
        "loss_weights": {"reconstruction": 1.0, "velocity": 0.1},
        "noise_std": 0.001,
    },
    "model": {
        "encoder": {
            "id": "basic",
            "class_name": "EncoderBasic",
            "settings": {
                "n_coordinates": 4,
                "out_channels": [4, 6, 8],
                "kernel_sizes": [3, 3, 3],
                "batch_norm": True,
                "softmax_temperature": 1.0,
                "train_softmax_temperature": False,
            },
        },
        "decoder": {
            "id": "basic",
            "class_name": "DecoderBasic",
            "settings": {
                "gaussian_std": 0.1,
                "train_gaussian_std": True,
                "share_gaussian_std": True,
                "limit_gaussian_std": None,
                "out_channels": [8, 6, 4],
                "kernel_sizes": [3, 3, 3],
                "batch_norm": True,
                "background_bias": True,
            },
        },
    },
    "dataset": {
        "id": "panda_push_custom",
        "target_shape": [3, 16, 16],
        "split": [500, 250, 250],
        "snippet_length": 3,
        "seed": 0,
    },
}


def fake_torch():
    """The names of torch that a pickled tensor refers to."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    for name in ("FloatStorage", "LongStorage"):
        setattr(torch, name, type(name, (), {"__module__": "torch"}))

    def _rebuild_tensor_v2():
        raise NotImplementedError

    _rebuild_tensor_v2.__module__ = "torch._utils"
    _rebuild_tensor_v2.__qualname__ = "_rebuild_tensor_v2"
    utils._rebuild_tensor_v2 = _rebuild_tensor_v2
    sys.modules.update({"torch": torch, "torch._utils": utils})
    return torch, utils


TORCH, UTILS = fake_torch()


class Storage:
    def __init__(self, array):
        self.array = array


class Tensor:
    def __init__(self, array):
        self.array = numpy.asarray(array, order="C")

    def __reduce__(self):
        strides = tuple(s // self.array.itemsize for s in self.array.strides)
        arguments = (Storage(self.array), 0, self.array.shape, strides, False, collections.OrderedDict())
        return UTILS._rebuild_tensor_v2, arguments


class Pickler(pickle.Pickler):
    def __init__(self, file):
        super().__init__(file, protocol=2)
        self.storages = []

    def persistent_id(self, value):
        if not isinstance(value, Storage):
            return None
        self.storages.append(value.array)
        kind = TORCH.FloatStorage if value.array.dtype == numpy.float32 else TORCH.LongStorage
        return "storage", kind, str(len(self.storages) - 1), "cpu", value.array.size


def save(value, path):
    pickled = io.BytesIO()
    pickler = Pickler(pickled)
    pickler.dump(value)
    entries = [("data.pkl", pickled.getvalue()), (".format_version", b"1"), (".storage_alignment", b"64")]
    entries += [("byteorder", b"little")]
    entries += [(f"data/{i}", array.tobytes()) for i, array in enumerate(pickler.storages)]
    entries += [("version", b"3\n"), (".data/serialization_id", b"0" * 40)]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in entries:
            info = zipfile.ZipInfo(f"{path.stem}/{name}", (1980, 1, 1, 0, 0, 0))
            # The bytes of a storage start at multiples of 64: an extra field fills the gap.
            start = archive.fp.tell() + 30 + len(info.filename) + 4
            padding = -start % 64
            info.extra = struct.pack("<2sH", b"FB", padding) + b"Z" * padding
            archive.writestr(info, data)


def main():
    weights = load_file(FOLDER / f"{NAME}.safetensors")
    state, parameters = collections.OrderedDict(), []
    for name in sorted(name for name in weights if not name.startswith("golden.")):
        state[name] = Tensor(weights[name])
        if name.endswith("running_var"):
            counter = name.replace("running_var", "num_batches_tracked")
            state[counter] = Tensor(numpy.array(1000, numpy.int64))
        if "running" not in name:
            parameters.append(weights[name])
    # One step of Adam is enough to see what it looks like.
    first = {
        "step": Tensor(numpy.array(1000, numpy.float32)),
        "exp_avg": Tensor(numpy.zeros_like(parameters[0])),
        "exp_avg_sq": Tensor(numpy.zeros_like(parameters[0])),
    }
    group = {"lr": 0.001, "betas": (0.9, 0.999), "eps": 1e-8, "params": list(range(len(parameters)))}
    checkpoint = {
        "epoch": 499,
        "model_state_dict": state,
        "optimizer_state_dict": {"state": {0: first}, "param_groups": [group]},
        "cfg": OmegaConf.create(CFG),
    }
    save(checkpoint, FOLDER / f"{NAME}.pth")
    print(json.dumps({"tensors": len(state), "bytes": (FOLDER / f"{NAME}.pth").stat().st_size}))


main()
