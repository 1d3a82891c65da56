//! The figures of agents: success over steps and at the end, and beside the tracking of encoders.

use std::collections::BTreeSet;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Circle, PathElement, Polygon};
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, RGBColor, ShapeStyle};

use super::statistics::{AgentGroupReport, AgentsReport, EncoderReport};
use crate::error::Result;
use crate::report::draw::{Decades, Figure, fitted, tick, width_of};
use crate::report::runs::panels::{
    Area, Backend, Done, EM, FLOOR, INK, MARGIN, PANEL, color, panels, plain, text,
};

/// Ends of an axis of shares, so that lines at 0 and 1 are seen whole.
const SHARES: std::ops::Range<f64> = -0.02..1.02;
/// Width of a panel of curves, and of one that stands alone.
const CURVES: u32 = 440;
const ALONE: u32 = 600;
/// Height of a row of the success at the end.
const ROW: u32 = 26;
/// The longest name of a group beside its row, in pixels.
const NAMES: i32 = 330;
/// Between encoders of the same TC.
const APART: f64 = 0.025;

type Chart<'a, 'b, X> = ChartContext<'a, Backend<'b>, Cartesian2d<X, RangedCoordf64>>;

/// All figures of agents.
///
/// # Errors
/// When a figure cannot be drawn.
pub(in crate::report::runs) fn agents_figures(agents: &AgentsReport) -> Result<Vec<Figure>> {
    let tasks: BTreeSet<Option<&str>> = placed(agents).map(|(_, g)| g.task.as_deref()).collect();
    let mut figures = Vec::new();
    for task in &tasks {
        let name = match task {
            Some(task) if tasks.len() > 1 => format!("success-over-steps-{task}"),
            _ => "success-over-steps".to_owned(),
        };
        figures.push(over_steps(agents, *task, name)?);
    }
    if !tasks.is_empty() {
        figures.push(at_the_end(agents)?);
    }
    if agents.encoders.iter().any(|encoder| encoder.tc.is_some()) {
        figures.push(beside_tracking(agents)?);
    }
    Ok(figures)
}

/// The groups with complete runs, and which colour they have.
fn placed(agents: &AgentsReport) -> impl Iterator<Item = (usize, &AgentGroupReport)> + Clone {
    let groups = agents.groups.iter().enumerate();
    groups.filter(|(_, group)| !group.curve.is_empty())
}

/// Whether a group belongs to the panel with what a robot measures of itself, or without; the full
/// state, which the others are held against, belongs to both.
fn belongs(group: &AgentGroupReport, with_robot: bool) -> bool {
    match group.state.as_deref() {
        None | Some("full") => true,
        Some(state) => state.ends_with("+robot") == with_robot,
    }
}

fn over_steps(agents: &AgentsReport, task: Option<&str>, name: String) -> Result<Figure> {
    let shown = || placed(agents).filter(|(_, group)| group.task.as_deref() == task);
    let told = [
        (false, "keypoints or points"),
        (true, "with the robot's position and velocity"),
    ];
    let tells = |with: bool| shown().any(|(_, g)| belongs(g, with) && !belongs(g, !with));
    let mut states: Vec<(bool, &str)> = told.into_iter().filter(|(with, _)| tells(*with)).collect();
    if states.is_empty() {
        states.push((false, ""));
    }
    let legend = shown().map(|(i, group)| (group.name.clone(), color(i)));
    let legend: Vec<(String, RGBColor)> = legend.collect();
    let last = shown()
        .map(|(_, group)| group.steps)
        .max()
        .unwrap_or(1)
        .max(1) as f64;
    let width = if states.len() > 1 { CURVES } else { ALONE };
    let svg = panels(states.len(), width, PANEL[1] + 30, &legend, |k, panel| {
        let (with_robot, title) = states[k];
        let title = if states.len() > 1 { title } else { "" };
        let mut chart = chart(panel, title, 0.0..last, 4)?;
        grid(
            &mut chart,
            "steps",
            if k == 0 { "success" } else { "" },
            &|x| steps(*x, last),
        )?;
        let mine = || shown().filter(|(_, group)| belongs(group, with_robot));
        for (i, group) in mine() {
            band(&mut chart, group, color(i))?;
        }
        // The best group is the first, and is drawn over the others.
        for (i, group) in mine().collect::<Vec<_>>().into_iter().rev() {
            let points = group.curve.iter().map(|p| (p.step as f64, p.iqm));
            let dot = if group.curve.len() == 1 { 3 } else { 0 };
            let style = color(i).stroke_width(2).filled();
            chart.draw_series(LineSeries::new(points, style).point_size(dot))?;
        }
        Ok(())
    })?;
    let of = task.map(|task| format!(" at the task {task}"));
    Ok(Figure {
        name,
        caption: format!(
            "Success{} over steps: interquartile mean over the runs, smoothed by a Gaussian of {} \
             evaluations; shaded: its 95 % interval by a stratified bootstrap over the runs.",
            of.unwrap_or_default(),
            agents.smoothing
        ),
        svg,
    })
}

