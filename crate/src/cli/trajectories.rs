//! Trajectories of runs of `tracklens report` on the frames of their data set.

use std::collections::BTreeSet;
use std::path::Path;

use crate::data::{Filter, Frame, FrameSource, SequenceRange, join};
use crate::error::{Error, ErrorKind, Result};
use crate::evaluation::ObjectReport;
use crate::event::Cancel;
use crate::extract::{CpuExtractor, Extractor as _, extract_frames};
use crate::metric::Object;
use crate::report::draw::{Figure, FileNames};
use crate::report::runs::{Group, Run, Runs, Scene, Trajectory, trajectories};
use crate::run::{CHECKPOINT_FINAL, RunConfig};
use crate::track::GroundTruth;
use crate::weights::read_checkpoint;

/// Sequences that are drawn when none are asked for.
const SHOWN: usize = 4;
/// Frames are made smaller than this, in pixels: they are drawn in half of it.
const LARGEST: u32 = 440;

/// A figure a group, of the run in its middle. Groups whose run has no weights or no maps are said
/// and left out.
pub(super) fn figures(
    runs: &Runs,
    frames: &dyn FrameSource,
    truth: &GroundTruth,
    asked: &[String],
) -> Result<Vec<Figure>> {
    let all = frames.index().sequences();
    if let Some(unknown) = asked
        .iter()
        .find(|name| !all.iter().any(|range| range.name == **name))
    {
        return Err(Error::mismatch(format!(
            "there is no sequence `{unknown}` among the frames; they have {}, …",
            all.iter()
                .take(3)
                .map(|range| range.name.as_str())
                .collect::<Vec<_>>()
                .join(", ")
        )));
    }
    let mut figures = Vec::new();
    let mut names = FileNames::default();
    for group in &runs.groups {
        let Some(run) = middle(group, &runs.objects) else {
            continue;
        };
        let name = format!("trajectories-{}", names.unique(&group.name));
        let drawing = Drawing::new(run, &runs.objects, frames, truth);
        match drawing.and_then(|drawing| figure(&drawing, group, name, asked)) {
            Ok(figure) => figures.push(figure),
            Err(e) if e.kind() == ErrorKind::Cancelled => return Err(e),
            Err(e) => eprintln!("warning: no trajectories of {}: {e}", group.name),
        }
    }
    Ok(figures)
}

/// The complete run whose errors, each over its threshold, have the median sum (the lower one of
/// two): neither the best nor the worst.
fn middle<'a>(group: &'a Group, objects: &[Object]) -> Option<&'a Run> {
    let sum = |run: &Run| -> f64 {
        let errors = objects
            .iter()
            .filter_map(|object| Some(run.error(&object.name)? / object.threshold));
        errors.sum()
    };
    let mut complete: Vec<&Run> = group.complete().collect();
    complete.sort_by(|a, b| sum(a).total_cmp(&sum(b)));
    complete.get(complete.len().saturating_sub(1) / 2).copied()
}

/// What the trajectories of one run need.
struct Drawing<'a> {
    run: &'a Run,
    config: &'a RunConfig,
    /// The objects with a map, and their columns in the ground truth.
    fits: Vec<&'a ObjectReport>,
    columns: Vec<usize>,
    frames: &'a dyn FrameSource,
    truth: &'a GroundTruth,
    /// For each frame its row of ground truth.
    rows: Vec<Option<usize>>,
}

