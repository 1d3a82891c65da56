"""Keypoints as the observations of reinforcement learning.

`KeypointObservation` wraps one environment of gymnasium (`pip install 'tracklens[gymnasium]'`),
`VecKeypointObservation` the vectorised ones of Stable-Baselines3 (`pip install 'tracklens[sb3]'`),
with one batch of frames for all of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._env import KeypointObservation as KeypointObservation
    from ._vec_env import VecKeypointObservation as VecKeypointObservation

__all__ = ["KeypointObservation", "VecKeypointObservation"]


def __getattr__(name: str) -> Any:
    """Imports gymnasium and Stable-Baselines3 when their wrapper is asked for, as both are optional."""
    try:
        if name == "KeypointObservation":
            from ._env import KeypointObservation

            return KeypointObservation
        if name == "VecKeypointObservation":
            from ._vec_env import VecKeypointObservation

            return VecKeypointObservation
    except ModuleNotFoundError as missing:
        extra = {"gymnasium": "gymnasium", "stable_baselines3": "sb3"}.get(missing.name or "")
        if extra is None:
            raise
        raise ImportError(
            f"{name} needs the package {missing.name}; install it with pip install 'tracklens[{extra}]'"
        ) from missing
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
