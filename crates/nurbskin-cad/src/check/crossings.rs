//! Folds and self-intersections.

use super::{FOLD, Subject, Worst};
use crate::extent::shell_extent;
use crate::model::{Model, Shell};
use crate::region::scale_of;
use glam::{DVec2, DVec3};
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::nurbs::NurbsSurface;
use nurbskin_geometry::nurbs::tessellate::{Grid, Tessellation};
use nurbskin_geometry::spatial::boxes::Tree;
use nurbskin_geometry::spatial::triangles::crossing;

/// Triangles of a face allowed for the search.
pub(super) const TRIANGLES: usize = 4_000_000;
/// Chordal tolerance as a share of the diagonal.
const SHARE: f64 = 1e-3;
/// Steps for each power of two by which the ratio of the diagonal to the size of the surface is rounded. A fit knows the diagonal
/// of its points only. With the rounded one it searches the triangles that the check searches.
const STEPS_OF_DIAGONAL: f64 = 2.0;
/// The diagonal of the points is that of the model but for this part. By trial: below 0.02 on the scans of
/// docs/real-scans.md.
const DOUBT: f64 = 0.04;
/// Parts along u and v into which the cells of a crossing are cut, to confirm it: chords cut corners, and those of the parts lie
/// nine times closer to the surface.
const PARTS: usize = 3;

/// Pairs of triangles, at most, whose cells a fit cuts to confirm that they cross; of more, every n-th. Count.
/// Guard: bounds the time. A surface that winds through itself has 160 000 such pairs, which take 36 s.
const MOST_CONFIRMED: usize = 10_000;
/// Pairs of triangles, as a share of the triangles, from which on a surface with more than [`MOST_CONFIRMED`] pairs intersects itself
/// widely, as far as these cross. Dimensionless.
/// Trial: not varied. One surface for a figure with a handle has 16 %, for the cloud of a head 6 %; a head whose 700 places other
/// fairness mends has 0.6 %.
const WIDE: f64 = 0.03;

/// Gauss-Newton steps to the nearest point of a surface from the middle of a cell. Count.
/// Guard: the place is within a cell or two, where each step gains a digit or more.
const FOOT_STEPS: usize = 8;

/// Size of `S_u x S_v`, as a share of its scale, below which it has no direction. Dimensionless.
/// Guard: some times the root of the machine precision.
const LEAST_ELEMENT: f64 = 1e-7;

/// Folds and self-intersections.
pub(super) struct Found {
    /// The largest angle by which a normal turns at once.
    pub(super) fold: Worst,
    /// The number of pairs of triangles that cross.
    pub(super) crossings: Worst,
    /// Where it folds: the face, and the place in (u, v).
    folds: Vec<(u32, DVec2)>,
    /// The cells of the pairs, by face.
    pairs: Vec<[(u32, u32); 2]>,
    /// Whether whole regions cross.
    is_wide: bool,
}

/// Where a surface folds or intersects itself, in (u, v).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    folds: Vec<DVec2>,
    /// Lower and upper corners of the cells of triangles that cross.
    pairs: Vec<[[DVec2; 2]; 2]>,
    is_wide: bool,
}

impl Defects {
    /// Whether the surface neither folds nor intersects itself.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.folds.is_empty() && self.pairs.is_empty()
    }

    /// Whether whole regions intersect each other; only a sample of the pairs of triangles is listed then.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.is_wide
    }

    /// The places of the folds, and the middles of the cells that cross, each once.
    #[must_use]
    pub fn places(&self) -> Vec<DVec2> {
        let crossed = self
            .pairs
            .as_flattened()
            .iter()
            .map(|[a, b]| a.midpoint(*b));
        let mut places: Vec<DVec2> = self.folds.iter().copied().chain(crossed).collect();
        let by = |a: &DVec2, b: &DVec2| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
        places.sort_unstable_by(by);
        places.dedup();
        places
    }

    /// Those that are left where less of the surface is kept: pairs whose cells are kept whole. A search may find one more,
    /// with a triangle of a cell that the border cuts.
    pub(crate) fn within(&self, keeps: &(dyn Fn(DVec2) -> bool + Sync)) -> Self {
        let whole = |[a, b]: &[DVec2; 2]| {
            keeps(*a) && keeps(*b) && keeps(DVec2::new(a.x, b.y)) && keeps(DVec2::new(b.x, a.y))
        };
        let is_left = |pair: &&[[DVec2; 2]; 2]| pair.iter().all(whole);
        Self {
            folds: self.folds.iter().copied().filter(|&p| keeps(p)).collect(),
            pairs: self.pairs.iter().filter(is_left).copied().collect(),
            is_wide: self.is_wide,
        }
    }
}

