//! Arcs split only where parity asks for it.
//!
//! A cell with k corners and s split arcs divides into four-sided faces if k + s is even. All arcs split is always a
//! solution; from there arcs are un-split as long as the cost falls. A change flips the arcs along a closed walk from cell to cell, the
//! outside of the borders being one more cell: every cell keeps its parity. The walk is the cheapest through an arc by an
//! estimate per cell; it counts only if the exact cost falls:
//!
//! ```text
//! faces + Σ |faces - 4| over vertices off hard lines and inside cells
//!       + 1.2 Σ max(0, |faces at a corner of a cell - angle / 90°| - 1/2)
//!       + 12 Σ corners between two hard lines, by their angle per face: 0 at 108°, 1 from 153° on
//!       + 2 Σ other corners above 145°, and all below 30°
//! ```
//!
//! It takes the place of an integer programme: T-joins by shortest paths (J. Edmonds, E. Johnson, *Matching, Euler tours and
//! the Chinese postman*, Mathematical Programming 5, 1973), repeated. It ends because the cost falls with each change.

mod walks;

use super::NONE;
use super::arcs::Polygons;
use super::cells::Cells;
use super::patterns::Pattern;
use super::quads::{Division, point_at};
use super::surface::{Surface, index};
use glam::DVec3;
use nurbskin_geometry::math;
use std::collections::BTreeMap;

/// Weight of faces at a corner against its angle. Trial: prototype.
const ANGLE_WEIGHT: f64 = 1.2;
/// Cost of a face with a straight angle between two hard sides.
/// Derived: the derivatives of a face along two sides in one line are parallel, so that it folds at their corner. Trial: with 6 a
/// straight corner is left in every layout of fandisk, with 12 and 25 in one of three.
const FLAT: f64 = 12.0;
/// Angle per face between hard sides from which on it costs, by the square of the excess. Right angles.
/// Trial: 1.2 on fandisk and a bracket, not varied; 108 degrees.
const BENT: f64 = 1.2;
/// Angle per face between hard sides from which on it costs all of [`FLAT`]. Right angles.
/// Trial: as [`BENT`]; 153 degrees.
const STRAIGHT_LINE: f64 = 1.7;
/// Angle per face off these lines from which on it is straight, in right angles. Trial: 1.6, not varied; 145 degrees.
const STRAIGHT: f64 = 1.6;
/// Cost of a straight angle off these lines, where the fit can bend the sides; also of angles per face below [`NARROW`].
/// Trial: nine scans and CAD meshes have 10 bad faces at first with 0, 9 with 2 and 7 with 4, which makes more faces.
const OFF_LINES: f64 = 2.0;
/// Angle per face below which it is narrow. Right angles. Trial: 0.35, not varied; 32 degrees.
const NARROW: f64 = 0.35;
/// Cost of an inner vertex with fewer than three faces. Guard: more than any gain.
const FOLD: f64 = 100.0;
/// Most rounds over all arcs. Guard: it ends before when no walk helps.
const MAX_ROUNDS: usize = 30;
/// Most arcs; above, all are split. Guard: time. Such layouts are the last resort of meshes cut to pieces.
const MAX_ARCS: usize = 10_000;
/// Least fall of the cost. Guard: rounding.
const LEAST_GAIN: f64 = 1e-9;
/// Where the direction of an arc at its corner is taken, as a share of its length. Trial: not varied; the
/// angles of single triangles are noise.
const DIRECTION: f64 = 0.25;
/// The same of arcs on hard lines. Trial: with 0.25 the arcs of a circle of fandisk leave their corners at 130 degrees.
const LINE_DIRECTION: f64 = 0.08;

/// The state of the search.
struct Search {
    split: Vec<bool>,
    /// Arcs that must stay split.
    fixed: Vec<bool>,
    patterns: Vec<Pattern>,
    /// Per cell the angles at its corners in right angles.
    angles: Vec<Vec<f64>>,
    /// Per cell, whether both sides at a corner are on hard lines.
    lines: Vec<Vec<bool>>,
    /// Per cell its arcs that are left, with their direction, and the corners at which they start.
    sides: Vec<Vec<(u32, bool)>>,
    corners: Vec<Vec<u32>>,
    /// The cells beside each arc; the outside is the last number.
    beside: Vec<[u32; 2]>,
    /// Arcs on borders, as sides of the outside.
    open: Vec<u32>,
    /// Faces at each corner, by vertex of the mesh, and at the middle of each arc.
    faces: Vec<usize>,
    /// Whether corners and middles are on hard lines.
    hard: Vec<bool>,
    /// Number of vertices of the mesh: the middle of arc k has number `base + k`.
    base: usize,
    /// Per cell the estimates of flipping two of its arcs, as far as they are known at present.
    known: Vec<Estimates>,
    /// The cells at each corner.
    around: BTreeMap<u32, Vec<u32>>,
}

