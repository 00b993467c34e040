//! Curves: each entity as one or more NURBS curves end to end.

use super::super::curve::{read_arc, read_line, read_spline};
use super::super::directory::DirectoryEntry;
use super::super::point::{Copious, read_copious};
use super::entity::Reader;
use super::structure::name_of;
use super::{Got, Place, conic_arc, leave, spline};
use nurbskin_geometry::nurbs::sweep::join;
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve};
use nurbskin_geometry::{DVec3, Result};
use std::rc::Rc;

/// Curves end to end.
pub(super) type Chain = Rc<Vec<NurbsCurve>>;

impl Reader<'_> {
    /// The curve at a pointer, its own transformation applied; a composite one in its parts.
    pub(super) fn chain(&mut self, from: &DirectoryEntry, at: usize) -> Got<Chain> {
        let entry = self.entry(from, at, "curve")?;
        self.once(&entry, |this| &mut this.curves, Self::read_chain)
    }

    /// The curve at a pointer as a single one, in the place of what points to it.
    pub(super) fn curve(&mut self, from: &DirectoryEntry, at: usize) -> Got<NurbsCurve> {
        let chain = self.chain(from, at)?;
        match &chain[..] {
            [one] => Ok(one.clone()),
            parts => {
                self.spend(points_of(parts))?;
                Ok(join(parts)?)
            }
        }
    }

    fn read_chain(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Chain> {
        let transform = self.store.transform(entry)?;
        let parts = if entry.entity == 102 {
            self.read_composite(entry)?
        } else {
            vec![self.read_curve(entry)?]
        };
        let parts = match transform {
            None => parts,
            Some(t) => {
                let placed = parts.iter().map(|part| part.map_points(|p| t.apply(p)));
                placed.collect::<Result<_>>()?
            }
        };
        self.spend(points_of(&parts))?;
        Ok(Rc::new(parts))
    }

    fn read_composite(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Vec<NurbsCurve>> {
        let mut cursor = self.cursor(entry)?;
        let mut parts = Vec::new();
        for _ in 0..cursor.count(1, self)? {
            let at = cursor.pointer();
            let part = self.entry(entry, at, "part")?;
            // Points and connect points may stand between the curves.
            if matches!(part.entity, 116 | 132) {
                continue;
            }
            let chain = self.chain(entry, at)?;
            self.spend(points_of(&chain))?;
            parts.extend(chain.iter().cloned());
        }
        if parts.is_empty() {
            return leave("the composite curve has no curves");
        }
        Ok(parts)
    }

    fn read_curve(&mut self, entry: &Rc<DirectoryEntry>) -> Got<NurbsCurve> {
        let (entity, form) = (entry.entity, entry.form);
        if !matches!(entity, 100 | 104 | 106 | 110 | 112 | 126) {
            // It is what keeps its parent from being read.
            self.left.insert(entry.sequence);
            return leave(format!("it needs a {}, which is not read", name_of(entity)));
        }
        let mut fields = self.store.fields(entry)?;
        Ok(match entity {
            100 => read_arc(&mut fields)?,
            104 => conic_arc::read(&mut fields, form)?,
            106 => match read_copious(&mut fields, form)? {
                Some(Copious::Polyline(points)) => polyline(&points)?,
                _ => {
                    return leave(format!("copious data of form {form} are not a curve"));
                }
            },
            110 => read_line(&mut fields)?,
            112 => spline::read_curve(&mut fields)?,
            _ => read_spline(&mut fields)?,
        })
    }
}

/// The curve of degree 1 through these points, by chord lengths; points that repeat count once.
fn polyline(points: &[DVec3]) -> Result<NurbsCurve> {
    let (mut kept, mut breaks): (Vec<DVec3>, Vec<f64>) = (Vec::new(), Vec::new());
    for &point in points {
        let Some((last, at)) = kept.last().zip(breaks.last()) else {
            kept.push(point);
            breaks.push(0.0);
            continue;
        };
        let next = at + last.distance(point);
        if next > *at {
            kept.push(point);
            breaks.push(next);
        }
    }
    NurbsCurve::new(KnotVector::clamped(1, &breaks)?, kept, None)
}

/// How many control points they have.
pub(super) fn points_of(parts: &[NurbsCurve]) -> usize {
    parts.iter().map(|part| part.control_points().len()).sum()
}

/// Curves in the coordinates of the model.
pub(super) fn placed(parts: &[NurbsCurve], place: Place) -> Result<Vec<NurbsCurve>> {
    let one = |part: &NurbsCurve| {
        if place.is_identity() {
            part.clamped()
        } else {
            part.clamped()?.map_points(|p| place.apply(p))
        }
    };
    parts.iter().map(one).collect()
}
