//! The order of steps of a fit.
//!
//! ```text
//! start ─▶ relax (8 steps, one knot per side) ─▶ refine (knots, 2 steps)* ─▶ finish (8 steps, jumps weigh more) ─▶ Fitted
//! ```
//!
//! Each step solves one sparse linear least-squares problem over the whole network and finds the feet of all points anew:
//!
//!   sum w tangent distance^2 + c sum |C_e(t) - X|^2 + lambda s sum phi_f E_f + w_j sum J^2 + g sum gluing^2 + q sum stars^2
//!
//! with s the ratio of the traces of data and bending. Faces that fold, or whose edges jump, get a larger phi: in the limit
//! a face is a thin plate between its edges.
//!
//! Source: ours, docs/network.md.

use super::feet;
use super::joins::{self, JoinWeights, smooth_uses};
use super::lines::LineSamples;
use super::network::Network;
use super::refine::refine;
use super::stars::Stars;
use super::system::Pattern;
use super::terms::{FaceTerms, Samples, add_scalars, bending, distances};
use super::{FitOptions, Target};
use crate::layout::Layout;
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_geometry::{Error, Result};

/// Weights of one step.
#[derive(Clone, Copy, Debug)]
struct Weights {
    /// Of bending, as a share of the data.
    bending: f64,
    /// Of jumps, gluing and stars: times the squared diagonal, and the number of points over [`REFERENCE_POINTS`].
    jump: f64,
    gluing: f64,
    stars: f64,
    /// Samples of jumps per span.
    per_span: usize,
}

/// Points for which the weights were found. Count.
/// Trial: scans of 6000 to 36 000 points.
const REFERENCE_POINTS: f64 = 2e4;
/// Weights while the layout relaxes; bending halves with each step.
/// Trial: on banana, bunny and fandisk (docs/network.md).
const RELAX: Weights = Weights { bending: 0.1, jump: 1e-2, gluing: 1e-3, stars: 1e-3, per_span: 2 };
/// Weights while knots are added.
/// Trial: as above.
const REFINE: Weights = Weights { bending: 1e-3, jump: 1e-2, gluing: 3e-4, stars: 3e-4, per_span: 2 };
/// Weights at the end.
/// Trial: as above.
const FINISH: Weights = Weights { bending: 1e-3, jump: 1e-1, gluing: 1e-4, stars: 1e-4, per_span: 4 };
/// Share of the distance across the normal.
/// Trial: with it points slide 18 % of the control points away (docs/network.md).
const SLIDE: f64 = 0.02;
/// Weight of a point on a line, for its curve; and of the same in the first fit.
/// Trial: as above.
const LINE_WEIGHT: f64 = 5.0;
const FIRST_LINE_WEIGHT: f64 = 20.0;
/// Weight of a point on a line as a point of the faces: its normal says little.
const ON_LINE_WEIGHT: f64 = 1e-3;
/// Scans of fewer points get the middles of their triangles as further points, of this weight, so that faces with few points do
/// not fold.
const FEW_POINTS: usize = 25_000;
const MIDDLE_WEIGHT: f64 = 0.15;
/// Steps of the parts of the schedule. Counts.
/// Trial: as above.
const RELAX_STEPS: usize = 8;
const STEPS_PER_ROUND: usize = 2;
const FINISH_STEPS: usize = 8;
const MOST_ROUNDS: usize = 12;
/// Jump at which a face is taken for folded. Radians: one degree.
const BAD_JUMP: f64 = 0.0175;
/// Factors of phi for a bad face and a good one, and its bounds.
/// Trial: as above.
const STIFFER: f64 = 4.0;
const SOFTER: f64 = 0.7;
const MOST_STIFF: f64 = 1000.0;
/// Samples of a face along u and v in the search for folds. Count.
const FOLD_SAMPLES: usize = 10;
/// Largest weight of a point out of tolerance at the end (C. Lawson's weights), and how much of the tolerance it counts from.
const MOST_LAWSON: f64 = 16.0;
const LAWSON_FROM: f64 = 1.2;

