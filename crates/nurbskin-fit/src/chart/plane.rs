//! Scans that project onto their best plane.

use super::rectangle::{convex_hull, robust_ends, smallest_rectangle};
use super::{Chart, domain, outline};
use nurbskin_geometry::unit::percent;
use nurbskin_scan::mesh::subset::subset;

pub use super::domain::{PlaneChart, RECTANGULAR, Sides};
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::normals::{principal_axes, symmetric_eigen};

/// Cosine of 85 degrees: a sheet steeper than this against the plane has no place on it.
const STEEP: f64 = 0.087_155_742_747_658_17;
/// Part of a mesh that may be turned away: ragged rims and stray bits. Real sheets (faces, a car's panel) show up to
/// 4 %, tubes and closed shapes 45 % and more.
const TURNED: f64 = 0.08;
/// Part of the points that may lie in a second layer. Real sheets show up to 5 %, others 45 % and more.
const DOUBLED: f64 = 0.12;
/// Sigma by which two points of one layer are not thrown apart.
const THROWN: f64 = 6.0;
/// Part of a cloud whose normals may point backward, since normals of clouds are turned by guess: sheets show up to
/// 7 %, closed shapes 30 % and more.
const UNCERTAIN: f64 = 0.2;
/// Part of a scan that may be steep.
const STEEP_PART: f64 = 0.15;
/// Of larger clouds so many points decide.
const DECISIVE: usize = 30_000;
/// Neighbours in space whose mean distance is the spacing.
const NEAREST: usize = 4;
/// For points on lines: so many spacings of the scan, which are 0.7 of the distance between lines.
const ON_LINES: f64 = 1.2;
/// Of larger clouds the spacing is measured in some boxes of about so many spacings, away from their sides by so many.
const BOX: f64 = 8.0;
const INSIDE: f64 = 2.0;
/// So many points must have been measured.
const MEASURED: usize = 1000;

/// Charts a scan by projection onto its best plane: a direction is sought along which the scan is single-valued, the
/// projected points are turned so that the rectangle around them is smallest, u along its longer side; those with a round
/// outline, which has no sides, so that it lies along the axes of their coordinates. Where the scan does
/// not fill that rectangle, the borders of the domain follow the scan's outline, and (u, v) come from a plane surface
/// without folds that fills it.
/// `S_u x S_v` looks to the side of the normals.
///
/// The triangles of a scan make the test exact where they exist: nothing of a mesh may face away. The sides of a cloud's
/// normals are uncertain and only count where very many face away; points that lie on each other after projection though
/// far apart give a second layer away. Separate pieces that are scraps take part in the chart but do not decide on it, and
/// what lies beyond the borders is put on them. Of a cloud of more than 30 000 points so many decide, which do not
/// depend on their order. O(n), about 0.5 us per point.
///
/// # Errors
/// [`Error::Unsupported`] for what no plane charts, with what it looks like: several parts, closed, tube-like, or
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

