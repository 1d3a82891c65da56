"""Makes the files of tests/public/files, and tests/public/expected.json with what each must come to.

Every file is one that people have, in small: written here by pandas, numpy or json as the program
does that writes them, or by hand where that is what people do. The expected errors are computed
from the positions by numpy alone, without the files: the best affine map by least squares, and the
mean squared distance in ndc.

    pip install -r tests/public/requirements.txt && python tests/public/make.py
"""

import io
import json
import pathlib
import pickle
import shutil
import struct
import zipfile
import zlib

import h5py
import numcodecs
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import tables
import zarr

HERE = pathlib.Path(__file__).parent
OUT = HERE / "files"
SIZE = np.array([100, 80])
T = 40
NAMES = ["nose", "tail"]
PX = {"space": "px", "image_size": [100, 80]}
SIZED = {"image_size": [100, 80]}

t = np.arange(T)
# Positions of two points in pixels, T x 2 x 2, of which every digit is written.
TRUTH = np.stack(
    [
        np.stack([50 + 30 * np.sin(0.9 * t), 40 + 25 * np.cos(1.7 * t)], -1),
        np.stack([45 + 28 * np.cos(1.3 * t), 42 + 20 * np.sin(0.5 * t + 1)], -1),
    ],
    1,
).round(4)
rng = np.random.default_rng(0)
# Keypoints of a detector in pixels: they follow the points from a distance, with noise.
KEYPOINTS = (TRUTH * [0.8, 0.9] + [7, -3] + rng.normal(0, 1.5, TRUTH.shape)).round(4)
# The same points in space, in some unit, T x 2 x 3; the page refuses such files.
SPACE = np.dstack([TRUTH / 64, np.stack([np.sin(0.7 * t), np.cos(2.1 * t)], 1)]).round(4)
# Keypoints that see them from elsewhere.
SPACE_KEYPOINTS = (SPACE @ [[2, 1, 0], [-1, 2, 1], [0, 1, 3]] + 4 + rng.normal(0, 0.02, SPACE.shape)).round(4)
HIDDEN = [(3, 0), (9, 1), (20, 0)]


def ndc(px):
    return (2 * px + 1) / SIZE - 1


def raised(points, z):
    return np.dstack([points, np.full(points.shape[:2], z)])


def hidden(points=TRUTH, which=HIDDEN):
    points = points.copy()
    for frame, point in which:
        points[frame, point] = np.nan
    return points


def errors(truth, keypoints):
    """Error of every keypoint for every object: objects x keypoints; None where there is none."""
    out = []
    for x in np.moveaxis(truth, 1, 0):
        row = []
        for z in np.moveaxis(keypoints, 1, 0):
            seen = ~np.isnan(x).any(1) & ~np.isnan(z).any(1)
            if not seen.any():
                row.append(None)
                continue
            design = np.column_stack([z[seen], np.ones(seen.sum())])
            fit = design @ np.linalg.lstsq(design, x[seen], rcond=None)[0]
            row.append(float(((x[seen] - fit) ** 2).sum(1).mean()))
        out.append(row)
    return out


cases = []


def case(name, content, role="truth", options=None, points=None, refused=None, notes=(), objects=NAMES, space=None, beside=None):
    """A file and what it comes to beside the plain table of the other role, or the one `beside`.

    `points` are what it holds, T x P x 2 in pixels, in the order of `objects`; `refused` is a part
    of the message of a file that cannot be read, `notes` are parts of what is told of one that can.
    `refused_by_page` is in the message of the page alone.
    `space` are positions in space in its place, T x P x 3 in the unit of the file.
    """
    data = content if isinstance(content, bytes) else content.encode()
    (OUT / name).write_bytes(data)
    found = {"file": name, "role": role, "options": options or {}, "notes": list(notes)}
    if beside is not None:
        found["beside"] = beside
    if name.endswith(".npz") and beside is not None:
        found["terminal_only"] = True
    if "zstd.parquet" in name:
        found["refused_by_page"] = "packed by Zstandard"
    if refused is not None:
        found["refused"] = refused
    elif space is not None:
        found["errors"] = errors(space, ndc(KEYPOINTS)) if role == "truth" else errors(ndc(TRUTH), space)
        found["axes"] = 3
        if role == "truth":
            found["objects"] = list(objects)
    else:
        points = TRUTH if points is None and role == "truth" else KEYPOINTS if points is None else points
        truth, keypoints = (points, KEYPOINTS) if role == "truth" else (TRUTH, points)
        found["errors"] = errors(ndc(truth), ndc(keypoints))
        if role == "truth":
            found["objects"] = list(objects)
    cases.append(found)


def number(value):
    return "" if np.isnan(value) else repr(float(value))


def tidy(points, column="object", names=NAMES, sequence="vid", missing="", frame=str, tail="", sep=","):
    rows = [sep.join(["sequence", "frame", column, "x", "y"])]
    for i in range(T):
        for p, name in enumerate(names):
            x, y = (missing if np.isnan(v) else repr(float(v)) for v in points[i, p])
            rows.append(sep.join([sequence, frame(i), name, x, y]) + tail)
    return "\n".join(rows) + "\n"


def wide(points, columns="{}_x,{}_y", frame="frame"):
    rows = [",".join([frame] + [columns.format(name, name) for name in NAMES])]
    for i in range(T):
        rows.append(",".join([str(i)] + [number(v) for v in points[i].ravel()]))
    return "\n".join(rows) + "\n"


# Tidy tables.
N = ndc(TRUTH)
case("tidy.csv", tidy(N))
case("tidy-three-d.csv", tidy(N, tail=",0.5").replace("x,y\n", "x,y,z\n", 1), space=raised(N, 0.5))
case("tidy-pixels.csv", tidy(TRUTH), options=PX)
case("tidy-hidden.csv", tidy(ndc(hidden())), points=hidden())
for word in ["None", "null", "NULL", "NaN", "nan", "<NA>", "N/A", "#N/A", "n/a", "NA"]:
    safe = word.replace("<", "lt").replace("/", "-").replace("#", "hash")
    upper = "-upper" if word == "NULL" or word == "NA" else ""
    case(f"tidy-missing-{safe}{upper}.csv", tidy(ndc(hidden()), missing=word), points=hidden())
