//! Tables as CSV.

use super::{Cell, Content, Table};
use crate::data::quote_csv;

impl Table {
    /// The values of the table as CSV, in full precision; missing ones are empty. Intervals, marks
    /// and small print are left out.
    pub fn to_csv(&self) -> String {
        let labels = self.columns.iter().map(|column| quote_csv(&column.label));
        let mut out = labels.collect::<Vec<_>>().join(",");
        out.push('\n');
        for cells in &self.rows {
            out += &cells.iter().map(value).collect::<Vec<_>>().join(",");
            out.push('\n');
        }
        out
    }
}

fn value(cell: &Cell) -> String {
    match &cell.content {
        Content::Text(text) => quote_csv(text),
        Content::Count(count) => count.to_string(),
        Content::Numbers(numbers) => {
            let value = numbers.iter().find_map(|number| number.value);
            value.map(|value| value.to_string()).unwrap_or_default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::sample;

    #[test]
    fn values_are_written_in_full() {
        assert_eq!(
            sample().to_csv(),
            "group,a|b,TC\nbasic_1,\"100 %, \"\"x\"\"\",0.5\nbasic_1,<i>,3\n"
        );
    }
}
