//! The paper's figures over many runs, as SVG by plotters.

use std::ops::Range;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::element::{Circle, PathElement, Rectangle};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle};

use super::agents::agents_figures;
use super::draws::SMOOTHING;
use super::group::{Group, Runs};
use super::panels::{
    Area, Backend, Done, EM, FLOOR, INK, MARGIN, PANEL, color, panels, plain, text,
};
use super::run::Run;
use super::statistics::{GroupReport, RunsReport};
use crate::error::Result;
use crate::metric::Object;
use crate::metric::stats::{Sample, performance_profile, smooth};
use crate::report::draw::{Decades, Figure, FileNames, tick};

/// With fewer runs than this a box plot shows every one, since quartiles of so few say little.
const FEW: usize = 8;

type Chart<'a, 'b, X> = ChartContext<'a, Backend<'b>, Cartesian2d<X, Decades>>;

/// All figures of the runs.
///
/// # Errors
/// When a figure cannot be drawn, or an error in a log is not a number.
pub fn runs_figures(runs: &Runs, report: &RunsReport) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    if !report.groups.is_empty() {
        figures.push(boxes(runs, report)?);
    }
    if report.has_spread() {
        figures.insert(0, capabilities(report)?);
        figures.push(profiles(runs, report)?);
    }
    // Detectors that were scored as they are have no epochs.
    let has_epochs = |group: &Group| group.complete().any(|run| !run.epochs.is_empty());
    let mut names = FileNames::default();
    for (i, group) in runs
        .groups
        .iter()
        .enumerate()
        .filter(|(_, group)| has_epochs(group))
    {
        let name = format!("errors-{}", names.unique(&group.name));
        figures.push(curves(runs, group, i, name)?);
    }
    if runs.groups.iter().any(has_epochs) {
        figures.push(reconstruction(runs)?);
    }
    if let Some(agents) = &report.agents {
        figures.extend(agents_figures(agents)?);
    }
    Ok(figures)
}

/// The axis of positive values.
fn log_axis(values: impl Iterator<Item = f64>) -> Decades {
    Decades::around(values, FLOOR, MARGIN)
}

fn curves(runs: &Runs, group: &Group, place: usize, name: String) -> Result<Figure> {
    let objects = &runs.objects;
    let of = |k: usize| -> Result<Vec<Vec<f64>>> {
        let errors = |run: &Run| {
            let values = run.epochs.iter().filter_map(|epoch| epoch.errors[k]);
            smooth(&values.collect::<Vec<f64>>(), SMOOTHING)
        };
        group.complete().map(errors).collect()
    };
    let all: Vec<Vec<Vec<f64>>> = (0..objects.len()).map(of).collect::<Result<_>>()?;
    let ink = color(place);
    let svg = panels(
        objects.len(),
        PANEL[0],
        PANEL[1],
        &[(group.name.clone(), ink)],
        |k, panel| {
            let Object { name, threshold } = &objects[k];
            let epochs = all[k].iter().map(Vec::len).max().unwrap_or(1).max(2);
            let axis = log_axis(all[k].iter().flatten().copied().chain([*threshold]));
            let mut chart = log_chart(panel, name, 1.0..epochs as f64, axis)?;
            plain(&mut chart.configure_mesh())
                .x_labels(6)
                .y_labels(6)
                .x_desc("epoch")
                .y_desc(if k == 0 { "tracking error" } else { "" })
                .x_label_formatter(&|x| format!("{x:.0}"))
                .y_label_formatter(&|y| tick(*y))
                .draw()?;
            for curve in &all[k] {
                let points = curve
                    .iter()
                    .enumerate()
                    .map(|(i, v)| ((i + 1) as f64, v.max(FLOOR)));
                chart.draw_series(LineSeries::new(points, ink.mix(0.7).stroke_width(1)))?;
            }
            dashed(&mut chart, [(1.0, *threshold), (epochs as f64, *threshold)])
        },
    )?;
    Ok(Figure {
        name,
        caption: format!(
            "Tracking errors of {} over epochs on the validation sequences, a line a run, smoothed by a Gaussian of 2.5 \
             epochs; dashed: the threshold.",
            group.name
        ),
        svg,
    })
}

