//! Tables as LaTeX with `booktabs`.

use super::{Cell, ColumnKind, Emphasis, Table};

impl Table {
    /// The table as a LaTeX float; needs the package `booktabs`, and `amssymb` for marks.
    pub fn to_latex(&self) -> String {
        let alignment = self.columns.iter().map(|column| match column.kind {
            ColumnKind::Number => 'r',
            ColumnKind::Text | ColumnKind::Group => 'l',
        });
        let alignment: String = alignment.collect();
        let labels = self.columns.iter().map(|column| escape(&column.label));
        let note = match self.note.as_str() {
            "" => String::new(),
            note => format!(" {}", escape(note)),
        };
        let mut out = format!(
            "\\begin{{table}}\n  \\centering\n  \\caption{{{}.{}}}\n  \\label{{tab:{}}}\n  \\begin{{tabular}}{{{alignment}}}\n\
             \x20   \\toprule\n    {} \\\\\n    \\midrule\n",
            escape(&self.caption),
            note,
            self.name,
            labels.collect::<Vec<_>>().join(" & ")
        );
        for (i, cells) in self.rows.iter().enumerate() {
            if i > 0 && self.begins_group(i) {
                out += "    \\addlinespace\n";
            }
            let cells = cells.iter().enumerate();
            let cells = cells.map(|(j, cell)| match self.repeats(i, j) {
                true => String::new(),
                false => content(cell),
            });
            out += &format!("    {} \\\\\n", cells.collect::<Vec<_>>().join(" & "));
        }
        out + "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n"
    }
}

fn content(cell: &Cell) -> String {
    let pieces = cell.pieces().into_iter().map(|(text, ends)| {
        let text = escape(&text);
        match ends {
            Some([low, high]) => format!("{text} {{\\scriptsize [{low}, {high}]}}"),
            None => text,
        }
    });
    let mut text = pieces.collect::<Vec<_>>().join(" / ");
    if let Some(mark) = cell.mark {
        text += &format!(" {}", escape(mark));
    }
    if cell.emphasis == Some(Emphasis::Good) {
        text = format!("\\textbf{{{text}}}");
    }
    match &cell.note {
        Some(note) => format!("{text} {{\\scriptsize {}}}", escape(note)),
        None => text,
    }
}

/// Text without the characters that LaTeX reads as commands.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => out.extend(['\\', c]),
            '\\' => out += "\\textbackslash{}",
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            '–' => out += "--",
            '−' => out += "$-$",
            '≤' => out += "$\\leq$",
            '×' => out += "$\\times$",
            '✓' => out += "\\checkmark{}",
            // A blank line would end the paragraph, and with it the table.
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::sample;
    use super::escape;

    #[test]
    fn a_float_has_rules_and_escaped_names() {
        let latex = sample().to_latex();
        for part in [
            "\\caption{Errors \\& more. Mean of 2 runs.}\n  \\label{tab:sample}\n  \\begin{tabular}{llr}\n    \\toprule\n",
            "    group & a\\textbar{}b & TC \\\\\n    \\midrule\n",
            "basic\\_1 & 100 \\%, \"x\" & \
             \\textbf{-- / 0.50 {\\scriptsize [0.25, 0.75]}} \\\\\n",
            "     & \\textless{}i\\textgreater{} & 3 \\checkmark{} {\\scriptsize +2} \\\\\n    \\bottomrule\n",
        ] {
            assert!(latex.contains(part), "{part}: {latex}");
        }
        assert_eq!(escape("a\\b\n~"), "a\\textbackslash{}b \\textasciitilde{}");
    }
}
