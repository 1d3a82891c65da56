"""`score` and `Evaluation` against the command and the authors' metric; wrong arrays."""

import json
import pickle

import numpy as np
import pytest
import tracklens
from conftest import GOLDEN, moving
from tracklens import Evaluation, score

METRIC = sorted((GOLDEN / "metric").glob("*.json"))
NAMES = ["cube", "target", "eef"]


def same(evaluation, expected):
    """Whether an evaluation is the JSON of the terminal."""
    assert json.loads(evaluation.to_json()) == expected
    assert evaluation.to_dict() == expected


def test_the_json_is_that_of_the_terminal(terminal, tmp_path, rng):
    keypoints, truth = moving(rng)
    same(score(keypoints, truth), terminal.score(tmp_path, keypoints, truth))


def test_one_sequence_and_float32_are_scored_as_by_the_terminal(terminal, tmp_path, rng):
    keypoints, truth = (array[0].astype(np.float32) for array in moving(rng))
    same(score(keypoints, truth), terminal.score(tmp_path, keypoints, truth))


def test_every_option_means_what_it_means_in_the_terminal(terminal, tmp_path, rng):
    keypoints, truth = moving(rng)
    keypoints[0, 3, 1] = np.nan
    confidence = rng.uniform(0, 1, keypoints.shape[:3])
    truth_confidence = rng.integers(1, 3, truth.shape[:3])
    cases = [
        ({"transform": "identity"}, ["--transform", "identity"]),
        ({"transform": "scale-translate"}, ["--transform", "scale-translate"]),
        ({"rank": "centred"}, ["--rank", "centred"]),
        ({"thresholds": {"cube": 0.5}}, ["--threshold", "cube=0.5"]),
        ({"objects": ["eef", "cube"]}, ["--objects", "eef,cube"]),
        ({"image_size": (200, 100)}, ["--image-size", "200x100"]),
        ({"non_finite": "exclude-frame"}, ["--non-finite", "exclude-frame"]),
        ({"min_confidence": 0.4}, ["--min-confidence", "0.4"]),
        ({"truth_min_confidence": 1.5}, ["--truth-min-confidence", "1.5"]),
        ({"confidence_levels": [0.1, 0.9]}, ["--confidence-levels", "0.1,0.9"]),
        ({"shift_frames": 2}, ["--shift-frames", "2"]),
        ({"shift_sequences": -1}, ["--shift-sequences", "-1"]),
        ({"rare_keypoints": True}, ["--rare-keypoints"]),
        ({"folds": 3, "resampling_seed": 5}, ["--folds", "3", "--resampling-seed", "5"]),
        ({"folds": 0}, ["--folds", "0"]),
        ({"bootstrap": 50}, ["--bootstrap", "50"]),
        ({"sequences": True}, ["--sequences"]),
        ({"context": True}, ["--context"]),
        ({"temporal": True}, ["--temporal"]),
        ({"space": "fraction"}, ["--space", "fraction"]),
        (
            {"space": "px", "image_size": (64, 48), "keypoints_space": "px"},
            ["--space", "px", "--image-size", "64x48", "--keypoints-space", "px"],
        ),
        ({"axis_order": "yx"}, ["--axis-order", "yx"]),
        ({"keypoints_axis_order": "yx"}, ["--keypoints-axis-order", "yx"]),
        ({"flip": "y"}, ["--flip", "y"]),
        ({"keypoints_flip": "xy"}, ["--keypoints-flip", "xy"]),
        ({"zero_is_missing": True}, ["--zero-is-missing"]),
        ({"keypoints_zero_is_missing": True}, ["--keypoints-zero-is-missing"]),
    ]
    for options, arguments in cases:
        sure = truth_sure = None
        if any("confidence" in option for option in options):
            sure, truth_sure = confidence, truth_confidence
        named = {"confidence": sure, "truth_confidence": truth_sure, "names": NAMES, **options}
        evaluation = score(keypoints, truth, **named)
        sides = {"sure": sure, "truth_sure": truth_sure, "names": NAMES}
        expected = terminal.score(tmp_path, keypoints, truth, *arguments, **sides)
        assert evaluation.to_dict() == expected, options


@pytest.mark.parametrize("path", METRIC, ids=lambda path: path.stem)
def test_errors_are_those_of_the_authors_metric(terminal, tmp_path, path):
    case = json.loads(path.read_text())
    keypoints, truth = (points(case, path, name) for name in ("keypoints", "ground_truth"))
    for transform, result in case["transforms"].items():
        if result["error"] is not None:
            continue
        option = transform.replace("_", "-")
        evaluation = score(keypoints, truth, transform=option)
        expected = np.array(result["pairwise"], float)
        # An object with a NaN has no error there; here its frame is left out.
        known = np.isfinite(expected)
        # As tests/library/metric.rs: the authors' float32 differs from float64 by up to 3.4e-7.
        np.testing.assert_allclose(evaluation.errors[known], expected[known], rtol=0, atol=1e-6)
        options = ["--transform", option]
        same(evaluation, terminal.score(tmp_path, keypoints, truth, *options))


