//! Scenes: segmentation of range images in which one object stands on or before another.
//!
//! Where an object stands on a table, the scanner sees one connected surface: along its foot the two meet in a sharp
//! valley, and above that the object hides what is behind. No single surface is both. The image is segmented along
//! valleys, where a line of the image turns by more than 35° towards the scanner. A segment is an object only if it
//! also hides what is behind it along a fifth of its outline: an angle iron has a valley, too.
//!
//! Source: S. C. Stein et al., *Object partitioning using local convexity*, CVPR 2014, for valleys; the test of
//! occlusion is ours.

use crate::GridLayout;
use glam::DVec3;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::numeric::parallel::each;
use std::collections::{BTreeMap, VecDeque};

/// Steps of the image on either side of a point over which the direction of a line is measured. Trial: not recorded.
/// The direction through so many points averages noise and depths that are coarse against the steps; more steps blur
/// narrow valleys.
const TANGENT_STEPS: usize = 8;
/// Cosine of the angle (35°) by which a line of the image must turn towards the scanner in a valley. Trial: not
/// recorded. Where an object stands upright on its support, one of the two lines turns by more than that.
const VALLEY_COSINE: f64 = 0.82;
/// Fewest points of a valley. Trial: not recorded. Noise makes smaller ones.
const MIN_VALLEY_POINTS: usize = 20;
/// Half the width of a neck between valleys and steps in depth, or the rim, that connects nothing. Trial: not recorded.
/// Where a valley ends at a step, its last points have no line on both sides.
const NECK_HALF_WIDTH: usize = 5;
/// Fewest points of a separate piece. Guard: fewer carry no surface.
const MIN_PIECE_POINTS: usize = 200;
/// Fewest points of a separate piece as a share of the whole image. Guard: smaller pieces are specks of a large image.
const MIN_PIECE_SHARE: f64 = 2e-3;
/// Share of its outline along which an object must hide what is behind it. Trial: not recorded. An object on a table
/// hides the table above its foot; an angle iron has a valley and hides nothing.
const MIN_HIDING_SHARE: f64 = 0.2;
/// Difference in depth per cell between two pixels, in the distance of the nearest neighbour on the mesh, above which
/// one lies behind the other. Trial: not recorded. A smaller value takes slanted surfaces for steps.
const BEHIND_STEP: f64 = 4.0;
/// Most cells, empty ones included, that are crossed in search of what lies behind: shadows of a scanner whose light
/// stands beside its camera. Trial: not recorded.
const MAX_SHADOW_CELLS: usize = 40;

/// The result of [`cut_at_feet`].
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The triangles without those across the foot of an object.
    pub triangles: Vec<[u32; 3]>,
    /// Number of objects that were separated.
    pub objects: usize,
}

/// Cuts the triangles of a range image, which do not cross steps in depth, along the feet of the objects that stand on
/// or before something else as seen from `viewpoint`; `None` if there are none. Of each connected surface, the largest
/// piece is the support. O(n log n).
#[must_use]
pub fn cut_at_feet(
    points: &[DVec3],
    grid: &GridLayout,
    triangles: &[[u32; 3]],
    viewpoint: DVec3,
) -> Option<Scene> {
    let image = Image::new(points, grid, triangles, viewpoint)?;
    let valley = image.valleys();
    if !valley.contains(&true) {
        return None;
    }
    // 1. Connected components without valleys and narrow necks.
    let beside_valley = image.within(NECK_HALF_WIDTH + 1, |k| valley[k]);
    let narrow = image.within(NECK_HALF_WIDTH, |k| valley[k] || image.is_rim(k));
    let mut sets = DisjointSets::new(points.len());
    let mut whole = DisjointSets::new(points.len());
    for (a, b) in triangles.iter().flat_map(|t| sides(*t)) {
        whole.join(a, b);
        if !narrow[a] && !narrow[b] {
            sets.join(a, b);
        }
    }
    let mut label: Vec<Option<usize>> = (0..points.len())
        .map(|k| (!narrow[k]).then(|| sets.root(k)))
        .collect();
    let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
    for piece in label.iter().flatten() {
        *sizes.entry(*piece).or_default() += 1;
    }
    let least = MIN_PIECE_POINTS.max(rounded(MIN_PIECE_SHARE * points.len() as f64));
    sizes.retain(|_, size| *size >= least);
    if sizes.len() < 2 {
        return None;
    }
    // 2. Points in the valleys, and small components, belong to the nearest piece.
    for piece in &mut label {
        *piece = piece.filter(|piece| sizes.contains_key(piece));
    }
    image.spread(&mut label);
    // 3. Pieces that hide what is behind them are objects; the others are joined to the piece with the longest common
    //    outline.
    let surface_of: BTreeMap<usize, usize> = sizes.keys().map(|&k| (k, whole.root(k))).collect();
    let mut largest: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    for (piece, &size) in &sizes {
        let most = largest.entry(surface_of[piece]).or_default();
        *most = (*most).max((size, *piece));
    }
    let outlines = image.outlines(&label, &beside_valley);
    let (mut objects, mut joined) = (0, DisjointSets::new(points.len()));
    for (&piece, surface) in &surface_of {
        let Some(outline) = outlines.get(&piece) else {
            continue;
        };
        if largest[surface].1 == piece {
            continue;
        }
        if outline.stands_apart() {
            objects += 1;
        } else if let Some((&other, _)) = outline.touches.iter().max_by_key(|touch| touch.1) {
            joined.join(piece, other);
        }
    }
    if objects == 0 {
        return None;
    }
    let mut piece_of = |k: u32| label[k as usize].map(|piece| joined.root(piece));
    let mut kept = triangles.to_vec();
    kept.retain(|t| {
        let [a, b, c] = t.map(&mut piece_of);
        a == b && b == c
    });
    Some(Scene {
        triangles: kept,
        objects,
    })
}

