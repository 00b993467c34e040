//! A part as an exact surface of revolution, accepted or refused.

use super::SurfacingOptions;
use super::outliers;
use super::part::{DEFAULT_BUDGET, Shaped, Task, seen};
use crate::deviation::verdict::USUAL_SHARE;
use nurbskin_cad::check::crossings;
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::revolution;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::{Error, NurbsSurface, Result};

/// Standard deviations, or a tolerance if that is more, within which a surface of revolution must have its points, ...
const REACH_SIGMAS: f64 = 5.0;
/// ... but for this part of them where they are noisy.
const MISSED: f64 = 5e-3;
/// Factors of a tolerance that is missed with which a surface of revolution is tried.
const LOOSER: [f64; 3] = [2.0, 4.0, 8.0];

impl Task<'_> {
    /// The exact surface of revolution, if the points are a scan of one and nothing else is asked for; else why not, where
    /// it was a near thing.
    pub(super) fn turned(&self, tolerance: f64) -> Result<(Option<Shaped>, Option<String>)> {
        let Self {
            scan,
            held_out,
            options,
            progress,
            ..
        } = *self;
        if options.degree != SurfacingOptions::default().degree {
            return Ok((None, None));
        }
        let points = seen(&scan.points, held_out);
        let normals = seen(&scan.normals, held_out);
        let made = revolution::fit(
            &points,
            &normals,
            tolerance,
            scan.noise,
            scan.spacing,
            progress,
        );
        let fit = match made {
            Ok(revolution::Outcome::Fitted(fit)) => fit,
            Ok(revolution::Outcome::Refused(_)) | Err(Error::NoSolution(_) | Error::Invalid(_)) => {
                return Ok((None, None));
            }
            Err(other) => return Err(other),
        };
        let count: usize = fit.surface.distinct_counts().into_iter().product();
        if count > options.max_control_points.unwrap_or(DEFAULT_BUDGET) {
            return Ok((None, None));
        }
        if options.topology.is_some_and(|asked| asked != fit.topology) {
            let why = format!(
                "{}, which is not the {} asked for",
                fit.reason,
                fit.topology.name()
            );
            return Ok((None, Some(why)));
        }
        // A profile that passes the axis, or turns back on itself, is no part of a solid.
        let [low, high] = bounding_box(&scan.points);
        if !crossings(&fit.surface, low.distance(high), &|_| true).is_empty() {
            return Ok((
                None,
                Some(format!("{}, which would intersect itself", fit.reason)),
            ));
        }
        let robust = outliers::Robust {
            residuals: &fit.residuals,
            weights: None,
            sigma: fit.sigma,
        };
        let places = (0..scan.points.len()).filter(|&k| !held_out[k]);
        let mut lost = vec![false; scan.points.len()];
        let found = outliers::lost(&points, &robust, tolerance, scan.spacing);
        for (k, out) in places.zip(found) {
            lost[k] = out;
        }
        // What was accepted by its symmetry must also reach every point, at the rims above all. Where it is a whole turn
        // that is known.
        let reach = tolerance.max(REACH_SIGMAS * scan.noise);
        let off = |k: usize| {
            if fit.sector.whole() {
                fit.residuals[k].abs()
            } else {
                let foot = fit.parameters[k];
                fit.surface.point(foot.x, foot.y).distance(points[k])
            }
        };
        let places = (0..scan.points.len()).filter(|&k| !held_out[k]);
        let missed = places
            .enumerate()
            .filter(|&(seen, k)| !lost[k] && off(seen) > reach);
        if missed.count() as f64 > MISSED * scan.points.len() as f64 * scan.noise / reach {
            return Ok((None, None));
        }
        Ok((
            Some(Shaped {
                surface: fit.surface,
                crossings: 0,
                trimming: None,
                may_cross: false,
                topology: fit.topology,
                error: fit.sigma,
                not_met: None,
                beyond: 0,
                lost,
                loose: Vec::new(),
                feet: (!held_out.contains(&true)).then_some(fit.parameters),
                met: Met::default(),
                notes: Notes {
                    details: vec![fit.reason],
                    ..Notes::default()
                },
            }),
            None,
        ))
    }

    /// A free form that misses the tolerance asked for, or the surface of revolution that a looser one allows, if that is
    /// closer to the points.
    pub(super) fn turned_instead(&self, free: Shaped) -> Result<Shaped> {
        let Self {
            scan,
            tolerance,
            options,
            ..
        } = *self;
        let Some(asked) = tolerance.asked().filter(|_| free.not_met.is_some()) else {
            return Ok(free);
        };
        let off = |surface: &NurbsSurface| -> Result<f64> {
            let closest = ClosestPoint::new(surface)?;
            let mut distances = each(scan.points.len(), |k| {
                closest.closest(scan.points[k]).distance
            });
            let within = options.within.unwrap_or(USUAL_SHARE);
            Ok(quantile_in_place(&mut distances, within))
        };
        for looser in LOOSER {
            let (turned, _) = self.turned(looser * asked)?;
            if let Some(mut turned) = turned {
                if off(&turned.surface)? < off(&free.surface)? {
                    turned.not_met = free.not_met;
                    return Ok(turned);
                }
                break;
            }
        }
        Ok(free)
    }
}
