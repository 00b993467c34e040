//! Triangles within a chordal tolerance.
//!
//! Linear interpolation over a triangle with legs along u and v of lengths h and k misses a surface by at most
//! `(h^2 |S_uu| + 2 h k |S_uv| + k^2 |S_vv|) / 8` (D. Filip, R. Magedson, R. Markot, *Surface algorithms using bounds
//! on derivatives*, CAGD 3, 1986). The second derivatives are bounded on each Bezier piece (`bounds.rs`). Each span is then cut evenly; as all pieces between two knot lines get the same cuts, the mesh is a
//! grid and thus watertight across spans.

use super::NurbsSurface;
use rayon::prelude::*;
pub mod bounds;
pub mod derivatives;

use super::bezier;
use super::refine::Direction;
use super::shape::Edge;
use crate::{Error, Result};
use bounds::Bounds;
use glam::{DVec2, DVec3};
use std::collections::HashMap;

/// Triangles on a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tessellation {
    /// Vertices; one where a seam closes, one for a pole.
    pub points: Vec<DVec3>,
    /// Unit normal of the surface per vertex, the mean of all at a pole; zero where there is none.
    pub normals: Vec<DVec3>,
    /// (u, v) per vertex; at a seam that of the start of the domain.
    pub parameters: Vec<DVec2>,
    /// Vertices of each triangle, counter-clockwise seen from the tip of the normal.
    pub triangles: Vec<[u32; 3]>,
    /// No point of the surface is further from the triangle at its parameters than this; below the tolerance.
    pub bound: f64,
}

/// Triangles that follow the surface within `tolerance`, at most `max_triangles`.
///
/// Edges that coincide, and poles, within 1/64 of the tolerance become shared vertices; the share is taken off the
/// tolerance of the chords.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_geometry::nurbs::conic;
/// use nurbskin_geometry::nurbs::tessellate::tessellate;
/// let sphere = conic::sphere(DVec3::ZERO, 1.0)?;
/// let mesh = tessellate(&sphere, 0.01, 100_000)?;
/// // Euler's formula for a closed surface without holes: V - E + F = 2 with E = 3 F / 2.
/// assert_eq!(2 * mesh.points.len(), mesh.triangles.len() + 4);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the tolerance is not positive; [`Error::NoSolution`] if it needs more triangles.
pub fn tessellate(
    surface: &NurbsSurface,
    tolerance: f64,
    max_triangles: usize,
) -> Result<Tessellation> {
    let grid = Grid::new(surface, tolerance, max_triangles)?;
    Ok(grid.mesh(surface).0)
}

/// Part of a cell by which [`Grid::uneven`] moves lines: (sqrt(5) - 2) / 4, far from simple fractions.
const UNEVEN: f64 = 0.059_016_994_374_947_4;

/// The lines of constant parameters along which a surface is cut into cells of two triangles.
#[derive(Clone, Debug)]
pub struct Grid {
    lines: [Vec<f64>; 2],
    numbering: Numbering,
    /// No point of the surface is further from the triangle at its parameters than this.
    bound: f64,
}

