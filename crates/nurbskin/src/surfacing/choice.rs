//! The choice between one surface and a network of faces.
//!
//! ```text
//! network:      a closed mesh has many feature lines, and the network meets the tolerance and keeps them sharp
//! one surface:  an open mesh without a requested tolerance, and a surface of the usual size comes as close as aimed at; it is tried
//!               first where one with 1000 control points shows that it should
//! one surface:  a mesh, or a closed cloud without a requested tolerance, and it meets its aim with no more control points than the
//!               network, which is tried where one surface takes more than 1000 (5000 if open with a requested tolerance)
//! network:      a closed cloud, and it keeps the requested tolerance with fewer control points than one surface that takes more than
//!               1000
//! network:      such a mesh or cloud, where only the network meets the aim, or one surface leaves much of the part without any
//! one surface:  otherwise, where it meets its aim and does not intersect itself
//! the better:   otherwise, also where one surface is refused
//! ```
//!
//! A network that lacks faces, which would intersect others, counts as one that meets the aim only if the scan is open and the faces have
//! few points. Other ones take the place of surfaces that are poor, or presumably would be with as many control points.
//!
//! Better is what meets the tolerance; then what does not intersect itself; then what is closer to the points, clearly closer if
//! it takes more control points. Ours.

use super::network::{Outlook, is_closed, outlook};
use super::part::{self, AUTOMATIC_BUDGET, LinedMesh, MOST_STRANDED, Made, Task, single};
use super::surfaces::PartShape;
use super::{FaceLayout, SurfacingOptions};
use network::Network;
use nurbskin_fit::fit::approximate::trade::TradePoint;
use nurbskin_geometry::math;
use nurbskin_geometry::unit::{counted, grouped, percent};
use nurbskin_geometry::{Error, Result};

mod network;

/// Ratio of the distances of 95 % of the points, network to single surface, below which the network is clearly closer where neither
/// meets the tolerance. Without a requested tolerance it is multiplied by the ratio of the control points. Dimensionless.
/// Trial: not varied; the network of a head at 0.1 % of its diagonal has 0.36, with 3.4 times the control points.
const CLEARLY_CLOSER: f64 = 0.8;
/// Distance of 95 % of the points, in that aimed at, above which a single surface is poor where no tolerance was asked
/// for. Dimensionless.
/// Trial: on the scans of docs/real-scans.md.
const POOR_FIT: f64 = 3.0;
/// Control points that a single surface may take before a network is tried. Count.
/// Trial: closed scans that one surface carries (bottles, a banana at a coarse tolerance) take 100 to 600; others fail at 5000
/// after minutes.
const FIRST_BUDGET: usize = 1000;
/// The same of an open mesh with a requested tolerance. Count.
/// Trial: the usual budget. A side panel with windows keeps 0.1 % of its diagonal with 2242 in 5 s, a vase 0.2 % with 3799 in 8 s, and
/// their networks take 17 and 40 s; a range image does not keep 0.1 % with 12 000 in 40 s, and its network does with 5100 in 15 s.
const FIRST_BUDGET_OPEN: usize = AUTOMATIC_BUDGET;
/// Distance of 95 % of the points, in that aimed at, beyond which the self-intersections of a single surface are not mended before the
/// network is tried. Dimensionless.
/// Derived: as [`POOR_FIT`]; mends bring no surface closer.
const WORTH_MENDING: f64 = POOR_FIT;
/// Factor of the order at which the distance has fallen with the control points (`Met::order`). With more than this order to go, a
/// larger surface is not tried. Dimensionless.
/// Guard: a detail that is not resolved yet makes the order too low. On nine bodies that one surface did not carry, the factor would
/// have had to be 1.0 to 6.
const STEEPER: f64 = 2.0;
/// Total length of the feature lines of a part, in diagonals, from which a network is tried first.
/// Trial: 0.7 for a scan of a banana, whose ridges are soft, and 10 for a machined part (fandisk).
const MIN_CREASES: f64 = 2.0;

