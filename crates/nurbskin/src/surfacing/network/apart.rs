//! The mesh of a part, untangled for a network where it passes through itself.

use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, counted};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::crossings::crossed;
use nurbskin_scan::mesh::untangle::untangled;
use std::borrow::Cow;

/// How far apart the sheets of a mesh that passed through itself are, in tolerances.
/// Trial: 0, 0.15, 0.5 and 1 on a head at 0.05, 0.1 and 0.2 % of its diagonal. With 0.15 at least 99.67 % of the points are within the
/// tolerance, with 0 and 0.5 98.8 and 99.1 % at worst, with 1 96 %. At 0.2 % the network lacks three faces with 0, and one with 0.15.
const CLEARANCE: f64 = 0.15;

/// A mesh and the points of its scan.
pub(super) struct Apart<'a> {
    pub(super) mesh: Cow<'a, Manifold>,
    /// Those at vertices of the mesh have moved with these.
    pub(super) points: Cow<'a, [DVec3]>,
    /// The vertices of triangles that passed through others.
    pub(super) crossed: Vec<bool>,
    /// Whether such vertices were moved.
    pub(super) untangled: bool,
}

impl<'a> Apart<'a> {
    /// A mesh as it is, with all points of its scan.
    pub(super) fn left(mesh: &'a Manifold, points: &'a [DVec3]) -> Self {
        Self {
            mesh: Cow::Borrowed(mesh),
            points: Cow::Borrowed(points),
            crossed: crossed(mesh),
            untangled: false,
        }
    }

    /// The same mesh, untangled for a fit with this tolerance, in the unit of the points.
    ///
    /// # Errors
    /// [`Error::Cancelled`](nurbskin_geometry::Error::Cancelled).
    pub(super) fn untangled(
        mesh: &'a Manifold,
        points: &'a [DVec3],
        tolerance: f64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let left = Self::left(mesh, points);
        let Some(places) = untangled(mesh, CLEARANCE * tolerance, progress)? else {
            return Ok(left);
        };
        let mut points = points.to_vec();
        let pairs = mesh.points.iter().zip(&places).zip(&mesh.source);
        for ((before, place), source) in pairs {
            let point = source.and_then(|k| points.get_mut(k as usize));
            // Vertices of evened rims, and of coarser meshes, are not where their points are.
            if let Some(point) = point.filter(|point| *point == before) {
                *point = *place;
            }
        }
        Ok(Self {
            mesh: Cow::Owned(Manifold {
                points: places,
                ..mesh.clone()
            }),
            points: Cow::Owned(points),
            untangled: true,
            ..left
        })
    }

    /// What was moved from a mesh, in words.
    pub(super) fn told(&self, from: &Manifold, unit: Unit) -> Option<String> {
        let pairs = from.points.iter().zip(&self.mesh.points);
        let distances = pairs.map(|(a, b)| a.distance(*b)).filter(|d| *d > 0.0);
        let (count, most) = distances.fold((0, 0.0), |(n, most), d| (n + 1, f64::max(most, d)));
        let moved = counted(count, "vertex was", "vertices were");
        let most = unit.length(most);
        self.untangled.then(|| {
            format!(
                "the mesh passes through itself: for the network {moved} moved apart, by {most} at most"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::progress::Silent;

    /// The vertex that has gone through the other half.
    const PIERCING: u32 = 10 * 21 + 16;

    /// A square of 21 x 21 vertices, folded over; one vertex of the upper half has gone through the lower one.
    fn folded() -> Manifold {
        let place = |k: u32| {
            let (i, j) = (f64::from(k % 21), f64::from(k / 21));
            match k {
                PIERCING => DVec3::new(4.1, j, -0.3),
                _ if i > 10.0 => DVec3::new(20.1 - i, j, 0.4),
                _ => DVec3::new(i, j, 0.0),
            }
        };
        let square = |k: u32| {
            let from = k % 20 + 21 * (k / 20);
            [[from, from + 1, from + 22], [from, from + 22, from + 21]]
        };
        let ring = |k: u32| match (k / 20, k % 20) {
            (0, i) => i,
            (1, i) => 20 + 21 * i,
            (2, i) => 440 - i,
            (_, i) => 420 - 21 * i,
        };
        Manifold {
            points: (0..441).map(place).collect(),
            // The scan has its points in the other direction, and one more.
            source: (0..441).map(|k| Some(440 - k)).collect(),
            triangles: (0..400).flat_map(square).collect(),
            loops: vec![(0..80).map(ring).collect()],
        }
    }

    #[test]
    fn points_that_are_vertices_move_with_them() {
        let mesh = folded();
        let mut points: Vec<DVec3> = mesh.points.iter().rev().copied().collect();
        points.push(DVec3::new(4.1, 10.0, -0.3));
        let left = Apart::left(&mesh, &points);
        assert!(left.crossed[PIERCING as usize] && !left.untangled);
        assert_eq!(
            (&left.mesh.points, &left.points[..]),
            (&mesh.points, &points[..])
        );
        assert_eq!(left.told(&mesh, Unit::Millimetre), None);
        let apart = Apart::untangled(&mesh, &points, 0.1, &Silent).unwrap();
        assert!(apart.untangled && !crossed(&apart.mesh).contains(&true));
        assert_eq!(apart.crossed, left.crossed);
        for (k, place) in apart.mesh.points.iter().enumerate() {
            assert_eq!(apart.points[440 - k], *place);
        }
        assert_eq!(apart.points[441], points[441]);
        assert!(apart.mesh.points[PIERCING as usize].z > -0.3);
        let told = apart.told(&mesh, Unit::Millimetre).unwrap();
        assert!(told.contains("vertices were moved apart, by "), "{told}");
        // Nothing to do.
        let again = Apart::untangled(&apart.mesh, &points, 0.1, &Silent).unwrap();
        assert!(!again.untangled);
    }
}
