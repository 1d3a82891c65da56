//! What follows the sums of a convolution.

/// What a convolution gives: every sum plus a bias, or the largest of 2 x 2 sums times a scale plus
/// a bias; then what is below `floor` is raised to it.
pub(crate) struct Epilogue<'a> {
    /// The scale of the batch norm after a pool; one value for each output.
    pub scale: Option<&'a [f32]>,
    pub bias: &'a [f32],
    pub floor: f32,
}