/// The interval of a group over steps.
fn band<'b>(
    chart: &mut Chart<'_, 'b, RangedCoordf64>,
    group: &AgentGroupReport,
    color: RGBColor,
) -> Done {
    let ends = |i: usize| {
        let points = group.curve.iter();
        points.filter_map(move |point| Some((point.step as f64, point.interval?[i])))
    };
    let back: Vec<(f64, f64)> = ends(1).collect();
    let around: Vec<(f64, f64)> = ends(0).chain(back.into_iter().rev()).collect();
    if around.len() > 2 {
        chart.draw_series([Polygon::new(around, color.mix(0.16).filled())])?;
    }
    Ok(())
}

fn at_the_end(agents: &AgentsReport) -> Result<Figure> {
    let rows: Vec<(usize, &AgentGroupReport)> = placed(agents).collect();
    let names: Vec<String> = rows
        .iter()
        .map(|(_, g)| fitted(&g.name, EM, NAMES))
        .collect();
    let widest = names
        .iter()
        .map(|name| width_of(name, EM))
        .max()
        .unwrap_or(0);
    let height = ROW * rows.len() as u32 + 4 * EM as u32;
    let svg = panels(1, 460 + widest as u32, height, &[], |_, panel| {
        let end = rows.len() as f64;
        let mut chart = ChartBuilder::on(panel)
            .margin_top(EM)
            .margin_right(2 * EM)
            .x_label_area_size(3 * EM)
            .y_label_area_size(widest + 2 * EM)
            .build_cartesian_2d(SHARES, 0.0..end)?;
        plain(&mut chart.configure_mesh())
            .disable_y_mesh()
            .x_labels(6)
            .y_labels(0)
            .x_desc("success at the end")
            .x_label_formatter(&|x| format!("{x:.1}"))
            .draw()?;
        for (row, ((i, group), name)) in rows.iter().zip(&names).enumerate() {
            let y = end - row as f64 - 0.5;
            one_row(&mut chart, y, group, color(*i))?;
            let (left, middle) = chart.backend_coord(&(SHARES.start, y));
            let (xs, ys) = panel.get_pixel_range();
            let beside = text().pos(Pos::new(HPos::Right, VPos::Center));
            panel.draw_text(name, &beside, (left - xs.start - EM, middle - ys.start))?;
        }
        Ok(())
    })?;
    Ok(Figure {
        name: "success-at-the-end".to_owned(),
        caption:
            "Success at the end of the curves: interquartile mean over the runs with its 95 % \
                  interval; small: every run."
                .to_owned(),
        svg,
    })
}

/// The runs of a group, their interquartile mean and its interval.
fn one_row<'b>(
    chart: &mut Chart<'_, 'b, RangedCoordf64>,
    y: f64,
    group: &AgentGroupReport,
    color: RGBColor,
) -> Done {
    let soft = color.mix(0.35).filled();
    chart.draw_series(
        group
            .runs
            .iter()
            .map(|run| Circle::new((run.success, y), 3, soft)),
    )?;
    if let Some([low, high]) = group.success_interval {
        let line = PathElement::new(vec![(low, y), (high, y)], color.stroke_width(3));
        chart.draw_series([line])?;
    }
    if let Some(success) = group.success {
        chart.draw_series([Circle::new((success, y), 5, color.filled())])?;
    }
    Ok(())
}

fn beside_tracking(agents: &AgentsReport) -> Result<Figure> {
    let settings = agents.settings();
    let legend = settings.iter().enumerate();
    let legend: Vec<_> = legend.map(|(i, s)| ((*s).to_owned(), color(i))).collect();
    let count = 1 + agents.objects.len();
    let svg = panels(
        count,
        PANEL[0],
        PANEL[1] + 10,
        &legend,
        |panel_at, panel| {
            let object = panel_at.checked_sub(1);
            let title = measure_title(agents, object);
            match object {
                None => {
                    let mut chart = chart(panel, &title, -0.06..1.06, 6)?;
                    grid(&mut chart, "TC", "success at the end", &|x| {
                        format!("{x:.1}")
                    })?;
                    let tcs = dodged(agents);
                    scatter(&mut chart, agents, |at, _| tcs[at])
                }
                Some(k) => {
                    let error = |encoder: &EncoderReport| encoder.errors[k];
                    let threshold = agents.thresholds[k];
                    let errors = agents.encoders.iter().filter_map(error).chain([threshold]);
                    let axis = Decades::around(errors, FLOOR, MARGIN);
                    let mut chart = chart(panel, &title, axis, 5)?;
                    grid(&mut chart, "tracking error", "", &|x| tick(*x))?;
                    let line = [(threshold, SHARES.start), (threshold, SHARES.end)];
                    let ink = ShapeStyle::from(&INK);
                    chart.draw_series(DashedLineSeries::new(line, 4, 4, ink))?;
                    scatter(&mut chart, agents, |_, encoder| {
                        error(encoder).map(|e| e.max(FLOOR))
                    })
                }
            }
        },
    )?;
    Ok(Figure {
        name: "tracking-and-success".to_owned(),
        caption: "Tracking and success: a point an encoder, the interquartile mean of its runs' \
                  success at the end with its 95 % interval, over its TC (equal ones side by side) \
                  and over the tracking error of every object; dashed: the threshold; ρ: \
                  Spearman's rank correlation."
            .to_owned(),
        svg,
    })
}