/// The largest fold, and the self-intersections.
///
/// # Errors
/// Those of tessellating with at most [`TRIANGLES`].
pub(super) fn folds_and_crossings(subject: &Subject) -> Result<Found> {
    Ok(found(&pieces_of(subject)?, usize::MAX))
}

/// A face, and the lower and upper corner of a part of it in (u, v).
pub type FaceCell = (usize, [DVec2; 2]);

/// Where the shells of a model fold or intersect themselves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShellDefects {
    /// The folds: a face, and the place in (u, v).
    pub folds: Vec<(usize, DVec2)>,
    /// The parts of faces that intersect each other; both may be of one face.
    pub crossings: Vec<[FaceCell; 2]>,
}

impl ShellDefects {
    /// Whether no face folds, and none intersects itself or another.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.folds.is_empty() && self.crossings.is_empty()
    }

    /// The parts of faces that are at fault, one for each fold and two for each intersection.
    pub fn parts(&self) -> impl Iterator<Item = FaceCell> + '_ {
        let folds = self
            .folds
            .iter()
            .map(|&(face, place)| (face, [place, place]));
        folds.chain(self.crossings.as_flattened().iter().copied())
    }
}

/// Where the faces of a model fold or intersect their shell, as the check finds it. O(n log n) in the triangles.
///
/// # Errors
/// [`nurbskin_geometry::Error::NoSolution`] if the search takes more than four million triangles of a face; those of
/// [`extent`](crate::extent::extent).
pub fn shell_defects(model: &Model) -> Result<ShellDefects> {
    let subject = Subject::new(model)?;
    let pieces = pieces_of(&subject)?;
    let Found { folds, pairs, .. } = found(&pieces, usize::MAX);
    let fold = |(face, place): (u32, DVec2)| (face as usize, place);
    let cell = |(face, cell): (u32, u32)| (face as usize, pieces[face as usize].grid.corners(cell));
    Ok(ShellDefects {
        folds: folds.into_iter().map(fold).collect(),
        crossings: pairs.into_iter().map(|pair| pair.map(cell)).collect(),
    })
}

/// The faces of a model, with triangles that suit the search.
fn pieces_of<'a>(subject: &'a Subject) -> Result<Vec<Piece<'a>>> {
    // Chords suit the size of each shell, so that what else is in the model makes no difference.
    let shells = subject.model.shells();
    let diagonal = |shell: &Shell| match shells.len() {
        1 => subject.diagonal,
        _ => shell_extent(subject.model, shell).map_or(subject.diagonal, |e| e.diagonal()),
    };
    let diagonals: Vec<f64> = shells.iter().map(diagonal).collect();
    let pieces = subject.model.faces().iter().zip(&subject.regions);
    let pieces = pieces
        .zip(subject.shell_of_faces())
        .map(|((face, region), shell)| {
            let region = region.as_ref().filter(|_| face.trimmed);
            // The chords of neighbours cross along the edges that they share.
            let alone = match shells.get(shell) {
                Some(shell) => shell.faces.len() == 1,
                None => subject.model.faces().len() == 1,
            };
            let [(a, b), (c, d)] = face.surface.domain();
            let on_side = move |p: DVec2| p.x <= a || p.x >= b || p.y <= c || p.y >= d;
            let keeps = move |p: DVec2| {
                (alone || !on_side(p)) && region.is_none_or(|region| region.contains(p))
            };
            let diagonal = diagonals.get(shell).copied();
            let diagonal = diagonal.unwrap_or(subject.diagonal);
            Piece::new(&face.surface, shell, diagonal, Box::new(keeps))
        });
    pieces.collect()
}

