//! How text is set: colours, the width of the terminal, numbers.

use anstyle::{AnsiColor, Style};
use nurbskin::pipeline::Output;
use std::io::IsTerminal;
use terminal_size::{Width, terminal_size_of};
use textwrap::{Options, WordSplitter};

pub(crate) const ERROR: Style = AnsiColor::Red.on_default().bold();
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default().bold();
pub(crate) const NOTE: Style = AnsiColor::Cyan.on_default().bold();
pub(crate) const PASS: Style = AnsiColor::Green.on_default().bold();
pub(crate) const LABEL: Style = Style::new().bold();

/// Columns of the labels at the left of a result.
const LABELS: usize = 12;
/// Words that stay with the number before them.
const UNITS: [&str; 10] = ["mm", "um", "nm", "m", "km", "in", "ft", "thou", "%", "s"];
/// Columns of the marks of a list: `FAIL`, `note`, `ok`.
const MARKS: usize = 6;
/// Columns at the left of a list.
const MARGIN: usize = 2;
/// Wider lines of prose are hard to read, columns. The help has the same width.
const WIDEST: usize = 100;
/// Narrower terminals get lines of this width all the same, columns.
const NARROWEST: usize = 40;

/// Columns for text on stdout; `None` where it is not a terminal, and lines are not broken.
pub(super) fn stdout_width() -> Option<usize> {
    let out = std::io::stdout();
    columns(out.is_terminal().then(|| terminal_size_of(out)))
}

/// Columns for text on stderr; `None` where it is not a terminal.
pub(super) fn stderr_width() -> Option<usize> {
    let out = std::io::stderr();
    columns(out.is_terminal().then(|| terminal_size_of(out)))
}

/// `None` is no terminal, `Some(None)` one that does not tell its size.
fn columns(size: Option<Option<(Width, terminal_size::Height)>>) -> Option<usize> {
    size.map(|size| {
        let columns = size.map_or(80, |(Width(columns), _)| usize::from(columns));
        columns.clamp(NARROWEST, WIDEST)
    })
}

/// `text` in `style`.
pub(crate) fn styled(style: Style, text: &str) -> String {
    format!("{style}{text}{style:#}")
}

/// `body` broken at blanks, for a first line that begins at the column `first` and others at the column `rest`.
fn filled(body: &str, first: usize, rest: usize, width: Option<usize>) -> String {
    let body = &glued(body);
    let text = match width {
        None => body.clone(),
        Some(width) => {
            let indents = [first, rest].map(|columns| " ".repeat(columns));
            let options = Options::new(width)
                .initial_indent(&indents[0])
                .subsequent_indent(&indents[1])
                .word_splitter(WordSplitter::NoHyphenation)
                .break_words(false);
            let text = textwrap::fill(body, options);
            text.get(first..).unwrap_or_default().to_owned()
        }
    };
    text.replace('\u{a0}', " ")
}

/// The same with blanks at which no line is broken inside numbers, sizes and between a number and its unit: `13 159`,
/// `161 x 161 x 55 mm`.
fn glued(text: &str) -> String {
    let number = |word: &str| word.ends_with(|c: char| c.is_ascii_digit() || c == ')');
    let digit = |word: &str| word.starts_with(|c: char| c.is_ascii_digit());
    let unit = |word: &str| UNITS.contains(&word.trim_end_matches([',', ';', ':', '.', ')']));
    let mut glued = String::with_capacity(text.len());
    let mut last: Option<&str> = None;
    for word in text.split(' ') {
        if let Some(last) = last {
            let one = match (last, word) {
                ("x", word) => digit(word),
                (last, "x") => number(last),
                (last, word) => number(last) && (digit(word) || unit(word)),
            };
            glued.push(if one { '\u{a0}' } else { ' ' });
        }
        glued.push_str(word);
        last = Some(word);
    }
    glued
}

/// `head` in `style`, padded to `column`, and `body`, all of which stays right of that column.
fn headed(head: &str, style: Style, body: &str, column: usize, width: Option<usize>) -> String {
    let length = head.chars().count();
    let gap = " ".repeat(column.saturating_sub(length));
    let body = filled(body, length.max(column), column, width);
    if head.is_empty() {
        format!("{gap}{body}\n")
    } else {
        format!("{}{gap}{body}\n", styled(style, head))
    }
}

