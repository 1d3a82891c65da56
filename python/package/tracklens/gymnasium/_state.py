"""What a wrapper makes of keypoints: the observation and its space."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._errors import InputError
from .._tracklens import Encoder

Part: TypeAlias = Callable[[Any], ArrayLike]
"""Takes a part out of an observation, or out of a batch of them."""


class KeypointState:
    """Keypoints (x, y) one after the other, then what `state` takes out of an observation."""

    def __init__(
        self, encoder: Encoder, observation_space: gymnasium.Space[Any], state: Part | None
    ) -> None:
        self.state = state
        self.keypoints = 2 * encoder.keypoints
        self.others = 0 if state is None else np.size(state(observation_space.sample()))
        # The soft-argmax of an autoencoder lies between the border cells of its last feature map.
        reach = 1.0 if encoder.space == "latent" else np.inf
        high = np.full(self.keypoints + self.others, np.inf, np.float32)
        high[: self.keypoints] = reach
        self.space = gymnasium.spaces.Box(-high, high, dtype=np.float32)

    def of(self, keypoints: NDArray[np.float32], observations: Any) -> NDArray[np.float32]:
        """The observations `[B, 2 N + E]` of keypoints `[B, N, 2]`; `observations` are a batch."""
        count = len(keypoints)
        points = keypoints.reshape(count, self.keypoints)
        if self.state is None:
            return points
        others = np.asarray(self.state(observations), np.float32)
        if others.size != count * self.others:
            raise InputError(
                f"`state` gives {others.size} numbers for {count} observations; expected "
                f"{self.others} for each, as for a sample of the observation space. A batch has "
                "one axis more in front: take parts as in lambda o: o['observation'][..., :6]"
            )
        return np.concatenate([points, others.reshape(count, self.others)], axis=1)
