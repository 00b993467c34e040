//! The contents of a file, without a fit.
//!
//! For a scan the verb reports size, unit, order, spacing, noise, parts and topology; for a CAD file its faces, area,
//! volume, entities and header. It takes as long as reading and cleaning.

use super::outcome::RejectedCounts;
use super::sanity::doubtful_unit;
use super::{Source, about};
use crate::surfacing::prepare_filled;
use nurbskin_cad::io::file::{CadFile, CadHeader};
use nurbskin_cad::{Face, Model, ShellKind, SurfaceKind, extent, mass};
use nurbskin_fit::chart::Topology;
use nurbskin_geometry::numeric::disjoint_sets::DisjointSets;
use nurbskin_geometry::nurbs::refine::Direction;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{CleanOptions, CleanScan, Organisation, Scan, clean};
use serde::Serialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

/// The contents of a file. Lengths are in its unit.
#[derive(Clone, Debug, Serialize)]
pub struct Information {
    /// Its path.
    pub path: String,
    /// Short name of its format.
    pub format: Cow<'static, str>,
    /// Unit of all lengths.
    pub unit: Unit,
    /// Source of the unit.
    pub unit_source: UnitSource,
    /// Smallest and largest finite coordinates; `None` without any.
    pub bounding_box: Option<[[f64; 3]; 2]>,
    /// Warnings: findings that affect the result.
    pub warnings: Vec<String>,
    /// Contents specific to the kind of file.
    #[serde(flatten)]
    pub content: Content,
}

/// Contents specific to scans or to CAD files.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Content {
    /// Points.
    Scan(ScanContent),
    /// Surfaces.
    Cad(CadContent),
}

/// Figures of a scan; `None` where its points form no surface and have no properties to report.
#[derive(Clone, Debug, Serialize)]
pub struct ScanContent {
    /// Points of the file, without the empty cells of a grid.
    pub points: usize,
    /// Unusable points, by reason; `None` where the points form no surface.
    pub rejected: Option<RejectedCounts>,
    /// `grid`, `rows`, `unordered` or `mesh`.
    pub organisation: &'static str,
    /// Cells of a grid along u and v, empty cells included.
    pub grid: Option<[usize; 2]>,
    /// Whether the file has a normal for each point.
    pub normals: bool,
    /// Triangles of a mesh.
    pub triangles: Option<usize>,
    /// Connected components, the smallest included.
    pub parts: Option<usize>,
    /// Typical distance between neighbouring points.
    pub spacing: Option<f64>,
    /// Standard deviation of the noise.
    pub noise: Option<f64>,
    /// The topology of a surface through the points, where it can be determined without a fit.
    pub topology: Option<Topology>,
}

/// A CAD file in numbers.
#[derive(Clone, Debug, Serialize)]
pub struct CadContent {
    /// Solids.
    pub solids: usize,
    /// Shells, those of the solids included; each face outside any shell counts as one.
    pub shells: usize,
    /// Faces.
    pub faces: usize,
    /// Their area.
    pub area: f64,
    /// Volume inside closed shells; `None` without closed shells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<f64>,
    /// Whether the faces, taken together, enclose a volume: every edge is shared by two.
    pub closed: bool,
    /// Entities of the file: by number for IGES, by name for STEP.
    pub entities: BTreeMap<String, usize>,
    /// Shape entities that were not read.
    pub unread: BTreeMap<String, usize>,
    /// Author, system and date of the file.
    pub header: CadHeader,
    /// The surface of each face.
    pub surfaces: Vec<SurfaceContent>,
}

/// Figures of a surface.
#[derive(Clone, Debug, Serialize)]
pub struct SurfaceContent {
    /// Its type in the file: `b_spline`, `plane`, `cylinder` and so on.
    pub kind: SurfaceKind,
    /// Degrees along u and v.
    pub degree: [usize; 2],
    /// Control points along u and v; those that wrap around a smooth seam count once, as in `fit`.
    pub control_points: [usize; 2],
    /// Numbers of knots along u and v.
    pub knots: [usize; 2],
    /// Whether it has weights.
    pub rational: bool,
    /// Whether it closes, along u and v.
    pub closed: [bool; 2],
    /// Whether it is periodic along u and v: clamped forms never are.
    pub periodic: [bool; 2],
    /// Whether the face is trimmed to a part of the surface.
    pub trimmed: bool,
}

/// Largest distance between coincident sides of a surface, as a share of its diagonal.
const CLOSED: f64 = 1e-7;

/// Reads the file in `path` and returns its contents: for a scan its points, order, spacing, noise and parts, for a CAD
/// file (IGES, STEP) its faces. Takes as long as reading and cleaning.
///
/// # Errors
/// Errors of the reader, and [`Error::Cancelled`]. A scan whose points form no surface is not an error.
pub fn info(path: &Path, progress: &dyn Progress) -> Result<Information> {
    info_from(&Source::file(path), progress)
}

/// As [`info`], for a file or for bytes.
///
/// # Errors
/// As [`info`].
pub fn info_from(source: &Source, progress: &dyn Progress) -> Result<Information> {
    let path = source.path();
    progress.stage("read", None);
    if source.is_cad() {
        let file = source.read_cad()?;
        progress.check()?;
        return information_of_cad(file, path).map_err(|error| about(path, error));
    }
    let mut scan = source.read_scan()?;
    progress.check()?;
    let found = information_of_scan(&mut scan, path, progress);
    found
        .map(|found| found.0)
        .map_err(|error| about(path, error))
}

