//! A fit under way: the network, the points and their feet, and one step of the solution.
//!
//! A step solves one sparse linear least-squares problem over the whole network and finds the feet of all points anew:
//!
//! ```text
//! sum w tangent distance^2 + c sum |C_e(t) - X|^2 + lambda s sum phi_f E_f + w_j sum J^2 + g sum gluing^2 + q sum stars^2
//! ```
//!
//! with s the ratio of the traces of data and bending. Faces that fold, or whose edges jump, get a larger phi: in the limit
//! a face is a thin plate between its edges.
//!
//! Source: ours, docs/network.md.

mod folds;
mod middles;
pub(super) mod release;

use super::Target;
use super::feet;
use super::joins::{self, JoinWeights};
use super::lines::LineSamples;
use super::network::{Edge, Network, number};
use super::stars::Stars;
use super::system::{Pattern, Symmetric};
use super::terms::{
    FaceTerms, ON_LINE_WEIGHT, Samples, add_blocks, add_scalars, bending, distances, evenness,
};
use super::ways::along_normals;
use crate::layout::{EdgeKind, Layout, OnFace};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::parallel::{each, each_light, gather};
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};
use nurbskin_geometry::unit::{grouped, percent};
use nurbskin_scan::mesh::Manifold;

/// Weights of one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    /// Of bending, as a share of the data.
    pub(super) bending: f64,
    /// Of the part of bending along the surface, as a share of the data.
    pub(super) even: f64,
    /// Of jumps, gluing and stars: times the squared diagonal, and the number of points over [`REFERENCE_POINTS`].
    pub(super) jump: f64,
    pub(super) gluing: f64,
    pub(super) stars: f64,
    /// Samples of jumps per span.
    pub(super) per_span: usize,
    /// Whether unknowns move along the normals only, where no face is stiff.
    pub(super) along_normals: bool,
}

/// Points for which the weights were found. Count.
/// Trial: scans of 6000 to 36 000 points.
const REFERENCE_POINTS: f64 = 2e4;
/// Share of the distance across the normal.
/// Trial: with it points slide 18 % of the control points away (docs/network.md).
const SLIDE: f64 = 0.02;
/// Weight of a point on a line, for its curve; and of the same in the first fit.
/// Trial: on fandisk and aorta.
const LINE_WEIGHT: f64 = 5.0;
const FIRST_LINE_WEIGHT: f64 = 20.0;
/// Points up to which the middles of the triangles are further points, so that faces with few points do not fold. Count.
/// Trial: not recorded.
const FEW_POINTS: usize = 25_000;
/// Sides of a typical triangle, by area, from which on a triangle is large.
/// Guard: a hole of the scan is filled with triangles of its own size, and nothing else holds the surface there.
const LARGE: f64 = 3.0;
/// Most parts that its sides are divided into. Count. Guard: bounds the number of middles.
const MOST_PARTS: f64 = 16.0;
/// Weight of such a middle.
/// Trial: not recorded; far below a point.
const MIDDLE_WEIGHT: f64 = 0.15;
/// Weight of the last solution, as a share of the mean diagonal.
/// Trial: see docs/network.md.
const DAMPING: f64 = 3e-6;
/// Factor of phi for a bad face. Dimensionless.
/// Trial: 2 and 4 on fandisk, aorta, banana and bottle; with 4 the tolerance suffers.
const STIFFER: f64 = 2.0;
/// Factor of phi for a face beside a bad one. Dimensionless.
/// Trial: over 24 layouts of fandisk 3.5 faces are bad with [`SOFTER`] there, 1.5 with 1.5, 2.0 with 2.
const BESIDE: f64 = 1.5;
/// Factor of phi for a good face. Dimensionless. Trial: as above, not varied alone.
pub(super) const SOFTER: f64 = 0.84;
/// Largest phi. Dimensionless.
/// Guard: keeps the equations well conditioned; a face reaches it after nine bad steps.
const MOST_STIFF: f64 = 300.0;
/// Factor of the evenness of a squeezed face, and the largest. Dimensionless.
/// Trial: with it the largest jumps of fandisk, bottle and bunny fall from 1.0, 0.17 and 0.12 to 0.25, 0.14 and 0.11 degrees, other
/// scans and all control points stay as they are.
const EVENER: f64 = 3.0;
/// Guard: as even as while the network relaxes.
const MOST_EVEN: f64 = 100.0;
/// Weight of a point where the mesh passes through itself. Dimensionless.
/// Trial: as of points that are let go later (`mend`). On a head 241 pairs of triangles cross; at first 512 to 1534 pairs of its
/// networks do, without this 1236 to 3926.
const CROSSED_WEIGHT: f64 = 0.03;
/// Shortest chord of an edge, and shortest length of a face, in the terms. Shares of the diagonal.
/// Guard: they are divided by.
const LEAST_CHORD: f64 = 1e-2;
const LEAST_LENGTH: f64 = 1e-3;
/// Vertices of the mesh that the network relaxes over. Count.
/// Trial: not recorded; some ten for each unknown before knots are added.
const MOST_ANCHORS: usize = 25_000;
/// Vertices among which the one nearest to a point, with an agreeing normal, is sought. Count.
/// Guard: thin walls have as many on their other side.
const CANDIDATES: usize = 8;

