//! The mesh of a part, untangled for a network where it passes through itself.

use glam::DVec3;
use nurbskin_geometry::unit::{Unit, counted};
use nurbskin_scan::mesh::Manifold;
use nurbskin_scan::mesh::crossings::crossed;
use nurbskin_scan::mesh::untangle::untangled;
use std::borrow::Cow;

/// How far apart the sheets of a mesh that passed through itself are, in tolerances.
/// Trial: 0, 0.15, 0.5 and 1 on a head at 0.05, 0.1 and 0.2 % of its diagonal. With 0.15 at least 99.67 % of the points are within the
/// tolerance. With 0 the network lacks faces at 0.2 %, with 0.5 and 1 down to 99.1 and 96 % of the points are.
const CLEARANCE: f64 = 0.15;

/// A mesh and the points of its scan.
pub(super) struct Apart<'a> {
    pub(super) mesh: Cow<'a, Manifold>,
    /// Those that are vertices of the mesh are where these are.
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
    pub(super) fn untangled(mesh: &'a Manifold, points: &'a [DVec3], tolerance: f64) -> Self {
        let left = Self::left(mesh, points);
        let Some(places) = untangled(mesh, CLEARANCE * tolerance) else {
            return left;
        };
        let mut points = points.to_vec();
        let pairs = mesh.points.iter().zip(&places).zip(&mesh.source);
        for ((_, place), source) in pairs.filter(|((before, after), _)| before != after) {
            if let Some(point) = source.and_then(|k| points.get_mut(k as usize)) {
                *point = *place;
            }
        }
        Self {
            mesh: Cow::Owned(Manifold {
                points: places,
                ..mesh.clone()
            }),
            points: Cow::Owned(points),
            untangled: true,
            ..left
        }
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

    /// A square of 11 x 11 vertices, folded over; one vertex of the upper half has gone through the lower one.
    fn folded() -> Manifold {
        let place = |k: u32| {
            let (i, j) = (f64::from(k % 11), f64::from(k / 11));
            match k {
                63 => DVec3::new(2.1, j, -0.3),
                _ if i > 5.0 => DVec3::new(10.1 - i, j, 0.4),
                _ => DVec3::new(i, j, 0.0),
            }
        };
        let square = |k: u32| {
            let from = k % 10 + 11 * (k / 10);
            [[from, from + 1, from + 12], [from, from + 12, from + 11]]
        };
        let ring = |k: u32| match (k / 10, k % 10) {
            (0, i) => i,
            (1, i) => 10 + 11 * i,
            (2, i) => 120 - i,
            (_, i) => 110 - 11 * i,
        };
        Manifold {
            points: (0..121).map(place).collect(),
            // The scan has its points in the other direction, and one more.
            source: (0..121).map(|k| Some(120 - k)).collect(),
            triangles: (0..100).flat_map(square).collect(),
            loops: vec![(0..40).map(ring).collect()],
        }
    }

    #[test]
    fn points_that_are_vertices_move_with_them() {
        let mesh = folded();
        let mut points: Vec<DVec3> = mesh.points.iter().rev().copied().collect();
        points.push(DVec3::new(2.1, 5.0, -0.3));
        let left = Apart::left(&mesh, &points);
        assert!(left.crossed[63] && !left.untangled);
        assert_eq!(
            (&left.mesh.points, &left.points[..]),
            (&mesh.points, &points[..])
        );
        assert_eq!(left.told(&mesh, Unit::Millimetre), None);
        let apart = Apart::untangled(&mesh, &points, 0.1);
        assert!(apart.untangled && !crossed(&apart.mesh).contains(&true));
        assert_eq!(apart.crossed, left.crossed);
        for (k, place) in apart.mesh.points.iter().enumerate() {
            assert_eq!(apart.points[120 - k], *place);
        }
        assert_eq!(apart.points[121], points[121]);
        assert!(apart.mesh.points[63].z > -0.3);
        let told = apart.told(&mesh, Unit::Millimetre).unwrap();
        assert!(told.contains("vertices were moved apart, by "), "{told}");
        // Nothing to do.
        let again = Apart::untangled(&apart.mesh, &points, 0.1);
        assert!(!again.untangled);
    }
}