case("tidy-extra-columns.csv", pd.read_csv(io.StringIO(tidy(N))).assign(note="?", speed=1.5).to_csv(index=False), notes=["`note`", "`speed`"])
case("tidy-index-column.csv", pd.read_csv(io.StringIO(tidy(N))).to_csv(), notes=["ignored"])
case("tidy-reordered.csv", pd.read_csv(io.StringIO(tidy(N)))[["y", "x", "object", "frame", "sequence"]].to_csv(index=False))
case("tidy-upper-case.csv", tidy(N).replace("sequence,frame,object,x,y", "Sequence,Frame,Object,X,Y"))
case("tidy-quoted.csv", pd.read_csv(io.StringIO(tidy(N))).to_csv(index=False, quoting=2))
case("tidy-crlf.csv", tidy(N).replace("\n", "\r\n"))
case("tidy-bom.csv", b"\xef\xbb\xbf" + tidy(N).encode())
case("tidy-tabs.tsv", tidy(N, sep="\t"), notes=["separated by a tab"])
case("tidy-semicolons.csv", tidy(N, sep=";"), notes=["separated by a semicolon"])
case("tidy-excel-sep.csv", "sep=;\n" + tidy(N, sep=";"))
case("tidy-decimal-comma.csv", tidy(N, sep=";").replace(".", ","), notes=["with a decimal comma"])
case("tidy-comment.csv", "# made by a script\n# of 2024\n" + tidy(N), notes=["2 lines before the header begin with #"])
case("tidy-blank-first-lines.csv", "\n\n" + tidy(N))
case("tidy-utf16-le-bom.csv", tidy(N).encode("utf-16"), notes=["UTF-16"])
case("tidy-utf16-le.csv", tidy(N).encode("utf-16-le"), notes=["UTF-16"])
case("tidy-utf16-be-bom.csv", b"\xfe\xff" + tidy(N).encode("utf-16-be"), notes=["UTF-16"])
case("tidy-frame-float.csv", tidy(N, frame=lambda i: f"{i}.0"))
case("tidy-frame-exponent.csv", tidy(N, frame=lambda i: f"{i}e0"))
case("tidy-frame-zeros.csv", tidy(N, frame=lambda i: f"{i:03}"))
case("tidy-frame-image.csv", tidy(N, frame=lambda i: f"frame_{i:03}.png"), notes=["`frame_000.png`"])
case("tidy-frames-from-one.csv", tidy(N, frame=lambda i: str(i + 1)), options={"index_base": 1})
case("tidy-trailing-commas.csv", tidy(N, tail=","), notes=["empty fields behind the last column"])
case("tidy-composed-names.csv", tidy(N, sequence="Ho\u0308hle"))
case("tidy-yx.csv", tidy(N[..., ::-1]), options={"axis_order": "yx"})
table = pd.read_csv(io.StringIO(tidy(ndc(hidden()).clip(-9, 9), missing="0")))
table["visible"] = table.x.ne(0)
case("tidy-visible.csv", table.to_csv(index=False), points=hidden())
for name, rows, why in [
    ("tidy-frame-negative", tidy(N, frame=lambda i: str(i - 1)), "is not a frame"),
    ("tidy-frame-clock", tidy(N, frame=lambda i: f"00:00:{i:02}"), "is not a frame"),
    ("tidy-no-number", tidy(N).replace(repr(float(N[2, 0, 0])), "?"), "`?` is not a number"),
    ("tidy-infinite", tidy(N).replace(repr(float(N[2, 0, 0])), "inf"), "is infinite"),
    ("tidy-too-large", tidy(N).replace(repr(float(N[2, 0, 0])), "1e400"), "is infinite"),
    ("tidy-two-x", tidy(N, tail=",9").replace("x,y\n", "x,y,x\n", 1), "column `x` stands twice"),
    ("tidy-no-y", tidy(N).replace("object,x,y", "object,x,z"), "column `y` missing"),
    ("tidy-no-z", tidy(N, tail=",").replace("x,y\n", "x,y,z\n", 1), "three coordinates"),
    ("tidy-twice", tidy(N) + "vid,0,nose,0,0\n", "is already in line 2"),
    ("tidy-header-only", "sequence,frame,object,x,y\n", "no rows"),
    ("tidy-empty", "", "no header"),
    ("tidy-blank", "\n\n\n", "no header"),
    ("tidy-cut", tidy(N)[:-30], "3 fields; expected 5"),
]:
    case(f"{name}.csv", rows, refused=why)
case("tidy-nul.csv", tidy(N).replace("nose", "no\0se"), refused="not a text file")
case("tidy-latin1.csv", tidy(N, sequence="H\u00f6hle").encode("latin-1"), refused="not valid UTF-8")
case("keypoints.csv", tidy(ndc(KEYPOINTS), "keypoint", ["0", "1"]), role="keypoints")
case("keypoints-pixels.csv", tidy(KEYPOINTS, "keypoint", ["0", "1"]), role="keypoints", options=PX)
case("keypoints-hidden.csv", tidy(ndc(hidden(KEYPOINTS)), "keypoint", ["0", "1"], missing="None"), role="keypoints", points=hidden(KEYPOINTS))
case("keypoints-float-numbers.csv", tidy(ndc(KEYPOINTS), "keypoint", ["0.0", "1.0"]), role="keypoints")

# Wide tables.
case("wide.csv", wide(N))
case("wide-dots.csv", wide(N, "{}.x,{}.y"))
case("wide-dashes.csv", wide(N, "{}-x,{}-y"))
case("wide-upper-case.csv", wide(N, "{}_X,{}_Y"))
case("wide-axis-first.csv", wide(N, "x_{},y_{}"))
case("wide-frame-idx.csv", wide(N, frame="frame_idx"))
case("wide-hidden.csv", wide(ndc(hidden())), points=hidden())
case("wide-pixels.csv", wide(TRUTH), options=PX)
table = pd.read_csv(io.StringIO(wide(N)))
case("wide-other-columns.csv", table.assign(x=1.0, y=2.0, time=0.1).to_csv(index=False), notes=["`x`", "`time`"])
case("wide-frame-float.csv", table.assign(frame=table.frame.astype(float)).to_csv(index=False))
case("wide-scores.csv", table.assign(nose_score=0.9, tail_likelihood=0.8).to_csv(index=False))
case("wide-twice.csv", wide(N).replace("tail_", "nose_"), refused="column `nose_x` stands twice")
case("wide-three-d.csv", table.assign(nose_z=1.0).to_csv(index=False), refused="three coordinates")
columns = {f"{name}_{axis}": SPACE[:, p, a] for p, name in enumerate(NAMES) for a, axis in enumerate("xyz")}
case("wide-space.csv", pd.DataFrame({"frame": t, **columns}).to_csv(index=False), space=SPACE)
rows = [("vid", i, p, *SPACE_KEYPOINTS[i, p]) for i in range(T) for p in range(2)]
columns = ["sequence", "frame", "keypoint", "x", "y", "z"]
case("keypoints-space.csv", pd.DataFrame(rows, columns=columns).to_csv(index=False), role="keypoints", space=SPACE_KEYPOINTS)
case("keypoints-wide.csv", wide(ndc(KEYPOINTS)), role="keypoints", notes=["keypoint 0 is `nose`"])

