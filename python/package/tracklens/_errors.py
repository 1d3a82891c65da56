"""Exceptions, with the texts that the command `tracklens` prints."""

from __future__ import annotations

from typing import Any


class TracklensError(Exception):
    """What every exception of tracklens is."""

    reason: dict[str, Any] | None = None
    """What a program needs to know to offer a remedy, with the kind in `type`; None where there is
    nothing to offer."""

    hint: str | None = None
    """The remedy in the words of this package."""


class InputError(TracklensError, ValueError):
    """The input is not what it should be: an array, a checkpoint, an option."""


class MismatchError(TracklensError, ValueError):
    """The inputs are fine by themselves and do not fit each other."""


class NumericError(TracklensError, ArithmeticError):
    """The numbers allow no answer, e.g. no frame has a ground truth."""


class FileError(TracklensError, OSError):
    """A file cannot be read."""


class CancelledError(TracklensError):
    """The work was cancelled."""
