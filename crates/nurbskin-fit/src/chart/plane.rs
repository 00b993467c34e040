//! Charts of sheets by projection onto a plane.
//!
//! The direction d is sought from which the largest share of the sheet is single-valued: normals n with n · d < cos 85°
//! are steep, with n · d < 0 turned away. Starting from the mean normal and from principal axes, d moves towards the
//! steepest normals, n weighted with exp(-4 n · d), as the axis of the smallest cone around all normals would. Of
//! clouds, whose normals have uncertain sides, points that fall next to points of another layer count as turned away.
//!
//! Source: height fields over a plane of the normals; the search is ours.

use super::rectangle::{convex_hull, robust_ends, smallest_rectangle};
use super::{Chart, domain, outline};
use nurbskin_geometry::unit::percent;
use nurbskin_scan::mesh::subset::subset;

pub use super::domain::{PlaneChart, RECTANGULAR, Sides};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::normals::{principal_axes, symmetric_eigen};

/// Cosine of 85 degrees: a part of a sheet steeper than this against the plane has no place on it. Trial: not recorded.
/// A larger angle squeezes walls to nothing in the chart.
const STEEP_COSINE: f64 = 0.087_155_742_747_658_17;
/// Largest share of a mesh that may face away from the plane: ragged rims and stray bits. Trial: real sheets (faces, a
/// car's panel) show up to 4 %, tubes and closed shapes 45 % and more.
const MAX_TURNED_MESH: f64 = 0.08;
/// Largest share of the points that may lie in a second layer. Trial: real sheets show up to 5 %, other shapes 45 % and
/// more.
const MAX_DOUBLED: f64 = 0.12;
/// Distance of two points across the surface, in sigma of the noise, beyond which they lie in different layers for
/// certain. Guard: noise throws no two points of one layer so far apart (4.2 sigma of their difference).
const LAYER_SIGMAS: f64 = 6.0;
/// Largest share of a cloud whose normals may point backward; their sides are a guess. Trial: sheets show up to 7 %,
/// closed shapes 30 % and more.
const MAX_TURNED_CLOUD: f64 = 0.2;
/// Largest share of a scan that may be steep against the plane. Trial: not recorded.
const MAX_STEEP: f64 = 0.15;
/// Neighbours on the plane that are tested for a second layer; twice as many in space give the reach. Trial: not
/// recorded.
const LAYER_NEIGHBOURS: usize = 5;
/// Points of a larger cloud on which the decision rests. Guard: bounds its time; shares are then known to 0.3 %.
const DECISION_POINTS: usize = 30_000;
/// Neighbours in space whose mean distance is the spacing. Derived: a point of a square lattice has four at one
/// spacing.
const SPACING_NEIGHBOURS: usize = 4;
/// Spacing of the outline's raster for points on lines, in spacings of the scan, which are 0.7 of the distance between
/// lines there. Trial: not recorded. A smaller one leaves the gaps between lines open.
const LINE_SPACING_FACTOR: f64 = 1.2;
/// Side of the boxes in which the spacing of a larger cloud is measured, in about one spacing. Trial: not recorded; a
/// box holds some 64 points of a surface.
const SPACING_BOX: f64 = 8.0;
/// Margin of these boxes, in the same unit: points nearer to a side may miss neighbours. Guard: twice the distance of
/// the nearest neighbours.
const SPACING_MARGIN: f64 = 2.0;
/// Fewest points in the boxes for a median; with fewer, all points are measured. Guard: a median of that number is known to
/// a few per cent.
const MIN_SPACING_POINTS: usize = 1000;
/// Rounds that centre a direction among the normals. Guard: each direction on the way is judged, so that a surplus does
/// no harm.
const CENTRING_ROUNDS: usize = 12;
/// Cosine against the direction below which a normal does not pull it. Trial: not recorded; normals turned away are
/// spurious, or no such direction exists.
const CENTRING_COSINE: f64 = -0.2;
/// Exponent k of the pull exp(-k cos) of a normal: the steeper, the stronger. Trial: not recorded. With 0 the direction
/// is the mean normal; a large one follows single normals.
const CENTRING_EXPONENT: f64 = 4.0;
/// Length of the step towards the pull, against a unit direction. Trial: not recorded.
const CENTRING_STEP: f64 = 0.5;
/// Distance of two neighbours on the plane, in the reach of the neighbours in space, above which they may lie in
/// different layers. Trial: not recorded.
const LAYER_DISTANCE: f64 = 1.3;
/// Least offset from the tangent plane of such a neighbour, as a share of its distance. Trial: not recorded (sin 30°);
/// on a steep sheet neighbours lie in the tangent plane.
const LAYER_OFFSET: f64 = 0.5;
/// Length of the mean normal below which a refused mesh with one rim is described as closed. Trial: not recorded; it
/// only words the refusal.
const CLOSED_MEAN_NORMAL: f64 = 0.3;
/// Doubled share below which a refused cloud is described as a sheet that turns over. Trial: not recorded; it only
/// words the refusal.
const TURNING_DOUBLED: f64 = 0.3;
/// Smallest eigenvalue of the mean of n nᵀ below which a refused cloud is described as a tube (0 for a straight one).
/// Trial: not recorded; it only words the refusal.
const TUBE_EIGENVALUE: f64 = 0.05;
/// Length of a rim, as a share of the diagonal, from which it is counted in a refusal. Trial: not recorded; it only
/// words the refusal.
const MIN_RIM_LENGTH: f64 = 0.1;

