//! Support: where a surface has its scan under it.
//!
//! For a node S(u, v) with the unit normal n and the nearest place x of the scan,
//!
//! ```text
//! d = x - S,   far = |d - (d · n) n|,   across = |d · n|        bare if far > level
//! ```
//!
//! Only the offset along the surface counts, so that a surface that is off by its tolerance is not bare. The level is
//! the reach of the scan: a share of the spacing for triangles, four medians of `far` near the points where there are none.
//! A closing (Serra 1982) by the signed distance to the contour takes the outline back from there to the rim of the data.
//! Where the (u, v) of the points are known to count, `far` is the distance from them in the domain.

use super::CLOSED_TOLERANCE;
use super::seams::copy_seams;
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::nurbs::shape::Edge as Side;
use nurbskin_geometry::spatial::nearest::Nearest;
use rayon::prelude::*;

/// Fewest and most nodes of the grid. Guard: the lower limit keeps small surfaces smooth, the upper one bounds time and
/// memory (a few hundred bytes per node).
const GRID_NODES: [f64; 2] = [4096.0, 250_000.0];
/// Nodes per spacing. Trial: 2 in an earlier version; the data are not recorded. The outline is then known to a sixth
/// of a spacing.
const NODES_PER_SPACING: f64 = 3.0;
/// Width of a bare region, in spacings, below which it stays covered. Trial: not recorded. A smaller one cuts chance
/// gaps between points out, a larger one covers real holes.
const MIN_GAP_WIDTH: f64 = 3.0;
/// Radius, in spacings, in which a wall that faces the same way as the surface is sought where the nearest wall does
/// not. Trial: not recorded. A smaller one leaves gaps in one of two close walls covered by the other.
const SAME_WALL_RADIUS: f64 = 6.0;
/// Quantile of the distances across the surface, over all nodes with data, that stands for its distance from the data.
/// Trial: not recorded; the rest are errors of single places.
const OFFSET_QUANTILE: f64 = 0.99;
/// Reach of the triangles of a mesh beyond their border, in spacings. Trial: not recorded; p-curves round off corners
/// of the border by about as much.
const REACH_OF_MESH: f64 = 0.25;
/// Reach of the triangles between samples of a range image, in spacings, since the surface goes on between the pixels.
/// Derived: the smoothed rim bridges steps of the pixels as wide as one and a half spacings.
const REACH_OF_SAMPLES: f64 = 0.75;
/// Reach of points without triangles, in the median distance of the nodes within a spacing from them. Derived: of points at
/// random, λ to a unit of area, the spacing is 0.82/√λ, that median 0.43/√λ, and exp(-π (4 · 0.43)²), one place in ten
/// thousand, is farther from them.
const REACH_OF_MEDIAN: f64 = 4.0;
/// Distance of the outline outside the outermost points, as a share of their reach. Trial: on clouds of 25 000 points
/// with eleven outlines, flat and bent over (docs/sheets.md), whose areas come out within 0.7 %. A larger one makes areas
/// too large, a smaller one too small.
const RIM_OF_POINTS: f64 = 0.28;
/// The same for the outermost triangles. Trial: with it and [`REACH_OF_SAMPLES`], areas of range images are within 0.4
/// %, and were 1 to 3 % too small before. An eighth of a spacing of a mesh holds the corners that p-curves round off;
/// of the squares around the samples of a range image, triangles leave out half along the rows and 0.35 along the
/// diagonals, and the closing makes good a part of that.
const RIM_OF_TRIANGLES: f64 = 0.5;
/// Share of a closed surface below which its bare regions stay covered. Trial: 0.01 in an earlier version; scans of
/// bunnies stay closed with 0.025.
const MAX_CLOSED_BARE: f64 = 0.025;
/// Least median distance that counts for the reach of points, in spacings. Guard: exact data on the nodes would have no
/// reach.
const MIN_MEDIAN: f64 = 0.25;
/// Distance, in levels, that nodes of islands are given. Guard: any value above 1 makes them bare.
const ISLAND_LEVEL: f64 = 1.5;
/// Distance, in levels, that covered nodes are given. Guard: below 1, and near enough to leave contours nearby where
/// they are.
const COVERED_LEVEL: f64 = 0.5;
/// Largest ratio of the numbers of nodes in both directions, as its square root. Guard: keeps long strips from having
/// one node across.
const MAX_GRID_ASPECT: f64 = 1e2;
/// The smallest such ratio. Guard: as above.
const MIN_GRID_ASPECT: f64 = 1e-2;
/// Fewest and most nodes along a direction. Guard: contours need some, and the product stays bounded.
const LINE_NODES: [f64; 2] = [16.0, 20_000.0];