/// Pairs of arcs of a cell, with the estimated cost of flipping both; infinite if no pattern fits then.
type Estimates = Vec<([u32; 2], f64)>;

/// The division with the fewest faces and most regular vertices that the search finds.
pub(crate) fn divide(surface: &Surface<'_>, cells: &Cells, polygons: &Polygons) -> Division {
    let all = Division::all(polygons);
    let left = polygons.arcs.iter().filter(|a| !a.gone).count();
    if left > MAX_ARCS {
        return all;
    }
    let mut search = Search::new(surface, cells, polygons, all);
    search.run();
    Division {
        split: search.split,
        patterns: search.patterns,
    }
}

/// What a change replaced.
struct Undo {
    flipped: Vec<u32>,
    patterns: Vec<(usize, Pattern)>,
}

impl Search {
    fn new(surface: &Surface<'_>, cells: &Cells, polygons: &Polygons, all: Division) -> Self {
        let labels = &cells.labels;
        let cells = polygons.sides.len();
        let outside = index(cells);
        let sides: Vec<Vec<(u32, bool)>> = (0..cells).map(|c| polygons.left(c).collect()).collect();
        let start =
            |&(arc, reversed): &(u32, bool)| polygons.corners_of(arc)[usize::from(reversed)];
        let corners: Vec<Vec<u32>> = sides
            .iter()
            .map(|sides| sides.iter().map(start).collect())
            .collect();
        let base = surface.mesh.points.len();
        let mut hard = vec![false; base + polygons.arcs.len()];
        let mut fixed = vec![false; polygons.arcs.len()];
        for (k, arc) in polygons.arcs.iter().enumerate() {
            let ends = polygons.corners_of(index(k));
            fixed[k] = arc.gone || ends[0] == ends[1];
            if arc.kind.is_hard() && !arc.gone {
                hard[base + k] = true;
                for end in ends {
                    hard[end as usize] = true;
                }
            }
        }
        for (sides, corners) in sides.iter().zip(&corners) {
            if (1..corners.len()).any(|k| corners[..k].contains(&corners[k])) {
                for &(arc, _) in sides {
                    fixed[arc as usize] = true;
                }
            }
        }
        let arcs = polygons.arcs.iter();
        let beside: Vec<[u32; 2]> = arcs
            .map(|a| a.cells.map(|c| if c == NONE { outside } else { c }))
            .collect();
        let open = (0..index(beside.len()))
            .filter(|&k| beside[k as usize][1] == outside && !polygons.arcs[k as usize].gone);
        let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (cell, corners) in corners.iter().enumerate() {
            for &corner in corners {
                around.entry(corner).or_default().push(index(cell));
            }
        }
        let mut search = Self {
            known: vec![Vec::new(); cells],
            around,
            angles: (0..cells)
                .map(|cell| angles(surface, labels, polygons, cell))
                .collect(),
            lines: sides.iter().map(|s| on_lines(polygons, s)).collect(),
            open: open.collect(),
            split: all.split,
            patterns: all.patterns,
            faces: vec![0; hard.len()],
            fixed,
            sides,
            corners,
            beside,
            hard,
            base,
        };
        for cell in 0..cells {
            search.count(cell, true);
        }
        search
    }

    /// Un-splits until nothing helps.
    fn run(&mut self) {
        for _ in 0..MAX_ROUNDS {
            let mut changed = self.divide_anew();
            for arc in 0..index(self.split.len()) {
                if self.fixed[arc as usize] {
                    continue;
                }
                if let Some(walk) = self.walk(arc) {
                    changed |= self.try_change(&walk);
                }
            }
            if !changed {
                break;
            }
        }
    }

    /// The best pattern of each cell amid those of the others, the same arcs split. Returns whether one changed. The costs of
    /// cells that have a corner twice are not exact, and their arcs are fixed.
    fn divide_anew(&mut self) -> bool {
        let mut changed = false;
        for cell in 0..self.sides.len() {
            if self.sides[cell]
                .iter()
                .all(|side| self.fixed[side.0 as usize])
            {
                continue;
            }
            self.count(cell, false);
            let now = self.cost_of_own(cell);
            let best = self.best_pattern(cell);
            if let Some((pattern, _)) = best.filter(|b| b.1 < now - LEAST_GAIN) {
                self.patterns[cell] = pattern;
                self.forget(&[cell]);
                changed = true;
            }
            self.count(cell, true);
        }
        changed
    }