/// A fit under way.
pub(super) struct Fit<'a> {
    pub(super) network: Network,
    stars: Stars,
    pub(super) samples: Samples,
    pub(super) lines: LineSamples,
    /// The first so many samples are points of the scan.
    pub(super) counted: usize,
    /// Weights of the samples before Lawson's.
    weights: Vec<f64>,
    /// Fairness of each face, phi.
    fairness: Vec<f64>,
    tree: Neighbours,
    vertex_normals: &'a [DVec3],
    diagonal: f64,
    pattern: Option<Pattern>,
    progress: &'a dyn Progress,
}

impl<'a> Fit<'a> {
    /// The first fit: plain distances from the first parameters of the layout.
    pub(super) fn start(target: &Target<'a>, layout: &Layout, progress: &'a dyn Progress) -> Result<Self> {
        let network = Network::new(layout, &[0.5])?;
        let counted = target.points.len();
        if layout.start.len() != counted {
            return Err(Error::invalid("a layout has a first place for each vertex of its mesh"));
        }
        let mut samples = Samples {
            points: target.points.to_vec(),
            normals: target.normals.to_vec(),
            weights: vec![1.0; counted],
            feet: layout.start.clone(),
            distances: vec![0.0; counted],
        };
        for on in &layout.on_lines {
            if let Some(w) = samples.weights.get_mut(on.vertex as usize) {
                *w = ON_LINE_WEIGHT;
            }
        }
        let lines = LineSamples::new(&network, target.points, &layout.on_lines);
        let stars = Stars::new(&network);
        let fairness = vec![1.0; network.faces.len()];
        let weights = samples.weights.clone();
        let mut fit = Self {
            network,
            stars,
            samples,
            lines,
            counted,
            weights,
            fairness,
            tree: Neighbours::new(target.points),
            vertex_normals: target.normals,
            diagonal: target.diagonal,
            pattern: None,
            progress,
        };
        fit.solve(&Weights { bending: 1.0, jump: 0.0, gluing: 0.0, stars: 0.0, per_span: 1 }, 1.0, FIRST_LINE_WEIGHT)?;
        if counted < FEW_POINTS {
            fit.add_middles(target);
        }
        fit.find_feet(0.0);
        Ok(fit)
    }