/// The scan to which a surface is trimmed.
#[derive(Clone, Copy, Debug)]
pub struct Scanned<'a> {
    /// Its points.
    pub points: &'a [DVec3],
    /// Triangles between them, if any.
    pub triangles: Option<&'a [[u32; 3]]>,
    /// Whether the triangles are those of a mesh, so that the surface ends where they do. Otherwise they connect
    /// samples, as of a range image: the surface continues beyond the outermost ones by half of their distance, on
    /// average.
    pub is_mesh: bool,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
    /// The (u, v) of the points, one for each, if only these places of the surface belong to them: where a surface continues
    /// beyond the scan, it may come back to other places of it. Distances along the surface are then those in the domain,
    /// drawn to scale, without regard to directions that are closed.
    pub feet: Option<&'a [DVec2]>,
    /// Whether a closed surface stays closed if at most 2.5 % of it is bare.
    pub stays_closed: bool,
}

impl<'a> Scanned<'a> {
    /// A cloud of points with this typical distance of neighbours, without triangles. The surface is trimmed where the
    /// cloud ends, whether it is closed or not.
    #[must_use]
    pub fn cloud(points: &'a [DVec3], spacing: f64) -> Self {
        Self {
            points,
            triangles: None,
            is_mesh: false,
            spacing,
            feet: None,
            stays_closed: false,
        }
    }

    /// The search structure for the nearest place: on the triangles and on samples without triangles, or on the points.
    pub fn nearest(&self) -> Nearest {
        self.at(self.points).with_walls()
    }

    /// The same for the points at other places.
    fn at(&self, places: &[DVec3]) -> Nearest {
        let Some(triangles) = self.triangles.filter(|t| !t.is_empty() && !self.is_mesh) else {
            return Nearest::new(places, self.triangles);
        };
        let mut is_alone = vec![true; places.len()];
        for &k in triangles.as_flattened() {
            is_alone[k as usize] = false;
        }
        let alone = (0_u32..).zip(&is_alone).filter(|(_, alone)| **alone);
        let mut all = triangles.to_vec();
        all.extend(alone.map(|(k, _)| [k; 3]));
        Nearest::new(places, Some(&all))
    }
}

/// The distance of the scan, along the surface, from each node of a grid over the domain.
#[derive(Clone)]
pub(super) struct Support {
    /// Nodes along u and v, those at both ends counted.
    pub(super) count: [usize; 2],
    /// Distances, u fastest; in closed directions the last node repeats the first.
    pub(super) far: Vec<f64>,
    /// Nodes with a larger distance are bare.
    pub(super) level: f64,
    /// Cosine of the angle between the normals of the surface and of the scan nearest to it; 1 if it is unknown.
    pub(super) cosines: Vec<f64>,
    /// Lengths of the iso-lines along u and v.
    lengths: DVec2,
    /// Area around each node.
    pub(super) areas: Vec<f64>,
    pub(super) closed: [bool; 2],
    /// As in [`Side::ALL`].
    pub(super) poles: [bool; 4],
    /// Typical distance of neighbouring points.
    pub(super) spacing: f64,
    /// Least distance of the deepest node of a bare region that is cut out.
    wide: f64,
    /// Distance of the outline outside the outermost points or triangles.
    rim: f64,
    stays_closed: bool,
    /// Whether wide regions were covered to keep the surface closed.
    pub(super) kept_closed: bool,
    pub(super) covered: f64,
    /// Share of the area that was withdrawn from unsound rims.
    pub(super) withdrawn: f64,
}

/// Length of an offset along the surface with this normal, and across it.
fn apart(off: DVec3, normal: DVec3) -> [f64; 2] {
    match off.is_finite() {
        true => [
            (off - off.dot(normal) * normal).length(),
            off.dot(normal).abs(),
        ],
        false => [f64::INFINITY, 0.0],
    }
}

/// Measurements at a node.
struct Seen {
    point: DVec3,
    /// Unit normal; zero if it is undefined.
    normal: DVec3,
    /// Offset of the scan along the surface, and across it.
    off: [f64; 2],
    /// Cosine of the angle between their normals, if the scan is near and has triangles.
    cosine: Option<f64>,
    area: f64,
}