impl Grid {
    /// The lines whose triangles follow the surface within `tolerance`; see [`tessellate`].
    pub fn new(surface: &NurbsSurface, tolerance: f64, max_triangles: usize) -> Result<Self> {
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(Error::invalid(format!(
                "the chordal tolerance must be a positive number, not {tolerance}"
            )));
        }
        let slack = tolerance / 64.0;
        let breaks = [
            surface.knots_u().breakpoints(),
            surface.knots_v().breakpoints(),
        ];
        let spans = [breaks[0].len() - 1, breaks[1].len() - 1];
        let check = |u: f64, v: f64| {
            let (need, vertices) = (2.0 * u * v, (u + 1.0) * (v + 1.0));
            if need <= max_triangles as f64 && vertices < f64::from(u32::MAX) {
                return Ok(());
            }
            Err(Error::NoSolution(format!(
                "a chordal tolerance of {tolerance} needs {need:.3e} triangles, but {max_triangles} are allowed: take a \
                 larger tolerance or allow more"
            )))
        };
        check(spans[0] as f64, spans[1] as f64)?;
        let mut numbering = Numbering::new(surface, slack);
        // A seam moves a vertex by one slack, a pole by two.
        let mut cuts = Cuts::new(surface, spans, tolerance - 3.0 * slack)?;
        for (cuts, closed) in [&mut cuts.u, &mut cuts.v].into_iter().zip(numbering.closed) {
            // A closed line of fewer than three chords would fold flat.
            if closed && cuts.len() < 3 {
                cuts.iter_mut().for_each(|cut| *cut = cut.max(3.0));
            }
        }
        check(cuts.u.iter().sum(), cuts.v.iter().sum())?;
        let lines = [cut(&breaks[0], &cuts.u), cut(&breaks[1], &cuts.v)];
        numbering.counts = [lines[0].len(), lines[1].len()];
        Ok(Self {
            lines,
            bound: cuts.error + numbering.moved * slack,
            numbering,
        })
    }

    /// The same grid with the lines between knots moved by 6 % of a cell. Where a symmetric surface meets itself, lines of its two
    /// halves may coincide, so that triangles touch that should cross; moved by an irrational part, they do not. The chordal
    /// error grows by an eighth at most.
    pub fn uneven(mut self, surface: &NurbsSurface) -> Self {
        let knots = [surface.knots_u(), surface.knots_v()];
        for (lines, knots) in self.lines.iter_mut().zip(knots) {
            let breaks = knots.breakpoints();
            for k in 1..lines.len().saturating_sub(1) {
                if !breaks.contains(&lines[k]) {
                    lines[k] += UNEVEN * (lines[k + 1] - lines[k]);
                }
            }
        }
        self.bound *= (1.0 + UNEVEN).powi(2);
        self
    }

    /// The triangles, and the cell of each.
    pub fn mesh(&self, surface: &NurbsSurface) -> (Tessellation, Vec<u32>) {
        let (mut mesh, cells) = mesh(surface, &self.lines, &self.numbering);
        mesh.bound = self.bound;
        (mesh, cells)
    }

    /// The triangles of the cells that `kept` marks, each cell cut into `parts` by `parts`, and the cell of each. Their
    /// chordal error is `parts^2` times less. They have no normals.
    pub fn finer(
        &self,
        surface: &NurbsSurface,
        kept: &[bool],
        parts: usize,
    ) -> (Tessellation, Vec<u32>) {
        let between = |lines: &Vec<f64>| cut(lines, &vec![parts as f64; lines.len() - 1]);
        let lines = self.lines.each_ref().map(between);
        let numbering = Numbering {
            counts: lines.each_ref().map(Vec::len),
            ..self.numbering
        };
        let columns = self.numbering.counts[0] - 1;
        let (mut mesh, mut cells) = (Tessellation::default(), Vec::new());
        let (mut numbers, mut next) = (HashMap::new(), 0_u32);
        for (cell, _) in (0..).zip(kept).filter(|&(_, &kept)| kept) {
            let first = [cell as usize % columns, cell as usize / columns].map(|k| k * parts);
            for k in 0..parts * parts {
                let (i, j) = (first[0] + k % parts, first[1] + k / parts);
                let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| {
                    let at = numbering.canonical(i, j);
                    *numbers.entry(at).or_insert_with(|| {
                        let place = DVec2::new(lines[0][at[0]], lines[1][at[1]]);
                        mesh.points.push(surface.point(place.x, place.y));
                        mesh.parameters.push(place);
                        next += 1;
                        next - 1
                    })
                });
                mesh.triangles.extend(halves(corners, &mesh.points));
            }
            cells.resize(mesh.triangles.len(), cell);
        }
        (mesh, cells)
    }

    /// Marks these cells and those that touch them.
    pub fn around(&self, cells: impl Iterator<Item = u32>) -> Vec<bool> {
        let [m, n] = self.numbering.counts.map(|count| count - 1);
        let closed = self.numbering.closed;
        let near = |k: usize, count: usize, closed: bool| {
            let before = k.checked_sub(1).or(closed.then_some(count - 1));
            let after = match k + 1 < count {
                true => Some(k + 1),
                false => closed.then_some(0),
            };
            [before, Some(k), after].into_iter().flatten()
        };
        let mut marks = vec![false; m * n];
        for cell in cells {
            let (i, j) = (cell as usize % m, cell as usize / m);
            for j in near(j, n, closed[1]) {
                for i in near(i, m, closed[0]) {
                    marks[j * m + i] = true;
                }
            }
        }
        marks
    }

    /// The lower and the upper corner of a cell in (u, v).
    pub fn corners(&self, cell: u32) -> [DVec2; 2] {
        let columns = self.numbering.counts[0] - 1;
        let (i, j) = (cell as usize % columns, cell as usize / columns);
        let [us, vs] = &self.lines;
        [DVec2::new(us[i], vs[j]), DVec2::new(us[i + 1], vs[j + 1])]
    }
}

