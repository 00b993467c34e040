//! Plausibility of a run, independent of its deviation.
//!
//! Checks units and sizes, the points without a surface, the outliers, the coverage, and the position of an aligned
//! scan. Each finding becomes a reason for `fail` or `cannot tell`, or a warning. The limits lie above the figures of
//! the project's real scans.

use super::outcome::RejectedCounts;
use super::{Length, Options, Trim};
use crate::deviation::verdict::{Reason, Verdict};
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::notes::Notes;
use nurbskin_geometry::unit::{Unit, UnitSource, counted, grouped, percent, three_digits};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::Scan;

/// Usual sizes of scanned parts, in millimetres; the unit of a scan without one is doubtful outside this range.
const USUAL_SIZES: [f64; 2] = [1.0, 10_000.0];
/// Share of the points without a surface above which a large part of the scan is missing. The worst real scan of the
/// project loses 8.5 %, in splinters at its boundaries.
const LEFT_OUT: f64 = 0.1;
/// The same including outliers. No scanner produces this many: such points belong to another object.
const IGNORED: f64 = 0.25;
/// Share of ignored points above which a warning is given.
const MANY_IGNORED: f64 = 5e-3;
/// Share of a surface without data above which it is mostly interpolated, unless the options extend it beyond the scan.
/// After trimming and filling, less than 1 % remains on the real scans of the project.
const INVENTED: f64 = 0.25;
/// A scan and a nominal whose sizes differ by more than this factor belong to different parts, or have different units.
const UNLIKE: f64 = 2.0;
/// Least share of the nominal with data for any statement.
const BARE: f64 = 0.01;
/// An aligned scan is misplaced if half of its points are farther from the nominal than this share of its diagonal. No
/// part deviates as much from its drawing; a misplaced scan is several times farther.
const MISPLACED: f64 = 5e-3;
/// Two sizes within this factor count as equal: one of the two is often partial or rotated.
const ALIKE: f64 = 1.3;

/// Refuses shares outside their range.
///
/// # Errors
/// [`Error::Invalid`].
pub(super) fn check_shares(within: Option<f64>, min_coverage: Option<f64>) -> Result<()> {
    for (name, share) in [("--within", within), ("--min-coverage", min_coverage)] {
        if let Some(share) = share.filter(|share| !(0.0..=1.0).contains(share)) {
            return Err(Error::invalid(format!(
                "{name} takes a share between 0 and 100 %, not {}",
                percent(share)
            )));
        }
    }
    Ok(())
}

/// The doubt about the unit of a scan: no source gives it, and with `unit` the scan is very small or large.
pub(super) fn doubtful_unit(source: UnitSource, unit: Unit, extents: [f64; 3]) -> Option<Reason> {
    let largest = extents.into_iter().fold(0.0, f64::max) * unit.millimetres();
    let usual = (USUAL_SIZES[0]..=USUAL_SIZES[1]).contains(&largest);
    if source != UnitSource::Assumed || usual || largest <= 0.0 {
        return None;
    }
    // The first unit with a usual size of the scan.
    let likely = [Unit::Metre, Unit::Millimetre, Unit::Micrometre]
        .into_iter()
        .find(|other| {
            let size = largest / unit.millimetres() * other.millimetres();
            *other != unit && (USUAL_SIZES[0]..=USUAL_SIZES[1]).contains(&size)
        })
        .unwrap_or(Unit::Metre);
    Some(
        Reason::new(format!(
            "the size of the scan is {}, if its numbers are in {unit}: nothing says their unit",
            unit.size(extents)
        ))
        .next(format!(
            "say the unit, as in --unit {likely}: {}",
            likely.size(extents)
        )),
    )
}

/// The doubt about a tolerance as large as the scan, reported before the computation.
pub(super) fn doubtful_tolerance(scan: &Scan, options: &Options) -> Option<String> {
    let finite = scan.points.iter().filter(|p| p.is_finite());
    let (low, high) = finite.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
        (low.min(*p), high.max(*p))
    });
    let diagonal = low.distance(high);
    let tolerance = options.surfacing.tolerance?.resolve(scan.unit, diagonal);
    (diagonal.is_finite() && diagonal > 0.0 && tolerance >= diagonal).then(|| {
        format!(
            "the tolerance of {} is larger than the scan, whose diagonal is {}: check the units of both",
            scan.unit.length(tolerance),
            scan.unit.length(diagonal)
        )
    })
}

