//! Reading the surfaces, curves and points of an IGES file one by one, whatever is made of them: no faces.

use super::curve;
use super::directory::DirectoryEntry;
use super::global::Global;
use super::point;
use super::point::Copious;
use super::store::Store;
use super::surface;
use super::transform::Place;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};
use nurbskin_geometry::{DVec3, Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A surface of a file.
#[derive(Clone, Debug)]
pub struct IgesSurface {
    /// The surface, transformed, restricted to the parameters that the file asks for. All weights equal makes it
    /// polynomial.
    pub surface: NurbsSurface,
    /// Sequence number of its directory entry.
    pub directory: usize,
    /// Level, or minus the directory entry of a list of levels.
    pub level: i64,
    /// Label of its directory entry, possibly empty.
    pub label: String,
    /// Whether the file says that it closes, along u and v.
    pub closed: [bool; 2],
    /// Whether a trimmed surface (143, 144) or a face (510) takes only a part of it.
    pub trimmed: bool,
}

/// A curve of a file.
#[derive(Clone, Debug)]
pub struct IgesCurve {
    /// The curve, transformed; a line has degree 1, an arc is rational of degree 2.
    pub curve: NurbsCurve,
    /// Entity type that it was: 126, 110 or 100.
    pub entity: u32,
    /// Sequence number of its directory entry.
    pub directory: usize,
    /// Level, or minus the directory entry of a list of levels.
    pub level: i64,
    /// Whether it belongs to another entity, as the border of a trimmed surface does.
    pub subordinate: bool,
    /// Whether it lives in the parameter plane of a surface.
    pub parametric: bool,
}

/// A composite curve (entity 102): curves end to end.
#[derive(Clone, Debug)]
pub struct IgesComposite {
    /// Its parts, transformed by the composite's own matrix where it has one.
    pub parts: Vec<NurbsCurve>,
    /// Sequence number of its directory entry.
    pub directory: usize,
}

/// What was read from a file. Coordinates are in [`Global::unit`].
#[derive(Clone, Debug)]
pub struct IgesModel {
    /// Unit, resolution, names.
    pub global: Global,
    /// Entities 128, in the order of the file.
    pub surfaces: Vec<IgesSurface>,
    /// Entities 126, 110 and 100, those within composites too.
    pub curves: Vec<IgesCurve>,
    /// Entities 102 all of whose parts are read.
    pub composites: Vec<IgesComposite>,
    /// Entities 116, and 106 of the forms that are points.
    pub points: Vec<DVec3>,
    /// Entities 106 of the forms that are lines.
    pub polylines: Vec<Vec<DVec3>>,
    /// How many entities of each type the file has.
    pub entities: BTreeMap<u32, usize>,
    /// How many entities of each type were left aside.
    pub unread: BTreeMap<u32, usize>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Reads the entities of an IGES file in its fixed-length ASCII form, versions up to 5.3, each for itself: surfaces over
/// their whole domain, curves, points. Faces are what [`read_cad`](super::read_cad) makes of them. `path` is for messages
/// only.
///
/// Time and memory are proportional to the size of the file, whatever it says.
///
/// # Errors
/// [`Error::Read`] that names the line and its card (as in `line 45 (P12)`), what is wrong and what to do: for a file
/// that is not IGES, compressed or binary, cut short, or whose counts, pointers or numbers contradict each other.
/// Entities that are sound but of another type are no error: they are counted in [`IgesModel::unread`].
pub fn read(bytes: impl AsRef<[u8]>, path: impl AsRef<Path>) -> Result<IgesModel> {
    let (bytes, path) = (bytes.as_ref(), path.as_ref());
    let mut warnings = Vec::new();
    let store = Store::open(bytes, path, &mut warnings)?;
    let model = IgesModel {
        global: store.global.clone(),
        surfaces: Vec::new(),
        curves: Vec::new(),
        composites: Vec::new(),
        points: Vec::new(),
        polylines: Vec::new(),
        entities: BTreeMap::new(),
        unread: BTreeMap::new(),
        warnings,
    };
    let mut reader = Reader {
        path,
        store,
        trimmed: BTreeSet::new(),
        composites: Vec::new(),
        model,
    };
    for entry in reader.store.entries.clone() {
        reader.entity(&entry)?;
    }
    reader.join_composites(bytes.len())?;
    let mut model = reader.model;
    for surface in &mut model.surfaces {
        surface.trimmed = reader.trimmed.contains(&surface.directory);
    }
    Ok(model)
}

struct Reader<'a> {
    path: &'a Path,
    store: Store<'a>,
    /// Directory entries of surfaces that something trims.
    trimmed: BTreeSet<usize>,
    /// Composite curves, and their parts.
    composites: Vec<(usize, Vec<usize>)>,
    model: IgesModel,
}

impl Reader<'_> {
    /// From an entity's own coordinates to those of the model.
    fn place(&self, entry: &DirectoryEntry) -> Result<Place> {
        Ok(Place {
            transform: self.store.transform(entry)?,
            factor: self.store.global.factor,
        })
    }

    fn entity(&mut self, entry: &DirectoryEntry) -> Result<()> {
        *self.model.entities.entry(entry.entity).or_default() += 1;
        let path = self.path;
        let moved = |e: Error| {
            entry.refuse(
                path,
                format!("its transformation leads to numbers that are too large: {e}"),
            )
        };
        match (entry.entity, entry.form) {
            (124, _) => {}
            (128, _) => {
                let mut fields = self.store.fields(entry)?;
                let found = surface::read(&mut fields)?;
                let place = self.place(entry)?;
                self.model.surfaces.push(IgesSurface {
                    surface: found
                        .surface
                        .map_points(|p| place.apply(p))
                        .map_err(moved)?,
                    directory: entry.sequence,
                    level: entry.level,
                    label: entry.label.clone(),
                    closed: found.closed,
                    trimmed: false,
                });
            }
            (126 | 100, _) | (110, 0) => {
                let mut fields = self.store.fields(entry)?;
                let curve = match entry.entity {
                    126 => curve::read_spline(&mut fields)?,
                    110 => curve::read_line(&mut fields)?,
                    _ => curve::read_arc(&mut fields)?,
                };
                // A curve in the parameter plane of a surface has no length in any unit.
                let curve = if entry.is_parametric() && entry.transform == 0 {
                    curve
                } else {
                    let place = self.place(entry)?;
                    curve.map_points(|p| place.apply(p)).map_err(moved)?
                };
                self.model.curves.push(IgesCurve {
                    curve,
                    entity: entry.entity,
                    directory: entry.sequence,
                    level: entry.level,
                    subordinate: entry.is_subordinate(),
                    parametric: entry.is_parametric(),
                });
            }
            (102, _) => {
                let mut fields = self.store.fields(entry)?;
                let count = fields.count("curves of a composite")?;
                let mut parts = Vec::new();
                for _ in 0..count {
                    parts.push(usize::try_from(fields.integer(0)?).unwrap_or(0));
                }
                self.composites.push((entry.sequence, parts));
            }
            (116, _) => {
                let mut fields = self.store.fields(entry)?;
                let point = point::read_point(&mut fields)?;
                let place = self.place(entry)?;
                self.model
                    .points
                    .push(finite(place.apply(point), entry, path)?);
            }
            (106, form) => {
                let mut fields = self.store.fields(entry)?;
                let Some(copious) = point::read_copious(&mut fields, form)? else {
                    self.unread(106);
                    return Ok(());
                };
                let place = self.place(entry)?;
                let place_all = |points: Vec<DVec3>| -> Result<Vec<DVec3>> {
                    points
                        .into_iter()
                        .map(|p| finite(place.apply(p), entry, path))
                        .collect()
                };
                match copious {
                    Copious::Points(points) => self.model.points.extend(place_all(points)?),
                    Copious::Polyline(points) => self.model.polylines.push(place_all(points)?),
                }
            }
            (143 | 144 | 510, _) => {
                // Only which surface they take: the first pointer of 144 and 510, the second number of 143.
                self.unread(entry.entity);
                let mut fields = self.store.fields(entry)?;
                if entry.entity == 143 {
                    fields.integer(0)?;
                }
                let surface = usize::try_from(fields.integer(0)?).unwrap_or(0);
                self.trimmed.insert(surface);
            }
            (other, _) => self.unread(other),
        }
        Ok(())
    }

    fn unread(&mut self, entity: u32) {
        *self.model.unread.entry(entity).or_default() += 1;
    }

    /// Puts composite curves together, once all curves are read. A curve may be part of several composites, but all
    /// together not much larger than the file: a damaged one shall not fill the memory.
    fn join_composites(&mut self, bytes: usize) -> Result<()> {
        let index: BTreeMap<usize, usize> = self
            .model
            .curves
            .iter()
            .enumerate()
            .map(|(k, curve)| (curve.directory, k))
            .collect();
        // A curve takes some hundred bytes of its file, and eight more for each control point at the least.
        let mut room = 2 * bytes;
        for (at, pointers) in std::mem::take(&mut self.composites) {
            let Some(entry) = self.store.entry(at) else {
                continue;
            };
            let place = self.place(&entry)?;
            let moves = entry.transform != 0;
            let mut parts = Vec::new();
            let mut whole = true;
            for pointer in pointers {
                if self.store.entry(pointer).is_none() {
                    return Err(entry.refuse(
                        self.path,
                        format!(
                            "a part of the composite curve should be at \
                     D{pointer}, but there is no entity"
                        ),
                    ));
                }
                let Some(&at) = index.get(&pointer) else {
                    whole = false;
                    break;
                };
                let curve = &self.model.curves[at].curve;
                room = room.checked_sub(100 + 8 * curve.control_points().len()).ok_or_else(|| {
                    entry.refuse(self.path, "composite curves repeat the same parts over and over; the file is damaged")
                })?;
                parts.push(if moves {
                    curve
                        .map_points(|p| place.apply(p))
                        .map_err(|e| entry.refuse(self.path, e.to_string()))?
                } else {
                    curve.clone()
                });
            }
            if whole {
                self.model.composites.push(IgesComposite {
                    parts,
                    directory: entry.sequence,
                });
            } else {
                self.unread(102);
            }
        }
        Ok(())
    }
}

fn finite(point: DVec3, entry: &DirectoryEntry, path: &Path) -> Result<DVec3> {
    if point.is_finite() {
        Ok(point)
    } else {
        Err(entry.refuse(
            path,
            "its transformation leads to numbers that are too large",
        ))
    }
}
