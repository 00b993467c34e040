//! The surfaces of a scan before they are measured: one [`Part`] each, with its points, its method and its trimming.
//!
//! A part is one surface or a network of faces ([`PartShape`]). Trimming cuts a surface down to the region with points
//! under it. The model that is written has a shell for each part, closed to a solid where it closes. Ours.

use super::{Method, SurfacingOptions, Tolerance, Trim};
use crate::deviation::verdict::{Asked, USUAL_SHARE};
use glam::{DVec2, DVec3};
use nurbskin_cad::trim::{Scanned, Trimming, trimming_near};
use nurbskin_cad::{FaceNetwork, Model, Region};
use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::spatial::nearest::Nearest;
use nurbskin_geometry::unit::{counted, grouped, percent};
use nurbskin_geometry::{Error, NurbsSurface, Result, Unit};
use nurbskin_network::layout::OnFace;
use nurbskin_scan::Rejected;
use std::ops::Range;
use std::sync::OnceLock;

/// Distance, as a share of the diagonal of the surface, up to which two of its sides count as one.
/// Guard: far above rounding and far below any feature.
const COINCIDENT_SIDES: f64 = 1e-9;
/// Distance, as a share of the diagonal, that the edges of a trimmed face may have from its surface.
/// Guard: below the tolerance to which CAD systems sew edges.
const EDGE_TOLERANCE: f64 = 1e-7;
/// Share of the area of a surface up to which bridged gaps are not reported.
/// Guard: a choice of what is worth reading.
const MIN_REPORTED_SHARE: f64 = 1e-3;
/// Colour of the faces in a CAD file, a light grey, as sRGB bytes.
/// Guard: a choice; shading stays visible on it.
const MODEL_COLOUR: [u8; 3] = [184, 190, 196];

/// The surfaces of a scan, one for each of its parts.
#[derive(Debug)]
pub struct Surfaces {
    /// At least one, the largest first.
    pub parts: Vec<Part>,
    /// The tolerance aimed at.
    pub tolerance: Tolerance,
    /// The array of an ordered scan.
    pub grid: Option<[usize; 2]>,
    /// Whether the array stands for rows of different length.
    pub resampled: bool,
    /// Number of objects that were separated from their support.
    pub objects: usize,
    /// The points that are not used, by their index in the file, and why.
    pub rejected: Vec<Rejected>,
    /// Median distance between neighbouring points.
    pub spacing: f64,
    /// Standard deviation of the points across the surface.
    pub noise: f64,
    /// Notes for the user on the choices made.
    pub notes: Notes,
}

/// The shape of one part of a scan, and its points.
#[derive(Debug)]
pub struct Part {
    /// Its surface, or its network of faces.
    pub shape: PartShape,
    /// How it was fitted: interpolated or approximated.
    pub method: Method,
    /// Reason for which the fit misses the tolerance.
    pub not_met: Option<String>,
    /// Indices in the file of the points that count.
    pub used: Vec<u32>,
    /// Those points.
    pub points: Vec<DVec3>,
    /// Which of `points` the fit excluded.
    pub held_out: Vec<bool>,
    /// Median distance between neighbouring points.
    pub spacing: f64,
    /// Standard deviation of the points across the surface.
    pub noise: f64,
    /// Triangles between them, where there are any.
    pub triangles: Option<Vec<[u32; 3]>>,
    /// Whether the scan came with them.
    pub is_mesh: bool,
    /// Search structure for the nearest place of the scan, built on demand.
    pub(super) near: OnceLock<Nearest>,
}

/// What a part of a scan was fitted with.
#[derive(Debug)]
pub enum PartShape {
    /// One surface.
    Single(Box<SinglePart>),
    /// A network of four-sided faces.
    Network(NetworkPart),
}