fn boxes(runs: &Runs, report: &RunsReport) -> Result<Figure> {
    let groups: Vec<_> = report
        .groups
        .iter()
        .filter(|group| group.complete > 0)
        .collect();
    let width = PANEL[0].max(60 + 34 * groups.len() as u32);
    let svg = panels(
        runs.objects.len(),
        width,
        PANEL[1],
        &legend(report),
        |k, panel| {
            let Object { name, threshold } = &runs.objects[k];
            let errors: Vec<Vec<f64>> = groups
                .iter()
                .map(|group| group.runs.iter().filter_map(|run| run.errors[k]).collect())
                .collect();
            let axis = log_axis(errors.iter().flatten().copied().chain([*threshold]));
            let end = groups.len() as f64;
            let mut chart = log_chart(panel, name, 0.0..end, axis)?;
            plain(&mut chart.configure_mesh())
                .disable_x_mesh()
                .x_labels(0)
                .y_labels(6)
                .y_desc(if k == 0 { "tracking error" } else { "" })
                .y_label_formatter(&|y| tick(*y))
                .draw()?;
            for (i, errors) in errors.iter().enumerate() {
                let Ok(sample) = Sample::of(errors) else {
                    continue;
                };
                draw_box(
                    &mut chart,
                    i as f64 + 0.5,
                    &sample,
                    errors,
                    color(place(report, groups[i])),
                )?;
            }
            dashed(&mut chart, [(0.0, *threshold), (end, *threshold)])
        },
    )?;
    Ok(Figure {
        name: "boxplots".to_owned(),
        caption: "Tracking errors of the complete runs at their last epoch: quartiles, whiskers to the furthest run within \
                  1.5 interquartile ranges, the others as circles; of fewer than 8 runs every one as a dot; dashed: the \
                  threshold."
            .to_owned(),
        svg,
    })
}

/// A box of the quartiles with whiskers after Tukey.
fn draw_box<'b>(
    chart: &mut Chart<'_, 'b, RangedCoordf64>,
    x: f64,
    sample: &Sample,
    values: &[f64],
    color: RGBColor,
) -> Done {
    let [_, q1, median, q3, _] = sample.quartiles;
    let reach = 1.5 * (q3 - q1);
    let is_inside = |v: &f64| (q1 - reach..=q3 + reach).contains(v);
    let inside = || values.iter().copied().filter(is_inside);
    let low = inside().fold(q1, f64::min).max(FLOOR);
    let high = inside().fold(q3, f64::max);
    let half = 0.3;
    let line = ShapeStyle::from(&INK).stroke_width(1);
    let path = |points: Vec<(f64, f64)>, style: ShapeStyle| PathElement::new(points, style);
    chart.draw_series([Rectangle::new(
        [(x - half, q1.max(FLOOR)), (x + half, q3)],
        color.mix(0.75).filled(),
    )])?;
    chart.draw_series([
        path(vec![(x, low), (x, q1.max(FLOOR))], line),
        path(vec![(x, q3), (x, high)], line),
        path(vec![(x - half / 2.0, low), (x + half / 2.0, low)], line),
        path(vec![(x - half / 2.0, high), (x + half / 2.0, high)], line),
        path(
            vec![(x - half, median.max(FLOOR)), (x + half, median.max(FLOOR))],
            line.stroke_width(2),
        ),
    ])?;
    if values.len() < FEW {
        let dot = ShapeStyle::from(&INK).filled();
        chart.draw_series(
            values
                .iter()
                .map(|v| Circle::new((x, v.max(FLOOR)), 2, dot)),
        )?;
    } else {
        let outside = values.iter().filter(|v| !is_inside(v));
        chart.draw_series(outside.map(|v| Circle::new((x, v.max(FLOOR)), 3, line)))?;
    }
    Ok(())
}