# Tables that are none of those known, with what says which column is what.
other = pd.read_csv(io.StringIO(tidy(N))).rename(columns={"frame": "t", "object": "label", "x": "px", "y": "py"})
named = {"columns": "x=px,y=py,frame=t,object=label"}
case("other-columns.csv", other.drop(columns="sequence").to_csv(index=False), options=named)
case("other-columns-semicolons.csv", other.assign(x=0.5, frame=7).to_csv(index=False, sep=";", decimal=","), options=named)
case("other-columns-missing.csv", other.to_csv(index=False), options={"columns": "x=u,y=v"}, refused="there is no column `u` for `x`")
other = pd.read_csv(io.StringIO(tidy(ndc(KEYPOINTS), "keypoint", ["0", "1"])))
other = other.rename(columns={"frame": "t", "keypoint": "id", "x": "px", "y": "py"})
case("keypoints-other-columns.csv", other.to_csv(index=False), role="keypoints", options={"columns": "x=px,y=py,frame=t,keypoint=id"})

# DeepLabCut and those who write its tables.
def deeplabcut(points, coords=("x", "y", "likelihood"), extra=None, individuals=None, index=None, scorer="DLC_resnet50"):
    """As pandas writes a table of several header rows."""
    columns, values = [], []
    for p, name in enumerate(NAMES):
        for coord in coords:
            column = {"x": points[:, p, 0], "y": points[:, p, 1], "likelihood": np.full(T, 0.99), "visible": np.full(T, 1)}
            columns.append((scorer, *([individuals[p]] if individuals else []), name, coord))
            values.append(column.get(coord, np.full(T, 0.25)))
    names = ["scorer", *(["individuals"] if individuals else []), "bodyparts", "coords"]
    table = pd.DataFrame(dict(enumerate(values)))
    table.columns = pd.MultiIndex.from_tuples(columns, names=names)
    if extra is not None:
        table[(extra,) + ("",) * (len(names) - 1)] = "train"
    if index is not None:
        table.index = index
    return table


paths = [f"labeled-data/vid/img{i:03}.png" for i in range(T)]
split = pd.MultiIndex.from_tuples([("labeled-data", "vid", f"img{i:03}.png") for i in range(T)])
case("dlc.csv", deeplabcut(TRUTH).to_csv(), options=SIZED)
case("dlc-labels.csv", deeplabcut(hidden(), ("x", "y"), index=paths).to_csv(), options=SIZED, points=hidden())
case("dlc-labels-three-fields.csv", deeplabcut(TRUTH, ("x", "y"), index=split).to_csv(), options=SIZED)
three = deeplabcut(TRUTH, index=split).to_csv().splitlines()
for row in range(3):
    three[row] = three[row].replace(",,,", f",Unnamed: 1_level_{row},Unnamed: 2_level_{row},", 1)
case("dlc-unnamed.csv", "\n".join(three) + "\n", options=SIZED)
case("dlc-no-scorer.csv", deeplabcut(TRUTH).to_csv().replace("scorer,", ",", 1), options=SIZED)
case("dlc-unnamed-scorer.csv", deeplabcut(TRUTH).to_csv().replace("scorer,", "Unnamed: 0,", 1), options=SIZED)
case("dlc-index-name.csv", deeplabcut(TRUTH, index=pd.Index(range(T), name="frame")).to_csv(), options=SIZED)
case("dlc-upper-case.csv", deeplabcut(TRUTH).to_csv().replace("coords,x,y,likelihood,x,y", "coords,X,Y,likelihood,X,Y"), options=SIZED)
case("dlc-float-index.csv", deeplabcut(TRUTH, index=np.arange(T, dtype=float)).to_csv(), options=SIZED)
case("dlc-individuals.csv", deeplabcut(TRUTH, individuals=["a", "b"]).to_csv(), options=SIZED, objects=["a/nose", "b/tail"])
case("dlc-one-individual.csv", deeplabcut(TRUTH, individuals=["single", "single"]).to_csv(), options=SIZED)
seen = deeplabcut(hidden(), ("x", "y", "visible"))
for frame, point in HIDDEN:
    seen.iloc[frame, 3 * point : 3 * point + 3] = 0
case("lightning-pose-visible.csv", seen.to_csv(), options=SIZED, points=hidden())
case("lightning-pose-set.csv", deeplabcut(TRUTH, extra="set").to_csv(), options=SIZED, notes=["ignored"])
unnamed = deeplabcut(TRUTH, extra="set").to_csv().splitlines()
unnamed[1] += "Unnamed: 7_level_1"
unnamed[2] += "Unnamed: 7_level_2"
case("lightning-pose-set-unnamed.csv", "\n".join(unnamed) + "\n", options=SIZED)
eks = ("x", "y", "likelihood", "x_ens_median", "y_ens_median", "x_ens_var", "y_ens_var", "x_posterior_var", "y_posterior_var")
case("eks.csv", deeplabcut(TRUTH, eks).to_csv(), options=SIZED, notes=["`x_ens_median`", "`y_posterior_var`"])
zero = deeplabcut(TRUTH, eks)
zero.loc[:, [c for c in zero.columns if c[-1] == "likelihood"]] = 0.0
case("eks-likelihood-0.csv", zero.to_csv(), options=SIZED, notes=["the confidence is 0 throughout"])
case("moseq-three-d.csv", deeplabcut(TRUTH, ("x", "y", "z")).to_csv(), options=SIZED, space=raised(TRUTH, 0.25))
case("dlc-without-size.csv", deeplabcut(TRUTH).to_csv(), refused="the size of the images is not known")
case("keypoints-dlc.csv", deeplabcut(KEYPOINTS).to_csv(), role="keypoints", options=SIZED)

# SLEAP's analysis, Anipose, MOT.
def sleap(points, track="track_0"):
    table = pd.DataFrame({"track": track, "frame_idx": t, "instance.score": 0.9})
    for p, name in enumerate(NAMES):
        table[f"{name}.x"], table[f"{name}.y"], table[f"{name}.score"] = *points[:, p].T, 0.8
    return table


