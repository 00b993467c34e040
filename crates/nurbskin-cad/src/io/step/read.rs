//! STEP files in: units, representations and where assemblies put them.

mod assembly;
mod curve;
mod edges;
mod index;
mod instance;
mod on_surface;
mod parse;
mod place;
mod shape;
mod spline_surface;
mod surface;
#[cfg(test)]
mod tests;
mod topology;
mod units;

use crate::Model;
use crate::io::file::{CadFile, CadHeader};
use glam::DAffine3;
use instance::Step;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use parse::{Part, Value, plain};
use place::Geometry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use topology::{Losses, Topology};
use units::Context;

/// Reads a STEP file (ISO 10303-21; AP203, AP214, AP242): solids, shells, faces and bare surfaces, placed as its
/// assemblies say, as NURBS. Elementary surfaces become exact NURBS. P-curves on B-spline surfaces are those of the file where they lie on
/// their edge; others are computed from the curves of the edges.
///
/// `path` is for messages. Lengths are in the unit of the file, or in millimetres where that is none of
/// [`Unit::ALL`](nurbskin_geometry::Unit::ALL). Whatever carries shape and is not understood is counted in
/// [`CadFile::unread`] and named in [`CadFile::warnings`]. Time is linear in the file for usual parts; besides the
/// result, memory is 16 bytes per instance.
///
/// ```
/// let text = "ISO-10303-21;HEADER;ENDSEC;DATA;
/// #1=CARTESIAN_POINT('',(0.,0.,0.));
/// #2=AXIS2_PLACEMENT_3D('',#1,$,$);
/// #3=SPHERICAL_SURFACE('',#2,10.);
/// #4=GEOMETRIC_SET('',(#3));
/// ENDSEC;END-ISO-10303-21;";
/// let file = nurbskin_cad::io::step::read(text, "ball.stp")?;
/// assert_eq!(file.model.faces().len(), 1);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Read`] with the line and the number of the instance if this is no STEP file, if it is cut off or its text
/// cannot be parsed, or if it holds nothing that can be read; the text then names what it holds.
pub fn read(bytes: impl AsRef<[u8]>, path: impl AsRef<Path>) -> Result<CadFile> {
    let step = Step::new(bytes.as_ref(), path.as_ref())?;
    Reader::new(&step).read()
}

