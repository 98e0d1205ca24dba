//! A table, and the forms it is written in.

use std::fmt::Write as _;

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Short name, for files.
    pub name: &'static str,
    /// What it is.
    pub title: String,
    /// What one must know to read it; plain text.
    pub note: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Cells, row by row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(name: &'static str, title: &str, note: &str, columns: &[&str]) -> Table {
        Table {
            name,
            title: title.to_owned(),
            note: note.to_owned(),
            columns: columns.iter().map(|c| (*c).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row, one cell a column.
    pub fn push(&mut self, row: Vec<String>) {
        debug_assert_eq!(row.len(), self.columns.len(), "{}", self.name);
        self.rows.push(row);
    }

    /// Comma-separated values (RFC 4180).
    pub fn csv(&self) -> String {
        let quote = |cell: &String| match cell.contains(['"', ',', '\n']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell.clone(),
        };
        let lines = std::iter::once(&self.columns).chain(&self.rows);
        lines.map(|row| row.iter().map(quote).collect::<Vec<_>>().join(",") + "\r\n").collect()
    }

    /// Markdown.
    pub fn markdown(&self) -> String {
        let line = |row: &[String]| format!("| {} |\n", row.join(" | ").replace('\n', " "));
        let mut text = format!("## {}\n\n{}", self.title, line(&self.columns));
        text += &format!("|{}\n", " --- |".repeat(self.columns.len()));
        self.rows.iter().for_each(|row| text += &line(row));
        if !self.note.is_empty() {
            write!(text, "\n{}\n", self.note).expect("writing to a string cannot fail");
        }
        text
    }

    /// HTML; cells that read as numbers are aligned to the right.
    pub fn html(&self) -> String {
        let cell = |tag: &str, text: &String| {
            let numeric = text.starts_with(|c: char| c.is_ascii_digit() || "+-<\u{2248}\u{2212}".contains(c));
            let class = if numeric { " class=n" } else { "" };
            format!("<{tag}{class}>{}</{tag}>", escape(text))
        };
        let row = |tag: &str, row: &[String]| {
            format!("<tr>{}</tr>\n", row.iter().map(|text| cell(tag, text)).collect::<String>())
        };
        let rows: String = self.rows.iter().map(|r| row("td", r)).collect();
        format!(
            "<figure class=table id={}><figcaption>{}</figcaption><div class=scroll><table><thead>{}</thead>\n<tbody>{rows}</tbody></table></div>\
             <p class=note>{}</p></figure>\n",
            self.name,
            escape(&self.title),
            row("th", &self.columns),
            escape(&self.note)
        )
    }
}

/// Text for HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A number with three significant digits, as short as it gets.
pub fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !x.is_finite() {
        return "\u{2013}".to_owned();
    }
    let magnitude = x.abs().log10().floor() as i32;
    match magnitude {
        3.. => format!("{x:.0}"),
        -3..=2 => format!("{x:.*}", (2 - magnitude) as usize),
        _ => format!("{x:.1e}"),
    }
}

/// Per cent with a sign, and its 95 % confidence interval.
pub fn signed_percent(x: f64, standard_error: f64) -> String {
    format!("{:+.2} \u{b1} {:.2} %", 100.0 * x, 196.0 * standard_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_of_a_table() {
        let mut table = Table::new("t", "A <b>", "Note.", &["a", "b"]);
        table.push(vec!["x, \"y\"".into(), "1.5".into()]);
        assert_eq!(table.csv(), "a,b\r\n\"x, \"\"y\"\"\",1.5\r\n");
        assert_eq!(table.markdown(), "## A <b>\n\n| a | b |\n| --- | --- |\n| x, \"y\" | 1.5 |\n\nNote.\n");
        let html = table.html();
        assert!(html.contains("A &lt;b&gt;") && html.contains("<td class=n>1.5</td>") && html.contains("<th>a</th>"));
    }

    #[test]
    fn numbers_keep_three_digits() {
        let cases = [
            (0.0, "0"),
            (1234.5, "1234"),
            (12.345, "12.3"),
            (0.12345, "0.123"),
            (0.001, "0.00100"),
            (2.5e-5, "2.5e-5"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }
}