    /// The corners and middles around a cell, in the order of its pattern.
    fn rim(&self, cell: usize) -> Vec<usize> {
        let mut rim = Vec::new();
        for (&(arc, _), &corner) in self.sides[cell].iter().zip(&self.corners[cell]) {
            rim.push(corner as usize);
            if self.split[arc as usize] {
                rim.push(self.base + arc as usize);
            }
        }
        rim
    }

    /// Adds the faces of a cell to those of its vertices, or takes them away.
    fn count(&mut self, cell: usize, add: bool) {
        for (k, v) in self.rim(cell).into_iter().enumerate() {
            let faces = self.patterns[cell].faces_at(k);
            if add {
                self.faces[v] += faces;
            } else {
                self.faces[v] -= faces;
            }
        }
    }

    /// The cost of the number of faces at a corner; that of middles belongs to their cells.
    fn vertex_cost(&self, vertex: usize, faces: usize) -> f64 {
        if vertex >= self.base || self.hard[vertex] || faces == 0 {
            return 0.0;
        }
        let fold = if faces < 3 { FOLD } else { 0.0 };
        faces.abs_diff(4) as f64 + fold
    }

    /// The cost of a pattern of a cell, without that of its vertices.
    fn pattern_cost(&self, cell: usize, pattern: &Pattern) -> f64 {
        let mut cost = pattern.faces.len() as f64;
        for vertex in pattern.count..pattern.count + pattern.inner() {
            cost += pattern.faces_at(vertex).abs_diff(4) as f64;
        }
        let mut at = 0;
        let corners = self.angles[cell].iter().zip(&self.lines[cell]);
        for (&(arc, _), (angle, on_lines)) in self.sides[cell].iter().zip(corners) {
            let faces = pattern.faces_at(at) as f64;
            let off = (faces - angle).abs() - 0.5;
            cost += ANGLE_WEIGHT * off.max(0.0);
            if *on_lines {
                let way = (angle / faces - BENT) / (STRAIGHT_LINE - BENT);
                let way = way.clamp(0.0, 1.0);
                cost += FLAT * way * way;
            } else if *angle > STRAIGHT * faces {
                cost += OFF_LINES;
            }
            if *angle < NARROW * faces {
                cost += OFF_LINES;
            }
            if self.split[arc as usize] {
                // A middle has two faces of each of its cells at least; each more counts.
                let more = pattern.faces_at(at + 1).saturating_sub(2);
                cost += if self.hard[self.base + arc as usize] {
                    0.0
                } else {
                    more as f64
                };
                at += 1;
            }
            at += 1;
        }
        cost
    }

    /// The best pattern of a cell whose faces are not counted at present, with its cost.
    fn best_pattern(&self, cell: usize) -> Option<(Pattern, f64)> {
        let rim = self.rim(cell);
        let middle: Vec<bool> = rim.iter().map(|v| *v >= self.base).collect();
        let mut best: Option<(Pattern, f64)> = None;
        for pattern in Pattern::all(&middle) {
            let mut cost = self.pattern_cost(cell, &pattern);
            for (k, &v) in rim.iter().enumerate() {
                let others = self.faces[v];
                let change = self.vertex_cost(v, others + pattern.faces_at(k));
                cost += change - self.vertex_cost(v, others);
            }
            if best.as_ref().is_none_or(|b| cost < b.1 - LEAST_GAIN) {
                best = Some((pattern, cost));
            }
        }
        best
    }

    /// The cost of some cells and of all of their vertices.
    fn cost(&self, cells: &[usize]) -> f64 {
        let mut vertices = Vec::new();
        let mut cost = 0.0;
        for &cell in cells {
            cost += self.pattern_cost(cell, &self.patterns[cell]);
            vertices.extend(self.corners[cell].iter().map(|&v| v as usize));
        }
        vertices.sort_unstable();
        vertices.dedup();
        let each = vertices.iter().map(|&v| self.vertex_cost(v, self.faces[v]));
        cost + each.sum::<f64>()
    }

