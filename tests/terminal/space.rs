//! Points with three coordinates by the real binary: tables, arrays, cameras, and what does not fit.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Output;

use serde_json::Value;
use tempfile::TempDir;

use crate::binary::{json, stderr, tracklens_in};

const SEQUENCES: usize = 4;
const FRAMES: usize = 30;

/// Where the cube and the eef are, in metres.
fn at(s: usize, t: usize) -> [[f64; 3]; 2] {
    let i = (s * FRAMES + t) as f64;
    [
        [
            0.5 * (0.9 * i).sin(),
            0.4 * (1.7 * i).cos(),
            0.3 * (0.7 * i).sin(),
        ],
        [
            0.3 * (1.1 * i).cos(),
            0.2 * (0.6 * i).sin(),
            0.4 * (1.9 * i).cos(),
        ],
    ]
}

/// A camera whose image is parallel to x and y, at `-z`.
fn camera(z: f64) -> String {
    format!(
        r#"{{"image_size": [100, 80], "intrinsics": [[90, 0, 49.5], [0, 90, 39.5], [0, 0, 1]],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, {z}]}}"#
    )
}

/// Ground truth in several layouts and without its z, keypoints in space (0 follows the cube, 1 the eef, 2 nothing)
/// and in the image of the camera.
fn tables() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut wide = String::from("sequence,frame,cube_x,cube_y,cube_z,eef_x,eef_y,eef_z\n");
    let mut tidy = String::from("sequence,frame,object,x,y,z\n");
    let mut space = String::from("sequence,frame,keypoint,x,y,z\n");
    let mut image = String::from("sequence,frame,keypoint,x,y\n");
    let mut flat = String::from("sequence,frame,cube_x,cube_y,eef_x,eef_y\n");
    for s in 0..SEQUENCES {
        for t in 0..FRAMES {
            let [cube, eef] = at(s, t);
            let [[a, b, c], [d, e, f]] = [cube, eef];
            let _ = writeln!(wide, "{s},{t},{a},{b},{c},{d},{e},{f}");
            let _ = writeln!(flat, "{s},{t},{a},{b},{d},{e}");
            let _ = writeln!(tidy, "{s},{t},cube,{a},{b},{c}\n{s},{t},eef,{d},{e},{f}");
            let i = (s * FRAMES + t) as f64;
            let _ = writeln!(
                space,
                "{s},{t},0,{},{},{}",
                2.0 * b + 1.0,
                a - c,
                0.5 * c + a
            );
            let _ = writeln!(space, "{s},{t},1,{},{},{}", 7.0 - d, e + f, 3.0 * f);
            let _ = writeln!(
                space,
                "{s},{t},2,{},{},{}",
                (2.3 * i).sin(),
                i.cos(),
                (3.1 * i).sin()
            );
            for (n, [x, y, z]) in [cube, eef].into_iter().enumerate() {
                let [u, v] = [90.0 * x / (z + 2.0) + 49.5, 90.0 * y / (z + 2.0) + 39.5];
                let ndc = [(2.0 * u + 1.0) / 100.0 - 1.0, (2.0 * v + 1.0) / 80.0 - 1.0];
                let _ = writeln!(image, "{s},{t},{n},{},{}", 0.9 * ndc[0], ndc[1] - 0.05);
            }
        }
    }
    for (name, text) in [
        ("wide.csv", wide),
        ("tidy.csv", tidy),
        ("space.csv", space),
        ("image.csv", image),
        ("flat.csv", flat),
        ("camera.json", camera(2.0)),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    folder
}

fn score(folder: &Path, truth: &str, keypoints: &str, more: &[&str]) -> Output {
    let files = ["score", "--truth", truth, "--keypoints", keypoints];
    tracklens_in(folder, &[&files[..], more].concat())
}

fn error_of(found: &Value, k: usize) -> f64 {
    found["objects"][k]["error"].as_f64().expect("an error")
}

