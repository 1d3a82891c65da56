"""The agent: SAC of Stable-Baselines3, and all that it goes on from."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecEnv,
    VecMonitor,
)

from environment import ROBOT, STATES, PandaTask, Scenario
from protocol import BAD_INPUT, RunConfig, RunError
from run_folder import Header

Tensors = dict[str, Any]

TRAINING, EVALUATION = 0, 1
"""What a seed of environments is for."""


def environments(
    config: RunConfig, count: int, encoder: Any | None, *, processes: bool
) -> VecEnv:
    """The environments of a run, in this process or in one each."""
    scenario = Scenario(
        task=config.task,
        reward=config.reward,
        state=config.state,
        time_limit=config.time_limit,
        size=config.size or 64,
        meshes=config.meshes or "simple",
    )

    def make() -> PandaTask:
        return PandaTask(scenario)

    def make_in_process() -> PandaTask:
        # What ends a run goes to all of its processes; this one is ended by the first.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        return make()

    venv: VecEnv
    venv = SubprocVecEnv([make_in_process] * count) if processes else DummyVecEnv([make] * count)
    if encoder is None:
        return venv
    from tracklens.gymnasium import VecKeypointObservation

    robot = (lambda observation: observation[ROBOT]) if STATES[config.state].robot else None
    return VecKeypointObservation(venv, encoder, state=robot)


def load_encoder(path: Path, threads: int) -> Any:
    """The encoder of a checkpoint."""
    try:
        import tracklens
    except ModuleNotFoundError as error:
        raise RunError(
            "states with keypoints need the Python package tracklens; install its wheel "
            "(`cargo xtask python` builds it)",
            BAD_INPUT,
        ) from error
    try:
        return tracklens.Encoder(path, threads=threads)
    except encoder_errors() as error:
        raise RunError(str(error), BAD_INPUT) from error


def encoder_errors() -> tuple[type[Exception], ...]:
    """What tracklens raises, where it is installed."""
    try:
        from tracklens import TracklensError
    except ModuleNotFoundError:
        return ()
    return (TracklensError,)


def new_agent(config: RunConfig, venv: VecEnv) -> SAC:
    """An untrained agent."""
    agent = SAC(
        "MlpPolicy",
        VecMonitor(venv),
        learning_rate=config.learning_rate,
        buffer_size=config.buffer,
        learning_starts=config.learning_starts,
        batch_size=config.batch,
        gamma=config.discount,
        ent_coef=f"auto_{config.entropy}",
        gradient_steps=config.updates_per_step * config.environments,
        policy_kwargs={"net_arch": list(config.network)},
        seed=config.seed,
        device="cpu",
    )
    venv.seed(environment_seed(config.seed, TRAINING))
    return agent


def environment_seed(seed: int, *purpose: int) -> int:
    """The seed of the first of several environments; the others count on from it. Those of
    different runs and purposes are far apart."""
    return int(np.random.SeedSequence([seed, *purpose]).generate_state(1)[0] // 2)


REPLAY = ["observations", "next_observations", "actions", "rewards", "dones", "timeouts"]


def capture(agent: SAC) -> tuple[Header, Tensors]:
    """All that the agent goes on from: what is said in words, and what in numbers.

    Between two steps: those of the environments are stored and learned from.
    """
    monitor = agent.env
    replay = agent.replay_buffer
    assert isinstance(monitor, VecMonitor) and replay is not None
    kind, keys, *rest = np.random.get_state()
    header = {
        "steps": agent.num_timesteps,
        "updates": agent._n_updates,
        "finished_episodes": agent._episode_num,
        "replay": {"position": replay.pos, "full": replay.full},
        "numpy": [kind, *rest],
        "actions": agent.action_space.np_random.bit_generator.state,
        "environments": monitor.env_method("snapshot"),
    }
    filled = replay.size()
    tensors = {
        "parameters": agent.get_parameters(),
        "log_ent_coef": agent.log_ent_coef.detach(),
        "replay": {name: torch.from_numpy(getattr(replay, name)[:filled]) for name in REPLAY},
        "observation": torch.from_numpy(agent._last_obs),
        "returns": torch.from_numpy(monitor.episode_returns),
        "lengths": torch.from_numpy(monitor.episode_lengths),
        "numpy": torch.from_numpy(keys),
        "torch": torch.get_rng_state(),
    }
    return json.loads(json.dumps(header)), tensors


def go_on(agent: SAC, header: Header, tensors: Tensors) -> None:
    """Makes a new agent the one that was captured."""
    monitor, replay = agent.env, agent.replay_buffer
    assert isinstance(monitor, VecMonitor) and replay is not None
    agent.set_parameters(tensors["parameters"], exact_match=True)
    agent.log_ent_coef.data = tensors["log_ent_coef"]
    for name, values in tensors["replay"].items():
        getattr(replay, name)[: len(values)] = values.numpy()
    replay.pos, replay.full = header["replay"]["position"], header["replay"]["full"]
    agent.num_timesteps = header["steps"]
    agent._n_updates = header["updates"]
    agent._episode_num = header["finished_episodes"]
    agent._last_obs = tensors["observation"].numpy()
    agent._last_episode_starts = np.zeros(monitor.num_envs, dtype=bool)
    monitor.episode_returns = tensors["returns"].numpy()
    monitor.episode_lengths = tensors["lengths"].numpy()
    for index, snapshot in enumerate(header["environments"]):
        monitor.env_method("restore", snapshot, indices=index)
    agent.action_space.np_random.bit_generator.state = header["actions"]
    kind, *rest = header["numpy"]
    np.random.set_state((kind, tensors["numpy"].numpy(), *rest))
    torch.set_rng_state(tensors["torch"])


