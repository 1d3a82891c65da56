//! The CPU engine against the authors' modules (`golden/*.safetensors`, computed by them with
//! PyTorch).

use crate::shared::{golden, tensor};
use safetensors::SafeTensors;
use tracklens::checkpoint::Checkpoint;
use tracklens::data::{Filter, Frame, Pixels};
use tracklens::engine::{CpuDecoder, CpuEncoder, Workspace};
use tracklens::extract::{CpuExtractor, Extractor};

/// Two float32 implementations add the same products in another order, and the peaky attention maps
/// magnify it: 1e-5 is measured on the full-size encoder. 1e-4 is 1/80 of a pixel at 256 px.
const TOLERANCE: f32 = 1e-4;

/// The largest difference of the engine's keypoints from the golden ones of the given input.
fn difference(encoder: &CpuEncoder, file: &SafeTensors, input: &str, expected: &str) -> f32 {
    let (shape, pixels) = tensor(file, input);
    let (points_shape, points) = tensor(file, expected);
    let [images, 3, height, width] = shape[..] else {
        panic!("an input of shape {shape:?}")
    };
    assert_eq!(points_shape, [images, encoder.keypoints(), 2]);
    let mut workspace = Workspace::default();
    let mut largest: f32 = 0.0;
    for (image, expected) in pixels
        .chunks_exact(3 * height * width)
        .zip(points.chunks_exact(2 * encoder.keypoints()))
    {
        let ours = encoder
            .run(&mut workspace, image, [width, height])
            .expect("keypoints");
        for (point, expected) in ours.iter().zip(expected.chunks_exact(2)) {
            // The reference speaks (y, x).
            largest = largest
                .max((point[1] - expected[0]).abs())
                .max((point[0] - expected[1]).abs());
        }
    }
    println!("{input}: largest difference {largest:.1e}");
    largest
}

#[test]
fn the_engine_equals_the_reference_on_tiny_encoders() {
    for name in [
        "basic-vel-std-bg-tiny",
        "dsae-tiny",
        "keynet-vel-std-bg-tiny",
    ] {
        let bytes = golden(&format!("{name}.safetensors"));
        let encoder = CpuEncoder::new(&Checkpoint::from_safetensors(&bytes).expect("a checkpoint"))
            .expect("a plan");
        let file = SafeTensors::deserialize(&bytes).expect("safetensors");
        let largest = difference(&encoder, &file, "golden.input64", "golden.keypoints64");
        assert!(largest < TOLERANCE, "{name}");
    }
}

#[test]
fn the_engine_equals_the_reference_on_the_papers_encoders() {
    for name in ["basic", "dsae", "keynet-vel-std-bg"] {
        let Some(bytes) = crate::shared::large_golden(&format!("{name}.safetensors")) else {
            return;
        };
        let encoder = CpuEncoder::new(&Checkpoint::from_safetensors(&bytes).expect("a checkpoint"))
            .expect("a plan");
        let file = SafeTensors::deserialize(&bytes).expect("safetensors");
        for size in ["64", "256"] {
            let (input, keypoints) = (
                format!("golden.input{size}"),
                format!("golden.keypoints{size}"),
            );
            assert!(
                difference(&encoder, &file, &input, &keypoints) < TOLERANCE,
                "{name}"
            );
        }
    }
}

#[test]
fn a_workspace_can_be_used_for_frames_of_any_size_in_any_order() {
    let checkpoint =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    let encoder = CpuEncoder::new(&checkpoint).expect("a plan");
    let mut shared = Workspace::default();
    for size in [[100usize, 76], [33, 257], [64, 64], [17, 16], [100, 76]] {
        let input: Vec<f32> = (0..3 * size[0] * size[1])
            .map(|i| (i * 31 % 97) as f32 / 97.0)
            .collect();
        let again = encoder.run(&mut shared, &input, size).expect("keypoints");
        let alone = encoder
            .run(&mut Workspace::default(), &input, size)
            .expect("keypoints");
        assert_eq!(again, alone, "{size:?}");
        assert!(again.iter().flatten().all(|v| v.abs() <= 1.0), "{size:?}");
    }
}

#[test]
fn a_frame_gives_what_its_planes_give() {
    let checkpoint =
        Checkpoint::from_safetensors(&golden("keynet-vel-std-bg-tiny.safetensors")).expect("valid");
    let encoder = CpuEncoder::new(&checkpoint).expect("a plan");
    let mut workspace = Workspace::default();
    let bytes: Vec<u8> = (0..3 * 37 * 50).map(|i| (i * 31 % 251) as u8).collect();
    let floats = bytes.iter().map(|v| f32::from(*v) / 255.0).collect();
    for pixels in [Pixels::Bytes(bytes), Pixels::Floats(floats)] {
        let frame = Frame::from_pixels(37, 50, pixels).expect("a frame");
        let planes = frame.to_planar(None, Filter::BilinearAntialias);
        let expected = encoder
            .run(&mut workspace, &planes, [37, 50])
            .expect("keypoints");
        assert_eq!(
            encoder.extract(&mut workspace, &frame).expect("keypoints"),
            expected
        );
    }
}

