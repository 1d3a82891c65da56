//! What the terminal offers for an error or a notice.

use crate::error::Reason;

/// The option that helps, in a sentence.
pub(super) fn hint(reason: &Reason) -> Option<&'static str> {
    Some(match reason {
        Reason::MissingImageSize => {
            "give the size with --image-size 256x256, or say that the positions are in ndc with --space ndc"
        }
        Reason::NonFinite { .. } => "--non-finite exclude-frame leaves such frames out",
        Reason::LooksLikePixels { .. } => {
            "`--space px` reads a ground truth in pixels, `--keypoints-space px` keypoints, with `--image-size WxH`"
        }
        Reason::LooksLikeNdc => {
            "`--space ndc` and `--keypoints-space ndc` read positions as they are"
        }
        Reason::LostPoints { .. } => {
            "`--min-confidence C` counts keypoints below C as missing, `--truth-min-confidence C` positions of the \
             ground truth"
        }
        Reason::AssumedAxisOrder => "`--axis-order yx` reads (y, x)",
        Reason::MissingPoints { .. } | Reason::LooksLikeFractions => return None,
    })
}