fn capabilities(report: &RunsReport) -> Result<Figure> {
    let groups: Vec<_> = report
        .groups
        .iter()
        .filter(|group| group.complete > 0)
        .collect();
    let objects: Vec<&str> = groups
        .first()
        .map(|group| group.objects.iter().map(|o| o.name.as_str()).collect())
        .unwrap_or_default();
    let colors: Vec<(String, RGBColor)> = objects
        .iter()
        .enumerate()
        .map(|(k, name)| (format!("TC of {name}"), color(k)))
        .collect();
    let width = (120 + 90 * groups.len() as u32).max(420);
    let svg = panels(1, width, PANEL[1] + 40, &colors, |_, panel| {
        let end = groups.len() as f64;
        let mut chart = ChartBuilder::on(panel)
            .margin(EM)
            .margin_top(2 * EM)
            .x_label_area_size(5 * EM)
            .y_label_area_size(4 * EM)
            .build_cartesian_2d(0.0..end, 0.0..objects.len().max(1) as f64)?;
        plain(&mut chart.configure_mesh())
            .disable_x_mesh()
            .x_labels(0)
            .y_labels(objects.len() + 1)
            .y_desc("sum of mean TC")
            .y_label_formatter(&|y| format!("{y:.0}"))
            .draw()?;
        for (i, group) in groups.iter().enumerate() {
            let x = i as f64;
            let mut bottom = 0.0;
            for (k, object) in group.objects.iter().enumerate() {
                let top = bottom + object.tc.unwrap_or(0.0);
                let bar = Rectangle::new([(x + 0.2, bottom), (x + 0.8, top)], color(k).filled());
                chart.draw_series([bar])?;
                bottom = top;
            }
            let (left, below) = chart.backend_coord(&(x + 0.5, 0.0));
            let [offset_x, offset_y] = {
                let (xs, ys) = panel.get_pixel_range();
                [xs.start, ys.start]
            };
            let centred = text().pos(Pos::new(HPos::Center, VPos::Top));
            let label = |line: &str, row: i32| -> Done {
                let at = (left - offset_x, below - offset_y + EM / 2 + row * (EM + 2));
                panel.draw_text(line, &centred, at)
            };
            let above = chart.backend_coord(&(x + 0.5, bottom)).1 - offset_y - EM - 4;
            panel.draw_text(&format!("{bottom:.2}"), &centred, (left - offset_x, above))?;
            // Long names break after their family.
            match group.name.split_once('-') {
                Some((family, rest)) => {
                    label(family, 0)?;
                    label(&format!("-{rest}"), 1)?;
                }
                None => label(&group.name, 0)?,
            }
            let runs = if group.complete == 1 { "run" } else { "runs" };
            label(&format!("{} {runs}", group.complete), 2)?;
        }
        Ok(())
    })?;
    Ok(Figure {
        name: "tracking-capability".to_owned(),
        caption: "Mean tracking capability of every object over the complete runs, stacked; all objects in all runs would be \
                  their number.".to_owned(),
        svg,
    })
}

fn profiles(runs: &Runs, report: &RunsReport) -> Result<Figure> {
    let svg = panels(
        runs.objects.len(),
        PANEL[0],
        PANEL[1],
        &legend(report),
        |k, panel| {
            let Object { name, threshold } = &runs.objects[k];
            let all: Vec<Vec<f64>> = report
                .groups
                .iter()
                .map(|group| group.runs.iter().filter_map(|run| run.errors[k]).collect())
                .collect();
            let axis = log_axis(all.iter().flatten().copied().chain([*threshold]));
            let mut chart = ChartBuilder::on(panel)
                .margin(EM / 2)
                .caption(name, text())
                .x_label_area_size(3 * EM)
                .y_label_area_size(4 * EM)
                .build_cartesian_2d(axis, 0.0..1.02)?;
            plain(&mut chart.configure_mesh())
                .x_labels(5)
                .y_labels(5)
                .x_desc("tau")
                .y_desc(if k == 0 {
                    "share of runs with error ≤ tau"
                } else {
                    ""
                })
                .x_label_formatter(&|x| tick(*x))
                .y_label_formatter(&|y| format!("{y:.1}"))
                .draw()?;
            for (i, errors) in all
                .iter()
                .enumerate()
                .filter(|(_, errors)| !errors.is_empty())
            {
                // A step at every error, between the ends of the axis.
                let mut taus: Vec<f64> = errors.iter().copied().filter(|e| e.is_finite()).collect();
                taus.sort_unstable_by(f64::total_cmp);
                let shares = performance_profile(errors, &taus).unwrap_or_default();
                let mut points = vec![(axis.low(), 0.0)];
                let mut before = 0.0;
                for (tau, share) in taus.iter().zip(shares) {
                    points.extend([(tau.max(FLOOR), before), (tau.max(FLOOR), share)]);
                    before = share;
                }
                points.push((axis.high(), before));
                chart.draw_series(LineSeries::new(points, color(i).stroke_width(2)))?;
            }
            let line = [(*threshold, 0.0), (*threshold, 1.02)];
            chart.draw_series(DashedLineSeries::new(line, 4, 4, ShapeStyle::from(&INK)))?;
            Ok(())
        },
    )?;
    Ok(Figure {
        name: "performance-profiles".to_owned(),
        caption: "Performance profiles: the share of runs whose tracking error is at most tau (Agarwal et al., 2021); dashed: \
                  the threshold."
            .to_owned(),
        svg,
    })
}