#[test]
fn a_table_with_z_is_scored_in_space_whatever_its_layout() {
    let folder = tables();
    let wide = json(&score(folder.path(), "wide.csv", "space.csv", &[]));
    assert_eq!(wide["schema"], "tracklens/evaluation/4");
    assert_eq!(
        wide["dimensions"],
        serde_json::json!({"keypoints": 3, "truth": 3})
    );
    assert_eq!(
        (&wide["rank"], &wide["tc"]),
        (&"centred".into(), &1.0.into())
    );
    for (k, keypoint) in [0, 1].into_iter().enumerate() {
        assert_eq!(wide["objects"][k]["best_keypoint"], keypoint);
        // The map is known: what is left is rounding.
        assert!(error_of(&wide, k) < 1e-12 && wide["objects"][k]["outside"] == 0);
        assert!(wide["objects"][k].get("rmse_px").is_none());
    }
    assert!(
        wide["held_out"]["objects"][0]["error"]
            .as_f64()
            .expect("held out")
            < 1e-12
    );

    let tidy = json(&score(
        folder.path(),
        "tidy.csv",
        "space.csv",
        &["--image-size", "9x9"],
    ));
    let npz = tracklens_in(folder.path(), &["data", "convert", "wide.csv", "truth.npz"]);
    assert!(npz.status.success(), "{}", stderr(&npz));
    let csv = tracklens_in(
        folder.path(),
        &["data", "convert", "truth.npz", "again.csv"],
    );
    assert!(csv.status.success(), "{}", stderr(&csv));
    let arrays = score(
        folder.path(),
        "truth.npz",
        "space.csv",
        &["--shift-sequences", "0"],
    );
    assert!(
        stderr(&arrays).contains("the third number of a point is its z"),
        "{}",
        stderr(&arrays)
    );
    let again = json(&score(folder.path(), "again.csv", "space.csv", &[]));
    for other in [&tidy, &json(&arrays), &again] {
        assert_eq!(other["errors"], wide["errors"]);
    }

    let mut dlc = String::from("scorer,me,me,me,me,me,me\nbodyparts,cube,cube,cube,eef,eef,eef\n");
    dlc += "coords,x,y,z,x,y,z\n";
    let mut anipose = String::from("cube_x,cube_y,cube_z,cube_error,cube_ncams,cube_score,");
    anipose += "eef_x,eef_y,eef_z,eef_error,eef_ncams,eef_score,M_00,fnum\n";
    let mut keypoints = String::from("frame,keypoint,sequence,x,y,z\n");
    for t in 0..FRAMES {
        let [[a, b, c], [d, e, f]] = at(0, t);
        let _ = writeln!(dlc, "{t},{a},{b},{c},{d},{e},{f}");
        let _ = writeln!(
            anipose,
            "{a},{b},{c},0.1,3,0.9,{d},{e},{f},0.1,3,0.9,1.0,{t}"
        );
        let _ = writeln!(keypoints, "{t},0,one,{c},{b},{a}\n{t},1,one,{f},{e},{d}");
    }
    for (name, text) in [
        ("dlc.csv", dlc),
        ("anipose.csv", anipose),
        ("one.csv", keypoints),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    for name in ["dlc.csv", "anipose.csv"] {
        let found = json(&score(folder.path(), name, "one.csv", &[]));
        assert!(
            error_of(&found, 0) < 1e-12 && error_of(&found, 1) < 1e-12,
            "{name}"
        );
        assert_eq!(found["dimensions"]["truth"], 3, "{name}");
    }
}

#[test]
fn two_and_three_coordinates_are_mapped_to_each_other_and_it_is_said() {
    let folder = tables();
    let up = score(folder.path(), "wide.csv", "image.csv", &[]);
    let found = json(&up);
    assert_eq!(
        found["dimensions"],
        serde_json::json!({"keypoints": 2, "truth": 3})
    );
    assert_eq!(found["rank"], "reference");
    let warnings = found["warnings"].to_string();
    assert!(warnings.contains("keypoints have two coordinates and the ground truth three"));
    assert!(warnings.contains("the thresholds of cube, eef are the defaults of an image"));
    assert_eq!(
        found["objects"][0]["map"]["a"][2].as_array().map(Vec::len),
        Some(2)
    );

    let down = json(&score(folder.path(), "flat.csv", "space.csv", &[]));
    assert_eq!(
        down["dimensions"],
        serde_json::json!({"keypoints": 3, "truth": 2})
    );
    assert!(
        down["warnings"]
            .to_string()
            .contains("keypoints have three coordinates")
    );
    assert!(error_of(&down, 0) < 1e-12);

    let page = folder.path().join("page.html");
    let path = page.to_str().expect("a path");
    let shown = score(folder.path(), "wide.csv", "image.csv", &["--report", path]);
    assert!(shown.status.success(), "{}", stderr(&shown));
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.contains("in space, in the squared unit of the ground truth"));
    assert!(page.contains("in the unit of the ground truth.") && page.contains(">z</th>"));
    // x, y and z of two objects over the frames of a sequence.
    let (_, moves) = page.split_once("How it moves").expect("a part of it");
    let (plots, _) = moves
        .split_once("Of each object x, y and z")
        .expect("words");
    assert_eq!(plots.matches("<svg").count(), 6);
}

#[test]
fn x_and_y_alone_are_scored_on_demand_as_if_there_were_no_z() {
    let folder = tables();
    let flat = json(&score(folder.path(), "flat.csv", "image.csv", &[]));
    let output = score(folder.path(), "wide.csv", "image.csv", &["--xy-only"]);
    let without = json(&output);
    assert_eq!(without["schema"], "tracklens/evaluation/3");
    assert_eq!(without["errors"], flat["errors"]);
    assert!(
        stderr(&output).contains("ignored: `cube_z`, `eef_z`"),
        "{}",
        stderr(&output)
    );
    let tidy = score(
        folder.path(),
        "tidy.csv",
        "image.csv",
        &["--xy-only", "--space", "ndc"],
    );
    assert_eq!(json(&tidy)["errors"], flat["errors"]);
    tracklens_in(folder.path(), &["data", "convert", "wide.csv", "truth.npz"]);
    let arrays = score(folder.path(), "truth.npz", "image.csv", &["--xy-only"]);
    assert!(
        stderr(&arrays).contains("z is left out of 2 points"),
        "{}",
        stderr(&arrays)
    );
    assert_eq!(json(&arrays)["errors"], flat["errors"]);
}

