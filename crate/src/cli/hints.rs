//! What the terminal offers for an error or a notice.

use std::borrow::Cow;

use crate::data::Space;
use crate::error::Reason;
use crate::evaluation::doctor::{Finding, Remedy, Side};

/// The option that helps, in a sentence.
pub(super) fn hint(reason: &Reason) -> Option<Cow<'static, str>> {
    Some(Cow::Borrowed(match reason {
        Reason::DetectorSettings { missing } => return Some(Cow::Owned(detector(missing))),
        Reason::MissingImageSize => {
            "give the size with --image-size WIDTHxHEIGHT, or say that the positions are in ndc with --space ndc"
        }
        Reason::UnknownUnit => {
            "say it with --space px and --image-size WxH (of the whole board), --space fraction \
             or --space ndc"
        }
        Reason::NoPoints => {
            "of HDF5 and Zarr, `score --columns` and `eval --truth-columns` name an array for each \
             object, e.g. eef=obs/robot0_eef_pos,cube=obs/object[0:3]; an NPZ file needs an array \
             of its own: np.savez(\"points.npz\", keypoints=points), points [S, T, K, 2]"
        }
        Reason::SeveralCameras { names } => {
            let first = names.first()?;
            return Some(Cow::Owned(format!("choose one with --array {first}")));
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
        Reason::OtherNumbers { frames, sequences } => {
            return Some(Cow::Owned(numbers(*frames, *sequences)));
        }
        Reason::KeypointsFromOne => "`--first-keypoint 1` counts the keypoints from 1",
        Reason::AssumedAxisOrder => {
            "`--axis-order yx` reads (y, x); `score` reads keypoints so too, unless `--keypoints-axis-order` is given"
        }
        Reason::OtherColumns { .. } => {
            "`--columns` says which column is what, e.g. --columns x=px,y=py,frame=t,object=label; \
             `--keypoints-columns` of keypoints"
        }
        Reason::MissingPoints { .. }
        | Reason::LooksLikeFractions
        | Reason::InSpace
        | Reason::NoFrames => return None,
    }))
}

/// The options that make frames and rows of other numbers match.
fn numbers(frames: i64, sequences: i64) -> String {
    let (option, of) = match frames {
        0 => (Remedy::ShiftSequences { by: sequences }, "sequences"),
        by => (Remedy::ShiftFrames { by }, "frames"),
    };
    format!(
        "{} adds to the numbers of the {of} of the ground truth; most frames have a row then",
        self::option(&option)
    )
}

/// The options that say what a model leaves open.
fn detector(missing: &[String]) -> String {
    let option = |name: &String| match name.as_str() {
        "inputSize" => "--input-size 256x256 (or frame)",
        "layout" => "--layout nchw (or nhwc)",
        "normalization" => {
            "--normalize imagenet (or fraction, symmetric, bytes), or --mean 0.5,0.5,0.5 --std 0.5,0.5,0.5"
        }
        "output" => "--output heatmaps (or points, simcc)",
        "columns" => "--columns xy (or yx, xyc, yxc, xyz)",
        "unit" => "--unit px (or fraction, ndc)",
        _ => "--output-names NAME",
    };
    let options: Vec<&str> = missing.iter().map(option).collect();
    format!(
        "say it with {}; --remember keeps it beside the model",
        options.join(" and ")
    )
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
                Space::Ndc | Space::Fraction | Space::World => "",
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