/// Figures of a scan and, where its points form a surface, the cleaned scan. Takes the warnings of the scan.
pub(super) fn information_of_scan(
    scan: &mut Scan,
    path: &Path,
    progress: &dyn Progress,
) -> Result<(Information, Option<CleanScan>)> {
    progress.stage("clean", Some(scan.points.len() as u64));
    let mut warnings = std::mem::take(&mut scan.warnings);
    let scan = &*scan;
    let cleaned = match clean(scan, &CleanOptions::default(), progress) {
        Ok(cleaned) => Some(cleaned),
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(error) => {
            warnings.push(error.to_string());
            None
        }
    };
    let used = cleaned.as_ref();
    let (topology, lines) = used.map_or((None, None), |cleaned| guess(scan, cleaned));
    let bounding_box = scan.corners();
    let extents = bounding_box.map(|[low, high]| [0, 1, 2].map(|k| high[k] - low[k]));
    let doubt = doubtful_unit(scan.unit_source, scan.unit, extents.unwrap_or_default());
    if let Some(doubt) = doubt {
        warnings.insert(0, doubt.words_with_next());
    }
    let information = Information {
        path: path.display().to_string(),
        format: scan.format.clone(),
        unit: scan.unit,
        unit_source: scan.unit_source,
        bounding_box,
        warnings,
        content: Content::Scan(ScanContent {
            points: scan.points.len(),
            rejected: used.map(|cleaned| RejectedCounts::of(&cleaned.rejected)),
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
            parts: used.map(|cleaned| cleaned.parts.count()),
            // The spacing between the lines of an ordered scan, as in `fit`.
            spacing: lines.or(used.map(|cleaned| cleaned.spacing)),
            noise: used.map(|cleaned| cleaned.noise),
            topology,
        }),
    };
    Ok((information, cleaned))
}

/// The topology of a mesh of one connected component with at most two boundaries, or of an ordered scan without large
/// holes; `None` otherwise. For such an ordered scan the function also returns the spacing of its lines.
fn guess(scan: &Scan, cleaned: &CleanScan) -> (Option<Topology>, Option<f64>) {
    match &scan.organisation {
        Organisation::Mesh(_) => (topology_of_mesh(&cleaned.triangles), None),
        Organisation::Grid(_) | Organisation::Rows(_) => {
            let mut masked = vec![true; scan.points.len()];
            for &used in &cleaned.used {
                masked[used as usize] = false;
            }
            match prepare_filled(scan, &masked, None) {
                Ok(prepared) => (Some(prepared.ordered.topology), Some(prepared.spacing)),
                Err(_) => (None, None),
            }
        }
        Organisation::Unordered => (None, None),
    }
}

/// By boundaries and the Euler characteristic V - E + F, which is 2 minus one for each boundary and two for each
/// handle.
fn topology_of_mesh(triangles: &[[u32; 3]]) -> Option<Topology> {
    // 1. Vertices, renumbered without gaps.
    let mut vertices: Vec<u32> = triangles.as_flattened().to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    let place = |v: u32| vertices.binary_search(&v).unwrap_or(0);
    // 2. Edges; an edge of one triangle belongs to the boundary.
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
            // An edge with more than two triangles is not a manifold.
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

/// The shells of a model; a face outside any shell counts as one.
fn shells_of(model: &Model) -> usize {
    let mut free = vec![true; model.faces().len()];
    for &face in model.shells().iter().flat_map(|shell| &shell.faces) {
        free[face] = false;
    }
    model.shells().len() + free.iter().filter(|free| **free).count()
}

/// A CAD file in numbers.
pub(super) fn information_of_cad(file: CadFile, path: &Path) -> Result<Information> {
    let CadFile {
        format,
        model,
        unit_source,
        entities,
        unread,
        header,
        warnings,
    } = file;
    let of_face = |face: &Face| SurfaceContent {
        kind: face.kind,
        degree: face.surface.degree(),
        control_points: {
            let [low, high] = face.surface.bounding_box();
            Direction::BOTH.map(|d| face.surface.count_around(d, CLOSED * low.distance(high)))
        },
        knots: [face.surface.knots_u(), face.surface.knots_v()].map(|k| k.knots().len()),
        rational: face.surface.is_rational(),
        closed: {
            let [low, high] = face.surface.bounding_box();
            Direction::BOTH.map(|d| face.surface.is_closed(d, CLOSED * low.distance(high)))
        },
        periodic: face.surface.periodic(),
        trimmed: face.trimmed,
    };
    let all: Vec<usize> = (0..model.faces().len()).collect();
    let extent = extent(&model)?;
    let mass = mass(&model)?;
    Ok(Information {
        path: path.display().to_string(),
        format: format.into(),
        unit: model.unit,
        unit_source,
        bounding_box: Some([extent.low.to_array(), extent.high.to_array()]),
        warnings,
        content: Content::Cad(CadContent {
            solids: model
                .shells()
                .iter()
                .filter(|shell| shell.kind == ShellKind::Solid)
                .count(),
            shells: shells_of(&model),
            faces: model.faces().len(),
            area: mass.area,
            volume: mass.volume,
            closed: model.is_closed(&all),
            entities,
            unread,
            header,
            surfaces: model.faces().iter().map(of_face).collect(),
        }),
    })
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
