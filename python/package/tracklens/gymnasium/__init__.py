"""Keypoints as the observations of reinforcement learning.

`KeypointObservation` wraps one environment of gymnasium (`pip install 'tracklens[gymnasium]'`),
`VecKeypointObservation` the vectorised ones of Stable-Baselines3 (`pip install 'tracklens[sb3]'`),
with one batch of frames for all of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._env import KeypointObservation as KeypointObservation
    from ._vec_env import VecKeypointObservation as VecKeypointObservation

__all__ = ["KeypointObservation", "VecKeypointObservation"]


def __getattr__(name: str) -> Any:
    """Imports gymnasium and Stable-Baselines3, which are optional, with their wrappers."""
    if name == "KeypointObservation":
        module, extra = "_env", "gymnasium"
    elif name == "VecKeypointObservation":
        module, extra = "_vec_env", "sb3"
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f".{module}", __name__), name)
    except ModuleNotFoundError as missing:
        if missing.name not in ("gymnasium", "stable_baselines3"):
            raise
        raise ImportError(
            f"{name} needs the package {missing.name}; install it with "
            f"pip install 'tracklens[{extra}]'"
        ) from missing
