//! Tables of every layout hold the same points.

use ndarray::Array3;
use tracklens::data::{
    AxisOrder, FrameIndex, Ground, Space, TableOptions, ground_truth_csv, join, keypoints_csv,
    parse_ground_truth, parse_keypoints,
};
use tracklens::intake::{Role, classify};
use tracklens::track::GroundTruth;

const SIZE: [u32; 2] = [200, 100];

/// The positions of two objects in one frame; none: hidden.
type Objects = [Option<[f64; 2]>; 2];

/// Two objects in two frames of two sequences, in pixels of 200 x 100 images; the second object is
/// hidden once.
const POINTS: [(&str, u64, Objects); 4] = [
    ("left", 0, [Some([0.0, 0.0]), Some([199.0, 99.0])]),
    ("left", 7, [Some([12.5, 40.0]), None]),
    ("right", 0, [Some([100.0, 3.25]), Some([50.0, 50.0])]),
    ("right", 1, [Some([99.0, 98.0]), Some([51.0, 52.0])]),
];

fn ndc(point: [f64; 2]) -> [f64; 2] {
    [
        (2.0 * point[0] + 1.0) / 200.0 - 1.0,
        (2.0 * point[1] + 1.0) / 100.0 - 1.0,
    ]
}

fn expected() -> Array3<f64> {
    let mut points = Array3::from_elem((4, 2, 2), f64::NAN);
    for (t, (_, _, objects)) in POINTS.iter().enumerate() {
        for (k, object) in objects.iter().enumerate() {
            if let Some(point) = object {
                let [x, y] = ndc(*point);
                points[[t, k, 0]] = x;
                points[[t, k, 1]] = y;
            }
        }
    }
    points
}

#[track_caller]
fn assert_same(found: &GroundTruth, names: [&str; 2]) {
    let keys: Vec<(&str, u64)> = found
        .keys()
        .iter()
        .map(|k| (k.sequence.as_str(), k.frame))
        .collect();
    let wanted: Vec<(&str, u64)> = POINTS.iter().map(|(s, t, _)| (*s, *t)).collect();
    assert_eq!(keys, wanted);
    assert_eq!(found.names(), names);
    for (a, b) in found.points_ndc().iter().zip(&expected()) {
        assert!(
            a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(),
            "{a} {b}"
        );
    }
}

fn in_pixels() -> TableOptions {
    TableOptions {
        image_size: Some(SIZE),
        ..TableOptions::default()
    }
}

fn cell(point: Option<[f64; 2]>, axis: usize) -> String {
    point.map(|p| p[axis].to_string()).unwrap_or_default()
}

fn wide() -> String {
    let mut text = "sequence,frame,cube_x,cube_y,note,eef_x,eef_y\n".to_owned();
    for (sequence, frame, [cube, eef]) in POINTS {
        let [cx, cy, ex, ey] = [cell(cube, 0), cell(cube, 1), cell(eef, 0), cell(eef, 1)];
        text += &format!("{sequence},{frame},{cx},{cy},?,{ex},{ey}\n");
    }
    text
}

/// DeepLabCut's labels; the path of the image in one field or in three.
fn labels(three_fields: bool) -> String {
    let (index, pad, separator) = if three_fields {
        (",,", ",,", ",")
    } else {
        ("", "", "/")
    };
    let mut text = format!(
        "scorer{index},me,me,me,me\nbodyparts{pad},cube,cube,eef,eef\ncoords{pad},x,y,x,y\n"
    );
    for (sequence, frame, [cube, eef]) in POINTS {
        let [cx, cy, ex, ey] = [cell(cube, 0), cell(cube, 1), cell(eef, 0), cell(eef, 1)];
        text += &format!(
            "labeled-data{separator}{sequence}{separator}img{frame:04}.png,{cx},{cy},{ex},{ey}\n"
        );
    }
    text
}

