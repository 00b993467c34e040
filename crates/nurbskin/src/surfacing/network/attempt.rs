//! One fit of a network, and what is wrong with it.

use super::network_of;
use super::opened::Opened;
use crate::deviation::verdict::USUAL_SHARE;
use nurbskin_cad::FaceNetwork;
use nurbskin_geometry::Result;
use nurbskin_geometry::unit::{counted, grouped, percent};
use nurbskin_network::fit::{FitOptions, Fitted, Target};
use nurbskin_network::layout::OnFace;

/// A fit with its network, and what is wrong with it.
pub(super) struct Attempt {
    pub(super) fitted: Fitted,
    pub(super) network: FaceNetwork,
    /// The network without the few faces that intersect others, if it intersects itself.
    pub(super) opened: Option<Opened>,
    /// Whether it misses the tolerance.
    pub(super) misses: bool,
    /// Whether the tolerance was requested.
    requested: bool,
}

impl Attempt {
    /// Looks what a fit has reached, and opens its network if it intersects itself.
    pub(super) fn new(fitted: Fitted, options: &FitOptions) -> Result<Self> {
        let network = network_of(&fitted);
        let opened = match fitted.defects.is_empty() || fitted.crosses_widely() {
            true => None,
            false => Opened::of(&network, &fitted.feet)?,
        };
        let attempt = Self {
            misses: false,
            requested: options.requested,
            fitted,
            network,
            opened,
        };
        Ok(Self {
            misses: attempt.not_met(options).is_some(),
            ..attempt
        })
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

    /// What counts, the less the better: a requested tolerance more than a network that is closed, this more than an aim.
    pub(super) fn rank(&self, target: &Target<'_>) -> (usize, bool, bool, bool, usize, usize) {
        let bad = self.fitted.bad.iter().filter(|bad| **bad).count();
        let open = self.opened.is_some() && !self.will_do(target);
        let fails = self.requested && self.misses;
        let points = self.points_left_out();
        (self.defects(), fails, open, self.misses, points, bad)
    }

    /// The index of a face in the network that is taken.
    pub(super) fn face(&self, face: u32) -> Option<usize> {
        match &self.opened {
            Some(opened) => opened.faces.get(face as usize).copied().flatten(),
            None => Some(face as usize),
        }
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
        let distances = self.distances();
        let within = distances.iter().filter(|d| **d <= options.tolerance);
        let share = within.count() as f64 / distances.len().max(1) as f64;
        if share >= options.share_within {
            return None;
        }
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