case("sleap.csv", sleap(TRUTH).to_csv(index=False), options=SIZED)
case("sleap-hidden.csv", sleap(hidden()).to_csv(index=False), options=SIZED, points=hidden())
both = pd.concat([sleap(TRUTH), sleap(TRUTH[:, ::-1], "track_1")]).sort_values(["frame_idx", "track"])
names = [f"track_{i}/{name}" for i in range(2) for name in NAMES]
case("sleap-two-tracks.csv", both.to_csv(index=False), options=SIZED, objects=names, points=np.concatenate([TRUTH, TRUTH[:, ::-1]], 1))
case("keypoints-sleap.csv", sleap(KEYPOINTS).to_csv(index=False), role="keypoints", options=SIZED)
anipose = pd.DataFrame()
for p, name in enumerate(NAMES):
    anipose[f"{name}_x"], anipose[f"{name}_y"] = TRUTH[:, p].T
    anipose[[f"{name}_z", f"{name}_error", f"{name}_ncams", f"{name}_score"]] = [1.0, 0.1, 2, 0.9]
case("anipose.csv", anipose.assign(fnum=t).to_csv(index=False), options=SIZED, space=raised(TRUTH, 1.0))
boxes = [
    f"{i + 1},{p + 1},{float(TRUTH[i, p, 0] - 5)!r},{float(TRUTH[i, p, 1] - 4)!r},10,8,1,-1,-1,-1"
    for i in range(T)
    for p in range(2)
]
case("mot.txt", "\n".join(boxes) + "\n", options={**SIZED, "index_base": 1}, objects=["1", "2"], notes=["centres of the boxes"])

# COCO.
def coco(points, v=2, **changes):
    images = [{"id": i, "file_name": f"vid/img{i:03}.png", "width": 100, "height": 80} for i in range(T)]
    flat = lambda i: [n for p in range(2) for n in ([0, 0, 0] if np.isnan(points[i, p, 0]) else [*map(float, points[i, p]), v])]
    annotations = [{"id": i, "image_id": i, "category_id": 1, "keypoints": flat(i), "num_keypoints": 2} for i in range(T)]
    file = {"images": images, "annotations": annotations, "categories": [{"id": 1, "name": "animal", "keypoints": NAMES}]}
    for key, change in changes.items():
        for i, one in enumerate(file[key]):
            change(i, one)
    return file


def put(key, value):
    return lambda i, one: one.__setitem__(key, value(i, one))


case("coco.json", json.dumps(coco(TRUTH)))
case("coco-hidden.json", json.dumps(coco(hidden())), points=hidden())
case("coco-width-float.json", json.dumps(coco(TRUTH, images=put("width", lambda i, one: 100.0))))
case("coco-width-text.json", json.dumps(coco(TRUTH, images=put("width", lambda i, one: "100"))))
case("coco-id-text.json", json.dumps(coco(TRUTH, annotations=put("image_id", lambda i, one: str(i)))))
case("coco-id-float.json", json.dumps(coco(TRUTH, annotations=put("image_id", lambda i, one: float(i)))))
case("coco-nested.json", json.dumps(coco(TRUTH, annotations=put("keypoints", lambda i, one: [one["keypoints"][:3], one["keypoints"][3:]]))))
case("coco-no-keypoints.json", json.dumps(coco(TRUTH, annotations=lambda i, one: one.update(keypoints=[]) if i == 4 else None)), points=hidden(which=[(4, 0), (4, 1)]))
nothing = lambda value: lambda i, one: one["keypoints"].__setitem__(slice(0, 2), [value] * 2) if i == 4 else None
case("coco-null.json", json.dumps(coco(TRUTH, annotations=nothing(None))), points=hidden(which=[(4, 0)]))
case("coco-nan.json", json.dumps(coco(TRUTH, annotations=nothing(float("nan")))), points=hidden(which=[(4, 0)]))
case("coco-infinity.json", json.dumps(coco(TRUTH, annotations=nothing(float("inf")))), points=hidden(which=[(4, 0)]))
case("coco-category-null.json", json.dumps(coco(TRUTH, categories=put("keypoints", lambda i, one: None))), objects=["0", "1"])
second = coco(TRUTH)
second["annotations"] += [{"id": 100 + i, "image_id": i, "category_id": 1, "keypoints": [0] * 6} for i in range(T)]
case("coco-second-of-zeros.json", json.dumps(second), notes=["that show no keypoint, beside another one"])
tracked = coco(TRUTH, annotations=put("attributes", lambda i, one: {"track_id": 7, "occluded": False}))
others = coco(TRUTH[:, ::-1], annotations=put("attributes", lambda i, one: {"track_id": 8}))
tracked["annotations"] += others["annotations"]
names = [f"{track}/{name}" for track in (7, 8) for name in NAMES]
case("coco-cvat-tracks.json", json.dumps(tracked), objects=names, points=np.concatenate([TRUTH, TRUTH[:, ::-1]], 1))
result = [{"image_id": i, "category_id": 1, "score": 0.9, "keypoints": [*map(float, KEYPOINTS[i, 0]), 0.8, *map(float, KEYPOINTS[i, 1]), 0.7]} for i in range(T)]
case("keypoints-coco-results.json", json.dumps(result), role="keypoints", options=SIZED, notes=["`image_id` is taken for the number of the frame"])
for name, file, why in [
    ("coco-two-of-one", {**coco(TRUTH), "annotations": coco(TRUTH)["annotations"] * 2}, "annotation 40: its image has annotation 0"),
    ("coco-no-image", coco(TRUTH, annotations=put("image_id", lambda i, one: i + 1)), "annotation 39: there is no image with the id 40"),
    ("coco-image-twice", {**coco(TRUTH), "images": coco(TRUTH)["images"] * 2}, "two images have the id 0"),
    ("coco-text", coco(TRUTH, annotations=nothing("1")), "annotation 4:"),
    ("coco-too-large", coco(TRUTH, annotations=nothing(1e308)), "annotation 4:"),
    ("coco-side-0", coco(TRUTH, images=put("width", lambda i, one: 0)), "annotation 0: its image `vid/img000.png` has a side of 0"),
    ("coco-no-number", coco(TRUTH, images=put("file_name", lambda i, one: "img.png")), "annotation 0: its image `img.png` has no number"),
    ("coco-empty", {}, "not COCO keypoints"),
]:
    case(f"{name}.json", json.dumps(file), refused=why)


