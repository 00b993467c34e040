//! Entities by pointer: each parsed once, circles and repetition refused.

use super::super::directory::DirectoryEntry;
use super::super::store::Store;
use super::super::transform::Transform;
use super::carrier::Carrier;
use super::{Got, Miss, Place, shell_of_loose};
use crate::io::file::CadFile;
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::{DVec3, Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Pointers lead no deeper than this in files that make sense.
const DEEPEST: usize = 40;

/// The integers of an entity whose parameters are all of that kind.
pub(super) struct Record {
    entry: Rc<DirectoryEntry>,
    integers: Vec<i64>,
}

/// Reads the integers of a record one after the other.
pub(super) struct Cursor {
    record: Rc<Record>,
    at: usize,
}

impl Cursor {
    /// The next integer, 0 beyond the end.
    pub(super) fn integer(&mut self) -> i64 {
        let value = self.record.integers.get(self.at).copied();
        self.at += 1;
        value.unwrap_or(0)
    }
    /// Passes over integers.
    pub(super) fn skip(&mut self, count: usize) {
        self.at += count;
    }
    /// The next integer as a pointer.
    pub(super) fn pointer(&mut self) -> usize {
        usize::try_from(self.integer().unsigned_abs()).unwrap_or(0)
    }
    /// The next integer as the number of things of `each` integers, which must be there.
    pub(super) fn count(&mut self, each: usize, reader: &Reader<'_>) -> Got<usize> {
        let value = self.integer();
        let left = self.record.integers.len().saturating_sub(self.at);
        match usize::try_from(value) {
            Ok(count) if count <= left / each => Ok(count),
            _ => Err(Miss::Refuse(self.record.entry.refuse(
                reader.store.path,
                format!(
                    "{value} as a number of things in a record that has {left} more parameters"
                ),
            ))),
        }
    }
    /// Pointers to properties, which may follow the last parameter.
    pub(super) fn properties(&mut self) -> Vec<usize> {
        let rest = self.record.integers.get(self.at..).unwrap_or(&[]);
        let size = |at: usize| usize::try_from(*rest.get(at)?).ok();
        let after = size(0).unwrap_or(0).saturating_add(1);
        let many = size(after).unwrap_or(0);
        let list = rest.iter().skip(after.saturating_add(1)).take(many);
        list.filter_map(|&p| usize::try_from(p).ok()).collect()
    }
}

/// What is known of a file while its faces are put together.
pub(super) struct Reader<'a> {
    pub(super) store: Store<'a>,
    pub(super) file: CadFile,
    /// Curves, or chains of them, with their own transformation, by pointer.
    pub(super) curves: BTreeMap<usize, Rc<Vec<NurbsCurve>>>,
    pub(super) carriers: BTreeMap<usize, Rc<Carrier>>,
    /// Points and directions, with their own transformation.
    pub(super) points: BTreeMap<usize, DVec3>,
    pub(super) vertices: BTreeMap<usize, Rc<Vec<DVec3>>>,
    pub(super) records: BTreeMap<usize, Rc<Record>>,
    /// The curves that bound planes (entity 108), by the planes.
    pub(super) plane_boundaries: BTreeMap<usize, usize>,
    /// Subfigures: what they hold.
    pub(super) figures: BTreeMap<usize, Rc<Vec<usize>>>,
    pub(super) instances: BTreeMap<usize, (usize, Transform)>,
    pub(super) colours: BTreeMap<usize, [u8; 3]>,
    pub(super) names: BTreeMap<usize, String>,
    /// The colours that faces have.
    pub(super) face_colours: BTreeSet<Option<[u8; 3]>>,
    /// Which entities were looked at, in the order of the directory.
    pub(super) touched: Vec<bool>,
    /// Entities that could not be read, and why.
    missed: BTreeMap<usize, String>,
    /// Entities that are counted as unread.
    pub(super) left: BTreeSet<usize>,
    /// The entities that are being read.
    active: Vec<usize>,
    /// Control points that may still be made: a damaged file shall not fill the memory.
    room: usize,
    /// Faces that belong to no shell of the file.
    pub(super) loose: Vec<usize>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(store: Store<'a>, file: CadFile, bytes: usize) -> Self {
        Self {
            touched: vec![false; store.entries.len()],
            store,
            file,
            curves: BTreeMap::new(),
            carriers: BTreeMap::new(),
            points: BTreeMap::new(),
            vertices: BTreeMap::new(),
            records: BTreeMap::new(),
            plane_boundaries: BTreeMap::new(),
            figures: BTreeMap::new(),
            instances: BTreeMap::new(),
            colours: BTreeMap::new(),
            names: BTreeMap::new(),
            face_colours: BTreeSet::new(),
            missed: BTreeMap::new(),
            left: BTreeSet::new(),
            active: Vec::new(),
            room: 2 * bytes + 100_000,
            loose: Vec::new(),
        }
    }

    /// Reads all faces.
    pub(super) fn read(mut self) -> Result<CadFile> {
        match self.all() {
            Ok(()) => {}
            Err(Miss::Refuse(error)) => return Err(error),
            Err(Miss::Leave(what)) => self.file.warnings.push(what),
        }
        let loose = std::mem::take(&mut self.loose);
        shell_of_loose(&mut self.file.model, loose)?;
        self.file.model.drop_unused();
        self.count_unread();
        if let [Some(colour)] = self.face_colours.iter().copied().collect::<Vec<_>>()[..] {
            self.file.model.colour = Some(colour);
        }
        Ok(self.file)
    }

    /// The place of what has no transformation.
    pub(super) fn place(&self) -> Place {
        Place {
            transform: None,
            factor: self.store.global.factor,
        }
    }

    /// Uses up room for control points.
    ///
    /// # Errors
    /// That the file repeats itself.
    pub(super) fn spend(&mut self, points: usize) -> Got<()> {
        let what = "the entities of the file repeat each other over and over; the file is damaged";
        self.room = self
            .room
            .checked_sub(points)
            .ok_or_else(|| Error::read(self.store.path, "", what))?;
        Ok(())
    }

    /// The entity at the pointer `at` of the entity `from`.
    pub(super) fn entry(
        &mut self,
        from: &DirectoryEntry,
        at: usize,
        what: &str,
    ) -> Got<Rc<DirectoryEntry>> {
        let Some(entry) = self.store.entry(at) else {
            return Err(Miss::Refuse(from.refuse(
                self.store.path,
                format!("its {what} should be at D{at}, but there is no entity"),
            )));
        };
        if let Some(touched) = self.touched.get_mut(at / 2) {
            *touched = true;
        }
        Ok(entry)
    }

    /// Reads an entity unless that was done, and keeps it in a table.
    pub(super) fn once<T: Clone>(
        &mut self,
        entry: &Rc<DirectoryEntry>,
        table: fn(&mut Self) -> &mut BTreeMap<usize, T>,
        make: fn(&mut Self, &Rc<DirectoryEntry>) -> Got<T>,
    ) -> Got<T> {
        let at = entry.sequence;
        if let Some(found) = table(self).get(&at) {
            return Ok(found.clone());
        }
        if let Some(why) = self.missed.get(&at) {
            return Err(Miss::Leave(why.clone()));
        }
        let made = self.inside(entry, |this| make(this, entry));
        match &made {
            Ok(found) => {
                table(self).insert(at, found.clone());
            }
            Err(Miss::Leave(why)) => {
                self.missed.insert(at, why.clone());
            }
            Err(Miss::Refuse(_)) => {}
        }
        made
    }

    /// Does something inside an entity, which must not lead back to itself.
    pub(super) fn inside<T>(
        &mut self,
        entry: &DirectoryEntry,
        work: impl FnOnce(&mut Self) -> Got<T>,
    ) -> Got<T> {
        let at = entry.sequence;
        if self.active.contains(&at) || self.active.len() >= DEEPEST {
            return Err(Miss::Refuse(entry.refuse(
                self.store.path,
                format!("it leads back to itself, or entities are nested more than {DEEPEST} deep; the file is damaged"),
            )));
        }
        self.active.push(at);
        let made = work(self);
        self.active.pop();
        made
    }

    /// The integers of an entity that has nothing else, from the first.
    pub(super) fn cursor(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Cursor> {
        if let Some(record) = self.records.get(&entry.sequence) {
            let record = Rc::clone(record);
            return Ok(Cursor { record, at: 0 });
        }
        let integers = self.store.fields(entry)?.integers_to_end()?;
        let record = Rc::new(Record {
            entry: Rc::clone(entry),
            integers,
        });
        self.records.insert(entry.sequence, Rc::clone(&record));
        Ok(Cursor { record, at: 0 })
    }

    /// A point (116) or direction (123).
    pub(super) fn point_at(&mut self, from: &DirectoryEntry, at: usize, entity: u32) -> Got<DVec3> {
        let what = if entity == 116 { "point" } else { "direction" };
        let entry = self.entry(from, at, what)?;
        if entry.entity != entity {
            return Err(Miss::Refuse(from.refuse(
                self.store.path,
                format!(
                    "its {what} at D{at} is an entity {}, not {entity}",
                    entry.entity
                ),
            )));
        }
        self.once(
            &entry,
            |this| &mut this.points,
            |this, entry| {
                let transform = this.store.transform(entry)?;
                let values = this.store.fields(entry)?.reals(3, "coordinates")?;
                let value = DVec3::from_slice(&values);
                let placed = match (transform, entry.entity) {
                    (None, _) => value,
                    (Some(t), 116) => t.apply(value),
                    (Some(t), _) => t.vector(value),
                };
                if placed.is_finite() {
                    Ok(placed)
                } else {
                    super::leave("a transformation leads to numbers that are too large")
                }
            },
        )
    }

    /// Hands on what was repaired at a face.
    pub(super) fn take_notes(&mut self, entry: &DirectoryEntry) {
        for note in self.file.model.take_notes() {
            self.file
                .warnings
                .push(format!("line {} (D{}): {note}", entry.line, entry.sequence));
        }
    }

    /// Counts an entity as unread and says why.
    pub(super) fn leave(&mut self, entry: &DirectoryEntry, why: &str) {
        if self.left.insert(entry.sequence) {
            self.file.warnings.push(format!(
                "line {} (D{}): the {} was skipped: {why}",
                entry.line,
                entry.sequence,
                super::structure::name_of(entry.entity)
            ));
        }
    }
}
