//! Bilinear resizing of planar images, as torchvision resizes tensors.

/// Which bilinear resizing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// Interpolates between the two nearest pixels a direction, also when shrinking: torchvision
    /// before 0.17 for tensors, which made the paper's reconstruction targets.
    Bilinear,
    /// A triangle filter that widens when shrinking (antialiased), so that every pixel counts.
    BilinearAntialias,
}

/// Resizes planes of `from` = `[width, height]` to `to`; pixel centres are at half-integers
/// (PyTorch's `align_corners=False`).
///
/// # Panics
/// When `planes` does not hold a whole number of planes, or a side is 0.
pub fn resize_planar(planes: &[f32], from: [usize; 2], to: [usize; 2], filter: Filter) -> Vec<f32> {
    let [columns, rows] = [0, 1].map(|axis| taps(from[axis], to[axis], filter));
    let plane = from[0] * from[1];
    let count = planes.len() / plane;
    assert_eq!(count * plane, planes.len(), "planes of {from:?} expected");
    let mut out = Vec::with_capacity(count * to[0] * to[1]);
    let mut narrow = vec![0.0f32; to[0] * from[1]];
    for plane in planes.chunks_exact(plane) {
        for (row, out) in plane
            .chunks_exact(from[0])
            .zip(narrow.chunks_exact_mut(to[0]))
        {
            for (value, tap) in out.iter_mut().zip(&columns) {
                let pixels = &row[tap.start..tap.start + tap.weights.len()];
                *value = pixels.iter().zip(&tap.weights).map(|(p, w)| p * w).sum();
            }
        }
        for tap in &rows {
            let start = out.len();
            out.resize(start + to[0], 0.0);
            for (i, weight) in tap.weights.iter().enumerate() {
                let row = &narrow[(tap.start + i) * to[0]..][..to[0]];
                for (value, pixel) in out[start..].iter_mut().zip(row) {
                    *value += weight * pixel;
                }
            }
        }
    }
    out
}

/// The input positions one output position is made of.
struct Tap {
    start: usize,
    weights: Vec<f32>,
}

/// Positions and weights in f32, in PyTorch's order of operations: at 100 px another order already
/// moves a weight by 4e-6.
fn taps(from: usize, to: usize, filter: Filter) -> Vec<Tap> {
    let scale = from as f32 / to as f32;
    let tap = |i: usize| match filter {
        Filter::Bilinear => {
            let at = (scale * (i as f32 + 0.5) - 0.5).max(0.0);
            let start = (at as usize).min(from - 1);
            let weight = at - start as f32;
            match start + 1 < from {
                true => Tap {
                    start,
                    weights: vec![1.0 - weight, weight],
                },
                false => Tap {
                    start,
                    weights: vec![1.0],
                },
            }
        }
        Filter::BilinearAntialias => {
            let reach = scale.max(1.0);
            let centre = scale * (i as f32 + 0.5);
            let start = (centre - reach + 0.5).max(0.0) as usize;
            let end = ((centre + reach + 0.5) as usize).min(from);
            let inverse = 1.0 / reach;
            let weight = |j: usize| (1.0 - ((j as f32 - centre + 0.5) * inverse).abs()).max(0.0);
            let mut weights: Vec<f32> = (start..end).map(weight).collect();
            let sum: f32 = weights.iter().sum();
            weights.iter_mut().for_each(|w| *w /= sum);
            Tap { start, weights }
        }
    };
    (0..to).map(tap).collect()
}