/// Charts a scan by projection onto its best plane: along a direction in which the scan is single-valued, and within
/// the smallest rectangle around the projection, u along its longer side. The rectangle around a round outline, which
/// has no sides, lies along the axes of the coordinates. If the scan does not fill its rectangle, the borders of the
/// domain follow the outline, and (u, v) come from a plane surface without folds that fills it. `S_u x S_v` points to
/// the side of the normals.
///
/// The test is exact for a mesh: no triangle may face away. The normals of a cloud have uncertain sides and only count
/// if very many face away; a second layer shows by points that are neighbours after projection but far apart in space.
/// Small separate parts are charted but do not take part in the decision, and points beyond the borders are put on
/// them. The decision for a cloud of more than 30 000 points rests on a sample of that size, which is independent of
/// their order. O(n), about 0.5 us per point.
///
/// # Errors
/// [`Error::Unsupported`] for scans that no plane charts, with their likely shape: several parts, closed, tube-like, or
/// turning over. [`Error::Invalid`] if there are no points or the lists do not correspond.
///
/// ```
/// use nurbskin_fit::chart::plane::chart_on_plane;
/// use nurbskin_geometry::progress::Silent;
/// use nurbskin_scan::{CleanOptions, clean, simulate};
/// let face = simulate::scan(simulate::Shape::Face, &simulate::ScanOptions::default())?;
/// let scan = clean(&face.scan, &CleanOptions::default(), &Silent)?;
/// let chart = chart_on_plane(&scan)?;
/// assert!((chart.size[0] - 200.0).abs() < 2.0 && (chart.size[1] - 150.0).abs() < 2.0);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn chart_on_plane(scan: &CleanScan) -> Result<Chart> {
    plane_chart(scan, Sides::Outline).map(|found| found.chart)
}