/// Fits a part as its options say: with one surface, with a network, or with the better one.
///
/// # Errors
/// [`Error::Unsupported`] and [`Error::NoSolution`] where no fit is possible; [`Error::Cancelled`].
pub(super) fn fit(task: &Task<'_>) -> Result<Made> {
    match task.options.layout {
        FaceLayout::Network => Network::of(task).take(),
        FaceLayout::Single => single(task).map_err(|why| with_way_out(why, task)),
        // A requested domain is that of one surface.
        FaceLayout::Auto if task.options.topology.is_some() => single(task),
        FaceLayout::Auto => automatic(task),
    }
}

/// Whether a surface meets the tolerance and does not intersect itself, and does not lack faces for that.
fn is_sound(made: &Made) -> bool {
    will_do(made) && !made.is_opened
}

/// Whether a surface meets the tolerance and does not intersect itself.
fn will_do(made: &Made) -> bool {
    made.part.not_met.is_none() && made.crossings == 0
}

/// One surface, or a network where that is better.
fn automatic(task: &Task<'_>) -> Result<Made> {
    let mut network = Network::of(task);
    let made = better(task, &mut network)?;
    Ok(match network.is_unsound() {
        true => beside_network(made),
        false => made,
    })
}

/// One surface, or the network where that is better.
fn better(task: &Task<'_>, network: &mut Network<'_, '_>) -> Result<Made> {
    let outlook = match outlook(task) {
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        outlook => outlook.unwrap_or(None),
    };
    let is_closed = outlook.as_ref().is_some_and(|outlook| !outlook.is_open);
    let is_open_mesh = outlook.as_ref().is_some_and(|outlook| outlook.is_open);
    if let Some(outlook) = outlook {
        if outlook.creases >= MIN_CREASES
            && let Some(made) = creased(task, network)?
        {
            return Ok(made);
        }
        if let Some(made) = no_larger(task, network, &outlook)? {
            return Ok(made);
        }
    }
    let options = SurfacingOptions {
        max_control_points: task
            .options
            .max_control_points
            .or_else(|| network.matched().filter(|_| is_closed)),
        ..task.options.clone()
    };
    let bounded = Task {
        options: &options,
        ..*task
    };
    // What the network may replace is mended only where that does not.
    let may_follow = is_possible(task) && (network.at_once || !network.is_unsound());
    let hasty = Task {
        worth_mending: match task.options.max_control_points {
            None if may_follow => WORTH_MENDING * task.tolerance.value,
            _ => f64::INFINITY,
        },
        ..bounded
    };
    let single = match single(&hasty) {
        Err(why @ (Error::Unsupported(_) | Error::NoSolution(_))) => {
            return instead_of_refused(network, why);
        }
        other => other?,
    };
    let Some(why) = poor(&single, task) else {
        if single.part.not_met.is_some() {
            // With a budget, or a tolerance below the noise, a network is not made for this; it may be there.
            let is_free = task.options.max_control_points.is_none() && may_follow;
            let is_far = single.error > task.tolerance.value;
            if is_open_mesh && is_free && is_far && network.made.is_none() {
                task.progress.check()?;
                network.at_once = true;
                network.sound()?;
            }
            if network.beats(&single) {
                let mut found = network.take()?;
                let tried = grouped(single.part.shape.control_points());
                found.notes.details.insert(0, missed(task, &tried));
                return Ok(found);
            }
        }
        if !is_smaller(task, network, &single)? {
            return Ok(single);
        }
        let control_points = grouped(single.part.shape.control_points());
        let mut found = network.take()?;
        let said = format!("one surface takes {control_points} control points");
        found.notes.details.insert(0, said);
        return Ok(found);
    };
    task.progress.check()?;
    let network = network.take();
    let is_settled = match &network {
        Err(Error::Cancelled) => true,
        network => network.as_ref().is_ok_and(will_do),
    };
    if is_settled || !single.is_unmended {
        return closer(task, single, &why, network);
    }
    let mended = match part::single(&bounded) {
        Err(Error::Unsupported(_) | Error::NoSolution(_)) => single,
        other => other?,
    };
    match poor(&mended, task) {
        Some(why) => closer(task, mended, &why, network),
        None => Ok(beside_network(mended)),
    }
}

