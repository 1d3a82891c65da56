"""`VecKeypointObservation`."""

import gymnasium
import numpy as np
import pytest
import tracklens
from conftest import TINY
from environment import Point
from gymnasium.wrappers import AddRenderObservation
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv
from tracklens import Encoder
from tracklens.gymnasium import KeypointObservation, VecKeypointObservation

COUNT = 3


@pytest.fixture(scope="module")
def encoder():
    return Encoder(TINY, threads=1)


def rendering(length=3):
    return AddRenderObservation(Point("rgb_array", length), render_only=False)


def vectorised(length=3):
    return DummyVecEnv([lambda: rendering(length)] * COUNT)


def robot(observation):
    return observation["robot"][..., :2]


def test_observations_are_those_of_single_environments(encoder):
    venv = VecKeypointObservation(vectorised(), encoder, state=robot)
    single = [KeypointObservation(Point("rgb_array"), encoder, state=robot) for _ in range(COUNT)]
    venv.seed(5)
    found = venv.reset()
    expected = [env.reset(seed=5 + i)[0] for i, env in enumerate(single)]
    assert found.shape == (COUNT, 10) and found.dtype == np.float32
    np.testing.assert_array_equal(found, expected)
    for _ in range(2):
        actions = np.full((COUNT, 2), 0.4, np.float32)
        found, _, dones, _ = venv.step(actions)
        expected = [env.step(action)[0] for env, action in zip(single, actions, strict=True)]
        np.testing.assert_array_equal(found, expected)
        assert not dones.any()


def test_terminal_observations_are_keypoints_of_the_last_frame(encoder):
    venv = VecKeypointObservation(vectorised(length=1), encoder, state=robot)
    single = [KeypointObservation(Point("rgb_array"), encoder, state=robot) for _ in range(COUNT)]
    venv.seed(5)
    venv.reset()
    for i, env in enumerate(single):
        env.reset(seed=5 + i)
    actions = np.full((COUNT, 2), 0.4, np.float32)
    found, _, dones, infos = venv.step(actions)
    assert dones.all()
    last = [info["terminal_observation"] for info in infos]
    expected = [env.step(action)[0] for env, action in zip(single, actions, strict=True)]
    np.testing.assert_array_equal(last, expected)
    # The observations are those of the new episodes.
    assert not np.array_equal(found, last)
    assert all(one in venv.observation_space for one in [*found, *last])


def test_only_some_environments_end(encoder):
    envs = [lambda: rendering(length=1), lambda: rendering(length=2), lambda: rendering(length=1)]
    venv = VecKeypointObservation(DummyVecEnv(envs), encoder)
    venv.reset()
    _, _, dones, infos = venv.step(np.zeros((COUNT, 2), np.float32))
    assert dones.tolist() == [True, False, True]
    assert [info.get("terminal_observation", np.empty(0)).shape for info in infos] == [
        (8,),
        (0,),
        (8,),
    ]


def test_observations_may_be_frames_themselves(encoder):
    envs = [lambda: AddRenderObservation(Point("rgb_array", 1), render_only=True)] * COUNT
    venv = VecKeypointObservation(DummyVecEnv(envs), encoder)
    assert venv.reset().shape == (COUNT, 8)
    _, _, _, infos = venv.step(np.zeros((COUNT, 2), np.float32))
    assert infos[0]["terminal_observation"].shape == (8,)


def test_environments_may_run_in_processes_of_their_own(encoder):
    here = VecKeypointObservation(vectorised(), encoder)
    there = VecKeypointObservation(SubprocVecEnv([rendering] * COUNT, start_method="fork"), encoder)
    try:
        for venv in (here, there):
            venv.seed(2)
        np.testing.assert_array_equal(here.reset(), there.reset())
        actions = np.full((COUNT, 2), -0.3, np.float32)
        np.testing.assert_array_equal(here.step(actions)[0], there.step(actions)[0])
    finally:
        there.close()


def test_stable_baselines3_learns_on_it(encoder):
    venv = VecKeypointObservation(vectorised(length=4), encoder, state=robot)
    model = SAC("MlpPolicy", venv, learning_starts=6, batch_size=4, buffer_size=60, device="cpu")
    model.learn(24)
    assert model.num_timesteps >= 24
    # The buffer holds the terminal observations, not those of the next episodes.
    assert np.abs(model.replay_buffer.next_observations).sum() > 0


def test_observations_without_frames_are_refused(encoder):
    venv = DummyVecEnv([Point])
    with pytest.raises(tracklens.InputError, match="hold no frames .*AddRenderObservation"):
        VecKeypointObservation(venv, encoder)


def test_closed_environments_are_named(encoder):
    venv = VecKeypointObservation(vectorised(), encoder)
    venv.reset()
    venv.close()
    for use in (venv.reset, lambda: venv.step(np.zeros((COUNT, 2)))):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="closed; make new ones"):
            use()
