"""Runs of a few steps: every state, resuming, and what is refused."""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

TOOL = Path(__file__).resolve().parents[1]
CHECKPOINT = TOOL.parents[1] / "web/example/checkpoint.safetensors"
sys.path[:0] = [str(TOOL), str(TOOL.parent / "panda_push")]

from scene import SITES
from stable_baselines3 import SAC

import environment
import train_rl

SMALL = [
    *["--environments=2", "--time-limit=7", "--evaluate-every=20", "--episodes=2"],
    *["--learning-starts=20", "--batch=8", "--buffer=50", "--network=64,64"],
]
"""Episodes of few steps, so that every part of a run comes to its turn within 60 of them; the
replay buffer overflows."""


def arguments(out: Path, *options: str, state: str = "points+robot", steps: int = 60) -> list[str]:
    """Those of a small run."""
    return [f"--state={state}", f"--out={out}", f"--steps={steps}", *SMALL, *options]


def command(out: Path, *options: str, steps: int = 60) -> list[str]:
    """A small run as a process."""
    return [sys.executable, str(TOOL / "train_rl.py"), *arguments(out, *options, steps=steps)]


def log(run: Path) -> list[dict]:
    """The evaluations without their time."""
    lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    for line in lines:
        del line["seconds"]
    return lines


def refused(capsys: pytest.CaptureFixture[str], argv: list[str], code: int) -> str:
    """What a refused command says."""
    capsys.readouterr()
    assert train_rl.main(argv) == code
    return capsys.readouterr().err