/// One surface for a part.
#[derive(Debug)]
pub struct SinglePart {
    /// The surface.
    pub surface: NurbsSurface,
    /// Which of its directions are closed.
    pub topology: Topology,
    /// Lines of the array that were interpolated, along u and v.
    pub kept: Option<[usize; 2]>,
    /// The parameterization that was interpolated with, by name.
    pub parameters: Option<&'static str>,
    /// How many of the points lie beyond its borders.
    pub beyond: usize,
    /// Foot points of the points of the part in the fit, if known: starting values for projections.
    pub feet: Option<Vec<DVec2>>,
    /// Whether it continues beyond the outline of a sheet that was spread out.
    pub is_spread_out: bool,
    /// The surfaces that the fit visited; empty where there was no search.
    pub met: Met,
    /// Whether the surface could intersect itself.
    pub may_cross: bool,
    /// The trimming of the surface; before [`Part::trim`], the known future one.
    pub trimming: Option<Trimming>,
    /// Whether a network was fitted, too, and found no better.
    pub network_tried: bool,
}

/// A network of faces for a part.
#[derive(Debug)]
pub struct NetworkPart {
    /// The faces and their edges.
    pub network: FaceNetwork,
    /// Where each point of the part lies, by the fit: starting values for projections.
    pub feet: Vec<OnFace>,
    /// Number of handles.
    pub genus: usize,
    /// Number of borders.
    pub borders: usize,
    /// Number of places where it folds or intersects itself.
    pub defects: usize,
    /// Number of points at faces that were left out, since they intersected others.
    pub beyond: usize,
}

impl NetworkPart {
    /// The topology, where it is one that a single surface can have.
    #[must_use]
    pub fn topology(&self) -> Option<Topology> {
        match (self.genus, self.borders) {
            (0, 0) => Some(Topology::Sphere),
            (0, 1) => Some(Topology::Disk),
            (0, 2) => Some(Topology::Tube),
            (1, 0) => Some(Topology::Torus),
            _ => None,
        }
    }
}

impl PartShape {
    /// The surfaces of its faces.
    pub fn surfaces(&self) -> impl Iterator<Item = &NurbsSurface> {
        let (one, many) = match self {
            Self::Single(single) => (Some(&single.surface), None),
            Self::Network(part) => (None, Some(part.network.faces.iter())),
        };
        let many = many.into_iter().flatten().map(|face| &face.surface);
        one.into_iter().chain(many)
    }

    /// The surfaces of its faces, moved out.
    pub fn into_surfaces(self) -> Vec<NurbsSurface> {
        match self {
            Self::Single(single) => vec![single.surface],
            Self::Network(part) => part
                .network
                .faces
                .into_iter()
                .map(|face| face.surface)
                .collect(),
        }
    }

    /// The single surface, if it is one.
    #[must_use]
    pub fn single(&self) -> Option<&SinglePart> {
        match self {
            Self::Single(single) => Some(single),
            Self::Network(_) => None,
        }
    }

    /// The network, if it is one.
    #[must_use]
    pub fn network(&self) -> Option<&NetworkPart> {
        match self {
            Self::Single(_) => None,
            Self::Network(network) => Some(network),
        }
    }

    /// Number of faces.
    #[must_use]
    pub fn faces(&self) -> usize {
        match self {
            Self::Single(_) => 1,
            Self::Network(part) => part.network.faces.len(),
        }
    }

    /// Distinct control points: those that faces share, or that a closed direction repeats, count once.
    #[must_use]
    pub fn control_points(&self) -> usize {
        match self {
            Self::Single(single) => single.surface.distinct_counts().into_iter().product(),
            Self::Network(part) => part.network.control_point_count(),
        }
    }

    /// Number of points beyond the borders: those that the fit of a single surface left out, and those at faces that a network lacks.
    #[must_use]
    pub fn beyond(&self) -> usize {
        match self {
            Self::Single(single) => single.beyond,
            Self::Network(part) => part.beyond,
        }
    }

    /// Whether a surface is trimmed.
    #[must_use]
    pub fn is_trimmed(&self) -> bool {
        self.single()
            .is_some_and(|single| single.trimming.is_some())
    }