/// Where a surface, as far as `keeps` keeps it, folds or intersects itself, with the chords of a model whose diagonal is this
/// but for `DOUBT`. Empty also where the search is not possible.
pub fn crossings(
    surface: &NurbsSurface,
    diagonal: f64,
    keeps: &(dyn Fn(DVec2) -> bool + Sync),
) -> Defects {
    let defects = |diagonal: f64| -> Defects {
        let Ok(piece) = Piece::new(surface, 0, diagonal, Box::new(keeps)) else {
            return Defects::default();
        };
        let pieces = [piece];
        let Found {
            folds,
            pairs,
            is_wide,
            ..
        } = found(&pieces, MOST_CONFIRMED);
        let cell = |(_, cell): (u32, u32)| pieces[0].grid.corners(cell);
        Defects {
            folds: folds.into_iter().map(|(_, place)| place).collect(),
            pairs: pairs.into_iter().map(|pair| pair.map(cell)).collect(),
            is_wide,
        }
    };
    let [low, high] = [1.0 - DOUBT, 1.0 + DOUBT].map(|part| part * diagonal);
    let found = defects(low);
    if found.is_empty() && rounded(low, surface) < rounded(high, surface) {
        return defects(high);
    }
    found
}

/// The size of the surface times the power of two, or of its root, that is nearest to a diagonal by its logarithm.
fn rounded(diagonal: f64, surface: &NurbsSurface) -> f64 {
    let [low, high] = surface.bounding_box();
    let size = low.distance(high);
    let steps = (math::log2(diagonal / size) * STEPS_OF_DIAGONAL).round();
    size * math::exp2(steps / STEPS_OF_DIAGONAL)
}

/// Folds and self-intersections; of the pairs of triangles that may cross at most about `most` are looked at, if some of these do.
fn found(pieces: &[Piece<'_>], most: usize) -> Found {
    let coarse: Vec<Kept> = pieces.iter().map(Piece::kept).collect();
    let (fold, folds) = folds(pieces, &coarse);
    let (_, doubtful) = overlaps(&coarse, |_, _, _| true);
    let step = doubtful.len().div_ceil(most).max(1);
    let sample = doubtful.iter().step_by(step);
    let looked_at = sample.len();
    let (mut crossings, mut pairs) = confirmed(pieces, sample);
    // The parts of the cells of a pair that crosses have several.
    let is_wide = doubtful.len() > most && pairs.len() >= looked_at && {
        let triangles: usize = coarse.iter().map(|kept| kept.triangles.len()).sum();
        doubtful.len() as f64 > WIDE * triangles as f64
    };
    // A sample proves that triangles cross, not that none do.
    if pairs.is_empty() && step > 1 {
        (crossings, pairs) = confirmed(pieces, doubtful.iter());
    }
    Found {
        fold,
        crossings,
        folds,
        pairs,
        is_wide,
    }
}

/// The pairs that cross after their cells are cut, and the cells of each.
fn confirmed<'d>(
    pieces: &[Piece<'_>],
    doubtful: impl Iterator<Item = &'d [(u32, u32); 2]>,
) -> (Worst, Vec<[(u32, u32); 2]>) {
    let mut cells = vec![Vec::new(); pieces.len()];
    for &(face, cell) in doubtful.flatten() {
        cells[face as usize].push(cell);
    }
    if cells.iter().all(Vec::is_empty) {
        return Default::default();
    }
    let finer = pieces.iter().zip(&cells);
    let finer: Vec<Kept> = finer.map(|(piece, cells)| piece.finer(cells)).collect();
    overlaps(&finer, |face, cell, place| {
        !pieces[face].ends_at(cell, place)
    })
}

/// A face as far as it is kept, and its triangles, cut along the knots of its surface.
struct Piece<'a> {
    surface: &'a NurbsSurface,
    /// The shell that the face belongs to: others may pass through it.
    shell: usize,
    keeps: Box<dyn Fn(DVec2) -> bool + Sync + 'a>,
    grid: Grid,
    mesh: Tessellation,
    /// The cell of each triangle.
    cells: Vec<u32>,
}

/// The triangles of a face that lie in it with all corners, and their cells. Along its loops a strip as wide as a triangle
/// is left out.
#[derive(Default)]
struct Kept {
    shell: usize,
    corners: Vec<[DVec3; 3]>,
    triangles: Vec<[u32; 3]>,
    cells: Vec<u32>,
}

impl<'a> Piece<'a> {
    /// Chords as in a model of this diagonal.
    fn new(
        surface: &'a NurbsSurface,
        shell: usize,
        diagonal: f64,
        keeps: Box<dyn Fn(DVec2) -> bool + Sync + 'a>,
    ) -> Result<Self> {
        let grid = Grid::new(surface, SHARE * rounded(diagonal, surface), TRIANGLES)?;
        let grid = grid.uneven(surface);
        let (mesh, cells) = grid.mesh(surface);
        Ok(Self {
            surface,
            shell,
            keeps,
            grid,
            mesh,
            cells,
        })
    }