/// A fit under way.
#[derive(Clone)]
pub(super) struct Fit<'a> {
    pub(super) network: Network,
    pub(super) samples: Samples,
    pub(super) lines: LineSamples,
    /// The first so many samples are points, the others middles of triangles.
    pub(super) counted: usize,
    pub(super) diagonal: f64,
    /// Weights of the samples as points of their kind.
    pub(super) weights: Vec<f64>,
    stars: Stars,
    /// Fairness of each face, phi.
    fairness: Vec<f64>,
    /// Least factor of the evenness of each face, whatever phi.
    evenness: Vec<f64>,
    mesh: &'a Manifold,
    /// Vertices of the mesh that stand for it, by index: all of a small one.
    anchors: Vec<u32>,
    anchor_normals: Vec<DVec3>,
    anchor_tree: Neighbours,
    /// Weight of a point at each of them.
    anchor_weights: Vec<f64>,
    pattern: Option<Pattern>,
    progress: &'a dyn Progress,
}

/// Unit normals of the vertices of a mesh, weighted by angle.
///
/// Source: G. Thuermer, C. Wuethrich, *Computing vertex normals from polygonal facets*, 1998.
pub(super) fn vertex_normals(mesh: &Manifold) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.points.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let corners = mesh.corners(t);
        let normal = mesh.vector_area(t).normalize_or_zero();
        for k in 0..3 {
            let [a, b] = [1, 2].map(|d| corners[(k + d) % 3] - corners[k]);
            normals[triangle[k] as usize] += math::angle_between(a, b) * normal;
        }
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

impl<'a> Fit<'a> {
    /// The first fit over the vertices of a mesh: plain distances from the first places of the layout.
    pub(super) fn start(
        target: &Target<'a>,
        layout: &Layout,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let Target { mesh, crossed, .. } = *target;
        let network = Network::new(layout, &[0.5])?;
        let mesh_normals = vertex_normals(mesh);
        let mut on_line = vec![false; mesh.points.len()];
        for on in &layout.on_lines {
            if let Some(flag) = on_line.get_mut(on.vertex as usize) {
                *flag = true;
            }
        }
        let weight = |&k: &u32| match (on_line[k as usize], crossed.get(k as usize)) {
            (true, _) => ON_LINE_WEIGHT,
            (false, Some(true)) => CROSSED_WEIGHT,
            (false, _) => 1.0,
        };
        let anchors = thinned(&mesh.points, MOST_ANCHORS);
        let of = |list: &[DVec3]| gather(list, &anchors);
        let weights: Vec<f64> = anchors.iter().map(weight).collect();
        let counted = anchors.len();
        let [low, high] = bounding_box(&mesh.points);
        let mut fit = Self {
            lines: LineSamples::new(&network, &mesh.points, &layout.on_lines),
            stars: Stars::new(&network),
            fairness: vec![1.0; network.faces.len()],
            evenness: vec![1.0; network.faces.len()],
            samples: Samples {
                points: of(&mesh.points),
                normals: of(&mesh_normals),
                weights: weights.clone(),
                feet: gather(&layout.start, &anchors),
                distances: vec![f64::INFINITY; counted],
            },
            network,
            counted,
            diagonal: low.distance(high),
            anchor_weights: weights.clone(),
            weights,
            mesh,
            anchor_tree: Neighbours::new(&of(&mesh.points)),
            anchor_normals: of(&mesh_normals),
            anchors,
            pattern: None,
            progress,
        };
        let first = Weights {
            bending: 1.0,
            even: 0.0,
            jump: 0.0,
            gluing: 0.0,
            stars: 0.0,
            per_span: 1,
            along_normals: false,
        };
        fit.solve(&first, 1.0, FIRST_LINE_WEIGHT, 0.0)?;
        fit.add_middles(target, |_, vertex| layout.start[vertex as usize]);
        fit.find_feet(0.0);
        Ok(fit)
    }