/// The basis of a fit besides its deviation.
pub(super) struct FitFacts<'a> {
    /// Points with coordinates.
    pub(super) points: usize,
    pub(super) rejected: RejectedCounts,
    /// Points beyond the boundary of their surface.
    pub(super) beyond: usize,
    pub(super) unsupported: f64,
    pub(super) unit: Unit,
    pub(super) unit_source: UnitSource,
    pub(super) extents: [f64; 3],
    pub(super) options: &'a Options,
}

/// The findings on a fit that do not depend on its deviation.
pub(super) fn of_fit(facts: &FitFacts<'_>) -> Vec<(Verdict, Reason)> {
    let mut found = Vec::new();
    let share = |count: usize| count as f64 / facts.points.max(1) as f64;
    let RejectedCounts {
        outlier, left_out, ..
    } = facts.rejected;
    let bare = left_out + facts.beyond;
    if share(bare) > LEFT_OUT {
        let reason = Reason::new(format!(
            "{} of the points ({} of {}) have no surface",
            percent(share(bare)),
            grouped(bare),
            grouped(facts.points)
        ));
        let next = "cut the scan up and fit each piece on its own";
        found.push((Verdict::Fail, reason.next(next)));
    } else if share(bare + outlier) > IGNORED {
        let reason = Reason::new(format!(
            "{} of the points ({} of {}) are not used, most of them as outliers",
            percent(share(bare + outlier)),
            grouped(bare + outlier),
            grouped(facts.points)
        ));
        let next = "remove what is not part of the surface from the scan";
        found.push((Verdict::Fail, reason.next(next)));
    }
    let covered = 1.0 - facts.unsupported;
    if let Some(least) = facts.options.min_coverage {
        if covered < least {
            found.push((Verdict::CannotTell, uncovered(covered, least, "surface")));
        }
    } else if facts.unsupported > INVENTED && facts.options.surfacing.trim != Trim::Off {
        let reason = Reason::new(format!(
            "{} of the surface's area has no data: it is invented there",
            percent(facts.unsupported)
        ));
        let next = "scan the rest of the part, or more densely";
        found.push((Verdict::CannotTell, reason.next(next)));
    }
    let doubt = doubtful_unit(facts.unit_source, facts.unit, facts.extents);
    if let (Some(doubt), Some(Length::In(..))) = (doubt, facts.options.surfacing.tolerance) {
        found.push((Verdict::CannotTell, doubt));
    }
    found
}

fn uncovered(covered: f64, least: f64, what: &str) -> Reason {
    let enough = (100.0 * covered).floor();
    let next = match enough > 0.0 {
        true => format!(
            "scan the rest of the part, or say --min-coverage {}% if this much is enough",
            three_digits(enough)
        ),
        false => format!("scan the part: next to nothing of the {what} was seen"),
    };
    Reason::new(format!(
        "only {} of the {what}'s area has data, {} is asked for",
        percent(covered),
        percent(least)
    ))
    .next(next)
}

/// The basis of a comparison besides its deviation.
pub(super) struct ComparedFacts {
    /// Diagonals of scan and nominal, in the scan's unit.
    pub(super) sizes: [f64; 2],
    pub(super) unit: Unit,
    pub(super) aligned: bool,
    /// Share of the nominal's area with data.
    pub(super) covered: f64,
    /// Required share, if a tolerance was given.
    pub(super) least: Option<f64>,
    /// Median distance of the points.
    pub(super) median: f64,
}

/// The findings on a comparison that do not depend on its deviation.
pub(super) fn of_comparison(facts: &ComparedFacts) -> Vec<(Verdict, Reason)> {
    let mut found = Vec::new();
    if let Some(reason) = unlike(facts) {
        found.push((Verdict::CannotTell, reason));
    } else if facts.covered < BARE {
        let next = match facts.aligned {
            true => "check that this is the scan of this part, and its unit (--unit)",
            false => "say --align if the scan is not in the nominal's coordinates",
        };
        let what = format!(
            "the scan is not where the nominal is: {} of the nominal's area has data",
            percent(facts.covered)
        );
        found.push((Verdict::CannotTell, Reason::new(what).next(next)));
    }
    if let Some(reason) = misplaced(facts) {
        found.push((Verdict::CannotTell, reason));
    }
    if let Some(least) = facts.least
        && facts.covered < least
    {
        found.push((
            Verdict::CannotTell,
            uncovered(facts.covered, least, "nominal"),
        ));
    }
    found
}

/// Reason for an aligned scan that does not lie on the nominal: the alignment stopped at a wrong position.
pub(super) fn misplaced(facts: &ComparedFacts) -> Option<Reason> {
    let far = facts.aligned && facts.median > MISPLACED * facts.sizes[1];
    (far && facts.sizes[1] > 0.0).then(|| {
        Reason::new(format!(
            "the alignment may have stopped at a wrong place: half of the points are still farther than {} from the \
             nominal, {} of its size",
            facts.unit.length(facts.median),
            percent(facts.median / facts.sizes[1])
        ))
        .next(
            "turn and move the scan roughly to its place first, then say --align again; or check that this is the scan \
             of this part",
        )
    })
}