/// As [`chart_on_plane`] with these sides, and with the points that lie beyond the borders.
///
/// # Errors
/// As [`chart_on_plane`].
pub fn plane_chart(scan: &CleanScan, sides: Sides) -> Result<PlaneChart> {
    let CleanScan {
        points,
        normals,
        triangles,
        parts,
        ..
    } = scan;
    if points.is_empty() || normals.len() != points.len() || parts.of.len() != points.len() {
        return Err(Error::invalid(
            "charting needs points, and a normal and a part for each of them",
        ));
    }
    super::check_one_part(parts)?;
    // 1. The decision rests on the largest part.
    let kept = |k: usize| parts.of[k] == 0;
    let main: Vec<usize> = (0..points.len()).filter(|&k| kept(k)).collect();
    let faces: Vec<[usize; 3]> = triangles
        .iter()
        .map(|t| t.map(|k| k as usize))
        .filter(|t| t.iter().all(|&k| k < points.len() && kept(k)))
        .collect();
    let few = subset(points, DECISION_POINTS, |k| {
        kept(k) && points[k].is_finite()
    });
    let few: Vec<usize> = few.into_iter().map(|k| k as usize).collect();
    let sheet = if faces.is_empty() {
        Sheet::new(points, normals, &few, &faces)
    } else {
        Sheet::new(points, normals, &main, &faces)
    };
    // 2. The direction in which the smallest share is steep or turned away.
    let direction = sheet.best_direction();
    let steep = sheet.part(direction, STEEP_COSINE);
    let [doubled, clear] = sheet.doubled(direction, normals, scan.noise);
    let turned = sheet.turned_away(direction);
    let allowed = if faces.is_empty() {
        MAX_TURNED_CLOUD
    } else {
        MAX_TURNED_MESH
    };
    if doubled > MAX_DOUBLED || turned > allowed || steep > MAX_STEEP {
        return Err(Error::Unsupported(
            sheet.refusal(doubled.max(turned).max(steep), doubled),
        ));
    }
    let wrong = if faces.is_empty() { doubled } else { turned };
    // 3. The rectangle.
    let across = direction.any_orthonormal_vector();
    let frame = [across, direction.cross(across)];
    let project = |k: usize| DVec2::new(points[k].dot(frame[0]), points[k].dot(frame[1]));
    let flat: Vec<DVec2> = main.iter().map(|&k| project(k)).collect();
    // A round outline has no sides: it is aligned with the coordinate axis that is most nearly parallel to the plane.
    let shadow = |axis: DVec3| DVec2::new(axis.dot(frame[0]), axis.dot(frame[1]));
    let flattest = DVec3::AXES.map(shadow).into_iter().rev();
    let flattest = flattest.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let usual = flattest.and_then(DVec2::try_normalize).unwrap_or(DVec2::X);
    let axis = smallest_rectangle(&convex_hull(&flat), usual);
    let mut long = axis.x * frame[0] + axis.y * frame[1];
    // The direction of the longer side: its largest coordinate is positive.
    if long[long.abs().max_position()] < 0.0 {
        long = -long;
    }
    let wide = direction.cross(long);
    let ends = |along: DVec3| robust_ends(main.iter().map(|&k| points[k].dot(along)).collect());
    let (u, v) = (ends(long), ends(wide));
    if u[1] <= u[0] || v[1] <= v[0] {
        return Err(Error::invalid(
            "the scan has no width; a line or a single spot is not a surface",
        ));
    }
    let size = DVec2::new(u[1] - u[0], v[1] - v[0]);
    let place = |p: &DVec3| DVec2::new(p.dot(long) - u[0], p.dot(wide) - v[0]);
    let flat: Vec<DVec2> = points.iter().map(place).collect();
    let reason = format!(
        "open sheet: {} of the scan faces one side of its best-fit plane",
        percent(1.0 - wrong)
    );
    // 4. The outline, of the largest part alone.
    let nowhere = DVec2::splat(f64::MAX);
    let drawn = |k: usize| if kept(k) { flat[k] } else { nowhere };
    let picture = outline::Picture {
        points: &(0..points.len()).map(drawn).collect::<Vec<_>>(),
        cosines: &normals
            .iter()
            .map(|n| n.dot(direction).abs())
            .collect::<Vec<_>>(),
        triangles: &faces,
        spacing: match scan.is_on_lines() {
            true => LINE_SPACING_FACTOR * scan.spacing,
            false => spacing(points, &main, few.len()),
        },
    };
    let (chart, mut beyond, filled) = domain::chart(&flat, size, &picture, sides, reason)?;
    // Of doubled regions, such as a hem, the layer that faces along the direction is the sheet.
    for (beyond, away) in beyond
        .iter_mut()
        .zip(facing_away(points, &faces, direction))
    {
        *beyond |= away;
    }
    Ok(PlaneChart {
        chart,
        beyond,
        doubtful: if faces.is_empty() { clear } else { turned },
        frame: [long, wide, direction],
        filled,
    })
}

