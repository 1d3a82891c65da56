"""What works where the wheel was installed alone, without the optional packages:

python clean_environment.py
"""

import importlib.metadata
from pathlib import Path

import numpy as np
import tracklens
import tracklens.gymnasium

ROOT = Path(__file__).resolve().parents[2]


def main():
    installed = {distribution.name for distribution in importlib.metadata.distributions()}
    assert installed <= {"tracklens", "numpy", "pip", "setuptools"}, installed
    assert tracklens.__version__ == importlib.metadata.version("tracklens")
    assert (Path(tracklens.__file__).parent / "py.typed").is_file()

    encoder = tracklens.Encoder(ROOT / "tests/golden/basic-vel-std-bg-tiny.safetensors")
    rng = np.random.default_rng(0)
    frames = rng.integers(0, 256, (60, 48, 64, 3), np.uint8)
    keypoints = encoder(frames)
    assert keypoints.shape == (60, encoder.keypoints, 2)
    evaluation = tracklens.score(keypoints, keypoints[:, :2], names=["cube", "eef"])
    assert evaluation.errors.shape == (2, encoder.keypoints)
    # An object that is a keypoint is that keypoint under the identity, up to rounding.
    assert evaluation.errors[0, 0] < 1e-12
    print(encoder, evaluation, sep="\n")

    wrappers = {"KeypointObservation": "gymnasium", "VecKeypointObservation": "sb3"}
    for wrapper, extra in wrappers.items():
        try:
            getattr(tracklens.gymnasium, wrapper)
        except ImportError as missing:
            assert f"pip install 'tracklens[{extra}]'" in str(missing), missing
        else:
            raise AssertionError(f"{wrapper} without its package")


main()