/// Reason for a scan and a nominal of different sizes. A partial scan is smaller than its nominal: without an
/// alignment, this is no reason for doubt unless it covers almost none of the nominal. The coverage is judged
/// separately.
fn unlike(facts: &ComparedFacts) -> Option<Reason> {
    let [scan, nominal] = facts.sizes;
    if scan <= 0.0 || nominal <= 0.0 {
        return None;
    }
    let ratio = nominal / scan;
    let differ = ratio.max(1.0 / ratio);
    let doubtful = facts.aligned || ratio < 1.0 || facts.covered < BARE;
    if differ <= UNLIKE || !doubtful {
        return None;
    }
    let likely = likely_unit(facts.sizes, facts.unit);
    let reason = Reason::new(format!(
        "the scan is {} times {} than the nominal: its diagonal is {}, the nominal's {}",
        three_digits(differ),
        if ratio > 1.0 { "smaller" } else { "larger" },
        facts.unit.length(scan),
        facts.unit.length(nominal)
    ));
    Some(reason.next(match likely {
        Some(unit) => format!("the scan looks like {}: say --unit {unit}", name_of(unit)),
        None => "check that this is the scan of this part, and its unit (--unit)".to_owned(),
    }))
}

/// The unit that makes the scan as large as the nominal, if there is one.
fn likely_unit([scan, nominal]: [f64; 2], unit: Unit) -> Option<Unit> {
    let off = |other: &Unit| {
        let scaled = scan * other.millimetres() / unit.millimetres();
        math::ln(scaled / nominal).abs()
    };
    let others = Unit::ALL.into_iter().filter(|&other| other != unit);
    others
        .filter(|other| off(other) < math::ln(ALIKE))
        .min_by(|a, b| off(a).total_cmp(&off(b)))
}

/// The plural of a unit.
fn name_of(unit: Unit) -> &'static str {
    match unit {
        Unit::Millimetre => "millimetres",
        Unit::Centimetre => "centimetres",
        Unit::Metre => "metres",
        Unit::Micrometre => "micrometres",
        Unit::Inch => "inches",
        Unit::Foot => "feet",
    }
}

