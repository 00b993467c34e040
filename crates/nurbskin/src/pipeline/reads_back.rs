//! Compares a CAD file with the model that it was written from.
//!
//! The comparison covers:
//!
//! - the unit;
//! - the faces, in any order: surface, side, number of loops;
//! - the edges of each loop in order, from any start: curve in space, p-curve and ends;
//! - for STEP and for IGES files of shells alone (514), which store them explicitly, the numbers of shared edges and
//!   vertices, and the shells: number of faces, and open, closed or solid.
//!
//! Points, weights and knots of surfaces must agree to the last bit, and so must points and weights of curves in space.
//! Knots of curves may differ by the rounding of a reversed curve. Points of p-curves may differ by 1e-9 of the domain,
//! because readers join ends that meet up to rounding. The comparison ignores degenerate edges beyond their ends, which
//! files do not contain, and the loop of an untrimmed face in IGES, which is written as its surface alone (128).

use nurbskin_cad::io::file::{CadFormat, read_cad_bytes};
use nurbskin_cad::{EdgeUse, Face, Loop, Model, ShellKind};
use nurbskin_geometry::nurbs::NurbsCurve;
use nurbskin_geometry::{DVec3, Result};
use std::collections::BTreeSet;
use std::path::Path;

/// Largest difference of the knots of a curve, as a share of its domain: the rounding of a few operations.
const ROUNDING: f64 = 1e-15;

/// Largest difference of the points of p-curves, as a share of the domain.
const TOGETHER: f64 = 1e-9;

/// The difference between a model moved by `origin` and the text of the CAD file written from it, as a sentence; `None`
/// if there is none.
pub(super) fn difference(text: &[u8], path: &Path, model: &Model, origin: DVec3) -> Option<String> {
    let file = match read_cad_bytes(text, path) {
        Ok(file) => file,
        Err(error) => return Some(error.to_string()),
    };
    let step = file.format == CadFormat::Step.name();
    // All faces of b-reps (510): shells with their edges and vertices.
    let faces = file.entities.get("510").copied();
    let shared = step || faces == Some(file.model.faces().len());
    let pair = Pair {
        ours: model,
        theirs: &file.model,
        origin,
        step,
        shared,
    };
    pair.difference().unwrap_or_else(|e| Some(e.to_string()))
}

struct Pair<'a> {
    ours: &'a Model,
    theirs: &'a Model,
    origin: DVec3,
    step: bool,
    /// Whether the file has edges and vertices that faces share, and shells.
    shared: bool,
}

