//! Rows of PLY elements, handed out one by one without a vector for each.

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// A vertex; what the file does not have stays zero.
#[derive(serde::Deserialize)]
pub(super) struct Vertex {
    pub(super) x: f64,
    #[serde(default)]
    pub(super) y: f64,
    #[serde(default)]
    pub(super) z: f64,
    #[serde(default)]
    pub(super) nx: f64,
    #[serde(default)]
    pub(super) ny: f64,
    #[serde(default)]
    pub(super) nz: f64,
}

/// A row of an element that nobody needs.
pub(super) struct Skipped;

impl<'de> serde::Deserialize<'de> for Skipped {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(IgnoredAny).map(|_| Skipped)
    }
}

/// All rows of an element: of each, the list of whole numbers that the property `name` holds goes to `each`, whose
/// complaint ends the reading.
pub(super) struct Lists<'a, F> {
    pub(super) name: &'a str,
    pub(super) each: F,
}

impl<'de, F: FnMut(&[i64]) -> Result<(), String>> DeserializeSeed<'de> for &mut Lists<'_, F> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, F: FnMut(&[i64]) -> Result<(), String>> Visitor<'de> for &mut Lists<'_, F> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("rows")
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<(), A::Error> {
        let mut list = Vec::new();
        while rows
            .next_element_seed(Row {
                name: self.name,
                list: &mut list,
            })?
            .is_some()
        {
            (self.each)(&list).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}

/// One row, whose list replaces the content of `list`.
struct Row<'a> {
    name: &'a str,
    list: &'a mut Vec<i64>,
}

impl<'de> DeserializeSeed<'de> for Row<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for Row<'_> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a row")
    }
    fn visit_map<A: MapAccess<'de>>(self, mut row: A) -> Result<(), A::Error> {
        while let Some(wanted) = row.next_key_seed(Is(self.name))? {
            if wanted {
                row.next_value_seed(WholeNumbers(self.list))?;
            } else {
                row.next_value::<IgnoredAny>()?;
            }
        }
        Ok(())
    }
}

/// Whether a key is this one.
struct Is<'a>(&'a str);

impl<'de> DeserializeSeed<'de> for Is<'_> {
    type Value = bool;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<bool, D::Error> {
        deserializer.deserialize_bytes(self)
    }
}

impl Visitor<'_> for Is<'_> {
    type Value = bool;
    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("the name of a property")
    }
    fn visit_bytes<E: Error>(self, name: &[u8]) -> Result<bool, E> {
        Ok(name == self.0.as_bytes())
    }
    fn visit_str<E: Error>(self, name: &str) -> Result<bool, E> {
        Ok(name == self.0)
    }
}

/// A list of whole numbers; those written as floating-point numbers count, too.
struct WholeNumbers<'a>(&'a mut Vec<i64>);

impl<'de> DeserializeSeed<'de> for WholeNumbers<'_> {
    type Value = ();
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for WholeNumbers<'_> {
    type Value = ();
    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list")
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        self.0.clear();
        while let Some(number) = list.next_element_seed(WholeNumber)? {
            self.0.push(number);
        }
        Ok(())
    }
}

struct WholeNumber;

impl<'de> DeserializeSeed<'de> for WholeNumber {
    type Value = i64;
    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<i64, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Visitor<'_> for WholeNumber {
    type Value = i64;
    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a whole number")
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<i64, E> {
        Ok(number)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<i64, E> {
        i64::try_from(number).map_err(|_| E::custom(format!("{number} is too large")))
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<i64, E> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a whole number of at most 32 bits"
        )]
        if number.fract().abs() > 0.0 || number.is_nan() || number.abs() > f64::from(u32::MAX) {
            Err(E::custom(format!("{number} is not an index")))
        } else {
            Ok(number as i64)
        }
    }
}