/// The points whose triangles all face away from a direction.
fn facing_away(points: &[DVec3], faces: &[[usize; 3]], direction: DVec3) -> Vec<bool> {
    let (mut along, mut away) = (vec![false; points.len()], vec![false; points.len()]);
    for t in faces {
        let [a, b, c] = t.map(|k| points[k]);
        let side = match (b - a).cross(c - a).dot(direction) < 0.0 {
            true => &mut away,
            false => &mut along,
        };
        t.iter().for_each(|&k| side[k] = true);
    }
    away.iter()
        .zip(along)
        .map(|(away, along)| *away && !along)
        .collect()
}

/// Median over the points of the mean distance to their four nearest neighbours. Of many points, only those well inside
/// of some boxes are measured, which have all their neighbours. `few` is a sufficient number of points. O(n).
fn spacing(points: &[DVec3], main: &[usize], few: usize) -> f64 {
    let all = || main.iter().map(|&k| points[k]);
    if main.len() <= 2 * few {
        return median_distance(&all().collect::<Vec<_>>(), |_| true);
    }
    // 1. A rough spacing from a sample: the number of points grows with the inverse square of the spacing.
    let some: Vec<DVec3> = main.iter().map(|&k| points[k]).collect();
    let sample = subset(&some, few, |_| true);
    let sample: Vec<DVec3> = sample.iter().map(|&k| some[k as usize]).collect();
    let share = sample.len() as f64 / some.len() as f64;
    let about = median_distance(&sample, |_| true) * share.sqrt();
    // 2. Boxes of a lattice in space, chosen by their position.
    let side = SPACING_BOX * about;
    let boxes = |p: DVec3| (p / side).floor();
    let chosen = |p: &DVec3| {
        let mixed = boxes(*p).dot(DVec3::new(0.754_877_666, 0.569_840_290, 0.321_928_095));
        (mixed - mixed.floor()) < share
    };
    let inside: Vec<DVec3> = some.iter().copied().filter(chosen).collect();
    let margin = SPACING_MARGIN / SPACING_BOX;
    let deep = |p: DVec3| {
        let at = p / side - boxes(p);
        at.min_element() > margin && at.max_element() < 1.0 - margin
    };
    if inside.iter().filter(|p| deep(**p)).count() >= MIN_SPACING_POINTS {
        median_distance(&inside, deep)
    } else {
        median_distance(&some, |_| true)
    }
}

/// Median over the points for which `asked` holds of the mean distance to their four nearest neighbours.
fn median_distance(cloud: &[DVec3], asked: impl Fn(DVec3) -> bool) -> f64 {
    let table = Neighbours::new(cloud).table(SPACING_NEIGHBOURS);
    let mut mean: Vec<f64> = (0..cloud.len())
        .filter(|&k| asked(cloud[k]))
        .map(|k| {
            let near = table.of(k);
            let distances = near.iter().map(|&j| cloud[j as usize].distance(cloud[k]));
            distances.sum::<f64>() / near.len().max(1) as f64
        })
        .collect();
    median_in_place(&mut mean)
}

/// The part of a scan on which the decision rests: elements with a normal and a weight.
struct Sheet<'a> {
    points: &'a [DVec3],
    main: &'a [usize],
    faces: &'a [[usize; 3]],
    /// Unit normals and weights (shares of the whole) of the triangles, or of the points of a cloud.
    elements: Vec<(DVec3, f64)>,
}