impl Support {
    pub(super) fn new(surface: &NurbsSurface, scan: &Scanned<'_>, nearest: &Nearest) -> Self {
        let triangles = scan.triangles.filter(|t| !t.is_empty());
        let lengths = surface.iso_lengths().map(|l| l.max(f64::MIN_POSITIVE));
        let count = nodes(lengths, scan.spacing);
        let [(a, b), (c, d)] = surface.domain();
        let steps = [
            (b - a) / (count[0] - 1) as f64,
            (d - c) / (count[1] - 1) as f64,
        ];
        // The points in the domain, in lengths along u and v.
        let feet = scan.feet.filter(|feet| feet.len() == scan.points.len());
        let in_lengths = |u: f64, v: f64| {
            let at = DVec2::from(lengths) * DVec2::new((u - a) / (b - a), (v - c) / (d - c));
            at.extend(0.0)
        };
        let in_domain = feet.map(|feet| {
            let places = feet.iter().map(|p| in_lengths(p.x, p.y));
            scan.at(&places.collect::<Vec<_>>())
        });
        let row = |j: usize| -> Vec<Seen> {
            let v = if j + 1 == count[1] {
                d
            } else {
                c + j as f64 * steps[1]
            };
            let (mut near, mut near_foot) = (None, None);
            let node = |i: usize| {
                let u = if i + 1 == count[0] {
                    b
                } else {
                    a + i as f64 * steps[0]
                };
                let at = surface.derivatives(u, v);
                let area = at.du.cross(at.dv);
                near = nearest.closest(at.point, near);
                let off = near.map_or(DVec3::INFINITY, |place| place.point - at.point);
                // Only the offset along the surface counts: a fit that is off by its tolerance is not bare.
                let normal = area.try_normalize().filter(|_| off.is_finite());
                let mut apart = apart(off, normal.unwrap_or(DVec3::ZERO));
                if let Some(in_domain) = &in_domain {
                    let at = in_lengths(u, v);
                    near_foot = in_domain.closest(at, near_foot);
                    apart[0] = near_foot.map_or(f64::INFINITY, |foot| foot.point.distance(at));
                }
                let is_near = off.length().max(apart[0]) <= MIN_GAP_WIDTH * scan.spacing;
                Seen {
                    point: at.point,
                    normal: normal.unwrap_or(DVec3::ZERO),
                    off: apart,
                    cosine: normal
                        .zip(near.filter(|place| is_near && place.facing != DVec3::ZERO))
                        .map(|(normal, place)| normal.dot(place.facing)),
                    area: area.length() * steps[0] * steps[1],
                }
            };
            (0..count[0]).map(node).collect()
        };
        let rows: Vec<Vec<Seen>> = (0..count[1]).into_par_iter().map(row).collect();
        let mut seen: Vec<Seen> = rows.into_iter().flatten().collect();
        // The sign of the larger part of the area defines the outside.
        let sides = seen
            .iter()
            .filter_map(|node| Some(node.cosine?.signum() * node.area));
        let outside = sides.sum::<f64>().signum();
        // Of two walls the one that faces the same way counts: next to a gap in one of them the other is near.
        let wrong = |node: &Seen| node.cosine.is_some_and(|cosine| outside * cosine < 0.0);
        let may_turn = |&k: &usize| in_domain.is_none() && wrong(&seen[k]);
        let turned: Vec<usize> = (0..seen.len()).filter(may_turn).collect();
        let same = each(turned.len(), |i| {
            let node = &seen[turned[i]];
            let within = SAME_WALL_RADIUS * scan.spacing;
            let place = nearest.on_same_side(node.point, outside * node.normal, within);
            place.map_or(node.off, |place| apart(place - node.point, node.normal))
        });
        for (k, off) in turned.into_iter().zip(same) {
            seen[k].off = off;
        }
        let mut far: Vec<f64> = seen.iter().map(|node| node.off[0]).collect();
        let cosine = |node: &Seen| node.cosine.map_or(1.0, |cosine| outside * cosine);
        let cell = lengths[0] / (count[0] - 1) as f64;
        let level = if triangles.is_some() {
            let reach = match scan.is_mesh {
                true => REACH_OF_MESH,
                false => REACH_OF_SAMPLES,
            };
            reach * scan.spacing.max(cell)
        } else {
            // Most of the domain may lie beyond the outline.
            let near = far.iter().filter(|far| **far <= scan.spacing);
            let mut sorted: Vec<f64> = near.copied().collect();
            sorted.sort_unstable_by(f64::total_cmp);
            let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
            REACH_OF_MEDIAN * median.max(MIN_MEDIAN * scan.spacing)
        };
        // Where a surface that is off by `across` turns away from its scan, the scan lies to its side by as much.
        // Without near nodes the quantile is NaN, and `max` makes it 0.
        let near = seen.iter().filter(|node| node.off[0] <= level);
        let mut across: Vec<f64> = near.map(|node| node.off[1]).collect();
        let across = quantile_in_place(&mut across, OFFSET_QUANTILE).max(0.0);
        let slack = CLOSED_TOLERANCE * lengths[0].max(lengths[1]);
        let closed = Direction::BOTH.map(|d| surface.is_closed(d, slack));
        copy_seams(&mut far, count, closed);
        Self {
            count,
            far,
            level,
            cosines: seen.iter().map(cosine).collect(),
            lengths: DVec2::from(lengths),
            areas: seen.iter().map(|node| node.area).collect(),
            closed,
            poles: Side::ALL.map(|side| surface.is_pole(side, slack)),
            wide: level + across + 0.5 * MIN_GAP_WIDTH * scan.spacing,
            rim: level
                * match triangles {
                    Some(_) => RIM_OF_TRIANGLES,
                    None => RIM_OF_POINTS,
                },
            spacing: scan.spacing,
            stays_closed: scan.stays_closed,
            kept_closed: false,
            covered: 0.0,
            withdrawn: 0.0,
        }
    }