# numpy.
def npz(**arrays):
    """As np.savez writes it, with the same bytes every time."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


case("points.npz", npz(keypoints=N, names=np.array(NAMES)))
case("points-sequences.npz", npz(keypoints=N[None], names=np.array(NAMES)))
case("points-hidden.npz", npz(keypoints=ndc(hidden()), names=np.array(NAMES)), points=hidden())
case("points-pixels.npz", npz(keypoints=TRUTH, names=np.array(NAMES)), options=PX)
case("points-other-arrays.npz", npz(keypoints=N, names=np.array(NAMES), extra=np.array([{"a": 1}], dtype=object)))
case("points-no-names.npz", npz(keypoints=N), objects=["point_0", "point_1"])
case("points-by-columns.npz", npz(keypoints=np.asfortranarray(N), names=np.array(NAMES)))
case("points-big-endian.npz", npz(keypoints=N.astype(">f8"), names=np.array(NAMES)))
whole = TRUTH.round()
for kind in ["i8", "i4", "u2", "f2"]:
    case(f"points-{kind}.npz", npz(keypoints=whole.astype(kind), names=np.array(NAMES)), options=PX, points=whole)
case("points-pickled-names.npz", npz(keypoints=N, names=np.array(NAMES, dtype=object)), objects=["point_0", "point_1"], notes=["`names`"])
case("points-confidence.npz", npz(keypoints=N, names=np.array(NAMES), confidence=np.full((T, 2), 0.5)))
seen = ~np.isnan(hidden()[..., 0])
tracked = {"options": SIZED, "points": hidden(KEYPOINTS), "role": "keypoints"}
case("cotracker.npz", npz(tracks=KEYPOINTS[None], visibility=seen[None]), **tracked)
case("tapir.npz", npz(tracks=KEYPOINTS.swapaxes(0, 1), visibles=seen.T), **tracked)
shares = (ndc(TRUTH).swapaxes(0, 1) + 1) / 2
case("tap-vid.npz", npz(points=shares, occluded=~seen.T), points=hidden(), objects=["point_0", "point_1"], notes=["shares of the image"])
array = io.BytesIO()
np.save(array, ndc(KEYPOINTS))
case("keypoints.npy", array.getvalue(), role="keypoints")
z_noted = ["`keypoints`: the third number of a point is its z"]
case("points-three-d.npz", npz(keypoints=SPACE), space=SPACE, objects=["point_0", "point_1"], notes=z_noted)
case("keypoints.npz", npz(keypoints=ndc(KEYPOINTS)), role="keypoints")


# SLEAP's analysis as HDF5.
with h5py.File(OUT / "sleap.analysis.h5", "w") as file:
    file["tracks"] = hidden().transpose(2, 1, 0)[None]
    file["node_names"] = [name.encode() for name in NAMES]
    file["track_names"] = [b"track_0"]
    file["point_scores"] = np.full((1, 2, T), 0.9)
case("sleap.analysis.h5", (OUT / "sleap.analysis.h5").read_bytes(), options=SIZED, points=hidden())
with h5py.File(OUT / "keypoints-sleap-two.analysis.h5", "w") as file:
    file["tracks"] = np.stack([KEYPOINTS, KEYPOINTS[:, ::-1]]).transpose(0, 3, 2, 1)
    file["node_names"] = [name.encode() for name in NAMES]
    file["track_names"] = [b"a", b"b"]
case("keypoints-sleap-two.analysis.h5", (OUT / "keypoints-sleap-two.analysis.h5").read_bytes(), role="keypoints", options=SIZED, points=np.concatenate([KEYPOINTS, KEYPOINTS[:, ::-1]], 1))


# DeepLabCut's tables as pandas' to_hdf stores them, in both of its formats, without the time of
# writing, so that the bytes are the same every time.
create_array = tables.File.create_carray
tables.File.create_carray = lambda *at, **given: create_array(*at, **given, track_times=False)


def hdf(name, table, key="df_with_missing", mode="w", **given):
    """Without the index that PyTables makes of a table, which takes 80 kB, and packed."""
    table.to_hdf(OUT / name, key=key, mode=mode, index=False, complib="zlib", complevel=9, **given)
    return (OUT / name).read_bytes()


for kind in ["fixed", "table"]:
    frame = lambda name, table, **given: hdf(f"{name}-{kind}.h5", table, format=kind, **given)
    case(f"dlc-{kind}.h5", frame("dlc", deeplabcut(TRUTH)), options=SIZED)
    labels = deeplabcut(hidden(), ("x", "y"), index=paths)
    case(f"dlc-labels-{kind}.h5", frame("dlc-labels", labels), options=SIZED, points=hidden())
    several = deeplabcut(TRUTH, individuals=["a", "b"])
    case(f"dlc-individuals-{kind}.h5", frame("dlc-individuals", several), options=SIZED, objects=["a/nose", "b/tail"])
    single = TRUTH.astype("f4").astype(float)
    types = deeplabcut(single)
    types = types.astype({column: "f4" for column in types.columns[:3]})
    case(f"dlc-two-types-{kind}.h5", frame("dlc-two-types", types), options=SIZED, points=single)
    plain = pd.read_csv(io.StringIO(wide(N)))
    case(f"pandas-wide-{kind}.h5", frame("pandas-wide", plain, key="points"))
    case(f"keypoints-dlc-{kind}.h5", frame("keypoints-dlc", deeplabcut(KEYPOINTS)), role="keypoints", options=SIZED)
case("dlc-labels-three-fields.h5", hdf("dlc-labels-three-fields.h5", deeplabcut(TRUTH, ("x", "y"), index=split)), options=SIZED)
for key, mode in [("a", "w"), ("b", "a")]:
    two = hdf("pandas-two.h5", pd.read_csv(io.StringIO(wide(N))), key, mode)
case("pandas-two.h5", two, refused="several data frames (`a`, `b`)")


# SLEAP's projects: instances of a person and of the network, with and without tracks.
def slp(name, rows, nodes=NAMES, tracks=(), version=1.2, skeletons=1, videos=("videos/vid.mp4",)):
    """A project of `rows`: video, frame, and its instances as (predicted, track, origin, points)."""
    frames, instances, points, predicted = [], [], [], []
    for video, number, of_frame in rows:
        start = len(instances)
        for is_predicted, track, origin, xy in of_frame:
            into = predicted if is_predicted else points
            first = len(into)
            for x, y in xy:
                seen = not np.isnan(x)
                into.append((x, y, seen, True) + ((0.8,) if is_predicted else ()))
            instances.append((len(instances), is_predicted, len(frames), skeletons - 1, track, origin, 0.9, first, len(into), 0.0))
        frames.append((len(frames), video, number, start, len(instances)))
    point = [("x", "f8"), ("y", "f8"), ("visible", "?"), ("complete", "?")]
    records = {
        "frames": (frames, [("frame_id", "u8"), ("video", "u4"), ("frame_idx", "u8"), ("instance_id_start", "u8"), ("instance_id_end", "u8")]),
        "instances": (
            instances,
            [("instance_id", "i8"), ("instance_type", "u1"), ("frame_id", "u8"), ("skeleton", "u4"), ("track", "i4"), ("from_predicted", "i8")]
            + [("score", "f4"), ("point_id_start", "u8"), ("point_id_end", "u8"), ("tracking_score", "f4")],
        ),
        "points": (points, point),
        "pred_points": (predicted, point + [("score", "f8")]),
    }
    skeleton = {"nodes": [{"id": i} for i in range(len(nodes))], "links": [], "graph": {"name": "Skeleton-0"}}
    about = {"version": "2.0.0", "skeletons": [skeleton] * skeletons, "nodes": [{"name": name, "weight": 1.0} for name in nodes]}
    with h5py.File(OUT / name, "w") as file:
        group = file.create_group("metadata")
        group.attrs["format_id"] = version
        group.attrs["json"] = np.bytes_(json.dumps(about))
        for table, (content, dtype) in records.items():
            file.create_dataset(table, data=np.array(content, dtype=dtype), maxshape=(None,))
        for table, texts in [("tracks_json", [[0, track] for track in tracks]), ("videos_json", [{"backend": {"filename": v}} for v in videos])]:
            data = [np.bytes_(json.dumps(text)) for text in texts]
            file.create_dataset(table, data=data, maxshape=(None,), dtype=h5py.string_dtype())
    return (OUT / name).read_bytes()


one = lambda points, predicted=True, track=-1: [(0, i, [(predicted, track, -1, points[i])]) for i in range(T)]
case("sleap.slp", slp("sleap.slp", one(hidden(), track=0), tracks=["mouse"]), options=SIZED, points=hidden())
case("sleap-labels.slp", slp("sleap-labels.slp", one(TRUTH, predicted=False)), options=SIZED)
# Before version 1.1 of the format the first pixel's centre was at (0.5, 0.5).
case("sleap-old.slp", slp("sleap-old.slp", one(TRUTH + 0.5), version=1.0), options=SIZED)
both = [(0, i, [(True, 0, -1, TRUTH[i]), (True, 1, -1, TRUTH[i, ::-1])]) for i in range(T)]
names = [f"{track}/{name}" for track in "ab" for name in NAMES]
case("sleap-two-tracks.slp", slp("sleap-two-tracks.slp", both, tracks="ab"), options=SIZED, objects=names, points=np.concatenate([TRUTH, TRUTH[:, ::-1]], 1))
# A person set right what the network found: in the first half as its correction, in the second by the track.
network = lambda i: (True, 0 if i >= T // 2 else -1, -1, KEYPOINTS[i])
person = lambda i: (False, 0, 2 * i if i < T // 2 else -1, TRUTH[i])
named = [(0, i, [network(i), person(i)]) for i in range(T)]
case("sleap-corrected.slp", slp("sleap-corrected.slp", named, tracks=["mouse"]), options=SIZED)
untracked = [(v, i, [(True, -1, -1, of[0][3]), (True, -1, -1, of[1][3])]) for v, i, of in both]
case("sleap-untracked.slp", slp("sleap-untracked.slp", untracked), refused="frame 0 shows 2 instances that belong to no track", options=SIZED)
case("sleap-two-skeletons.slp", slp("sleap-two-skeletons.slp", one(TRUTH), skeletons=2), refused="several skeletons", options=SIZED)
case("keypoints-sleap.slp", slp("keypoints-sleap.slp", one(KEYPOINTS)), role="keypoints", options=SIZED)


# Pickles, as TAP-Vid is published and trackers' results are kept.
def tap_vid(points, **given):
    return {"points": ((ndc(points).swapaxes(0, 1) + 1) / 2).astype(given.get("dtype", "f8")), "occluded": np.isnan(hidden()[..., 0]).T}


video = {"video": np.zeros((T, 2, 2, 3), "u1")}
numbered = {"points": hidden(), "objects": ["point_0", "point_1"]}
for protocol in [3, 4, 5]:
    data = pickle.dumps({"vid": {**video, **tap_vid(TRUTH)}}, protocol)
    case(f"tap-vid-{protocol}.pkl", data, **numbered)
case("tap-vid-list.pkl", pickle.dumps([{"video": [b"jpeg"] * T, **tap_vid(TRUTH)}]), **numbered)
case("tap-vid-columns.pkl", pickle.dumps({"vid": {key: np.asfortranarray(value) for key, value in tap_vid(TRUTH).items()}}), **numbered)
shares = tap_vid(TRUTH, dtype="f4")
single = (2 * shares["points"].astype(float) - 1).swapaxes(0, 1)
single = np.where(np.isnan(hidden()), np.nan, ((single + 1) * SIZE - 1) / 2)
case("tap-vid-f4.pkl", pickle.dumps({"vid": shares}), points=single, objects=["point_0", "point_1"])
case("keypoints-cotracker.pkl", pickle.dumps({"tracks": KEYPOINTS[None], "visibility": seen[None]}), **tracked)
case("keypoints-tapir.pkl", pickle.dumps({"vid": {"tracks": KEYPOINTS.swapaxes(0, 1), "visibles": seen.T}}), **tracked)
case("tap-vid-no-points.pkl", pickle.dumps({"vid": video}), refused="no tracks of points among `vid`")
case("tap-vid-cut.pkl", pickle.dumps({"vid": tap_vid(TRUTH)})[:-90], refused="the pickle cannot be read at byte")
case("tap-vid-three-d.pkl", pickle.dumps({"points": np.zeros((2, T, 3)), "occluded": np.zeros((2, T), bool)}), refused="expected [K, T, 2]")


# Robots: episodes of unequal length, whose frames an index tells apart.
LENGTHS = [12, 20, 8]
ENDS = np.cumsum(LENGTHS)
EPISODES = np.split(np.arange(T), ENDS[:-1])
rows = [(s, i - of[0], p, *ndc(KEYPOINTS)[i, p]) for s, of in enumerate(EPISODES) for i in of for p in range(2)]
columns = ["sequence", "frame", "keypoint", "x", "y"]
(OUT / "keypoints-episodes.csv").write_text(pd.DataFrame(rows, columns=columns).to_csv(index=False))
of_episodes = {"beside": "keypoints-episodes.csv", "objects": ["point_0", "point_1"]}


def frames(of, camera=0):
    """RGB of 16 x 16 px: 40 in red and 3 in blue a camera tell it, green the frame of all."""
    red, green, blue = np.full((3, len(of), 16, 16), 40 + camera)
    green[:] = np.asarray(of)[:, None, None] * 5
    blue[:] = 3 * camera + np.arange(16)[:, None] * 8 + np.arange(16)
    return np.stack([red, green, blue], -1).astype("u1")


def robomimic(name, points="keypoints", values=N, cameras=("agentview_image",), only=None):
    """Demonstrations as robomimic has them, each in a group, of which some have points."""
    with h5py.File(OUT / name, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = "{}"
        for number, of in enumerate(EPISODES):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["num_samples"] = len(of)
            demo["actions"] = np.zeros((len(of), 7))
            obs = demo.create_group("obs")
            for camera, key in enumerate(cameras):
                obs.create_dataset(key, data=frames(of, camera), compression="gzip")
            obs["robot0_eef_pos"] = SPACE[of, 0]
            obs["object"] = np.concatenate([SPACE[of, 1], np.ones((len(of), 4))], 1)
            if points is not None and (only is None or number in only):
                obs[points] = values[of]
    return (OUT / name).read_bytes()


case("robomimic.hdf5", robomimic("robomimic.hdf5"), **of_episodes)
case("robomimic-sites.hdf5", robomimic("robomimic-sites.hdf5", "sites", SPACE, cameras=()), space=SPACE, **of_episodes)
two = robomimic("robomimic-two-cameras.hdf5", cameras=("agentview_image", "robot0_eye_in_hand_image"))
case("robomimic-two-cameras.hdf5", two, **of_episodes)
named = {"columns": "gripper=obs/robot0_eef_pos,cube=obs/object[0:3]"}
lowdim = robomimic("robomimic-low-dim.hdf5", None, cameras=())
case("robomimic-low-dim.hdf5", lowdim, options=named, space=SPACE, **{**of_episodes, "objects": ["gripper", "cube"]})
some = robomimic("robomimic-some.hdf5", cameras=(), only=[0, 2])
case("robomimic-some.hdf5", some, refused="`data/demo_1`: there are no points, unlike in other episodes", **of_episodes)
case("episodes.npz", npz(keypoints=N, episode_ends=ENDS, images=frames(np.arange(T))), **of_episodes)
case("episodes-short.npz", npz(keypoints=N, episode_ends=ENDS[:2]), refused="the last episode ends at 32", **of_episodes)
case("episodes-descending.npz", npz(keypoints=N, episode_ends=ENDS[::-1]), refused="`episode_ends`: ", **of_episodes)


# Parquet: tables as pandas and polars write them, and data of LeRobot, with a row a frame.
def parquet(table, **given):
    """As pyarrow writes it, with the same bytes every time; pandas notes its index."""
    out = io.BytesIO()
    table = pa.Table.from_pandas(table) if isinstance(table, pd.DataFrame) else table
    pq.write_table(table, out, **given)
    return out.getvalue()


tidy_table = pd.read_csv(io.StringIO(tidy(N)), dtype={"object": "str"})
wide_table = pd.read_csv(io.StringIO(wide(N)))
case("tidy.parquet", parquet(tidy_table))
for packed in ["none", "gzip", "lz4", "zstd"]:
    case(f"tidy-{packed}.parquet", parquet(tidy_table, compression=packed))
case("tidy-pages-2.parquet", parquet(tidy_table, data_page_version="2.0", data_page_size=256, use_dictionary=False))
case("tidy-delta.parquet", parquet(tidy_table, compression="none", use_dictionary=False, column_encoding={"frame": "DELTA_BINARY_PACKED", "object": "PLAIN", "x": "BYTE_STREAM_SPLIT"}))
case("tidy-text-deltas.parquet", parquet(tidy_table, use_dictionary=False, column_encoding={"object": "DELTA_BYTE_ARRAY"}), refused="column `object`: its texts are stored as deltas")
case("wide.parquet", parquet(wide_table, row_group_size=7))
case("wide-hidden.parquet", parquet(pd.read_csv(io.StringIO(wide(ndc(hidden()))))), points=hidden())
single = ((N.astype("f4").astype(float) + 1) * SIZE - 1) / 2
case("wide-f4.parquet", parquet(pd.read_csv(io.StringIO(wide(N))).astype({f"{name}_{axis}": "f4" for name in NAMES for axis in "xy"})), points=single)
other = tidy_table.rename(columns={"frame": "t", "object": "label", "x": "px", "y": "py"}).drop(columns="sequence")
case("other-columns.parquet", parquet(other), options={"columns": "x=px,y=py,frame=t,object=label"})
seen_table = tidy_table.assign(visible=True)
for frame, point in HIDDEN:
    seen_table.loc[2 * frame + point, "visible"] = False
case("tidy-visible.parquet", parquet(seen_table), points=hidden())
struct_table = pa.Table.from_pandas(tidy_table)
struct_table = struct_table.append_column("camera", pa.array([{"name": "a", "f": [1.0, 2.0]}] * 2 * T))
struct_table = struct_table.append_column("image", pa.array([b"\x89PNG"] * 2 * T))
struct_table = struct_table.append_column("time", pa.array([0] * 2 * T, pa.timestamp("us")))
case("tidy-others.parquet", parquet(struct_table), notes=["left out 3 column(s) that hold neither numbers nor text", "`camera` (of a struct)", "`image` (bytes)", "`time` (a time)"])


def lerobot(name_of_points, points, **given):
    """The frames of all episodes with lists of fixed length, as LeRobot's data/chunk-000/file-000.parquet."""
    flat = pa.array(points.reshape(T, -1).astype("f4").ravel(), pa.float32())
    lists = pa.FixedSizeListArray.from_arrays(flat, points[0].size)
    state = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(2 * T), pa.float32()), 2)
    number = lambda values: pa.array(np.asarray(values), pa.int64())
    return parquet(
        pa.table(
            {
                "observation.state": state,
                name_of_points: lists,
                "action": state,
                "episode_index": number([s for s, of in enumerate(EPISODES) for _ in of]),
                "frame_index": number([i - of[0] for of in EPISODES for i in of]),
                "timestamp": pa.array(t / 10, pa.float32()),
                "next.done": pa.array([i == of[-1] for of in EPISODES for i in of]),
                "index": number(t),
                "task_index": number(0 * t),
            }
        ),
        **given,
    )


