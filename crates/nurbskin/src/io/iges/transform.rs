//! Transformation matrices (entity 124).

use super::directory::DirectoryEntry;
use super::field::Fields;
use crate::{DVec3, Error, Result};
use glam::DMat3;
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
        format!("its transformation matrix should be at D{pointer}, where no entity 124 is"),
    )
}