    /// Lengths along u and v.
    pub(super) fn size(&self) -> DVec2 {
        self.lengths
    }

    /// Distances of neighbouring nodes along u and v.
    pub(super) fn steps(&self) -> DVec2 {
        let [m, n] = self.count;
        self.lengths / DVec2::new((m - 1) as f64, (n - 1) as f64)
    }

    /// Largest distance of neighbouring nodes.
    pub(super) fn step(&self) -> f64 {
        self.steps().max_element()
    }

    /// Position of a node, in lengths along u and v.
    pub(super) fn place(&self, node: usize) -> DVec2 {
        let [m, _] = self.count;
        DVec2::new((node % m) as f64, (node / m) as f64) * self.steps()
    }

    /// Covers narrow bare regions, and all bare regions of a closed shape if they are small in total; then drops
    /// islands.
    pub(super) fn keep_wide(&mut self) {
        let total: f64 = self.areas.iter().sum();
        let bare = self.components(|far, level| far > level);
        let mut wide = 0.0;
        for region in &bare {
            let most = region.iter().map(|&k| self.far[k]).fold(0.0, f64::max);
            if most < self.wide {
                self.cover(region);
            } else {
                wide += region.iter().map(|&k| self.areas[k]).sum::<f64>();
            }
        }
        let has_borders = (0..4).any(|k| !self.closed[k / 2] && !self.poles[k]);
        if self.stays_closed && !has_borders && wide < MAX_CLOSED_BARE * total {
            self.kept_closed = wide > 0.0;
            for region in &bare {
                self.cover(region);
            }
        }
        self.drop_islands();
    }

    /// Keeps the largest connected region that is not bare, and makes the others bare.
    pub(super) fn drop_islands(&mut self) {
        let mut islands = self.components(|far, level| far <= level);
        let area = |region: &Vec<usize>| region.iter().map(|&k| self.areas[k]).sum::<f64>();
        let main =
            (0..islands.len()).max_by(|&i, &j| area(&islands[i]).total_cmp(&area(&islands[j])));
        if let Some(main) = main {
            islands.remove(main);
        }
        for k in islands.into_iter().flatten() {
            self.far[k] = self.far[k].max(self.level * ISLAND_LEVEL);
        }
    }

