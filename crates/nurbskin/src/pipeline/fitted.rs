//! Surfaces and how they came about, before they are measured.

use super::options::Trim;
use super::trade::Trade;
use super::{Options, SurfaceSummary};
use crate::deviation::verdict::{Asked, USUAL_SHARE};
use glam::{DVec2, DVec3};
use nurbskin_cad::trim::{Scanned, Trimming, trimming_near};
use nurbskin_cad::{Face, Model, Region, curvature_variation};
use nurbskin_fit::chart::Topology;
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::spatial::nearest::Nearest;
use nurbskin_geometry::unit::{counted, percent};
use nurbskin_geometry::{Error, NurbsSurface, Result, Unit};
use nurbskin_scan::{Rejected, Scan};
use std::sync::OnceLock;

/// Sides of a surface that are one, and how far edges may be from their surface, as shares of its diagonal.
const SAME: f64 = 1e-9;
const GAP: f64 = 1e-7;
/// Less than this share of a surface is not worth a word.
const LITTLE: f64 = 1e-3;
/// A calm grey.
const COLOUR: [u8; 3] = [184, 190, 196];
/// Share of the bounding-box diagonal that is the tolerance where the scan shows no noise.
const TOLERANCE_OF_DIAGONAL: f64 = 5e-4;
/// The tolerance chosen for a noisy scan, in standard deviations: 99.7 % of normal noise lies within.
const TOLERANCE_OF_SIGMA: f64 = 3.0;

/// The surfaces of a scan, one for each of its parts.
pub(super) struct Fitted {
    /// At least one, the largest first.
    pub(super) parts: Vec<Part>,
    pub(super) tolerance: Tolerance,
    /// The array of an ordered scan.
    pub(super) grid: Option<[usize; 2]>,
    /// Whether the array stands for rows of different length.
    pub(super) resampled: bool,
    /// Objects that were cut off what they stand on.
    pub(super) objects: usize,
    pub(super) rejected: Vec<Rejected>,
    pub(super) spacing: f64,
    pub(super) noise: f64,
    /// Choices made, for the user.
    pub(super) notes: Notes,
}

/// One surface and the points that it stands for.
pub(super) struct Part {
    pub(super) surface: NurbsSurface,
    pub(super) topology: Topology,
    pub(super) method: &'static str,
    /// Why the fit itself says that it falls short of the tolerance.
    pub(super) not_met: Option<String>,
    pub(super) kept: Option<[usize; 2]>,
    pub(super) parameters: Option<&'static str>,
    /// How many of the points lie beyond its borders.
    pub(super) beyond: usize,
    /// The points that count, with their indices in the file.
    pub(super) used: Vec<u32>,
    pub(super) points: Vec<DVec3>,
    /// Where on the surface the fit saw each of `points`, if it says so: a good guess of the nearest place.
    pub(super) feet: Option<Vec<DVec2>>,
    /// The surfaces that the fit met on its way; none where there was no search.
    pub(super) met: Met,
    /// Which of `points` the fit did not see.
    pub(super) held_out: Vec<bool>,
    pub(super) spacing: f64,
    pub(super) noise: f64,
    pub(super) triangles: Option<Vec<[u32; 3]>>,
    /// Whether the scan came with them.
    pub(super) is_mesh: bool,
    /// Whether the surface could intersect itself.
    pub(super) may_cross: bool,
    /// What of the surface is left where it was cut down to the scan; before that, what will be, where it is known.
    pub(super) trimming: Option<Trimming>,
    /// What finds the nearest place of the scan, once it was needed.
    pub(super) near: OnceLock<Nearest>,
}

impl Part {
    /// What finds the nearest place of the points, or of the triangles between them.
    pub(super) fn nearest(&self) -> &Nearest {
        self.near.get_or_init(|| self.scanned(false).nearest())
    }

    /// What the surface stands for.
    fn scanned(&self, stays_closed: bool) -> Scanned<'_> {
        Scanned {
            points: &self.points,
            triangles: self.triangles.as_deref(),
            is_mesh: self.is_mesh,
            spacing: self.spacing,
            stays_closed,
        }
    }

    /// Cuts the surface down to the scan, if that is asked for, and notes what was done.
    pub(super) fn trim(&mut self, options: &Options, notes: &mut Notes) -> Result<()> {
        if options.trim == Trim::Off {
            return Ok(());
        }
        let found = match self.trimming.take() {
            Some(known) => known,
            None => {
                let scan = self.scanned(options.trim == Trim::Auto);
                let crosses = self.may_cross.then(|| {
                    let [low, high] = bounding_box(&self.points);
                    low.distance(high)
                });
                trimming_near(&self.surface, &scan, self.nearest(), crosses)?
            }
        };
        if !found.is_cut() {
            let told = found.covered > LITTLE;
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
            return Ok(());
        }
        // Known feet move with the seam.
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
        let gaps = match found.covered > LITTLE {
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
        Ok(())
    }

    /// The surface, of which this face is what is left, in numbers, with what its size buys.
    pub(super) fn summary(&self, trade: Trade, face: &Face) -> SurfaceSummary {
        SurfaceSummary {
            topology: self.topology,
            degree: self.surface.degree(),
            control_points: self.surface.distinct_counts(),
            rational: self.surface.is_rational(),
            closed: self.topology.closed(),
            periodic: self.surface.periodic(),
            trimmed: self.trimming.is_some(),
            kept: self.kept,
            parameters: self.parameters.map(Into::into),
            curvature_variation: curvature_variation(face),
            trade: trade.curve,
            knee: trade.knee,
            neighbours: trade.neighbours,
            ended: self.not_met.clone(),
        }
    }
}