#[test]
fn activations_that_overflow_are_named_by_their_layer() {
    let bytes = golden("basic-vel-std-bg-tiny.safetensors");
    let mut checkpoint = Checkpoint::from_safetensors(&bytes).expect("valid");
    for (name, value) in [
        ("block1.bn2.bias", 10.0),
        ("block2.conv1.weight", 1e38),
        ("block2.bn1.weight", 1.0),
        ("block2.bn1.running_var", 1.0),
    ] {
        let tensor = checkpoint.tensors.get_mut(&format!("encoder.{name}"));
        tensor.expect("a tensor").data.fill(value);
    }
    let encoder = CpuEncoder::new(&checkpoint).expect("finite weights");
    let error = encoder
        .run(&mut Workspace::default(), &[0.5; 3 * 64 * 64], [64, 64])
        .expect_err("an overflow")
        .to_string();
    assert!(error.contains("`encoder.block2.conv1` overflow"), "{error}");
}

#[test]
fn the_grid_places_border_cells_where_the_convolutions_see_them() {
    let checkpoint =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    let grid = CpuExtractor::new(&checkpoint)
        .expect("a plan")
        .grid([256, 128]);
    // 256 px: cell k of 33 is at pixel 8k - 3.5, ndc (2 px + 1) / 256 - 1; 128 px: 17 cells.
    let corner = grid.to_image([-1.0, -1.0]);
    assert!((corner[0] - (2.0 * -3.5 + 1.0) / 256.0 + 1.0).abs() < 1e-12);
    assert!((corner[1] - (2.0 * -3.5 + 1.0) / 128.0 + 1.0).abs() < 1e-12);
    let opposite = grid.to_image([1.0, 1.0]);
    assert!((opposite[0] - (2.0 * (8.0 * 32.0 - 3.5) + 1.0) / 256.0 + 1.0).abs() < 1e-12);
    assert!((opposite[1] - (2.0 * (8.0 * 16.0 - 3.5) + 1.0) / 128.0 + 1.0).abs() < 1e-12);
    // KeyNet: cell k of 32 at pixel 8k; DSAE: cell k of 117 at pixel 2k + 11.
    for (name, first, last) in [
        ("keynet-vel-std-bg-tiny", 0.0, 8.0 * 31.0),
        ("dsae-tiny", 11.0, 2.0 * 116.0 + 11.0),
    ] {
        let checkpoint =
            Checkpoint::from_safetensors(&golden(&format!("{name}.safetensors"))).expect("valid");
        let grid = CpuExtractor::new(&checkpoint)
            .expect("a plan")
            .grid([256, 256]);
        for (latent, pixel) in [(-1.0, first), (1.0, last)] {
            let place = grid.to_image([latent, latent])[0];
            assert!(
                (place - (2.0 * pixel + 1.0) / 256.0 + 1.0).abs() < 1e-12,
                "{name}"
            );
        }
    }
}

#[test]
fn decoders_reconstruct_as_the_reference() {
    for name in [
        "basic-vel-std-bg-tiny",
        "dsae-tiny",
        "keynet-vel-std-bg-tiny",
    ] {
        let bytes = golden(&format!("{name}.safetensors"));
        let mut checkpoint = Checkpoint::from_safetensors(&bytes).expect("a checkpoint");
        let decoder = CpuDecoder::new(&checkpoint)
            .expect("a plan")
            .expect("a decoder");
        let file = SafeTensors::deserialize(&bytes).expect("safetensors");
        let (shape, points) = tensor(&file, "golden.keypoints64");
        let (image_shape, images) = tensor(&file, "golden.reconstruction64");
        assert_eq!(image_shape[2..], [decoder.size()[1], decoder.size()[0]]);
        let mut largest: f32 = 0.0;
        for (points, expected) in points
            .chunks_exact(2 * shape[1])
            .zip(images.chunks_exact(3 * image_shape[2] * image_shape[3]))
        {
            // The reference speaks (y, x).
            let points: Vec<[f32; 2]> = points.chunks_exact(2).map(|p| [p[1], p[0]]).collect();
            let ours = decoder.reconstruct(&points).expect("an image");
            assert_eq!(ours.len(), expected.len());
            for (value, expected) in ours.iter().zip(expected) {
                largest = largest.max((value - expected).abs());
            }
        }
        println!("{name}: largest difference {largest:.1e}");
        // A trained sigma of 0.1 magnifies the rounding of f32, in the reference as well: up to
        // 7e-4.
        assert!(largest < 2e-3, "{name}: {largest}");
        assert!(decoder.reconstruct(&[]).is_err());
        checkpoint
            .tensors
            .retain(|name, _| !name.starts_with("decoder."));
        assert!(CpuDecoder::new(&checkpoint).expect("no error").is_none());
    }
}