    /// A face, numbered from `first` on, and a place on it near each point, where known.
    #[must_use]
    pub fn starts(&self, first: usize) -> Option<Vec<(usize, DVec2)>> {
        match self {
            Self::Single(single) => {
                let feet = single.feet.as_ref()?;
                Some(feet.iter().map(|&place| (first, place)).collect())
            }
            Self::Network(part) => {
                let start = |at: &OnFace| (first + at.face as usize, DVec2::new(at.u, at.v));
                Some(part.feet.iter().map(start).collect())
            }
        }
    }
}

impl Part {
    /// Drops the search structure, and with it a copy of the points.
    pub(crate) fn forget_nearest(&mut self) {
        self.near.take();
    }

    /// Search structure for the nearest place of the points, or of the triangles between them.
    pub fn nearest(&self) -> &Nearest {
        self.near.get_or_init(|| self.scanned(false).nearest())
    }

    /// The points and triangles of the surface.
    fn scanned(&self, stays_closed: bool) -> Scanned<'_> {
        Scanned {
            points: &self.points,
            triangles: self.triangles.as_deref(),
            is_mesh: self.is_mesh,
            spacing: self.spacing,
            feet: self
                .shape
                .single()
                .filter(|single| single.is_spread_out)
                .and_then(|single| single.feet.as_deref()),
            stays_closed,
        }
    }

    /// Trims the surface to the scan, if requested, and notes the result.
    ///
    /// # Errors
    /// As [`trimming_near`].
    pub fn trim(&mut self, options: &SurfacingOptions, notes: &mut Notes) -> Result<()> {
        let known = match &mut self.shape {
            PartShape::Single(single) if options.trim != Trim::Off => single.trimming.take(),
            _ => return Ok(()),
        };
        let found = match (known, &self.shape) {
            (Some(known), _) => known,
            (None, PartShape::Network(_)) => return Ok(()),
            (None, PartShape::Single(single)) => {
                let scan = self.scanned(options.trim == Trim::Auto);
                let crosses = single.may_cross.then(|| {
                    let [low, high] = bounding_box(&self.points);
                    low.distance(high)
                });
                trimming_near(&single.surface, &scan, self.nearest(), crosses)?
            }
        };
        if let PartShape::Single(single) = &mut self.shape {
            single.cut(found, notes);
        }
        Ok(())
    }
}

impl SinglePart {
    /// Cuts the surface down to a trimming, if that cuts anything, and notes the result.
    fn cut(&mut self, found: Trimming, notes: &mut Notes) {
        if !found.is_cut() {
            let told = found.covered > MIN_REPORTED_SHARE;
            let stays = match found.kept_closed {
                true => "; it is kept closed (--trim always leaves the gaps open)",
                false => "",
            };
            if told {
                notes.warn(format!(
                    "{} of the surface's area bridges gaps in the scan{stays}",
                    percent(found.covered)
                ));
            }
            return;
        }
        // Foot points move with the seam.
        let [(a, b), (c, d)] = self.surface.domain();
        let moved = DVec2::from(found.moved) * DVec2::new(b - a, d - c);
        for foot in self.feet.iter_mut().flatten() {
            *foot -= moved;
            foot.x = found.surface.knots_u().wrap(foot.x);
            foot.y = found.surface.knots_v().wrap(foot.y);
        }
        self.surface = found.surface.clone();
        let holes = match found.holes() {
            0 => String::new(),
            n => format!(", with {}", counted(n, "hole", "holes")),
        };
        let gaps = match found.covered > MIN_REPORTED_SHARE {
            true => format!(
                "; {} of its area bridges gaps in the scan",
                percent(found.covered)
            ),
            false => String::new(),
        };
        let said = format!("the surface is trimmed to the scan{holes}{gaps}");
        match holes.is_empty() && gaps.is_empty() {
            true => notes.detail(said),
            false => notes.warn(said),
        }
        notes.detail(format!(
            "trimming cuts {} of the untrimmed surface away, which has no scan under it",
            percent(found.cut)
        ));
        if found.withdrawn > 0.0 {
            notes.detail(format!(
                "of that, {} lies beside ragged rims, where the surface turned away from the scan or met itself",
                percent(found.withdrawn)
            ));
        }
        self.trimming = Some(found);
    }
}