fn coco() -> String {
    let mut images = Vec::new();
    let mut annotations = Vec::new();
    for (i, (sequence, frame, objects)) in POINTS.iter().enumerate() {
        images.push(serde_json::json!({
            "id": 10 + i, "file_name": format!("{sequence}/frame_{frame}.png"), "width": SIZE[0], "height": SIZE[1],
        }));
        let mut keypoints = Vec::new();
        for object in objects {
            let [x, y] = object.unwrap_or_default();
            keypoints.extend([x, y, if object.is_some() { 2.0 } else { 0.0 }]);
        }
        annotations.push(serde_json::json!({
            "id": i, "image_id": 10 + i, "category_id": 1, "keypoints": keypoints, "num_keypoints": 2,
        }));
    }
    let categories = serde_json::json!([{ "id": 1, "name": "scene", "keypoints": ["cube", "eef"], "skeleton": [] }]);
    serde_json::json!({ "images": images, "annotations": annotations, "categories": categories })
        .to_string()
}

#[test]
fn every_layout_holds_the_same_points() {
    let tidy: String = POINTS
        .iter()
        .flat_map(|(sequence, frame, objects)| {
            ["cube", "eef"].iter().zip(objects).map(move |(name, p)| {
                format!(
                    "{sequence},{frame},{name},{},{}\n",
                    cell(*p, 0),
                    cell(*p, 1)
                )
            })
        })
        .collect();
    let tidy = format!("sequence,frame,object,x,y\n{tidy}");
    let px = TableOptions {
        space: Some(Space::Pixels),
        ..in_pixels()
    };
    for (text, options) in [
        (tidy, px),
        (wide(), px),
        (labels(false), in_pixels()),
        (labels(true), in_pixels()),
        (coco(), TableOptions::default()),
    ] {
        let table = parse_ground_truth(text.as_bytes(), "t", &options)
            .unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_same(&table.content, ["cube", "eef"]);
        let track = parse_keypoints(text.as_bytes(), "t", &options);
        match text.starts_with("sequence,frame,object") {
            true => assert!(
                track
                    .expect_err("no keypoints")
                    .to_string()
                    .contains("are the two tables swapped?")
            ),
            false => assert_eq!(track.expect("keypoints").content.keypoints(), 2),
        }
    }
}

#[test]
fn axes_and_counting_can_be_given() {
    let text = "frame,a_x,a_y\n1,0.25,0.5\n2,-0.5,0.75\n";
    let options = TableOptions {
        axes: Some(AxisOrder::Yx),
        index_base: Some(1),
        ..TableOptions::default()
    };
    let table = parse_ground_truth(text.as_bytes(), "folder/seq_3.csv", &options).expect("a table");
    let keys: Vec<String> = table
        .content
        .keys()
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(keys, ["sequence seq_3, frame 0", "sequence seq_3, frame 1"]);
    assert_eq!(table.content.points_ndc()[[0, 0, 0]], 0.5);
    assert!(
        table
            .notices
            .iter()
            .any(|n| n.text.contains("all rows are taken for one, `seq_3`"))
    );
    let from_one = "sequence,frame,keypoint,x,y\n0,1,1,0,0\n0,1,2,0,0\n";
    assert_eq!(
        parse_keypoints(from_one.as_bytes(), "t", &options)
            .expect("a table")
            .content
            .keypoints(),
        2
    );
    let zero =
        parse_keypoints(b"frame,a_x,a_y\n0,0,0\n", "t", &options).expect_err("before the first");
    assert!(
        zero.to_string()
            .contains("line 2: the frame 0; expected frames from 1"),
        "{zero}"
    );
}