def lerobot_episodes():
    """The table of the episodes, as LeRobot's meta/episodes/chunk-000/file-000.parquet: two cameras, one video each."""
    columns = {
        "episode_index": list(range(len(EPISODES))),
        "tasks": [["push"] for _ in EPISODES],
        "length": [len(of) for of in EPISODES],
        "stats/action/mean": [[0.0, 0.0] for _ in EPISODES],
    }
    for camera in ["observation.images.top", "observation.images.wrist"]:
        columns[f"videos/{camera}/chunk_index"] = [0 for _ in EPISODES]
        columns[f"videos/{camera}/file_index"] = [0 for _ in EPISODES]
        columns[f"videos/{camera}/from_timestamp"] = [of[0] / 10 for of in EPISODES]
        columns[f"videos/{camera}/to_timestamp"] = [(of[-1] + 1) / 10 for of in EPISODES]
    return parquet(pa.table(columns))


# Beside the files: what the page needs to find the episodes in a video.
episodes_of = HERE / "lerobot/meta/episodes/chunk-000/file-000.parquet"
episodes_of.parent.mkdir(parents=True, exist_ok=True)
episodes_of.write_bytes(lerobot_episodes())

environment = "observation.environment_state"
of_columns = [f"{name}_{axis}={environment}_{2 * p + a}" for p, name in enumerate(NAMES) for a, axis in enumerate("xy")]
lerobot_noted = {"notes": ["read as LeRobot's data"], "beside": "keypoints-episodes.csv", "points": single}
case("lerobot.parquet", lerobot(environment, N), options={"columns": ",".join(of_columns)}, **lerobot_noted)
one = {"columns": f"x={environment}_0,y={environment}_1"}
case("lerobot.parquet", lerobot(environment, N), options=one, **{**lerobot_noted, "points": single[:, :1]}, objects=["object"])
ragged = pa.table({"frame": pa.array(t), "cube": pa.array([None if i == 3 else [] if i == 9 else [*N[i, 0], None][: 2 + i % 2] for i in range(T)])})
gone = hidden(TRUTH[:, :1], [(3, 0), (9, 0)])
case("lists.parquet", parquet(ragged), options={"columns": "cube_x=cube_0,cube_y=cube_1"}, objects=["cube"], points=gone, notes=["`cube_2`"])
whole = parquet(tidy_table)
case("tidy-cut.parquet", whole[:-20], refused="not a whole Parquet file")
case("no-columns.parquet", parquet(struct_table.select(["camera", "image"])), refused="no column of numbers or text")
keypoint_table = pd.read_csv(io.StringIO(tidy(ndc(KEYPOINTS), "keypoint", ["0", "1"])))
case("keypoints.parquet", parquet(keypoint_table), role="keypoints")


