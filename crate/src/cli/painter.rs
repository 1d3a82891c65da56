//! Figures as PNG.

use crate::error::{Error, Result};

/// Pixels of a PNG for one of the SVG.
const PNG_SCALE: f32 = 2.0;

/// Draws SVG documents as PNG, with a font of its own: the machine may have none.
pub(super) struct Painter {
    options: resvg::usvg::Options<'static>,
}

impl Painter {
    pub fn new() -> Self {
        let mut options = resvg::usvg::Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_font_data(epaint_default_fonts::UBUNTU_LIGHT.to_vec());
        let family = fonts
            .faces()
            .next()
            .and_then(|face| face.families.first())
            .map(|(name, _)| name.clone());
        if let Some(family) = family {
            fonts.set_sans_serif_family(family);
        }
        Self { options }
    }

    /// Two pixels for one of the document.
    ///
    /// # Errors
    /// When it is not an SVG document.
    pub fn png(&self, svg: &str) -> Result<Vec<u8>> {
        let failed = |e: &dyn std::fmt::Display| {
            Error::input(format!("a figure cannot be drawn as PNG: {e}"))
        };
        let tree = resvg::usvg::Tree::from_str(svg, &self.options).map_err(|e| failed(&e))?;
        let size = tree.size().to_int_size();
        let [width, height] = [size.width(), size.height()].map(|side| side * PNG_SCALE as u32);
        let mut image = resvg::tiny_skia::Pixmap::new(width, height)
            .ok_or_else(|| failed(&"it has no size"))?;
        let scale = resvg::tiny_skia::Transform::from_scale(PNG_SCALE, PNG_SCALE);
        resvg::render(&tree, scale, &mut image.as_mut());
        image.encode_png().map_err(|e| failed(&e))
    }
}
