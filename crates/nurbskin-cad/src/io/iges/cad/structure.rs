//! What of a file is a face of its own, and what carries no shape.

use super::super::directory::DirectoryEntry;
use super::super::transform::Transform;
use super::entity::Reader;
use super::surfaces::SURFACES;
use super::trimmed::reason;
use super::{Got, Place, leave};
use nurbskin_geometry::DVec3;
use std::collections::BTreeSet;
use std::rc::Rc;

/// What an entity is called.
pub(super) fn name_of(entity: u32) -> String {
    let name = match entity {
        100 => "circular arc",
        102 => "composite curve",
        104 => "conic arc",
        106 => "copious data",
        108 => "plane",
        110 => "line",
        112 => "parametric spline curve",
        114 => "parametric spline surface",
        116 => "point",
        118 => "ruled surface",
        120 => "surface of revolution",
        122 => "tabulated cylinder",
        126 => "rational B-spline curve",
        128 => "rational B-spline surface",
        130 => "offset curve",
        140 => "offset surface",
        141 | 142 => "boundary",
        143 => "bounded surface",
        144 => "trimmed surface",
        186 => "solid",
        190 => "plane surface",
        192 => "cylinder",
        194 => "cone",
        196 => "sphere",
        198 => "torus",
        308 => "subfigure",
        408 => "subfigure instance",
        430 => "solid instance",
        510 => "face",
        514 => "shell",
        _ => return format!("entity {entity}"),
    };
    format!("{name} ({entity})")
}

/// Whether an entity says nothing of the shape: annotation, drawings, views, properties, definitions that others use.
fn is_no_shape(entry: &DirectoryEntry) -> bool {
    let annotation = matches!(entry.status.get(4..6), Some("01"));
    annotation
        || matches!(
            entry.entity,
            0 | 123 | 124 | 132 | 202..=230 | 302..=322 | 402 | 404 | 406 | 410 | 418 | 420 | 422
        )
        || entry.entity == 106 && !matches!(entry.form, 1..=3 | 11..=13 | 63)
}

impl Reader<'_> {
    /// Reads everything that is a face or has faces.
    pub(super) fn all(&mut self) -> Got<()> {
        let entries = self.store.entries.clone();
        // 1. What belongs to a definition is shape only where that is used; what is grouped stands alone.
        let (mut defined, mut grouped) = (BTreeSet::new(), BTreeSet::new());
        for entry in &entries {
            match (entry.entity, entry.form) {
                (308, _) => defined.extend(self.figure(entry)?.iter().copied()),
                (402, 1 | 7 | 14 | 15) => {
                    let mut cursor = self.cursor(entry)?;
                    let count = cursor.count(1, self)?;
                    grouped.extend((0..count).map(|_| cursor.pointer()));
                }
                _ => {}
            }
        }
        // 2. Wholes before their parts: what a whole has taken does not stand alone.
        let ranks: [&[u32]; 6] = [&[408], &[186], &[514], &[510], &[143, 144], &SURFACES];
        for rank in ranks {
            for entry in entries.iter().filter(|e| rank.contains(&e.entity)) {
                let part = SURFACES.contains(&entry.entity) && entry.is_subordinate();
                let stands = !part || grouped.contains(&entry.sequence);
                let touched = self.touched.get(entry.sequence / 2) == Some(&true);
                if stands && !touched && !defined.contains(&entry.sequence) {
                    self.shape(self.place(), entry, entry.sequence)?;
                }
            }
        }
        // 3. Definitions that nobody uses are no shape.
        for at in defined {
            if let Some(touched) = self.touched.get_mut(at / 2) {
                *touched = true;
            }
        }
        Ok(())
    }

    /// Reads one entity that stands alone; what cannot be read is counted.
    fn shape(&mut self, place: Place, from: &DirectoryEntry, at: usize) -> Got<()> {
        let entry = self.entry(from, at, "member")?;
        self.spend(16)?;
        let made = match entry.entity {
            408 => self.instance(place, &entry),
            402 => Ok(()),
            186 | 510 | 514 => self.body(place, &entry),
            143 | 144 => {
                let face = if entry.entity == 144 {
                    self.trimmed_surface(place, &entry)
                } else {
                    self.bounded_surface(place, &entry)
                };
                face.map(|face| self.loose.push(face))
            }
            other if SURFACES.contains(&other) => {
                let face = self.bare_surface(place, &entry);
                face.map(|face| self.loose.push(face))
            }
            _ if is_no_shape(&entry) => Ok(()),
            _ => {
                self.left.insert(entry.sequence);
                Ok(())
            }
        };
        if let Err(why) = reason(made)? {
            self.leave(&entry, &why);
        }
        Ok(())
    }

    /// Entity 308: depth, name, members.
    fn figure(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Rc<Vec<usize>>> {
        self.once(
            entry,
            |this| &mut this.figures,
            |this, entry| {
                let mut fields = this.store.fields(entry)?;
                fields.skip(2)?;
                Ok(Rc::new(fields.pointers("members")?))
            },
        )
    }

    /// Entity 408: subfigure, translation, scale.
    fn instance(&mut self, place: Place, entry: &Rc<DirectoryEntry>) -> Got<()> {
        let (at, own) = self.once(
            entry,
            |this| &mut this.instances,
            |this, entry| {
                let mut fields = this.store.fields(entry)?;
                let at = fields.pointer()?;
                let shift = [fields.real(0.0)?, fields.real(0.0)?, fields.real(0.0)?];
                let scale = fields.real(1.0)?;
                Ok((at, Transform::scaling(scale, DVec3::from_array(shift))))
            },
        )?;
        let outer = place.of_part(self.store.transform(entry)?);
        let figure = self.entry(entry, at, "subfigure")?;
        if figure.entity != 308 {
            return leave(format!("it is one of an entity {}, not 308", figure.entity));
        }
        let place = outer
            .of_part(Some(own))
            .of_part(self.store.transform(&figure)?);
        let members = self.figure(&figure)?;
        self.inside(entry, |this| {
            members
                .iter()
                .try_for_each(|&member| this.shape(place, &figure, member))
        })
    }

    /// Counts what was not understood, and what nobody asked for though it has a shape.
    pub(super) fn count_unread(&mut self) {
        let mut alone = 0_usize;
        for (k, entry) in self.store.entries.clone().iter().enumerate() {
            let curve = matches!(
                entry.entity,
                100..=106 | 110 | 112 | 116 | 126 | 130 | 141 | 142 | 502 | 504 | 508
            );
            let seen = self.touched.get(k) == Some(&true);
            let part = curve && (entry.is_subordinate() || entry.is_parametric());
            if !seen && !part && !is_no_shape(entry) {
                self.left.insert(entry.sequence);
                alone += usize::from(curve);
            }
        }
        for at in &self.left {
            if let Some(entry) = self.store.entry(*at) {
                let kind = entry.entity.to_string();
                *self.file.unread.entry(kind).or_default() += 1;
            }
        }
        if alone > 0 {
            self.file.warnings.push(format!(
                "ignored {alone} curves and points that bound no face"
            ));
        }
        if self.file.model.faces().is_empty() {
            self.file
                .warnings
                .push("no face was found in the file".into());
        }
    }
}
