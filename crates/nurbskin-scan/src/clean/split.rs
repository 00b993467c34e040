//! Parts of a scan as scans of their own.
//!
//! A part is kept if it has at least a given share of the points of the largest part and at least 200 points, and does
//! not lie on one line; the others are scraps. Where scraps would have more than a twentieth of all points, the largest
//! of them are kept, too. Spacing and noise are measured again for each part. Source: ours.

use super::elements::median_spacing;
use super::parts::Parts;
use crate::CleanScan;
use crate::clean::noise::noise_of_cloud;
use crate::normals::plane_axes;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::parallel::gather;

/// Fewest points of a part that carries a surface; the largest part is exempt. Also the fewest sample points that
/// measure the spacing and noise of a part. Trial: not recorded.
const MIN_PART_POINTS: usize = 200;
/// Share of all points beyond which scraps are too many: the largest of them become parts. Dimensionless.
/// Guard: half of the share without a surface at which the verdict on a fit is that a large part of the scan is missing.
const MOST_SCRAPS: f64 = 0.05;
/// Ratio of the second to the largest variance up to which points lie on one line. Guard: the square of the ratio 1e-6
/// of deviations at which a whole scan is refused; single precision leaves 6e-8 as rounding.
const COLLINEAR_VARIANCE: f64 = 1e-12;

/// A small part of a scan that carries no surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scrap {
    /// Index in the scan of each of its points, ascending.
    pub indices: Vec<u32>,
}

impl CleanScan {
    /// Separates the parts. Parts with at least the share `scrap` (0 to 1; 0.1 is usual) of the points of the largest,
    /// and at least 200 points, become scans of their own, the largest first. So do smaller ones, down to 200 points,
    /// until those that are left have at most 5 % of all points. The others, and parts on one line, become scraps: they are too small
    /// for a surface. Indices remain those of the scan. With more than one part, spacing and noise are measured for
    /// each. O(n log n).
    ///
    /// ```
    /// use nurbskin_geometry::DVec3;
    /// use nurbskin_geometry::progress::Silent;
    /// use nurbskin_scan::{CleanOptions, Scan, clean};
    /// let square = |k: u32, z: f64| DVec3::new(f64::from(k % 20), f64::from(k / 20), z);
    /// let mut points: Vec<DVec3> = (0..400).map(|k| square(k, 0.0)).collect();
    /// points.extend((0..300).map(|k| square(k, 30.0)));
    /// points.extend((0..100).map(|k| square(k, 90.0)));
    /// let scan = Scan { points, ..Scan::default() };
    /// let (pieces, scraps) = clean(&scan, &CleanOptions::default(), &Silent)?.split(0.1);
    /// assert_eq!(pieces.iter().map(|p| p.points.len()).collect::<Vec<_>>(), [400, 300]);
    /// assert_eq!(pieces[1].used[0], 400);
    /// assert_eq!(scraps[0].indices.len(), 100);
    /// # Ok::<(), nurbskin_geometry::Error>(())
    /// ```
    #[must_use]
    pub fn split(self, scrap: f64) -> (Vec<CleanScan>, Vec<Scrap>) {
        if self.parts.count() <= 1 {
            return (vec![self], Vec::new());
        }
        // 1. The points of each part, and their new indices.
        let mut members: Vec<Vec<u32>> = vec![Vec::new(); self.parts.count()];
        let mut within = vec![0_u32; self.points.len()];
        for ((k, &part), within) in (0_u32..).zip(&self.parts.of).zip(&mut within) {
            if let Some(members) = members.get_mut(part as usize) {
                #[expect(clippy::cast_possible_truncation, reason = "at most 2^32 points")]
                let place = members.len() as u32;
                *within = place;
                members.push(k);
            }
        }
        let mut triangles: Vec<Vec<[u32; 3]>> = vec![Vec::new(); members.len()];
        for t in &self.triangles {
            if let Some(list) = triangles.get_mut(self.parts.of[t[0] as usize] as usize) {
                list.push(t.map(|k| within[k as usize]));
            }
        }
        // 2. Pieces and scraps.
        let least = scrap.clamp(0.0, 1.0) * members[0].len() as f64;
        let (mut pieces, mut scraps) = (Vec::new(), Vec::new());
        let most = MOST_SCRAPS * self.points.len() as f64;
        let is_tiny = |members: &[u32]| members.len() < MIN_PART_POINTS;
        let sizes = members.iter().filter(|m| !is_tiny(m)).map(Vec::len);
        // Points in parts that are still to come and may carry a surface.
        let mut left: usize = sizes.sum();
        for (part, (members, triangles)) in members.into_iter().zip(triangles).enumerate() {
            let is_small = (members.len() as f64) < least && left as f64 <= most;
            let is_scrap = is_tiny(&members) || self.on_one_line(&members);
            left = left.saturating_sub(members.len());
            if part > 0 && (is_small || is_scrap) {
                let indices = members.iter().map(|&k| self.used[k as usize]).collect();
                scraps.push(Scrap { indices });
            } else {
                pieces.push(self.piece(&members, triangles));
            }
        }
        (pieces, scraps)
    }

