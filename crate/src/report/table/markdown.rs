//! Tables as Markdown.

use super::{Cell, Table};

impl Table {
    /// The table as Markdown with its note, without its caption.
    pub fn to_markdown(&self) -> String {
        let labels = self.columns.iter().map(|column| column.label.clone());
        let mut out = row(labels);
        out += &format!("|{}\n", "---|".repeat(self.columns.len()));
        for cells in &self.rows {
            out += &row(cells.iter().map(text));
        }
        if !self.note.is_empty() {
            out += &format!("\n{}\n", self.note);
        }
        out
    }
}

fn text(cell: &Cell) -> String {
    let pieces = cell.pieces().into_iter().map(|(text, ends)| match ends {
        Some([low, high]) => format!("{text} [{low}, {high}]"),
        None => text,
    });
    let mut text = pieces.collect::<Vec<_>>().join(" / ");
    if let Some(mark) = cell.mark {
        text += &format!(" {mark}");
    }
    if let Some(note) = &cell.note {
        text += &format!(" ({note})");
    }
    text
}

fn row(cells: impl Iterator<Item = String>) -> String {
    // A bar or a line break in a name would end its cell.
    let cells: Vec<String> = cells
        .map(|cell| cell.replace('|', "\\|").replace(['\n', '\r'], " "))
        .collect();
    format!("| {} |\n", cells.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::super::tests::sample;

    #[test]
    fn cells_stand_between_bars() {
        assert_eq!(
            sample().to_markdown(),
            "| group | a\\|b | TC |\n|---|---|---|\n\
             | basic_1 | 100 %, \"x\" | – / 0.50 [0.25, 0.75] |\n| basic_1 | <i> | 3 ✓ (+2) |\n\nMean of 2 runs.\n"
        );
    }
}
