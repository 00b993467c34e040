//! A network of four-sided faces for a part of any shape.
//!
//! 1. The mesh of the part, its small holes filled (`charting::mesh_of`).
//! 2. The lines that stay sharp, and a layout of four-sided faces between them (`nurbskin_network::layout`).
//! 3. Least squares of all faces together to the points that count (`nurbskin_network::fit`).
//!
//! The stages are those of nurbskin-network; the tolerance and the treatment of outliers are those of single surfaces.

use super::outliers;
use super::part::{LinedMesh, Made, Task, is_gone, kept, seen};
use super::surfaces::{NetworkPart, PartShape};
use crate::deviation::verdict::USUAL_SHARE;
use apart::Apart;
use attempt::Attempt;
use glam::{DVec2, DVec3};
use nurbskin_cad::check::{FOLD, ShellDefects, shell_defects};
use nurbskin_cad::{FaceNetwork, JoinKind, Meant, Model, NetworkEdge, NetworkFace, normal_jumps};
use nurbskin_fit::charting::PointState;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::statistics::{median_in_place, quantile_in_place};
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::unit::counted;
use nurbskin_geometry::{Error, Result};
use nurbskin_network::fit::{FacePart, FaceSizes, FitOptions, Fitted, Target, fit_adaptive};
use nurbskin_network::layout::lines::{FeatureLines, Sharp};
use nurbskin_network::layout::{EdgeKind, LayoutOptions, Producer, Seeds};

mod apart;
mod attempt;
mod opened;

/// Most control points of a network where no budget is asked for. Count.
/// Guard: bounds time and memory; a network takes what its detail needs, and stops by itself.
const MOST_CONTROL_POINTS: usize = 40_000;
/// Share of the points within the aim of a fit without a requested tolerance. Dimensionless.
/// Guard: the share whose distance is reported first.
pub(super) const AUTOMATIC_SHARE: f64 = 0.95;
/// Standard deviation of a normal distribution, in median absolute deviations.
/// Derived: 1 / 0.6745, the upper quartile of the normal distribution.
const SIGMA_OF_MEDIAN: f64 = 1.4826;
/// Most fits with the feature lines, and as many without them, each over a layout with smaller faces where the last one folded,
/// jumped or intersected itself, or lost points to mends. Count.
/// Guard: bounds the time. Of eight bodies at 0.1 % of their diagonals whose first network is not sound, or misses the tolerance, a second
/// fit mends four and a third three; one stays unsound.
const MOST_ATTEMPTS: usize = 5;
/// Fits without a requested tolerance, after which one that intersects nothing is enough, even if faces are left out. Count.
/// Trial: a fourth fit mended none of those bodies.
const MOST_FOR_AN_AIM: usize = 3;
/// Such fits in a row, none better than the best, after which there are no more; one, where the best intersects nothing and keeps the
/// tolerance, or lacks faces and no tolerance was requested. Count.
/// Trial: with 1, one of the seven misses the tolerance.
const MOST_VAIN: usize = 2;
/// Faces that fold, jump or intersect others, as a share of all, up to which a network that is of use only if it is sound gets
/// further attempts. Dimensionless.
/// Trial: 0.02 and 0.05. With 0.05 a head (one surface of 5000 control points in 67 s before) and two bodies without their bottom are mended
/// in time; what stays unsound has taken up to four fits more.
const NEARLY_SOUND: f64 = 0.05;
/// Faces between feature lines that fold or jump after the first round of refinement, as a share of all, beyond which the lines are
/// noise in all likelihood, and the network is made without them. Dimensionless.
/// Trial: on the first layouts of ten scans at 0.05 to 0.2 % of their diagonals. Along the lines of machined parts (fandisk, a bracket)
/// 0 to 9 % of the faces fold; along those of cans, a bowl, a vase, a car's side panel, a face and a head, 26 to 49 %. With the
/// lines none of the latter is sound; without them all but one are.
const MOST_TANGLED: f64 = 0.2;
/// Largest share of the defects of the network with feature lines at which the one without them replaces it. Dimensionless.
/// Guard: a network with a few defects needs a few repairs; with one thousand it is of no use, whatever its lines.
const FAR_FEWER: f64 = 0.1;