/// The triangles of a cell, cut along its shorter diagonal; fewer where corners coincide.
fn halves([a, b, c, d]: [u32; 4], points: &[DVec3]) -> impl Iterator<Item = [u32; 3]> + use<> {
    let length = |x: u32, y: u32| points[x as usize].distance_squared(points[y as usize]);
    let pair = if length(a, c) <= length(b, d) {
        [[a, b, c], [a, c, d]]
    } else {
        [[a, b, d], [b, c, d]]
    };
    let whole = |[x, y, z]: &[u32; 3]| x != y && y != z && z != x;
    pair.into_iter().filter(whole)
}

/// Into how many equal parts each span is cut; whole numbers.
struct Cuts {
    u: Vec<f64>,
    v: Vec<f64>,
    /// The chordal error they leave.
    error: f64,
}

impl Cuts {
    fn new(surface: &NurbsSurface, [m, n]: [usize; 2], tolerance: f64) -> Result<Self> {
        let rational = surface.is_rational();
        let mut bounds = Vec::with_capacity(m * n);
        bezier::visit(surface, |_, patch| {
            bounds.push(Bounds::new(patch, rational));
        })?;
        let at = |i: usize, j: usize| bounds[j * m + i];
        let eighths = 8.0 * tolerance;
        // Half of the error for each direction needs the fewest triangles; the mixed term goes to both.
        let half = |x: f64| (2.0 * x / eighths).sqrt().ceil().max(1.0);
        let start_v = (0..n).map(|j| {
            half(
                (0..m)
                    .map(|i| at(i, j).vv + at(i, j).uv)
                    .fold(0.0, f64::max),
            )
        });
        let mut cuts = Self {
            u: vec![1.0; m],
            v: start_v.collect(),
            error: 0.0,
        };
        // What one direction leaves by rounding up, the other may use.
        for (i, cut) in cuts.u.iter_mut().enumerate() {
            let need = (0..n).map(|j| at(i, j).fewest(cuts.v[j], eighths));
            *cut = need.fold(1.0, f64::max);
        }
        for (j, cut) in cuts.v.iter_mut().enumerate() {
            let need = (0..m).map(|i| at(i, j).transposed().fewest(cuts.u[i], eighths));
            *cut = need.fold(1.0, f64::max).min(*cut);
        }
        for (k, bounds) in bounds.iter().enumerate() {
            let error = bounds.error(cuts.u[k % m], cuts.v[k / m]) / 8.0;
            cuts.error = cuts.error.max(error);
        }
        Ok(cuts)
    }
}

/// The parameters of the grid lines.
fn cut(breaks: &[f64], cuts: &[f64]) -> Vec<f64> {
    let mut lines = vec![breaks[0]];
    for (range, &count) in breaks.windows(2).zip(cuts) {
        let mut k = 1.0;
        while k < count {
            lines.push(range[0] + (range[1] - range[0]) * (k / count));
            k += 1.0;
        }
        lines.push(range[1]);
    }
    lines
}

/// Which grid points are one vertex.
#[derive(Clone, Copy, Debug)]
struct Numbering {
    /// Number of grid lines along u and v.
    counts: [usize; 2],
    closed: [bool; 2],
    /// As in [`Edge::ALL`].
    poles: [bool; 4],
    /// By how many slacks a vertex may have been moved.
    moved: f64,
}

impl Numbering {
    fn new(surface: &NurbsSurface, slack: f64) -> Self {
        let closed = Direction::BOTH.map(|direction| surface.is_closed(direction, slack));
        let poles = Edge::ALL.map(|edge| surface.is_pole(edge, slack));
        let moved = f64::from(u8::from(closed.contains(&true)));
        let moved = if poles.contains(&true) {
            moved + 2.0
        } else {
            moved
        };
        Self {
            counts: [0; 2],
            closed,
            poles,
            moved,
        }
    }

    /// The grid point that stands for (i, j).
    fn canonical(&self, mut i: usize, mut j: usize) -> [usize; 2] {
        let [last_u, last_v] = self.counts.map(|count| count - 1);
        if self.closed[0] && i == last_u {
            i = 0;
        }
        if self.closed[1] && j == last_v {
            j = 0;
        }
        if self.poles[0] && i == 0 || self.poles[1] && i == last_u {
            j = 0;
        }
        if self.poles[2] && j == 0 || self.poles[3] && j == last_v {
            i = 0;
        }
        [i, j]
    }
}

