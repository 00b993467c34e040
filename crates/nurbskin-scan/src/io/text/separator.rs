//! What stands between the numbers of a line.

use super::super::lines::number;
use csv::ByteRecord;
use std::io::Cursor;

/// How lines are cut into fields, and how numbers are spelt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    /// The byte between fields; `None` for any amount of white space.
    pub(super) separator: Option<u8>,
    /// Whether numbers have a comma where others have a point.
    pub(super) decimal_comma: bool,
    /// Whether fields may be quoted.
    pub(super) quoted: bool,
}

impl Style {
    /// Finds the style that fits all of the sample's lines.
    pub(super) fn of(sample: &[&[u8]]) -> Self {
        let quoted = sample.iter().any(|line| line.contains(&b'"'));
        // Names and counts may stand in the first lines.
        let numeric: Vec<&[u8]> = sample
            .iter()
            .copied()
            .filter(|line| {
                line.iter().any(u8::is_ascii_digit) && line.iter().any(|b| b";\t, ".contains(b))
            })
            .collect();
        let lines = if numeric.is_empty() { sample } else { &numeric };
        let cut = |separator: u8| {
            !lines.is_empty()
                && lines.iter().all(|line| {
                    let fields = || line.split(|&b| b == separator).map(<[u8]>::trim_ascii);
                    fields().count() >= 3
                        && fields().all(|field| {
                            quoted || !field.contains(&b' ') && !field.contains(&b'\t')
                        })
                })
        };
        let filled = |separator: u8| {
            lines.iter().any(|line| {
                line.split(|&b| b == separator)
                    .take(3)
                    .all(|f| !f.is_empty())
            })
        };
        let separator = if lines.iter().all(|line| line.contains(&b';')) && !lines.is_empty() {
            Some(b';')
        } else if cut(b',') {
            Some(b',')
        } else if cut(b'\t') && filled(b'\t') {
            // Not for tabs that only align: they would leave empty fields everywhere.
            Some(b'\t')
        } else {
            None
        };
        let mut style = Style {
            separator,
            decimal_comma: false,
            quoted,
        };
        style.decimal_comma = separator != Some(b',')
            && lines.iter().any(|line| line.contains(&b','))
            && lines.iter().all(|line| style.has_decimal_commas(line));
        style
    }

    /// Whether no field of the line contradicts the decimal comma: no number has a point or two commas.
    fn has_decimal_commas(self, line: &[u8]) -> bool {
        self.fields(line).take(3).all(|field| {
            let commas = field.iter().filter(|&&b| b == b',').count();
            commas <= 1 && (!field.contains(&b'.') || number(field).is_none())
        })
    }

    /// The fields of a line without quotes.
    pub(super) fn fields(self, line: &[u8]) -> Fields<'_> {
        Fields {
            rest: line,
            separator: self.separator,
            done: line.is_empty(),
        }
    }

    /// The fields of a line, quoted or not; for the few lines from which the columns are told.
    pub(super) fn all_fields(self, line: &[u8]) -> Vec<Vec<u8>> {
        if self.quoted
            && let Some(fields) = Quoted::new(self).fields(line)
        {
            return fields.map(<[u8]>::to_vec).collect();
        }
        self.fields(line).map(<[u8]>::to_vec).collect()
    }

    /// The number in a field; an empty one between separators is missing data.
    #[inline]
    pub(super) fn number(self, field: &[u8]) -> Option<f64> {
        if self.decimal_comma
            && let Some(at) = field.iter().position(|&b| b == b',')
        {
            // No number that counts is longer.
            let mut point = [0; 64];
            let point = point.get_mut(..field.len())?;
            point.copy_from_slice(field);
            point[at] = b'.';
            return number(point);
        }
        if field.is_empty() && self.separator.is_some() {
            return Some(f64::NAN);
        }
        number(field)
    }
}

/// Cuts lines with quoted fields: the parser of `csv`, fed line by line, as it would not tell blank lines.
#[derive(Debug)]
pub(super) struct Quoted {
    reader: csv::Reader<Cursor<Vec<u8>>>,
    record: ByteRecord,
    keep_empty: bool,
}