/// As [`chart_on_plane`] with the sides asked for, and which points lie beyond the borders.
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
    // 1. What decides: the largest part.
    let kept = |k: usize| parts.of[k] == 0;
    let main: Vec<usize> = (0..points.len()).filter(|&k| kept(k)).collect();
    let faces: Vec<[usize; 3]> = triangles
        .iter()
        .map(|t| t.map(|k| k as usize))
        .filter(|t| t.iter().all(|&k| k < points.len() && kept(k)))
        .collect();
    let few = subset(points, DECISIVE, |k| kept(k) && points[k].is_finite());
    let few: Vec<usize> = few.into_iter().map(|k| k as usize).collect();
    let sheet = if faces.is_empty() {
        Sheet::new(points, normals, &few, &faces)
    } else {
        Sheet::new(points, normals, &main, &faces)
    };
    // 2. The direction along which least is wrong.
    let direction = sheet.best_direction();
    let steep = sheet.part(direction, STEEP);
    let [doubled, clear] = sheet.doubled(direction, normals, scan.noise);
    let turned = sheet.turned_away(direction);
    let allowed = if faces.is_empty() { UNCERTAIN } else { TURNED };
    if doubled > DOUBLED || turned > allowed || steep > STEEP_PART {
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
    // A round outline has no sides: the axis of the scan's coordinates that lies flattest stands for them.
    let shadow = |axis: DVec3| DVec2::new(axis.dot(frame[0]), axis.dot(frame[1]));
    let flattest = DVec3::AXES.map(shadow).into_iter().rev();
    let flattest = flattest.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let usual = flattest.and_then(DVec2::try_normalize).unwrap_or(DVec2::X);
    let axis = smallest_rectangle(&convex_hull(&flat), usual);
    let mut long = axis.x * frame[0] + axis.y * frame[1];
    // The longer side's sense: its largest coordinate is positive.
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
    // 4. What of it the scan fills: only the part that decides is drawn.
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
            true => ON_LINES * scan.spacing,
            false => spacing(points, &main, few.len()),
        },
    };
    let (chart, mut beyond, filled) = domain::chart(&flat, size, &picture, sides, reason)?;
    // Of what lies doubled, as a hem, the sheet is what faces along.
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

/// The points of which all triangles face away from a direction.
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

/// Mean distance to the four nearest neighbours, in the median over these points; of many points, over those well inside
/// of some boxes, which have all their neighbours. `few` is the number of points that would do. O(n).
fn spacing(points: &[DVec3], main: &[usize], few: usize) -> f64 {
    let all = || main.iter().map(|&k| points[k]);
    if main.len() <= 2 * few {
        return median_distance(&all().collect::<Vec<_>>(), |_| true);
    }
    // 1. About: the area of the points is that of as many squares.
    let some: Vec<DVec3> = main.iter().map(|&k| points[k]).collect();
    let sample = subset(&some, few, |_| true);
    let sample: Vec<DVec3> = sample.iter().map(|&k| some[k as usize]).collect();
    let share = sample.len() as f64 / some.len() as f64;
    let about = median_distance(&sample, |_| true) * share.sqrt();
    // 2. Boxes of a lattice in space, chosen by their place.
    let side = BOX * about;
    let boxes = |p: DVec3| (p / side).floor();
    let chosen = |p: &DVec3| {
        let mixed = boxes(*p).dot(DVec3::new(0.754_877_666, 0.569_840_290, 0.321_928_095));
        (mixed - mixed.floor()) < share
    };
    let inside: Vec<DVec3> = some.iter().copied().filter(chosen).collect();
    let margin = INSIDE / BOX;
    let deep = |p: DVec3| {
        let at = p / side - boxes(p);
        at.min_element() > margin && at.max_element() < 1.0 - margin
    };
    if inside.iter().filter(|p| deep(**p)).count() >= MEASURED {
        median_distance(&inside, deep)
    } else {
        median_distance(&some, |_| true)
    }
}

