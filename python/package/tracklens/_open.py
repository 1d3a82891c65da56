"""How pickled objects come back."""

from __future__ import annotations

import json
from os import PathLike

from ._tracklens import Encoder


def open_encoder(
    path: str | PathLike[str], key: str | None, threads: int, settings: str | None
) -> Encoder:
    """The encoder of a file, opened again."""
    parsed = None if settings is None else json.loads(settings)
    return Encoder(path, key=key, threads=threads, settings=parsed)