#[test]
fn an_analysis_of_deeplabcut_is_read() {
    let name = "videos/push3DLC_resnet50_pushAug1shuffle1_50000.csv";
    let one = "scorer,DLC,DLC,DLC,DLC,DLC,DLC\nbodyparts,cube,cube,cube,eef,eef,eef\ncoords,x,y,likelihood,x,y,likelihood\n\
               0,0,0,0.9,199,99,0.1\n1.0,1,1,0.9,2,2,0.2\n";
    let track = parse_keypoints(one.as_bytes(), name, &in_pixels()).expect("a table");
    assert_eq!(
        track.content.keys()[1].to_string(),
        "sequence push3, frame 1"
    );
    assert_eq!(track.content.points()[[0, 1, 0]], ndc([199.0, 99.0])[0]);
    assert!(
        track.notices.iter().all(|n| !n.text.contains("ignored")),
        "the likelihoods are read"
    );
    let confidence = track.content.confidence().expect("likelihoods");
    assert_eq!(confidence.as_slice(), Some(&[0.9, 0.1, 0.9, 0.2][..]));
    assert!(
        track
            .notices
            .iter()
            .any(|n| n.text.contains("keypoint 0 is `cube`, keypoint 1 is `eef`"))
    );

    let several = "scorer,s,s,s,s,s,s\nindividuals,a,a,b,b,single,single\nbodyparts,tip,tip,tip,tip,box,box\n\
                   coords,x,y,x,y,x,y\nlabeled-data/v/img01.png,1,1,2,2,3,3\n";
    let truth = parse_ground_truth(several.as_bytes(), "t", &in_pixels()).expect("a table");
    assert_eq!(truth.content.names(), ["a/tip", "b/tip", "box"]);
}

#[test]
fn several_instances_need_to_be_told_apart() {
    let file = |tracks: [&str; 2]| {
        let annotation = |track: &str| {
            format!("{{\"image_id\":1,\"category_id\":1,{track}\"keypoints\":[1,1,2]}}")
        };
        format!(
            "{{\"images\":[{{\"id\":1,\"file_name\":\"3.png\",\"width\":9,\"height\":9}}],\
             \"annotations\":[{},{}],\"categories\":[{{\"id\":1,\"name\":\"p\",\"keypoints\":[\"nose\"]}}]}}",
            annotation(tracks[0]),
            annotation(tracks[1])
        )
    };
    // An empty track is none, as when a spreadsheet or a script had nothing to write.
    for untold in [["", ""], ["\"track_id\":\"\",", "\"track_id\":\" \","]] {
        let error = parse_ground_truth(file(untold).as_bytes(), "c.json", &TableOptions::default());
        let error = error.expect_err("two of one").to_string();
        assert!(
            error.contains("c.json: annotation 1: its image has annotation 0")
                && error.contains("track_id"),
            "{error}"
        );
    }
    let told = file(["\"track_id\":4,", "\"track_id\":\"b\","]);
    let table =
        parse_ground_truth(told.as_bytes(), "c.json", &TableOptions::default()).expect("a table");
    assert_eq!(table.content.names(), ["4/nose", "b/nose"]);
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let message = |text: &str, options: &TableOptions| {
        let error = parse_ground_truth(text.as_bytes(), "t", options).expect_err(text);
        error.to_string()
    };
    let none = TableOptions::default();
    for (text, parts) in [
        (
            labels(false),
            &[
                "the positions are in pixels (as always in this layout)",
                "the size of the images is not known",
            ][..],
        ),
        (
            "a_x,a_y\n0,0\n".to_owned(),
            &["line 1: column `frame` missing"],
        ),
        (
            "frame,a_x,a_y\n0,0,zero\n".to_owned(),
            &["line 2, column `a_y`: `zero` is not a number"],
        ),
        (
            "frame,a_x,a_y\n0,0\n".to_owned(),
            &["line 2: 2 fields; expected 3"],
        ),
        (
            "frame,a_x,a_y,a_x\n0,0,0,0\n".to_owned(),
            &["column `a_x` stands twice"],
        ),
        ("frame,a_x,a_y\n".to_owned(), &["no rows"]),
        (
            "frame,a_x,a_y\n0,0,0\n0,1,1\n".to_owned(),
            &["line 3", "is already in line 2"],
        ),
        (
            "scorer,a,a\nbodyparts,b,b\n".to_owned(),
            &["no row `coords`"],
        ),
        (
            "scorer,a,a\nbodyparts,b,b\nbones,x,y\n".to_owned(),
            &["line 3: the row begins with `bones`"],
        ),
        (
            "scorer,a\nbodyparts,b\ncoords,x\n0,1\n".to_owned(),
            &["`b` has one coordinate"],
        ),
        (
            "scorer,a,a\nbodyparts,b,b\ncoords,x,y\nfirst,1,1\n".to_owned(),
            &["line 4", "`first` is neither a frame"],
        ),
        (
            "{\"images\": []}".to_owned(),
            &["not COCO keypoints", "annotations"],
        ),
        (
            "{\"images\": [], \"annotations\": []}".to_owned(),
            &["no annotation has keypoints"],
        ),
        (
            coco().replace("\"image_id\":11", "\"image_id\":77"),
            &["annotation 1: there is no image with the id 77"],
        ),
        (
            coco().replace("frame_7.png", "frame.png"),
            &["annotation 1: its image `left/frame.png` has no number"],
        ),
    ] {
        let told = message(&text, &none);
        for part in parts {
            assert!(told.contains(part), "{text}: {told}");
        }
    }
}

