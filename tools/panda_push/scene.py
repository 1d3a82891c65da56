"""The scene of PandaPush as the paper's code draws it: robot, task, camera and frames.

The recorder and the RL runs of tools/rl share it, so that an encoder sees in RL what it was trained
on.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
from numpy.typing import NDArray
from panda_gym.envs.core import RobotTaskEnv
from panda_gym.envs.robots.panda import Panda
from panda_gym.envs.tasks.push import Push
from panda_gym.pybullet import PyBullet

FloatArray = NDArray[np.float32]

ANTIALIAS = 2
"""Frames are rendered larger by this factor and averaged down."""

OBJECT_SITES = {"cube": "object", "target": "target"}
"""Sites at the base of a body, by the body's name in the simulation."""
LINK_SITES = {"link4": 4, "link5": 5, "eef": 11}
"""Sites at the centre of mass of a link of the robot."""
SITES = [*OBJECT_SITES, *LINK_SITES]
OBJECTS = ["cube", "target", "eef"]
"""The sites that the paper calls objects."""


@dataclass(frozen=True)
class Camera:
    """The paper's camera: where it looks from and how it projects."""

    target: tuple[float, float, float] = (0.0, -0.1, 0.0)
    distance: float = 0.7
    yaw: float = 45.0
    pitch: float = -35.0
    roll: float = 0.0
    # What panda-gym's renderer uses.
    fov: float = 60.0
    near: float = 0.1
    far: float = 100.0

    def view(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from the world to the camera."""
        columns = pybullet.computeViewMatrixFromYawPitchRoll(
            self.target, self.distance, self.yaw, self.pitch, self.roll, 2
        )
        return np.array(columns).reshape(4, 4).T

    def projection(self) -> NDArray[np.float64]:
        """The 4 x 4 matrix from the camera to clip space, for a square image."""
        columns = pybullet.computeProjectionMatrixFOV(self.fov, 1.0, self.near, self.far)
        return np.array(columns).reshape(4, 4).T

    def project(self, points: NDArray[np.float64]) -> FloatArray:
        """Places world points (K x 3) in the image: K x 2, x right, y down, the edges at +-0.999.

        The authors multiply by the transpose of the projection matrix and divide what comes out by
        5. That is ndc times (far - near) / (10 far near), with these planes exactly 0.999.
        """
        homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        clip = homogeneous @ (self.projection() @ self.view()).T
        ndc = clip[:, :2] / clip[:, 3:]
        return (0.999 * ndc * [1, -1]).astype(np.float32)


class FlatTargetPush(Push):
    """The push task with the target drawn as an opaque blue plate in the surface of the table."""

    def __init__(self, sim: PyBullet, reward: str = "sparse") -> None:
        """The reward is `sparse` or `dense`."""
        super().__init__(sim, reward_type=reward)

    def _create_scene(self) -> None:
        half = self.object_size / 2
        self.sim.create_plane(z_offset=-0.4)
        self.sim.create_table(length=1.1, width=0.7, height=0.4, x_offset=-0.3)
        self.sim.create_box(
            "object",
            half_extents=np.full(3, half),
            mass=1.0,
            position=np.array([0.0, 0.0, half]),
            rgba_color=np.array([0.1, 0.9, 0.1, 1.0]),
        )
        self.sim.create_box(
            "target",
            half_extents=np.array([half, half, half / 100]),
            mass=0.0,
            ghost=True,
            position=np.zeros(3),
            rgba_color=np.array([0.1, 0.1, 0.9, 1.0]),
        )

    def reset(self) -> None:
        """Draws the goal and the cube's place; the goal stays at the cube's height, the plate lies
        below it."""
        super().reset()
        plate = self.goal - np.array([0.0, 0.0, self.object_size / 2])
        self.sim.set_base_pose("target", plate, np.array([0.0, 0.0, 0.0, 1.0]))


class SimplePanda(Panda):
    """The robot with its collision meshes as its visual ones.

    TinyRenderer's time grows with the triangles, and the collision meshes have far fewer of them.
    """

    def _load_robot(self, file_name: str, base_position: NDArray[np.float64]) -> None:
        source = Path(pybullet_data.getDataPath(), file_name)
        collision = Path("meshes", "collision")
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(source.parent / collision, Path(folder, collision))
            simple = Path(folder, source.name)
            simple.write_text(source.read_text().replace("meshes/visual/", "meshes/collision/"))
            super()._load_robot(str(simple), base_position)


ROBOTS = {"paper": Panda, "simple": SimplePanda}
"""The robots by the name of their meshes."""

MakeTask = Callable[[PyBullet, Panda], Push]
"""Makes the task and with it the scene, which has a robot already."""


def eight_bit(frame: FloatArray) -> NDArray[np.uint8]:
    """A frame of values in [0, 1] as the recorder stores it in a PNG."""
    return np.rint(frame * 255).astype(np.uint8)


class Environment(RobotTaskEnv):
    """panda-gym's robot, the scene above and the paper's camera, rendered on the CPU by
    TinyRenderer."""

    def __init__(self, size: int, meshes: str = "paper", task: MakeTask | None = None) -> None:
        """Frames are size x size; the task is to push the cube onto the plate, unless another one
        is given."""
        self.camera = Camera()
        sim = PyBullet(render_mode="rgb_array", renderer="Tiny")
        base = np.array([-0.6, 0.0, 0.0])
        robot = ROBOTS[meshes](sim, block_gripper=True, base_position=base, control_type="ee")
        super().__init__(
            robot,
            task(sim, robot) if task else FlatTargetPush(sim),
            render_width=size * ANTIALIAS,
            render_height=size * ANTIALIAS,
            render_target_position=np.array(self.camera.target),
            render_distance=self.camera.distance,
            render_yaw=self.camera.yaw,
            render_pitch=self.camera.pitch,
            render_roll=self.camera.roll,
        )

    def frame(self) -> FloatArray:
        """The picture of the scene: size x size x 3, values in [0, 1]."""
        pixels = self.render() / 255
        size = len(pixels) // ANTIALIAS
        blocks = pixels.reshape(size, ANTIALIAS, size, ANTIALIAS, 3)
        return blocks.mean(axis=(1, 3)).astype(np.float32)

    def sites(self) -> FloatArray:
        """Where the sites are in the picture: K x 2 as `Camera.project` gives them."""
        bodies = [self.sim.get_base_position(body) for body in OBJECT_SITES.values()]
        links = [self.sim.get_link_position("panda", link) for link in LINK_SITES.values()]
        return self.camera.project(np.array(bodies + links))