impl<'a> Sheet<'a> {
    fn new(
        points: &'a [DVec3],
        normals: &[DVec3],
        main: &'a [usize],
        faces: &'a [[usize; 3]],
    ) -> Self {
        let mut elements: Vec<(DVec3, f64)> = if faces.is_empty() {
            main.iter().map(|&k| (normals[k], 1.0)).collect()
        } else {
            faces
                .iter()
                .map(|t| t.map(|k| points[k]))
                .map(|[a, b, c]| (b - a).cross(c - a))
                .map(|area| (area.normalize_or_zero(), area.length()))
                .collect()
        };
        let total: f64 = elements.iter().map(|e| e.1).sum();
        for element in &mut elements {
            element.1 /= total;
        }
        Self {
            points,
            main,
            faces,
            elements,
        }
    }

    /// The direction with the smallest steep share of the sheet; what is turned away counts twice.
    fn best_direction(&self) -> DVec3 {
        let mean: DVec3 = self.elements.iter().map(|(n, w)| *n * *w).sum();
        let [_, _, common] = self.spread();
        let around = self.main.iter().map(|&k| self.points[k]);
        let (_, axes) = principal_axes(around);
        let starts = [mean, common.1, axes[0].1, axes[1].1, axes[2].1];
        let mut best = (f64::INFINITY, DVec3::Z);
        for start in starts {
            let Some(start) = start.try_normalize() else {
                continue;
            };
            let start = if start.dot(mean) < 0.0 { -start } else { start };
            for direction in self.centred(start) {
                let wrong = self.part(direction, STEEP_COSINE) + self.part(direction, 0.0);
                if wrong < best.0 {
                    // Here the sides of a cloud's normals count for the first time.
                    let side = if direction.dot(mean) < 0.0 { -1.0 } else { 1.0 };
                    best = (wrong, side * direction);
                }
            }
        }
        best.1
    }

    /// Directions that approach the axis of the smallest cone around all normals: each step is a weighted mean with
    /// larger weights for steeper normals.
    fn centred(&self, start: DVec3) -> Vec<DVec3> {
        let mut directions = vec![start];
        let mut direction = start;
        for _ in 0..CENTRING_ROUNDS {
            let pull = |(n, w): &(DVec3, f64)| {
                let n = if self.faces.is_empty() {
                    *n * n.dot(direction).signum()
                } else {
                    *n
                };
                // Normals that are turned away do not pull: they are spurious, or there is no such direction.
                let cosine = n.dot(direction);
                if cosine > CENTRING_COSINE {
                    n * (w * math::exp(-CENTRING_EXPONENT * cosine))
                } else {
                    DVec3::ZERO
                }
            };
            let sum: DVec3 = self.elements.iter().map(pull).sum();
            direction =
                (direction + CENTRING_STEP * sum.normalize_or_zero()).normalize_or(direction);
            directions.push(direction);
        }
        directions
    }

    /// Share of the sheet whose normals have a cosine below `least` against `direction`; for a cloud, whose normals
    /// have uncertain sides, the absolute cosine.
    fn part(&self, direction: DVec3, least: f64) -> f64 {
        let cosine = |n: DVec3| {
            let cosine = n.dot(direction);
            if self.faces.is_empty() {
                cosine.abs()
            } else {
                cosine
            }
        };
        let below = self.elements.iter().filter(|(n, _)| cosine(*n) < least);
        below.map(|(_, w)| w).sum()
    }

    /// Share of the sheet that faces away from `direction`.
    fn turned_away(&self, direction: DVec3) -> f64 {
        let away = self.elements.iter().filter(|(n, _)| n.dot(direction) < 0.0);
        away.map(|(_, w)| w).sum()
    }

