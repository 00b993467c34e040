//! What stands between the numbers of a line.

use super::super::lines::number;
use csv::ByteRecord;

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

    /// The fields of a line, quoted or not.
    pub(super) fn all_fields(self, line: &[u8]) -> Vec<Vec<u8>> {
        let mut record = ByteRecord::new();
        if self.quoted
            && csv::ReaderBuilder::new()
                .has_headers(false)
                .delimiter(self.separator.unwrap_or(b' '))
                .from_reader(line)
                .read_byte_record(&mut record)
                .is_ok()
        {
            return record
                .iter()
                .map(|field| field.trim_ascii().to_vec())
                .filter(|field| self.separator.is_some() || !field.is_empty())
                .collect();
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
}