    /// The middles of the triangles as further points; each begins at the foot of a corner. Of large triangles, as fill a hole
    /// of the scan, those of their parts; of all others only where points are few.
    fn add_middles(&mut self, target: &Target<'_>, foot: impl Fn(&Self, u32) -> OnFace) {
        let few = self.counted < FEW_POINTS && self.mesh.points.len() < FEW_POINTS;
        let area = |t: usize| self.mesh.vector_area(t).length();
        let mut areas: Vec<f64> = (0..self.mesh.triangles.len()).map(area).collect();
        let typical = median_in_place(&mut areas).max(f64::MIN_POSITIVE);
        for (t, triangle) in self.mesh.triangles.iter().enumerate() {
            let normal = self.mesh.vector_area(t).normalize_or_zero();
            let parts = (area(t) / typical).sqrt().floor().clamp(1.0, MOST_PARTS);
            let large = parts >= LARGE;
            if normal == DVec3::ZERO || !(few || large) {
                continue;
            }
            let corners = self.mesh.corners(t);
            let parts = if large { parts } else { 1.0 };
            let foot = foot(self, triangle[0]);
            let is_crossed = |v: &u32| target.crossed.get(*v as usize) == Some(&true);
            let weight = match !target.untangled && triangle.iter().any(is_crossed) {
                true => CROSSED_WEIGHT * MIDDLE_WEIGHT,
                false => MIDDLE_WEIGHT,
            };
            for middle in middles::of_parts(&corners, parts) {
                self.samples.points.push(middle);
                self.samples.normals.push(normal);
                self.samples.weights.push(weight);
                self.samples.feet.push(foot);
                self.samples.distances.push(f64::INFINITY);
            }
        }
        self.weights.clone_from(&self.samples.weights);
    }

    /// Goes over to some points of the target, by index. Normals are turned to the side of the mesh's.
    pub(super) fn follow(&mut self, target: &Target, which: &[u32]) {
        let feet = self.anchor_feet();
        let found = each_light(which.len(), |i| {
            let k = which[i] as usize;
            let (point, normal) = (target.points[k], target.normals[k]);
            let anchor = self.anchor_near(point, normal);
            let flipped = normal.dot(self.anchor_normals[anchor]) < 0.0;
            (
                feet[anchor],
                if flipped { -normal } else { normal },
                self.anchor_weights[anchor],
            )
        });
        self.samples = Samples {
            points: which.iter().map(|&k| target.points[k as usize]).collect(),
            normals: found.iter().map(|f| f.1).collect(),
            weights: found.iter().map(|f| f.2).collect(),
            feet: found.iter().map(|f| f.0).collect(),
            distances: vec![f64::INFINITY; which.len()],
        };
        self.counted = which.len();
        self.weights.clone_from(&self.samples.weights);
        self.add_middles(target, |fit, vertex| {
            // Small meshes are their own anchors.
            if feet.len() == fit.mesh.points.len() {
                return feet[vertex as usize];
            }
            let near = fit.anchor_tree.nearest(fit.mesh.points[vertex as usize], 1);
            near.first()
                .map_or_else(OnFace::default, |&k| feet[k as usize])
        });
        self.find_feet(0.0);
    }

    /// The feet of the anchors: those of the samples while they are the anchors, else found anew.
    fn anchor_feet(&self) -> Vec<OnFace> {
        let count = self.anchors.len();
        let points = gather(&self.mesh.points, &self.anchors);
        if self.counted == count && self.samples.points[..count] == points[..] {
            return self.samples.feet[..count].to_vec();
        }
        let first = self.samples.feet.first().copied().unwrap_or_default();
        let mut samples = Samples {
            points,
            normals: self.anchor_normals.clone(),
            weights: Vec::new(),
            feet: vec![first; count],
            distances: vec![f64::INFINITY; count],
        };
        let all: Vec<u32> = (0..number(count)).collect();
        feet::anywhere(&self.network, &mut samples, &all);
        samples.feet
    }

