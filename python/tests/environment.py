"""An environment that draws where its point is."""

from __future__ import annotations

import gymnasium
import numpy as np

SIDE = 48


class Point(gymnasium.Env):
    """A bright square on dark ground; an episode ends after `length` steps."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, render_mode=None, length=3):
        self.render_mode = render_mode
        self.length = length
        self.action_space = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
        self.observation_space = gymnasium.spaces.Dict(
            {"robot": gymnasium.spaces.Box(-1, 1, (2,), np.float32)}
        )

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = self.np_random.uniform(-0.5, 0.5, 2).astype(np.float32)
        self.steps = 0
        return self._observation(), {}

    def step(self, action):
        self.at = np.clip(self.at + 0.3 * np.asarray(action, np.float32), -1, 1)
        self.steps += 1
        return self._observation(), 0.0, False, self.steps >= self.length, {}

    def render(self):
        if self.render_mode is None:
            return None
        frame = np.full((SIDE, SIDE, 3), 20, np.uint8)
        column, row = ((self.at + 1) / 2 * (SIDE - 8)).astype(int)
        frame[row : row + 8, column : column + 8] = (250, 200, 40)
        return frame

    def _observation(self):
        return {"robot": self.at.copy()}