/// The fits of a network to one part, in the order in which they are made.
#[derive(Default)]
pub(super) struct Search {
    /// With the feature lines.
    sharp: Fits,
    /// Without them.
    smooth: Fits,
    /// Whether many faces between the lines fold from the first.
    is_tangled: bool,
    /// Whether the last network taken is one without them.
    pub(super) is_smooth: bool,
}

impl Search {
    /// Goes on until a fit is sound, or further ones are of no use; the best one is the network of the part.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a part without a mesh or a layout; [`Error::NoSolution`] where the fit fails;
    /// [`Error::Cancelled`].
    pub(super) fn fit(&mut self, task: &Task<'_>) -> Result<Made> {
        let Task { scan, progress, .. } = *task;
        progress.stage("order", None);
        let LinedMesh { mesh, lines } = task.lined_mesh()?;
        progress.check()?;
        progress.stage("fit", None);
        let either = task.held_out.iter().zip(&mesh.detached);
        let unseen: Vec<bool> = either.map(|(out, off)| *out || *off).collect();
        let apart = match task.tolerance.asked() {
            // Without a requested tolerance fewer points must be within, and letting go of those that cross is faster.
            None => Apart::left(&mesh.manifold, &scan.points),
            Some(tolerance) => Apart::untangled(&mesh.manifold, &scan.points, tolerance, progress)?,
        };
        let points = seen(&apart.points, &unseen);
        let normals = seen(&scan.normals, &unseen);
        let target = Target {
            mesh: &apart.mesh,
            crossed: &apart.crossed,
            untangled: apart.untangled,
            points: &points,
            normals: &normals,
            noise: scan.noise,
        };
        let options = fit_options(task);
        self.is_smooth = self.search(task, &target, &lines.sides, &options)?;
        let is_smooth = self.is_smooth;
        let taken = if is_smooth { &self.smooth } else { &self.sharp };
        let attempt = taken.taken()?;
        let fitted = &attempt.fitted;
        let states = states(task, &unseen, &mesh.detached, (&points, &fitted.distances));
        let mut distances = attempt.distances();
        let error = quantile_in_place(&mut distances, 0.95);
        let not_met = attempt.not_met(&options);
        let gone: Vec<bool> = states.iter().map(|&state| is_gone(state)).collect();
        let out = attempt.left_out(&unseen);
        let network = attempt.shown().clone();
        let [genus, borders] = match attempt.opened {
            Some(_) => network.genus_and_borders(),
            None => [mesh.manifold.genus(), mesh.manifold.loops.len()],
        };
        let part = NetworkPart {
            feet: kept(&attempt.feet(&unseen), &gone),
            genus,
            borders,
            network,
            defects: attempt.defects(),
            beyond: out.iter().zip(&gone).filter(|at| *at.0 && !at.1).count(),
        };
        let crossings = part.defects;
        let mut notes = mesh.notes.clone();
        tell_lines(task, lines, is_smooth, &mut notes);
        notes.details.extend(apart.told(&mesh.manifold, scan.unit));
        notes.details.insert(0, described(&part));
        if let Some(told) = attempt.told() {
            notes.warn(told);
        }
        Ok(Made {
            error,
            crossings,
            is_opened: attempt.opened.is_some() && !attempt.will_do(&target),
            ..Made::new(task, &states, PartShape::Network(part), not_met, notes)
        })
    }