/// Mean distance to the four nearest neighbours, in the median over the points asked for.
fn median_distance(cloud: &[DVec3], asked: impl Fn(DVec3) -> bool) -> f64 {
    let table = Neighbours::new(cloud).table(NEAREST);
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

/// The part of a scan that decides on its chart: elements with a normal and a weight.
struct Sheet<'a> {
    points: &'a [DVec3],
    main: &'a [usize],
    faces: &'a [[usize; 3]],
    /// Unit normals of triangles, or of points where there are none, and their share of the whole.
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

    /// The direction against which the smallest part of the sheet is steep; what is turned away counts twice.
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
                let wrong = self.part(direction, STEEP) + self.part(direction, 0.0);
                if wrong < best.0 {
                    // Sides do not count for a cloud until here.
                    let side = if direction.dot(mean) < 0.0 { -1.0 } else { 1.0 };
                    best = (wrong, side * direction);
                }
            }
        }
        best.1
    }

    /// Directions that look more and more from the middle of all normals, as that of the smallest cone around them
    /// would: each is a mean that weighs normals more the steeper they are.
    fn centred(&self, start: DVec3) -> Vec<DVec3> {
        let mut directions = vec![start];
        let mut direction = start;
        for _ in 0..12 {
            let pull = |(n, w): &(DVec3, f64)| {
                let n = if self.faces.is_empty() {
                    *n * n.dot(direction).signum()
                } else {
                    *n
                };
                // Turned away ones have no say: they are spurious, or there is no such direction.
                let cosine = n.dot(direction);
                if cosine > -0.2 {
                    n * (w * (-4.0 * cosine).exp())
                } else {
                    DVec3::ZERO
                }
            };
            let sum: DVec3 = self.elements.iter().map(pull).sum();
            direction = (direction + 0.5 * sum.normalize_or_zero()).normalize_or(direction);
            directions.push(direction);
        }
        directions
    }

    /// Part of the sheet whose cosine against `direction` is below `least`; of a cloud, whose normals' sides are
    /// uncertain, whose absolute cosine is.
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

    /// Part of the sheet that faces away from `direction`.
    fn turned_away(&self, direction: DVec3) -> f64 {
        let away = self.elements.iter().filter(|(n, _)| n.dot(direction) < 0.0);
        away.map(|(_, w)| w).sum()
    }

    /// Part of the points that lie, after projection, beside a point of another layer: farther than the neighbours in
    /// space, and off the tangent plane by more than half of that distance, which on a steep sheet it would not be.
    ///
    /// The second number is the part whose layers are farther apart than noise throws points.
    fn doubled(&self, direction: DVec3, normals: &[DVec3], noise: f64) -> [f64; 2] {
        const NEAR: usize = 5;
        let cloud: Vec<DVec3> = self.main.iter().map(|&k| self.points[k]).collect();
        let flat: Vec<DVec3> = cloud
            .iter()
            .map(|p| p.reject_from_normalized(direction))
            .collect();
        let in_space = Neighbours::new(&cloud).table(2 * NEAR);
        let on_plane = Neighbours::new(&flat).table(NEAR);
        let mut counts = [0.0; 2];
        for (k, p) in cloud.iter().enumerate() {
            let offset = |j: &u32| cloud[*j as usize] - *p;
            let reach = in_space.of(k).last().map_or(0.0, |j| offset(j).length());
            let apart = |offset: DVec3| {
                let (distance, off) = (offset.length(), offset.dot(normals[self.main[k]]).abs());
                let layered = distance > 1.3 * reach && off > 0.5 * distance;
                if layered { off } else { 0.0 }
            };
            let apart = on_plane.of(k).iter().map(offset).map(apart);
            let farthest = apart.fold(0.0, f64::max);
            counts[0] += f64::from(u8::from(farthest > 0.0));
            counts[1] += f64::from(u8::from(farthest > THROWN * noise));
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

    /// Why no plane will do, by what the scan looks like; `wrong` is the part of it that has no place on the plane,
    /// `doubled` that in a second layer.
    fn refusal(&self, wrong: f64, doubled: f64) -> String {
        let mean: DVec3 = self.elements.iter().map(|(n, w)| *n * *w).sum();
        let [(least, _), ..] = self.spread();
        let looks = match self.rims() {
            Some(0) => "a closed shape".to_owned(),
            Some(2) => "a tube".to_owned(),
            Some(1) if mean.length() < 0.3 => "a closed shape with one opening".to_owned(),
            Some(1) => "a sheet that turns over".to_owned(),
            Some(many) => format!("a shape with {many} openings"),
            None if doubled < 0.3 => "a sheet that turns over".to_owned(),
            // The normals of a straight tube are all perpendicular to its axis.
            None if least < 0.05 => "a tube".to_owned(),
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
        let least = 0.1 * low.distance(high);
        Some(lengths.iter().filter(|&&length| length > least).count())
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod outline_tests;
