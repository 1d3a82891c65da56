//! A sequence that plays in a report: its frames with the objects and their mapped keypoints. It
//! needs no script: an animation of CSS shows every frame in its part of the time. In space, where
//! there is no image to play, its coordinates are drawn over the frames.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};
use ndarray::{Array2, s};
use serde::{Deserialize, Serialize};

use crate::data::{SequenceRange, ranges};
use crate::error::Result;
use crate::evaluation::{EvaluationReport, ObjectReport, Scoring};
use crate::metric::Settings;
use crate::report::draw::{Color, LineFigure, LineSeries, Theme, lines_to_svg};

/// Frames of a film; of a longer sequence the first ones are shown.
const MOST_FRAMES: usize = 120;
/// What the images of a film may take in all, in characters.
const BUDGET: usize = 2 << 20;
/// How an image begins: nothing is loaded from elsewhere.
const EMBEDDED: &str = "data:image/";
/// Frames per second.
const SPEED: f64 = 5.0;
/// Width of the drawing, in its own pixels.
const WIDTH: f64 = 480.0;
/// Width and height of a plot of one coordinate, in pixels.
const PLOT: [u32; 2] = [352, 200];
/// How far a mark reaches from its middle.
const MARK: f64 = 7.0;
/// After M. Okabe and K. Ito, told apart by everyone; those of the page.
const COLORS: [&str; 7] = [
    "#e69f00", "#56b4e9", "#cc79a7", "#009e73", "#f0e442", "#d55e00", "#0072b2",
];
/// The share of the time by which a frame stays longer than its turn, below the next one: rounding
/// would leave a gap.
const OVERLAP: f64 = 1e-4;

/// A position, (x, y) in ndc or (x, y, z) in the unit of the ground truth; `None` where it is not
/// visible.
type Position = Option<Vec<f64>>;

/// A sequence with objects, and images where there are some.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Film {
    /// The name of the sequence.
    pub sequence: String,
    /// How many frames the sequence has; the first ones are here.
    pub length: usize,
    /// Width and height of the images, or how they relate.
    pub size: [u32; 2],
    /// The numbers of the frames.
    pub frames: Vec<u64>,
    /// The image of each frame as a data URI; none where there are no images.
    pub images: Vec<Option<String>>,
    /// The objects, each with a keypoint.
    pub tracks: Vec<FilmTrack>,
}

/// An object and a keypoint over the frames of a [`Film`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FilmTrack {
    /// The object's name.
    pub object: String,
    /// The keypoint, counted from 0.
    pub keypoint: usize,
    /// Where the object is.
    pub truth: Vec<Position>,
    /// Where the fitted map takes the keypoint.
    pub mapped: Vec<Position>,
}

impl Film {
    /// The first frames of the sequence in which the objects cover the longest paths, with the best
    /// keypoints and without images; `None` where no object has a keypoint.
    ///
    /// # Errors
    /// As [`Scoring::series`].
    pub fn of(
        scoring: &Scoring,
        report: &EvaluationReport,
        settings: &Settings,
    ) -> Result<Option<Self>> {
        let best = |(k, object): (usize, &ObjectReport)| {
            let keypoint = object.best_keypoint?;
            Some((object.name.clone(), k, keypoint))
        };
        let mut series = Vec::new();
        let objects = report.objects.iter().enumerate().filter_map(best);
        for (name, k, keypoint) in objects.take(COLORS.len()) {
            series.push((name, keypoint, scoring.series(k, keypoint, settings)?));
        }
        let path = |range: &SequenceRange| -> f64 {
            series
                .iter()
                .map(|(_, _, series)| length(&positions(&series.truth_ndc, range, range.length)))
                .sum()
        };
        // The first one of those in which as much moves.
        let sequences = ranges(scoring.keys());
        let liveliest = sequences
            .iter()
            .map(|range| (path(range), range))
            .reduce(|best, next| if next.0 > best.0 { next } else { best });
        let Some((_, range)) = liveliest.filter(|_| !series.is_empty()) else {
            return Ok(None);
        };
        let count = range.length.min(MOST_FRAMES);
        let keys = &scoring.keys()[range.start..range.start + count];
        Ok(Some(Self {
            sequence: range.name.clone(),
            length: range.length,
            size: report.image_size.unwrap_or([1, 1]),
            frames: keys.iter().map(|key| key.frame).collect(),
            images: Vec::new(),
            tracks: series
                .into_iter()
                .map(|(object, keypoint, series)| FilmTrack {
                    object,
                    keypoint,
                    truth: positions(&series.truth_ndc, range, count),
                    mapped: positions(&series.transformed_ndc, range, count),
                })
                .collect(),
        }))
    }