    /// Fits that keep the feature lines sharp. Where nobody asked for these, fits without them take their place if many faces
    /// between the lines fold after the first round, and follow them if they intersect themselves. Returns whether the best one is
    /// without lines.
    fn search(
        &mut self,
        task: &Task<'_>,
        target: &Target<'_>,
        lines: &[bool],
        options: &FitOptions,
    ) -> Result<bool> {
        let none = vec![false; lines.len()];
        let is_free = may_give_up(task, lines);
        if self.is_tangled {
            match self.smooth.run(task, target, &none, options) {
                Err(Error::NoSolution(_) | Error::Unsupported(_)) => {}
                other => return other.map(|_| true),
            }
        }
        let is_first = is_free && self.sharp.best.is_none() && !self.is_tangled;
        let careful = FitOptions {
            most_folding: if is_first { MOST_TANGLED } else { 1.0 },
            ..*options
        };
        let sharp = match self.sharp.run(task, target, lines, &careful) {
            Err(Error::NoSolution(_) | Error::Unsupported(_)) if is_first => {
                self.is_tangled = true;
                return self.search(task, target, lines, options);
            }
            other => other?,
        };
        let rank = sharp.rank(target);
        let crosses = !task.only_met && !sharp.is_sound(target);
        let widely = sharp.fitted.crosses_widely();
        // A network with lines gives way to one that intersects itself, too, only if that has far fewer defects.
        let far_fewer = FAR_FEWER * sharp.fitted.defects.len() as f64;
        if is_free && (crosses || widely) {
            match self.smooth.run(task, target, &none, options) {
                Ok(_) | Err(Error::NoSolution(_) | Error::Unsupported(_)) => {}
                Err(why) => return Err(why),
            }
        }
        let smooth = self.smooth.best.as_ref();
        let gains = |smooth: &&Attempt| {
            let is_sound = smooth.defects() == 0 && sharp.defects() > 0;
            widely || is_sound || smooth.fitted.defects.len() as f64 <= far_fewer
        };
        Ok(smooth
            .filter(gains)
            .is_some_and(|smooth| smooth.rank(target) < rank))
    }
}

/// Whether the network may round off its feature lines, since nobody asked for them.
fn may_give_up(task: &Task<'_>, lines: &[bool]) -> bool {
    task.options.sharp == Sharp::Auto && lines.contains(&true)
}

/// Fits over layouts with smaller faces where the last one was not sound.
#[derive(Default)]
struct Fits {
    /// Those of the next layout.
    sizes: Option<FaceSizes>,
    /// The seeds of the layouts so far.
    seeds: Seeds,
    count: usize,
    /// Fits since the best one.
    vain: usize,
    /// Whether the last one was sound, or further ones are of no use.
    is_over: bool,
    best: Option<Attempt>,
}

impl Fits {
    /// Goes on until one is sound, and returns the best. One that gives up its lines is the last one.
    fn run(
        &mut self,
        task: &Task<'_>,
        target: &Target<'_>,
        lines: &[bool],
        options: &FitOptions,
    ) -> Result<&Attempt> {
        let progress = task.progress;
        let mesh = target.mesh;
        let mut producer = Producer::new(mesh, lines).map_err(undivided)?;
        let coarse = LayoutOptions::coarse();
        let mut inspect = |fitted: &Fitted| {
            progress.check()?;
            defects(&network_of(fitted))
        };
        let sizes = self.sizes.get_or_insert_with(|| FaceSizes::new(mesh));
        while !self.is_over && self.count < MOST_ATTEMPTS {
            progress.check()?;
            if self.count > 0 {
                // Faces beside no bad ones stay.
                producer.follow(std::mem::take(&mut self.seeds));
            }
            let mut divide = |sizes: &[f64]| {
                progress.check()?;
                let layout = producer.layout(&coarse, sizes);
                layout.validate(mesh).map_err(undivided)?;
                Ok(layout)
            };
            let most_folding = match self.best {
                None => options.most_folding,
                Some(_) => 1.0,
            };
            let options = FitOptions {
                most_folding,
                ..*options
            };
            let fitted = fit_adaptive(target, &mut divide, sizes, &mut inspect, &options, progress);
            let fitted = match (fitted, &self.best) {
                (Ok(fitted), _) => fitted,
                (Err(Error::NoSolution(_) | Error::Unsupported(_)), Some(_)) => {
                    self.is_over = true;
                    break;
                }
                (Err(why), _) => return Err(refused(why)),
            };
            self.count += 1;
            let mut bad = fitted.bad.clone();
            for defect in &fitted.defects {
                if let Some(flag) = bad.get_mut(defect.face as usize) {
                    *flag = true;
                }
            }
            let faulty = bad.iter().filter(|bad| **bad).count();
            let attempt = Attempt::new(fitted, &options, progress)?;
            let fitted = &attempt.fitted;
            for (flag, lost) in bad.iter_mut().zip(&fitted.lost) {
                *flag |= attempt.misses() && *lost;
            }
            sizes.shrink(mesh, &bad);
            let count = bad.iter().filter(|bad| **bad).count();
            let gives_up = may_give_up(task, lines) && fitted.crosses_widely();
            let is_best = |b: &Attempt| attempt.rank(target) < b.rank(target);
            if self.best.as_ref().is_none_or(is_best) {
                self.best = Some(attempt);
                self.vain = 0;
            } else {
                self.vain += 1;
            }
            // One that only jumps at an edge will do.
            let best = self.best.as_ref();
            let may_miss = |best: &Attempt| best.opened.is_some() && !options.requested;
            let will_do = best.is_some_and(|b| b.defects() == 0 && (!b.misses() || may_miss(b)));
            let most_vain = if will_do { 1 } else { MOST_VAIN };
            // An open scan whose network lacks a few faces gets no other layout.
            let lacks = |b: &Attempt| b.opened.is_some() && b.is_sound(target) && !b.misses();
            let is_late = self.count >= MOST_FOR_AN_AIM && !options.requested;
            let is_enough = best.is_some_and(lacks) || is_late && will_do;
            self.is_over = count == 0 || is_enough || self.vain >= most_vain || gives_up;
            if task.only_met && faulty as f64 > NEARLY_SOUND * bad.len() as f64 {
                break;
            }
        }
        self.seeds = producer.into_seeds();
        self.taken()
    }