#[test]
fn a_keypoint_is_the_mean_position_under_its_heat_map() {
    let pixels = (0..3 * 72 * 56).map(|i| (i * 7919 % 251) as u8).collect();
    let frame = Frame::new(72, 56, pixels).expect("a frame");
    for name in ["basic-vel-std-bg-tiny", "keynet-vel-std-bg-tiny"] {
        let checkpoint =
            Checkpoint::from_safetensors(&golden(&format!("{name}.safetensors"))).expect("valid");
        let encoder = CpuEncoder::new(&checkpoint).expect("a plan");
        let mut workspace = Workspace::default();
        let points = encoder.extract(&mut workspace, &frame).expect("keypoints");
        for (n, point) in points.iter().enumerate() {
            let map = encoder.heat_map(&mut workspace, &frame, n).expect("a map");
            let height = map.weights.len() / map.width;
            let mut mean = [0.0; 2];
            let mut total = 0.0;
            for (cell, weight) in map.weights.iter().enumerate() {
                let weight = f64::from(*weight);
                let at = |i: usize, cells: usize| 2.0 * i as f64 / (cells - 1) as f64 - 1.0;
                mean[0] += weight * at(cell % map.width, map.width);
                mean[1] += weight * at(cell / map.width, height);
                total += weight;
            }
            // Weights and keypoints are rounded to f32, half an ulp of at most 1 each.
            assert!((total - 1.0).abs() < 1e-6, "{name}, {n}: {total}");
            for (mean, coordinate) in mean.iter().zip(point) {
                assert!((mean - f64::from(*coordinate)).abs() < 1e-6, "{name}, {n}");
            }
        }
        let error = encoder.heat_map(&mut workspace, &frame, points.len());
        assert!(error.is_err_and(|e| e.to_string().contains("there is no keypoint")));
    }
}

#[test]
fn a_frame_smaller_than_the_kernels_is_told() {
    let checkpoint = Checkpoint::from_safetensors(&golden("dsae-tiny.safetensors")).expect("valid");
    let encoder = CpuEncoder::new(&checkpoint).expect("a plan");
    let error = encoder
        .run(&mut Workspace::default(), &[0.5; 3 * 16 * 16], [16, 16])
        .expect_err("too small")
        .to_string();
    assert!(
        error.contains("too small") && error.contains("encoder.conv3"),
        "{error}"
    );
}

#[test]
fn a_bright_spot_moves_a_keypoint_to_its_place_in_the_image() {
    // An encoder made by hand: each block passes its input on (centre taps of 1), the aggregation
    // is sharp.
    let mut checkpoint =
        Checkpoint::from_safetensors(&golden("basic-vel-std-bg-tiny.safetensors")).expect("valid");
    for (name, tensor) in checkpoint
        .tensors
        .iter_mut()
        .filter(|(name, _)| name.starts_with("encoder."))
    {
        let scale =
            name.ends_with("running_var") || (name.contains(".bn") && name.ends_with("weight"));
        tensor.data.fill(if scale { 1.0 } else { 0.0 });
        if name.contains(".conv") && name.ends_with("weight") {
            tensor.data[4] = 1.0;
        }
        if name == "encoder.aggregate_conv.weight" {
            tensor.data[0] = 1000.0;
        }
    }
    let extractor = CpuExtractor::new(&checkpoint).expect("a plan");
    for (column, row) in [(100usize, 40usize), (12, 90), (64, 64)] {
        let mut rgb = vec![0; 128 * 128 * 3];
        for y in row - 4..row + 4 {
            for x in column - 4..column + 4 {
                rgb[3 * (y * 128 + x)] = 255;
            }
        }
        let frame = Frame::new(128, 128, rgb).expect("a frame");
        let point = extractor.extract_frame(&frame).expect("keypoints").points[0];
        let ndc = extractor.grid([128, 128]).to_image(point.map(f64::from));
        // A cell is 8 px wide and pooling takes the maximum around it: a cell is what can be told.
        let cell = 2.0 * 8.0 / 128.0;
        assert!(
            (ndc[0] - (2.0 * column as f64 / 128.0 - 1.0)).abs() < cell,
            "{ndc:?} for {column}"
        );
        assert!(
            (ndc[1] - (2.0 * row as f64 / 128.0 - 1.0)).abs() < cell,
            "{ndc:?} for {row}"
        );
    }
    assert!(extractor.extract(b"no image").is_err());
}
