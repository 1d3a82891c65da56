/// n coordinates from -1 to 1, the ends included: the authors' grid over a feature map or an image,
/// on which -1 and 1 are the *centres* of the border cells.
pub(super) fn grid(n: usize) -> Vec<f32> {
    let step = 2.0 / (n.max(2) - 1) as f64;
    (0..n).map(|i| (step * i as f64 - 1.0) as f32).collect()
}