#[test]
fn a_camera_puts_the_ground_truth_into_its_image() {
    let folder = tables();
    // The eef moves too little in the image for its default threshold.
    let options = ["--camera", "camera.json", "--threshold", "eef=0.015"];
    let found = json(&score(folder.path(), "wide.csv", "image.csv", &options));
    assert_eq!(found["schema"], "tracklens/evaluation/3");
    assert_eq!(
        found["camera"],
        serde_json::json!({"projected": 240, "behind": 0})
    );
    assert_eq!(
        (&found["tc"], &found["image_size"]),
        (&1.0.into(), &serde_json::json!([100, 80]))
    );
    assert!(error_of(&found, 0) < 1e-12 && error_of(&found, 1) < 1e-12);
    assert!(found["objects"][0]["rmse_px"].is_f64());
    // Without it, the best linear map from the image into space leaves the perspective.
    let space = json(&score(folder.path(), "wide.csv", "image.csv", &[]));
    assert!(error_of(&space, 0) > 1e-4);

    // A camera in the middle of the scene has some of it behind.
    std::fs::write(folder.path().join("inside.json"), camera(0.0)).expect("written");
    let options = ["--camera", "inside.json"];
    let inside = json(&score(folder.path(), "wide.csv", "image.csv", &options));
    let behind = (0..SEQUENCES).flat_map(|s| (0..FRAMES).flat_map(move |t| at(s, t)));
    let behind = behind.filter(|[_, _, z]| *z <= 0.0).count();
    assert_eq!(inside["camera"]["behind"], behind);
    let warning = format!("{behind} of 240 positions lie behind the camera");
    assert!(inside["warnings"].to_string().contains(&warning));
}

#[test]
fn what_does_not_fit_in_space_is_said() {
    let folder = tables();
    let mixed = "frame,cube_x,cube_y,cube_z,eef_x,eef_y\n0,1,2,3,4,5\n1,1,3,3,4,5\n";
    let partly = "sequence,frame,object,x,y,z\n0,0,cube,1,2,3\n0,0,eef,1,2,\n0,1,eef,1,2,\n";
    let infinite = "frame,cube_x,cube_y,cube_z\n0,1,2,3\n1,1,2,inf\n";
    let one = "frame,cube_x,cube_y,cube_z\n0,1,2,3\n1,1,2,\n2,4,2,1\n";
    for (name, text) in [
        ("mixed.csv", mixed),
        ("partly.csv", partly),
        ("infinite.csv", infinite),
        ("one.csv", one),
        ("broken.json", "{\"image_size\": [100, 80]}"),
    ] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    let refused = |truth: &str, keypoints: &str, more: &[&str], message: &str| {
        let output = score(folder.path(), truth, keypoints, more);
        let said = stderr(&output);
        assert!(
            !output.status.success() && said.contains(message),
            "{message}: {said}"
        );
    };
    let two = "`cube` has three coordinates, x, y and z, and `eef` two; expected as many";
    refused("mixed.csv", "space.csv", &[], two);
    refused(
        "partly.csv",
        "space.csv",
        &[],
        "`eef` has x and y and nowhere a z",
    );
    refused("partly.csv", "space.csv", &[], "line 3");
    refused(
        "infinite.csv",
        "space.csv",
        &[],
        "line 3: the z inf is infinite",
    );
    refused(
        "wide.csv",
        "space.csv",
        &["--space", "px"],
        "`px` is a unit of positions in the image",
    );
    refused(
        "flat.csv",
        "image.csv",
        &["--camera", "camera.json"],
        "a camera projects three",
    );
    refused(
        "wide.csv",
        "image.csv",
        &["--camera", "broken.json"],
        "missing field `intrinsics`",
    );
    refused(
        "wide.csv",
        "image.csv",
        &["--camera", "none.json"],
        "none.json",
    );
    let identity = ["--transform", "identity"];
    refused(
        "wide.csv",
        "image.csv",
        &identity,
        "`identity` goes coordinate by coordinate",
    );
    refused(
        "wide.csv",
        "space.csv",
        &["--context"],
        "compare distances with the size of the image",
    );
    refused(
        "wide.csv",
        "space.csv",
        &["--temporal"],
        "compare distances with the size of the image",
    );
    // One position without a z is a position that is missing.
    let found = score(folder.path(), "one.csv", "space.csv", &[]);
    assert!(
        stderr(&found).contains("1 of 3 positions are missing"),
        "{}",
        stderr(&found)
    );
    let coco = tracklens_in(folder.path(), &["data", "convert", "wide.csv", "out.json"]);
    assert!(
        stderr(&coco).contains("COCO needs positions in the image"),
        "{}",
        stderr(&coco)
    );
}
