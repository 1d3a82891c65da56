"""`Encoder` against the command, the authors' modules, and what is wrong with frames."""

import copy
import json
import multiprocessing
import pickle
import threading
import time
import warnings

import numpy as np
import pytest
import tracklens
from conftest import CHECKPOINTS, GOLDEN, REPOSITORY, SIZED, TINY, tensors
from tracklens import Encoder

ONNX = REPOSITORY / "tests" / "data" / "onnx"


def noise(rng, frames=5, height=48, width=64):
    return rng.integers(0, 256, (frames, height, width, 3), np.uint8)


@pytest.mark.parametrize("checkpoint", CHECKPOINTS, ids=lambda path: path.name)
@pytest.mark.parametrize("threads", [1, 3])
def test_keypoints_are_those_of_the_terminal_bit_for_bit(
    terminal, tmp_path, rng, checkpoint, threads
):
    encoder = Encoder(checkpoint, threads=threads)
    frames = noise(rng)
    for given in (frames, (frames / 255).astype(np.float32), frames / 255):
        found = encoder(given)
        assert found.shape == (5, encoder.keypoints, 2) and found.dtype == np.float32
        expected = terminal.extract(checkpoint, given, tmp_path)
        # f64 of the table holds every float32.
        np.testing.assert_array_equal(found.astype(np.float64), expected)


@pytest.mark.parametrize("name", ["basic-vel-std-bg-tiny", "dsae-tiny", "keynet-vel-std-bg-tiny"])
def test_keypoints_are_those_of_the_authors_modules(name):
    golden = tensors(GOLDEN / f"{name}.safetensors")
    frames = golden["golden.input64"].transpose(0, 2, 3, 1)
    found = Encoder(GOLDEN / f"{name}.safetensors")(frames)
    # As tests/library/engine.rs: two float32 implementations add the same products in another
    # order, and the peaky attention maps magnify it.
    expected = golden["golden.keypoints64"][..., ::-1]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4)


