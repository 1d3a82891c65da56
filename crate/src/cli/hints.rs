//! What the terminal offers for an error or a notice.

use crate::data::Space;
use crate::error::Reason;
use crate::evaluation::doctor::{Finding, Remedy, Side};

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
        Reason::KeypointsFromOne => "`--first-keypoint 1` counts the keypoints from 1",
        Reason::AssumedAxisOrder => "`--axis-order yx` reads (y, x)",
        Reason::MissingPoints { .. } | Reason::LooksLikeFractions => return None,
    })
}

/// A finding of the data's doctor on one line, with the options that remedy it.
pub(super) fn finding_line(finding: &Finding) -> String {
    let options: Vec<String> = finding.remedies.iter().map(option).collect();
    match options.is_empty() {
        true => format!("check: {}", finding.text),
        false => format!(
            "check: {}; to change that: {}",
            finding.text,
            options.join(", or ")
        ),
    }
}

/// The option that applies a remedy.
fn option(remedy: &Remedy) -> String {
    let of = |side: Side, name: &str| match side {
        Side::Truth => format!("--{name}"),
        Side::Keypoints => format!("--keypoints-{name}"),
    };
    match *remedy {
        Remedy::Unit { side, space } => {
            let size = match space {
                Space::Pixels => " (with --image-size WxH where the size is not known)",
                Space::Ndc | Space::Fraction => "",
            };
            format!("{} {}{size}", of(side, "space"), space.name())
        }
        Remedy::CountFrom {
            side,
            first,
            first_keypoint,
        } => {
            let keypoint = first_keypoint.map(|first| format!(" --first-keypoint {first}"));
            format!(
                "{} {first}{}",
                of(side, "index-base"),
                keypoint.unwrap_or_default()
            )
        }
        Remedy::ShiftFrames { by } => format!("--shift-frames {by}"),
        Remedy::ShiftSequences { by } => format!("--shift-sequences {by}"),
        Remedy::Axes { side, order, flip } => format!(
            "{} {} {} {}",
            of(side, "axis-order"),
            order.name(),
            of(side, "flip"),
            flip.name()
        ),
        Remedy::ZeroIsMissing { side } => of(side, "zero-is-missing"),
    }
}