def points(case, path, name):
    """The points of a golden case, (x, y), `[T, N, 2]`."""
    count = {"keypoints": case["N"], "ground_truth": case["K"]}[name]
    if name in case:
        array = np.array(case[name], float)
    else:
        array = np.fromfile(path.with_suffix(f".{name}.f32"), "<f4")
    return array.reshape(case["T"], count, 2)[..., ::-1]


def in_space(rng):
    """Keypoints and truth `[S, T, N, 3]`; an affine map takes the first keypoints to the objects."""
    _, truth = moving(rng)
    truth = np.concatenate([truth, rng.uniform(0.5, 2, truth.shape[:3])[..., None]], axis=-1)
    points = rng.uniform(-1, 1, (*truth.shape[:2], 5, 3))
    points[:, :, :3] = truth @ rng.normal(size=(3, 3)).T + 0.3
    return points, truth


def test_points_in_space_are_scored_as_by_the_terminal(terminal, tmp_path, rng):
    keypoints, truth = in_space(rng)
    camera = {
        "image_size": [200, 100],
        "intrinsics": [[150, 0, 100], [0, 150, 50], [0, 0, 1]],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "translation": [0, 0, 1],
    }
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(camera))
    for given, of, options, arguments in [
        (keypoints, truth, {}, []),
        (keypoints[..., :2], truth, {}, []),
        (keypoints, truth[..., :2], {"rank": "reference"}, ["--rank", "reference"]),
        (keypoints, truth, {"xy_only": True}, ["--xy-only"]),
        (keypoints[..., :2], truth, {"camera": camera}, ["--camera", file]),
    ]:
        evaluation = score(given, of, names=NAMES, **options)
        same(evaluation, terminal.score(tmp_path, given, of, *arguments, names=NAMES))
    # What a map of its own leaves is rounding.
    assert np.nanmin(score(keypoints, truth).errors, axis=1) == pytest.approx(0, abs=1e-12)


def test_a_camera_that_is_none_says_what_is_expected(rng):
    keypoints, truth = in_space(rng)
    with pytest.raises(tracklens.InputError, match="`camera`.*expected `image_size`"):
        score(keypoints, truth, camera={"image_size": [2, 2]})
    flat = keypoints[..., :2]
    with pytest.raises(tracklens.InputError, match="sequence 1: the last axis has 2 numbers"):
        score([keypoints[0], flat[1]], [truth[0], truth[1]])


def test_sequences_may_differ_in_length(terminal, tmp_path, rng):
    keypoints, truth = moving(rng)
    lengths = [40, 31, 8, 40, 22, 1]
    ragged = [[a[s, :n] for s, n in enumerate(lengths)] for a in (keypoints, truth)]
    tables = [tmp_path / "keypoints.csv", tmp_path / "truth.csv"]
    for path, sequences, kind in zip(tables, ragged, ("keypoint", "object"), strict=True):
        rows = [f"sequence,frame,{kind},x,y"]
        for s, sequence in enumerate(sequences):
            for t, frame in enumerate(sequence.tolist()):
                names = range(len(frame)) if kind == "keypoint" else NAMES
                named = zip(names, frame, strict=True)
                rows += [f"seq_{s:04},{t},{name},{x!r},{y!r}" for name, (x, y) in named]
        path.write_text("\n".join(rows) + "\n")
    text = terminal.run("score", "--json", "--keypoints", tables[0], "--truth", tables[1])
    expected = json.loads(text)
    del expected["command"]
    same(score(*ragged, names=NAMES), expected)
    same(score(tuple(ragged[0]), ragged[1], names=NAMES), expected)


@pytest.mark.parametrize(
    ("keypoints", "truth", "error", "message"),
    [
        ((5, 4, 4), (5, 2, 2), ValueError, "`keypoints`, sequence 0: the last axis has 4 numbers"),
        (
            (2, 5, 4, 2),
            (2, 5, 2, 1),
            ValueError,
            "`truth`, sequence 0: the last axis has 1 numbers",
        ),
        ((5, 2), (5, 2, 2), ValueError, r"`keypoints` has shape \[5, 2\], 2 axes; expected"),
        ((2, 0, 4, 2), (2, 5, 2, 2), ValueError, "sequence 0: the axis of frames is empty"),
        ((2, 5, 0, 2), (2, 5, 2, 2), ValueError, "sequence 0: the axis of points is empty"),
        ((0, 5, 4, 2), (2, 5, 2, 2), ValueError, "`keypoints` has no sequence"),
    ],
)
def test_wrong_shapes_name_the_axis(keypoints, truth, error, message):
    with pytest.raises(error, match=message):
        score(np.zeros(keypoints), np.zeros(truth))


