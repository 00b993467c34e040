//! The points of a triangulation and what is known around each of them.

use crate::Result;
use crate::numeric::statistics::median_in_place;
use crate::progress::Progress;
use crate::scan::neighbours::{NeighbourTable, Neighbours};
use crate::scan::normals::plane_normals;
use glam::DVec3;

/// Neighbours of each point that are looked at first.
const NEIGHBOURS: usize = 24;
/// The spacing is measured to this neighbour of the same sheet.
const SPACING_BY: usize = 12;

/// Points in the order of their coordinates.
#[derive(Debug)]
pub(super) struct Sites {
    pub(super) points: Vec<DVec3>,
    pub(super) normals: Vec<DVec3>,
    /// The side of the square that one point stands for nearby on the same sheet.
    pub(super) spacing: Vec<f64>,
    /// Weights that make four points on one circle none: differences of squared distances, harmlessly small.
    pub(super) weights: Vec<f64>,
    pub(super) tree: Neighbours,
    pub(super) table: NeighbourTable,
}

impl Sites {
    pub(super) fn new(
        points: &[DVec3],
        normals: &[DVec3],
        order: &[u32],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let points: Vec<DVec3> = order.iter().map(|&k| points[k as usize]).collect();
        let tree = Neighbours::new(&points);
        progress.check()?;
        let table = tree.table(NEIGHBOURS);
        progress.check()?;
        let normals = normals_of(&points, normals, order, &table);
        let mut this = Self {
            weights: vec![0.0; points.len()],
            spacing: vec![0.0; points.len()],
            points,
            normals,
            tree,
            table,
        };
        this.measure();
        progress.check()?;
        Ok(this)
    }

    /// Finds weights and spacing.
    fn measure(&mut self) {
        let count = self.points.len();
        let near = |k: usize, n: usize| {
            let row = self.table.of(k);
            let at = n.min(row.len()).checked_sub(1);
            at.map_or(0.0, |at| {
                let other = self.points[row[at] as usize];
                // A disc of that radius holds n + 1/2 points on average.
                let points = at as f64 + 1.5;
                self.points[k].distance(other) * (std::f64::consts::PI / points).sqrt()
            })
        };
        self.weights = (0..count)
            .map(|k| {
                let row = self.table.of(k);
                let nearest = row
                    .first()
                    .map_or(0.0, |&j| self.points[k].distance(self.points[j as usize]));
                0.01 * nearest * nearest * scatter(k)
            })
            .collect();
        self.spacing = (0..count).map(|k| near(k, SPACING_BY)).collect();
        // Neighbours on other sheets make the spacing look smaller: once more without them.
        let own: Vec<f64> = (0..count)
            .map(|k| {
                let mut found = 0;
                let mut last = 0.0;
                for &j in self.table.of(k) {
                    if self.same_sheet(k, j as usize) {
                        found += 1;
                        last = self.points[k].distance(self.points[j as usize]);
                    }
                    if found == SPACING_BY {
                        break;
                    }
                }
                if found < 4 {
                    self.spacing[k]
                } else {
                    last * (std::f64::consts::PI / (f64::from(found as u32) + 0.5)).sqrt()
                }
            })
            .collect();
        // A point at a border sees half of a disc; most of its neighbours see more.
        let mut values = Vec::with_capacity(NEIGHBOURS + 1);
        self.spacing = (0..count)
            .map(|k| {
                values.clear();
                values.push(own[k]);
                let row = self.table.of(k).iter().map(|&j| j as usize);
                values.extend(row.filter(|&j| self.same_sheet(k, j)).map(|j| own[j]));
                median_in_place(&mut values)
            })
            .collect();
    }

    /// Whether `j` may lie on the sheet of `i` nearby. On a smooth sheet the chord between two points makes the same
    /// angle with both tangent planes, one above and one below; the chord between two walls does not.
    pub(super) fn same_sheet(&self, i: usize, j: usize) -> bool {
        let (n, mut m) = (self.normals[i], self.normals[j]);
        if n.dot(m) < 0.0 {
            m = -m;
        }
        let d = self.points[j] - self.points[i];
        let length = d.length();
        let slack = self.spacing[i].max(self.spacing[j]);
        let (here, there) = (n.dot(d), m.dot(d));
        0.5 * (here + there).abs() <= 0.35 * length + 0.3 * slack
            && here.abs().max(there.abs()) <= 0.85 * length + 0.1 * slack
    }
}

/// Normals in the order of the sites, those that are none found from the neighbours.
fn normals_of(
    points: &[DVec3],
    normals: &[DVec3],
    order: &[u32],
    table: &NeighbourTable,
) -> Vec<DVec3> {
    let given = |k: u32| {
        let n = normals.get(k as usize).copied().unwrap_or_default();
        n.try_normalize().unwrap_or_default()
    };
    let mut own: Vec<DVec3> = order.iter().map(|&k| given(k)).collect();
    if own.contains(&DVec3::ZERO) {
        let planes = plane_normals(points, table, 12);
        for (n, plane) in own.iter_mut().zip(planes) {
            if *n == DVec3::ZERO {
                *n = plane;
            }
        }
    }
    own
}

/// A number between 0 and 1 that looks random (the finaliser of `SplitMix64`).
fn scatter(k: usize) -> f64 {
    let mut z = (k as u64).wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}