/// `TC, ρ = 0.80`; the correlations of several settings in the order of the legend.
fn measure_title(agents: &AgentsReport, object: Option<usize>) -> String {
    let name = object.map(|k| &agents.objects[k]);
    let reports = agents
        .correlations
        .iter()
        .filter(|r| r.object.as_ref() == name);
    let rho = reports.map(|report| report.rho.map_or("–".to_owned(), |rho| format!("{rho:.2}")));
    let rho = rho.collect::<Vec<_>>().join(" / ");
    let name = name.map_or("TC", String::as_str);
    format!("{name}, ρ = {rho}")
}

/// The TC of every encoder; equal ones lie side by side.
fn dodged(agents: &AgentsReport) -> Vec<Option<f64>> {
    let all = &agents.encoders;
    let place = |(at, encoder): (usize, &EncoderReport)| {
        let tc = encoder.tc?;
        let same = |other: &&EncoderReport| other.tc == Some(tc);
        let before = all[..at].iter().filter(same).count() as f64;
        let count = all.iter().filter(same).count() as f64;
        Some(tc + APART * (before - (count - 1.0) / 2.0))
    };
    all.iter().enumerate().map(place).collect()
}

/// Encoders by their success, with its interval, at the places of `x`.
fn scatter<'b, X: Ranged<ValueType = f64>>(
    chart: &mut Chart<'_, 'b, X>,
    agents: &AgentsReport,
    x: impl Fn(usize, &EncoderReport) -> Option<f64>,
) -> Done {
    let settings = agents.settings();
    for (at, encoder) in agents.encoders.iter().enumerate() {
        let Some(x) = x(at, encoder) else { continue };
        let setting = settings
            .iter()
            .position(|setting| *setting == encoder.setting);
        let color = color(setting.unwrap_or(0));
        if let Some([low, high]) = encoder.success_interval {
            let style = color.mix(0.5).stroke_width(2);
            chart.draw_series([PathElement::new(vec![(x, low), (x, high)], style)])?;
        }
        chart.draw_series([Circle::new((x, encoder.success), 4, color.filled())])?;
    }
    Ok(())
}

/// A chart of success over something.
fn chart<'a, 'b, X: plotters::coord::ranged1d::AsRangedCoord<Value = f64>>(
    panel: &'a Area<'b>,
    title: &str,
    x: X,
    margin: i32,
) -> std::result::Result<
    Chart<'a, 'b, X::CoordDescType>,
    plotters::drawing::DrawingAreaErrorKind<std::io::Error>,
> {
    let mut builder = ChartBuilder::on(panel);
    builder
        .margin(margin)
        .margin_right(2 * EM)
        .x_label_area_size(3 * EM)
        .y_label_area_size(4 * EM);
    if !title.is_empty() {
        builder.caption(title, text());
    }
    builder.build_cartesian_2d(x, SHARES)
}

fn grid<X: Ranged<ValueType = f64> + ValueFormatter<f64>>(
    chart: &mut Chart<'_, '_, X>,
    x: &str,
    y: &str,
    written: &dyn Fn(&f64) -> String,
) -> Done {
    plain(&mut chart.configure_mesh())
        .x_labels(6)
        .y_labels(6)
        .x_desc(x)
        .y_desc(y)
        .x_label_formatter(&written)
        .y_label_formatter(&|y| format!("{y:.1}"))
        .draw()
}

/// Steps on an axis that ends at `last`, in one unit: `2500`, `2.5k` up to `10k`, `0.5M` up to `1M`.
fn steps(count: f64, last: f64) -> String {
    match last {
        _ if count == 0.0 => "0".to_owned(),
        last if last >= 1e6 => format!("{}M", count / 1e6),
        last if last >= 1e4 => format!("{}k", count / 1e3),
        _ => format!("{count}"),
    }
}