    fn kept(&self) -> Kept {
        Kept::new(self.shell, (&self.mesh, &self.cells), &self.keeps)
    }

    /// Whether the face ends before a place near one of its cells: the nearest point of the surface is on a side of its
    /// domain. The chords of a face whose sides bend reach over them, into its neighbours.
    fn ends_at(&self, cell: u32, place: DVec3) -> bool {
        let [low, high] = self.grid.corners(cell);
        let [(a, b), (c, d)] = self.surface.domain();
        let (least, most) = (DVec2::new(a, c), DVec2::new(b, d));
        let mut at = low.midpoint(high);
        for _ in 0..FOOT_STEPS {
            let s = self.surface.derivatives(at.x, at.y);
            let off = place - s.point;
            let [uu, uv, vv] = [s.du.dot(s.du), s.du.dot(s.dv), s.dv.dot(s.dv)];
            let determinant = uu * vv - uv * uv;
            if determinant <= 0.0 {
                return false;
            }
            let [p, q] = [off.dot(s.du), off.dot(s.dv)];
            let step = DVec2::new(vv * p - uv * q, uu * q - uv * p) / determinant;
            at = (at + step).clamp(least, most);
        }
        at.x <= a || at.x >= b || at.y <= c || at.y >= d
    }

    /// Smaller triangles in these cells and those around them.
    fn finer(&self, cells: &[u32]) -> Kept {
        let marks = self.grid.around(cells.iter().copied());
        let (mesh, cells) = self.grid.finer(self.surface, &marks, PARTS);
        Kept::new(self.shell, (&mesh, &cells), &self.keeps)
    }
}

impl Kept {
    fn new(
        shell: usize,
        (mesh, cells): (&Tessellation, &[u32]),
        keeps: &(dyn Fn(DVec2) -> bool + Sync),
    ) -> Self {
        let inside = each(mesh.parameters.len(), |k| keeps(mesh.parameters[k]));
        let mut kept = Self {
            shell,
            ..Self::default()
        };
        for (&triangle, &cell) in mesh.triangles.iter().zip(cells) {
            if triangle.iter().all(|&k| inside[k as usize]) {
                kept.triangles.push(triangle);
                kept.corners.push(triangle.map(|k| mesh.points[k as usize]));
                kept.cells.push(cell);
            }
        }
        kept
    }
}

/// Counts the pairs of triangles of a shell without a common point that cross, and tells the face and the cell of each. Those
/// of different faces count where `reaches` says that both faces, by index and cell, reach the place.
fn overlaps(
    faces: &[Kept],
    reaches: impl Fn(usize, u32, DVec3) -> bool + Sync,
) -> (Worst, Vec<[(u32, u32); 2]>) {
    let items: Vec<(usize, usize)> = faces
        .iter()
        .enumerate()
        .flat_map(|(face, kept)| (0..kept.corners.len()).map(move |k| (face, k)))
        .collect();
    let bounds = |&(face, k): &(usize, usize)| {
        let t = &faces[face].corners[k];
        [t[0].min(t[1]).min(t[2]), t[0].max(t[1]).max(t[2])]
    };
    let boxes: Vec<[DVec3; 2]> = items.iter().map(bounds).collect();
    let found = Tree::new(&boxes).filter_pairs(|a, b| {
        let ((face, one), (other, two)) = (items[a], items[b]);
        if faces[face].shell != faces[other].shell {
            return None;
        }
        let triangles = [(face, one), (other, two)].map(|(f, k)| faces[f].triangles[k]);
        if face == other && triangles[0].iter().any(|k| triangles[1].contains(k)) {
            return None;
        }
        let place = crossing(&faces[face].corners[one], &faces[other].corners[two])?;
        let cells = [faces[face].cells[one], faces[other].cells[two]];
        let counts =
            face == other || reaches(face, cells[0], place) && reaches(other, cells[1], place);
        let number = |face: usize| u32::try_from(face).unwrap_or(u32::MAX);
        counts.then(|| (place, [(number(face), cells[0]), (number(other), cells[1])]))
    });
    let mut worst = Worst::default();
    for &(place, [(face, _), _]) in &found {
        worst.count(Some(place), Some(face as usize), None);
    }
    (worst, found.into_iter().map(|(_, cells)| cells).collect())
}