    /// Share of the points that lie, after projection, next to a point of another layer: a point that is farther away
    /// than the neighbours in space, and off the tangent plane by more than half of its distance, which excludes
    /// neighbours on a steep sheet.
    ///
    /// The second number is the share whose layers are farther apart than noise can explain.
    fn doubled(&self, direction: DVec3, normals: &[DVec3], noise: f64) -> [f64; 2] {
        let cloud: Vec<DVec3> = self.main.iter().map(|&k| self.points[k]).collect();
        let flat: Vec<DVec3> = cloud
            .iter()
            .map(|p| p.reject_from_normalized(direction))
            .collect();
        let in_space = Neighbours::new(&cloud).table(2 * LAYER_NEIGHBOURS);
        let on_plane = Neighbours::new(&flat).table(LAYER_NEIGHBOURS);
        let mut counts = [0.0; 2];
        for (k, p) in cloud.iter().enumerate() {
            let offset = |j: &u32| cloud[*j as usize] - *p;
            let reach = in_space.of(k).last().map_or(0.0, |j| offset(j).length());
            let apart = |offset: DVec3| {
                let (distance, off) = (offset.length(), offset.dot(normals[self.main[k]]).abs());
                let layered = distance > LAYER_DISTANCE * reach && off > LAYER_OFFSET * distance;
                if layered { off } else { 0.0 }
            };
            let apart = on_plane.of(k).iter().map(offset).map(apart);
            let farthest = apart.fold(0.0, f64::max);
            counts[0] += f64::from(u8::from(farthest > 0.0));
            counts[1] += f64::from(u8::from(farthest > LAYER_SIGMAS * noise));
        }
        counts.map(|count| count / cloud.len() as f64)
    }

    /// Eigenvalues and axes of the mean of n n^T.
    fn spread(&self) -> [(f64, DVec3); 3] {
        let mut square = DVec3::ZERO;
        let mut mixed = DVec3::ZERO;
        for &(n, w) in &self.elements {
            square += w * n * n;
            mixed += w * DVec3::new(n.x * n.y, n.x * n.z, n.y * n.z);
        }
        symmetric_eigen(square.x, square.y, square.z, mixed.x, mixed.y, mixed.z)
    }

    /// The reason of a refusal, with the likely shape of the scan; `wrong` is the share without a place on the plane,
    /// `doubled` the share in a second layer.
    fn refusal(&self, wrong: f64, doubled: f64) -> String {
        let mean: DVec3 = self.elements.iter().map(|(n, w)| *n * *w).sum();
        let [(least, _), ..] = self.spread();
        let looks = match self.rims() {
            Some(0) => "a closed shape".to_owned(),
            Some(2) => "a tube".to_owned(),
            Some(1) if mean.length() < CLOSED_MEAN_NORMAL => {
                "a closed shape with one opening".to_owned()
            }
            Some(1) => "a sheet that turns over".to_owned(),
            Some(many) => format!("a shape with {many} openings"),
            None if doubled < TURNING_DOUBLED => "a sheet that turns over".to_owned(),
            // The normals of a straight tube are all perpendicular to its axis.
            None if least < TUBE_EIGENVALUE => "a tube".to_owned(),
            None => "a closed shape or a bent tube".to_owned(),
        };
        format!(
            "the scan looks like {looks}: whichever way it is seen, {:.0} % of it is turned away or hidden; only scans \
             that project onto a plane are charted yet",
            (100.0 * wrong).max(1.0)
        )
    }

    /// Number of rims longer than a tenth of the mesh's diagonal; `None` for a cloud.
    fn rims(&self) -> Option<usize> {
        if self.faces.is_empty() {
            return None;
        }
        let mut edges: Vec<(usize, usize)> = self
            .faces
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        edges.sort_unstable();
        let single = edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        let rim: Vec<(usize, usize)> = single.map(|same| same[0]).collect();
        let mut parents: Vec<usize> = (0..self.points.len()).collect();
        let root = |parents: &mut Vec<usize>, mut k: usize| {
            while parents[k] != k {
                parents[k] = parents[parents[k]];
                k = parents[k];
            }
            k
        };
        for &(a, b) in &rim {
            let (a, b) = (root(&mut parents, a), root(&mut parents, b));
            parents[a.max(b)] = a.min(b);
        }
        let mut lengths = vec![0.0; self.points.len()];
        for &(a, b) in &rim {
            lengths[root(&mut parents, a)] += self.points[a].distance(self.points[b]);
        }
        let (low, high) = self
            .main
            .iter()
            .map(|&k| self.points[k])
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let least = MIN_RIM_LENGTH * low.distance(high);
        Some(lengths.iter().filter(|&&length| length > least).count())
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod outline_tests;
