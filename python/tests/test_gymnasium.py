"""`KeypointObservation`."""

import gymnasium
import numpy as np
import pytest
import tracklens
from conftest import TINY
from environment import Point
from gymnasium.utils.env_checker import check_env
from tracklens import Encoder
from tracklens.gymnasium import KeypointObservation


@pytest.fixture(scope="module")
def encoder():
    return Encoder(TINY, threads=1)


def test_observations_are_the_keypoints_of_the_rendered_frame(encoder):
    env = KeypointObservation(Point("rgb_array"), encoder)
    assert env.observation_space == gymnasium.spaces.Box(-1, 1, (8,), np.float32)
    observation, _ = env.reset(seed=3)
    seen = [observation]
    for _ in range(2):
        expected = encoder(env.render()[None])[0].ravel()
        np.testing.assert_array_equal(observation, expected)
        assert observation in env.observation_space
        observation, reward, terminated, truncated, _ = env.step(np.array([0.5, -0.5]))
        seen.append(observation)
    assert len({one.tobytes() for one in seen}) == 3
    assert (reward, terminated, truncated) == (0.0, False, False)


def test_a_part_of_the_observation_is_appended(encoder):
    env = KeypointObservation(Point("rgb_array"), encoder, state=lambda o: o["robot"])
    assert env.observation_space.shape == (10,)
    assert (env.observation_space.high[8:] == np.inf).all()
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(observation[8:], env.unwrapped.at)


def test_frames_may_be_in_the_observations(encoder):
    inner = gymnasium.wrappers.AddRenderObservation(Point("rgb_array"), render_only=False)
    env = KeypointObservation(inner, encoder, frame=lambda o: o["pixels"])
    observation, _ = env.reset(seed=3)
    np.testing.assert_array_equal(observation, encoder(env.render()[None])[0].ravel())


# Gymnasium would rather check what is wrapped.
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_gymnasium_finds_nothing_wrong_with_it(encoder):
    check_env(KeypointObservation(Point("rgb_array"), encoder), skip_render_check=True)


def test_an_environment_that_does_not_render_is_refused(encoder):
    with pytest.raises(tracklens.InputError, match='render_mode=None; expected "rgb_array"'):
        KeypointObservation(Point(), encoder)


def test_an_environment_that_renders_nothing_is_named(encoder):
    inner = Point("rgb_array")
    env = KeypointObservation(inner, encoder)
    inner.render_mode = None
    with pytest.raises(tracklens.InputError, match="rendered nothing"):
        env.reset()


def test_a_closed_environment_is_named(encoder):
    env = KeypointObservation(Point("rgb_array"), encoder)
    env.reset()
    env.close()
    for use in (env.reset, lambda: env.step(np.zeros(2))):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="closed; make a new one"):
            use()
    env.close()


def test_a_state_of_another_size_is_named(encoder):
    sizes = iter([2, 3])
    env = KeypointObservation(Point("rgb_array"), encoder, state=lambda o: np.zeros(next(sizes)))
    with pytest.raises(tracklens.InputError, match="3 numbers for 1 observations; expected 2"):
        env.reset()
