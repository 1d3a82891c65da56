"""Do the keypoints track the objects?

`Encoder` finds the keypoints of frames, `score` says which objects they track, and
`tracklens.gymnasium` puts both into reinforcement learning. All of it is the Rust code of the
command `tracklens`, and gives its numbers bit for bit.
"""

from ._errors import (
    CancelledError,
    FileError,
    InputError,
    MismatchError,
    NumericError,
    TracklensError,
)
from ._score import score
from ._tracklens import VERSION as __version__
from ._tracklens import Encoder, Evaluation

__all__ = [
    "CancelledError",
    "Encoder",
    "Evaluation",
    "FileError",
    "InputError",
    "MismatchError",
    "NumericError",
    "TracklensError",
    "__version__",
    "score",
]
