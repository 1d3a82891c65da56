/// What batch norms add to the variance before the square root: PyTorch's default `eps`.
pub(crate) const BATCH_NORM_EPSILON: f64 = 1e-5;
