//! Self-contained HTML pages: one file, no scripts, nothing that is fetched.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::Figure;

/// Figures are drawn in the colours of a light page; these are the ones that change in the dark.
const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1c1c1e; --soft: #63636a; --plate: #ffffff; --line: #dedee3; --good: #00734f;
  --bad: #a8430a; --warn: #fdf3dc; --shade: #1c1c1e40; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #ececf0; --soft: #a3a3aa; --plate: #17171a; --line: #3a3a40; --good: #4fd1a5; --bad: #ffa36b; --warn: #332812;
    --shade: #ececf04d; }
}
body { margin: 0 auto; padding: 2.5rem 1.25rem 4rem; max-width: 68rem; background: var(--plate); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.75rem; line-height: 1.2; letter-spacing: -0.015em; margin: 0 0 .25rem; }
h2 { font-size: 1.2rem; margin: 2.75rem 0 .5rem; }
p, figcaption, li { max-width: 46rem; }
p, figcaption { color: var(--soft); }
.lead { color: var(--ink); font-size: 1.1rem; }
.note { background: var(--warn); color: var(--ink); border-radius: 8px; padding: .6rem .9rem; }
.table { overflow-x: auto; background:
    linear-gradient(to right, var(--plate) 40%, transparent) left / 2.5rem 100% local,
    linear-gradient(to left, var(--plate) 40%, transparent) right / 2.5rem 100% local,
    linear-gradient(to right, var(--shade), transparent) left / .9rem 100%,
    linear-gradient(to left, var(--shade), transparent) right / .9rem 100%; background-repeat: no-repeat; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .75rem 0; }
th, td { padding: .35rem .8rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th { font-weight: 600; vertical-align: bottom; }
th:first-child, td:first-child, td.text, th.text { text-align: left; }
td.text { white-space: normal; min-width: 11rem; }
td small { color: var(--soft); font-weight: 400; }
td.good { color: var(--good); font-weight: 600; }
td.bad { color: var(--bad); }
tr.first td { border-top: 1px solid var(--soft); }
figure { margin: 1.5rem 0; }
figure .plate { overflow-x: auto; }
.film-space { display: grid; grid-template-columns: repeat(auto-fit, minmax(17rem, 1fr)); gap: .5rem; }
.film-space svg { width: 100%; height: auto; }
figure .white { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: .5rem; }
pre { padding: .75rem 1rem; border: 1px solid var(--line); border-radius: 8px; white-space: pre-wrap; overflow-wrap: anywhere;
  font: .875rem/1.5 ui-monospace, monospace; }
figure svg { display: block; height: auto; max-width: 100%; min-width: 30rem; }
@media screen and (max-width: 33rem) {
  figure .plate::before { content: \"Scroll sideways →\"; display: block; position: sticky; left: 0;
    width: fit-content; padding: 0 .25rem .25rem; color: var(--soft); font-size: .8125rem; }
  figure .white::before { color: #56606b; }
}
figure .plate:not(.white) svg [fill=\"#222222\"] { fill: var(--ink); }
figure .plate:not(.white) svg [stroke=\"#222222\"] { stroke: var(--ink); }
figure .plate:not(.white) svg [stroke=\"#DEDEDE\"] { stroke: var(--line); }
figure .plate:not(.white) svg > rect:first-of-type[fill=\"#FFFFFF\"] { fill: var(--plate); }
#film { max-width: 34rem; }
#film svg { display: block; width: 100%; height: auto; border-radius: 8px; }
.film-objects { display: flex; flex-wrap: wrap; gap: .25rem 1.25rem; margin: .5rem 0; color: var(--ink); }
.film-objects i { display: inline-block; width: .7rem; height: .7rem; margin-right: .4rem; border-radius: 50%; }
@media print {
  :root { --ink: #000; --soft: #444; --plate: #fff; --line: #ccc; --good: #00734f; --bad: #a8430a; --warn: #eee; }
  body { max-width: none; padding: 0; } figure, tr { break-inside: avoid; } figure svg { min-width: 0; }
  .table { overflow: visible; background: none; } th, td { padding: .25rem .4rem; white-space: normal; }
}
";

/// A page of its own.
pub(in crate::report) fn document(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { h1 { (title) } (body) }
        }
    }
    .into_string()
}

/// The same for a part of a page of somebody else, such as the output of a notebook: it changes
/// nothing around it. The figures stand on white, whatever the page is in.
const PART_STYLE: &str = "
.tracklens { font-size: 14px; line-height: 1.45; max-width: 56rem; }
.tracklens table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .5rem 0; }
.tracklens th, .tracklens td { padding: .2rem .6rem; text-align: right; }
.tracklens th:first-child, .tracklens td:first-child, .tracklens .text { text-align: left; }
.tracklens td.good { color: #00734f; font-weight: 600; } .tracklens td.bad { color: #a8430a; }
.tracklens figure { margin: 1rem 0; } .tracklens figcaption { font-size: 12px; }
.tracklens .white { background: #fff; padding: .5rem; overflow-x: auto; }
.tracklens svg { display: block; height: auto; max-width: 100%; }
";

/// A part of a page of somebody else.
pub(in crate::report) fn part(title: &str, body: &Markup) -> String {
    html! {
        div.tracklens { style { (PreEscaped(PART_STYLE)) } p { strong { (title) } } (body) }
    }
    .into_string()
}

/// A figure with its caption; on white where its colours are made for that.
pub(in crate::report) fn figure(figure: &Figure, is_white: bool) -> Markup {
    html! {
        figure id=(figure.name) {
            div.plate.white[is_white] role="region" tabindex="0" aria-label=(figure.name) { (PreEscaped(&figure.svg)) }
            figcaption { (figure.caption) }
        }
    }
}
