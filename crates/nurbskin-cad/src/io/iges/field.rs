//! The free format of global and parameter data: fields between delimiters, running on from card to card.

use super::card::Card;
use super::number::{parse_integer, parse_real};
use nurbskin_geometry::{DVec3, Error, Result};
use std::path::Path;

/// Delimiters, which a file may choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Delimiters {
    /// Between parameters.
    pub(super) parameter: u8,
    /// After the last parameter of a record.
    pub(super) record: u8,
}

impl Default for Delimiters {
    fn default() -> Self {
        Self {
            parameter: b',',
            record: b';',
        }
    }
}

/// Reads the fields of one record, one after the other.
#[derive(Debug)]
pub(super) struct Fields<'a> {
    path: &'a Path,
    section: char,
    /// Sequence number of the first card.
    first: usize,
    cards: &'a [Card<'a>],
    width: usize,
    pub(super) delimiters: Delimiters,
    card: usize,
    column: usize,
    ended: bool,
    text: String,
    /// Card on which the latest field began.
    at: usize,
}

impl<'a> Fields<'a> {
    pub(super) fn new(
        path: &'a Path,
        section: char,
        first: usize,
        cards: &'a [Card<'a>],
        width: usize,
        delimiters: Delimiters,
    ) -> Self {
        Self {
            path,
            section,
            first,
            cards,
            width,
            delimiters,
            card: 0,
            column: 0,
            ended: false,
            text: String::new(),
            at: 0,
        }
    }

    /// The error `what` at the latest field.
    pub(super) fn refuse(&self, what: impl Into<String>) -> Error {
        let at = self.at.min(self.cards.len().saturating_sub(1));
        let line = self.cards.get(at).map_or(0, |card| card.line);
        let place = format!("line {line} ({}{})", self.section, self.first + at);
        Error::read(self.path, place, what)
    }

    /// Looks at the next byte of the record.
    pub(super) fn peek(&self) -> Option<u8> {
        Some(self.cards.get(self.card)?.byte(self.column))
    }

    /// Takes the next byte of the record.
    pub(super) fn bump(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.column += 1;
        if self.column == self.width {
            self.card += 1;
            self.column = 0;
        }
        Some(byte)
    }

    /// Columns that are left, at least one of which every further field needs.
    fn left(&self) -> usize {
        (self.cards.len() - self.card) * self.width - self.column
    }

    /// Reads the next field into `self.text`: true where it is a string. After the record has ended, fields are empty
    /// and so take their defaults.
    fn advance(&mut self) -> Result<bool> {
        self.text.clear();
        if self.ended {
            return Ok(false);
        }
        while self.peek() == Some(b' ') {
            self.bump();
        }
        self.at = self.card;
        let mut string = false;
        loop {
            match self.bump() {
                None => {
                    return Err(self.refuse(format!(
                        "the record runs on without its `{}`: it is cut short, or its directory entry says too few lines",
                        char::from(self.delimiters.record)
                    )));
                }
                Some(byte) if byte == self.delimiters.parameter => return Ok(string),
                Some(byte) if byte == self.delimiters.record => {
                    self.ended = true;
                    return Ok(string);
                }
                Some(b'H')
                    if !string
                        && !self.text.is_empty()
                        && self.text.bytes().all(|b| b.is_ascii_digit()) =>
                {
                    let length = self.text.parse::<usize>().unwrap_or(usize::MAX);
                    if length > self.left() {
                        return Err(self.refuse(format!(
                            "a string of {length} characters is longer than its record"
                        )));
                    }
                    self.text.clear();
                    for _ in 0..length {
                        let byte = self.bump().unwrap_or(b' ');
                        self.text.push(char::from(byte));
                    }
                    string = true;
                }
                Some(b' ') if string => {}
                Some(byte) if string => {
                    return Err(self.refuse(format!(
                        "`{}` after a string where a delimiter should be: its length is wrong",
                        byte.escape_ascii()
                    )));
                }
                Some(byte) => self.text.push(char::from(byte)),
            }
        }
    }

    fn is_blank(&self) -> bool {
        self.text.bytes().all(|b| b == b' ')
    }

    /// The field's text for a message, not too long.
    fn shown(&self) -> String {
        self.text
            .chars()
            .take(40)
            .collect::<String>()
            .escape_debug()
            .to_string()
    }

    /// The next field as a string, empty where it is left out. Some writers forget to count a short string; its text
    /// is taken as it stands.
    pub(super) fn string(&mut self) -> Result<String> {
        self.advance()?;
        Ok(self.text.trim().to_owned())
    }

    /// Passes over fields that nobody needs.
    pub(super) fn skip(&mut self, count: usize) -> Result<()> {
        (0..count).try_for_each(|_| self.advance().map(drop))
    }

    /// The next field as an integer, or `default` where it is left out.
    pub(super) fn integer(&mut self, default: i64) -> Result<i64> {
        let string = self.advance()?;
        if !string && self.is_blank() {
            return Ok(default);
        }
        match parse_integer(&self.text) {
            Some(value) if !string => Ok(value),
            _ => Err(self.refuse(format!("`{}` where an integer should be", self.shown()))),
        }
    }

    /// The next field as a real, or `default` where it is left out.
    pub(super) fn real(&mut self, default: f64) -> Result<f64> {
        let string = self.advance()?;
        if !string && self.is_blank() {
            return Ok(default);
        }
        match parse_real(&self.text) {
            Some(value) if !string => Ok(value),
            _ => Err(self.refuse(format!(
                "`{}` where a finite real number should be",
                self.shown()
            ))),
        }
    }

    /// `count` reals; each may be left out (zero), but the record may not end before them.
    pub(super) fn reals(&mut self, count: usize, of_what: &str) -> Result<Vec<f64>> {
        self.expect_room(count, of_what)?;
        let mut values = Vec::with_capacity(count);
        for k in 0..count {
            if self.ended {
                return Err(self.refuse(format!(
                    "the record ends after {k} of {count} numbers ({of_what}): its counts do not fit its data"
                )));
            }
            values.push(self.real(0.0)?);
        }
        Ok(values)
    }

    /// `count` points of three reals each.
    pub(super) fn points(&mut self, count: usize, of_what: &str) -> Result<Vec<DVec3>> {
        self.expect_room(count.saturating_mul(3), of_what)?;
        let values = self.reals(3 * count, of_what)?;
        Ok(values.chunks_exact(3).map(DVec3::from_slice).collect())
    }

    /// A pointer to a directory entry, 0 where it is left out. A negative one means the same entity in some places.
    pub(super) fn pointer(&mut self) -> Result<usize> {
        let pointer = self.integer(0)?;
        usize::try_from(pointer.unsigned_abs())
            .map_err(|_| self.refuse(format!("{pointer} is not a pointer to an entity")))
    }

    /// All fields that are left, as integers.
    pub(super) fn integers_to_end(&mut self) -> Result<Vec<i64>> {
        let mut all = Vec::new();
        while !self.ended {
            all.push(self.integer(0)?);
        }
        Ok(all)
    }

    /// A count and as many pointers.
    pub(super) fn pointers(&mut self, of_what: &str) -> Result<Vec<usize>> {
        let value = self.integer(0)?;
        let count = usize::try_from(value)
            .map_err(|_| self.refuse(format!("{value} as the number of {of_what}")))?;
        self.expect_room(count, of_what)?;
        (0..count).map(|_| self.pointer()).collect()
    }

    /// A count that must be in 1..=most for the record to be meaningful and to hold that many values at all.
    pub(super) fn count(&mut self, of_what: &str) -> Result<usize> {
        let value = self.integer(0)?;
        let count = usize::try_from(value).ok().filter(|&n| n >= 1);
        let count =
            count.ok_or_else(|| self.refuse(format!("{value} as the number of {of_what}")))?;
        self.expect_room(count, of_what)?;
        Ok(count)
    }

    /// That many more fields can be in the record.
    pub(super) fn expect_room(&self, count: usize, of_what: &str) -> Result<()> {
        if count > self.left() {
            return Err(self.refuse(format!(
                "{count} values ({of_what}) cannot be in this record, which has {} more columns: its counts do not fit its data",
                self.left()
            )));
        }
        Ok(())
    }
}
