//! Points and frames that are in memory, against the same in a recording.

use std::io::Cursor;

use ndarray::{Array3, Array4, Axis, s};
use tracklens::data::{
    AxisOrder, Flip, Frame, FrameSource, FramesInMemory, NpzWriter, PointSequences, Space,
    TableOptions, parse_npz_ground_truth, parse_npz_keypoints,
};
use tracklens::error::Reason;

/// S x T x N x 2.
fn points() -> Array4<f64> {
    let mut points = Array4::from_shape_fn((3, 5, 4, 2), |(s, t, n, axis)| {
        (s * 41 + t * 7 + n * 3 + axis) as f64 / 100.0
    });
    points[[1, 2, 3, 0]] = f64::NAN;
    points[[2, 4, 0, 0]] = 0.0;
    points[[2, 4, 0, 1]] = 0.0;
    points
}

fn recording(points: &Array4<f64>) -> Vec<u8> {
    let mut writer = NpzWriter::new(Cursor::new(Vec::new()));
    let values = points.iter().copied();
    writer
        .floats("keypoints", points.shape(), values)
        .expect("written");
    writer.finish().expect("a file").into_inner()
}

fn in_memory(points: &Array4<f64>, options: &TableOptions) -> tracklens::Result<PointSequences> {
    let sequences: Vec<_> = points.outer_iter().collect();
    PointSequences::new("keypoints", &sequences, None, options)
}

/// Whether two arrays are the same to the bit.
fn bits(points: &Array3<f64>) -> Vec<u64> {
    points.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn points_in_memory_are_read_as_those_of_a_recording() {
    let points = points();
    let file = recording(&points);
    let pixels = TableOptions {
        space: Some(Space::Pixels),
        image_size: Some([64, 48]),
        ..TableOptions::default()
    };
    let turned = TableOptions {
        axes: Some(AxisOrder::Yx),
        flip: Some(Flip::Y),
        zero_is_missing: Some(true),
        ..TableOptions::default()
    };
    for options in [TableOptions::default(), pixels, turned] {
        let expected = parse_npz_keypoints(&file, "file", &options).expect("keypoints");
        let found = in_memory(&points, &options).and_then(PointSequences::into_keypoints);
        let found = found.expect("keypoints");
        assert_eq!(found.content.keys(), expected.content.keys());
        assert_eq!(
            bits(found.content.points()),
            bits(expected.content.points())
        );
        assert_eq!(found.reading, expected.reading);
        let expected = parse_npz_ground_truth(&file, "file", &options).expect("a ground truth");
        let found = in_memory(&points, &options).and_then(|found| found.into_truth(None));
        let found = found.expect("a ground truth");
        assert_eq!(found.content.names(), expected.content.names());
        assert_eq!(
            bits(found.content.points_ndc()),
            bits(expected.content.points_ndc())
        );
    }
}

#[test]
fn sequences_in_memory_may_differ_in_length() {
    let points = points();
    let parts = [
        points.slice(s![0, ..3, .., ..]),
        points.slice(s![1, .., .., ..]),
        points.slice(s![2, ..1, .., ..]),
    ];
    let confidence = parts.map(|part| part.index_axis_move(Axis(2), 0));
    let options = TableOptions::default();
    let found = PointSequences::new("keypoints", &parts, Some(&confidence), &options)
        .and_then(PointSequences::into_keypoints)
        .expect("keypoints")
        .content;
    let numbers: Vec<u64> = found.keys().iter().map(|key| key.frame).collect();
    assert_eq!(numbers, [0, 1, 2, 0, 1, 2, 3, 4, 0]);
    assert_eq!(found.keys()[8].sequence, "seq_0002");
    assert_eq!(found.frame(8), points.slice(s![2, 0, .., ..]));
    let sure = found.confidence().expect("confidences");
    assert_eq!(sure.row(4), points.slice(s![1, 1, .., 0]));
}

#[test]
fn wrong_shapes_name_the_axis() {
    let error = |shapes: &[(usize, usize, usize)]| {
        let arrays: Vec<_> = shapes.iter().map(|shape| Array3::zeros(*shape)).collect();
        let views: Vec<_> = arrays.iter().map(|array| array.view()).collect();
        let options = TableOptions::default();
        let found = PointSequences::new("truth", &views, None, &options);
        found.err().expect("an error").to_string()
    };
    assert!(error(&[]).contains("no sequence"));
    assert!(error(&[(2, 3, 4)]).contains("sequence 0: the last axis has 4"));
    assert!(error(&[(2, 3, 2), (0, 3, 2)]).contains("sequence 1: the axis of frames is empty"));
    assert!(error(&[(2, 0, 2)]).contains("the axis of points is empty"));
    assert!(error(&[(2, 3, 2), (2, 4, 2)]).contains("sequence 1: the axis of points has 4"));
    let pixels = TableOptions {
        space: Some(Space::Pixels),
        ..TableOptions::default()
    };
    let unknown = in_memory(&points(), &pixels).err().expect("an error");
    assert_eq!(unknown.reason(), Some(&Reason::MissingImageSize));
}

#[test]
fn an_infinite_position_is_named_in_the_sequence_it_is_in() {
    let mut points = points();
    points[[2, 1, 3, 1]] = f64::INFINITY;
    let found = in_memory(&points, &TableOptions::default()).and_then(|p| p.into_truth(None));
    let message = found.expect_err("an error").to_string();
    assert!(
        message.contains("point 3 is inf in sequence 2, frame 1"),
        "{message}"
    );
}

#[test]
fn frames_in_memory_have_the_numbers_they_are_given() {
    let frame = |value| Frame::new(16, 16, vec![value; 16 * 16 * 3]).expect("a frame");
    let source = FramesInMemory::new(64, vec![frame(1), frame(2)]);
    let numbers: Vec<u64> = source.index().keys().iter().map(|key| key.frame).collect();
    assert_eq!(numbers, [64, 65]);
    assert_eq!(source.read(1).expect("a frame"), frame(2));
}
