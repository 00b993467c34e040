//! Product data quality: what makes a model fit for use in other systems.
//!
//! The list is that of SASIG *Product Data Quality Guideline* and VDA 4955, whose usual limits for vehicles are taken
//! where they are lengths (0.02 mm), for models that are small in proportion to their size:
//!
//! | check | measures | limit |
//! |---|---|---|
//! | `faces` | whether the model has a face | at least 1 |
//! | `edge_vertex_gap` | ends of edge curves to their vertices | length L |
//! | `edge_surface_gap` | edge curves to where their p-curves lie on the surface | L |
//! | `neighbour_gap` | the surfaces at both p-curves of a shared edge | L |
//! | `loop_gap` | ends of successive p-curves of a loop, in space | L |
//! | `boundary_off_surface` | p-curves beyond the domain of the surface, in space | L |
//! | `edge_tangency` | angle of the normals across shared edges and seams | information, 0.1 degrees |
//! | `normal_jump` | the same where it is meant to be smooth, with a certified bound | information, 0.5 degrees |
//! | `edge_curvature` | relative jump of the normal curvature across smooth edges | information, 0.1 |
//! | `knot_tangency` | angle of the normals across creases inside faces | 0.1 degrees |
//! | `knot_curvature` | relative jump of the normal curvature across inner knot lines | information, 0.1 |
//! | `degree` | highest degree of surfaces and curves | 11 |
//! | `knot_distance` | width of the narrowest knot span in space | at least L |
//! | `edge_length` | shortest edge | at least L |
//! | `face_width` | twice the area over the border's length, of the narrowest face | at least L |
//! | `loop_crossings` | crossings of loops with themselves and each other | 0 |
//! | `loop_orientation` | loops that have the face on their right | 0 |
//! | `loop_nesting` | holes that are not inside the outer loop or inside another hole | 0 |
//! | `folds` | angle by which normals turn at once inside a face, or across an edge that is meant to be smooth | 90 degrees |
//! | `self_intersections` | pairs of triangles of a shell that cross | 0 |
//! | `unoccupied_rows` | rows of knot spans that a face does not touch | information, 0 |
//! | `shell_orientation` | edges whose faces look opposite ways | 0 |
//! | `non_manifold_edges` | edges that more than two faces share | 0 |
//! | `free_edges` | edges of one face in shells that are said to be closed | 0 |
//! | `open_edges` | edges of one face in other shells | information, 0 |
//! | `solid_volume` | the least volume of a solid | above 0 |
//!
//! L is 0.02 mm, and at most 1e-4 of the diagonal of the model. Gaps and angles are measured on samples: at least 24
//! per edge and eight per Bezier piece, so a gap that is shorter can be missed. Information never fails a model: a
//! box has sharp edges, and a trimmed face may leave spans free. What is over its limit is told by `within`.
//!
//! [`Report::normal_jump`] has the quantiles of the angles across smooth edges, from [`mod@crate::normal_jump`].

mod crossings;
mod edges;
mod loops;
mod shells;
mod surfaces;
mod worst;

use super::extent::extent;
use super::model::{Face, Model};
use super::normal_jump::{JumpSummary, Meant, normal_jumps};
use super::region::Region;
use glam::DVec3;
use nurbskin_geometry::Result;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use worst::Worst;

pub use crossings::{Defects, FaceCell, ShellDefects, crossings, shell_defects};
pub(crate) use edges::largest_gap;

/// The usual limit of lengths, in millimetres.
const LENGTH: f64 = 0.02;
/// ... and as a share of the model's diagonal.
const SHARE: f64 = 1e-4;
/// Highest degree that all common systems keep.
const DEGREE: f64 = 11.0;
/// Normals that differ by less are smooth, in degrees.
const ANGLE: f64 = 0.1;
/// Normals at edges that are meant to be smooth may differ by this, in degrees. Guard: up to this bound a network of
/// faces is called smooth; five times the limit of `edge_tangency`.
const JUMP: f64 = 0.5;
/// Curvatures that differ by less of the larger are smooth.
const CURVATURE: f64 = 0.1;
/// Normals that turn by more at once are a fold, in degrees.
pub const FOLD: f64 = 90.0;

/// Whether a check can fail a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Over the limit, the model fails.
    Defect,
    /// Over the limit, that is worth knowing.
    Information,
}

/// One thing that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// What, as in the list above.
    pub name: Cow<'static, str>,
    /// The worst value found.
    pub measured: f64,
    /// The largest value allowed; the smallest for the checks that say "at least".
    pub limit: f64,
    /// Unit of both: of the model's lengths, their square or cube, `deg`, or empty for numbers.
    pub unit: String,
    /// Where the worst value is, if it is somewhere.
    #[serde(rename = "where")]
    pub where_: Option<DVec3>,
    /// The face concerned, if it is one.
    pub face: Option<usize>,
    /// The edge concerned, if it is one.
    pub edge: Option<usize>,
    /// Whether a value over the limit is a defect.
    pub severity: Severity,
    /// Whether the limit is kept.
    pub within: bool,
    /// Whether the limit is kept or the check is for information only.
    pub pass: bool,
}

