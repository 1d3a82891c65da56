//! Tables as HTML.

use maud::{Markup, html};

use super::{Cell, ColumnKind, Emphasis, Table};

impl Table {
    /// The table as HTML in a region that scrolls sideways; the caption is its label.
    pub(in crate::report) fn to_html(&self) -> Markup {
        html! {
            div.table role="region" tabindex="0" aria-label=(self.caption) {
                table {
                    thead { tr {
                        @for (j, column) in self.columns.iter().enumerate() {
                            th class=[self.text_class(j)] { (column.label) }
                        }
                    } }
                    tbody { @for i in 0..self.rows.len() { (self.row(i)) } }
                }
            }
            @if !self.note.is_empty() { p { (self.note) } }
        }
    }

    fn row(&self, i: usize) -> Markup {
        html! {
            tr class=[self.begins_group(i).then_some("first")] {
                @for (j, cell) in self.rows[i].iter().enumerate() {
                    td class=[self.cell_class(j, cell)] {
                        @if !self.repeats(i, j) { (content(cell)) }
                    }
                }
            }
        }
    }

    /// The first column is aligned to the left whatever it holds.
    fn text_class(&self, j: usize) -> Option<&'static str> {
        (j > 0 && self.columns[j].kind != ColumnKind::Number).then_some("text")
    }

    fn cell_class(&self, j: usize, cell: &Cell) -> Option<String> {
        let emphasis = cell.emphasis.map(Emphasis::name);
        let classes: Vec<&str> = self.text_class(j).into_iter().chain(emphasis).collect();
        (!classes.is_empty()).then(|| classes.join(" "))
    }
}

fn content(cell: &Cell) -> Markup {
    html! {
        @for (i, (text, ends)) in cell.pieces().into_iter().enumerate() {
            @if i > 0 { " / " }
            (text)
            @if let Some([low, high]) = ends { " " small { (low) "–" (high) } }
        }
        @if let Some(mark) = cell.mark { " " (mark) }
        @if let Some(note) = &cell.note { " " small { (note) } }
        @for line in &cell.details { br; small { (line) } }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::sample;

    #[test]
    fn names_are_escaped_and_groups_are_named_once() {
        let html = sample().to_html().into_string();
        for part in [
            "aria-label=\"Errors &amp; more\"",
            "<th>group</th><th class=\"text\">a|b</th><th>TC</th>",
            "<tr class=\"first\"><td>basic_1</td>",
            "<td class=\"good\">– / 0.50 <small>0.25–0.75</small></td>",
            "<tr><td></td><td class=\"text\">&lt;i&gt;</td>",
            "3 ✓ <small>+2</small><br><small>below</small>",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
    }
}
