//! Outcomes as bytes, for transfer between processes.
//!
//! Unlike the JSON, the bytes contain the points, the model and the surfaces. Reading validates everything, so that
//! damaged bytes give an error instead of an unsound outcome.

use super::{FaceEdge, Outcome, PerPoint, Unused};
use crate::deviation::measure::PointDeviation;
use glam::DVec3;
use nurbskin_cad::{Model, Place};
use nurbskin_geometry::{Error, NurbsSurface, Result};
use nurbskin_scan::binary as stored;
use nurbskin_scan::{Reason, Records};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Identifier at the start of the bytes.
const KIND: &str = "outcome";

/// An outcome, with the fields that its serialisation omits.
#[derive(Serialize, Deserialize)]
struct Stored<'a> {
    outcome: Cow<'a, Outcome>,
    said: Option<Cow<'a, str>>,
    points: Points<'a>,
    rejected: Cow<'a, [(u32, DVec3)]>,
    model: Cow<'a, Model>,
    geometry: Cow<'a, [NurbsSurface]>,
    edges: Cow<'a, [FaceEdge]>,
    origin: DVec3,
}

/// The fields of [`PerPoint`].
#[derive(Serialize, Deserialize)]
struct Points<'a> {
    indices: Cow<'a, [u32]>,
    points: Cow<'a, [DVec3]>,
    #[serde(with = "rows")]
    deviation: Cow<'a, [PointDeviation]>,
    held_out: Cow<'a, [bool]>,
    triangles: Cow<'a, [[u32; 3]]>,
    /// The points that are not used: index, point, number of the reason in [`REASONS`], whether it has a deviation.
    unused: Vec<UnusedRow>,
    /// The deviations of those that have one, in the same order.
    #[serde(with = "rows")]
    unused_deviation: Cow<'a, [PointDeviation]>,
    records: Cow<'a, Records>,
}

type UnusedRow = (u32, DVec3, usize, bool);

/// The reasons by their stored numbers.
const REASONS: [Reason; 4] = [
    Reason::NonFinite,
    Reason::Duplicate,
    Reason::Outlier,
    Reason::LeftOut,
];

/// The stored form of points that are not used.
fn stored_unused(unused: &[Unused]) -> (Vec<UnusedRow>, Vec<PointDeviation>) {
    let number = |reason| REASONS.iter().position(|r| *r == reason).unwrap_or(0);
    let row = |p: &Unused| (p.index, p.point, number(p.reason), p.deviation.is_some());
    let deviation = unused.iter().filter_map(|p| p.deviation).collect();
    (unused.iter().map(row).collect(), deviation)
}

/// The points of [`stored_unused`]; `None` if the lists do not go together.
fn read_unused(rows: &[UnusedRow], deviation: &[PointDeviation]) -> Option<Vec<Unused>> {
    let mut deviation = deviation.iter();
    let mut found = Vec::with_capacity(rows.len());
    for &(index, point, number, measured) in rows {
        found.push(Unused {
            index,
            point,
            reason: *REASONS.get(number)?,
            deviation: match measured {
                true => Some(*deviation.next()?),
                false => None,
            },
        });
    }
    deviation.next().is_none().then_some(found)
}

/// Deviations without field names, which would take as much space as the values.
mod rows {
    use super::{Cow, Place, PointDeviation};
    use serde::{Deserialize, Deserializer, Serializer};

    type Row = (f64, f64, f64, f64, f64, u32, bool);

    pub(super) fn serialize<S: Serializer>(
        list: &[PointDeviation],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let row = |d: &PointDeviation| -> Row {
            let free = d.place == Place::FreeEdge;
            (d.lower, d.upper, d.side, d.u, d.v, d.face, free)
        };
        serializer.collect_seq(list.iter().map(row))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Cow<'static, [PointDeviation]>, D::Error> {
        let deviation = |(lower, upper, side, u, v, face, free): Row| PointDeviation {
            lower,
            upper,
            side,
            u,
            v,
            face,
            place: if free {
                Place::FreeEdge
            } else {
                Place::Interior
            },
        };
        let rows = Vec::<Row>::deserialize(deserializer)?;
        Ok(rows.into_iter().map(deviation).collect())
    }
}

impl Outcome {
    /// The complete outcome as bytes of `MessagePack`; [`from_bytes`](Self::from_bytes) of the same version of the
    /// library restores an equal outcome, with every float exact. Only a path that is not Unicode is stored in its
    /// displayed form.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `MessagePack` cannot represent it.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        let points = &self.per_point;
        let (unused, unused_deviation) = stored_unused(&points.unused);
        let all = Stored {
            outcome: Cow::Borrowed(self),
            said: self.check.as_ref().map(|c| c.said.as_str().into()),
            points: Points {
                indices: points.indices.as_slice().into(),
                points: points.points.as_slice().into(),
                deviation: points.deviation.as_slice().into(),
                held_out: points.held_out.as_slice().into(),
                triangles: points.triangles.as_slice().into(),
                unused,
                unused_deviation: unused_deviation.into(),
                records: Cow::Borrowed(&points.records),
            },
            rejected: self.rejected.as_slice().into(),
            model: Cow::Borrowed(&self.model),
            geometry: self.geometry.as_slice().into(),
            edges: self.edges.as_slice().into(),
            origin: self.origin,
        };
        stored::to_bytes(KIND, &all)
    }

    /// The outcome that [`to_bytes`](Self::to_bytes) stored.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the bytes are not an outcome, come from another version of the library, or are damaged so
    /// that a curve, a surface or the model is unsound or the fields are inconsistent.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let all: Stored = stored::from_bytes(KIND, bytes)?;
        let mut outcome = all.outcome.into_owned();
        if let (Some(check), Some(said)) = (&mut outcome.check, all.said) {
            check.said = said.into_owned();
        }
        let points = all.points;
        let unused = read_unused(&points.unused, &points.unused_deviation).ok_or_else(unsound)?;
        outcome.per_point = PerPoint {
            indices: points.indices.into_owned(),
            points: points.points.into_owned(),
            deviation: points.deviation.into_owned(),
            held_out: points.held_out.into_owned(),
            triangles: points.triangles.into_owned(),
            unused,
            records: points.records.into_owned(),
        };
        outcome.rejected = all.rejected.into_owned();
        outcome.model = all.model.into_owned();
        outcome.geometry = all.geometry.into_owned();
        outcome.edges = all.edges.into_owned();
        outcome.origin = all.origin;
        if goes_together(&outcome) {
            Ok(outcome)
        } else {
            Err(unsound())
        }
    }
}

fn unsound() -> Error {
    Error::invalid(
        "the stored outcome has no surface, lists of points of different lengths, or names points or faces that do not \
         exist",
    )
}

/// Whether parallel lists have equal lengths, and all indices are valid.
fn goes_together(outcome: &Outcome) -> bool {
    let PerPoint {
        indices,
        points,
        deviation,
        held_out,
        triangles,
        unused,
        records,
    } = &outcome.per_point;
    let (count, faces) = (points.len(), outcome.model.faces().len());
    indices.len() == count
        && records.is_sound()
        && deviation.len() == count
        && (held_out.is_empty() || held_out.len() == count)
        && triangles.iter().flatten().all(|&k| (k as usize) < count)
        && deviation
            .iter()
            .chain(unused.iter().filter_map(|p| p.deviation.as_ref()))
            .all(|d| (d.face as usize) < faces)
        && outcome
            .edges
            .iter()
            .all(|e| e.edge < outcome.model.edges().len())
        && !outcome.geometry.is_empty()
}

#[cfg(test)]
mod tests;
