//! Networks without the few faces that intersect others.
//!
//! A scan passes through itself at lips, lids and fins that are thinner than its spacing, and the network follows. Most often some
//! faces are at fault that hold less than one point in a hundred. Without them the shell is sound, with a hole there. Ours.

use super::{AUTOMATIC_SHARE, turned_edges};
use nurbskin_cad::FaceNetwork;
use nurbskin_cad::check::{ShellDefects, shell_defects};
use nurbskin_geometry::{Error, Result};
use nurbskin_network::layout::OnFace;
use std::collections::BTreeSet;

/// Points on the faces left out, as a share of all, beyond which a network stays as it is. Dimensionless.
/// Guard: half of what an aim lets lie anywhere. Of seven scans whose networks stay unsound, the best attempts need 0.03 to 0.9 %.
const MOST_LEFT_OUT: f64 = 0.5 * (1.0 - AUTOMATIC_SHARE);
/// Most times that faces are left out. Count.
/// Guard: fewer faces make the shell smaller, and its search has other chords; a second time finds nothing more but for these.
const MOST_TIMES: usize = 3;

/// A network without the faces that fold or intersect others.
pub(super) struct Opened {
    pub(super) network: FaceNetwork,
    /// For each face of the whole network its index here, if it has stayed.
    pub(super) faces: Vec<Option<usize>>,
    /// Number of points whose feet lie on faces that have not.
    pub(super) points: usize,
}

impl Opened {
    /// Opens a network whose points have these feet. [`None`] where too many points lie on the faces at fault, and where others are at
    /// fault without them.
    ///
    /// # Errors
    /// Those of [`shell_defects`] but for a search that is too large; [`Error::Invalid`] for an invalid network.
    pub(super) fn of(network: &FaceNetwork, feet: &[OnFace]) -> Result<Option<Self>> {
        let mut weights = vec![0; network.faces.len()];
        for foot in feet {
            weights[foot.face as usize] += 1;
        }
        let mut gone = vec![false; weights.len()];
        let mut kept: Vec<usize> = (0..weights.len()).collect();
        let mut rest = network.clone();
        for time in 0..=MOST_TIMES {
            let model = rest.to_model("")?;
            let found = match shell_defects(&model) {
                Err(Error::NoSolution(_)) => return Ok(None),
                found => found?,
            };
            let own: Vec<usize> = kept.iter().map(|&face| weights[face]).collect();
            let mut at_fault = faces_at_fault(&found, &own);
            at_fault.extend(turned_edges(&model, &rest).map(|faces| lightest(faces, &own)));
            let held: usize = kept.iter().map(|&face| weights[face]).sum();
            let points = feet.len() - held;
            if points as f64 > MOST_LEFT_OUT * feet.len() as f64 {
                return Ok(None);
            }
            if at_fault.is_empty() {
                let mut faces = vec![None; gone.len()];
                for (k, &face) in kept.iter().enumerate() {
                    faces[face] = Some(k);
                }
                return Ok(Some(Self {
                    network: rest,
                    faces,
                    points,
                }));
            }
            if time == MOST_TIMES {
                break;
            }
            for face in at_fault {
                gone[kept[face]] = true;
            }
            (rest, kept) = match network.without(&gone, &weights) {
                Some(left) => left,
                None => return Ok(None),
            };
        }
        Ok(None)
    }

    /// Number of faces left out.
    pub(super) fn left_out(&self) -> usize {
        self.faces.len() - self.network.faces.len()
    }
}

/// Faces without which no other one folds or intersects any: those that do so by themselves, and of the others again and again the one
/// with the most intersections that are left, of equals the one with the fewest points.
fn faces_at_fault(found: &ShellDefects, points: &[usize]) -> BTreeSet<usize> {
    let mut at_fault: BTreeSet<usize> = found.folds.iter().map(|fold| fold.0).collect();
    let mut pairs = Vec::new();
    for [(one, _), (other, _)] in &found.crossings {
        if one == other {
            at_fault.insert(*one);
        } else {
            pairs.push([*one, *other]);
        }
    }
    loop {
        pairs.retain(|pair| !pair.iter().any(|face| at_fault.contains(face)));
        let mut counts = vec![0_usize; points.len()];
        for face in pairs.as_flattened() {
            counts[*face] += 1;
        }
        let busy = (0..counts.len()).filter(|&face| counts[face] > 0);
        let by = |&face: &usize| (counts[face], std::cmp::Reverse((points[face], face)));
        match busy.max_by_key(by) {
            Some(face) => at_fault.insert(face),
            None => return at_fault,
        };
    }
}

