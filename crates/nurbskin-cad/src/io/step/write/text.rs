//! Instances, tokens and strings of an exchange file (ISO 10303-21).

use crate::io::text::{push_real, shifted};
use glam::DVec2;
use nurbskin_geometry::{DVec3, Error, Result};
use std::collections::HashMap;
use std::fmt::{self, Write};

/// The name of an instance: `#12`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Id(usize);

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// Lines are broken between the items of a list after this many characters.
const WIDTH: usize = 120;

/// A file that grows instance by instance. Points with the same bits are written once.
#[derive(Debug)]
pub(super) struct Text {
    out: String,
    /// Where the last line begins.
    line: usize,
    last: usize,
    origin: DVec3,
    // Looked up only, never walked through: the order of a hash map does not show.
    points: HashMap<[u64; 3], Id>,
    points_uv: HashMap<[u64; 2], Id>,
}

impl Text {
    pub(super) fn new(origin: DVec3) -> Self {
        Self {
            out: String::new(),
            line: 0,
            last: 0,
            origin,
            points: HashMap::new(),
            points_uv: HashMap::new(),
        }
    }
    /// The whole text.
    pub(super) fn finish(self) -> String {
        self.out
    }

    /// Adds an instance, whose part after the `=` is pushed by `spell`, and tells its name.
    pub(super) fn add(&mut self, spell: impl FnOnce(&mut Self)) -> Id {
        self.last += 1;
        let id = Id(self.last);
        self.line = self.out.len();
        self.id(id).raw("=");
        spell(self);
        self.raw(";\n");
        id
    }

    /// Appends text as it is.
    pub(super) fn raw(&mut self, text: &str) -> &mut Self {
        self.out.push_str(text);
        self
    }
    /// Appends a reference.
    pub(super) fn id(&mut self, id: Id) -> &mut Self {
        // Writing to a String cannot fail.
        let _ = write!(self.out, "{id}");
        self
    }
    /// Appends a real.
    pub(super) fn real(&mut self, x: f64) -> &mut Self {
        push_real(&mut self.out, x, "E");
        self
    }
    /// Appends an integer.
    pub(super) fn count(&mut self, n: usize) -> &mut Self {
        let _ = write!(self.out, "{n}");
        self
    }
    /// Appends `.T.` or `.F.`
    pub(super) fn flag(&mut self, is: bool) -> &mut Self {
        self.raw(if is { ".T." } else { ".F." })
    }
    /// Appends a string in its quotes: those inside and backslashes doubled, what is not printable ASCII as `\X2\` with
    /// four hexadecimal digits for each character or, beyond the basic plane, `\X4\` with eight; `\X0\` ends both.
    pub(super) fn string(&mut self, text: &str) -> &mut Self {
        self.raw("'");
        let mut run = "";
        for c in text.chars() {
            let wanted = match c {
                ' '..='~' => "",
                '\0'..='\u{ffff}' => "\\X2\\",
                _ => "\\X4\\",
            };
            if wanted != run {
                let end = if run.is_empty() { "" } else { "\\X0\\" };
                self.raw(end).raw(wanted);
                run = wanted;
            }
            match (run, c) {
                ("", '\'' | '\\') => drop(write!(self.out, "{c}{c}")),
                ("", c) => self.out.push(c),
                ("\\X2\\", c) => drop(write!(self.out, "{:04X}", u32::from(c))),
                (_, c) => drop(write!(self.out, "{:08X}", u32::from(c))),
            }
        }
        if !run.is_empty() {
            self.raw("\\X0\\");
        }
        self.raw("'")
    }
    /// Appends a list in its parentheses.
    pub(super) fn list<T>(
        &mut self,
        items: impl IntoIterator<Item = T>,
        mut push: impl FnMut(&mut Self, T),
    ) -> &mut Self {
        self.raw("(");
        for (k, item) in items.into_iter().enumerate() {
            if k > 0 {
                self.raw(",");
            }
            if self.out.len() - self.line > WIDTH {
                self.raw("\n");
                self.line = self.out.len();
            }
            push(self, item);
        }
        self.raw(")")
    }
    /// Appends a list of references.
    pub(super) fn ids(&mut self, ids: &[Id]) -> &mut Self {
        self.list(ids, |text, &id| {
            text.id(id);
        })
    }
    /// Appends a list of reals.
    pub(super) fn reals(&mut self, numbers: &[f64]) -> &mut Self {
        self.list(numbers, |text, &x| {
            text.real(x);
        })
    }

    /// The `CARTESIAN_POINT` at this place, moved by the origin.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not finite then.
    pub(super) fn point(&mut self, point: DVec3) -> Result<Id> {
        let key = self.moved(point)?.to_array().map(f64::to_bits);
        if let Some(&id) = self.points.get(&key) {
            return Ok(id);
        }
        let id = self.named_point("", point)?;
        self.points.insert(key, id);
        Ok(id)
    }
    /// A `CARTESIAN_POINT` of its own with this name.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it is not finite once the origin is added.
    pub(super) fn named_point(&mut self, name: &str, point: DVec3) -> Result<Id> {
        let point = self.moved(point)?.to_array();
        Ok(self.add(|text| {
            text.raw("CARTESIAN_POINT(").string(name).raw(",");
            text.reals(&point).raw(")");
        }))
    }
    fn moved(&self, point: DVec3) -> Result<DVec3> {
        let moved = shifted(point, self.origin);
        if moved.is_finite() {
            Ok(moved)
        } else {
            Err(Error::invalid(format!(
                "the point {point} is not finite once the origin {} is added",
                self.origin
            )))
        }
    }
    /// The `CARTESIAN_POINT` at this place of a parameter plane.
    pub(super) fn point_uv(&mut self, point: DVec2) -> Id {
        let key = point.to_array().map(f64::to_bits);
        if let Some(&id) = self.points_uv.get(&key) {
            return id;
        }
        let id = self.add(|text| {
            text.raw("CARTESIAN_POINT('',")
                .reals(&point.to_array())
                .raw(")");
        });
        self.points_uv.insert(key, id);
        id
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn strings_are_escaped() {
        let spelled = |s: &str| {
            let mut text = Text::new(DVec3::ZERO);
            text.string(s);
            text.finish()
        };
        assert_eq!(spelled(""), "''");
        assert_eq!(spelled("a'b\\c"), "'a''b\\\\c'");
        assert_eq!(
            spelled("Gehäuse ß"),
            "'Geh\\X2\\00E4\\X0\\use \\X2\\00DF\\X0\\'"
        );
        assert_eq!(spelled("杯子"), "'\\X2\\676F5B50\\X0\\'");
        assert_eq!(
            spelled("é🦊\n"),
            "'\\X2\\00E9\\X0\\\\X4\\0001F98A\\X0\\\\X2\\000A\\X0\\'"
        );
    }

    proptest! {
        #[test]
        fn every_finite_number_returns(bits in any::<u64>()) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            let mut text = Text::new(DVec3::ZERO);
            text.real(x);
            let text = text.finish();
            // sign digit+ . digit* [E sign digit+]: the syntax of ISO 10303-21, 6.3.2.
            let (whole, rest) = text.trim_start_matches('-').split_once('.').unwrap();
            let (fraction, exponent) = rest.split_once('E').unwrap_or((rest, "0"));
            let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
            prop_assert!(!whole.is_empty() && digits(whole) && digits(fraction), "{}", text);
            prop_assert!(digits(exponent.trim_start_matches('-')), "{}", text);
            prop_assert_eq!(text.parse::<f64>().unwrap().to_bits(), bits);
        }
    }
}