    /// The best one.
    fn taken(&self) -> Result<&Attempt> {
        let none = || Error::NoSolution("the network of faces cannot be fitted".into());
        self.best.as_ref().ok_or_else(none)
    }
}

/// Where a network folds or intersects itself, as the check of the file finds it.
fn defects(network: &FaceNetwork) -> Result<Vec<FacePart>> {
    let model = network.to_model("")?;
    // Where the search takes too many triangles, the check of the file says so.
    let found = match shell_defects(&model) {
        Err(Error::NoSolution(_)) => ShellDefects::default(),
        found => found?,
    };
    let part = |(face, [low, high]): (usize, [DVec2; 2])| FacePart {
        face: u32::try_from(face).unwrap_or(u32::MAX),
        low: low.into(),
        high: high.into(),
    };
    if !found.is_empty() {
        return Ok(found.parts().map(part).collect());
    }
    let turned = turned_edges(&model, network);
    let whole = |faces: [usize; 2]| part((faces[0], [DVec2::ZERO, DVec2::ONE]));
    Ok(turned.map(whole).collect())
}

/// The faces of the smooth edges at which a network turns over. They may be narrower than the samples of the fit at edges.
fn turned_edges(model: &Model, network: &FaceNetwork) -> impl Iterator<Item = [usize; 2]> {
    let jumps = normal_jumps(model, Meant::Kinds(&network.kinds()));
    let turned: Vec<[usize; 2]> = jumps.smooth_above(FOLD).map(|edge| edge.faces).collect();
    turned.into_iter()
}

/// What decides whether the network of a part is tried early.
pub(super) struct Outlook {
    /// Total length of its feature lines, in diagonals; 0 for an open part, which is often one sheet or tube whatever its lines, and for a
    /// cloud, whose lines are those of a guessed mesh.
    pub(super) creases: f64,
    /// Whether it has a border.
    pub(super) is_open: bool,
}

/// The outlook for a part. [`None`] where its network comes last: for a cloud with a requested tolerance, whose mesh would take as long
/// as the fit of a sheet, and for an open cloud.
///
/// # Errors
/// As [`Task::lined_mesh`].
pub(super) fn outlook(task: &Task<'_>) -> Result<Option<Outlook>> {
    let is_cloud = task.scan.triangles.is_empty();
    let is_asked = task.tolerance.asked().is_some();
    if is_cloud && is_asked {
        return Ok(None);
    }
    let LinedMesh { mesh, lines } = task.lined_mesh()?;
    let is_open = !mesh.manifold.loops.is_empty();
    if is_open && is_cloud {
        return Ok(None);
    }
    let [low, high] = bounding_box(&mesh.manifold.points);
    let creases = match task.vertices && !is_open {
        true => lines.length / low.distance(high).max(f64::MIN_POSITIVE),
        false => 0.0,
    };
    Ok(Some(Outlook { creases, is_open }))
}