    /// The nearest anchor whose normal agrees with that of a point or its opposite.
    fn anchor_near(&self, point: DVec3, normal: DVec3) -> usize {
        let mut found = Nearest::default();
        self.anchor_tree
            .search(point, CANDIDATES, &mut found, |_| true);
        let agrees = |&k: &u32| self.anchor_normals[k as usize].dot(normal).abs() >= feet::AGREE;
        found
            .indices()
            .find(agrees)
            .or_else(|| found.indices().next())
            .unwrap_or(0) as usize
    }

    /// Feet of all points: near the last ones, and all over for those beyond `limit` or with a normal that disagrees.
    pub(super) fn find_feet(&mut self, limit: f64) {
        feet::near(&self.network, &mut self.samples);
        let doubtful = feet::doubtful(&self.network, &self.samples, limit);
        feet::anywhere(&self.network, &mut self.samples, &doubtful);
        self.lines.project(&self.network, limit);
    }

    /// The last feet, with a second look all over at every point beyond `limit`.
    pub(super) fn finish_feet(&mut self, limit: f64) {
        let doubtful: Vec<u32> = (0_u32..)
            .zip(self.distances())
            .filter(|d| *d.1 > limit)
            .map(|d| d.0)
            .collect();
        feet::anywhere(&self.network, &mut self.samples, &doubtful);
    }

    /// Solves once, without new feet.
    fn solve(
        &mut self,
        weights: &Weights,
        slide: f64,
        line_weight: f64,
        damping: f64,
    ) -> Result<()> {
        self.progress.check()?;
        let scale = self.diagonal * self.diagonal * self.counted as f64 / REFERENCE_POINTS;
        let chords = self.network.chords(LEAST_CHORD * self.diagonal);
        let joins = JoinWeights {
            jump: weights.jump * scale,
            gluing: weights.gluing * scale,
            per_span: weights.per_span,
        };
        let elements = joins::elements(&self.network, &chords, &joins);
        let known = self.pattern.take();
        let mut pattern = known.unwrap_or_else(|| Pattern::new(&self.network, &elements));
        let by_face = self.samples.by_face(self.network.faces.len());
        let faces = &self.network.faces;
        let mut terms: Vec<(FaceTerms, Vec<f64>, Vec<Symmetric>, f64)> = each(faces.len(), |k| {
            let open = faces[k].open(&self.network.edges);
            let data = distances(&faces[k], open, &self.samples, &by_face[k], slide);
            let lengths = self.network.lengths(&faces[k], &chords);
            let lengths = lengths.map(|l| l.max(LEAST_LENGTH * self.diagonal));
            let (plate, trace) = bending(&faces[k], lengths);
            let even = if weights.even > 0.0 {
                evenness(&faces[k], lengths)
            } else {
                Vec::new()
            };
            (data, plate, even, trace)
        });
        let data: f64 = terms.iter().map(|t| t.0.trace).sum();
        let plates: f64 = terms.iter().map(|t| t.3).sum();
        let stiffness = data / plates.max(f64::MIN_POSITIVE);
        let mut system = pattern.system();
        for (k, (data, plate, even, _)) in terms.iter_mut().enumerate() {
            let phi = self.fairness[k];
            add_scalars(&mut data.stencil, plate, weights.bending * stiffness * phi);
            let even_phi = phi.max(self.evenness[k]);
            add_blocks(&mut data.stencil, even, weights.even * stiffness * even_phi);
            pattern.add_face(&mut system, k, &faces[k].rows, &data.stencil, &data.rhs);
        }
        for element in &elements {
            pattern.add_element(&mut system, element, 1.0);
        }
        if weights.stars > 0.0 {
            for star in self.stars.rows(&self.network, &chords) {
                pattern.add_row(
                    &mut system,
                    &star.row,
                    weights.stars * scale * star.weight,
                    star.target,
                );
            }
        }
        // A thinned mesh has fewer points on its lines than the scan would.
        let line_weight =
            line_weight * (self.counted as f64 / self.mesh.points.len() as f64).max(1.0);
        // A stiff face must not bend a sharp line: across it lies the other face. A border gives way.
        let stiffest = |e: u32| {
            let Edge { kind, uses, .. } = &self.network.edges[e as usize];
            let fairness = uses.iter().map(|used| self.fairness[used.face as usize]);
            match kind {
                EdgeKind::Open => 1.0,
                EdgeKind::Sharp | EdgeKind::Smooth => fairness.fold(1.0, f64::max),
            }
        };
        let lines = &self.lines;
        for (k, (&(e, t), own)) in lines.feet.iter().zip(&lines.weights).enumerate() {
            let weight = line_weight * stiffest(e) * own;
            let basis = Network::edge_basis(&self.network.edges[e as usize], t);
            let row = basis.map(|(k, [value, _])| (k, value));
            pattern.add_row(&mut system, &row, weight, lines.points[k]);
        }
        let ways = match weights.along_normals {
            true => {
                let stiff: Vec<bool> = self.fairness.iter().map(|phi| *phi > 1.0).collect();
                along_normals(&self.network, &stiff)
            }
            false => vec![None; self.network.unknowns()],
        };
        self.network.x = pattern.solve(system, &self.network.x, damping, &ways)?;
        self.network.update_nets();
        self.pattern = Some(pattern);
        Ok(())
    }