    /// Flips the arcs that occur an odd number of times in a walk, if the cost falls.
    fn try_change(&mut self, walk: &[u32]) -> bool {
        let mut arcs = walk.to_vec();
        arcs.sort_unstable();
        let flipped: Vec<u32> = arcs
            .chunk_by(|a, b| a == b)
            .filter(|same| same.len() % 2 == 1)
            .map(|same| same[0])
            .collect();
        let mut cells: Vec<usize> = flipped
            .iter()
            .flat_map(|&arc| self.beside[arc as usize])
            .map(|c| c as usize)
            .filter(|&c| c < self.sides.len())
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let before = self.cost(&cells);
        for &cell in &cells {
            self.count(cell, false);
        }
        let undo = Undo {
            patterns: cells
                .iter()
                .map(|&c| (c, self.patterns[c].clone()))
                .collect(),
            flipped,
        };
        for &arc in &undo.flipped {
            self.split[arc as usize] ^= true;
        }
        let mut possible = true;
        for &cell in &cells {
            match self.best_pattern(cell) {
                Some((pattern, _)) => {
                    self.patterns[cell] = pattern;
                    self.count(cell, true);
                }
                None => {
                    possible = false;
                    // Counts nothing, so that it can be taken back like the others.
                    self.patterns[cell].faces.clear();
                }
            }
        }
        if possible {
            // Once more, now that all the others are known.
            for &cell in &cells {
                self.count(cell, false);
                if let Some((pattern, _)) = self.best_pattern(cell) {
                    self.patterns[cell] = pattern;
                }
                self.count(cell, true);
            }
            if self.cost(&cells) < before - LEAST_GAIN {
                self.forget(&cells);
                return true;
            }
        }
        self.restore(undo);
        false
    }

    fn restore(&mut self, undo: Undo) {
        for (cell, _) in &undo.patterns {
            self.count(*cell, false);
        }
        for &arc in &undo.flipped {
            self.split[arc as usize] ^= true;
        }
        for (cell, pattern) in undo.patterns {
            self.patterns[cell] = pattern;
            self.count(cell, true);
        }
    }
}

/// For each corner of a cell, whether both of its sides there are on hard lines.
fn on_lines(polygons: &Polygons, sides: &[(u32, bool)]) -> Vec<bool> {
    let hard = |k: usize| polygons.arcs[sides[k].0 as usize].kind.is_hard();
    let count = sides.len();
    (0..count)
        .map(|k| hard(k) && hard((k + count - 1) % count))
        .collect()
}

/// The angles at the corners of a cell, in right angles, 0 to 4.
fn angles(surface: &Surface<'_>, labels: &[u32], polygons: &Polygons, cell: usize) -> Vec<f64> {
    let sides: Vec<(u32, bool)> = polygons.left(cell).collect();
    let direction = |&(arc, reversed): &(u32, bool), at_end: bool| -> DVec3 {
        let arc = &polygons.arcs[arc as usize];
        let line = &arc.line;
        let backward = reversed != at_end;
        let way = if arc.kind.is_hard() {
            LINE_DIRECTION
        } else {
            DIRECTION
        };
        let (from, to) = if backward {
            (1.0, 1.0 - way)
        } else {
            (0.0, way)
        };
        point_at(surface, line, to) - point_at(surface, line, from)
    };
    (0..sides.len())
        .map(|k| {
            let before = &sides[(k + sides.len() - 1) % sides.len()];
            let (a, b) = (direction(&sides[k], false), direction(before, true));
            let cosine = a.dot(b) / (a.length() * b.length()).max(f64::MIN_POSITIVE);
            let angle = math::acos(cosine.clamp(-1.0, 1.0));
            let corner = polygons.corners_of(sides[k].0)[usize::from(sides[k].1)];
            // The triangles tell an angle from its complement.
            let inside = inner_angle(surface, labels, cell, corner);
            let angle = if inside > std::f64::consts::PI {
                std::f64::consts::TAU - angle
            } else {
                angle
            };
            angle / std::f64::consts::FRAC_PI_2
        })
        .collect()
}

/// The sum of the angles at a vertex of the triangles of a cell.
fn inner_angle(surface: &Surface<'_>, labels: &[u32], cell: usize, vertex: u32) -> f64 {
    let own = |side: &u32| labels[*side as usize / 3] as usize == cell;
    let angle = |side: u32| {
        let (t, k) = (side as usize / 3, side as usize % 3);
        let corners = surface.mesh.corners(t);
        let [a, b] = [1, 2].map(|d| corners[(k + d) % 3] - corners[k]);
        math::angle_between(a, b)
    };
    surface.table.fan(vertex).filter(own).map(angle).sum()
}