/// The largest angle by which the normal turns at once inside a face, and where in (u, v) it is over the limit. Where it differs
/// by more than the limit between the corners of a triangle, the way between them is halved towards the larger turn.
fn folds(pieces: &[Piece<'_>], kept: &[Kept]) -> (Worst, Vec<(u32, DVec2)>) {
    let (mut worst, mut places) = (Worst::default(), Vec::new());
    let limit = math::cos(FOLD.to_radians());
    for (face, (piece, kept)) in pieces.iter().zip(kept).enumerate() {
        let mesh = &piece.mesh;
        let sides = kept
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(|side| side.map(|k| k as usize)));
        let is_sharp = |&[a, b]: &[usize; 2]| {
            let [n, m] = [a, b].map(|k| mesh.normals[k]);
            a <= b && n != DVec3::ZERO && m != DVec3::ZERO && n.dot(m) < limit
        };
        let sides: Vec<[usize; 2]> = sides.filter(is_sharp).collect();
        // Where S_u x S_v is all but nothing, at poles, its direction is that of rounding.
        let least = LEAST_ELEMENT * scale_of(piece.surface).element_product();
        let turns = each(sides.len(), |k| {
            let ends = sides[k].map(|k| mesh.parameters[k]);
            turn(piece.surface, least, ends)
        });
        for (angle, place) in turns {
            let point = piece.surface.point(place.x, place.y);
            worst = worst.larger(Worst::at(angle, point, face));
            if angle > FOLD {
                places.push((u32::try_from(face).unwrap_or(u32::MAX), place));
            }
        }
    }
    (worst, places)
}

/// By how many degrees the normal turns in a short piece between two places, and where. Normals are those where `|S_u x S_v|` is more
/// than `least`.
fn turn(surface: &NurbsSurface, least: f64, [mut a, mut b]: [DVec2; 2]) -> (f64, DVec2) {
    let normal = |p: DVec2| {
        let d = surface.derivatives(p.x, p.y);
        let normal = d.du.cross(d.dv);
        if normal.length() > least {
            normal.normalize_or_zero()
        } else {
            DVec3::ZERO
        }
    };
    let angle = math::angle_between;
    let (mut n, mut m) = (normal(a), normal(b));
    if n == DVec3::ZERO || m == DVec3::ZERO {
        return (0.0, a);
    }
    for _ in 0..24 {
        let middle = a.midpoint(b);
        let between = normal(middle);
        if between == DVec3::ZERO {
            break;
        }
        if angle(n, between) >= angle(between, m) {
            (b, m) = (middle, between);
        } else {
            (a, n) = (middle, between);
        }
    }
    (angle(n, m).to_degrees(), a.midpoint(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::{ControlNet, KnotVector};

    /// A square of control points that turns back over itself; each layer has bumps of this height towards and away from the other,
    /// in its first columns.
    fn doubled(height: f64, columns: usize) -> NurbsSurface {
        let n = 40;
        let net = ControlNet::from_fn(2 * n, n, |i, j| {
            let (x, layer) = if i < n { (i, 0) } else { (2 * n - 1 - i, 1) };
            let bump = match (x / 2 + j / 2 + layer) % 2 {
                _ if j >= columns => 0.0,
                0 => height,
                _ => -height,
            };
            DVec3::new(x as f64, j as f64, layer as f64 + bump)
        });
        let knots = |n| KnotVector::uniform(3, n).unwrap();
        NurbsSurface::new(knots(2 * n), knots(n), net.unwrap(), None).unwrap()
    }

    #[test]
    fn layers_that_pass_through_each_other_all_over_cross_widely() {
        let searched = |height, columns| {
            let surface = doubled(height, columns);
            let [low, high] = surface.bounding_box();
            crossings(&surface, low.distance(high), &|_| true)
        };
        // However few are looked at, what crosses is found.
        let surface = doubled(1.5, 2);
        let piece = || Piece::new(&surface, 0, 60.0, Box::new(|_: DVec2| true)).unwrap();
        let [one, all] = [1, usize::MAX].map(|most| found(&[piece()], most).pairs);
        assert!(!one.is_empty() && 10 * one.len() < all.len());
        assert!(searched(0.3, 40).is_empty());
        let [few, all] = [2, 40].map(|columns| searched(1.5, columns));
        assert!(!few.is_empty() && !few.is_wide());
        assert!(!all.is_empty() && all.is_wide());
        // A sample still lists places all over.
        let places = all.places();
        for quarter in 0..4 {
            let part = 0.25 * f64::from(quarter);
            assert!(places.iter().any(|p| (part..part + 0.25).contains(&p.y)));
        }
    }
}
