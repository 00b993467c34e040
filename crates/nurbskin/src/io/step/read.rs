//! STEP files in: units, representations and where assemblies put them.

use super::instance::{Instance, Step, real};
use super::parse::{Value, plain};
use super::place::Geometry;
use super::topology_in::{Losses, Topology};
use crate::cad::Model;
use crate::io::cad::CadFile;
use crate::unit::{Unit, UnitSource};
use crate::{Error, Result};
use glam::DAffine3;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Not more placements of parts than this are followed.
const MAX_PLACEMENTS: usize = 100_000;

/// Reads a STEP file (ISO 10303-21; AP203, AP214, AP242): solids, shells, faces and bare surfaces, placed as its
/// assemblies say, as NURBS. Elementary surfaces become exact NURBS; p-curves are computed from the curves of the edges.
///
/// `path` is for messages. Lengths are in the unit of the file, or in millimetres where that is none of
/// [`Unit::ALL`](crate::Unit::ALL). Whatever carries shape and is not understood is counted in
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
/// let file = nurbskin::io::step::read(text, "ball.stp")?;
/// assert_eq!(file.model.faces().len(), 1);
/// # Ok::<(), nurbskin::Error>(())
/// ```
///
/// # Errors
/// [`Error::Read`] with the line and the number of the instance if this is no STEP file, if it is cut off or its text
/// cannot be parsed, or if it holds nothing that can be read; the text then names what it holds.
pub fn read(bytes: impl AsRef<[u8]>, path: impl AsRef<Path>) -> Result<CadFile> {
    let step = Step::new(bytes.as_ref(), path.as_ref())?;
    Reader::new(&step).read()
}

/// Units of a representation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Context {
    /// Millimetres per unit, where the file says so.
    length: Option<f64>,
    /// Radians per unit.
    angle: f64,
    /// The uncertainty, in the unit.
    tolerance: f64,
}

const UNKNOWN: Context = Context {
    length: None,
    angle: 1.0,
    tolerance: 1e-5,
};

#[derive(Clone, Debug, Default)]
struct Representation {
    items: Vec<u64>,
    context: Option<u64>,
}