    /// The middles of the triangles as further points; each begins at the foot of a corner.
    fn add_middles(&mut self, target: &Target) {
        for triangle in target.triangles {
            let [a, b, c] = triangle.map(|k| target.points[k as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal == DVec3::ZERO {
                continue;
            }
            let nearest = triangle.map(|k| k as usize);
            self.samples.points.push((a + b + c) / 3.0);
            self.samples.normals.push(normal);
            self.samples.weights.push(MIDDLE_WEIGHT);
            self.samples.feet.push(self.samples.feet[nearest[0]]);
            self.samples.distances.push(f64::INFINITY);
        }
        self.weights.clone_from(&self.samples.weights);
    }

    /// Feet of all points: near the last ones, and all over for those beyond `limit` or with a normal that disagrees.
    fn find_feet(&mut self, limit: f64) {
        feet::near(&self.network, &mut self.samples);
        let doubtful = feet::doubtful(&self.network, &self.samples, limit);
        feet::anywhere(&self.network, &mut self.samples, &doubtful);
        self.lines.project(&self.network);
    }

    /// Solves once, without new feet.
    fn solve(&mut self, weights: &Weights, slide: f64, line_weight: f64) -> Result<()> {
        self.progress.check()?;
        let scale = self.diagonal * self.diagonal * self.counted as f64 / REFERENCE_POINTS;
        let chords = self.network.chords(1e-2 * self.diagonal);
        let joins = JoinWeights {
            jump: weights.jump * scale,
            gluing: weights.gluing * scale,
            per_span: weights.per_span,
        };
        let elements = joins::elements(&self.network, &chords, &joins);
        let pattern = match self.pattern.take() {
            Some(pattern) => pattern,
            None => Pattern::new(&self.network, &elements)?,
        };
        let by_face = self.samples.by_face(self.network.faces.len());
        let faces = &self.network.faces;
        let short = 1e-3 * self.diagonal;
        let mut terms: Vec<(FaceTerms, Vec<f64>, f64)> = each(faces.len(), |k| {
            let data = distances(&faces[k], &self.samples, &by_face[k], slide);
            let lengths = self.network.lengths(&faces[k], &chords).map(|l| l.max(short));
            let (plate, trace) = bending(&faces[k], lengths);
            (data, plate, trace)
        });
        let data: f64 = terms.iter().map(|t| t.0.trace).sum();
        let plates: f64 = terms.iter().map(|t| t.2).sum();
        let stiffness = weights.bending * data / plates.max(f64::MIN_POSITIVE);
        let mut system = pattern.system();
        for (k, (data, plate, _)) in terms.iter_mut().enumerate() {
            add_scalars(&mut data.stencil, plate, stiffness * self.fairness[k]);
            pattern.add_face(&mut system, k, &faces[k].rows, &data.stencil, &data.rhs);
        }
        for element in &elements {
            pattern.add_element(&mut system, element, 1.0);
        }
        for star in self.stars.rows(&self.network, &chords) {
            if weights.stars > 0.0 {
                pattern.add_row(&mut system, &star.row, weights.stars * scale * star.weight, star.target);
            }
        }
        for (k, &(e, t)) in self.lines.feet.iter().enumerate() {
            let basis = Network::edge_basis(&self.network.edges[e as usize], t);
            let row = basis.map(|(k, [value, _])| (k, value));
            pattern.add_row(&mut system, &row, line_weight, self.lines.points[k]);
        }
        self.network.x = pattern.solve(system)?;
        self.network.update_nets();
        self.pattern = Some(pattern);
        Ok(())
    }

    /// One step: solves and finds the feet anew.
    fn step(&mut self, weights: &Weights, limit: f64) -> Result<()> {
        self.solve(weights, SLIDE, LINE_WEIGHT)?;
        self.find_feet(limit);
        Ok(())
    }

    /// Faces that fold or whose edges jump get smoother, others less so. Returns how many are bad.
    fn judge_faces(&mut self) -> usize {
        let network = &self.network;
        let mut bad = each(network.faces.len(), |k| self.folds(k));
        let mut count = vec![0_u32; network.faces.len()];
        for foot in &self.samples.feet[..self.counted] {
            count[foot.face as usize] += 1;
        }
        let jumps = each(network.edges.len(), |k| {
            let edge = &network.edges[k];
            let uses = smooth_uses(edge)?;
            let jump = |t: f64| joins::jump(network, &uses, t);
            let worst = joins::samples(network, edge, 4).into_iter().map(jump).fold(0.0, f64::max);
            let [a, b] = uses.map(|used| used.face);
            // The emptier face gives way.
            let emptier = if count[b as usize] < count[a as usize] { b } else { a };
            (worst > BAD_JUMP).then_some(emptier)
        });
        for face in jumps.into_iter().flatten() {
            bad[face as usize] = true;
        }
        for (phi, &bad) in self.fairness.iter_mut().zip(&bad) {
            *phi = (*phi * if bad { STIFFER } else { SOFTER }).clamp(1.0, MOST_STIFF);
        }
        bad.iter().filter(|&&b| b).count()
    }

    /// Whether a face has a normal against those of the three nearest points.
    fn folds(&self, face: usize) -> bool {
        let patch = self.network.faces[face].patch();
        let at = |k: usize| 0.02 + 0.96 * k as f64 / (FOLD_SAMPLES - 1) as f64;
        (0..FOLD_SAMPLES * FOLD_SAMPLES).any(|k| {
            let jet = patch.tangents(at(k % FOLD_SAMPLES), at(k / FOLD_SAMPLES));
            let normal = jet.normal();
            let against = |&p: &u32| self.vertex_normals[p as usize].dot(normal) < 0.0;
            self.tree.nearest(jet.point, 3).iter().all(against)
        })
    }

    /// The distances of the scan's own points.
    pub(super) fn distances(&self) -> &[f64] {
        &self.samples.distances[..self.counted]
    }

    /// Share of the scan's points beyond the tolerance.
    fn beyond(&self, tolerance: f64) -> f64 {
        let beyond = self.distances().iter().filter(|&&d| d > tolerance).count();
        beyond as f64 / self.counted.max(1) as f64
    }

    /// Relaxes, refines and finishes.
    pub(super) fn run(&mut self, options: &FitOptions) -> Result<()> {
        let tolerance = options.tolerance;
        let mut weights = RELAX;
        for _ in 0..RELAX_STEPS {
            self.step(&weights, 0.25 * self.quantile(0.98))?;
            weights.bending *= 0.5;
        }
        self.say("relaxed", tolerance);
        for round in 0..MOST_ROUNDS {
            let full = self.network.control_points() >= options.max_control_points;
            if self.beyond(tolerance) <= 1.0 - options.share_within || full {
                break;
            }
            let part = if round < 3 { 0.5 } else { 0.25 };
            let limit = tolerance.max(part * self.quantile(0.98));
            let excess = self.distances().to_vec();
            let marks = refine(
                &mut self.network,
                &self.samples,
                &excess,
                &self.lines,
                limit,
                self.diagonal,
                options.max_control_points,
            )?;
            if marks == 0 {
                break;
            }
            self.pattern = None;
            self.judge_faces();
            for _ in 0..STEPS_PER_ROUND {
                self.step(&REFINE, tolerance)?;
            }
            let bad = self.judge_faces();
            self.say(&format!("round {round} bad {bad}"), tolerance);
        }
        for step in 0..FINISH_STEPS {
            for (k, (w, &own)) in self.samples.weights.iter_mut().zip(&self.weights).enumerate() {
                let pull = LAWSON_FROM * self.samples.distances[k] / tolerance;
                *w = if k < self.counted { own * (pull * pull).clamp(1.0, MOST_LAWSON) } else { own };
            }
            let mut weights = FINISH;
            if step == 0 {
                weights.jump *= 0.3;
            }
            if step + 2 >= FINISH_STEPS {
                weights.per_span = 6;
            }
            self.step(&weights, tolerance)?;
            let bad = self.judge_faces();
            self.say(&format!("finish {step} bad {bad}"), tolerance);
        }
        Ok(())
    }

    /// A quantile of the distances.
    fn quantile(&self, share: f64) -> f64 {
        quantile_in_place(&mut self.distances().to_vec(), share)
    }

    /// Tells the progress how far the fit is.
    fn say(&self, step: &str, tolerance: f64) {
        if std::env::var_os("NETWORK_LOG").is_none() {
            return;
        }
        let k = 1e3 / self.diagonal;
        let network = &self.network;
        let jumps = each(network.edges.len(), |e| {
            let edge = &network.edges[e];
            let Some(uses) = smooth_uses(edge) else { return Vec::new() };
            joins::samples(network, edge, 8).into_iter().map(|t| joins::jump(network, &uses, t).to_degrees()).collect::<Vec<_>>()
        });
        let over = |limit: f64| jumps.iter().filter(|j| j.iter().any(|&a| a > limit)).count();
        let mut all = jumps.concat();
        let max = all.iter().copied().fold(0.0, f64::max);
        let line = format!(
            "{step:16} cps {:6} unknowns {:6} p50 {:.3} p95 {:.3} p99 {:.3} max {:.2} over {:.4} | jump p95 {:.3} p99 {:.3} max {:.2} >.5 {} >.1 {} of {} lines {:.3}",
            network.control_points(),
            network.unknowns(),
            self.quantile(0.5) * k,
            self.quantile(0.95) * k,
            self.quantile(0.99) * k,
            self.distances().iter().copied().fold(0.0, f64::max) * k,
            self.beyond(tolerance),
            quantile_in_place(&mut all, 0.95),
            quantile_in_place(&mut all, 0.99),
            max,
            over(0.5),
            over(0.1),
            network.edges.len(),
            self.lines.distances.iter().copied().fold(0.0, f64::max) * k,
        );
        self.progress.tell(&line);
    }
}