/// Whether a surface may keep the tolerance: one below the noise of the scan none keeps.
fn is_possible(task: &Task<'_>) -> bool {
    task.tolerance.value >= task.tolerance.told(task.scan.noise)
}

/// The better one of a single surface that is poor for the reason `why`, and the network.
fn closer(task: &Task<'_>, single: Made, why: &str, network: Result<Made>) -> Result<Made> {
    match network {
        Ok(mut found) if is_better(&found, &single, task) => {
            found
                .notes
                .details
                .insert(0, format!("one surface was tried first: {why}"));
            Ok(found)
        }
        Ok(other) => {
            let control_points = grouped(other.part.shape.control_points());
            Ok(kept(
                single,
                format!(
                    "{why}; a network of {} with {control_points} control points is no better: {} at 95 % of the points",
                    counted(other.part.shape.faces(), "face", "faces"),
                    task.scan.unit.length(other.error)
                ),
            ))
        }
        Err(Error::Cancelled) => Err(Error::Cancelled),
        Err(other) => Ok(kept(
            single,
            format!("{why}; a network of faces fails: {other}"),
        )),
    }
}

/// One surface, as long as it takes no more control points than the network that keeps the tolerance, or comes as close as aimed at
/// where none was asked for; that network otherwise. It is tried where one surface takes more control points than a first budget, and a
/// larger surface is tried only where it [may reach](may_reach) the tolerance. [`None`]
/// where neither is sound, with a budget, with a tolerance below the noise, and where an open part may be one surface of the usual size.
fn no_larger(
    task: &Task<'_>,
    network: &mut Network<'_, '_>,
    outlook: &Outlook,
) -> Result<Option<Made>> {
    let is_asked = task.tolerance.asked().is_some();
    let first = match outlook.is_open && is_asked {
        true => FIRST_BUDGET_OPEN,
        false => FIRST_BUDGET,
    };
    if task.options.max_control_points.is_some() || !is_possible(task) {
        return Ok(None);
    }
    let within = |budget: usize| {
        let options = SurfacingOptions {
            max_control_points: Some(budget),
            ..task.options.clone()
        };
        let task = Task {
            options: &options,
            only_met: true,
            ..*task
        };
        single(&task)
    };
    // A sheet of the usual size ends where control points no longer pay.
    let is_sheet = |made: &Made| {
        let is_near = is_sound(made) || carries(made, task.tolerance.value);
        outlook.is_open && !is_asked && is_near && !is_partial(made, task)
    };
    let unsound = match within(first) {
        Ok(made) if is_sheet(&made) => return Ok(None),
        Ok(made) if is_sound(&made) && !is_partial(&made, task) => return Ok(Some(made)),
        Ok(made) => made,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        // Where one surface is refused, the reason is said elsewhere.
        Err(_) => return Ok(None),
    };
    task.progress.check()?;
    network.at_once = !is_asked && network.made.is_none();
    let tolerance = task.tolerance.value;
    // Larger surfaces leave out the same.
    let partial = is_partial(&unsound, task);
    let why = |tried: usize| match partial {
        true => format!("one surface {}", leaves_out(&unsound)),
        false => missed(task, &grouped(tried)),
    };
    let Some(found) = network.sound()? else {
        // One that lacks faces will do where a larger surface is not even tried.
        let may_do =
            |count: usize| !partial && may_reach(&unsound, tolerance, count.max(AUTOMATIC_BUDGET));
        if network.opened().is_none_or(may_do) {
            return Ok(None);
        }
        let found = network.closed()?;
        return Ok(found.map(|mut found| {
            found.notes.details.insert(0, why(first));
            found
        }));
    };
    let count = found.part.shape.control_points();
    // Without a requested tolerance no surface is larger than usual.
    let most = match is_asked {
        true => usize::MAX,
        false => AUTOMATIC_BUDGET,
    };
    let mut tried = first;
    let may_do =
        !partial && (unsound.part.not_met.is_none() || may_reach(&unsound, tolerance, count));
    if (first + 1..=most).contains(&count) && may_do {
        tried = count;
        if let Ok(made) = within(count)
            && is_sound(&made)
            && !is_partial(&made, task)
        {
            return Ok(Some(made));
        }
    }
    task.progress.check()?;
    let mut found = network.take()?;
    found.notes.details.insert(0, why(tried));
    Ok(Some(found))
}

