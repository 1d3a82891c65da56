//! From the latent space of an encoder to the image.

use super::SaeConfig;

/// Where the cells of the last feature map lie in the image.
///
/// The latent coordinates -1 and +1 are the centres of its border cells, which are not the edges of
/// the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentGrid {
    ndc_from_latent: [[f64; 2]; 2],
}

impl LatentGrid {
    /// Of points that are in ndc already.
    pub fn of_image() -> Self {
        Self {
            ndc_from_latent: [[1.0, 0.0]; 2],
        }
    }

    /// Places a latent point (x, y) in the image (ndc).
    pub fn to_image(&self, point: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [scale, shift] = self.ndc_from_latent[axis];
            scale * point[axis] + shift
        })
    }
}

impl SaeConfig {
    /// Where latent points lie in an image of `[width, height]`.
    pub fn latent_grid(&self, image_size: [u32; 2]) -> LatentGrid {
        let input = self
            .input_size
            .unwrap_or(image_size.map(|side| side as usize));
        let layers = self.encoder_layers();
        let [first, step] = self.cell_positions();
        let ndc_from_latent = input.map(|side| {
            let mut cells = side;
            for layer in &layers {
                cells = layer.output_side(cells).unwrap_or(1);
            }
            let last = first + step * (cells - 1) as f64;
            let ndc = |pixel: f64| (2.0 * pixel + 1.0) / side as f64 - 1.0;
            [
                (ndc(last) - ndc(first)) / 2.0,
                (ndc(last) + ndc(first)) / 2.0,
            ]
        });
        LatentGrid { ndc_from_latent }
    }
}
