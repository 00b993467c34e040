//! What is in a file, without fitting anything.

use super::outcome::RejectedCounts;
use super::{about, ordered};
use crate::chart::Topology;
use crate::io::{self, iges};
use crate::numeric::disjoint_sets::DisjointSets;
use crate::nurbs::NurbsSurface;
use crate::progress::Progress;
use crate::scan::{CleanOptions, CleanScan, Organisation, Scan, clean};
use crate::unit::{Unit, UnitSource};
use crate::{Error, Result};
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// What a file holds. Lengths are in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Information {
    /// Its path.
    pub path: String,
    /// Short name of its format.
    pub format: &'static str,
    /// Unit of all lengths.
    pub unit: Unit,
    /// Where the unit was learnt from.
    pub unit_source: UnitSource,
    /// Smallest and largest coordinates of what is finite; `None` where nothing is.
    pub bounding_box: Option<[[f64; 3]; 2]>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// The rest, by the kind of file.
    #[serde(flatten)]
    pub content: Content,
}

/// What only scans or only CAD files have.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Content {
    /// Points.
    Scan(ScanContent),
    /// Surfaces.
    Cad(CadContent),
}

/// A scan in numbers; `None` where its points are no surface and nothing can be said.
#[derive(Clone, Debug, Serialize)]
pub struct ScanContent {
    /// Points of the file, without the empty cells of a grid.
    pub points: usize,
    /// Points that cannot be used, by reason; `None` where the points are no surface.
    pub rejected: Option<RejectedCounts>,
    /// `grid`, `rows`, `unordered` or `mesh`.
    pub organisation: &'static str,
    /// Cells of a grid along u and v, the empty ones too.
    pub grid: Option<[usize; 2]>,
    /// Whether the file has a normal for each point.
    pub normals: bool,
    /// Triangles of a mesh.
    pub triangles: Option<usize>,
    /// Separate pieces, the smallest too.
    pub parts: Option<usize>,
    /// Typical distance between neighbouring points.
    pub spacing: Option<f64>,
    /// Standard deviation of the noise.
    pub noise: Option<f64>,
    /// The topology that a surface through the points would have, where it can be told without fitting one.
    pub topology: Option<Topology>,
}

/// A CAD file in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct CadContent {
    /// Surfaces that are faces: all that are read.
    pub faces: usize,
    /// Their area; `None` where a face is trimmed, as trims are not read yet.
    pub area: Option<f64>,
    /// Whether the faces enclose a volume; `None` where that is not known.
    pub closed: Option<bool>,
    /// Entities of the file by their number.
    pub entities: BTreeMap<u32, usize>,
    /// Those that were left aside.
    pub unread: BTreeMap<u32, usize>,
    /// Its surfaces.
    pub surfaces: Vec<SurfaceContent>,
}

/// A surface in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceContent {
    /// `b_spline`.
    pub kind: &'static str,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Control points along u and v.
    pub control_points: [usize; 2],
    /// Numbers of knots along u and v.
    pub knots: [usize; 2],
    /// Whether it has weights.
    pub rational: bool,
    /// Whether the file says that it closes, along u and v.
    pub closed: [bool; 2],
    /// Whether it is periodic along u and v.
    pub periodic: [bool; 2],
    /// Whether only a part of it is meant.
    pub trimmed: bool,
}

/// Reads the file in `path` and says what it holds: of a scan its points, order, spacing, noise and parts, of a CAD
/// file (IGES) its surfaces. As long as reading and cleaning.
///
/// # Errors
/// Those of reading, and [`Error::Cancelled`]. A scan whose points are no surface is no error.
pub fn info(path: &Path, progress: &dyn Progress) -> Result<Information> {
    progress.stage("read", None);
    let extension = io::extension(path);
    if matches!(extension.as_str(), "igs" | "iges") {
        let bytes = io::read_file(path)?;
        return of_iges(&iges::read(bytes, path)?, path);
    }
    let scan = io::read_scan(path)?;
    progress.check()?;
    of_scan(scan, path, progress).map_err(|error| about(path, error))
}