impl Pair<'_> {
    fn difference(&self) -> Result<Option<String>> {
        let (ours, theirs) = (self.ours.faces(), self.theirs.faces());
        let said = |what: &str, ours: usize, theirs: usize| {
            (ours != theirs).then(|| format!("{theirs} {what} where {ours} were written"))
        };
        if self.ours.unit != self.theirs.unit {
            return Ok(Some(format!(
                "the unit is {} where {} was written",
                self.theirs.unit, self.ours.unit
            )));
        }
        if let Some(what) = said("faces", ours.len(), theirs.len()) {
            return Ok(Some(what));
        }
        // The order of the faces depends on the format.
        let mut open: Vec<&Face> = theirs.iter().collect();
        for (k, face) in ours.iter().enumerate() {
            let mut why = "its surface is another one".to_owned();
            let mut found = None;
            for (at, other) in open.iter().enumerate() {
                let Some(of_loops) = self.of_face(face, other)? else {
                    found = Some(at);
                    break;
                };
                if !of_loops.is_empty() {
                    why = of_loops;
                }
            }
            let Some(found) = found else {
                return Ok(Some(format!("face {}: {why}", k + 1)));
            };
            open.remove(found);
        }
        if !self.shared {
            return Ok(None);
        }
        let [a, b] = [self.ours, self.theirs].map(pieces);
        Ok(said("edges", a[0], b[0])
            .or_else(|| said("vertices", a[1], b[1]))
            .or_else(|| {
                let [a, b] = [self.ours, self.theirs].map(shells);
                (a != b).then(|| format!("the shells are {b:?} where {a:?} were written"))
            }))
    }

    /// The difference between two faces; an empty text stands for the surface.
    fn of_face(&self, ours: &Face, theirs: &Face) -> Result<Option<String>> {
        let moved = ours.surface.map_points(|p| self.moved(p))?;
        // IGES has no reversed faces: the surface is transposed instead.
        let turned = !self.step && ours.reversed;
        let surface = if turned { moved.transposed() } else { moved };
        let other = &theirs.surface;
        let same = surface.control_points() == other.control_points()
            && [surface.knots_u(), surface.knots_v()] == [other.knots_u(), other.knots_v()]
            && true_weights(surface.weights()) == true_weights(other.weights());
        if !same {
            return Ok(Some(String::new()));
        }
        if theirs.reversed != (ours.reversed && !turned) {
            return Ok(Some("it looks the other way".into()));
        }
        if !self.shared && !ours.trimmed {
            return Ok(None);
        }
        if ours.loops.len() != theirs.loops.len() {
            let counts = [&theirs.loops, &ours.loops].map(Vec::len);
            return Ok(Some(format!("{} loops of {}", counts[0], counts[1])));
        }
        let runs = |model: &Model, loops: &[Loop], turned: bool, origin: bool| {
            let each = loops.iter().map(|l| self.run(model, l, turned, origin));
            each.collect::<Result<Vec<_>>>()
        };
        let [(a, b), (c, d)] = ours.surface.domain();
        let slack = TOGETHER * (b - a).max(d - c);
        let mut open = runs(self.theirs, &theirs.loops, false, false)?;
        for (k, run) in runs(self.ours, &ours.loops, turned, true)?
            .iter()
            .enumerate()
        {
            let mut why = String::new();
            let same = |other: &Vec<Side>| {
                let of_loop = apart(run, other, slack);
                let same = of_loop.is_none();
                // The best match of several.
                if let Some(said) = of_loop.filter(|_| why.is_empty() || other.len() == run.len()) {
                    why = said;
                }
                same
            };
            let Some(found) = open.iter().position(same) else {
                return Ok(Some(format!("loop {}: {why}", k + 1)));
            };
            open.remove(found);
        }
        Ok(None)
    }

    fn moved(&self, p: DVec3) -> DVec3 {
        if self.origin == DVec3::ZERO {
            p
        } else {
            p + self.origin
        }
    }

    /// The edges of a loop in its direction; on the transposed surface if `turned`.
    fn run(&self, model: &Model, each: &Loop, turned: bool, origin: bool) -> Result<Vec<Side>> {
        let side = |used: &EdgeUse| -> Result<Side> {
            let backwards = used.reversed != turned;
            let run = |curve: &NurbsCurve| {
                if backwards {
                    curve.reversed()
                } else {
                    Ok(curve.clone())
                }
            };
            let place = |p: DVec3| if turned { DVec3::new(p.y, p.x, p.z) } else { p };
            let shift = |p: DVec3| if origin { self.moved(p) } else { p };
            let mut ends = model.ends_of(used)?.map(|v| shift(model.vertices()[v]));
            if turned {
                ends.reverse();
            }
            let curve = model.edges()[used.edge].curve.as_ref();
            Ok(Side {
                curve: curve.map(|c| run(&c.map_points(shift)?)).transpose()?,
                pcurve: run(&used.pcurve.map_points(place)?)?,
                // IGES has vertices in b-reps only.
                ends: self.shared.then_some(ends),
            })
        };
        let mut sides = each.uses.iter().map(side).collect::<Result<Vec<_>>>()?;
        if turned {
            sides.reverse();
        }
        Ok(sides)
    }
}

/// An edge in the direction of its loop.
struct Side {
    curve: Option<NurbsCurve>,
    pcurve: NurbsCurve,
    ends: Option<[DVec3; 2]>,
}