/// A message of one sentence: `warning: the file ...`.
pub(super) fn message(kind: &str, style: Style, body: &str, width: Option<usize>) -> String {
    let head = format!("{kind}: ");
    headed(&head, style, body, head.len(), width)
}

/// A result in rows, each with a label at the left.
#[derive(Debug)]
pub(super) struct Page {
    text: String,
    width: Option<usize>,
}

impl Page {
    /// An empty page of this many columns; `None` does not break lines.
    pub(super) fn new(width: Option<usize>) -> Self {
        Self {
            text: String::new(),
            width,
        }
    }

    /// `label      body`; an empty label continues the row above.
    pub(super) fn row(&mut self, label: &str, body: &str) {
        self.text += &headed(label, LABEL, body, LABELS, self.width);
    }

    /// A line after a mark in the colours of `style`.
    pub(super) fn marked(&mut self, mark: &str, style: Style, body: &str) {
        let mark = format!("{:MARGIN$}{mark}", "");
        self.text += &headed(&mark, style, body, MARGIN + MARKS, self.width);
    }

    /// A line from the left, further ones a little to the right.
    pub(super) fn line(&mut self, body: &str) {
        self.text += &filled(body, 0, MARGIN, self.width);
        self.text.push('\n');
    }

    pub(super) fn finish(self) -> String {
        self.text
    }
}

/// The size of a file: `912 bytes`, `20.5 kB`, `1.25 MB`.
pub(crate) fn bytes(n: u64) -> String {
    use nurbskin::unit::three_digits;
    let x = n as f64;
    match n {
        0..1000 => format!("{n} byte{}", if n == 1 { "" } else { "s" }),
        1000..1_000_000 => format!("{} kB", three_digits(x / 1e3)),
        1_000_000..1_000_000_000 => format!("{} MB", three_digits(x / 1e6)),
        _ => format!("{} GB", three_digits(x / 1e9)),
    }
}

/// Seconds a person waits: `0.48 s`, `12.3 s`, `3 min 20 s`.
pub(crate) fn seconds(x: f64) -> String {
    match x {
        x if x < 10.0 => format!("{x:.2} s"),
        x if x < 120.0 => format!("{x:.1} s"),
        x => format!("{:.0} min {:.0} s", (x / 60.0).floor(), x % 60.0),
    }
}

/// A file that was written, with its size.
pub(super) fn output(output: &Output) -> String {
    let note = if output.replaced {
        ", replaced the file that was there"
    } else {
        ""
    };
    let path = match &output.content {
        Some(_) => "standard output".to_owned(),
        None => output.path.display().to_string(),
    };
    format!("{path} ({}){note}", bytes(output.bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_have_fitting_units() {
        assert_eq!(
            [1, 912, 20480, 1_250_000].map(bytes),
            ["1 byte", "912 bytes", "20.5 kB", "1.25 MB"]
        );
        assert_eq!(
            [0.484, 12.34, 200.0].map(seconds),
            ["0.48 s", "12.3 s", "3 min 20 s"]
        );
    }

    #[test]
    fn numbers_stay_with_their_units() {
        let said = glued(
            "a: 13 159 points, 161 x 161 x 55 mm; at (1, 2, 3) mm, 0.5 % of it in 3 s, box 3 in all",
        );
        let wanted = "a: 13~159 points, 161~x~161~x~55~mm; at (1, 2, 3)~mm, 0.5~% of it in 3~s, box 3~in all";
        assert_eq!(said, wanted.replace('~', "\u{a0}"));
    }

    #[test]
    fn lines_break_at_blanks_and_go_on_under_their_text() {
        let mut page = Page {
            text: String::new(),
            width: Some(40),
        };
        page.row(
            "scan",
            "a/very-long-name/that-has-hyphens.ply: 13 159 points in a mesh",
        );
        let text = anstream::adapter::strip_str(&page.finish()).to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[0],
            "scan        a/very-long-name/that-has-hyphens.ply:"
        );
        assert_eq!(lines[1], "            13 159 points in a mesh");
        let text = message("note", NOTE, &"word ".repeat(20), Some(40));
        let text = anstream::adapter::strip_str(&text).to_string();
        assert!(
            text.lines()
                .skip(1)
                .all(|line| line.starts_with("      word")),
            "{text}"
        );
        assert!(text.lines().all(|line| line.len() <= 40), "{text}");
        // Where nobody looks at columns, a line is one line.
        let text = message("note", NOTE, &"word ".repeat(60), None);
        assert_eq!(text.lines().count(), 1);
    }
}
