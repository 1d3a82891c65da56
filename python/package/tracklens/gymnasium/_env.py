"""One environment of gymnasium."""

from __future__ import annotations

from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from numpy.typing import NDArray

from .._errors import InputError
from .._tracklens import Encoder
from ._state import KeypointState, Part


class KeypointObservation(gymnasium.ObservationWrapper[NDArray[np.float32], Any, Any]):
    """Observations are the keypoints of the rendered frame, `float32 [2 N + E]`: x and y of the N
    keypoints one after the other, then the E numbers of `state`.

    `env` renders frames (`render_mode="rgb_array"`), or `frame` takes a frame `[H, W, 3]` out of an
    observation. `state` takes further numbers out of an observation, such as where a robot is:
    `lambda o: o["observation"][:6]`. It is called once with a sample of the observation space.

    Raises `InputError` when the environment has another render mode or renders nothing, and
    `gymnasium.error.ClosedEnvironmentError` when it is used after `close`.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        encoder: Encoder,
        *,
        frame: Part | None = None,
        state: Part | None = None,
    ) -> None:
        super().__init__(env)
        if frame is None and env.render_mode != "rgb_array":
            raise InputError(
                f'the environment has render_mode={env.render_mode!r}; expected "rgb_array", as in '
                'gymnasium.make(ID, render_mode="rgb_array"), or `frame` to take the frame out '
                "of an observation"
            )
        self.encoder = encoder
        self.frame = frame
        self.closed = False
        self._state = KeypointState(encoder, env.observation_space, state)
        self.observation_space = self._state.space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """As `gymnasium.Env.reset`."""
        self._check_open()
        return super().reset(seed=seed, options=options)

    def step(
        self, action: Any
    ) -> tuple[NDArray[np.float32], SupportsFloat, bool, bool, dict[str, Any]]:
        """As `gymnasium.Env.step`."""
        self._check_open()
        return super().step(action)

    def observation(self, observation: Any) -> NDArray[np.float32]:
        """The keypoints of the frame that belongs to an observation of the environment."""
        frame = self.env.render() if self.frame is None else self.frame(observation)
        if frame is None:
            raise InputError(
                "the environment rendered nothing (None); expected a frame, uint8 [H, W, 3]"
            )
        keypoints = self.encoder(np.asarray(frame)[None])
        observed: NDArray[np.float32] = self._state.of(keypoints, observation)[0]
        return observed

    def close(self) -> None:
        """Closes the environment."""
        self.closed = True
        super().close()

    def _check_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError(
                "the environment is closed; make a new one"
            )