/// The difference between two loops, from any start.
fn apart(ours: &[Side], theirs: &[Side], slack: f64) -> Option<String> {
    if ours.len() != theirs.len() {
        return Some(format!("{} edges of {}", theirs.len(), ours.len()));
    }
    // The start with the largest agreement.
    let mut best = (0, String::new());
    for start in 0..ours.len() {
        let turned = theirs[start..].iter().chain(&theirs[..start]);
        let first = ours
            .iter()
            .zip(turned)
            .enumerate()
            .find_map(|(k, (a, b))| {
                let (rank, why) = different(a, b, slack)?;
                Some((3 * k + rank, format!("edge {}: {why}", k + 1)))
            })?;
        if first.0 > best.0 || best.1.is_empty() {
            best = first;
        }
    }
    Some(best.1)
}

/// The first difference between two edges, and the number of equal properties before it.
fn different(ours: &Side, theirs: &Side, slack: f64) -> Option<(usize, String)> {
    match (&ours.curve, &theirs.curve) {
        (None, None) => {
            let ends = [&ours.pcurve, &theirs.pcurve].map(|p| {
                let points = p.control_points();
                [points[0], points[points.len() - 1]]
            });
            let other = (0..2).any(|k| ends[0][k].distance(ends[1][k]) > slack);
            return other.then(|| (1, "the pole has other ends".into()));
        }
        (Some(ours), Some(theirs)) => {
            if let Some(why) = off(ours, theirs, 0.0) {
                return Some((0, format!("its curve in space {why}")));
            }
        }
        _ => return Some((0, "it is a pole in one of them".into())),
    }
    if let Some(why) = off(&ours.pcurve, &theirs.pcurve, slack) {
        return Some((1, format!("its p-curve {why}")));
    }
    (ours.ends != theirs.ends).then(|| (2, "its vertices are others".into()))
}

/// The difference between two curves beyond the rounding of knots, with a tolerance `slack` for points.
fn off(ours: &NurbsCurve, theirs: &NurbsCurve, slack: f64) -> Option<String> {
    let (p, q) = (ours.control_points(), theirs.control_points());
    let [a, b] = [ours, theirs].map(|c| c.knots().knots());
    if p.len() != q.len() || a.len() != b.len() {
        let count = |c: &NurbsCurve| (c.control_points().len(), c.knots().degree());
        let [(m, d), (n, e)] = [ours, theirs].map(count);
        return Some(format!(
            "has {n} control points and degree {e} where {m} and {d} were written"
        ));
    }
    let apart = p.iter().zip(q).map(|(p, q)| p.distance(*q));
    let most = apart.fold(0.0, f64::max);
    if most > slack {
        return Some(format!("is {most:.1e} off"));
    }
    if true_weights(ours.weights()) != true_weights(theirs.weights()) {
        return Some("has other weights".into());
    }
    let (from, to) = ours.domain();
    let slack = ROUNDING * (to - from + from.abs() + to.abs());
    let most = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    (most > slack).then(|| format!("has knots {most:.1e} off"))
}

/// The weights; `None` if all are equal, as in the readers.
#[expect(clippy::float_cmp, reason = "identical weights cancel exactly")]
fn true_weights(weights: Option<&[f64]>) -> Option<&[f64]> {
    weights.filter(|w| w.iter().any(|x| *x != w[0]))
}

/// Numbers of edges and vertices that the faces use.
fn pieces(model: &Model) -> [usize; 2] {
    let uses = model
        .faces()
        .iter()
        .flat_map(|f| &f.loops)
        .flat_map(|l| &l.uses);
    let edges: BTreeSet<usize> = uses.map(|u| u.edge).collect();
    let ends = |&e: &usize| [model.edges()[e].start, model.edges()[e].end];
    let vertices: BTreeSet<usize> = edges.iter().flat_map(ends).collect();
    [edges.len(), vertices.len()]
}

