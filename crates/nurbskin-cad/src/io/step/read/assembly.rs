//! Where the assemblies of a STEP file put their parts.

use super::Reader;
use super::units::UNKNOWN;
use crate::Model;
use glam::DAffine3;
use nurbskin_geometry::Result;
use std::collections::{BTreeMap, BTreeSet};

/// What places scaled or mirrored copies.
const OPERATOR: &str = "CARTESIAN_TRANSFORMATION_OPERATOR_3D";

/// Not more placements of parts than this are followed.
const MAX_PLACEMENTS: usize = 100_000;

impl Reader<'_, '_> {
    fn factor(&self, representation: u64) -> f64 {
        let context = self
            .representations
            .get(&representation)
            .and_then(|r| r.context);
        self.step.context(context).length.map_or(1.0, |mm| {
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
    pub(super) fn relations(&mut self) {
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
        if operator.has(OPERATOR) {
            let to = self.placement(operator.id, other)?;
            return Ok((one, other, Some(to)));
        }
        if !operator.has("ITEM_DEFINED_TRANSFORMATION") {
            return Err(operator.error("this transformation is not read"));
        }
        let all = operator.all();
        let from = self.placement(all.reference(2)?, one)?;
        let to = self.placement(all.reference(3)?, other)?;
        Ok((one, other, Some(to * from.inverse())))
    }

    /// A placement or a transformation operator in the unit of the model.
    fn placement(&self, id: u64, representation: u64) -> Result<DAffine3> {
        let geometry = self.geometry(UNKNOWN);
        let mut way = if self.step.names(id).contains(&OPERATOR) {
            geometry.operator(id)?
        } else {
            geometry.frame(id)?.affine()
        };
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

    /// Puts all parts where the assemblies say, from the representations that are in no other.
    pub(super) fn assemble(&mut self, model: &mut Model) -> Result<()> {
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
            let note = self.step.error(group, "the assembly contains itself");
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
                model.append(part.placed(&way)?)?;
            }
        }
        path.push(group);
        for (child, own) in self.children.get(&group).cloned().unwrap_or_default() {
            self.put(model, child, way * own, path)?;
        }
        path.pop();
        Ok(())
    }
}