/// Note on outliers and points without coordinates (empty cells of a grid excepted): a warning if there are many.
pub(super) fn ignored(points: usize, rejected: RejectedCounts, is_grid: bool, notes: &mut Notes) {
    let RejectedCounts {
        non_finite,
        outlier,
        ..
    } = rejected;
    let without = counted(non_finite, "point", "points") + " without finite coordinates";
    let off = counted(outlier, "outlier", "outliers") + " off the surface";
    for (count, said, is_usual) in [(non_finite, without, is_grid), (outlier, off, false)] {
        let share = count as f64 / points.max(1) as f64;
        let said = format!("{} of the scan is ignored: {said}", percent(share));
        if count > 0 && share >= MANY_IGNORED && !is_usual {
            notes.warn(said);
        } else if count > 0 {
            notes.detail(said);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfacing::SurfacingOptions;

    #[test]
    fn sizes_without_a_unit_are_doubted() {
        let mm = Unit::Millimetre;
        let doubt = |size: f64| doubtful_unit(UnitSource::Assumed, mm, [size, 0.1 * size, 0.0]);
        assert!(doubt(2.0).is_none() && doubt(9000.0).is_none() && doubt(0.0).is_none());
        let said = doubt(0.196).unwrap();
        assert!(said.what.contains("0.196 x 0.0196 x 0 mm"), "{}", said.what);
        assert!(said.next.unwrap().contains("--unit m: 196 x 19.6 x 0 mm"));
        assert!(doubt(2e5).unwrap().next.unwrap().contains("--unit um"));
        let far = doubtful_unit(UnitSource::Assumed, Unit::Metre, [3360.0, 4640.0, 136.0]).unwrap();
        assert!(far.next.unwrap().contains("--unit mm: 3.36 x 4.64"));
        assert!(doubtful_unit(UnitSource::File, mm, [0.1; 3]).is_none());
    }

    fn compared(sizes: [f64; 2], covered: f64) -> ComparedFacts {
        ComparedFacts {
            sizes,
            unit: Unit::Millimetre,
            aligned: true,
            covered,
            least: Some(0.9),
            median: 0.0,
        }
    }

    #[test]
    fn a_scan_of_another_size_or_of_little_of_the_part_cannot_tell() {
        assert!(of_comparison(&compared([100.0, 110.0], 0.95)).is_empty());
        let [(verdict, reason), (_, coverage)] =
            &of_comparison(&compared([19.4, 19_393.0], 0.0))[..]
        else {
            panic!();
        };
        assert_eq!(*verdict, Verdict::CannotTell);
        assert!(
            reason.what.contains("1000 times smaller"),
            "{}",
            reason.what
        );
        assert_eq!(
            reason.next.as_deref(),
            Some("the scan looks like metres: say --unit m")
        );
        assert!(coverage.what.contains("0 % of the nominal's area"));
        assert!(!coverage.next.as_deref().unwrap().contains("--min-coverage"));
        // Inches, and no unit at all.
        let next = |sizes| unlike(&compared(sizes, 0.9)).unwrap().next.unwrap();
        assert!(next([10.0, 254.0]).contains("--unit in"));
        assert!(next([254.0, 80.0]).contains("this part"));
        // A third of the part.
        let [(_, part)] = &of_comparison(&compared([90.0, 100.0], 0.3034))[..] else {
            panic!();
        };
        assert!(
            part.what
                .contains("only 30.3 % of the nominal's area has data, 90 %")
        );
        assert!(part.next.as_deref().unwrap().contains("--min-coverage 30%"));
        let unasked = |sizes, covered| ComparedFacts {
            least: None,
            aligned: false,
            ..compared(sizes, covered)
        };
        assert!(of_comparison(&unasked([20.0, 100.0], 0.05)).is_empty());
        assert_eq!(of_comparison(&unasked([20.0, 100.0], 0.0)).len(), 1);
        assert_eq!(of_comparison(&unasked([90.0, 100.0], 0.0)).len(), 1);
    }

    #[test]
    fn an_alignment_that_failed_is_said() {
        let placed = |median, aligned| ComparedFacts {
            median,
            aligned,
            ..compared([100.0, 100.0], 0.95)
        };
        let [(Verdict::CannotTell, reason)] = &of_comparison(&placed(2.0, true))[..] else {
            panic!();
        };
        assert!(reason.what.contains("farther than 2 mm"), "{}", reason.what);
        assert!(of_comparison(&placed(0.1, true)).is_empty());
        assert!(of_comparison(&placed(2.0, false)).is_empty());
    }

    #[test]
    fn what_a_fit_leaves_out_and_invents_is_held_against_it() {
        let options = Options::default();
        let facts = FitFacts {
            points: 1000,
            rejected: RejectedCounts::default(),
            beyond: 0,
            unsupported: 0.01,
            unit: Unit::Millimetre,
            unit_source: UnitSource::Assumed,
            extents: [0.2; 3],
            options: &options,
        };
        assert!(of_fit(&facts).is_empty());
        let left = |outlier, left_out, beyond| FitFacts {
            rejected: RejectedCounts {
                outlier,
                left_out,
                ..RejectedCounts::default()
            },
            beyond,
            ..facts
        };
        assert!(of_fit(&left(150, 50, 40)).is_empty());
        let [(Verdict::Fail, reason)] = &of_fit(&left(0, 70, 40))[..] else {
            panic!();
        };
        assert_eq!(
            reason.what,
            "11 % of the points (110 of 1000) have no surface"
        );
        assert_eq!(of_fit(&left(260, 0, 0)).len(), 1);
        let bare = FitFacts {
            unsupported: 0.35,
            ..facts
        };
        assert_eq!(of_fit(&bare)[0].0, Verdict::CannotTell);
        let asked = |min_coverage, trim| Options {
            surfacing: SurfacingOptions {
                trim,
                ..SurfacingOptions::default()
            },
            min_coverage,
            ..Options::default()
        };
        let with = |options: &Options| of_fit(&FitFacts { options, ..bare }).len();
        assert_eq!(with(&asked(Some(0.6), Trim::Auto)), 0);
        assert_eq!(with(&asked(Some(0.7), Trim::Off)), 1);
        assert_eq!(with(&asked(None, Trim::Off)), 0);
        // A tolerance in millimetres has no meaning if the scan's unit is assumed.
        let tolerance = |length| Options {
            surfacing: SurfacingOptions {
                tolerance: Some(length),
                ..SurfacingOptions::default()
            },
            ..Options::default()
        };
        let with = |options: &Options| of_fit(&FitFacts { options, ..facts }).len();
        assert_eq!(with(&tolerance(Length::In(0.01, Unit::Millimetre))), 1);
        assert_eq!(with(&tolerance(Length::Plain(0.01))), 0);
    }
}
