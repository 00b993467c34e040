//! Transformation matrices (entity 124), and the places of entities that they make.

use super::directory::DirectoryEntry;
use super::field::Fields;
use glam::DMat3;
use nurbskin_geometry::nurbs::elementary::Frame;
use nurbskin_geometry::{DVec3, Error, Result};
use std::collections::BTreeMap;
use std::path::Path;

/// x -> R x + t.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    rotation: DMat3,
    translation: DVec3,
}

impl Transform {
    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The image of a direction.
    pub(super) fn vector(&self, direction: DVec3) -> DVec3 {
        self.rotation * direction
    }

    /// Whether it turns right-handed frames into left-handed ones.
    pub(super) fn mirrors(&self) -> bool {
        self.rotation.determinant() < 0.0
    }

    /// A scaling about the origin, then a shift.
    pub(super) fn scaling(factor: f64, translation: DVec3) -> Self {
        Transform {
            rotation: DMat3::from_diagonal(DVec3::splat(factor)),
            translation,
        }
    }

    /// First `self`, then `next`.
    pub(super) fn then(&self, next: &Transform) -> Transform {
        Transform {
            rotation: next.rotation * self.rotation,
            translation: next.apply(self.translation),
        }
    }

    /// Reads R row by row, each row followed by its component of t.
    pub(super) fn read(fields: &mut Fields<'_>) -> Result<Transform> {
        let r = fields.reals(12, "transformation matrix")?;
        let row = |k: usize| DVec3::new(r[4 * k], r[4 * k + 1], r[4 * k + 2]);
        Ok(Transform {
            rotation: DMat3::from_cols(row(0), row(1), row(2)).transpose(),
            translation: DVec3::new(r[3], r[7], r[11]),
        })
    }
}

/// From the coordinates of an entity to those of the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) transform: Option<Transform>,
    /// From the file's numbers to the model's unit.
    pub(super) factor: f64,
}

impl Place {
    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        let point = self.transform.map_or(point, |t| t.apply(point));
        #[expect(
            clippy::float_cmp,
            reason = "one is the factor of a unit that needs no conversion"
        )]
        let converts = self.factor != 1.0;
        if converts { point * self.factor } else { point }
    }
    pub(super) fn vector(&self, direction: DVec3) -> DVec3 {
        self.transform.map_or(direction, |t| t.vector(direction)) * self.factor
    }
    pub(super) fn frame(&self, frame: &Frame) -> Frame {
        frame.moved(|p| self.apply(p), |d| self.vector(d))
    }
    /// The place of a part that has a transformation of its own.
    pub(super) fn of_part(self, inner: Option<Transform>) -> Self {
        let transform = match (inner, self.transform) {
            (Some(inner), Some(outer)) => Some(inner.then(&outer)),
            (inner, outer) => inner.or(outer),
        };
        Self { transform, ..self }
    }
    pub(super) fn mirrors(&self) -> bool {
        self.transform.is_some_and(|t| t.mirrors())
    }
    pub(super) fn is_identity(&self) -> bool {
        self.transform.is_none() && self.apply(DVec3::ONE) == DVec3::ONE
    }
}

/// Nobody chains more matrices; a longer chain is a damaged file, which shall not cost time.
const LONGEST_CHAIN: usize = 100;

/// All matrices of a file, by the sequence number of their directory entry; each with the matrix that it names in turn.
pub(super) type Transforms = BTreeMap<usize, (Transform, usize)>;

/// The whole transformation of an entity, chained matrices included; `None` where it names none.
///
/// # Errors
/// [`Error::Read`] if a pointer does not lead to a matrix or the chain does not end.
pub(super) fn chain(
    entry: &DirectoryEntry,
    transforms: &Transforms,
    path: &Path,
) -> Result<Option<Transform>> {
    let mut pointer = entry.transform;
    let mut total: Option<Transform> = None;
    for _ in 0..=LONGEST_CHAIN {
        if pointer == 0 {
            return Ok(total);
        }
        let Some((transform, next)) = transforms.get(&pointer) else {
            return Err(no_matrix(entry, pointer, path));
        };
        total = Some(total.map_or(*transform, |first| first.then(transform)));
        pointer = *next;
    }
    Err(entry.refuse(
        path,
        format!("its chain of transformation matrices is a circle or longer than {LONGEST_CHAIN}; the file is damaged"),
    ))
}

fn no_matrix(entry: &DirectoryEntry, pointer: usize, path: &Path) -> Error {
    entry.refuse(
        path,
        format!("its transformation matrix should be at D{pointer}, but there is no entity 124"),
    )
}