fn of_scan(mut scan: Scan, path: &Path, progress: &dyn Progress) -> Result<Information> {
    progress.stage("clean", None);
    let mut warnings = std::mem::take(&mut scan.warnings);
    let cleaned = match clean(&scan, &CleanOptions::default(), progress) {
        Ok(cleaned) => Some(cleaned),
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(error) => {
            warnings.push(error.to_string());
            None
        }
    };
    let cleaned = cleaned.as_ref();
    let topology = cleaned.and_then(|cleaned| topology_guess(&scan, cleaned));
    let finite = scan.points.iter().filter(|p| p.is_finite());
    Ok(Information {
        path: path.display().to_string(),
        format: scan.format,
        unit: scan.unit,
        unit_source: scan.unit_source,
        bounding_box: extent(finite.map(|&p| p + scan.origin)),
        warnings,
        content: Content::Scan(ScanContent {
            points: scan.points.len(),
            rejected: cleaned.map(|cleaned| RejectedCounts::of(&cleaned.rejected)),
            organisation: scan.organisation.name(),
            grid: match &scan.organisation {
                Organisation::Grid(layout) => Some([layout.count_u, layout.count_v]),
                _ => None,
            },
            normals: scan.normals.is_some(),
            triangles: match &scan.organisation {
                Organisation::Mesh(triangles) => Some(triangles.len()),
                _ => None,
            },
            parts: cleaned.map(|cleaned| cleaned.parts.count()),
            spacing: cleaned.map(|cleaned| cleaned.spacing),
            noise: cleaned.map(|cleaned| cleaned.noise),
            topology,
        }),
    })
}

/// The box around points; `None` without any.
fn extent(mut points: impl Iterator<Item = DVec3>) -> Option<[[f64; 3]; 2]> {
    let first = points.next()?;
    let (low, high) = points.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    Some([low.to_array(), high.to_array()])
}

/// The topology of a mesh of one piece with at most two borders, or of an ordered scan without large holes; `None`
/// where it takes more to tell.
fn topology_guess(scan: &Scan, cleaned: &CleanScan) -> Option<Topology> {
    match &scan.organisation {
        Organisation::Mesh(_) => topology_of_mesh(&cleaned.triangles),
        Organisation::Grid(_) | Organisation::Rows(_) => {
            let mut masked = vec![true; scan.points.len()];
            for &used in &cleaned.used {
                masked[used as usize] = false;
            }
            let prepared = ordered::prepare_filled(scan, &masked, None).ok()?;
            Some(prepared.ordered.topology)
        }
        Organisation::Unordered => None,
    }
}

/// By borders and Euler characteristic V - E + F, which is 2 less one for each border and two for each handle.
fn topology_of_mesh(triangles: &[[u32; 3]]) -> Option<Topology> {
    // 1. Vertices, numbered anew without gaps.
    let mut vertices: Vec<u32> = triangles.as_flattened().to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    let place = |v: u32| vertices.binary_search(&v).unwrap_or(0);
    // 2. Edges, those of one triangle being the border.
    let mut edges: Vec<[usize; 2]> = Vec::with_capacity(3 * triangles.len());
    let mut pieces = DisjointSets::new(vertices.len());
    for t in triangles {
        let [a, b, c] = t.map(place);
        edges.extend([[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]));
        pieces.join(a, b);
        pieces.join(b, c);
    }
    edges.sort_unstable();
    let mut borders = DisjointSets::new(vertices.len());
    let mut on_border = vec![false; vertices.len()];
    let mut count: i64 = 0;
    for edge in edges.chunk_by(|a, b| a == b) {
        count += 1;
        match *edge {
            [[a, b]] => {
                borders.join(a, b);
                (on_border[a], on_border[b]) = (true, true);
            }
            [_, _] => {}
            // More than two triangles at an edge are no surface.
            _ => return None,
        }
    }
    let roots = |sets: &mut DisjointSets, of: &dyn Fn(usize) -> bool| {
        let all = (0..vertices.len()).filter(|&v| of(v));
        all.filter(|&v| sets.root(v) == v).count()
    };
    if roots(&mut pieces, &|_| true) != 1 {
        return None;
    }
    let number = |n: usize| i64::try_from(n).unwrap_or(i64::MAX);
    let characteristic = number(vertices.len()) - count + number(triangles.len());
    match (roots(&mut borders, &|v| on_border[v]), characteristic) {
        (0, 2) => Some(Topology::Sphere),
        (0, 0) => Some(Topology::Torus),
        (1, 1) => Some(Topology::Disk),
        (2, 0) => Some(Topology::Tube),
        _ => None,
    }
}