/// Whether the mesh of a part has no border.
///
/// # Errors
/// As [`Task::lined_mesh`].
pub(super) fn is_closed(task: &Task<'_>) -> Result<bool> {
    Ok(task.lined_mesh()?.mesh.manifold.loops.is_empty())
}

/// Adds notes on the feature lines, which stay sharp unless the network is smooth.
fn tell_lines(task: &Task<'_>, lines: &FeatureLines, is_smooth: bool, notes: &mut Notes) {
    for note in &lines.notes {
        notes.detail(note.clone());
    }
    if lines.chains > 0 {
        let count = counted(lines.chains, "feature line", "feature lines");
        let said = if is_smooth {
            "are rounded off: a network that keeps them sharp folds or intersects itself"
        } else {
            "stay sharp"
        };
        notes.detail(format!(
            "{count} of {} in all {said}",
            task.scan.unit.length(lines.length)
        ));
    }
}

/// The error of a division into faces.
fn undivided(error: Error) -> Error {
    match error {
        Error::Invalid(what) => Error::Unsupported(format!(
            "the mesh cannot be divided into four-sided faces: {what}"
        )),
        other => other,
    }
}

/// The error of a fit of faces.
fn refused(error: Error) -> Error {
    match error {
        Error::NoSolution(what) => {
            Error::NoSolution(format!("the network of faces cannot be fitted: {what}"))
        }
        other => other,
    }
}

/// The requirements on the fit: those of a single surface.
fn fit_options(task: &Task<'_>) -> FitOptions {
    let asked = task.tolerance.asked();
    FitOptions {
        tolerance: task.tolerance.value,
        share_within: match asked {
            Some(_) => task.options.within.unwrap_or(USUAL_SHARE),
            None => AUTOMATIC_SHARE,
        },
        beyond_share: asked.is_some() && task.options.within.is_none(),
        requested: asked.is_some(),
        max_control_points: task
            .options
            .max_control_points
            .unwrap_or(MOST_CONTROL_POINTS),
        most_folding: 1.0,
    }
}

/// The state of each point: detached bits of the mesh, and isolated points far off the network, are left out.
fn states(
    task: &Task<'_>,
    unseen: &[bool],
    detached: &[bool],
    (points, distances): (&[DVec3], &[f64]),
) -> Vec<PointState> {
    let mut off = distances.to_vec();
    let robust = outliers::Robust {
        residuals: distances,
        weights: None,
        sigma: SIGMA_OF_MEDIAN * median_in_place(&mut off),
    };
    let found = outliers::lost(points, &robust, task.tolerance.value, task.scan.spacing);
    let mut found = found.into_iter();
    let state = |(unseen, detached): (&bool, &bool)| match (*detached, *unseen) {
        (true, _) => PointState::Detached,
        (false, true) => PointState::Charted,
        (false, false) if found.next() == Some(true) => PointState::Outlier,
        (false, false) => PointState::Charted,
    };
    unseen.iter().zip(detached).map(state).collect()
}

/// The faces for a model.
fn network_of(fitted: &Fitted) -> FaceNetwork {
    FaceNetwork {
        vertices: fitted.vertices.clone(),
        edges: fitted
            .edges
            .iter()
            .map(|edge| NetworkEdge {
                curve: edge.curve.clone(),
                ends: edge.ends,
                kind: match edge.kind {
                    EdgeKind::Smooth => JoinKind::Smooth,
                    EdgeKind::Sharp => JoinKind::Sharp,
                    EdgeKind::Open => JoinKind::Open,
                },
            })
            .collect(),
        faces: fitted
            .faces
            .iter()
            .map(|face| NetworkFace {
                surface: face.surface.clone(),
                sides: face.sides.map(|side| (side.edge, side.reversed)),
            })
            .collect(),
    }
}

/// What the network is, in words.
fn described(part: &NetworkPart) -> String {
    let borders = match part.borders {
        0 => "closed".to_owned(),
        n => format!("open at {}", counted(n, "border", "borders")),
    };
    let handles = match part.genus {
        0 => "without handles".to_owned(),
        n => format!("with {} (genus {n})", counted(n, "handle", "handles")),
    };
    let count = counted(
        part.network.faces.len(),
        "four-sided face",
        "four-sided faces",
    );
    format!("a network of {count}; it is {borders}, {handles}")
}