    /// Moves the borders of bare regions from the end of the scan's reach back to its rim. Bays narrower than the reach
    /// stay covered. O(nodes log nodes).
    pub(super) fn draw_in(&mut self) {
        let values: Vec<f64> = self.far.iter().map(|far| self.level - far).collect();
        let [m, n] = self.count;
        let place = |k: usize| self.place(k);
        // Intersections of the contour with the grid lines between neighbouring nodes.
        let mut border: Vec<DVec3> = Vec::new();
        for k in 0..m * n {
            let right = (k % m + 1 < m).then_some(k + 1);
            let above = (k / m + 1 < n).then_some(k + m);
            for other in right.into_iter().chain(above) {
                let (a, b) = (values[k], values[other]);
                if (a >= 0.0) != (b >= 0.0) {
                    let at = place(k).lerp(place(other), a / (a - b));
                    border.extend(self.images(at).map(|p| p.extend(0.0)));
                }
            }
        }
        if border.is_empty() {
            return;
        }
        let nearest = Nearest::new(&border, None);
        let drawn_in = self.level - self.rim;
        let far = each(m * n, |k| {
            let at = place(k).extend(0.0);
            let off = nearest
                .closest(at, None)
                .map_or(0.0, |place| place.point.distance(at));
            let inside = if values[k] >= 0.0 { off } else { -off };
            self.level + drawn_in - inside
        });
        self.far = far;
        copy_seams(&mut self.far, self.count, self.closed);
    }

    /// A place, and its images across the seams.
    pub(super) fn images(&self, p: DVec2) -> impl Iterator<Item = DVec2> + use<> {
        let shifts = |closed: bool| if closed { -1..=1 } else { 0..=0 };
        let ([across, along], lengths) = (self.closed.map(shifts), self.lengths);
        across.flat_map(move |i| {
            along
                .clone()
                .map(move |j| p + DVec2::new(f64::from(i), f64::from(j)) * lengths)
        })
    }

    /// Shares of the area: cut off, and bare but covered.
    pub(super) fn shares(&self) -> [f64; 2] {
        let total: f64 = self.areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let bare = self
            .far
            .iter()
            .zip(&self.areas)
            .filter(|(far, _)| **far > self.level);
        [
            bare.map(|(_, area)| area).sum::<f64>() / total,
            self.covered / total,
        ]
    }

    pub(super) fn cover(&mut self, region: &[usize]) {
        for &k in region {
            if self.far[k] > self.level {
                self.covered += self.areas[k];
                self.far[k] = COVERED_LEVEL * self.level;
            }
        }
    }

    /// Connected regions of nodes, over seams.
    pub(super) fn components(&self, is: impl Fn(f64, f64) -> bool) -> Vec<Vec<usize>> {
        let wraps = self.closed;
        let [m, n] = self.count;
        let mut open: Vec<bool> = self.far.iter().map(|&far| is(far, self.level)).collect();
        let mut regions = Vec::new();
        for start in 0..open.len() {
            if !open[start] {
                continue;
            }
            open[start] = false;
            let (mut region, mut next) = (vec![start], 0);
            while next < region.len() {
                let k = region[next];
                next += 1;
                let (i, j) = (k % m, k / m);
                let mut visit = |i: usize, j: usize| {
                    let k = j * m + i;
                    if open[k] {
                        open[k] = false;
                        region.push(k);
                    }
                };
                if i > 0 {
                    visit(i - 1, j);
                } else if wraps[0] {
                    visit(m - 1, j);
                }
                if i + 1 < m {
                    visit(i + 1, j);
                } else if wraps[0] {
                    visit(0, j);
                }
                if j > 0 {
                    visit(i, j - 1);
                } else if wraps[1] {
                    visit(i, n - 1);
                }
                if j + 1 < n {
                    visit(i, j + 1);
                } else if wraps[1] {
                    visit(i, 0);
                }
            }
            regions.push(region);
        }
        regions
    }
}

/// Numbers of nodes along u and v, a third of a spacing apart, within the limits.
fn nodes(lengths: [f64; 2], spacing: f64) -> [usize; 2] {
    let step = (spacing / NODES_PER_SPACING).max(f64::MIN_POSITIVE);
    let wanted = (lengths[0] / step * (lengths[1] / step)).clamp(GRID_NODES[0], GRID_NODES[1]);
    let ratio = (lengths[0] / lengths[1])
        .sqrt()
        .clamp(MIN_GRID_ASPECT, MAX_GRID_ASPECT);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within LINE_NODES"
    )]
    let count = |x: f64| x.round().clamp(LINE_NODES[0], LINE_NODES[1]) as usize;
    [count(wanted.sqrt() * ratio), count(wanted.sqrt() / ratio)]
}
