//! A file taken apart into cards and entities; an entity's parameters are handed out once.

use super::card;
use super::card::{Cards, PARAMETER_WIDTH};
use super::directory;
use super::directory::DirectoryEntry;
use super::field::{Delimiters, Fields};
use super::global;
use super::global::Global;
use super::transform;
use super::transform::{Transform, Transforms};
use nurbskin_geometry::{Error, Result};
use std::path::Path;
use std::rc::Rc;

/// The sections of a file.
pub(super) struct Store<'a> {
    pub(super) path: &'a Path,
    pub(super) global: Global,
    /// In the order of the file; the one with sequence number d is at (d - 1) / 2.
    pub(super) entries: Vec<Rc<DirectoryEntry>>,
    cards: Cards<'a>,
    delimiters: Delimiters,
    /// Parameter cards that an entity has taken: none may be taken twice, so that time and memory stay bound by the
    /// file.
    claimed: Vec<bool>,
    transforms: Transforms,
}

impl<'a> Store<'a> {
    /// Splits the file, reads all but its parameters, and of these the matrices.
    pub(super) fn open(
        bytes: &'a [u8],
        path: &'a Path,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let cards = card::split(bytes, path)?;
        let (global, delimiters) = global::read(&cards.global, path, warnings)?;
        let entries = directory::read(&cards, path)?;
        if entries.is_empty() {
            return Err(Error::read(
                path,
                "",
                "the file has no entities: its directory section (D) is empty",
            ));
        }
        let mut store = Self {
            path,
            global,
            entries: entries.into_iter().map(Rc::new).collect(),
            claimed: vec![false; cards.parameter.len()],
            cards,
            delimiters,
            transforms: Transforms::new(),
        };
        for entry in store.entries.clone() {
            if entry.entity == 124 {
                let matrix = Transform::read(&mut store.fields(&entry)?)?;
                let found = (matrix, entry.transform);
                store.transforms.insert(entry.sequence, found);
            }
        }
        Ok(store)
    }

    /// The entity that a pointer leads to.
    pub(super) fn entry(&self, pointer: usize) -> Option<Rc<DirectoryEntry>> {
        let index = (pointer % 2 == 1).then_some(pointer / 2)?;
        self.entries.get(index).map(Rc::clone)
    }

    /// The whole transformation of an entity, chained matrices included; `None` where it names none.
    pub(super) fn transform(&self, entry: &DirectoryEntry) -> Result<Option<Transform>> {
        transform::chain(entry, &self.transforms, self.path)
    }

    /// The parameters of an entity, its type number already taken.
    pub(super) fn fields<'s>(&'s mut self, entry: &DirectoryEntry) -> Result<Fields<'s>> {
        let path = self.path;
        let all = &self.cards.parameter;
        let first = entry.parameter.wrapping_sub(1);
        let end = first.checked_add(entry.parameter_cards);
        let Some(cards) = end
            .and_then(|end| all.get(first..end))
            .filter(|cards| !cards.is_empty())
        else {
            return Err(entry.refuse(
                path,
                format!(
                    "its parameter data should be {} cards from P{}, and the file has P1 to P{}",
                    entry.parameter_cards,
                    entry.parameter,
                    all.len()
                ),
            ));
        };
        if self.claimed[first..first + cards.len()].contains(&true) {
            return Err(entry.refuse(
                path,
                "its parameter cards belong to another entity already; the file is damaged",
            ));
        }
        self.claimed[first..first + cards.len()].fill(true);
        let delimiters = self.delimiters;
        let mut fields = Fields::new(
            path,
            'P',
            entry.parameter,
            cards,
            PARAMETER_WIDTH,
            delimiters,
        );
        let entity = fields.integer(0)?;
        if entity != i64::from(entry.entity) {
            return Err(fields.refuse(format!(
                "the data of an entity {entity}, where the directory (D{}) has an entity {}",
                entry.sequence, entry.entity
            )));
        }
        Ok(fields)
    }
}