    /// Whether its positions are in space: it has no images.
    pub fn is_in_space(&self) -> bool {
        let mut positions = self.tracks.iter().flat_map(|track| &track.truth).flatten();
        positions.next().is_some_and(|point| point.len() > 2)
    }

    /// The film as a part of a page; nothing without frames.
    ///
    /// # Errors
    /// When coordinates cannot be drawn.
    pub(super) fn to_html(&self) -> Result<Markup> {
        let count = self.shown();
        if count == 0 {
            return Ok(html! {});
        }
        if self.is_in_space() {
            return self.coordinates(count);
        }
        Ok(html! {
            h2 { "How it moves" }
            div #film {
                input #film-pause type="checkbox";
                label for="film-pause" { "Pause" }
                div.plate { (PreEscaped(self.svg(count))) }
                p.film-objects {
                    @for (track, color) in self.tracks.iter().zip(COLORS) {
                        span {
                            i style=(format!("background:{color}")) {}
                            (track.object) ", keypoint " (track.keypoint)
                        }
                    }
                }
                p {
                    "Sequence " (self.sequence) ": " (count) " of " (self.length) " frames. Circles: ground truth. \
                     Diamonds: the keypoint under its fitted map. Lines: their paths, those of keypoints dashed."
                }
            }
        })
    }

    /// Every coordinate of every object over the frames.
    fn coordinates(&self, count: usize) -> Result<Markup> {
        const AXES: [&str; 3] = ["x", "y", "z"];
        let theme = Theme::PRINT;
        let line = |label: &str, color: Color, points: &[Position], axis: usize| LineSeries {
            label: label.to_owned(),
            color,
            values: points
                .iter()
                .take(count)
                .map(|point| coordinate(point, axis))
                .collect(),
        };
        let mut figures = Vec::new();
        for track in &self.tracks {
            let mapped = format!("keypoint {}", track.keypoint);
            for (axis, name) in AXES.iter().enumerate() {
                let lines = LineFigure {
                    title: String::new(),
                    x_label: "frame".to_owned(),
                    y_label: (*name).to_owned(),
                    start: self.frames.first().map_or(0.0, |frame| *frame as f64),
                    series: vec![
                        line(&track.object, theme.accent, &track.truth, axis),
                        line(&mapped, theme.bad, &track.mapped, axis),
                    ],
                    cursor: None,
                    from_zero: false,
                    foreground: theme.foreground,
                    background: theme.background,
                    grid: theme.grid,
                    font_size: theme.font_size,
                };
                figures.push(lines_to_svg(&lines, PLOT[0], PLOT[1])?);
            }
        }
        Ok(html! {
            h2 { "How it moves" }
            div.film-space { @for svg in &figures { (PreEscaped(svg)) } }
            p {
                "Sequence " (self.sequence) ": " (count) " of " (self.length) " frames, in the unit of the ground truth. \
                 Of each object x, y and z, and those of its keypoint under the fitted map."
            }
        })
    }

    /// How many frames are shown: those whose images fit the budget.
    fn shown(&self) -> usize {
        let mut left = BUDGET;
        let fits = |image: &&Option<String>| {
            let size = image.as_ref().map_or(0, String::len);
            let rest = left.checked_sub(size);
            left = rest.unwrap_or(0);
            rest.is_some()
        };
        let most = self.frames.len().min(MOST_FRAMES);
        match self.images.is_empty() {
            true => most,
            false => self.images.iter().take_while(fits).count().min(most),
        }
    }

    fn svg(&self, count: usize) -> String {
        let [width, height] = self.size.map(|side| f64::from(side.max(1)));
        let height = (WIDTH * height / width).clamp(WIDTH / 8.0, 2.0 * WIDTH);
        let place = |point: &Position| {
            let [x, y] = [0, 1].map(|axis| coordinate(point, axis));
            let placed = [(x + 1.0) / 2.0 * WIDTH, (y + 1.0) / 2.0 * height];
            point.as_ref().map(|_| placed)
        };
        let frame = |i: usize, inside: Markup| {
            let seconds = count as f64 / SPEED;
            let delay = i as f64 / SPEED - seconds;
            html! { g.film-frame style=(format!("animation-delay:{delay:.3}s")) { (inside) } }
        };
        let drawn = html! {
            svg viewBox=(format!("0 0 {WIDTH} {height:.0}")) role="img" aria-label="The sequence as it moves" {
                style { (PreEscaped(animation(count))) }
                defs { (marks()) }
                rect width="100%" height="100%" fill="#22272d" {}
                @for (i, image) in self.images.iter().take(count).enumerate() {
                    @if let Some(image) = image.as_ref().filter(|image| image.starts_with(EMBEDDED)) {
                        (frame(i, html! {
                            image href=(image) width="100%" height="100%" preserveAspectRatio="none" {}
                        }))
                    }
                }
                @for (track, color) in self.tracks.iter().zip(COLORS) {
                    @for (points, dashes) in [(&track.truth, "none"), (&track.mapped, "4 3")] {
                        path d=(path(points.iter().take(count).map(place))) fill="none" stroke=(color)
                            stroke-width="1.5" stroke-opacity="0.65" stroke-dasharray=(dashes) {}
                    }
                }
                @for i in 0..count {
                    (frame(i, html! {
                        @for (track, color) in self.tracks.iter().zip(COLORS) {
                            @for (points, mark) in [(&track.truth, "#film-truth"), (&track.mapped, "#film-mapped")] {
                                @if let Some([x, y]) = points.get(i).and_then(place) {
                                    use href=(mark) x=(format!("{x:.1}")) y=(format!("{y:.1}")) color=(color) {}
                                }
                            }
                        }
                        text x="8" y=(format!("{:.0}", height - 8.0)) class="film-number" {
                            "frame " (self.frames[i])
                        }
                    }))
                }
            }
        };
        drawn.into_string()
    }
}