def wait_for_lines(process: subprocess.Popen, run: Path, count: int) -> None:
    """Until the log has as many lines."""
    while process.poll() is None:
        if (run / "log.jsonl").exists() and (run / "log.jsonl").read_text().count("\n") >= count:
            return
        time.sleep(0.01)


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that nothing interrupted."""
    run = tmp_path_factory.mktemp("whole") / "run"
    assert train_rl.main(arguments(run, steps=400)) == 0
    return run


@pytest.mark.parametrize("task", environment.TASKS)
@pytest.mark.parametrize("reward", environment.REWARDS)
@pytest.mark.parametrize("state", ["points", "points+robot", "full"])
def test_every_state_without_frames_trains_on_every_task(tmp_path, task, reward, state):
    run = tmp_path / "run"
    options = [f"--task={task}", f"--reward={reward}"]
    assert train_rl.main(arguments(run, *options, state=state, steps=40)) == 0
    assert [line["step"] for line in log(run)] == [20, 40]
    summary = json.loads((run / "summary.json").read_text())
    assert summary["steps"] == 40 and not summary["interrupted"]
    agent = SAC.load(run / "model.zip", device="cpu")
    action, _ = agent.predict(agent.observation_space.sample())
    assert action.shape == (3,)


@pytest.mark.parametrize("state", ["keypoints", "keypoints+robot"])
def test_every_state_with_frames_trains(tmp_path, state):
    tracklens = pytest.importorskip("tracklens", reason="the wheel of tracklens is not installed")
    run = tmp_path / "run"
    checkpoint = f"--checkpoint={CHECKPOINT}"
    assert train_rl.main(arguments(run, checkpoint, "--size=32", state=state)) == 0
    assert len(log(run)) == 3
    config = json.loads((run / "config.json").read_text())
    assert config["checkpoint_file"] == CHECKPOINT.name
    agent = SAC.load(run / "model.zip", device="cpu")
    numbers = 2 * tracklens.Encoder(CHECKPOINT).keypoints + 6 * state.endswith("robot")
    assert agent.observation_space.shape == (numbers,)


def test_an_evaluation_of_the_encoder_is_kept_for_reports(tmp_path, capsys):
    pytest.importorskip("tracklens", reason="the wheel of tracklens is not installed")
    run, evaluation = tmp_path / "run", tmp_path / "evaluation.json"
    objects = [{"name": "eef", "error": 0.2, "threshold": 0.1, "tracked": False}]
    report = {"schema": "tracklens/evaluation/3", "tc": 0.0, "transform": "affine"}
    evaluation.write_text(json.dumps({**report, "objects": objects}))
    options = [f"--checkpoint={CHECKPOINT}", "--size=32"]
    given = [*options, f"--evaluation={evaluation}"]
    assert train_rl.main(arguments(run, *given, state="keypoints", steps=20)) == 0
    assert train_rl.main(arguments(run, *options, "--resume", state="keypoints", steps=40)) == 0
    encoder = json.loads((run / "config.json").read_text())["encoder"]
    assert encoder["path"] == str(CHECKPOINT) and encoder["architecture"]
    kept = {"name": "eef", "error": 0.2, "threshold": 0.1}
    assert encoder["evaluation"] == {"tc": 0.0, "transform": "affine", "objects": [kept]}
    evaluation.write_text("{}")
    other = arguments(tmp_path / "other", *given, state="keypoints")
    assert "is no evaluation" in refused(capsys, other, 3)
    assert "belongs to keypoints" in refused(
        capsys, arguments(tmp_path / "other", f"--evaluation={evaluation}"), 2
    )


def test_a_sweep_is_told_the_options(capsys):
    with pytest.raises(SystemExit) as ended:
        train_rl.main(["--options"])
    told = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0 and told["states"] == list(environment.STATES)
    assert told["switches"] == ["processes"]
    assert {"task", "steps", "learning-rate", "meshes"} <= set(told["values"])
    assert not {"state", "out", "checkpoint", "resume", "help"} & set(told["values"])


def test_a_killed_run_goes_on_to_the_log_of_an_uninterrupted_one(tmp_path, whole_run):
    run = tmp_path / "run"
    process = subprocess.Popen(command(run, steps=400))
    wait_for_lines(process, run, 3)
    process.kill()
    process.wait()
    assert train_rl.main(arguments(run, "--resume", steps=400)) == 0
    assert log(run) == log(whole_run)


def test_a_cancelled_run_is_saved_where_it_is_and_goes_on(tmp_path, whole_run):
    run = tmp_path / "run"
    process = subprocess.Popen(command(run, steps=400))
    wait_for_lines(process, run, 1)
    process.send_signal(signal.SIGTERM)
    assert process.wait() == 130
    summary = json.loads((run / "summary.json").read_text())
    assert summary["interrupted"] and 0 < summary["steps"] < 400
    assert train_rl.main(arguments(run, "--resume", steps=400)) == 0
    assert log(run) == log(whole_run)


def test_a_full_disk_is_said_and_loses_nothing(tmp_path, whole_run):
    run = tmp_path / "run"
    assert train_rl.main(arguments(run, steps=40)) == 0
    state = (run / "state.pt").read_bytes()

    def little_space() -> None:
        # A file larger than this cannot be written, as on a full disk: the state is larger, what
        # the simulation loads is smaller.
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    full = subprocess.run(
        command(run, "--resume", steps=400),
        check=False,
        preexec_fn=little_space,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert full.returncode == 1
    assert "cannot write" in full.stderr and "File too large" in full.stderr
    assert "Traceback" not in full.stderr
    assert (run / "state.pt").read_bytes() == state
    assert not list(run.glob(".tracklens-*"))
    assert train_rl.main(arguments(run, "--resume", steps=400)) == 0
    assert log(run) == log(whole_run)


def test_environments_in_processes_give_the_same_log(tmp_path, whole_run):
    run = tmp_path / "run"
    assert train_rl.main(arguments(run, "--processes", steps=40)) == 0
    assert log(run) == log(whole_run)[:2]


def test_a_complete_run_is_left_alone_and_can_be_given_more_steps(tmp_path, whole_run):
    run = tmp_path / "run"
    shutil.copytree(whole_run, run)
    state = (run / "state.pt").read_bytes()
    assert train_rl.main(arguments(run, "--resume", steps=400)) == 0
    assert (run / "state.pt").read_bytes() == state
    assert train_rl.main(arguments(run, "--resume", steps=420)) == 0
    assert len(log(run)) == 21


def test_a_folder_that_exists_is_refused_without_resume(whole_run, capsys):
    assert "--resume" in refused(capsys, arguments(whole_run), 1)


def test_a_run_of_other_settings_is_refused(whole_run, capsys):
    said = refused(capsys, arguments(whole_run, "--resume", "--seed=1"), 4)
    assert "seed was 0 and is 1 now" in said


@pytest.mark.parametrize("seed", [0, 1])
def test_a_replay_buffer_of_another_run_is_refused(tmp_path, whole_run, capsys, seed):
    run = tmp_path / "run"
    assert train_rl.main(arguments(run, f"--seed={seed}", steps=40)) == 0
    shutil.copy(whole_run / "state.pt", run / "state.pt")
    # With the seed of the other run only the log tells them apart, by its times.
    code, words = [(3, "does not belong to"), (4, "is of another run: seed was 0 and is 1")][seed]
    said = refused(capsys, arguments(run, "--resume", f"--seed={seed}"), code)
    assert words in said and "state.pt" in said


def test_a_damaged_state_is_refused(tmp_path, whole_run, capsys):
    run = tmp_path / "run"
    shutil.copytree(whole_run, run)
    state = run / "state.pt"
    content = bytearray(state.read_bytes())
    content[len(content) // 2] ^= 1
    state.write_bytes(content)
    assert "damaged" in refused(capsys, arguments(run, "--resume", steps=420), 3)
    state.write_bytes(content[: len(content) // 2])
    assert "damaged" in refused(capsys, arguments(run, "--resume", steps=420), 3)


def test_a_run_without_its_state_is_refused(tmp_path, whole_run, capsys):
    run = tmp_path / "run"
    shutil.copytree(whole_run, run)
    (run / "state.pt").unlink()
    before = (run / "log.jsonl").read_bytes()
    assert "state.pt is missing" in refused(capsys, arguments(run, "--resume", steps=420), 3)
    assert (run / "log.jsonl").read_bytes() == before


def test_two_processes_do_not_work_on_one_run(tmp_path, capsys):
    run = tmp_path / "run"
    process = subprocess.Popen(command(run, steps=20_000))
    wait_for_lines(process, run, 1)
    said = refused(capsys, arguments(run, "--resume", steps=20_000), 1)
    process.kill()
    process.wait()
    assert "another process works on" in said


@pytest.mark.parametrize(
    ("options", "state", "words"),
    [
        ([], "keypoints", "needs an encoder: --checkpoint"),
        (["--checkpoint=x.safetensors"], "full", "--checkpoint belongs to keypoints"),
        (["--size=64"], "points", "--size belongs to keypoints"),
        (["--evaluate-every=15"], "points", "--evaluate-every 15 is not a multiple of the 2"),
        (["--steps=61"], "points", "--steps 61 is not a multiple of the 2"),
    ],
)
def test_options_that_do_not_go_together_are_refused(tmp_path, capsys, options, state, words):
    run = tmp_path / "run"
    assert words in refused(capsys, arguments(run, *options, state=state), 2)
    assert not run.exists()


def test_a_checkpoint_that_is_none_is_refused(tmp_path, capsys):
    missing = f"--checkpoint={tmp_path / 'none.safetensors'}"
    said = refused(capsys, arguments(tmp_path / "run", missing, state="keypoints"), 1)
    assert "none.safetensors" in said
    folder = f"--checkpoint={tmp_path}"
    assert "is no file" in refused(
        capsys, arguments(tmp_path / "run", folder, state="keypoints"), 1
    )
    pytest.importorskip("tracklens", reason="the wheel of tracklens is not installed")
    text = tmp_path / "text.safetensors"
    text.write_text("no weights")
    said = refused(
        capsys, arguments(tmp_path / "run", f"--checkpoint={text}", state="keypoints"), 3
    )
    assert "text.safetensors" in said


def test_an_episode_depends_on_its_seed_and_actions_alone():
    scenario = environment.Scenario("push", "dense", "full", 100, 64, "simple")
    fresh, used = (environment.PandaTask(scenario) for _ in range(2))
    actions = np.random.default_rng(0).uniform(-1, 1, (200, 3)).astype(np.float32)
    used.reset(seed=1)
    for action in actions[:100]:
        used.step(action)
    episodes = []
    for one in (fresh, used):
        one.reset(seed=2)
        episodes.append(np.array([one.step(action)[0] for action in actions[100:]]))
    assert np.array_equal(*episodes)


def test_an_episode_never_starts_solved_and_is_cut_off_at_the_limit():
    scenario = environment.Scenario("push", "sparse", "full", 3, 64, "simple")
    task = environment.PandaTask(scenario)
    task.reset(seed=0)
    for _ in range(50):
        observation, _ = task.reset()
        cube, goal = observation[6:9], observation[18:21]
        assert np.linalg.norm(cube - goal) >= 0.05
    ends = [task.step(np.zeros(3, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_reach_is_solved_where_the_end_effector_is_at_the_plate():
    scenario = environment.Scenario("reach", "sparse", "full", 100, 64, "simple")
    task = environment.PandaTask(scenario)
    observation, _ = task.reset(seed=0)
    for _ in range(100):
        toward = observation[18:21] - observation[:3]
        observation, reward, solved, _, info = task.step(np.clip(20 * toward, -1, 1))
        if solved:
            break
        assert reward == -1
    assert info["is_success"] and reward == 0
    assert np.linalg.norm(observation[:3] - observation[18:21]) < 0.05


def test_the_points_are_where_the_recorder_sees_them():
    scenario = environment.Scenario("push", "sparse", "points", 100, 64, "simple")
    task = environment.PandaTask(scenario)
    observation, _ = task.reset(seed=0)
    recorded = dict(zip(SITES, task.scene.sites(), strict=True))
    points = observation.reshape(5, 2)
    for row, name in [(0, "cube"), (1, "target"), (4, "eef")]:
        assert np.array_equal(points[row], recorded[name])


def test_states_hold_no_code(tmp_path, whole_run):
    tensors = torch.load(whole_run / "state.pt", weights_only=True)
    assert len(tensors["replay"]["actions"]) == 25


def test_the_notebook_runs(monkeypatch):
    tracklens = pytest.importorskip("tracklens", reason="the wheel of tracklens is not installed")
    docs = TOOL.parents[1] / "docs"
    monkeypatch.chdir(docs)
    notebook = json.loads((docs / "rl.ipynb").read_text(encoding="utf-8"))
    names: dict = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), "rl.ipynb", "exec"), names)
    assert isinstance(names["evaluation"], tracklens.Evaluation)
    assert names["evaluation"].objects["cube"]["tracked"]
    assert names["venv"].observation_space.shape == (2 * names["encoder"].keypoints + 6,)
