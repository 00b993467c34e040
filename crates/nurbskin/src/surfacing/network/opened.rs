//! Networks without the few faces that intersect others.
//!
//! A scan passes through itself at lips, lids and fins that are thinner than its spacing, and the network follows. Most often some
//! faces are at fault that hold less than one point in a hundred. Without them the shell is sound, with a hole there. Ours.

use super::{AUTOMATIC_SHARE, turned_edges};
use nurbskin_cad::FaceNetwork;
use nurbskin_cad::check::{ShellDefects, shell_defects};
use nurbskin_geometry::Result;
use nurbskin_geometry::progress::Progress;
use nurbskin_network::layout::OnFace;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

/// Points on the faces left out, as a share of all, beyond which a network stays as it is. Dimensionless.
/// Guard: half of what an aim lets lie anywhere. Of seven scans whose networks stay unsound, the best attempts need 0.03 to 0.9 %.
const MOST_LEFT_OUT: f64 = 0.5 * (1.0 - AUTOMATIC_SHARE);
/// Faces left out, as a share of all, beyond which a network stays as it is: faces may hold few points or none. Dimensionless.
/// Guard: a surface with more holes is torn. Of those scans the best attempts lack 0.2 to 4 %.
const MOST_FACES: f64 = 0.05;
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
    /// Opens a network whose points have these feet. [`None`] where no face is at fault, where too many are or hold too many points, and
    /// where others are at fault without them.
    ///
    /// # Errors
    /// Those of [`shell_defects`]; `Error::Invalid` for an invalid network; `Error::Cancelled`.
    pub(super) fn of(
        network: &FaceNetwork,
        feet: &[OnFace],
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let mut weights = vec![0; network.faces.len()];
        for foot in feet {
            weights[foot.face as usize] += 1;
        }
        let mut gone = vec![false; weights.len()];
        let mut kept: Vec<usize> = (0..weights.len()).collect();
        let mut rest = network.clone();
        let mut points = 0;
        for _ in 0..=MOST_TIMES {
            progress.check()?;
            let model = rest.to_model("")?;
            let found = shell_defects(&model)?;
            let turned: Vec<[usize; 2]> = turned_edges(&model, &rest).collect();
            let own: Vec<usize> = kept.iter().map(|&face| weights[face]).collect();
            let at_fault = faces_at_fault(&found, &turned, &own);
            if at_fault.is_empty() {
                let mut faces = vec![None; gone.len()];
                for (k, &face) in kept.iter().enumerate() {
                    faces[face] = Some(k);
                }
                let opened = Self {
                    network: rest,
                    faces,
                    points,
                };
                return Ok(Some(opened).filter(|opened| opened.left_out() > 0));
            }
            for face in at_fault {
                gone[kept[face]] = true;
            }
            (rest, kept) = match network.without(&gone, &weights) {
                Some(left) => left,
                None => break,
            };
            points = feet.len() - kept.iter().map(|&face| weights[face]).sum::<usize>();
            let faces = gone.len() - kept.len();
            if points as f64 > MOST_LEFT_OUT * feet.len() as f64
                || faces as f64 > MOST_FACES * gone.len() as f64
            {
                break;
            }
        }
        Ok(None)
    }

    /// Number of faces left out.
    pub(super) fn left_out(&self) -> usize {
        self.faces.len() - self.network.faces.len()
    }
}

/// Faces without which no other one folds, turns over at an edge or intersects any: those that do so by themselves, and of the others
/// again and again the one with the most such pairs that are left, of equals the one with the fewest points.
fn faces_at_fault(
    found: &ShellDefects,
    turned: &[[usize; 2]],
    points: &[usize],
) -> BTreeSet<usize> {
    let mut at_fault: BTreeSet<usize> = found.folds.iter().map(|fold| fold.0).collect();
    let crossed = found.crossings.iter().map(|pair| pair.map(|cell| cell.0));
    let mut pairs = Vec::new();
    for [one, other] in crossed.chain(turned.iter().copied()) {
        if one == other {
            at_fault.insert(one);
        } else {
            pairs.push([one, other]);
        }
    }
    loop {
        pairs.retain(|pair| !pair.iter().any(|face| at_fault.contains(face)));
        let mut counts = BTreeMap::new();
        for &face in pairs.as_flattened() {
            *counts.entry(face).or_insert(0_usize) += 1;
        }
        let by = |&(face, count): &(usize, usize)| (count, Reverse((points[face], face)));
        match counts.into_iter().max_by_key(by) {
            Some((face, _)) => at_fault.insert(face),
            None => return at_fault,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};
    use nurbskin_cad::check;
    use nurbskin_cad::samples::torus_network;
    use nurbskin_geometry::progress::Silent;
    use nurbskin_geometry::{ControlNet, NurbsSurface};

    fn crossing(one: usize, other: usize) -> [(usize, [DVec2; 2]); 2] {
        [one, other].map(|face| (face, [DVec2::ZERO, DVec2::ONE]))
    }

    #[test]
    fn few_faces_are_at_fault() {
        let mut found = ShellDefects::default();
        assert!(faces_at_fault(&found, &[], &[1; 5]).is_empty());
        // Face 2 passes through three others.
        found.crossings = vec![crossing(0, 2), crossing(2, 1), crossing(2, 3)];
        assert_eq!(faces_at_fault(&found, &[], &[1; 5]), [2].into());
        // Of two that pass through each other the one with fewer points.
        found.crossings.push(crossing(3, 4));
        assert_eq!(faces_at_fault(&found, &[], &[1, 1, 1, 9, 5]), [2, 4].into());
        // Those that fold or pass through themselves, and nothing that only meets these.
        found.folds.push((0, DVec2::ZERO));
        found.crossings.push(crossing(4, 4));
        assert_eq!(faces_at_fault(&found, &[], &[1; 5]), [0, 2, 4].into());
        // One of two that turn over at their edge, unless one of them goes in any case.
        let turned = [[1, 3], [2, 3]];
        assert_eq!(
            faces_at_fault(&found, &turned, &[1, 3, 1, 2, 1]),
            [0, 2, 3, 4].into()
        );
    }

    #[test]
    fn a_network_is_opened_where_a_face_passes_through_another() {
        // A tube of radius 10, of which one face is pulled across it.
        let mut network = torus_network([8, 3], 4, [30.0, 10.0]);
        let count = network.faces.len();
        let on = |face: usize| OnFace {
            face: u32::try_from(face).unwrap(),
            u: 0.5,
            v: 0.5,
        };
        let feet = |own: usize, each: usize| -> Vec<OnFace> {
            let points = |face| if face == 0 { own } else { each };
            (0..count)
                .flat_map(|face| std::iter::repeat_n(on(face), points(face)))
                .collect()
        };
        let of =
            |network: &FaceNetwork, feet: &[OnFace]| Opened::of(network, feet, &Silent).unwrap();
        assert!(of(&network, &feet(1, 20)).is_none());
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
        let opened = of(&network, &feet(1, 20)).unwrap();
        assert_eq!([opened.left_out(), opened.points], [1, 1]);
        assert_eq!(opened.faces[0], None);
        assert_eq!(opened.faces[count - 1], Some(count - 2));
        assert_eq!(opened.network.genus_and_borders(), [1, 1]);
        assert!(check(&opened.network.to_model("").unwrap()).pass());
        // The faces at fault hold too many of the points.
        assert!(of(&network, &feet(20, 20)).is_none());
    }
}