/// What is wrong with one surface of `tried` control points that misses the tolerance.
fn missed(task: &Task<'_>, tried: &str) -> String {
    let missed = match task.tolerance.asked() {
        Some(_) => "does not keep the tolerance",
        None => "does not come as close as aimed at",
    };
    format!("one surface {missed} with {tried} control points")
}

/// Whether 95 % of the points are as near as aimed at, or presumably with the usual budget: the search for this smaller surface shows how
/// fast the distance falls. Either error only takes time: the other kind of surface follows.
fn carries(single: &Made, aim: f64) -> bool {
    largest(single).is_none_or(|(last, order)| {
        let growth = AUTOMATIC_BUDGET as f64 / last.control_points as f64;
        last.p95 <= aim * math::powf(growth, order).max(1.0)
    })
}

/// The largest surface in the search for a single one, and the order at which the distance fell up to it, if they are known.
fn largest(single: &Made) -> Option<(&TradePoint, f64)> {
    let met = &single.part.shape.single()?.met;
    met.largest().zip(met.order())
}

/// Whether a surface with `count` control points may keep the tolerance. The search for this smaller one, which misses it, shows how fast
/// the distance falls.
fn may_reach(single: &Made, tolerance: f64, count: usize) -> bool {
    largest(single).is_none_or(|(last, order)| {
        let growth = count as f64 / last.control_points as f64;
        last.tolerance <= tolerance * math::powf(growth, STEEPER * order)
    })
}

/// Whether the network of a closed cloud is sound and keeps a requested tolerance with fewer control points than one surface that does,
/// too. It is made where that takes more than [`FIRST_BUDGET`].
fn is_smaller(task: &Task<'_>, network: &mut Network<'_, '_>, single: &Made) -> Result<bool> {
    let is_cloud = task.scan.triangles.is_empty();
    let is_free = task.options.max_control_points.is_none() && task.tolerance.asked().is_some();
    let count = single.part.shape.control_points();
    if !is_cloud || !is_free || !is_sound(single) || count <= FIRST_BUDGET {
        return Ok(false);
    }
    match is_closed(task) {
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Ok(true) => {}
        _ => return Ok(false),
    }
    let found = network.sound()?;
    Ok(found.is_some_and(|found| found.part.shape.control_points() < count))
}

/// The network of a part with many feature lines, which one surface would round off, if it keeps the tolerance and the lines, and
/// does not intersect itself. An exact surface of revolution goes first.
fn creased(task: &Task<'_>, network: &mut Network<'_, '_>) -> Result<Option<Made>> {
    if task
        .turned(task.tolerance.told(task.scan.noise))?
        .0
        .is_some()
    {
        return Ok(None);
    }
    let affordable = |made: &Made| {
        let most = task.options.max_control_points;
        most.is_none_or(|most| made.part.shape.control_points() <= most)
    };
    if !network.sound()?.is_some_and(affordable) || network.search.is_smooth {
        return Ok(None);
    }
    let mut made = network.take()?;
    made.notes.details.insert(
        0,
        "one surface would round off the feature lines: a network keeps them sharp".into(),
    );
    Ok(Some(made))
}