/// The face with the fewest points.
fn lightest(faces: [usize; 2], points: &[usize]) -> usize {
    let [one, other] = faces;
    if points[other] < points[one] {
        other
    } else {
        one
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use nurbskin_cad::check;
    use nurbskin_cad::samples::torus_network;
    use nurbskin_geometry::{ControlNet, NurbsSurface};

    fn crossing(one: usize, other: usize) -> [(usize, [DVec2; 2]); 2] {
        [one, other].map(|face| (face, [DVec2::ZERO, DVec2::ONE]))
    }

    #[test]
    fn few_faces_are_at_fault() {
        let mut found = ShellDefects::default();
        assert!(faces_at_fault(&found, &[1; 5]).is_empty());
        // Face 2 passes through three others.
        found.crossings = vec![crossing(0, 2), crossing(2, 1), crossing(2, 3)];
        assert_eq!(faces_at_fault(&found, &[1; 5]), [2].into());
        // Of two that pass through each other the one with fewer points.
        found.crossings.push(crossing(3, 4));
        assert_eq!(faces_at_fault(&found, &[1, 1, 1, 9, 5]), [2, 4].into());
        // Those that fold or pass through themselves, and nothing that only meets these.
        found.folds.push((0, DVec2::ZERO));
        found.crossings.push(crossing(4, 4));
        assert_eq!(faces_at_fault(&found, &[1; 5]), [0, 2, 4].into());
    }

    #[test]
    fn a_network_is_opened_where_a_face_passes_through_another() {
        // A tube of radius 10, of which one face is pulled across it.
        let mut network = torus_network([4, 3], 4, [30.0, 10.0]);
        let count = network.faces.len();
        let on = |face: usize| OnFace {
            face: face as u32,
            u: 0.5,
            v: 0.5,
        };
        let feet = |own: usize, each: usize| -> Vec<OnFace> {
            let points = |face| if face == 0 { own } else { each };
            (0..count)
                .flat_map(|face| std::iter::repeat_n(on(face), points(face)))
                .collect()
        };
        let whole = Opened::of(&network, &feet(1, 20)).unwrap().unwrap();
        assert_eq!([whole.left_out(), whole.points], [0, 0]);
        let surface = &network.faces[0].surface;
        let net = surface.control_points();
        let [m, n] = net.counts();
        let middle = surface.point(0.5, 0.5);
        let normal = surface.derivatives(0.5, 0.5);
        let inwards = normal.du.cross(normal.dv).normalize();
        let inwards = if (middle + inwards).truncate().length() < middle.truncate().length() {
            inwards
        } else {
            -inwards
        };
        let pulled = ControlNet::from_fn(m, n, |i, j| {
            let is_inner = (3..m - 3).contains(&i) && (3..n - 3).contains(&j);
            net.point(i, j)
                + if is_inner {
                    60.0 * inwards
                } else {
                    DVec3::ZERO
                }
        });
        let knots = [surface.knots_u().clone(), surface.knots_v().clone()];
        let [u, v] = knots;
        network.faces[0].surface = NurbsSurface::new(u, v, pulled.unwrap(), None).unwrap();
        network.validate().unwrap();
        assert!(
            !shell_defects(&network.to_model("").unwrap())
                .unwrap()
                .is_empty()
        );
        let opened = Opened::of(&network, &feet(1, 20)).unwrap().unwrap();
        assert_eq!([opened.left_out(), opened.points], [1, 1]);
        assert_eq!(opened.faces[0], None);
        assert_eq!(opened.faces[count - 1], Some(count - 2));
        assert_eq!(opened.network.genus_and_borders(), [1, 1]);
        assert!(check(&opened.network.to_model("").unwrap()).pass());
        // The faces at fault hold too many of the points.
        assert!(Opened::of(&network, &feet(20, 20)).unwrap().is_none());
    }
}