def test_sequences_that_do_not_fit_together_are_named(rng):
    truth = [np.zeros((4, 2, 2)), np.zeros((5, 2, 2))]
    with pytest.raises(
        tracklens.InputError, match="sequence 1: the axis of points has 3; expected 4"
    ):
        score([np.zeros((4, 4, 2)), np.zeros((5, 3, 2))], truth)
    points = [np.zeros((4, 4, 2)), np.zeros((5, 4, 2))]
    with pytest.raises(tracklens.InputError, match="confidences of `keypoints`, sequence 1"):
        score(points, truth, confidence=[np.zeros((4, 4)), np.zeros((4, 4))])
    with pytest.raises(tracklens.InputError, match="has 2 sequences and the confidences of 1"):
        score(points, truth, confidence=np.zeros((4, 4)))
    with pytest.raises(tracklens.InputError, match="2 objects has 3 names"):
        score(points, truth, names=NAMES)


@pytest.mark.parametrize("dtype", [complex, object, bool, "U3"])
def test_what_holds_no_numbers_is_a_type_error(dtype):
    with pytest.raises(TypeError, match="`keypoints` has dtype .*; expected numbers"):
        score(np.zeros((5, 4, 2)).astype(dtype), np.zeros((5, 2, 2)))


def test_infinite_positions_are_named_by_sequence_and_frame(rng):
    keypoints, truth = moving(rng)
    truth[2, 7, 1, 0] = np.inf
    with pytest.raises(tracklens.InputError, match="point 1 is inf in sequence 2, frame 7"):
        score(keypoints, truth)
    lists = [list(keypoints), [truth[0, :5], truth[1], truth[2], *truth[3:]]]
    with pytest.raises(tracklens.InputError, match="point 1 is inf in sequence 2, frame 7"):
        score(*lists)


def test_errors_have_the_text_of_the_terminal_and_say_what_helps(terminal, tmp_path, rng):
    keypoints, truth = moving(rng)
    np.savez(tmp_path / "truth.npz", keypoints=truth)
    np.savez(tmp_path / "keypoints.npz", keypoints=keypoints)
    files = ["--truth", tmp_path / "truth.npz", "--keypoints", tmp_path / "keypoints.npz"]
    cases = [
        ({"transform": "shear"}, ["--transform", "shear"]),
        ({"thresholds": {"cup": 1.0}}, ["--threshold", "cup=1"]),
        ({"objects": ["cup"]}, ["--objects", "cup"]),
        ({"folds": 99}, ["--folds", "99"]),
        ({"shift_sequences": 50}, ["--shift-sequences", "50"]),
        ({"bootstrap": 0}, ["--bootstrap", "0"]),
    ]
    for options, arguments in cases:
        with pytest.raises(tracklens.TracklensError) as raised:
            score(keypoints, truth, **options)
        assert str(raised.value) in terminal.error("score", *files, *arguments), options
    with pytest.raises(tracklens.InputError) as raised:
        score(keypoints, truth, space="px")
    assert raised.value.reason == {"type": "missingImageSize"}
    assert "image_size=(width, height)" in raised.value.hint


def test_strict_raises_where_the_tc_is_unknown(rng):
    keypoints, truth = moving(rng)
    truth *= 0.01  # So still that any keypoint would pass.
    assert score(keypoints, truth).tc is None
    with pytest.raises(tracklens.NumericError, match="unknown") as raised:
        score(keypoints, truth, strict=True)
    assert isinstance(raised.value, ArithmeticError)


def test_an_evaluation_tells_what_it_found(rng):
    keypoints, truth = moving(rng)
    evaluation = score(keypoints, truth, names=NAMES, sequences=True)
    assert evaluation.names == NAMES and evaluation.frames == 240
    assert evaluation.errors.shape == (3, 5) and evaluation.errors.dtype == np.float64
    cube = evaluation.objects["cube"]
    assert cube["tracked"] and cube["error"] == evaluation.errors[0, cube["best_keypoint"]]
    assert evaluation.tc == evaluation.to_dict()["tc"]
    assert evaluation.to_csv().splitlines()[0].startswith("object,tracked,error")
    assert "tabular" in evaluation.to_latex()
    assert str(evaluation).startswith("Tracking capability") and "TC" in repr(evaluation)
    for again in (
        Evaluation.from_json(evaluation.to_json()),
        pickle.loads(pickle.dumps(evaluation)),
    ):
        assert again.to_dict() == evaluation.to_dict()


def test_a_notebook_shows_the_figures_of_the_report(terminal, tmp_path, rng):
    keypoints, truth = moving(rng)
    evaluation = score(keypoints, truth, names=NAMES, sequences=True)
    figures = evaluation.figures()
    assert list(figures) == ["errors", "capability", *(f"sequences-{name}" for name in NAMES)]
    terminal.score(tmp_path, keypoints, truth, "--figures", tmp_path / "figures", names=NAMES)
    html = evaluation._repr_html_()
    for name, svg in figures.items():
        assert (tmp_path / "figures" / f"{name}.svg").read_text() == svg
        assert svg in html and svg in evaluation.to_html()
    assert html.startswith('<div class="tracklens">') and "<td>cube</td>" in html
    # It changes nothing around it.
    assert "<body" not in html and ":root" not in html


def test_an_evaluation_of_a_newer_version_is_refused_with_the_text_of_the_library():
    with pytest.raises(tracklens.InputError, match="tracklens/evaluation/99"):
        Evaluation.from_json('{"schema": "tracklens/evaluation/99"}')