/// A network in place of a single surface that is refused for the reason `why`.
fn instead_of_refused(network: &mut Network<'_, '_>, why: Error) -> Result<Made> {
    match network.take() {
        Ok(mut found) => {
            found
                .notes
                .details
                .insert(0, format!("one surface cannot be this part: {why}"));
            Ok(found)
        }
        Err(Error::Cancelled) => Err(Error::Cancelled),
        // Without a mesh of one piece with two sides, the first reason is the same.
        Err(other) if other.to_string() == why.to_string() => Err(why),
        Err(other) => Err(match why {
            Error::Unsupported(why) => {
                Error::Unsupported(format!("{why}; as a network of faces: {other}"))
            }
            why => Error::NoSolution(format!("{why}; as a network of faces: {other}")),
        }),
    }
}

/// The single surface, with the reason for which it stays.
fn kept(mut single: Made, said: String) -> Made {
    single.notes.detail(said);
    beside_network(single)
}

/// The single surface of a part whose network was tried.
fn beside_network(mut single: Made) -> Made {
    if let PartShape::Single(part) = &mut single.part.shape {
        part.network_tried = true;
    }
    single
}

/// Whether a surface leaves too much of its part without any that a network of its mesh could cover.
fn is_partial(made: &Made, task: &Task<'_>) -> bool {
    // Loose bits and narrow teeth of the mesh get none in any case.
    let lost = |mesh: &LinedMesh| task.stranded(&mesh.mesh.detached);
    made.stranded > MOST_STRANDED
        && task
            .lined_mesh()
            .is_ok_and(|mesh| made.stranded - lost(mesh) > MOST_STRANDED)
}

/// What a surface leaves out, in words.
fn leaves_out(made: &Made) -> String {
    format!(
        "leaves {} of the points without a surface, which hang by narrow necks",
        percent(made.stranded)
    )
}

/// The reason for which a network may be better than this surface, if there is one.
fn poor(single: &Made, task: &Task<'_>) -> Option<String> {
    if single.crossings > 0 {
        return Some(format!(
            "it intersects itself at {}",
            counted(single.crossings, "place", "places")
        ));
    }
    // A budget is meant for one surface: a network rarely does with fewer control points.
    if task.options.max_control_points.is_some() {
        return None;
    }
    if is_possible(task) && is_partial(single, task) {
        return Some(format!("it {}", leaves_out(single)));
    }
    let not_met = single.part.not_met.as_ref()?;
    let tolerance = task.tolerance.value;
    if task.tolerance.asked().is_some() {
        return is_possible(task).then(|| format!("it misses the tolerance: {not_met}"));
    }
    (single.error > POOR_FIT * tolerance).then(|| {
        let unit = task.scan.unit;
        format!(
            "95 % of the points are within {} of it, {} was aimed at",
            unit.length(single.error),
            unit.length(tolerance)
        )
    })
}

/// Whether a network replaces a single surface that is poor.
fn is_better(network: &Made, single: &Made, task: &Task<'_>) -> bool {
    let options = task.options;
    let count = network.part.shape.control_points();
    if options.max_control_points.is_some_and(|most| count > most) {
        return false;
    }
    let met = |made: &Made| made.part.not_met.is_none();
    let crosses = |made: &Made| made.crossings > 0;
    if crosses(network) && !crosses(single) {
        return false;
    }
    if is_partial(single, task) && !is_partial(network, task) {
        return met(network) || !met(single) || task.tolerance.asked().is_none();
    }
    match (met(network), met(single)) {
        (true, _) => true,
        (false, true) => false,
        (false, false) => {
            let control_points = |made: &Made| made.part.shape.control_points() as f64;
            let size = control_points(network) / control_points(single);
            let distance = network.error / single.error;
            // For a requested tolerance what is closer may take more.
            let price = if options.tolerance.is_some() {
                1.0
            } else {
                size
            };
            let pays = size <= 1.0 || price * distance < CLEARLY_CLOSER;
            distance < 1.0 && (pays || single.crossings > 0)
        }
    }
}

/// A refusal of a single surface that names the network as the way out, if the part has a mesh for one.
fn with_way_out(why: Error, task: &Task<'_>) -> Error {
    match why {
        Error::Unsupported(what) if task.lined_mesh().is_ok() => Error::Unsupported(format!(
            "{what}; or use `--layout network`, which fits any shape with several faces"
        )),
        other => other,
    }
}
