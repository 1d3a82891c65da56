//! The shape of a convolution.

/// What a band of the source may take, in values: it should stay in the second-level cache.
pub(super) const BAND: usize = 64 * 1024;

/// Groups of images whose weight gradients are summed up one after the other.
pub(super) const GROUPS: usize = 8;

/// A convolution with square filters, the same stride and the same zero padding on both axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Convolution {
    pub batch: usize,
    pub inputs: usize,
    pub outputs: usize,
    /// Rows and columns of an input image.
    pub size: [usize; 2],
    pub kernel: usize,
    pub stride: usize,
    pub padding: usize,
}

impl Convolution {
    /// Rows and columns of an output image.
    pub fn output_size(&self) -> [usize; 2] {
        self.size
            .map(|side| (side + 2 * self.padding - self.kernel) / self.stride + 1)
    }

    /// The weights by output, input, row and column.
    pub fn taps<'a>(
        &self,
        weight: &'a [f32],
    ) -> impl Fn(usize, usize, usize, usize) -> f32 + Sync + use<'a> {
        let Self { inputs, kernel, .. } = *self;
        move |output, input, ky, kx| weight[((output * inputs + input) * kernel + ky) * kernel + kx]
    }

    /// Whether the kernels here can compute it.
    pub fn is_supported(&self) -> bool {
        let fits = |side: usize| side > 0 && side + 2 * self.padding >= self.kernel;
        self.batch * self.inputs * self.outputs > 0
            && self.stride > 0
            && self.padding < self.kernel
            && self.size.into_iter().all(fits)
    }
}