impl Quoted {
    pub(super) fn new(style: Style) -> Self {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(style.separator.unwrap_or(b' '))
            .buffer_capacity(1 << 10)
            .from_reader(Cursor::new(Vec::new()));
        Quoted {
            reader,
            record: ByteRecord::new(),
            keep_empty: style.separator.is_some(),
        }
    }

    /// The fields of a line; `None` if a quote is not closed.
    pub(super) fn fields(&mut self, line: &[u8]) -> Option<impl Iterator<Item = &[u8]>> {
        let feed = self.reader.get_mut();
        feed.get_mut().clear();
        feed.get_mut().extend_from_slice(line);
        feed.get_mut().push(b'\n');
        feed.set_position(0);
        let found = self.reader.read_byte_record(&mut self.record);
        // A field that is still open has taken the end of the line.
        let open = self
            .record
            .iter()
            .next_back()
            .is_none_or(|f| f.ends_with(b"\n"));
        if !matches!(found, Ok(true)) || open {
            return None;
        }
        let keep_empty = self.keep_empty;
        let fields = self.record.iter().map(<[u8]>::trim_ascii);
        Some(fields.filter(move |field| keep_empty || !field.is_empty()))
    }
}

/// The fields of a line, without white space around them.
#[derive(Clone, Debug)]
pub(super) struct Fields<'a> {
    rest: &'a [u8],
    separator: Option<u8>,
    done: bool,
}

impl<'a> Iterator for Fields<'a> {
    type Item = &'a [u8];
    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        if let Some(separator) = self.separator {
            if self.done {
                return None;
            }
            let field = match self.rest.iter().position(|&b| b == separator) {
                Some(at) => {
                    let field = &self.rest[..at];
                    self.rest = &self.rest[at + 1..];
                    field
                }
                None => {
                    self.done = true;
                    self.rest
                }
            };
            return Some(field.trim_ascii());
        }
        let start = self.rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let rest = &self.rest[start..];
        let end = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        self.rest = &rest[end..];
        Some(&rest[..end])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_and_decimal_commas_are_told_apart() {
        for (lines, separator, decimal_comma, first) in [
            (&["1 2 3", "-1.5  2e3\t3"][..], None, false, 1.0),
            (&["x,y,z", "1.5,2,3"], Some(b','), false, 1.5),
            (&["1.5, 2, 3"], Some(b','), false, 1.5),
            (&["1,5;2,5;3,5"], Some(b';'), true, 1.5),
            (&["1.5;2;3"], Some(b';'), false, 1.5),
            (&["1,5\t2,5\t3"], Some(b'\t'), true, 1.5),
            (&["1,5 2,5 3,5"], None, true, 1.5),
            (&["1.5\t\t2\t\t3"], None, false, 1.5),
            (&["19", "1.5 2 3"], None, false, 1.5),
            (&["\"1.5\",\"2\",\"3\""], Some(b','), false, 1.5),
            (&["1,5;2;3;a.b"], Some(b';'), true, 1.5),
        ] {
            let lines: Vec<&[u8]> = lines.iter().map(|line| line.as_bytes()).collect();
            let style = Style::of(&lines);
            assert_eq!(style.separator, separator, "{lines:?}");
            assert_eq!(style.decimal_comma, decimal_comma, "{lines:?}");
            let line = lines.last().unwrap();
            let line = if lines[0] == b"1 2 3" { lines[0] } else { line };
            assert_eq!(style.number(&style.all_fields(line)[0]), Some(first));
        }
    }

    #[test]
    fn quoted_lines_one_after_another() {
        let style = Style {
            separator: Some(b';'),
            decimal_comma: false,
            quoted: true,
        };
        let mut quoted = Quoted::new(style);
        let mut cut = |line: &str| -> Option<Vec<String>> {
            let fields = quoted.fields(line.as_bytes())?;
            Some(fields.map(|f| String::from_utf8_lossy(f).into()).collect())
        };
        let long = "9".repeat(5000);
        for _ in 0..3 {
            assert_eq!(
                cut("\"a;b\"; 1 ;\"say \"\"c\"\"\";").unwrap(),
                ["a;b", "1", "say \"c\"", ""]
            );
            assert_eq!(cut(&format!("1;\"{long}\"")).unwrap(), ["1", &long]);
            assert_eq!(cut("2;3").unwrap(), ["2", "3"]);
        }
        assert_eq!(cut("1;\"2;3"), None);
    }
}