/// The outline of a piece, in sides of the image.
#[derive(Clone, Debug, Default)]
struct Outline {
    length: usize,
    /// Number of sides at which it meets each other piece.
    touches: BTreeMap<usize, usize>,
    /// Number of sides at which it meets them in a valley.
    foot: usize,
    /// Number of sides at which it hides what is behind it.
    hides: usize,
}

impl Outline {
    fn stands_apart(&self) -> bool {
        let met: usize = self.touches.values().sum();
        self.foot > 0
            && 2 * self.foot >= met
            && self.hides as f64 >= MIN_HIDING_SHARE * self.length as f64
    }
}

/// A range image with its triangles.
struct Image<'a> {
    points: &'a [DVec3],
    grid: &'a GridLayout,
    viewpoint: DVec3,
    /// The cell of each point.
    cell: Vec<usize>,
    /// The neighbours of each point along the sides of triangles, ascending.
    around: Vec<Vec<u32>>,
}

/// Steps from a cell to the four beside it. Derived: the unit vectors and their opposites.
const CELL_STEPS: [[isize; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

impl<'a> Image<'a> {
    fn new(
        points: &'a [DVec3],
        grid: &'a GridLayout,
        triangles: &[[u32; 3]],
        viewpoint: DVec3,
    ) -> Option<Self> {
        if grid.count_u.checked_mul(grid.count_v)? != grid.cells.len() {
            return None;
        }
        let mut cell = vec![0; points.len()];
        for (k, point) in grid.cells.iter().enumerate() {
            if let Some(point) = point {
                *cell.get_mut(*point as usize)? = k;
            }
        }
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); points.len()];
        for t in triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                around.get_mut(a as usize)?.push(b);
                around.get_mut(b as usize)?.push(a);
            }
        }
        for list in &mut around {
            list.sort_unstable();
            list.dedup();
        }
        Some(Self {
            points,
            grid,
            viewpoint,
            cell,
            around,
        })
    }

    /// The cell at this offset from the cell of a point, if the grid has one.
    fn moved(&self, k: usize, [x, y]: [isize; 2], steps: usize) -> Option<usize> {
        let steps = isize::try_from(steps).ok()?;
        let (m, n) = (self.grid.count_u, self.grid.count_v);
        let (i, j) = (self.cell[k] % m, self.cell[k] / m);
        let i = i
            .checked_add_signed(x.checked_mul(steps)?)
            .filter(|&i| i < m)?;
        let j = j
            .checked_add_signed(y.checked_mul(steps)?)
            .filter(|&j| j < n)?;
        Some(i + j * m)
    }

    /// The least-squares direction of the line of joined points that starts at a point; `None` if the line is shorter
    /// than 8 steps.
    fn tangent(&self, k: usize, direction: [isize; 2]) -> Option<DVec3> {
        let mut line = [DVec3::ZERO; TANGENT_STEPS + 1];
        line[0] = self.points[k];
        let mut at = k;
        for (step, place) in line.iter_mut().enumerate().skip(1) {
            let next = self.grid.cells[self.moved(k, direction, step)?]?;
            self.around[at].binary_search(&next).ok()?;
            at = next as usize;
            *place = self.points[at];
        }
        let middle = TANGENT_STEPS as f64 / 2.0;
        let slope = line.iter().enumerate();
        let slope: DVec3 = slope.map(|(i, p)| (i as f64 - middle) * *p).sum();
        slope.try_normalize()
    }

    /// The points at which a line of the image turns sharply towards the scanner, without small components.
    fn valleys(&self) -> Vec<bool> {
        let is_valley = |k: usize| {
            let sight = self.viewpoint - self.points[k];
            CELL_STEPS[..2].iter().any(|&direction| {
                let back = direction.map(|step| -step);
                let ends = [direction, back].map(|d| self.tangent(k, d));
                let [Some(on), Some(back)] = ends else {
                    return false;
                };
                // Both tangents lead away from the bottom of the valley.
                -on.dot(back) < VALLEY_COSINE && (on + back).dot(sight) > 0.0
            })
        };
        let mut valley: Vec<bool> = each(self.points.len(), is_valley);
        let mut sets = DisjointSets::new(valley.len());
        for k in (0..valley.len()).filter(|&k| valley[k]) {
            for &j in self.around[k].iter().filter(|&&j| valley[j as usize]) {
                sets.join(k, j as usize);
            }
        }
        let roots: Vec<usize> = (0..valley.len()).map(|k| sets.root(k)).collect();
        let mut sizes = vec![0_usize; valley.len()];
        for k in (0..valley.len()).filter(|&k| valley[k]) {
            sizes[roots[k]] += 1;
        }
        for (k, valley) in valley.iter_mut().enumerate() {
            *valley &= sizes[roots[k]] >= MIN_VALLEY_POINTS;
        }
        valley
    }

    /// The next point in a direction, if a triangle joins them.
    fn beside(&self, k: usize, direction: [isize; 2]) -> Option<usize> {
        let next = self.grid.cells[self.moved(k, direction, 1)?]?;
        self.around[k].binary_search(&next).ok()?;
        Some(next as usize)
    }

    /// Whether a point has no joined neighbour in some direction.
    fn is_rim(&self, k: usize) -> bool {
        CELL_STEPS
            .iter()
            .any(|&direction| self.beside(k, direction).is_none())
    }

    /// The points within this number of grid steps of the given ones.
    fn within(&self, steps: usize, some: impl Fn(usize) -> bool) -> Vec<bool> {
        let mut near: Vec<bool> = (0..self.points.len()).map(some).collect();
        let mut front: Vec<usize> = (0..near.len()).filter(|&k| near[k]).collect();
        for _ in 0..steps {
            let mut next = Vec::new();
            for k in front {
                for direction in CELL_STEPS {
                    if let Some(j) = self.beside(k, direction)
                        && !near[j]
                    {
                        near[j] = true;
                        next.push(j);
                    }
                }
            }
            front = next;
        }
        near
    }

    /// Gives each point without a label that of the nearest labelled one, in steps along triangles.
    fn spread(&self, label: &mut [Option<usize>]) {
        let mut queue: VecDeque<usize> = (0..label.len()).filter(|&k| label[k].is_some()).collect();
        while let Some(k) = queue.pop_front() {
            for &j in &self.around[k] {
                if label[j as usize].is_none() {
                    label[j as usize] = label[k];
                    queue.push_back(j as usize);
                }
            }
        }
    }

    /// The outline of each piece.
    fn outlines(
        &self,
        label: &[Option<usize>],
        beside_valley: &[bool],
    ) -> BTreeMap<usize, Outline> {
        let mut found: BTreeMap<usize, Outline> = BTreeMap::new();
        for k in 0..label.len() {
            let Some(piece) = label[k] else { continue };
            for direction in CELL_STEPS {
                let next = self.beside(k, direction);
                let other = next.and_then(|j| label[j]);
                if other == Some(piece) {
                    continue;
                }
                let outline = found.entry(piece).or_default();
                outline.length += 1;
                if let Some(other) = other {
                    *outline.touches.entry(other).or_default() += 1;
                    outline.foot += usize::from(beside_valley[k]);
                } else if self.hides(k, direction) {
                    outline.hides += 1;
                }
            }
        }
        found
    }

    /// Whether the next point in a direction, across cells without points, is farther away by a step in depth.
    fn hides(&self, k: usize, direction: [isize; 2]) -> bool {
        let depth = |k: usize| self.points[k].distance(self.viewpoint);
        let usual = self.around[k]
            .iter()
            .map(|&j| self.points[k].distance(self.points[j as usize]));
        let usual = usual.fold(f64::INFINITY, f64::min);
        for steps in 1..=MAX_SHADOW_CELLS {
            let Some(cell) = self.moved(k, direction, steps) else {
                return false;
            };
            if let Some(j) = self.grid.cells[cell] {
                return depth(j as usize) - depth(k) > BEHIND_STEP * usual * steps as f64;
            }
        }
        false
    }
}

fn sides([a, b, c]: [u32; 3]) -> [(usize, usize); 3] {
    let [a, b, c] = [a, b, c].map(|k| k as usize);
    [(a, b), (b, c), (c, a)]
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a count"
)]
fn rounded(count: f64) -> usize {
    count.round() as usize
}

#[cfg(test)]
mod tests;