struct Reader<'s, 'a> {
    step: &'s Step<'a>,
    losses: Losses,
    entities: BTreeMap<String, usize>,
    /// Instances by type, of the types that lead to shape.
    by_type: BTreeMap<&'a str, Vec<u64>>,
    representations: BTreeMap<u64, Representation>,
    /// Representations that are one: to the smallest of their numbers, perhaps over others.
    same: BTreeMap<u64, u64>,
    /// The representations of each group of those that are one.
    members: BTreeMap<u64, Vec<u64>>,
    /// Children of a representation with their placements, in the unit of the model.
    children: BTreeMap<u64, Vec<(u64, DAffine3)>>,
    parts: BTreeMap<u64, Model>,
    taken: BTreeSet<u64>,
    unit: Unit,
    placements: usize,
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
            .filter_map(|&c| self.context(Some(c)).length)
            .collect();
        if let Some(&first) = lengths.first() {
            source = UnitSource::File;
            let ours = |u: &Unit| (u.millimetres() / first - 1.0).abs() < 1e-9;
            match Unit::ALL.into_iter().find(ours) {
                Some(unit) => self.unit = unit,
                None => self.losses.warn(format!(
                    "the unit of the file is {first} mm; lengths are in mm"
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
                .warn("the file does not end with END-ISO-10303-21;");
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
            if let Some(name) = names.iter().find(|n| shape(n)) {
                if let Err(error) = self.representation(id) {
                    self.losses.add(name, error);
                }
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

    /// Lengths, angles and uncertainty of a context.
    fn context(&self, id: Option<u64>) -> Context {
        id.and_then(|id| self.step.get(id).ok())
            .map_or(UNKNOWN, |instance| {
                let mut context = UNKNOWN;
                if let Ok(all) = instance.part("GLOBAL_UNIT_ASSIGNED_CONTEXT") {
                    let k = if instance.is_complex() { 0 } else { 2 };
                    for unit in all.references(k).unwrap_or_default() {
                        let _ = self.unit_into(unit, &mut context);
                    }
                }
                if let Ok(all) = instance.part("GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT") {
                    let k = if instance.is_complex() { 0 } else { 2 };
                    for uncertainty in all.references(k).unwrap_or_default() {
                        let value = self.step.get(uncertainty).ok();
                        if let Some(value) = value.and_then(|v| v.all().get(0).and_then(real)) {
                            let millimetre = 1.0 / context.length.unwrap_or(1.0);
                            context.tolerance = value.clamp(1e-7 * millimetre, 1e-2 * millimetre);
                        }
                    }
                }
                context
            })
    }

    fn unit_into(&self, id: u64, context: &mut Context) -> Result<()> {
        let unit = self.step.get(id)?;
        if unit.has("LENGTH_UNIT") {
            let metres = self.scale(&unit, "METRE")?;
            context.length = metres
                .map(|m| m * 1000.0)
                .filter(|m| *m > 0.0 && m.is_finite());
        } else if unit.has("PLANE_ANGLE_UNIT") {
            let radians = self.scale(&unit, "RADIAN")?;
            context.angle = radians.filter(|r| *r > 0.0 && r.is_finite()).unwrap_or(1.0);
        }
        Ok(())
    }

    /// How many SI units this one is.
    fn scale(&self, unit: &Instance<'_, '_>, si: &str) -> Result<Option<f64>> {
        if unit.has("CONVERSION_BASED_UNIT") {
            let measure = self
                .step
                .get(unit.part("CONVERSION_BASED_UNIT")?.reference(1)?)?;
            let all = measure.part("MEASURE_WITH_UNIT")?;
            let base = self.step.get(all.reference(1)?)?;
            let factor = self.step.deeper(base.id, || self.scale(&base, si))?;
            let exact = |x: f64| (x * 1e12).round() / 1e12;
            return Ok(factor.map(|f| f * all.real(0).map_or(f64::NAN, exact)));
        }
        if !unit.has("SI_UNIT") {
            return Ok(None);
        }
        let all = unit.part("SI_UNIT")?;
        let k = usize::from(!unit.is_complex());
        if all.get(k + 1) != Some(&Value::Name(si)) {
            return Ok(None);
        }
        Ok(match all.get(k) {
            Some(Value::Name(prefix)) => prefix_of(prefix),
            _ => Some(1.0),
        })
    }

    fn factor(&self, representation: u64) -> f64 {
        let context = self
            .representations
            .get(&representation)
            .and_then(|r| r.context);
        self.context(context).length.map_or(1.0, |mm| {
            let factor = mm / self.unit.millimetres();
            if (factor - 1.0).abs() < 1e-9 {
                1.0
            } else {
                factor
            }
        })
    }

    fn group(&self, mut id: u64) -> u64 {
        while let Some(&next) = self.same.get(&id) {
            if next >= id {
                break;
            }
            id = next;
        }
        id
    }

    /// Which representations are one, and which are placed in others.
    fn relations(&mut self) {
        let of_type = |name: &str| self.by_type.get(name).cloned().unwrap_or_default();
        let mut ids = of_type("SHAPE_REPRESENTATION_RELATIONSHIP");
        ids.extend(of_type("REPRESENTATION_RELATIONSHIP"));
        ids.sort_unstable();
        ids.dedup();
        let swapped = self.swapped();
        let mut placed = Vec::new();
        for id in ids {
            match self.relation(id) {
                Ok((one, other, None)) => {
                    let (a, b) = (self.group(one), self.group(other));
                    if a != b {
                        self.same.insert(a.max(b), a.min(b));
                    }
                }
                Ok((one, other, Some(way))) => {
                    let turned = swapped.contains(&id);
                    placed.push(if turned {
                        (one, other, way.inverse())
                    } else {
                        (other, one, way)
                    });
                }
                Err(error) => self.losses.add("SHAPE_REPRESENTATION_RELATIONSHIP", error),
            }
        }
        for (parent, child, way) in placed {
            if way.is_finite() {
                let (parent, child) = (self.group(parent), self.group(child));
                self.children.entry(parent).or_default().push((child, way));
            }
        }
        let all: Vec<u64> = self.representations.keys().copied().collect();
        for id in all {
            for item in self
                .representations
                .get(&id)
                .map(|r| r.items.clone())
                .unwrap_or_default()
            {
                if self.step.names(item).contains(&"MAPPED_ITEM") {
                    match self.mapped(id, item) {
                        Ok((child, way)) if way.is_finite() => {
                            let (parent, child) = (self.group(id), self.group(child));
                            self.children.entry(parent).or_default().push((child, way));
                        }
                        Ok(_) => {}
                        Err(error) => self.losses.add("MAPPED_ITEM", error),
                    }
                }
            }
        }
    }

    /// Two related representations, and where the first is in the second.
    fn relation(&self, id: u64) -> Result<(u64, u64, Option<DAffine3>)> {
        let instance = self.step.get(id)?;
        let all = instance.part("REPRESENTATION_RELATIONSHIP")?;
        let (one, other) = (all.reference(2)?, all.reference(3)?);
        if !instance.has("REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION") {
            return Ok((one, other, None));
        }
        let operator = instance
            .part("REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION")?
            .reference(0)?;
        let operator = self.step.get(operator)?;
        if !operator.has("ITEM_DEFINED_TRANSFORMATION") {
            return Err(operator.error("this transformation is not read"));
        }
        let all = operator.all();
        let from = self.placement(all.reference(2)?, one)?;
        let to = self.placement(all.reference(3)?, other)?;
        Ok((one, other, Some(to * from.inverse())))
    }

    /// A placement in the unit of the model.
    fn placement(&self, id: u64, representation: u64) -> Result<DAffine3> {
        let mut way = self.geometry(UNKNOWN).frame(id)?.affine();
        way.translation *= self.factor(representation);
        Ok(way)
    }

    fn mapped(&self, parent: u64, item: u64) -> Result<(u64, DAffine3)> {
        let instance = self.step.get(item)?;
        let all = instance.part("MAPPED_ITEM")?;
        let k = usize::from(!instance.is_complex());
        let source = self.step.get(all.reference(k)?)?;
        let child = source.all().reference(1)?;
        let from = self.placement(source.all().reference(0)?, child)?;
        let to = self.placement(all.reference(k + 1)?, parent)?;
        Ok((child, to * from.inverse()))
    }

    /// Relationships whose first representation is that of the assembly, not of the component.
    fn swapped(&self) -> BTreeSet<u64> {
        let mut owner = BTreeMap::new();
        for &id in self
            .by_type
            .get("SHAPE_DEFINITION_REPRESENTATION")
            .into_iter()
            .flatten()
        {
            let pair = || -> Result<(u64, u64)> {
                let instance = self.step.get(id)?;
                let shape = self.step.get(instance.all().reference(0)?)?;
                Ok((instance.all().reference(1)?, shape.all().reference(2)?))
            };
            if let Ok((representation, definition)) = pair() {
                owner.insert(definition, representation);
            }
        }
        let mut swapped = BTreeSet::new();
        for &id in self
            .by_type
            .get("CONTEXT_DEPENDENT_SHAPE_REPRESENTATION")
            .into_iter()
            .flatten()
        {
            let against = || -> Result<Option<u64>> {
                let instance = self.step.get(id)?;
                let relation = instance.all().reference(0)?;
                let shape = self.step.get(instance.all().reference(1)?)?;
                let usage = self.step.get(shape.all().reference(2)?)?;
                let (assembly, component) = (usage.all().reference(3)?, usage.all().reference(4)?);
                let both = self.step.get(relation)?;
                let all = both.part("REPRESENTATION_RELATIONSHIP")?;
                let (one, other) = (all.reference(2)?, all.reference(3)?);
                let is = |d: u64, r: u64| owner.get(&d) == Some(&r);
                Ok((is(assembly, one) && is(component, other) && one != other).then_some(relation))
            };
            swapped.extend(against().ok().flatten());
        }
        swapped
    }

    fn geometry(&self, context: Context) -> Geometry<'s, 'a> {
        Geometry {
            step: self.step,
            angle: context.angle,
            tolerance: context.tolerance,
        }
    }

    /// Puts all parts where the assemblies say, from the representations that are in no other.
    fn assemble(&mut self, model: &mut Model) -> Result<()> {
        let inner: BTreeSet<u64> = self.children.values().flatten().map(|c| c.0).collect();
        for &id in self.representations.keys() {
            let group = self.group(id);
            self.members.entry(group).or_default().push(id);
        }
        let roots: Vec<u64> = self
            .members
            .keys()
            .copied()
            .filter(|g| !inner.contains(g))
            .collect();
        for root in roots {
            self.put(model, root, DAffine3::IDENTITY, &mut Vec::new())?;
        }
        Ok(())
    }

    fn put(
        &mut self,
        model: &mut Model,
        group: u64,
        way: DAffine3,
        path: &mut Vec<u64>,
    ) -> Result<()> {
        if path.contains(&group) || path.len() > 32 {
            let note = self.step.error(group, "an assembly that holds itself");
            self.losses.warn(note.to_string());
            return Ok(());
        }
        self.placements += 1;
        let most = self
            .step
            .index
            .instances
            .len()
            .saturating_mul(64)
            .saturating_add(10_000);
        if self.placements > MAX_PLACEMENTS || model.faces().len() > most {
            return Err(self.step.error(
                group,
                "the assemblies of this file repeat their parts too often",
            ));
        }
        let members = self.members.get(&group).cloned().unwrap_or_default();
        for id in members {
            let part = self.part(id)?;
            if !part.faces().is_empty() {
                let part = if way == DAffine3::IDENTITY {
                    part
                } else {
                    part.map_points(|p| way.transform_point3(p))?
                };
                model.append(part)?;
            }
        }
        path.push(group);
        for (child, own) in self.children.get(&group).cloned().unwrap_or_default() {
            self.put(model, child, way * own, path)?;
        }
        path.pop();
        Ok(())
    }

    /// The items of a representation as a model in the unit of the result.
    fn part(&mut self, id: u64) -> Result<Model> {
        if let Some(part) = self.parts.get(&id) {
            return Ok(part.clone());
        }
        let representation = self.representations.get(&id).cloned().unwrap_or_default();
        let part = self.items(&representation.items, representation.context)?;
        self.parts.insert(id, part.clone());
        Ok(part)
    }

    fn items(&mut self, items: &[u64], context: Option<u64>) -> Result<Model> {
        let context = self.context(context);
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
                    .warn("some shapes are in no representation; they were read all the same");
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

fn prefix_of(prefix: &str) -> Option<f64> {
    Some(match prefix {
        "EXA" => 1e18,
        "PETA" => 1e15,
        "TERA" => 1e12,
        "GIGA" => 1e9,
        "MEGA" => 1e6,
        "KILO" => 1e3,
        "HECTO" => 1e2,
        "DECA" => 1e1,
        "DECI" => 1e-1,
        "CENTI" => 1e-2,
        "MILLI" => 1e-3,
        "MICRO" => 1e-6,
        "NANO" => 1e-9,
        "PICO" => 1e-12,
        "FEMTO" => 1e-15,
        "ATTO" => 1e-18,
        _ => return None,
    })
}