fn reconstruction(runs: &Runs) -> Result<Figure> {
    let losses: Vec<Vec<Vec<f64>>> = runs
        .groups
        .iter()
        .map(|group| {
            let loss = |run: &Run| run.epochs.iter().map(|e| e.reconstruction).collect();
            group.complete().map(loss).collect()
        })
        .collect();
    let colors: Vec<(String, RGBColor)> = runs
        .groups
        .iter()
        .enumerate()
        .map(|(i, group)| (group.name.clone(), color(i)))
        .collect();
    let svg = panels(1, 2 * PANEL[0], PANEL[1], &colors, |_, panel| {
        let values = losses.iter().flatten().flatten().copied();
        let epochs = losses
            .iter()
            .flatten()
            .map(Vec::len)
            .max()
            .unwrap_or(1)
            .max(2);
        let mut chart = log_chart(panel, "", 1.0..epochs as f64, log_axis(values))?;
        plain(&mut chart.configure_mesh())
            .x_labels(8)
            .y_labels(6)
            .x_desc("epoch")
            .y_desc("reconstruction loss")
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| tick(*y))
            .draw()?;
        for (i, group) in losses.iter().enumerate() {
            for run in group {
                let points = run
                    .iter()
                    .enumerate()
                    .map(|(e, v)| ((e + 1) as f64, v.max(FLOOR)));
                chart.draw_series(LineSeries::new(points, color(i).mix(0.7).stroke_width(1)))?;
            }
        }
        Ok(())
    })?;
    Ok(Figure {
        name: "reconstruction-loss".to_owned(),
        caption: "Reconstruction loss on the validation sequences over epochs, a line a run."
            .to_owned(),
        svg,
    })
}

fn log_chart<'a, 'b>(
    panel: &'a Area<'b>,
    title: &str,
    x: Range<f64>,
    y: Decades,
) -> std::result::Result<Chart<'a, 'b, RangedCoordf64>, DrawingAreaErrorKind<std::io::Error>> {
    let mut builder = ChartBuilder::on(panel);
    builder
        .margin(EM / 2)
        .margin_right(EM)
        .x_label_area_size(3 * EM)
        .y_label_area_size(5 * EM);
    if !title.is_empty() {
        builder.caption(title, text());
    }
    builder.build_cartesian_2d(x, y)
}

fn dashed<'b>(chart: &mut Chart<'_, 'b, RangedCoordf64>, line: [(f64, f64); 2]) -> Done {
    chart.draw_series(DashedLineSeries::new(line, 4, 4, ShapeStyle::from(&INK)))?;
    Ok(())
}

fn legend(report: &RunsReport) -> Vec<(String, RGBColor)> {
    let groups = report.groups.iter().enumerate();
    groups
        .filter(|(_, group)| group.complete > 0)
        .map(|(i, group)| (group.name.clone(), color(i)))
        .collect()
}

fn place(report: &RunsReport, group: &GroupReport) -> usize {
    report
        .groups
        .iter()
        .position(|g| g.name == group.name)
        .unwrap_or(0)
}