/// Point and normal at every grid point, u fastest.
fn samples(surface: &NurbsSurface, lines: &[Vec<f64>; 2]) -> Vec<(DVec3, Option<DVec3>)> {
    let [us, vs] = lines;
    let spans_u: Vec<usize> = us.iter().map(|&u| surface.knots_u().span(u)).collect();
    let row = |&v: &f64| {
        let span_v = surface.knots_v().span(v);
        let places = us.iter().zip(&spans_u);
        let sample = |(&u, &span_u): (&f64, &usize)| {
            let spans = [span_u, span_v];
            let d = surface.derivatives_on(spans, u, v);
            (d.point, surface.normal_of(spans, [u, v], &d))
        };
        places.map(sample).collect::<Vec<_>>()
    };
    let rows: Vec<_> = vs.par_iter().map(row).collect();
    rows.concat()
}

/// The mesh over a grid of parameters, without its bound, and the cell of each triangle.
fn mesh(
    surface: &NurbsSurface,
    lines: &[Vec<f64>; 2],
    numbering: &Numbering,
) -> (Tessellation, Vec<u32>) {
    let samples = samples(surface, lines);
    let [m, n] = numbering.counts;
    let mut mesh = Tessellation::default();
    let mut numbers: Vec<u32> = Vec::with_capacity(m * n);
    let mut next = 0;
    for (k, &(point, normal)) in samples.iter().enumerate() {
        let (i, j) = (k % m, k / m);
        // The grid point that stands for others comes before them.
        let [first_i, first_j] = numbering.canonical(i, j);
        let number = match numbers.get(first_j * m + first_i) {
            Some(&number) => number,
            None => {
                mesh.points.push(point);
                mesh.normals.push(DVec3::ZERO);
                mesh.parameters.push(DVec2::new(lines[0][i], lines[1][j]));
                next += 1;
                next - 1
            }
        };
        numbers.push(number);
        mesh.normals[number as usize] += normal.unwrap_or_default();
    }
    for normal in &mut mesh.normals {
        *normal = normal.normalize_or_zero();
    }
    mesh.triangles.reserve(2 * (m - 1) * (n - 1));
    let mut cells = Vec::with_capacity(2 * (m - 1) * (n - 1));
    let rows = numbers.chunks_exact(m).zip(numbers.chunks_exact(m).skip(1));
    let mut cell = 0;
    for (low, high) in rows {
        for (below, above) in low.windows(2).zip(high.windows(2)) {
            let corners = [below[0], below[1], above[1], above[0]];
            mesh.triangles.extend(halves(corners, &mesh.points));
            cells.resize(mesh.triangles.len(), cell);
            cell += 1;
        }
    }
    (mesh, cells)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;
    use crate::nurbs::conic;

    #[test]
    fn finer_cells_of_a_whole_sphere_close_it_and_lie_nine_times_closer() {
        let sphere = conic::sphere(DVec3::ZERO, 1.0).unwrap();
        let grid = Grid::new(&sphere, 0.01, 100_000).unwrap();
        let (coarse, cells) = grid.mesh(&sphere);
        assert_eq!(coarse.triangles.len(), cells.len());
        let all = vec![true; *cells.last().unwrap() as usize + 1];
        let (fine, _) = grid.finer(&sphere, &all, 3);
        assert_eq!(2 * fine.points.len(), fine.triangles.len() + 4);
        let off = |mesh: &Tessellation| {
            let middles = mesh.triangles.iter().map(|t| {
                let sum: DVec3 = t.iter().map(|&k| mesh.points[k as usize]).sum();
                1.0 - sum.length() / 3.0
            });
            middles.fold(0.0, f64::max)
        };
        // The sagitta falls with the square of the sides, and the next term with the fourth power.
        assert!(
            off(&fine) < off(&coarse) / 8.5,
            "{} {}",
            off(&fine),
            off(&coarse)
        );
    }

    #[test]
    fn cells_around_a_cell_go_on_across_a_seam() {
        let cylinder = conic::cylinder(DVec3::ZERO, DVec3::Z, 1.0).unwrap();
        let grid = Grid::new(&cylinder, 0.01, 100_000).unwrap();
        let [m, n] = grid.numbering.counts.map(|count| count - 1);
        assert!(m > 3 && n == 1, "{m} {n}");
        let marks = grid.around([0].into_iter());
        let marked: Vec<usize> = (0..m * n).filter(|&k| marks[k]).collect();
        assert_eq!(marked, [0, 1, m - 1]);
    }
}