    /// One step: solves and finds the feet anew, all over for points beyond `limit`.
    pub(super) fn step(&mut self, weights: &Weights, limit: f64) -> Result<()> {
        self.solve(weights, SLIDE, LINE_WEIGHT, DAMPING)?;
        self.find_feet(limit);
        Ok(())
    }

    /// Forgets the pattern, after knots were added.
    pub(super) fn knots_changed(&mut self) {
        self.pattern = None;
    }

    /// Makes faces that fold smoother while the network relaxes, but for those at lines and borders: a stiff face would bend
    /// these.
    pub(super) fn judge_free_faces(&mut self) {
        let bad = self.crooked_faces();
        let edges = &self.network.edges;
        for ((phi, bad), face) in self.fairness.iter_mut().zip(bad).zip(&self.network.faces) {
            let hard = face
                .sides
                .iter()
                .any(|side| edges[side.edge as usize].kind.is_hard());
            if !hard {
                *phi = (*phi * if bad { STIFFER } else { SOFTER }).clamp(1.0, MOST_STIFF);
            }
        }
    }

    /// Faces that fold or whose edges jump get smoother, those beside them a little; others are made `softer`. The parameters of
    /// squeezed faces get more even. Returns which are bad.
    pub(super) fn judge_faces(&mut self, softer: f64) -> Vec<bool> {
        let bad = self.crooked_faces();
        let squeezed = self.squeezed_faces();
        for (even, squeezed) in self.evenness.iter_mut().zip(squeezed) {
            let factor = if squeezed { EVENER } else { SOFTER };
            *even = (*even * factor).clamp(1.0, MOST_EVEN);
        }
        let mut beside = vec![false; bad.len()];
        for edge in &self.network.edges {
            let is_bad = edge.uses.iter().any(|used| bad[used.face as usize]);
            if is_bad && edge.kind == EdgeKind::Smooth {
                for used in &edge.uses {
                    beside[used.face as usize] = true;
                }
            }
        }
        for ((phi, &bad), beside) in self.fairness.iter_mut().zip(&bad).zip(beside) {
            let factor = match (bad, beside) {
                (true, _) => STIFFER,
                (false, true) => BESIDE,
                (false, false) => softer,
            };
            *phi = (*phi * factor).clamp(1.0, MOST_STIFF);
        }
        bad
    }

    /// The distances of the points.
    pub(super) fn distances(&self) -> &[f64] {
        &self.samples.distances[..self.counted]
    }

    /// Share of the points beyond a distance.
    pub(super) fn beyond(&self, distance: f64) -> f64 {
        let beyond = self.distances().iter().filter(|&&d| d > distance).count();
        beyond as f64 / self.counted.max(1) as f64
    }

    /// A quantile of the distances.
    pub(super) fn quantile(&self, share: f64) -> f64 {
        quantile_in_place(&mut self.distances().to_vec(), share)
    }

    /// Tells the progress how far the fit is.
    pub(super) fn say(&self, step: &str, tolerance: f64) {
        self.progress.tell(&format!(
            "{step}: {} faces, {} control points, {} of the points within",
            self.network.faces.len(),
            grouped(self.network.unknowns()),
            percent(1.0 - self.beyond(tolerance))
        ));
    }
}

/// Every so manieth point along a space-filling curve, at most `most`, ascending.
pub(super) fn thinned(points: &[DVec3], most: usize) -> Vec<u32> {
    if points.len() <= most {
        return (0..number(points.len())).collect();
    }
    let order = spatial_order(points, |p| p.is_finite());
    let step = order.len().div_ceil(most);
    let mut some: Vec<u32> = order.into_iter().step_by(step).collect();
    some.sort_unstable();
    some
}
