//! One fit of a network, and what is wrong with it.

use super::network_of;
use super::opened::Opened;
use crate::deviation::verdict::USUAL_SHARE;
use nurbskin_cad::FaceNetwork;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{counted, grouped, percent};
use nurbskin_geometry::{Error, Result};
use nurbskin_network::fit::{FitOptions, Fitted, Target};
use nurbskin_network::layout::OnFace;

/// A fit with its network, and what is wrong with it.
pub(super) struct Attempt {
    pub(super) fitted: Fitted,
    pub(super) network: FaceNetwork,
    /// The network without the few faces that intersect others, if it intersects itself.
    pub(super) opened: Option<Opened>,
    /// Number of points beyond the tolerance, if these are too many; else 0.
    missing: usize,
    /// Whether the tolerance was requested.
    requested: bool,
}

impl Attempt {
    /// Looks what a fit has reached, and opens its network if it intersects itself.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(super) fn new(
        fitted: Fitted,
        options: &FitOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let network = network_of(&fitted);
        let opened = match fitted.defects.is_empty() || fitted.crosses_widely() {
            true => None,
            false => match Opened::of(&network, &fitted.feet, progress) {
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                opened => opened.unwrap_or(None),
            },
        };
        let attempt = Self {
            missing: 0,
            requested: options.requested,
            fitted,
            network,
            opened,
        };
        Ok(Self {
            missing: attempt.missing(options),
            ..attempt
        })
    }

    /// Whether it misses the tolerance.
    pub(super) fn misses(&self) -> bool {
        self.missing > 0
    }

    /// Number of points beyond the tolerance, those on faces left out among them, if they are more than the options allow; else 0.
    fn missing(&self, options: &FitOptions) -> usize {
        let distances = self.distances();
        let within = distances.iter().filter(|d| **d <= options.tolerance);
        let (within, all) = (within.count(), distances.len());
        match within as f64 / all.max(1) as f64 >= options.share_within {
            true => 0,
            false => all - within,
        }
    }

    /// The network that is taken.
    pub(super) fn shown(&self) -> &FaceNetwork {
        self.opened
            .as_ref()
            .map_or(&self.network, |opened| &opened.network)
    }

    /// Its number of defects.
    pub(super) fn defects(&self) -> usize {
        match self.opened {
            Some(_) => 0,
            None => self.fitted.defects.len(),
        }
    }

    /// Number of points on the faces left out.
    pub(super) fn points_left_out(&self) -> usize {
        self.opened.as_ref().map_or(0, |opened| opened.points)
    }

    /// Whether it is sound, and closed where the scan is.
    pub(super) fn is_sound(&self, target: &Target<'_>) -> bool {
        self.defects() == 0 && (self.opened.is_none() || self.will_do(target))
    }

    /// Whether the network may be open at the faces left out: the scan is open, too, and they have no more points than a tolerance lets
    /// lie anywhere.
    pub(super) fn will_do(&self, target: &Target<'_>) -> bool {
        let few = (1.0 - USUAL_SHARE) * self.fitted.feet.len() as f64;
        !target.mesh.loops.is_empty() && self.points_left_out() as f64 <= few
    }

    /// What counts, the less the better: a requested tolerance more than a network that is closed, this more than an aim. Of networks that
    /// miss it one with half as many points beyond it is better.
    pub(super) fn rank(&self, target: &Target<'_>) -> (usize, bool, bool, u32, usize, usize) {
        let bad = self.fitted.bad.iter().filter(|bad| **bad).count();
        let open = self.opened.is_some() && !self.will_do(target);
        let fails = self.requested && self.misses();
        let points = self.points_left_out();
        // A few points more or less are chance.
        let missing = self.missing.checked_ilog2().map_or(0, |log| log + 1);
        (self.defects(), fails, open, missing, points, bad)
    }

    /// The index of a face in the network that is taken.
    pub(super) fn face(&self, face: u32) -> Option<usize> {
        match &self.opened {
            Some(opened) => opened.faces.get(face as usize).copied().flatten(),
            None => Some(face as usize),
        }
    }

    /// Which of the points lie on faces left out; those that are `unseen` have no face.
    pub(super) fn left_out(&self, unseen: &[bool]) -> Vec<bool> {
        let mut feet = self.fitted.feet.iter();
        let is_out = |unseen: &bool| {
            let foot = if *unseen { None } else { feet.next() };
            foot.is_some_and(|foot| self.face(foot.face).is_none())
        };
        unseen.iter().map(is_out).collect()
    }

    /// The distance of each point; those on faces left out have none.
    pub(super) fn distances(&self) -> Vec<f64> {
        let Fitted {
            feet, distances, ..
        } = &self.fitted;
        let own = |(foot, distance): (&OnFace, &f64)| match self.face(foot.face) {
            Some(_) => *distance,
            None => f64::INFINITY,
        };
        feet.iter().zip(distances).map(own).collect()
    }

    /// A place on the network near each point: its foot, or that of the point before it where the fit excluded it or left its
    /// face out.
    pub(super) fn feet(&self, unseen: &[bool]) -> Vec<OnFace> {
        let here = |foot: &OnFace| {
            let face = u32::try_from(self.face(foot.face)?).ok()?;
            Some(OnFace { face, ..*foot })
        };
        let mut feet = self.fitted.feet.iter();
        let mut last = feet.clone().find_map(here).unwrap_or_default();
        let foot = |unseen: &bool| {
            if !unseen && let Some(foot) = feet.next() {
                last = here(foot).unwrap_or(last);
            }
            last
        };
        unseen.iter().map(foot).collect()
    }

    /// The reason for which the fit misses its aim, if it does.
    pub(super) fn not_met(&self, options: &FitOptions) -> Option<String> {
        if !self.misses() {
            return None;
        }
        let share = 1.0 - self.missing as f64 / self.fitted.distances.len() as f64;
        let count = self.network.control_point_count();
        let said = format!(
            "the fit of the network ended with {} of the points within",
            percent(share)
        );
        Some(match count >= options.max_control_points {
            true => format!(
                "{said}, at its budget of {} control points",
                grouped(options.max_control_points)
            ),
            false => format!("{said}: further control points did not bring it closer"),
        })
    }

    /// What an opened network lacks, in words.
    pub(super) fn told(&self) -> Option<String> {
        let opened = self.opened.as_ref()?;
        let points = self.fitted.feet.len();
        Some(format!(
            "left out, to keep the network from intersecting itself: {} with {} of the points; it is open there",
            counted(opened.left_out(), "face", "faces"),
            percent(opened.points as f64 / points.max(1) as f64)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_network::fit::FacePart;
    use nurbskin_scan::mesh::Manifold;

    fn on(face: u32) -> OnFace {
        OnFace {
            face,
            u: 0.25,
            v: 0.5,
        }
    }

    fn asking(tolerance: f64, requested: bool) -> FitOptions {
        FitOptions {
            tolerance,
            share_within: 0.99,
            beyond_share: false,
            requested,
            max_control_points: 1000,
            most_folding: 1.0,
        }
    }

    /// A fit with defects over a thousand points, at the tolerance each, of which the first `lost` lie on a face left out.
    fn attempt(lost: usize, tolerance: f64, requested: bool) -> Attempt {
        let fitted = Fitted {
            vertices: Vec::new(),
            edges: Vec::new(),
            faces: Vec::new(),
            feet: (0..1000)
                .map(|k| on(if k < lost { 1 } else { 2 }))
                .collect(),
            distances: vec![1.0; 1000],
            bad: vec![false; 3],
            defects: vec![FacePart {
                face: 1,
                low: [0.0; 2],
                high: [1.0; 2],
            }],
            lost: Vec::new(),
        };
        let mut attempt = Attempt {
            fitted,
            network: FaceNetwork::default(),
            opened: Some(Opened {
                network: FaceNetwork::default(),
                faces: vec![Some(0), None, Some(1)],
                points: lost,
            }),
            missing: 0,
            requested,
        };
        attempt.missing = attempt.missing(&asking(tolerance, requested));
        attempt
    }

    #[test]
    fn points_on_faces_left_out_have_no_distance() {
        let few = attempt(5, 1.0, true);
        assert_eq!(few.distances()[4..6], [f64::INFINITY, 1.0]);
        assert!(!few.misses() && attempt(11, 1.0, true).misses());
        // The second point was not seen; those without a face have a place nearby.
        let mut unseen = vec![false; 1001];
        unseen[1] = true;
        let feet = few.feet(&unseen);
        assert!(feet.iter().all(|foot| *foot == on(1)));
        let out = few.left_out(&unseen);
        assert_eq!(out[..7], [true, false, true, true, true, true, false]);
    }

    #[test]
    fn a_requested_tolerance_goes_before_a_closed_network_and_that_before_an_aim() {
        let mut mesh = Manifold::default();
        let target = |mesh: &Manifold, rank: &dyn Fn(&Target<'_>) -> bool| {
            rank(&Target {
                mesh,
                crossed: &[],
                untangled: false,
                points: &[],
                normals: &[],
                noise: 0.0,
            })
        };
        let whole = |tolerance, requested| {
            let mut whole = attempt(0, tolerance, requested);
            whole.fitted.defects.clear();
            whole.opened = None;
            whole
        };
        for requested in [false, true] {
            let [opened, sound, misses] = [
                attempt(4, 1.0, requested),
                whole(1.0, requested),
                whole(0.5, requested),
            ];
            assert!(misses.misses() && !opened.misses());
            let is_first =
                |a: &Attempt, b: &Attempt| target(&mesh, &|target| a.rank(target) < b.rank(target));
            assert!(is_first(&sound, &opened) && is_first(&sound, &misses));
            assert_eq!(is_first(&opened, &misses), requested);
            // Of two that miss it, the closer one.
            let mut closer = whole(0.5, requested);
            closer.fitted.distances[..500].fill(0.1);
            closer.missing = closer.missing(&asking(0.5, requested));
            assert!(closer.misses() && is_first(&closer, &misses));
            let mut crossing = attempt(4, 1.0, requested);
            crossing.opened = None;
            assert!(is_first(&opened, &crossing) && is_first(&misses, &crossing));
            assert!(!target(&mesh, &|target| opened.is_sound(target)));
        }
        // An open scan may lack one point in two hundred.
        mesh.loops.push(Vec::new());
        let sound = |lost| {
            let opened = attempt(lost, 1.0, false);
            target(&mesh, &|target| opened.is_sound(target))
        };
        assert!(sound(5) && !sound(6));
    }
}