#[test]
fn tables_are_recognised() {
    let role = |path: &str, text: &str| classify(path, text.as_bytes()).role;
    assert_eq!(role("wide.csv", &wide()), Role::GroundTruth);
    assert_eq!(role("labels.csv", &labels(true)), Role::GroundTruth);
    assert_eq!(role("person_keypoints.json", &coco()), Role::GroundTruth);
    assert_eq!(role("package.json", "{\"name\": 1}"), Role::Unknown);
    let schema = |name: &str| format!("{{\"schema\": \"tracklens/{name}\"}}");
    assert_eq!(role("result.json", &schema("evaluation/9")), Role::Result);
    assert_eq!(role("report.json", &schema("report/1")), Role::Unknown);
    assert_eq!(role("other.csv", "time,temperature\n0,1\n"), Role::Unknown);
}

#[test]
fn what_the_numbers_are_taken_for_is_told_with_its_ground() {
    let wide = "frame,a_x,a_y\n1,0.25,0.5\n";
    let read = |options: &TableOptions| {
        parse_ground_truth(wide.as_bytes(), "t.csv", options)
            .expect("a table")
            .reading
    };
    let guessed = read(&TableOptions::default());
    assert_eq!(
        (guessed.space.value, guessed.space.by),
        (Space::Ndc, Ground::Guess)
    );
    assert_eq!(
        (guessed.index_base.value, guessed.index_base.by),
        (0, Ground::Guess)
    );
    assert_eq!(
        (guessed.axes.value, guessed.axes.by),
        (AxisOrder::Xy, Ground::File)
    );
    let said = read(&TableOptions {
        space: Some(Space::Pixels),
        axes: Some(AxisOrder::Yx),
        index_base: Some(1),
        image_size: Some([20, 10]),
        ..TableOptions::default()
    });
    assert_eq!(
        (said.space.value, said.space.by),
        (Space::Pixels, Ground::Said)
    );
    assert_eq!(
        (said.axes.value, said.axes.by),
        (AxisOrder::Yx, Ground::Said)
    );
    assert_eq!(
        (said.index_base.value, said.index_base.by),
        (1, Ground::Said)
    );
    let coco =
        parse_ground_truth(coco().as_bytes(), "c.json", &TableOptions::default()).expect("a table");
    assert_eq!(
        (coco.reading.space.value, coco.reading.space.by),
        (Space::Pixels, Ground::File)
    );
}