    /// The connected components, by triangles, of the points marked in `chosen`: as scans of their own, the largest
    /// first, and as scraps those with fewer than `least` or 200 points, or on one line. O(n log n).
    pub fn rest(&self, chosen: &[bool], least: usize) -> (Vec<CleanScan>, Vec<Scrap>) {
        let inside = |t: &&[u32; 3]| t.iter().all(|&k| chosen.get(k as usize) == Some(&true));
        let mut sets = DisjointSets::new(self.points.len());
        for t in self.triangles.iter().filter(inside) {
            sets.join(t[0] as usize, t[1] as usize);
            sets.join(t[1] as usize, t[2] as usize);
        }
        // 1. Members by the root of their component.
        let mut by_root: Vec<(usize, u32)> = (0_u32..)
            .zip(chosen)
            .filter(|(_, chosen)| **chosen)
            .map(|(k, _)| (sets.root(k as usize), k))
            .collect();
        by_root.sort_unstable();
        let mut groups: Vec<Vec<u32>> = by_root
            .chunk_by(|a, b| a.0 == b.0)
            .map(|group| group.iter().map(|member| member.1).collect())
            .collect();
        groups.sort_by(|a, b| b.len().cmp(&a.len()).then(a.cmp(b)));
        // 2. Pieces and scraps.
        let (mut pieces, mut scraps) = (Vec::new(), Vec::new());
        for members in groups {
            if members.len() < MIN_PART_POINTS.max(least) || self.on_one_line(&members) {
                let indices = members.iter().map(|&k| self.used[k as usize]).collect();
                scraps.push(Scrap { indices });
                continue;
            }
            let place = |k: &u32| members.binary_search(k).ok();
            let local = |t: &[u32; 3]| {
                let [a, b, c] = [place(&t[0])?, place(&t[1])?, place(&t[2])?];
                let near = |k: usize| u32::try_from(k).ok();
                Some([near(a)?, near(b)?, near(c)?])
            };
            let triangles = self.triangles.iter().filter_map(local).collect();
            pieces.push(self.piece(&members, triangles));
        }
        (pieces, scraps)
    }

    fn on_one_line(&self, members: &[u32]) -> bool {
        let (values, _) = plane_axes(members.iter().map(|&k| self.points[k as usize]));
        values[1] <= COLLINEAR_VARIANCE * values[2]
    }

    fn piece(&self, members: &[u32], triangles: Vec<[u32; 3]>) -> CleanScan {
        let pick = |k: &u32| *k as usize;
        let points: Vec<_> = members.iter().map(|k| self.points[pick(k)]).collect();
        let normals: Vec<_> = members.iter().map(|k| self.normals[pick(k)]).collect();
        // Spacing and noise come from the examined sample, if enough of it lies in the part.
        let within = |k: &u32| members.binary_search(k).ok();
        let within = |k: &u32| within(k).and_then(|k| u32::try_from(k).ok());
        let sample: Vec<u32> = self.sample.iter().filter_map(within).collect();
        let (spacing, noise) = if self.sample.is_empty() {
            let noise = noise_of_cloud(&points, Some(&normals));
            (median_spacing(&points), noise)
        } else if sample.len() < MIN_PART_POINTS {
            (None, self.noise)
        } else {
            let (seen, facing) = (gather(&points, &sample), gather(&normals, &sample));
            let share = match self.is_on_lines() {
                true => 1.0,
                false => sample.len() as f64 / points.len() as f64,
            };
            let spacing = median_spacing(&seen).map(|spacing| spacing * share.sqrt());
            (spacing, noise_of_cloud(&seen, Some(&facing)))
        };
        CleanScan {
            used: members.iter().map(|k| self.used[pick(k)]).collect(),
            rejected: Vec::new(),
            spacing: spacing.unwrap_or(self.spacing),
            squares: match self.is_on_lines() {
                true => sample.len(),
                false => points.len(),
            },
            unit: self.unit,
            noise,
            sample,
            parts: Parts {
                of: vec![0; points.len()],
                sizes: vec![points.len()],
            },
            points,
            normals,
            triangles,
        }
    }
}