def test_frames_of_another_size_are_resized_as_in_training_and_it_is_said_once(
    terminal, tmp_path, rng
):
    encoder = Encoder(SIZED)
    assert encoder.input_size == (64, 64)
    frames = noise(rng, 3, 90, 120)
    with pytest.warns(UserWarning, match="120 x 90 pixels and are resized to 64 x 64") as said:
        found = encoder(frames)
    assert "as in training" in str(said[0].message) and str(SIZED) in str(said[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = encoder(frames)
    np.testing.assert_array_equal(found, again)
    np.testing.assert_array_equal(found, terminal.extract(SIZED, frames, tmp_path))


def test_frames_may_lie_in_memory_in_any_way(rng):
    encoder = Encoder(TINY)
    frames = noise(rng)
    expected = encoder(frames)
    mirrored = np.ascontiguousarray(frames[:, :, ::-1])[:, :, ::-1]
    fortran = np.asfortranarray(frames)
    planes = np.ascontiguousarray(frames.transpose(0, 3, 1, 2)).transpose(0, 2, 3, 1)
    for same in (mirrored, fortran, planes, list(frames)):
        np.testing.assert_array_equal(encoder(same), expected)


def test_no_frames_have_no_keypoints():
    assert Encoder(TINY)(np.zeros((0, 32, 32, 3), np.uint8)).shape == (0, 4, 2)


def test_more_frames_than_a_block_come_in_order(rng):
    encoder = Encoder(TINY)
    frames = noise(rng, 150, 16, 16)
    found = encoder(frames)
    np.testing.assert_array_equal(found[-3:], encoder(frames[-3:]))


@pytest.mark.parametrize(
    ("frames", "error", "message"),
    [
        (np.zeros((2, 32, 32, 4), np.uint8), ValueError, r"axis 3 \(channels\) has 4; expected 3"),
        (np.zeros((2, 3, 32, 32), np.uint8), ValueError, r"frames.transpose\(0, 2, 3, 1\)"),
        (np.zeros((2, 8, 32, 3), np.uint8), ValueError, r"axis 1 \(height\) has 8 pixels"),
        (np.zeros((2, 32, 9000, 3), np.uint8), ValueError, r"axis 2 \(width\) has 9000 pixels"),
        (np.zeros((32, 32, 3), np.uint8), ValueError, r"3 axes; .*single frame is frames\[None\]"),
        (np.zeros((32,), np.uint8), ValueError, r"shape \[32\], 1 axes"),
        (np.zeros((2, 32, 32, 3), np.int64), TypeError, "dtype int64; expected .* uint8"),
        (np.zeros((2, 32, 32, 3), bool), TypeError, "dtype bool"),
        ([np.zeros((32, 32, 3)), np.zeros((16, 32, 3))], ValueError, "cannot be made an array"),
        (None, ValueError, "axes"),
    ],
)
def test_wrong_shapes_and_types_are_named(frames, error, message):
    with pytest.raises(error, match=message):
        Encoder(TINY)(frames)


@pytest.mark.parametrize("value", [1.5, -0.2, np.nan, np.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_floats_outside_0_to_1_are_named_with_frame_and_pixel(value, dtype):
    frames = np.zeros((3, 32, 40, 3), dtype)
    frames[2, 5, 7, 1] = value
    with pytest.raises(
        tracklens.InputError, match=r"frame 2: .* of pixel \(7, 5\) is not within 0 to 1"
    ):
        Encoder(TINY)(frames)


def test_frames_too_small_for_the_encoder_are_refused_as_by_the_terminal(terminal, tmp_path):
    frames = np.zeros((1, 16, 16, 3), np.uint8)
    np.savez(tmp_path / "frames.npz", frames=frames)
    dsae = GOLDEN / "dsae-tiny.safetensors"
    arguments = ["--checkpoint", dsae, "--frames", tmp_path / "frames.npz", "--out", "-"]
    message = terminal.error("extract", "--quiet", *arguments)
    with pytest.raises(tracklens.InputError) as raised:
        Encoder(dsae)(frames)
    assert str(raised.value) in message


def test_a_file_that_is_no_checkpoint_is_refused_with_the_text_of_the_terminal(terminal, tmp_path):
    missing, text = tmp_path / "missing.pth", tmp_path / "text.safetensors"
    text.write_text("no weights")
    np.savez(tmp_path / "frames.npz", frames=np.zeros((1, 32, 32, 3), np.uint8))
    for path, error in ((missing, OSError), (text, ValueError)):
        with pytest.raises(error) as raised:
            Encoder(path)
        assert isinstance(raised.value, tracklens.TracklensError)
        arguments = ["--checkpoint", path, "--frames", tmp_path / "frames.npz", "--out", "-"]
        assert str(raised.value) in terminal.error("extract", *arguments)


def test_options_that_do_not_fit_are_refused():
    with pytest.raises(tracklens.MismatchError, match="settings"):
        Encoder(TINY, settings={"output": "points"})
    with pytest.raises(tracklens.InputError, match="threads is 0"):
        Encoder(TINY, threads=0)
    with pytest.raises(tracklens.TracklensError, match="ema"):
        Encoder(TINY, key="ema")


def test_any_detector_runs_as_an_onnx_model(terminal, tmp_path, rng):
    path = tmp_path / "heatmaps.onnx"
    path.write_bytes((ONNX / "heatmaps.onnx").read_bytes())
    settings = json.loads((ONNX / "expected.json").read_text())["heatmaps"]["settings"]
    encoder = Encoder(path, settings=settings)
    assert encoder.space == "ndc" and encoder.architecture is None
    width, height = encoder.input_size
    frames = noise(rng, 3, height, width)
    # What the terminal reads of the settings is a file beside the model, and so can the package.
    (tmp_path / "heatmaps.onnx.json").write_text(json.dumps(settings))
    expected = terminal.extract(path, frames, tmp_path)
    np.testing.assert_array_equal(encoder(frames), expected)
    points, confidences = Encoder(path).with_confidence(frames)
    np.testing.assert_array_equal(points, expected)
    assert confidences.shape == points.shape[:2]


def test_what_a_model_leaves_open_is_asked_for():
    with pytest.raises(tracklens.TracklensError) as raised:
        Encoder(ONNX / "heatmaps.onnx")
    assert raised.value.reason["type"] == "detectorSettings"
    assert "settings=" in raised.value.hint


def test_latent_points_are_placed_in_the_image():
    encoder = Encoder(TINY)
    assert encoder.space == "latent"
    corners = encoder.to_ndc([[-1.0, -1.0], [1.0, 1.0]], (64, 48))
    # The pools pad by one, so the first cell is centred at pixel -3.5; the others follow 8 pixels
    # apart, the last of 9 and of 7 at pixel 60.5 and 44.5.
    assert corners.tolist() == [[-6 / 64 - 1, -6 / 48 - 1], [122 / 64 - 1, 90 / 48 - 1]]
    with pytest.raises(tracklens.InputError, match="expected"):
        encoder.to_ndc(np.zeros((4, 3)), (64, 48))


def test_an_encoder_says_what_it_is():
    encoder = Encoder(TINY, threads=2)
    assert (encoder.keypoints, encoder.threads, encoder.input_size) == (4, 2, None)
    assert encoder.architecture.startswith("basic") and encoder.path == TINY
    assert "basic" in repr(encoder) and "2 threads" in repr(encoder)


def test_copies_open_the_file_again(rng):
    encoder = Encoder(TINY, threads=2)
    frames = noise(rng)
    for copied in (copy.deepcopy(encoder), pickle.loads(pickle.dumps(encoder))):
        assert (copied.path, copied.threads) == (encoder.path, encoder.threads)
        np.testing.assert_array_equal(copied(frames), encoder(frames))


def test_a_forked_process_starts_threads_of_its_own(rng):
    encoder = Encoder(TINY, threads=2)
    frames = noise(rng)
    expected = encoder(frames)
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    with warnings.catch_warnings():
        # Python 3.12 and later warn of forks of processes with threads, which this is about.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = context.Process(target=lambda: queue.put(encoder(frames)))
        child.start()
    child.join(60)
    assert child.exitcode == 0, "the forked process hangs or failed"
    np.testing.assert_array_equal(queue.get(), expected)


def test_other_python_threads_run_while_frames_are_extracted(rng):
    encoder = Encoder(SIZED, threads=1)
    frames = noise(rng, 64, 64, 64)
    counted, done = 0, threading.Event()

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count, daemon=True)
    counter.start()
    before = counted
    encoder(frames)
    during = counted - before
    done.set()
    counter.join()
    # A call that held the GIL would let the other thread run before and after it only.
    assert during > 3