#[test]
fn two_annotations_that_become_the_same_frame_are_an_error_that_names_both() {
    let file = "{\"images\":[{\"id\":1,\"file_name\":\"camA/rec/000.png\",\"width\":9,\"height\":9},\
                {\"id\":2,\"file_name\":\"camB/rec/000.png\",\"width\":9,\"height\":9}],\
                \"annotations\":[{\"image_id\":1,\"category_id\":1,\"keypoints\":[1,1,2]},\
                {\"image_id\":2,\"category_id\":1,\"keypoints\":[5,5,2]}],\
                \"categories\":[{\"id\":1,\"name\":\"p\",\"keypoints\":[\"nose\"]}]}";
    let error = parse_ground_truth(file.as_bytes(), "c.json", &TableOptions::default())
        .expect_err("two positions of one point")
        .to_string();
    assert!(
        error.contains("c.json: annotation 1: ") && error.contains("is already in annotation 0"),
        "{error}"
    );
}

#[test]
fn a_table_with_hardly_any_positions_is_refused_before_it_takes_memory() {
    // Every row has a frame and an object of its own: 4 million positions, 2000 of them given.
    let row = |i: usize| format!("a,{i},object_{i},0.5,0.5\n");
    let text = format!(
        "sequence,frame,object,x,y\n{}",
        (0..2000).map(row).collect::<String>()
    );
    let error = parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default())
        .expect_err("a sparse table")
        .to_string();
    assert!(
        error.contains("2000 rows name 2000 points in 2000 frames"),
        "{error}"
    );
}

#[test]
fn a_name_is_the_same_however_its_letters_are_composed() {
    let parse = |sequence: &str, object: &str| {
        let text = format!("sequence,frame,object,x,y\n{sequence},0,{object},0.5,0.5\n");
        parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default()).expect("a table")
    };
    let typed = parse("H\u{f6}hle", "T\u{fc}r");
    let from_mac = parse("Ho\u{308}hle", "Tu\u{308}r");
    assert_eq!(typed.content, from_mac.content);
    let frames = FrameIndex::new(&["Ho\u{308}hle/0.png"]).expect("frames");
    let joined = join(frames.keys(), typed.content.keys()).expect("a join");
    assert_eq!(joined.pairs, [(0, 0)]);
}

#[test]
fn control_characters_do_not_reach_a_terminal() {
    let text = "sequence,frame,object,x,y\na,0,\u{1b}]0;title\u{7}cube,0.5,0.5\n";
    let table =
        parse_ground_truth(text.as_bytes(), "gt.csv", &TableOptions::default()).expect("a table");
    assert_eq!(
        table.content.names(),
        ["\u{fffd}]0;title\u{fffd}cube".to_owned()]
    );
    let text = "sequence,frame,object,x,y,\u{1b}[31m\na,0,cube,0.5,\u{1b}[31m,0\n";
    let error = parse_ground_truth(text.as_bytes(), "\u{1b}gt.csv", &TableOptions::default())
        .expect_err("no number")
        .to_string();
    assert!(!error.contains('\u{1b}'), "{error:?}");
}

#[test]
fn names_that_a_spreadsheet_would_run_are_written_as_text_and_read_back() {
    let names = ["=1+1", "@cmd", "+a", "-b", "'=c", "'d", "-1.5"];
    let rows = names.map(|name| format!("\"{name}\",0,{name},0.5,0.5\n"));
    let text = format!("sequence,frame,object,x,y\n{}", rows.concat());
    let parse = |text: &str| {
        let table = parse_ground_truth(text.as_bytes(), "t", &TableOptions::default());
        table.expect("a table").content
    };
    let written = ground_truth_csv(&parse(&text));
    for field in written.lines().skip(1).flat_map(|line| line.split(',')) {
        let runs = field.starts_with(['=', '+', '-', '@']) && field.parse::<f64>().is_err();
        assert!(!runs, "{written}");
    }
    assert_eq!(ground_truth_csv(&parse(&written)), written);
    assert!(
        written.contains("'=1+1") && written.contains("-1.5,0"),
        "{written}"
    );
}