fn of_iges(model: &iges::IgesModel, path: &Path) -> Result<Information> {
    let of_surface = |surface: &iges::IgesSurface| SurfaceContent {
        kind: "b_spline",
        degree: surface.surface.degree(),
        control_points: surface.surface.distinct_counts(),
        knots: [
            surface.surface.knots_u().knots().len(),
            surface.surface.knots_v().knots().len(),
        ],
        rational: surface.surface.is_rational(),
        closed: surface.closed,
        periodic: surface.surface.periodic(),
        trimmed: surface.trimmed,
    };
    let boxes = model.surfaces.iter().map(|s| s.surface.bounding_box());
    let trimmed = model.surfaces.iter().any(|surface| surface.trimmed);
    let mut warnings = model.warnings.clone();
    if trimmed {
        warnings.push(
            "the trims of the surfaces are not read yet: their box is that of the whole surfaces"
                .to_owned(),
        );
    }
    Ok(Information {
        path: path.display().to_string(),
        format: "iges",
        unit: model.global.unit,
        unit_source: if model.global.unit_given {
            UnitSource::File
        } else {
            UnitSource::Assumed
        },
        bounding_box: extent(boxes.flatten()),
        warnings,
        content: Content::Cad(CadContent {
            faces: model.surfaces.len(),
            area: (!trimmed).then(|| model.surfaces.iter().map(|s| area(&s.surface)).sum()),
            closed: None,
            entities: model.entities.clone(),
            unread: model.unread.clone(),
            surfaces: model.surfaces.iter().map(of_surface).collect(),
        }),
    })
}

/// The area of a surface, by four Gauss points along u and v of each piece between knots.
fn area(surface: &NurbsSurface) -> f64 {
    // Abscissae and weights on [-1, 1].
    const GAUSS: [(f64, f64); 4] = [
        (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
        (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
    ];
    let domain = surface.domain();
    let places = |knots: &[f64], (low, high): (f64, f64)| -> Vec<(f64, f64)> {
        let spans = knots.windows(2).map(|k| (k[0], k[1]));
        let inside = spans.filter(|&(a, b)| b > a && a >= low && b <= high);
        inside
            .flat_map(|(a, b)| {
                GAUSS.map(|(x, w)| (f64::midpoint(a, b) + 0.5 * (b - a) * x, 0.5 * (b - a) * w))
            })
            .collect()
    };
    let along_u = places(surface.knots_u().knots(), domain[0]);
    let along_v = places(surface.knots_v().knots(), domain[1]);
    let mut sum = 0.0;
    for &(u, weight_u) in &along_u {
        for &(v, weight_v) in &along_v {
            let d = surface.derivatives(u, v);
            sum += weight_u * weight_v * d.du.cross(d.dv).length();
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A band of `m` x `n` squares, closed along either direction.
    fn band(m: u32, n: u32, closed: [bool; 2]) -> Vec<[u32; 3]> {
        let count = [m + u32::from(!closed[0]), n + u32::from(!closed[1])];
        let at = |i: u32, j: u32| (j % count[1]) * count[0] + i % count[0];
        (0..n)
            .flat_map(|j| (0..m).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    #[test]
    fn meshes_are_told_by_borders_and_euler_characteristic() {
        let sphere = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [3, 2, 1]];
        for (triangles, topology) in [
            (band(5, 4, [false, false]), Some(Topology::Disk)),
            (band(5, 4, [true, false]), Some(Topology::Tube)),
            (band(5, 4, [true, true]), Some(Topology::Torus)),
            (sphere, Some(Topology::Sphere)),
            (Vec::new(), None),
            (
                [band(2, 2, [false, false]), vec![[50, 51, 52]]].concat(),
                None,
            ),
            (vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]], None),
        ] {
            assert_eq!(topology_of_mesh(&triangles), topology);
        }
    }
}