/// What `FILE_NAME` says (ISO 10303-21, 8.2.3): name, time, authors, organisations, preprocessor, system, authorisation.
fn header(parts: &[Part<'_>]) -> CadHeader {
    let Some(part) = parts.iter().find(|part| part.name == "FILE_NAME") else {
        return CadHeader::default();
    };
    let text = |value: &Value<'_>| match value {
        Value::Text(text) => plain(text).trim().to_owned(),
        _ => String::new(),
    };
    let field = |k: usize| match part.values.get(k) {
        Some(Value::List(values)) => {
            let texts = values.iter().map(text).filter(|text| !text.is_empty());
            texts.collect::<Vec<_>>().join(", ")
        }
        Some(value) => text(value),
        None => String::new(),
    };
    CadHeader {
        author: field(2),
        organization: field(3),
        system: field(5),
        date: field(1),
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Representation {
    pub(super) items: Vec<u64>,
    pub(super) context: Option<u64>,
}

pub(super) struct Reader<'s, 'a> {
    step: &'s Step<'a>,
    losses: Losses,
    pub(super) entities: BTreeMap<String, usize>,
    /// Instances by type, of the types that lead to shape.
    pub(super) by_type: BTreeMap<&'a str, Vec<u64>>,
    pub(super) representations: BTreeMap<u64, Representation>,
    /// Representations that are one: to the smallest of their numbers, perhaps over others.
    pub(super) same: BTreeMap<u64, u64>,
    /// The representations of each group of those that are one.
    pub(super) members: BTreeMap<u64, Vec<u64>>,
    /// Children of a representation with their placements, in the unit of the model.
    pub(super) children: BTreeMap<u64, Vec<(u64, DAffine3)>>,
    pub(super) parts: BTreeMap<u64, Model>,
    pub(super) taken: BTreeSet<u64>,
    pub(super) unit: Unit,
    pub(super) placements: usize,
}

/// Types of items that hold shape.
const ITEMS: [&str; 7] = [
    "MANIFOLD_SOLID_BREP",
    "BREP_WITH_VOIDS",
    "FACETED_BREP",
    "SHELL_BASED_SURFACE_MODEL",
    "FACE_BASED_SURFACE_MODEL",
    "GEOMETRIC_SET",
    "GEOMETRIC_CURVE_SET",
];

impl<'s, 'a> Reader<'s, 'a> {
    fn new(step: &'s Step<'a>) -> Self {
        Self {
            step,
            losses: Losses::default(),
            entities: BTreeMap::new(),
            by_type: BTreeMap::new(),
            representations: BTreeMap::new(),
            same: BTreeMap::new(),
            members: BTreeMap::new(),
            children: BTreeMap::new(),
            parts: BTreeMap::new(),
            taken: BTreeSet::new(),
            unit: Unit::Millimetre,
            placements: 0,
        }
    }

    fn read(mut self) -> Result<CadFile> {
        self.survey();
        let (mut source, mut name) = (UnitSource::Assumed, String::new());
        let contexts: BTreeSet<u64> = self
            .representations
            .values()
            .filter_map(|r| r.context)
            .collect();
        let lengths: Vec<f64> = contexts
            .iter()
            .filter_map(|&c| self.step.context(Some(c)).length)
            .collect();
        if let Some(&first) = lengths.first() {
            source = UnitSource::File;
            let ours = |u: &Unit| (u.millimetres() / first - 1.0).abs() < 1e-9;
            match Unit::ALL.into_iter().find(ours) {
                Some(unit) => self.unit = unit,
                None => self.losses.warn(format!(
                    "the file has a unit of its own ({first} mm): lengths were converted to mm"
                )),
            }
        }
        self.relations();
        let mut model = Model::default();
        model.unit = self.unit;
        self.assemble(&mut model)?;
        self.orphans(&mut model)?;
        for &id in self.by_type.get("PRODUCT").into_iter().flatten().take(1) {
            let product = self.step.get(id)?;
            let (number, text) = (product.all().text(0), product.all().text(1));
            name = if text.is_empty() { number } else { text };
        }
        model.name = name;
        model.colour = self.colour();
        if model.faces().is_empty() {
            return Err(self.nothing());
        }
        if !self.step.index.complete {
            self.losses
                .warn("the file does not end with END-ISO-10303-21; it may be cut off");
        }
        if self.losses.more > 0 {
            let more = format!("and {} more warnings", self.losses.more);
            self.losses.warnings.push(more);
        }
        Ok(CadFile {
            format: "step",
            model,
            unit_source: source,
            entities: self.entities,
            unread: self.losses.unread,
            header: header(&self.step.index.header),
            warnings: self.losses.warnings,
        })
    }

    /// Counts all types, and collects what leads to shape.
    fn survey(&mut self) {
        for id in self.step.ids() {
            let names = self.step.names(id);
            for name in &names {
                match self.entities.get_mut(*name) {
                    Some(count) => *count += 1,
                    None => {
                        self.entities.insert((*name).to_string(), 1);
                    }
                }
                let wanted = ITEMS.contains(name)
                    || matches!(
                        *name,
                        "PRODUCT"
                            | "OPEN_SHELL"
                            | "CLOSED_SHELL"
                            | "ADVANCED_FACE"
                            | "FACE_SURFACE"
                            | "COLOUR_RGB"
                    )
                    || *name == "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION"
                    || *name == "SHAPE_DEFINITION_REPRESENTATION"
                    || *name == "SHAPE_REPRESENTATION_RELATIONSHIP"
                    || *name == "REPRESENTATION_RELATIONSHIP";
                if wanted {
                    self.by_type.entry(name).or_default().push(id);
                }
            }
            let shape = |n: &&str| {
                n.ends_with("SHAPE_REPRESENTATION")
                    && *n != "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION"
            };
            if let Some(name) = names.iter().find(|n| shape(n))
                && let Err(error) = self.representation(id)
            {
                self.losses.add(name, error);
            }
        }
    }

    fn representation(&mut self, id: u64) -> Result<()> {
        let instance = self.step.get(id)?;
        let all = instance.part("REPRESENTATION")?;
        let context = match all.get(2) {
            Some(Value::Reference(id)) => Some(*id),
            _ => None,
        };
        let items = all.references(1)?;
        self.representations
            .insert(id, Representation { items, context });
        Ok(())
    }

    fn geometry(&self, context: Context) -> Geometry<'s, 'a> {
        Geometry {
            step: self.step,
            angle: context.angle,
            tolerance: context.tolerance,
            planar: false,
        }
    }

    /// The items of a representation as a model in the unit of the result.
    pub(super) fn part(&mut self, id: u64) -> Result<Model> {
        if let Some(part) = self.parts.get(&id) {
            return Ok(part.clone());
        }
        let representation = self.representations.get(&id).cloned().unwrap_or_default();
        let part = self.items(&representation.items, representation.context)?;
        self.parts.insert(id, part.clone());
        Ok(part)
    }

    fn items(&mut self, items: &[u64], context: Option<u64>) -> Result<Model> {
        let context = self.step.context(context);
        let geometry = self.geometry(context);
        let mut topology = Topology::new(&geometry, &mut self.losses);
        for &item in items {
            if self.taken.insert(item) {
                topology.item(item);
            }
        }
        let factor = context
            .length
            .map_or(1.0, |mm| mm / self.unit.millimetres());
        let mut model = topology.model;
        model.drop_unused();
        model.unit = self.unit;
        if (factor - 1.0).abs() < 1e-9 {
            Ok(model)
        } else {
            model.map_points(|p| p * factor)
        }
    }

    /// Shape that no representation holds.
    fn orphans(&mut self, model: &mut Model) -> Result<()> {
        let mut lost = Vec::new();
        for name in ITEMS {
            lost.extend(self.by_type.get(name).into_iter().flatten().copied());
        }
        lost.retain(|id| !self.taken.contains(id));
        for types in [
            ["OPEN_SHELL", "CLOSED_SHELL"],
            ["ADVANCED_FACE", "FACE_SURFACE"],
        ] {
            if lost.is_empty() && model.faces().is_empty() && self.losses.unread.is_empty() {
                for name in types {
                    lost.extend(self.by_type.get(name).into_iter().flatten().copied());
                }
            }
        }
        lost.sort_unstable();
        if lost.is_empty() {
            return Ok(());
        }
        let context = self.representations.values().find_map(|r| r.context);
        let found = self.items(&lost, context)?;
        if !found.faces().is_empty() {
            if !self.representations.is_empty() {
                self.losses
                    .warn("some shapes belong to no shape representation; they were read anyway");
            }
            model.append(found)?;
        }
        Ok(())
    }

    /// The colour, if the file has only one.
    fn colour(&self) -> Option<[u8; 3]> {
        let colour = |&id: &u64| -> Result<[u8; 3]> {
            let instance = self.step.get(id)?;
            let all = instance.all();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 255"
            )]
            let byte = |k: usize| {
                all.real(k)
                    .map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8)
            };
            Ok([byte(1)?, byte(2)?, byte(3)?])
        };
        let all = self
            .by_type
            .get("COLOUR_RGB")
            .into_iter()
            .flatten()
            .take(10_000);
        let found: BTreeSet<[u8; 3]> = all.filter_map(|id| colour(id).ok()).collect();
        if found.len() == 1 {
            found.first().copied()
        } else {
            None
        }
    }

    /// The error about a file without shape that is read.
    fn nothing(&self) -> Error {
        let list = |counts: &BTreeMap<String, usize>| {
            let mut all: Vec<_> = counts.iter().collect();
            all.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
            let shown = all
                .iter()
                .take(8)
                .map(|(name, count)| format!("{count} {name}"));
            shown.collect::<Vec<_>>().join(", ")
        };
        let schema = self
            .step
            .index
            .header
            .iter()
            .find(|p| p.name == "FILE_SCHEMA");
        let schema = schema.and_then(|p| match p.values.first() {
            Some(Value::List(names)) => names.first(),
            _ => None,
        });
        let schema = match schema {
            Some(Value::Text(text)) => plain(text),
            _ => "unknown".into(),
        };
        let what = if self.entities.is_empty() {
            "the file holds no instances".to_string()
        } else if self.losses.unread.is_empty() {
            format!(
                "no surfaces or solids in it (schema {schema}); it holds {}",
                list(&self.entities)
            )
        } else {
            let why = self.losses.warnings.first().cloned().unwrap_or_default();
            format!(
                "nothing in it could be read: {}; first: {why}",
                list(&self.losses.unread)
            )
        };
        Error::read(self.step.path(), "", what)
    }
}
