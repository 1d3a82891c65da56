"""Vectorised environments of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from .._errors import InputError
from .._tracklens import Encoder
from ._state import KeypointState, Part

RENDERED = "pixels"
"""The key under which `gymnasium.wrappers.AddRenderObservation` puts frames."""


class VecKeypointObservation(VecEnvWrapper):
    """Observations are the keypoints of the frames in them, `float32 [B, 2 N + E]`: x and y of the
    N keypoints one after the other, then the E numbers of `state`.

    The frames of all B environments go through the encoder together, with those of the terminal
    observations: an environment that ended is reset before its observation arrives, so its last
    frame is in `infos[i]["terminal_observation"]` alone, which becomes keypoints as well. For that
    the frames have to be in the observations: wrap every environment in
    `gymnasium.wrappers.AddRenderObservation` before it is vectorised.

    `frame` takes the frames `[..., H, W, 3]` out of observations; by default they are the
    observations themselves, or what `AddRenderObservation` adds to them. `state` takes further
    numbers out of them, `[..., E]`. Both are called with batches and with single observations:
    `lambda o: o["observation"][..., :6]`.

    Raises `InputError` when the observations hold no frames, and
    `gymnasium.error.ClosedEnvironmentError` when it is used after `close`.
    """

    def __init__(
        self,
        venv: VecEnv,
        encoder: Encoder,
        *,
        frame: Part | None = None,
        state: Part | None = None,
    ) -> None:
        found = frame if frame is not None else rendered(venv.observation_space)
        if found is None:
            raise InputError(
                f"the observations hold no frames ({venv.observation_space}); expected uint8 "
                '[H, W, 3]: wrap every environment, made with render_mode="rgb_array", in '
                "gymnasium.wrappers.AddRenderObservation before it is vectorised, or give `frame` "
                "to take the frames out of an observation"
            )
        self.encoder = encoder
        self.frame: Part = found
        self.closed = False
        self._state = KeypointState(encoder, venv.observation_space, state)
        super().__init__(venv, observation_space=self._state.space)

    def reset(self) -> NDArray[np.float32]:
        """As `VecEnv.reset`."""
        self._check_open()
        observations = self.venv.reset()
        return self._state.of(self.encoder(self.frame(observations)), observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """As `VecEnv.step_async`."""
        self._check_open()
        self.venv.step_async(actions)

    def step_wait(self) -> VecEnvStepReturn:
        """As `VecEnv.step_wait`."""
        observations, rewards, dones, infos = self.venv.step_wait()
        ended = [info for info in infos if "terminal_observation" in info]
        last = [info["terminal_observation"] for info in ended]
        frames = np.asarray(self.frame(observations))
        if last:
            terminal = np.stack([np.asarray(self.frame(one)) for one in last])
            frames = np.concatenate([frames, terminal])
        keypoints = self.encoder(frames)
        for info, one, points in zip(ended, last, keypoints[self.num_envs :], strict=True):
            info["terminal_observation"] = self._state.of(points[None], one)[0]
        return self._state.of(keypoints[: self.num_envs], observations), rewards, dones, infos

    def close(self) -> None:
        """Closes the environments."""
        self.closed = True
        super().close()

    def _check_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError(
                "the environments are closed; make new ones"
            )


def rendered(space: gymnasium.Space[Any]) -> Part | None:
    """What takes the frames out of observations of a space, if they hold any."""
    if isinstance(space, gymnasium.spaces.Dict) and RENDERED in space.spaces:
        return of_dictionary
    shape = space.shape or ()
    if isinstance(space, gymnasium.spaces.Box) and len(shape) == 3 and shape[2] == 3:
        return np.asarray
    return None


def of_dictionary(observation: Mapping[str, ArrayLike]) -> ArrayLike:
    """The frames that `AddRenderObservation` added."""
    return observation[RENDERED]