impl<'a> Drawing<'a> {
    fn new(
        run: &'a Run,
        objects: &[Object],
        frames: &'a dyn FrameSource,
        truth: &'a GroundTruth,
    ) -> Result<Self> {
        let config = run
            .config
            .as_ref()
            .ok_or_else(|| Error::input("it was scored, not trained"))?;
        let evaluation = run.evaluation.as_ref().ok_or_else(|| {
            Error::input("its summary.json holds no maps from keypoints to objects").at(&run.name)
        })?;
        let fits: Vec<&ObjectReport> = objects
            .iter()
            .filter_map(|object| evaluation.objects.iter().find(|o| o.name == object.name))
            .filter(|object| object.map.is_some() && object.best_keypoint.is_some())
            .collect();
        if fits.is_empty() {
            return Err(
                Error::numeric("no object is visible in its validation sequences").at(&run.name),
            );
        }
        let column = |fit: &&ObjectReport| {
            let names = truth.names();
            let found = names.iter().position(|name| *name == fit.name);
            found.ok_or_else(|| {
                Error::mismatch(format!(
                    "the ground truth has no object `{}`; it has {}",
                    fit.name,
                    names.join(", ")
                ))
            })
        };
        Ok(Self {
            run,
            config,
            columns: fits.iter().map(column).collect::<Result<_>>()?,
            fits,
            frames,
            truth,
            rows: rows(frames, truth)?,
        })
    }

    /// The sequences that are drawn: those in `asked`, or the run's validation sequences in which
    /// the objects move furthest.
    fn sequences(&self, asked: &[String]) -> Result<Vec<SequenceRange>> {
        let mut all = self.frames.index().sequences();
        if !asked.is_empty() {
            let find = |name: &String| all.iter().find(|range| range.name == *name).cloned();
            return Ok(asked.iter().filter_map(find).collect());
        }
        let validation: BTreeSet<&String> = self.config.validation_sequences.iter().collect();
        all.retain(|range| validation.contains(&range.name));
        if all.is_empty() {
            return Err(Error::mismatch(
                "none of its validation sequences is among the frames; are they of another data set?",
            )
            .at(&self.run.name));
        }
        let motion = |range: &SequenceRange| motion(range, &self.rows, self.truth, &self.columns);
        all.sort_by(|a, b| {
            motion(b)
                .total_cmp(&motion(a))
                .then_with(|| a.name.cmp(&b.name))
        });
        all.truncate(SHOWN);
        Ok(all)
    }

    /// The frames and paths of `sequences`.
    fn scenes(&self, sequences: &[SequenceRange]) -> Result<Vec<Scene>> {
        let path = Path::new(&self.run.name).join(CHECKPOINT_FINAL);
        let extractor =
            CpuExtractor::new(&read_checkpoint(&path, None)?).map_err(|e| e.at(path.display()))?;
        let truth = |t: usize, k: usize| {
            self.rows[t].map_or([f64::NAN; 2], |row| {
                let point = self.truth.frame(row);
                [point[[self.columns[k], 0]], point[[self.columns[k], 1]]]
            })
        };
        let mut scenes = Vec::new();
        for range in sequences {
            let mut scene = scene(range, self.frames, &extractor, &self.fits, truth)?;
            if self.config.training_sequences.contains(&range.name) {
                scene.title += " (trained on)";
            }
            scenes.push(scene);
        }
        Ok(scenes)
    }

    /// The names of the objects, with what stands below them.
    fn details(&self) -> Vec<(String, String)> {
        let detail = |fit: &&ObjectReport| {
            let keypoint = fit.best_keypoint.unwrap_or_default();
            let error = fit.error.map(|e| format!("error {e:.4}"));
            let error = error.unwrap_or_default();
            let tracked = if fit.tracked {
                "tracked"
            } else {
                "not tracked"
            };
            let text = format!("keypoint {keypoint}\n{error}\n{tracked}");
            (fit.name.clone(), text)
        };
        self.fits.iter().map(detail).collect()
    }
}

fn figure(drawing: &Drawing, group: &Group, name: String, asked: &[String]) -> Result<Figure> {
    let scenes = drawing.scenes(&drawing.sequences(asked)?)?;
    let seed = drawing.run.seed;
    let seed = seed.map_or_else(String::new, |seed| format!(" (seed {seed})"));
    let which = match asked.is_empty() {
        true => "the validation sequences in which the objects move furthest",
        false => "sequences that were asked for",
    };
    let of = match group.complete().count() {
        1 => "its one run".to_owned(),
        n => {
            format!("the run in the middle of {n}, by the sum of its errors over their thresholds")
        }
    };
    let caption = format!(
        "Trajectories of {}{seed}, {of}, on {which}: objects white, best keypoints red, and blue under the map that was \
         fitted on all validation sequences; a dot where they start, on the first frame. Errors are those on all validation \
         sequences; what lies outside the image is drawn at its edge.",
        group.name
    );
    trajectories(name, caption, &drawing.details(), &scenes)
}