/// Kind and number of faces of each shell, sorted; faces outside any shell are written as open shells.
fn shells(model: &Model) -> Vec<(&'static str, usize)> {
    let kind = |kind: ShellKind| match kind {
        ShellKind::Open => "open",
        ShellKind::Closed => "closed",
        ShellKind::Solid => "solid",
    };
    let mut loose: BTreeSet<usize> = (0..model.faces().len()).collect();
    let mut shells = Vec::new();
    for shell in model.shells() {
        loose.retain(|f| !shell.faces.contains(f));
        shells.push((kind(shell.kind), shell.faces.len()));
    }
    shells.extend(loose.iter().map(|_| ("open", 1)));
    shells.sort_unstable();
    shells
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_cad::Shell;
    use nurbskin_cad::io::file::{CadWriteOptions, cad_text};
    use nurbskin_geometry::nurbs::conic;

    /// A ball and a half cylinder; the ball is a solid or in no shell.
    fn parts(solid: bool) -> Model {
        let mut model = Model::new("parts");
        let ball = conic::sphere(DVec3::ZERO, 2.0).unwrap();
        let ball = model.add_whole_surface(&ball, 1e-9).unwrap();
        if solid {
            model.add_shell_of(ball).unwrap();
        }
        let side = conic::cylinder(5.0 * DVec3::X, 3.0 * DVec3::Z, 1.0).unwrap();
        model.add_whole_surface(&side, 1e-9).unwrap();
        model
    }

    fn said(model: &Model, text: &str) -> String {
        difference(text.as_bytes(), Path::new("a"), model, DVec3::ZERO).unwrap_or_default()
    }

    fn text(model: &Model, format: CadFormat) -> String {
        let text = cad_text(model, format, &CadWriteOptions::default()).unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn what_differs_is_told() {
        let (model, loose) = (parts(true), parts(false));
        let step = text(&model, CadFormat::Step);
        assert_eq!(said(&model, &step), "");
        assert_eq!(said(&model, &text(&model, CadFormat::Iges)), "");
        assert!(said(&loose, &step).contains("solid"));
        assert!(said(&model, "").contains("a"));
        // The boundary of the cylinder: another circle with the same ends and nearly the same p-curve.
        let rim = step.rfind("RATIONAL_B_SPLINE_CURVE((1.,0.7").unwrap();
        let mut other = step.clone();
        other.replace_range(rim + 27..rim + 30, "0.70000000001,0.7");
        assert!(
            said(&model, &other).contains("curve"),
            "{}",
            said(&model, &other)
        );
        let mut inches = model.clone();
        inches.unit = nurbskin_geometry::Unit::Inch;
        assert!(said(&inches, &step).contains("unit"));
        let mut more = model.clone();
        let again = conic::cylinder(DVec3::ZERO, DVec3::Z, 1.0).unwrap();
        let face = more.add_whole_surface(&again, 1e-9).unwrap();
        let shell = Shell {
            faces: vec![face],
            ..Shell::default()
        };
        more.add_shell(shell).unwrap();
        assert!(said(&more, &step).contains("2 faces where 3"));
    }

    #[test]
    fn networks_keep_their_shells_in_both_formats() {
        use nurbskin_cad::samples::{cube_network, open_network, torus_network};
        let torus = torus_network([4, 3], 4, [30.0, 10.0]);
        for network in [torus, cube_network(), open_network()] {
            let model = network.to_model("network").unwrap();
            for format in [CadFormat::Step, CadFormat::Iges] {
                let text = text(&model, format);
                assert_eq!(said(&model, &text), "", "{format:?}");
                // The same faces, each with edges of its own.
                let mut apart = Model::new("network");
                for face in &network.faces {
                    apart.add_whole_surface(&face.surface, 1e-9).unwrap();
                }
                assert!(said(&apart, &text).contains("edges where"), "{format:?}");
            }
        }
    }

    #[test]
    fn p_curves_count() {
        let model = parts(false);
        let step = text(&model, CadFormat::Step);
        let changed = step.replace(
            "CARTESIAN_POINT('',(0.,1.))",
            "CARTESIAN_POINT('',(0.,1.0000002))",
        );
        assert_ne!(step, changed);
        assert!(
            said(&model, &changed).contains("p-curve"),
            "{}",
            said(&model, &changed)
        );
    }
}
