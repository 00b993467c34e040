//! Faces that stand alone: surfaces with the curves that bound them (entities 141 to 144), or without any.

use super::super::directory::DirectoryEntry;
use super::curves::{Chain, points_of};
use super::entity::Reader;
use super::{Got, Miss, Place, leave};
use nurbskin_geometry::Result;
use nurbskin_geometry::nurbs::NurbsCurve;
use std::rc::Rc;

/// A boundary of a face as a file gives it: curves in space, in the parameter plane, or both.
pub(super) struct Border {
    pub(super) space: Option<Chain>,
    pub(super) plane: Option<Chain>,
    /// Whether the file prefers the curves in space.
    pub(super) space_first: bool,
    pub(super) outer: bool,
}

impl Reader<'_> {
    /// Entity 144: surface, whether its outer boundary is given, number of holes, outer boundary, holes.
    pub(super) fn trimmed_surface(
        &mut self,
        place: Place,
        entry: &Rc<DirectoryEntry>,
    ) -> Got<usize> {
        let mut cursor = self.cursor(entry)?;
        let surface = cursor.pointer();
        let given = cursor.integer() != 0;
        let holes = cursor.count(1, self)?;
        let outer = cursor.pointer();
        let mut borders = Vec::new();
        if given && outer != 0 {
            borders.push(self.curve_on_surface(entry, outer, true)?);
        }
        for _ in 0..holes {
            let hole = cursor.pointer();
            borders.push(self.curve_on_surface(entry, hole, false)?);
        }
        let name = self.name(entry, &cursor.properties())?;
        self.face(place, entry, surface, &borders, name)
    }

    /// Entity 142: how it was made, surface, curve in the parameter plane, curve in space, which of them is preferred.
    fn curve_on_surface(&mut self, from: &DirectoryEntry, at: usize, outer: bool) -> Got<Border> {
        let entry = self.entry(from, at, "boundary")?;
        if entry.entity != 142 {
            // Some writers point to the curve in space itself.
            let space = Some(self.chain(from, at)?);
            return Ok(Border {
                space,
                plane: None,
                space_first: true,
                outer,
            });
        }
        let mut cursor = self.cursor(&entry)?;
        let [_, _, plane, space] = [0; 4].map(|_: u8| cursor.pointer());
        let preferred = cursor.integer();
        Ok(Border {
            plane: self.optional_chain(&entry, plane)?,
            space: self.optional_chain(&entry, space)?,
            space_first: preferred == 2,
            outer,
        })
    }

    fn optional_chain(&mut self, from: &DirectoryEntry, at: usize) -> Got<Option<Chain>> {
        if at == 0 {
            return Ok(None);
        }
        self.chain(from, at).map(Some)
    }

    /// Entity 143: kind, surface, boundaries (141).
    pub(super) fn bounded_surface(
        &mut self,
        place: Place,
        entry: &Rc<DirectoryEntry>,
    ) -> Got<usize> {
        let mut cursor = self.cursor(entry)?;
        let _kind = cursor.integer();
        let surface = cursor.pointer();
        let mut borders = Vec::new();
        for k in 0..cursor.count(1, self)? {
            let boundary = self.entry(entry, cursor.pointer(), "boundary")?;
            if boundary.entity != 141 {
                return leave(format!(
                    "its boundary is an entity {}, not 141",
                    boundary.entity
                ));
            }
            borders.push(self.boundary(&boundary, k == 0)?);
        }
        let name = self.name(entry, &cursor.properties())?;
        self.face(place, entry, surface, &borders, name)
    }

    /// Entity 141: kind, preference, surface, and of each curve: itself, its sense, its curves in the parameter plane.
    fn boundary(&mut self, entry: &Rc<DirectoryEntry>, outer: bool) -> Got<Border> {
        let mut cursor = self.cursor(entry)?;
        let [_, preferred] = [cursor.integer(), cursor.integer()];
        let _surface = cursor.pointer();
        let (mut space, mut plane, mut paired) = (Vec::new(), Vec::new(), true);
        for _ in 0..cursor.count(3, self)? {
            let at = cursor.pointer();
            let backwards = cursor.integer() == 2;
            let chain = self.chain(entry, at)?;
            self.spend(points_of(&chain))?;
            let mut parts = chain.to_vec();
            if backwards {
                parts.reverse();
                parts = parts
                    .iter()
                    .map(NurbsCurve::reversed)
                    .collect::<Result<_>>()?;
            }
            let before = plane.len();
            for _ in 0..cursor.count(1, self)? {
                let chain = self.chain(entry, cursor.pointer())?;
                self.spend(points_of(&chain))?;
                plane.extend(chain.iter().cloned());
            }
            paired &= plane.len() - before == parts.len();
            space.append(&mut parts);
        }
        Ok(Border {
            space: Some(Rc::new(space)),
            plane: paired.then(|| Rc::new(plane)),
            space_first: preferred == 2,
            outer,
        })
    }

    /// A surface that is a face of its own: whole, or within the curve of a bounded plane (entity 108).
    pub(super) fn bare_surface(&mut self, place: Place, entry: &Rc<DirectoryEntry>) -> Got<usize> {
        self.carrier(entry, entry.sequence)?;
        let mut borders = Vec::new();
        if let Some(&at) = self.plane_boundaries.get(&entry.sequence)
            && at != 0
        {
            if entry.form == -1 {
                return leave("its plane is a hole in another plane");
            }
            borders.push(self.curve_on_surface(entry, at, true)?);
        }
        let name = entry.label.clone();
        self.face(place, entry, entry.sequence, &borders, name)
    }
}

/// Refusals pass; everything else is why an entity was left out.
pub(super) fn reason<T>(got: Got<T>) -> Result<std::result::Result<T, String>> {
    match got {
        Ok(value) => Ok(Ok(value)),
        Err(Miss::Leave(why)) => Ok(Err(why)),
        Err(Miss::Refuse(error)) => Err(error),
    }
}