#[test]
fn every_layout_says_how_sure_its_points_are() {
    let tidy = "sequence,frame,keypoint,x,y,Likelihood\na,0,0,5,6,0.9\na,0,1,7,8,0.1\na,1,0,1,2,\na,1,1,3,4,1\n";
    let wide = "frame,p.x,p.y,p.score,q.x,q.y,q.score\n0,5,6,0.9,7,8,0.1\n1,1,2,,3,4,1\n";
    let deeplabcut = "scorer,s,s,s,s,s,s\nbodyparts,p,p,p,q,q,q\ncoords,x,y,likelihood,x,y,likelihood\n\
                      0,5,6,0.9,7,8,0.1\n1,1,2,NaN,3,4,1\n";
    let coco = "{\"images\":[{\"id\":1,\"file_name\":\"a/0.png\"},{\"id\":2,\"file_name\":\"a/1.png\"}],\
                \"annotations\":[{\"image_id\":1,\"keypoints\":[5,6,0.9,7,8,0.1]},\
                {\"image_id\":2,\"keypoints\":[1,2,null,3,4,1]}]}";
    let options = TableOptions {
        space: Some(Space::Pixels),
        image_size: Some(SIZE),
        ..TableOptions::default()
    };
    let expected = [0.9, 0.1, f64::NAN, 1.0].map(f64::to_bits);
    for text in [tidy, wide, deeplabcut, coco] {
        let table = parse_keypoints(text.as_bytes(), "a.csv", &options).expect(text);
        let found = table
            .content
            .confidence()
            .unwrap_or_else(|| panic!("{text}"));
        let bits: Vec<u64> = found.iter().map(|c| c.to_bits()).collect();
        assert_eq!(bits, expected, "{text}");
        assert_eq!(
            table.content.points()[[1, 0, 0]],
            ndc([1.0, 2.0])[0],
            "{text}"
        );
        // As is what is written of them.
        let written = keypoints_csv(&table.content);
        let again = parse_keypoints(written.as_bytes(), "b.csv", &TableOptions::default());
        assert_eq!(keypoints_csv(&again.expect("a table").content), written);
    }
    let truth = coco.replace("0.1", "1").replace("0.9", "0");
    let truth = parse_ground_truth(truth.as_bytes(), "t.json", &options).expect("a table");
    assert!(
        truth.content.points_ndc()[[0, 0, 0]].is_nan(),
        "v = 0 is not labelled"
    );
    assert_eq!(truth.content.confidence().expect("v")[[0, 1]], 1.0);
    let select = truth.content.select(&["1".to_owned()]).expect("an object");
    assert_eq!(select.confidence().expect("v").dim(), (2, 1));
}

#[test]
fn a_confidence_that_says_nothing_is_not_used() {
    let rows = |confidence: &str| {
        let rows = (0..3).map(|t| format!("a,{t},0,0,0,{confidence}\n"));
        let text = format!(
            "sequence,frame,keypoint,x,y,confidence\n{}",
            rows.collect::<String>()
        );
        parse_keypoints(text.as_bytes(), "a.csv", &TableOptions::default()).expect("a table")
    };
    let zero = rows("0");
    assert!(zero.content.confidence().is_none());
    let told = |part: &str| zero.notices.iter().any(|n| n.text.contains(part));
    assert!(told("the confidence is 0 throughout, and is not used"));
    assert!(told(
        "3 points lie at exactly (0, 0) with the least confidence"
    ));
    assert!(rows("").content.confidence().is_none());
    assert!(rows("0.5").content.confidence().is_some());
    let text = "sequence,frame,object,x,y,visible\na,0,c,1,1,True\na,1,c,0,0,false\n";
    let hidden = parse_ground_truth(text.as_bytes(), "a.csv", &TableOptions::default());
    let hidden = hidden.expect("a table").content;
    assert_eq!(hidden.points_ndc()[[0, 0, 0]], 1.0);
    assert!(
        hidden.points_ndc()[[1, 0, 0]].is_nan(),
        "what is not visible is hidden"
    );
}