/// The points of a sequence's first frames.
fn positions(points: &Array2<f64>, range: &SequenceRange, count: usize) -> Vec<Position> {
    let rows = points.slice(s![range.start..range.start + count, ..]);
    let rows = rows.rows().into_iter();
    rows.map(|row| Some(row.to_vec()).filter(|point| point.iter().all(|v| v.is_finite())))
        .collect()
}

/// A coordinate of a position; NaN where there is none.
fn coordinate(point: &Position, axis: usize) -> f64 {
    let point = point.as_ref();
    point
        .and_then(|point| point.get(axis))
        .copied()
        .unwrap_or(f64::NAN)
}

/// How long a path is, where it is visible.
fn length(path: &[Position]) -> f64 {
    let steps = path.windows(2).filter_map(|pair| match pair {
        [Some(a), Some(b)] => {
            let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
            Some(squares.sum::<f64>().sqrt())
        }
        _ => None,
    });
    steps.sum()
}

/// A path through points, with gaps where there are none.
fn path(points: impl Iterator<Item = Option<[f64; 2]>>) -> String {
    let mut path = String::new();
    let mut is_down = false;
    for point in points {
        if let Some([x, y]) = point {
            let step = if is_down { 'L' } else { 'M' };
            let _ = write!(path, "{step}{x:.1} {y:.1}");
        }
        is_down = point.is_some();
    }
    path
}

