"""Scoring of arrays."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias

from numpy.typing import ArrayLike

from . import _tracklens
from ._tracklens import Evaluation

Space: TypeAlias = Literal["ndc", "px", "fraction"]
AxisOrder: TypeAlias = Literal["xy", "yx"]
Flip: TypeAlias = Literal["none", "x", "y", "xy"]


def score(
    keypoints: ArrayLike | Sequence[ArrayLike],
    truth: ArrayLike | Sequence[ArrayLike],
    *,
    names: Sequence[str] | None = None,
    objects: Sequence[str] | None = None,
    confidence: ArrayLike | Sequence[ArrayLike] | None = None,
    truth_confidence: ArrayLike | Sequence[ArrayLike] | None = None,
    image_size: tuple[int, int] | None = None,
    camera: Mapping[str, Any] | None = None,
    xy_only: bool = False,
    transform: Literal["affine", "scale-translate", "identity"] = "affine",
    rank: Literal["reference", "centred"] | None = None,
    thresholds: Mapping[str, float] | None = None,
    non_finite: Literal["exclude-point", "exclude-frame", "error"] = "exclude-point",
    min_confidence: float | None = None,
    truth_min_confidence: float | None = None,
    confidence_levels: Sequence[float] = (),
    shift_frames: int = 0,
    shift_sequences: int = 0,
    rare_keypoints: bool = False,
    folds: int | None = None,
    bootstrap: int | None = None,
    resampling_seed: int = 0,
    sequences: bool = False,
    context: bool = False,
    temporal: bool = False,
    strict: bool = False,
    space: Space | None = None,
    axis_order: AxisOrder | None = None,
    flip: Flip | None = None,
    zero_is_missing: bool = False,
    keypoints_space: Space | None = None,
    keypoints_axis_order: AxisOrder | None = None,
    keypoints_flip: Flip | None = None,
    keypoints_zero_is_missing: bool = False,
) -> Evaluation:
    """Says how well keypoints track objects, as the command `tracklens score` does.

    A time-invariant map is fitted from every keypoint to every object; the tracking error is the
    mean squared distance that is left, and the tracking capability (TC) the share of objects whose
    best keypoint stays below a threshold.

    `keypoints` are S sequences of T frames with N keypoints (x, y): an array `[S, T, N, 2]`,
    `[T, N, 2]` of one sequence, or a list with an array `[T, N, 2]` a sequence where they differ in
    length; NaN where one is missing. `truth` has the same sequences and frames with K objects,
    `[S, T, K, 2]` and so on; NaN where an object is not visible. The numbers are floats or
    integers, in ndc unless `space` says otherwise: x to the right, y down, -1 and +1 at the outer
    edges of the image.

    Points in space have a third number, z, in any unit: of the keypoints, of the objects, or of
    both (docs/metrics.md, "Three dimensions"). Errors are then in the unit of the truth, squared.

    The options are those of the command, whose help explains them:

    - `names`: of the K objects; `point_0`, `point_1`, … without them. `objects`: only these, in
      this order.
    - `confidence`, `truth_confidence`: how sure each point is, `[S, T, N]`, `[S, T, K]` or lists as
      above; `min_confidence`, `truth_min_confidence`: what is less sure counts as missing;
      `confidence_levels`: where the TC is also given.
    - `image_size`: width and height in pixels, for positions and errors in pixels.
    - `camera`: puts a truth in space into its image, where it is scored; `image_size`,
      `intrinsics`, `rotation`, `translation` and `distortion` as in the JSON of `--camera`
      (docs/formats.md), as lists. `xy_only`: leave z out.
    - `transform`, `rank`, `non_finite`, `rare_keypoints`: how maps are fitted, and on what. `rank`
      is by default "reference", and "centred" of keypoints in space.
    - `thresholds`: by the name of the object; by default cube 0.015, target 0.015, eef 0.1, others
      0.015.
    - `folds`: of the sequences for held-out errors, 0 for none; `bootstrap`: resamples for 95 %
      intervals; `resampling_seed`: of both.
    - `sequences`: also the errors by sequence; `context`: also other metrics; `temporal`: also
      measures of the best keypoints over time.
    - `shift_frames`, `shift_sequences`: added to the numbers of the ground truth.
    - `strict`: raise when the TC is unknown because there are not enough data.
    - `space`, `axis_order`, `flip`, `zero_is_missing`: how `truth` is read; with `keypoints_`
      before them, how `keypoints` are. `keypoints_axis_order` is `axis_order` by default.

    Sequences and frames are counted from 0 in both arrays and matched by these numbers; what finds
    no partner is counted in the warnings of the evaluation.

    Raises `InputError` where an array or an option is not what it should be (the axis is named),
    `TypeError` where an array does not hold numbers, `MismatchError` where the arrays do not fit
    each other, and `NumericError` where the numbers allow no answer.
    """
    options = {
        "names": None if names is None else list(names),
        "objects": None if objects is None else list(objects),
        "image_size": image_size,
        "camera": None if camera is None else json.dumps(camera),
        "xy_only": xy_only,
        "transform": transform,
        "rank": rank,
        "thresholds": dict(thresholds or {}),
        "non_finite": non_finite,
        "min_confidence": min_confidence,
        "truth_min_confidence": truth_min_confidence,
        "confidence_levels": list(confidence_levels),
        "shift_frames": shift_frames,
        "shift_sequences": shift_sequences,
        "rare_keypoints": rare_keypoints,
        "folds": folds,
        "bootstrap": bootstrap,
        "resampling_seed": resampling_seed,
        "sequences": sequences,
        "context": context,
        "temporal": temporal,
        "strict": strict,
        "truth_reading": {
            "space": space,
            "axis_order": axis_order,
            "flip": flip,
            "zero_is_missing": zero_is_missing,
        },
        "keypoints_reading": {
            "space": keypoints_space,
            "axis_order": keypoints_axis_order or axis_order,
            "flip": keypoints_flip,
            "zero_is_missing": keypoints_zero_is_missing,
        },
    }
    return _tracklens.score(keypoints, truth, confidence, truth_confidence, options)