impl Fitted {
    /// The faces as a CAD file shall hold them, each a shell of its own: a solid where it closes.
    pub(super) fn model(&self, name: &str, unit: Unit) -> Result<Model> {
        let mut model = Model::new(name);
        model.unit = unit;
        model.colour = Some(COLOUR);
        for part in &self.parts {
            let [low, high] = part.surface.bounding_box();
            let diagonal = low.distance(high);
            let face = match &part.trimming {
                Some(trimming) => {
                    model.add_trimmed_surface(trimming, SAME * diagonal, GAP * diagonal)?
                }
                None => model.add_whole_surface(&part.surface, SAME * diagonal)?,
            };
            model.add_shell_of(face)?;
        }
        Ok(model)
    }

    /// The sides of the box around the points that count.
    pub(super) fn extents(&self) -> [f64; 3] {
        let boxes = self.parts.iter().map(|part| bounding_box(&part.points));
        let both = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| [a.min(c), b.max(d)];
        let whole = boxes.reduce(both);
        whole.map_or([0.0; 3], |[low, high]| (high - low).to_array())
    }

    /// What the deviation is judged by, where a tolerance was asked for.
    pub(super) fn asked(&self, options: &Options) -> Option<Asked> {
        let tolerance = self.tolerance.asked()?;
        Some(Asked {
            tolerance,
            within: self.share(options),
        })
    }

    /// The share of the points that a tolerance demands.
    pub(super) fn share(&self, options: &Options) -> f64 {
        options.within.unwrap_or(match self.grid {
            Some(_) => 1.0,
            None => USUAL_SHARE,
        })
    }

    /// What of each surface counts, where that is not all of it.
    pub(super) fn regions(&self) -> Result<Vec<Option<Region>>> {
        let region = |part: &Part| {
            let trimming = part.trimming.as_ref();
            trimming.map(Trimming::region).transpose()
        };
        self.parts.iter().map(region).collect()
    }

    /// Distinct control points of all surfaces.
    pub(super) fn control_points(&self) -> usize {
        let count = |part: &Part| {
            part.surface
                .distinct_counts()
                .into_iter()
                .product::<usize>()
        };
        self.parts.iter().map(count).sum()
    }

    /// The budget is a promise: what cannot be had within it is not written.
    pub(super) fn check_budget(&self, options: &Options) -> Result<()> {
        let Some(budget) = options.max_control_points else {
            return Ok(());
        };
        for part in &self.parts {
            let [m, n] = part.surface.distinct_counts();
            let [p, q] = part.surface.degree();
            if m * n > budget {
                return Err(Error::NoSolution(format!(
                    "a {} of degree {p} x {q} takes {m} x {n} control points here, which is over the budget of \
                     {budget}: allow more, or a lower degree",
                    part.topology.name()
                )));
            }
        }
        Ok(())
    }
}

/// The tolerance aimed at, and where it comes from.
#[derive(Clone, Debug)]
pub(super) struct Tolerance {
    pub(super) value: f64,
    /// `option`, or how it was chosen.
    pub(super) source: String,
    is_asked: bool,
    /// What the data can carry, whatever was asked for.
    carried: f64,
    /// Whether that is set by noise.
    noisy: bool,
}

impl Tolerance {
    /// The tolerance where one was asked for.
    pub(super) fn asked(&self) -> Option<f64> {
        self.is_asked.then_some(self.value)
    }

    /// What the knots of a fit aim at: what the data can carry, or less where less was asked for of data without noise
    /// that counts.
    pub(super) fn aim(&self) -> f64 {
        match self.noisy {
            true => self.carried,
            false => self.value.min(self.carried),
        }
    }

    /// The tolerance, or what the noise of a part leaves of it.
    pub(super) fn told(&self, noise: f64) -> f64 {
        self.value.max(TOLERANCE_OF_SIGMA * noise)
    }

    /// The tolerance asked for, or one that the data can carry.
    pub(super) fn choose(options: &Options, scan: &Scan, noise: f64, diagonal: f64) -> Self {
        let by_noise = TOLERANCE_OF_SIGMA * noise;
        let by_size = TOLERANCE_OF_DIAGONAL * diagonal;
        let noisy = by_noise > by_size;
        let carried = by_noise.max(by_size);
        if let Some(length) = options.tolerance {
            return Self {
                value: length.resolve(scan.unit, diagonal),
                source: "option".into(),
                is_asked: true,
                carried,
                noisy,
            };
        }
        let source = match noisy {
            true => "three times the measured noise",
            false => "0.05 % of the scan's diagonal; the measured noise is smaller",
        };
        Self {
            value: carried,
            source: source.into(),
            is_asked: false,
            carried,
            noisy,
        }
    }
}