/// What the checks of a model say.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Report {
    /// All checks, in the order of the list.
    pub checks: Vec<Check>,
    /// What could not be measured, a sentence each.
    pub skipped: Vec<String>,
    /// Angles between normals across the edges that are meant to be smooth, in degrees.
    pub normal_jump: JumpSummary,
}

impl Report {
    /// Whether every check passes and none was skipped.
    #[must_use]
    pub fn pass(&self) -> bool {
        self.skipped.is_empty() && self.checks.iter().all(|check| check.pass)
    }

    /// The check of this name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Check> {
        self.checks.iter().find(|check| check.name == name)
    }
}

/// A model and what several checks need of it.
struct Subject<'a> {
    model: &'a Model,
    /// The limit of lengths in the model's unit.
    length: f64,
    diagonal: f64,
    /// Per face; `None` where it has none.
    regions: Vec<Option<Region>>,
    /// Per edge: face, loop, use.
    uses: Vec<Vec<[usize; 3]>>,
}

impl<'a> Subject<'a> {
    fn new(model: &'a Model) -> Result<Self> {
        let diagonal = extent(model)?.diagonal();
        let mut uses = vec![Vec::new(); model.edges().len()];
        for (k, face) in model.faces().iter().enumerate() {
            for (l, each) in face.loops.iter().enumerate() {
                for (m, used) in each.uses.iter().enumerate() {
                    uses[used.edge].push([k, l, m]);
                }
            }
        }
        let length = (LENGTH / model.unit.millimetres()).min(SHARE * diagonal);
        Ok(Self {
            model,
            length,
            diagonal,
            regions: model.faces().iter().map(|f| Region::new(f).ok()).collect(),
            uses,
        })
    }

    /// The shell of each face; the largest number for those without one, which count as an open shell.
    fn shell_of_faces(&self) -> Vec<usize> {
        let mut shells = vec![usize::MAX; self.model.faces().len()];
        for (k, shell) in self.model.shells().iter().enumerate() {
            shell.faces.iter().for_each(|&face| shells[face] = k);
        }
        shells
    }

    fn faces(&self) -> impl Iterator<Item = (usize, &'a Face, &Region)> {
        let pairs = self.model.faces().iter().zip(&self.regions).enumerate();
        pairs.filter_map(|(k, (face, region))| Some((k, face, region.as_ref()?)))
    }
}

/// Measures a model. Nothing is changed. The longest part is the search for self-intersections, about that of
/// tessellating the model to 1/1000 of its diagonal.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Model, check};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ring");
/// let face = model.add_whole_surface(&conic::torus(DVec3::ZERO, DVec3::Z, 30.0, 10.0)?, 1e-9)?;
/// model.add_shell_of(face)?;
/// let report = check(&model);
/// assert!(report.pass(), "{report:?}");
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn check(model: &Model) -> Report {
    check_meant(model, Meant::default())
}

/// [`check`] of a model whose edges are known to be meant smooth or sharp.
#[must_use]
pub fn check_meant(model: &Model, meant: Meant<'_>) -> Report {
    let mut report = Report::default();
    let count = model.faces().len() as f64;
    report.add(
        "faces",
        Severity::Defect,
        Limit::Least(1.0),
        "",
        Worst::of(count),
    );
    if model.faces().is_empty() {
        return report;
    }
    let subject = match Subject::new(model) {
        Ok(subject) => subject,
        Err(error) => {
            report
                .skipped
                .push(format!("nothing could be measured: {error}"));
            return report;
        }
    };
    let jumps = normal_jumps(model, meant);
    edges::check(&subject, &jumps, &mut report);
    report.normal_jump = jumps.summary;
    surfaces::check(&subject, &mut report);
    loops::check(&subject, &mut report);
    shells::check(&subject, &jumps, &mut report);
    report
}

/// What a check allows.
#[derive(Clone, Copy)]
enum Limit {
    Most(f64),
    Least(f64),
    /// More than this.
    Above(f64),
}

impl Report {
    fn add(
        &mut self,
        name: &'static str,
        severity: Severity,
        limit: Limit,
        unit: &str,
        worst: Worst,
    ) {
        let measured = worst.value;
        let (limit, within) = match limit {
            Limit::Most(limit) => (limit, measured <= limit),
            Limit::Least(limit) => (limit, measured >= limit),
            Limit::Above(limit) => (limit, measured > limit),
        };
        self.checks.push(Check {
            name: Cow::Borrowed(name),
            measured,
            limit,
            unit: unit.to_owned(),
            where_: worst.place,
            face: worst.face,
            edge: worst.edge,
            severity,
            within,
            pass: within || severity == Severity::Information,
        });
    }
}

#[cfg(test)]
mod tests;