/// For each frame its row of ground truth.
fn rows(frames: &dyn FrameSource, truth: &GroundTruth) -> Result<Vec<Option<usize>>> {
    let mut rows = vec![None; frames.index().keys().len()];
    for (frame, row) in join(frames.index().keys(), truth.keys())?.pairs {
        rows[frame] = Some(row);
    }
    Ok(rows)
}

/// How far the objects move in a sequence, in ndc: the lengths of their paths, added up.
fn motion(
    range: &SequenceRange,
    rows: &[Option<usize>],
    truth: &GroundTruth,
    columns: &[usize],
) -> f64 {
    let seen: Vec<usize> = (range.start..range.start + range.length)
        .filter_map(|t| rows[t])
        .collect();
    let step = |pair: &[usize], k: usize| {
        let [a, b] = [pair[0], pair[1]].map(|row| truth.frame(row));
        let length = (b[[k, 0]] - a[[k, 0]]).hypot(b[[k, 1]] - a[[k, 1]]);
        if length.is_finite() { length } else { 0.0 }
    };
    seen.windows(2)
        .map(|pair| columns.iter().map(|k| step(pair, *k)).sum::<f64>())
        .sum()
}

fn scene(
    range: &SequenceRange,
    frames: &dyn FrameSource,
    extractor: &CpuExtractor,
    fits: &[&ObjectReport],
    truth: impl Fn(usize, usize) -> [f64; 2],
) -> Result<Scene> {
    let empty = || Trajectory {
        truth: Vec::new(),
        keypoint: Vec::new(),
        transformed: Vec::new(),
    };
    let mut paths: Vec<Trajectory> = fits.iter().map(|_| empty()).collect();
    let all = range.start..range.start + range.length;
    let found = extract_frames(extractor, frames, all.clone(), &|_| (), &Cancel::default())?;
    for (t, found) in all.zip(found) {
        let found = found?;
        let grid = extractor.grid(found.image_size);
        for (k, (fit, path)) in fits.iter().zip(&mut paths).enumerate() {
            let (Some(n), Some(map)) = (fit.best_keypoint, fit.map) else {
                continue;
            };
            let point = found.points.get(n).ok_or_else(|| {
                Error::mismatch(format!(
                    "its checkpoint has no keypoint {n}, which its summary.json names"
                ))
            })?;
            let [x, y] = point.map(f64::from);
            path.truth.push(truth(t, k));
            path.keypoint.push(grid.to_image([x, y]));
            let mapped = map.apply(&[x, y]);
            path.transformed.push([mapped[0], mapped[1]]);
        }
    }
    let small = shrunk(frames.read(range.start)?)?;
    Ok(Scene {
        title: range.name.clone(),
        png: small.to_png()?,
        size: [small.width(), small.height()],
        paths,
    })
}

/// The frame, made smaller where it is larger than what is drawn.
fn shrunk(frame: Frame) -> Result<Frame> {
    let largest = frame.width().max(frame.height());
    if largest <= LARGEST {
        return Ok(frame);
    }
    let side = |side: u32| (side * LARGEST / largest).max(1);
    let size = [side(frame.width()), side(frame.height())];
    let planar = frame.to_planar(Some(size.map(|s| s as usize)), Filter::BilinearAntialias);
    let pixels = (size[0] * size[1]) as usize;
    let byte = |i: usize| (planar[i % 3 * pixels + i / 3].clamp(0.0, 1.0) * 255.0).round() as u8;
    Frame::new(size[0], size[1], (0..3 * pixels).map(byte).collect())
}
