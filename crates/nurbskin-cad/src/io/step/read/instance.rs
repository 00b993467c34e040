//! Instances of a STEP file by number, and their attributes with checks.

use super::index;
use super::index::{Index, Lines};
use super::parse;
use super::parse::{Cursor, Flaw, Part, Value};
use nurbskin_geometry::{Error, Result};
use std::cell::Cell;
use std::path::Path;

/// Instances that refer to each other deeper than this are refused: they go in circles.
const MAX_DEPTH: usize = 40;

/// A STEP file, its instances parsed when they are asked for.
#[derive(Debug)]
pub(super) struct Step<'a> {
    bytes: &'a [u8],
    path: &'a Path,
    pub(super) index: Index<'a>,
    lines: Lines,
    /// Bytes that may still be parsed: circles of references would never end.
    budget: Cell<usize>,
    depth: Cell<usize>,
}

impl<'a> Step<'a> {
    pub(super) fn new(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let lines = Lines::new(bytes);
        let fail = |flaw: Flaw| {
            let line = lines.of(bytes, flaw.at);
            Error::read(path, format!("line {line}"), flaw.what)
        };
        let index = index::index(bytes).map_err(fail)?;
        Ok(Self {
            bytes,
            path,
            index,
            lines,
            budget: Cell::new(bytes.len().saturating_mul(256).saturating_add(10_000_000)),
            depth: Cell::new(0),
        })
    }

    /// The file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    fn place(&self, id: u64) -> Option<usize> {
        let k = self
            .index
            .instances
            .binary_search_by_key(&id, |i| i.0)
            .ok()?;
        Some(self.index.instances[k].1)
    }

    /// An error about an instance.
    pub(super) fn error(&self, id: u64, what: impl std::fmt::Display) -> Error {
        let at = match self.place(id) {
            Some(at) => format!("line {}, #{id}", self.lines.of(self.bytes, at)),
            None => format!("#{id}"),
        };
        Error::read(self.path, at, what.to_string())
    }

    /// The instance with this number.
    pub(super) fn get(&self, id: u64) -> Result<Instance<'_, 'a>> {
        let Some(at) = self.place(id) else {
            return Err(self.error(
                id,
                "the file refers to this instance but does not contain it; the file may be cut off",
            ));
        };
        let mut cursor = Cursor::new(self.bytes, at);
        let parts = cursor.parts().map_err(|flaw| {
            let line = self.lines.of(self.bytes, flaw.at);
            Error::read(self.path, format!("line {line}, #{id}"), flaw.what)
        })?;
        let used = cursor.at - at;
        let Some(rest) = self.budget.get().checked_sub(used) else {
            return Err(self.error(
                id,
                "the instances of this file refer to each other too often; the file is damaged",
            ));
        };
        self.budget.set(rest);
        Ok(Instance {
            step: self,
            id,
            parts,
        })
    }

    /// Runs `f` one level deeper.
    pub(super) fn deeper<T>(&self, id: u64, f: impl FnOnce() -> Result<T>) -> Result<T> {
        if self.depth.get() >= MAX_DEPTH {
            return Err(self.error(
                id,
                "the instance refers to itself, or instances are nested too deep",
            ));
        }
        self.depth.set(self.depth.get() + 1);
        let result = f();
        self.depth.set(self.depth.get() - 1);
        result
    }

    /// Numbers of all instances.
    pub(super) fn ids(&self) -> Vec<u64> {
        self.index.instances.iter().map(|i| i.0).collect()
    }

    /// The type of an instance: the keyword, or all keywords of a complex instance in their order.
    pub(super) fn names(&self, id: u64) -> Vec<&'a str> {
        let Some(at) = self.place(id) else {
            return Vec::new();
        };
        let mut cursor = Cursor::new(self.bytes, at);
        match cursor.takes(b"(") {
            Ok(false) => cursor.keyword().into_iter().collect(),
            _ => self
                .get(id)
                .map_or(Vec::new(), |i| i.parts.iter().map(|p| p.name).collect()),
        }
    }
}

/// An instance.
#[derive(Debug)]
pub(super) struct Instance<'s, 'a> {
    step: &'s Step<'a>,
    pub(super) id: u64,
    pub(super) parts: Vec<Part<'a>>,
}