/// Each frame is visible in its part of the time. A check box stops it; paper, and whoever wants
/// less motion, sees the first frame.
fn animation(count: usize) -> String {
    let seconds = count as f64 / SPEED;
    let part = 100.0 * (1.0 / count as f64 + OVERLAP).min(1.0);
    format!(
        ".film-frame {{ visibility: hidden; animation: film-play {seconds:.3}s step-end infinite; }}
.film-number {{ font: 13px system-ui, sans-serif; fill: #fff; stroke: #0b0d0f; stroke-width: 3px; paint-order: stroke; }}
@keyframes film-play {{ 0% {{ visibility: visible; }} {part:.5}% {{ visibility: hidden; }} }}
#film-pause:checked ~ .plate .film-frame {{ animation-play-state: paused; }}
@media print {{ .film-frame {{ animation-play-state: paused; }} }}
@media (prefers-reduced-motion: reduce) {{
  #film-pause:not(:checked) ~ .plate .film-frame {{ animation-play-state: paused; }}
  #film-pause:checked ~ .plate .film-frame {{ animation-play-state: running; }}
  label[for=film-pause] {{ font-size: 0; }} label[for=film-pause]::after {{ content: \"Play\"; font-size: 1rem; }}
}}"
    )
}

/// The forms of ground truth and mapped keypoint, outlined so that they are seen on every image.
fn marks() -> Markup {
    let diamond = format!("M0 -{MARK}L{MARK} 0L0 {MARK}L-{MARK} 0Z");
    html! {
        g #film-truth fill="none" {
            circle r=(MARK) stroke="#0b0d0f" stroke-width="4.5" {}
            circle r=(MARK) stroke="currentColor" stroke-width="2.5" {}
        }
        path #film-mapped d=(diamond) fill="currentColor" stroke="#0b0d0f" stroke-width="1.5" {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(frames: usize, image: Option<&str>) -> Film {
        let at = |t: usize| Some(vec![t as f64 / frames as f64, 0.0]);
        Film {
            sequence: "a <b>".to_owned(),
            length: frames,
            size: [64, 48],
            frames: (0..frames as u64).collect(),
            images: image.map_or_else(Vec::new, |image| vec![Some(image.to_owned()); frames]),
            tracks: vec![FilmTrack {
                object: "cube".to_owned(),
                keypoint: 3,
                truth: (0..frames).map(at).collect(),
                mapped: vec![None; frames],
            }],
        }
    }

    #[test]
    fn every_frame_has_its_turn_and_nothing_comes_from_elsewhere() {
        let page = film(4, Some("https://example.org/a.png"))
            .to_html()
            .expect("a film")
            .into_string();
        assert!(!page.contains("example.org"));
        assert!(page.contains("a &lt;b&gt;: 4 of 4 frames"));
        for delay in ["-0.800s", "-0.600s", "-0.400s", "-0.200s"] {
            assert!(
                page.contains(&format!("animation-delay:{delay}")),
                "{delay}"
            );
        }
        assert_eq!(page.matches("#film-truth\"").count(), 4);
        assert_eq!(page.matches("href=\"#film-mapped").count(), 0);
    }

    #[test]
    fn what_is_too_much_for_a_page_is_left_out_and_counted() {
        let image = format!("data:image/png;base64,{}", "A".repeat(BUDGET / 10));
        let html = |film: Film| film.to_html().expect("a film").into_string();
        let page = html(film(50, Some(&image)));
        assert!(page.contains("9 of 50 frames"));
        assert!(page.len() < BUDGET + 100_000);
        assert!(html(film(500, None)).contains("120 of 500 frames"));
        assert_eq!(html(film(0, None)), "");
    }

    #[test]
    fn in_space_coordinates_are_drawn() {
        let mut film = film(4, None);
        let point = |t: usize| Some(vec![t as f64, 0.5, 7.0]);
        film.tracks[0].truth = (0..4).map(point).collect();
        film.tracks[0].mapped = vec![point(0), None, point(2), point(3)];
        assert!(film.is_in_space());
        let page = film.to_html().expect("a film").into_string();
        assert_eq!(page.matches("<svg").count(), 3);
        assert!(page.contains("4 of 4 frames, in the unit of the ground truth"));
        assert!(!page.contains("film-frame"));
    }

    #[test]
    fn the_points_of_a_sequence_are_its_own() {
        let points = ndarray::array![[0.0, 0.1], [1.0, 1.1], [f64::NAN, 2.1], [3.0, 3.1]];
        let range = SequenceRange {
            name: "b".to_owned(),
            start: 1,
            length: 3,
        };
        assert_eq!(positions(&points, &range, 2), [Some(vec![1.0, 1.1]), None]);
    }

    #[test]
    fn a_path_has_gaps() {
        let points = [Some([0.0, 1.0]), Some([2.0, 3.0]), None, Some([4.0, 5.0])];
        assert_eq!(path(points.into_iter()), "M0.0 1.0L2.0 3.0M4.0 5.0");
    }
}
