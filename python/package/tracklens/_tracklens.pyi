"""The compiled part of the package."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["VERSION", "Encoder", "Evaluation", "score"]

VERSION: Final[str]

@final
class Encoder:
    """Finds keypoints in frames, on the CPU.

    `path` is a checkpoint of a spatial autoencoder (`.safetensors`, PyTorch's `.pth`, burn's
    `.bpk`), the index of one in several files, or any keypoint detector as an ONNX model. `key`
    says which weights where a file has several sets. `threads` compute at a time, by default as
    many as there are cores. `settings` say what an ONNX model leaves open, under the keys of
    docs/detectors.md; a file beside the model (`model.onnx.json`) says the rest.

    Raises `FileError` when the file cannot be read, and `InputError` or `MismatchError` when it is
    no such model. An encoder can be pickled: the copy opens the file again.
    """

    def __new__(
        cls,
        path: str | PathLike[str],
        *,
        key: str | None = None,
        threads: int | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Encoder: ...
    def __call__(self, frames: ArrayLike | Sequence[ArrayLike]) -> NDArray[np.float32]:
        """The keypoints of B frames, `[B, N, 2]`, (x, y).

        `frames` are `[B, H, W, 3]`, RGB: `uint8`, or `float32` or `float64` within 0 to 1. They are
        resized to the encoder's input size, if it has one and it is another one, as in training,
        which a warning says once. The keypoints are in the latent space of an autoencoder, as
        `tracklens extract` writes them, and in ndc of other detectors; see `to_ndc`.

        Other Python threads run meanwhile. Raises `InputError` for another shape (the axis is
        named) or values outside 0 to 1 (the frame and the pixel are named), `TypeError` for another
        dtype, `NumericError` when a keypoint is not finite.
        """

    def with_confidence(
        self, frames: ArrayLike | Sequence[ArrayLike]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """The keypoints of B frames, `[B, N, 2]`, and how sure the detector is of each, `[B, N]`;
        None where it does not say, as no autoencoder does."""

    def to_ndc(self, points: ArrayLike, image_size: tuple[int, int]) -> NDArray[np.float64]:
        """Keypoints `[..., 2]` of images of (width, height) in ndc: -1 and +1 at the outer edges of
        the image. In the latent space -1 and +1 are the centres of the border cells of the last
        feature map."""

    @property
    def keypoints(self) -> int:
        """The number of keypoints N."""

    @property
    def input_size(self) -> tuple[int, int] | None:
        """Width and height that frames are resized to; None where each is taken as it is."""

    @property
    def architecture(self) -> str | None:
        """Such as `keynet-vel-std-bg`; None of a detector that is not an autoencoder."""

    @property
    def space(self) -> str:
        """Where the keypoints lie: `latent` or `ndc`."""

    @property
    def threads(self) -> int:
        """How many compute at a time."""

    @property
    def path(self) -> Path:
        """The file."""

@final
class Evaluation:
    """How well the keypoints track the objects. A notebook shows its table and its figures."""

    @staticmethod
    def from_json(text: str) -> Evaluation:
        """Reads what `to_json` or `tracklens score --json` wrote, also of an older version."""

    @property
    def tc(self) -> float | None:
        """Tracking capability: the share of tracked objects; None where there are not enough data
        to tell tracking from chance."""

    @property
    def frames(self) -> int:
        """The number of frames that were scored."""

    @property
    def names(self) -> list[str]:
        """Of the K objects, in order."""

    @property
    def objects(self) -> dict[str, dict[str, Any]]:
        """By name what the JSON says of each object: `tracked`, `error`, `best_keypoint`, `map`, …
        (docs/metrics.md)."""

    @property
    def errors(self) -> NDArray[np.float64]:
        """The tracking error of every object and keypoint, `[K, N]`: the mean squared distance in
        ndc. NaN where there is none."""

    @property
    def warnings(self) -> list[str]:
        """What a reader has to know."""

    @property
    def findings(self) -> list[dict[str, Any]]:
        """What looks wrong with the data, as the JSON has it."""

    @property
    def notes(self) -> list[str]:
        """How the arrays were read and matched."""

    def to_json(self) -> str:
        """The JSON of `tracklens score --json`, without its command."""

    def to_dict(self) -> dict[str, Any]:
        """The same as plain objects."""

    def to_csv(self) -> str:
        """One line an object."""

    def to_latex(self) -> str:
        """The table of the objects for a paper."""

    def to_html(self) -> str:
        """The report of `tracklens score --report`, one self-contained page."""

    def figures(self) -> dict[str, str]:
        """The figures of the report by name, as SVG."""

    def _repr_html_(self) -> str: ...

def score(
    keypoints: ArrayLike | Sequence[ArrayLike],
    truth: ArrayLike | Sequence[ArrayLike],
    confidence: ArrayLike | Sequence[ArrayLike] | None,
    truth_confidence: ArrayLike | Sequence[ArrayLike] | None,
    options: Mapping[str, Any],
) -> Evaluation: ...