impl<'s, 'a> Instance<'s, 'a> {
    /// The type of a simple instance; of a complex one the most telling keyword.
    pub(super) fn name(&self) -> &'a str {
        let telling = |p: &&Part<'a>| {
            ["_WITH_KNOTS", "BEZIER_", "UNIFORM_", "_WITH_TRANSFORMATION"]
                .iter()
                .any(|t| p.name.contains(t))
        };
        let first = self.parts.first();
        self.parts
            .iter()
            .find(telling)
            .or(first)
            .map_or("", |p| p.name)
    }

    pub(super) fn is_complex(&self) -> bool {
        self.parts.len() != 1
    }

    pub(super) fn has(&self, name: &str) -> bool {
        self.parts.iter().any(|p| p.name == name)
    }

    pub(super) fn error(&self, what: impl std::fmt::Display) -> Error {
        self.step
            .error(self.id, format_args!("{}: {what}", self.name()))
    }

    /// The attributes of a part of a complex instance, or all of a simple one.
    pub(super) fn part(&self, name: &str) -> Result<Attributes<'_, 's, 'a>> {
        let found = match &self.parts[..] {
            [only] => Some(only),
            parts => parts.iter().find(|p| p.name == name),
        };
        let part =
            found.ok_or_else(|| self.error(format_args!("the instance has no part {name}")))?;
        Ok(Attributes {
            of: self,
            values: &part.values,
        })
    }

    /// The attributes of a simple instance, or the first part of a complex one.
    pub(super) fn all(&self) -> Attributes<'_, 's, 'a> {
        Attributes {
            of: self,
            values: self.parts.first().map_or(&[], |p| &p.values),
        }
    }
}

/// Attributes by place, counted from 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attributes<'i, 's, 'a> {
    of: &'i Instance<'s, 'a>,
    pub(super) values: &'i [Value<'a>],
}

impl<'i, 'a> Attributes<'i, '_, 'a> {
    fn wrong<T>(&self, k: usize, what: &str) -> Result<T> {
        Err(self
            .of
            .error(format_args!("attribute {} should be {what}", k + 1)))
    }

    pub(super) fn get(&self, k: usize) -> Option<&'i Value<'a>> {
        self.values.get(k)
    }

    pub(super) fn reference(&self, k: usize) -> Result<u64> {
        match self.get(k) {
            Some(Value::Reference(id)) => Ok(*id),
            _ => self.wrong(k, "a reference"),
        }
    }

    pub(super) fn list(&self, k: usize) -> Result<&'i [Value<'a>]> {
        match self.get(k) {
            Some(Value::List(values)) => Ok(values),
            _ => self.wrong(k, "a list"),
        }
    }

    pub(super) fn references(&self, k: usize) -> Result<Vec<u64>> {
        self.references_of(k, self.list(k)?)
    }

    /// The references in a list that is attribute k or in it.
    pub(super) fn references_of(&self, k: usize, list: &[Value<'a>]) -> Result<Vec<u64>> {
        let id = |v: &Value<'a>| match v {
            Value::Reference(id) => Ok(*id),
            _ => self.wrong(k, "a list of references"),
        };
        list.iter().map(id).collect()
    }

    pub(super) fn real(&self, k: usize) -> Result<f64> {
        match self.get(k).and_then(real) {
            Some(real) => Ok(real),
            None => self.wrong(k, "a number"),
        }
    }

    pub(super) fn reals(&self, k: usize) -> Result<Vec<f64>> {
        self.reals_of(k, self.list(k)?)
    }

    pub(super) fn reals_of(&self, k: usize, list: &[Value<'a>]) -> Result<Vec<f64>> {
        match list.iter().map(real).collect::<Option<Vec<_>>>() {
            Some(reals) => Ok(reals),
            None => self.wrong(k, "a list of numbers"),
        }
    }

    pub(super) fn count(&self, k: usize) -> Result<usize> {
        match self.get(k) {
            Some(Value::Integer(i)) if *i >= 0 => match usize::try_from(*i) {
                Ok(count) => Ok(count),
                Err(_) => self.wrong(k, "a smaller count"),
            },
            _ => self.wrong(k, "a count"),
        }
    }

    pub(super) fn counts(&self, k: usize) -> Result<Vec<usize>> {
        let count = |v: &Value<'a>| match v {
            Value::Integer(i) => usize::try_from(*i).ok(),
            _ => None,
        };
        match self.list(k)?.iter().map(count).collect::<Option<Vec<_>>>() {
            Some(counts) => Ok(counts),
            None => self.wrong(k, "a list of counts"),
        }
    }

    pub(super) fn flag(&self, k: usize) -> Result<bool> {
        match self.get(k) {
            Some(Value::Name("T")) => Ok(true),
            Some(Value::Name("F")) => Ok(false),
            _ => self.wrong(k, ".T. or .F."),
        }
    }

    /// A string, empty where there is none.
    pub(super) fn text(&self, k: usize) -> String {
        match self.get(k) {
            Some(Value::Text(text)) => parse::plain(text),
            _ => String::new(),
        }
    }
}

/// A number, with or without its type.
pub(super) fn real(value: &Value<'_>) -> Option<f64> {
    match value {
        Value::Real(x) => Some(*x),
        #[expect(clippy::cast_precision_loss, reason = "a number of a file as f64")]
        Value::Integer(i) => Some(*i as f64),
        Value::Typed(_, values) => match &values[..] {
            [one @ (Value::Real(_) | Value::Integer(_))] => real(one),
            _ => None,
        },
        _ => None,
    }
}