# Zarr, versions 2 and 3, as a ZIP archive: arrays as in the other recordings, and diffusion policy's replay buffers.
def zarr_zip(arrays, version, folder="", **given):
    """A hierarchy of `arrays` by their paths, with the same bytes every time."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for key, value in zarr_files(arrays, version, **given).items():
            archive.writestr(zipfile.ZipInfo(folder + key), value)
    return out.getvalue()


def zarr_files(arrays, version, **given):
    store = zarr.storage.MemoryStore()
    root = zarr.create_group(store, zarr_format=version)
    for path, array in arrays.items():
        options = {"chunks": (16, *array.shape[1:]), **(given if array.ndim > 1 else {})}
        if options.get("shards"):
            options["shards"] = (32, *array.shape[1:])
        root.create_array(path, data=array, **options)
    return {key: value.to_bytes() for key, value in sorted(store._store_dict.items())}


blosc_2 = numcodecs.Blosc(cname="lz4", clevel=5, shuffle=numcodecs.Blosc.SHUFFLE)
packings = {
    "v2-blosc": (2, {"compressors": blosc_2}),
    "v2-zstd": (2, {"compressors": numcodecs.Zstd()}),
    "v2-gzip": (2, {"compressors": numcodecs.GZip()}),
    "v2-zlib": (2, {"compressors": numcodecs.Zlib(), "order": "F"}),
    "v2-plain": (2, {"compressors": None}),
    "v3-zstd": (3, {"compressors": zarr.codecs.ZstdCodec(checksum=True)}),
    "v3-blosc": (3, {"compressors": zarr.codecs.BloscCodec(cname="zstd")}),
    "v3-gzip": (3, {"compressors": zarr.codecs.GzipCodec()}),
    "v3-plain": (3, {"compressors": None, "filters": zarr.codecs.TransposeCodec(order=(1, 0, 2))}),
    "v3-shards": (3, {"shards": True, "compressors": zarr.codecs.ZstdCodec()}),
}
unnamed_points = {"objects": ["point_0", "point_1"]}
for name, (version, given) in packings.items():
    case(f"points-{name}.zarr.zip", zarr_zip({"keypoints": N}, version, **given), **unnamed_points)
    # For the fuzzer the description of an array and its first chunk: an archive has checksums.
    files = zarr_files({"keypoints": N}, version, **given)
    description, chunk = ("keypoints/.zarray", "keypoints/0.0.0") if version == 2 else ("keypoints/zarr.json", "keypoints/c/0/0/0")
    (HERE / f"../../fuzz/seeds/zarr/{name}.chunk").write_bytes(files[description] + b"\0" + files[chunk])
replay = {"data/img": frames(t), "data/keypoint": TRUTH, "data/state": np.concatenate([TRUTH.reshape(T, 4), np.ones((T, 1))], 1), "meta/episode_ends": ENDS}
archive = zarr_zip(replay, 2, "replay.zarr/")
case("replay.zarr.zip", archive, options=PX, **of_episodes)
case("replay.zarr.zip", archive, refused="the unit of `keypoint` is that of its simulator", **of_episodes)
state = {**PX, "columns": "nose=state[0:2],tail=state[2:4]"}
case("replay.zarr.zip", archive, options=state, **{**of_episodes, "objects": NAMES})
floating = zarr_zip({**replay, "data/img": frames(t).astype("f4")}, 3)
case("replay-v3.zarr.zip", floating, options=PX, **of_episodes)
case("keypoints.zarr.zip", zarr_zip({"keypoints": ndc(KEYPOINTS)}, 3), role="keypoints")


def main():
    plain = {"truth": "tidy.csv", "keypoints": "keypoints.csv", "size": SIZE.tolist()}
    text = json.dumps({**plain, "cases": cases}, indent=1)
    (HERE / "expected.json").write_text(text + "\n")
    print(f"{len(cases)} files, {sum('refused' in c for c in cases)} of them refused")


main()