impl Surfaces {
    /// The CAD model: each part in a shell of its own, closed to a solid where it closes.
    ///
    /// # Errors
    /// [`Error::Invalid`] where a trimmed surface makes no valid face.
    pub fn model(&self, name: &str, unit: Unit) -> Result<Model> {
        let mut model = Model::new(name);
        model.unit = unit;
        model.colour = Some(MODEL_COLOUR);
        for part in &self.parts {
            let single = match &part.shape {
                PartShape::Network(part) => {
                    part.network.add_to(&mut model)?;
                    continue;
                }
                PartShape::Single(single) => single,
            };
            let [low, high] = single.surface.bounding_box();
            let diagonal = low.distance(high);
            let face = match &single.trimming {
                Some(trimming) => model.add_trimmed_surface(
                    trimming,
                    COINCIDENT_SIDES * diagonal,
                    EDGE_TOLERANCE * diagonal,
                )?,
                None => model.add_whole_surface(&single.surface, COINCIDENT_SIDES * diagonal)?,
            };
            model.add_shell_of(face)?;
        }
        Ok(model)
    }

    /// The sides of the box around the points that count.
    pub fn extents(&self) -> [f64; 3] {
        let boxes = self.parts.iter().map(|part| bounding_box(&part.points));
        let both = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| [a.min(c), b.max(d)];
        let whole = boxes.reduce(both);
        whole.map_or([0.0; 3], |[low, high]| (high - low).to_array())
    }

    /// The criterion of the deviation, where a tolerance was requested.
    pub fn asked(&self, options: &SurfacingOptions) -> Option<Asked> {
        let tolerance = self.tolerance.asked()?;
        Some(Asked {
            tolerance,
            within: self.share(options),
        })
    }

    /// The share of the points that a tolerance demands.
    pub fn share(&self, options: &SurfacingOptions) -> f64 {
        options.within.unwrap_or(match self.grid {
            Some(_) => 1.0,
            None => USUAL_SHARE,
        })
    }

    /// The faces of each part, by their index in the [model](Self::model).
    pub fn faces(&self) -> Vec<Range<usize>> {
        let ends = self.parts.iter().scan(0, |end, part| {
            let first = *end;
            *end += part.shape.faces();
            Some(first..*end)
        });
        ends.collect()
    }

    /// The trimmed region of the surface of each part; `None` where nothing is trimmed.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the loops of a trimming enclose nothing.
    pub fn regions(&self) -> Result<Vec<Option<Region>>> {
        let region = |part: &Part| {
            let single = part.shape.single();
            let trimming = single.and_then(|single| single.trimming.as_ref());
            trimming.map(Trimming::region).transpose()
        };
        self.parts.iter().map(region).collect()
    }

    /// Distinct control points of all surfaces.
    pub fn control_points(&self) -> usize {
        self.parts
            .iter()
            .map(|part| part.shape.control_points())
            .sum()
    }

    /// Enforces the budget: a surface that exceeds it is not written.
    ///
    /// # Errors
    /// [`Error::NoSolution`] where a part has more control points than the options allow.
    pub fn check_budget(&self, options: &SurfacingOptions) -> Result<()> {
        let Some(budget) = options.max_control_points else {
            return Ok(());
        };
        for part in &self.parts {
            let count = part.shape.control_points();
            if count <= budget {
                continue;
            }
            return Err(Error::NoSolution(match &part.shape {
                PartShape::Single(single) => {
                    let [m, n] = single.surface.distinct_counts();
                    let [p, q] = single.surface.degree();
                    format!(
                        "a {} of degree {p} x {q} takes {m} x {n} control points here, which is over the budget of \
                         {budget}: allow more, or a lower degree",
                        single.topology.name()
                    )
                }
                PartShape::Network(_) => format!(
                    "a network of {} takes {} control points here, which is over the budget of {budget}: allow more",
                    counted(part.shape.faces(), "face", "faces"),
                    grouped(count)
                ),
            }));
        }
        Ok(())
    }
}
