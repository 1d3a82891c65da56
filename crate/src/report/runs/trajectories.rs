//! Trajectories on their frames, as in the paper: the object white, its best keypoint red, the
//! transformed keypoint blue.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Rectangle};
use plotters::style::{Color as _, IntoFont as _, RGBColor, ShapeStyle, TextStyle};

use super::panels::{Backend, Done, EM, INK, PAPER, text};
use crate::error::{Error, Result};
use crate::report::draw::{Figure, Measured};

/// Width of a frame in the figure, in pixels; its height follows.
const FRAME: u32 = 220;
/// Between frames.
const GAP: u32 = 10;
/// Room for the legend, and for the names of the sequences below it.
const TOP: u32 = 58;
/// Room for the names of the objects, and between them and the edge.
const LEFT: u32 = 100;
const MARGIN: i32 = 8;

const TRUTH: RGBColor = RGBColor(255, 255, 255);
const KEYPOINT: RGBColor = RGBColor(230, 40, 40);
const TRANSFORMED: RGBColor = RGBColor(40, 130, 255);
/// Around the lines, so that they show on any frame.
const EDGE: RGBColor = RGBColor(16, 16, 16);

/// A sequence of a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// What stands above it.
    pub title: String,
    /// A frame of it, as PNG.
    pub png: Vec<u8>,
    /// Width and height of that frame.
    pub size: [u32; 2],
    /// The points of every object.
    pub paths: Vec<Trajectory>,
}

/// One object and its best keypoint over a sequence; points (x, y) in ndc, NaN where the object is
/// not visible.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// The object.
    pub truth: Vec<[f64; 2]>,
    /// The keypoint where it lies in the image.
    pub keypoint: Vec<[f64; 2]>,
    /// The keypoint under the fitted map.
    pub transformed: Vec<[f64; 2]>,
}

/// A figure of `scenes` side by side, with a row an object: `objects` are its name and a line of
/// smaller print below it. `name` is the name of its files, see
/// [`FileNames`](crate::report::draw::FileNames).
///
/// # Errors
/// When there is no scene, a scene has another number of objects, or the figure cannot be drawn.
pub fn trajectories(
    name: String,
    caption: String,
    objects: &[(String, String)],
    scenes: &[Scene],
) -> Result<Figure> {
    let Some(first) = scenes.first() else {
        return Err(Error::input(
            "no sequence is given for a figure of trajectories; expected one or more",
        ));
    };
    if let Some(scene) = scenes
        .iter()
        .find(|scene| scene.paths.len() != objects.len())
    {
        return Err(Error::input(format!(
            "{} has trajectories of {} objects; expected {}",
            scene.title,
            scene.paths.len(),
            objects.len()
        )));
    }
    let height = |scene: &Scene| (FRAME * scene.size[1] / scene.size[0].max(1)).max(1);
    let tallest = scenes
        .iter()
        .map(height)
        .max()
        .unwrap_or_else(|| height(first));
    let size = [
        (LEFT + scenes.len() as u32 * (FRAME + GAP)).max(560),
        TOP + objects.len() as u32 * (tallest + GAP),
    ];
    let left = |column: usize| LEFT + column as u32 * (FRAME + GAP);
    let top = |row: usize| TOP + row as u32 * (tallest + GAP);

    let mut svg = String::new();
    let mut drawn = || -> Done {
        let area =
            Measured(SVGBackend::with_string(&mut svg, (size[0], size[1]))).into_drawing_area();
        area.fill(&PAPER)?;
        legend(&area)?;
        for (column, scene) in scenes.iter().enumerate() {
            area.draw_text(
                &scene.title,
                &text(),
                (left(column) as i32, TOP as i32 - EM - 5),
            )?;
            for (row, path) in scene.paths.iter().enumerate() {
                let (x, y) = (left(column), top(row));
                let cell = area.clone().shrink((x, y), (FRAME, height(scene)));
                draw(&cell, path, [FRAME, height(scene)])?;
            }
        }
        for (row, (object, detail)) in objects.iter().enumerate() {
            let y = top(row) as i32;
            area.draw_text(object, &text(), (MARGIN, y + 2))?;
            for (i, line) in detail.lines().enumerate() {
                let small = TextStyle::from(("sans-serif", EM - 2).into_font()).color(&INK);
                area.draw_text(line, &small, (MARGIN, y + 2 + (i as i32 + 1) * (EM + 4)))?;
            }
        }
        area.present()
    };
    drawn().map_err(|e| Error::input(format!("a figure could not be drawn: {e}")))?;

    // plotters draws no pictures in SVG: they lie between its background, which comes first, and
    // all else; each is there once.
    let mut pictures = String::new();
    for (column, scene) in scenes.iter().enumerate() {
        let id = format!("{}-{column}", name);
        let (height, data) = (height(scene), STANDARD.encode(&scene.png));
        pictures += &format!(
            "<defs><image id=\"{id}\" width=\"{FRAME}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{data}\"/></defs>\n"
        );
        for row in 0..objects.len() {
            pictures += &format!(
                "<use href=\"#{id}\" x=\"{}\" y=\"{}\"/>\n",
                left(column),
                top(row)
            );
        }
    }
    let open = svg.find("/>").map_or(0, |end| end + 2);
    svg.insert_str(open, &format!("\n{pictures}"));
    Ok(Figure { name, caption, svg })
}

fn legend(area: &DrawingArea<Backend<'_>, Shift>) -> Done {
    let entries = [
        (TRUTH, "ground truth"),
        (KEYPOINT, "best keypoint"),
        (TRANSFORMED, "best keypoint, transformed"),
    ];
    let mut left = LEFT as i32;
    let middle = EM;
    for (color, label) in entries {
        let ends = [(left, middle - 3), (left + 22, middle + 3)];
        area.draw(&Rectangle::new(ends, ShapeStyle::from(&color).filled()))?;
        area.draw(&Rectangle::new(
            ends,
            ShapeStyle::from(&INK).stroke_width(1),
        ))?;
        area.draw_text(label, &text(), (left + 28, middle - EM / 2))?;
        left += 28 + area.estimate_text_size(label, &text())?.0 as i32 + 2 * EM;
    }
    Ok(())
}

/// The lines of one object over a frame of `size`; a ring marks where they start.
fn draw(cell: &DrawingArea<Backend<'_>, Shift>, path: &Trajectory, size: [u32; 2]) -> Done {
    let place = |point: &[f64; 2]| {
        // What lies outside the image stays at its edge, so that it is not drawn over the next
        // frame.
        let pixel = |axis: usize| {
            let share = (point[axis].clamp(-1.0, 1.0) + 1.0) / 2.0;
            (share * f64::from(size[axis])).round() as i32
        };
        (pixel(0), pixel(1))
    };
    // The keypoint as it is lies below, since what counts are the other two.
    for (color, points) in [
        (KEYPOINT, &path.keypoint),
        (TRUTH, &path.truth),
        (TRANSFORMED, &path.transformed),
    ] {
        for run in points.split(|p| p.iter().any(|v| !v.is_finite())) {
            let line: Vec<(i32, i32)> = run.iter().map(place).collect();
            let Some(start) = line.first().copied() else {
                continue;
            };
            for (color, width) in [(EDGE, 4), (color, 2)] {
                cell.draw(&PathElement::new(line.clone(), color.stroke_width(width)))?;
            }
            for (color, radius) in [(EDGE, 5), (color, 4)] {
                cell.draw(&Circle::new(start, radius, color.filled()))?;
            }
        }
    }
    Ok(())
}
