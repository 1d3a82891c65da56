"""The environments that an agent learns in: tasks in the scene of PandaPush, states, episodes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from panda_gym.envs.robots.panda import Panda
from panda_gym.pybullet import PyBullet

sys.path.append(str(Path(__file__).resolve().parents[1] / "panda_push"))

from scene import ROBOTS, Environment, FlatTargetPush, eight_bit

MESHES = list(ROBOTS)
REWARDS = ["sparse", "dense"]
POINT_BODIES = ["object", "target"]
POINT_LINKS = [6, 8, 11]
"""What the true points are of: the cube, the plate and three links, as in the authors' runs with
ground-truth points. Three points of the arm fix its place in space, the end effector's alone (link
11) leaves the depth open."""

FRAME = "pixels"
"""The part of an observation that tracklens takes for the frame."""
ROBOT = "robot"

Observation = NDArray[np.float32] | dict[str, NDArray[Any]]


class Push(FlatTargetPush):
    """The cube has to come to the plate: the paper's task."""

    def __init__(self, sim: PyBullet, robot: Panda, reward: str) -> None:
        self.robot = robot
        super().__init__(sim, reward=reward)

    def reset(self) -> None:
        """Places plate and cube, without what the simulation keeps of the contacts before.

        The simulation starts its solver from the last contacts of a body, wherever it was put
        since. Far from everything the cube has none, so that an episode is the same whatever was
        simulated before it.
        """
        upright = np.array([0.0, 0.0, 0.0, 1.0])
        self.sim.set_base_pose("object", np.array([5.0, 5.0, 5.0]), upright)
        self.sim.physics_client.performCollisionDetection()
        super().reset()


class Reach(Push):
    """The end effector has to come to the plate; the cube is in the scene and does not matter."""

    def get_achieved_goal(self) -> NDArray[np.float64]:
        """Where the end effector is."""
        return np.array(self.robot.get_ee_position())


TASKS = {"push": Push, "reach": Reach}


@dataclass(frozen=True)
class State:
    """What an agent sees."""

    frame: bool = False
    """The camera's frame, for an encoder."""
    points: bool = False
    """The true points in the image."""
    robot: bool = False
    """Position and velocity of the end effector."""
    task: bool = False
    """Position, rotation, velocity and angular velocity of the cube, and the goal."""


STATES = {
    "keypoints": State(frame=True),
    "keypoints+robot": State(frame=True, robot=True),
    "points": State(points=True),
    "points+robot": State(points=True, robot=True),
    "full": State(robot=True, task=True),
}
"""The five states of the paper (appendix, table "Specifications of state representation")."""


@dataclass(frozen=True)
class Scenario:
    """Everything that an environment depends on but its seed."""

    task: str
    reward: str
    state: str
    time_limit: int
    """Steps after which an episode is cut off."""
    size: int
    """Side of a frame in pixels."""
    meshes: str


class PandaTask(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A task in the scene of PandaPush.

    An episode never starts solved, ends when it is solved or at the time limit, and depends on its
    seed and its actions alone. A state has these parts, in this order:

    | part | numbers | |
    |---|---|---|
    | points | 5 x 2 | x right, y down, the image's edges at +-0.999 |
    | robot | 6 | position (m) and velocity (m/s) of the end effector |
    | task | 15 | of the cube position, rotation (Euler), velocity and angular velocity; the goal |

    Observations are these numbers, float32. Those for an encoder are dictionaries instead, with the
    frame (`pixels`, H x W x 3, uint8, as the recorder stores it) and, if it is part of the state,
    `robot`.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}
    render_mode = "rgb_array"

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.state = STATES[scenario.state]
        make = TASKS[scenario.task]
        self.scene = Environment(
            scenario.size,
            meshes=scenario.meshes,
            task=lambda sim, robot: make(sim, robot, scenario.reward),
        )
        # Otherwise the solver's order, and so its rounding, depends on what was simulated before.
        self.scene.sim.physics_client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        self.action_space = self.scene.action_space
        observation = self._observation()
        if isinstance(observation, dict):
            self.observation_space = spaces.Dict({k: space(v) for k, v in observation.items()})
        else:
            self.observation_space = space(observation)
        self._episode_seed = 0
        self._actions: list[list[float]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode; with a seed, this and all after it follow from the seed."""
        super().reset(seed=seed, options=options)
        while True:
            self._episode_seed = int(self.np_random.integers(2**31))
            _, info = self.scene.reset(seed=self._episode_seed)
            if not info["is_success"]:
                break
        self._actions = []
        return self._observation(), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One step of the simulation, 0.04 s."""
        self._actions.append(np.asarray(action, dtype=np.float32).tolist())
        _, reward, solved, _, info = self.scene.step(action)
        cut = not solved and len(self._actions) >= self.scenario.time_limit
        return self._observation(), reward, solved, cut, info

    def render(self) -> NDArray[np.uint8]:
        """The camera's frame: H x W x 3."""
        return eight_bit(self.scene.frame())

    def close(self) -> None:
        """Ends the simulation."""
        self.scene.close()

    def snapshot(self) -> dict[str, Any]:
        """Where the environment is, as JSON has it: `restore` comes back to it."""
        return {
            "random": self.np_random.bit_generator.state,
            "seed": self._episode_seed,
            "actions": list(self._actions),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Goes through the episode of a snapshot up to where it was."""
        self.np_random.bit_generator.state = snapshot["random"]
        self._episode_seed = snapshot["seed"]
        self._actions = list(snapshot["actions"])
        self.scene.reset(seed=self._episode_seed)
        for action in self._actions:
            self.scene.step(np.array(action, dtype=np.float32))

    def _observation(self) -> Observation:
        numbers = [part.astype(np.float32) for part in self._parts()]
        if not self.state.frame:
            return np.concatenate(numbers)
        return {FRAME: self.render(), **({ROBOT: numbers[0]} if numbers else {})}

    def _parts(self) -> Iterator[NDArray[np.float64 | np.float32]]:
        task, sim = self.scene.task, self.scene.sim
        if self.state.points:
            places = [sim.get_base_position(body) for body in POINT_BODIES]
            places += [sim.get_link_position("panda", link) for link in POINT_LINKS]
            yield self.scene.camera.project(np.array(places)).ravel()
        if self.state.robot:
            yield self.scene.robot.get_obs()
        if self.state.task:
            yield np.concatenate([task.get_obs(), task.get_goal()])


def space(part: NDArray[Any]) -> spaces.Box:
    """The space of a frame or of numbers; panda-gym bounds its numbers by 10 as well."""
    if part.dtype == np.uint8:
        return spaces.Box(0, 255, part.shape, np.uint8)
    return spaces.Box(-10.0, 10.0, part.shape, np.float32)
