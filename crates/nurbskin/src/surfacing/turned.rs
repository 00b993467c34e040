//! A part as an exact surface of revolution, accepted or refused.
//!
//! ```text
//! accept:  points with |d| > max(T, 5 σ), outliers aside,  ≤ 0.005 M σ / reach,   and no self-intersection
//! ```
//!
//! The fit itself is `nurbskin_fit::fit::revolution`; here its result is tested against all points, the budget and the
//! requested topology. Where a free form misses the tolerance, a surface of revolution with a looser one is tried.
//! Ours.

use super::SurfacingOptions;
use super::outliers;
use super::part::{AUTOMATIC_BUDGET, Shaped, Task, seen};
use crate::deviation::verdict::USUAL_SHARE;
use nurbskin_cad::check::crossings;
use nurbskin_fit::charting::PointState;
use nurbskin_fit::fit::approximate::trade::Met;
use nurbskin_fit::fit::revolution;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::nurbs::closest::ClosestPoint;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::{Error, NurbsSurface, Result};

/// Distance within which a surface of revolution must have its points, in standard deviations of the noise, or the
/// tolerance if that is more.
/// Derived: one normal error in 1.7 million exceeds it.
const REACH_SIGMAS: f64 = 5.0;
/// Share of the points that may lie beyond this reach, times the ratio of the noise to the reach; none where there is
/// no noise.
/// Trial: not recorded. It allows for scatter at rims.
const MAX_MISSED_SHARE: f64 = 5e-3;
/// Factors of a tolerance that the free form misses, with which a surface of revolution is tried in turn.
/// Dimensionless.
/// Guard: doubled each time; each takes a fit.
const LOOSENED_TOLERANCES: [f64; 3] = [2.0, 4.0, 8.0];

impl Task<'_> {
    /// The exact surface of revolution, if the points are a scan of one and nothing else is requested; otherwise, for a
    /// near miss, the reason.
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
        if count > options.max_control_points.unwrap_or(AUTOMATIC_BUDGET) {
            return Ok((None, None));
        }
        if let Some(asked) = options.topology.filter(|&asked| asked != fit.topology) {
            let why = format!(
                "{}, which is not the {} asked for",
                fit.reason,
                asked.name()
            );
            return Ok((None, Some(why)));
        }
        // A profile that crosses the axis, or itself, bounds no solid.
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
        // The symmetry was accepted on a sample; the surface must also reach every point, above all at the rims. For a
        // whole turn the residuals are known.
        let states = lost.iter().map(|&lost| match lost {
            true => PointState::Outlier,
            false => PointState::Charted,
        });
        let states = states.collect();
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
        if missed.count() as f64 > MAX_MISSED_SHARE * scan.points.len() as f64 * scan.noise / reach
        {
            return Ok((None, None));
        }
        Ok((
            Some(Shaped {
                surface: fit.surface,
                crossings: 0,
                crosses_widely: false,
                is_unmended: false,
                trimming: None,
                may_cross: false,
                topology: fit.topology,
                is_spread_out: false,
                error: fit.sigma,
                not_met: None,
                beyond: 0,
                states,
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

    /// The free form that misses the requested tolerance, or the surface of revolution that a looser one allows, if
    /// that is closer to the points.
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
        for looser in LOOSENED_TOLERANCES {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfacing::Tolerance;
    use nurbskin_fit::chart::Topology;
    use nurbskin_fit::charting::{ChartOptions, Charts};
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::simulate::{self, Order, ScanOptions, Shape};
    use nurbskin_scan::{CleanOptions, clean};
    use std::sync::OnceLock;

    #[test]
    fn a_turned_part_of_another_topology_is_named_as_what_was_asked_for() {
        let options = ScanOptions {
            points: Some(3000),
            order: Order::Shuffled,
            ..ScanOptions::default()
        };
        let scan = simulate::scan(Shape::Pot, &options).unwrap().scan;
        let cleaned = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
        let asked = |topology| SurfacingOptions {
            topology,
            ..SurfacingOptions::default()
        };
        let turned = |options: &SurfacingOptions| {
            let tolerance = Tolerance::choose(options, scan.unit, cleaned.noise, 100.0);
            let task = Task {
                scan: &cleaned,
                vertices: false,
                least: 0,
                tolerance: &tolerance,
                held_out: &vec![false; cleaned.points.len()],
                options,
                progress: &Silent,
                only_met: false,
                worth_mending: f64::INFINITY,
                mesh: &OnceLock::new(),
                charts: &Charts::new(&cleaned, ChartOptions::default()),
            };
            task.turned(0.1).unwrap()
        };
        assert!(turned(&asked(None)).0.is_some());
        let (none, why) = turned(&asked(Some(Topology::Torus)));
        assert!(none.is_none());
        assert!(why.unwrap().ends_with("which is not the torus asked for"));
    }
}
