//! Thin cells join a neighbour, and cells with many corners are split: each only if all cells stay sound.
//!
//! The width of a cell is its area over its longest side. Thin cells give faces with short sides, and cells of seven and
//! more corners give irregular middles.

use super::arcs::Polygons;
use super::cells::{Cells, relabelled, smooth, split};
use super::collapse;
use super::grow::Grower;
use super::outlines::Outlines;
use super::surface::{Surface, index};
use super::{EdgeKind, NONE};

/// Width below which a cell is thin, in typical sides. Trial: prototype.
const THIN: f64 = 0.25;
/// Most corners of a cell after the collapse of arcs. Trial: prototype.
const MOST_CORNERS: usize = 6;
/// Most attempts of each kind. Guard: each looks at the whole mesh.
const ATTEMPTS: usize = 40;
/// Neighbours that a thin cell is offered to. Trial: prototype.
const OFFERS: usize = 3;
/// Rounds in which the labels of a split cell are smoothed. Trial: as for unsound cells.
const SMOOTHINGS: usize = 2;

/// Tidies sound cells; the result is sound. O(n) per attempt.
pub(crate) fn tidy(surface: &Surface<'_>, cells: Cells) -> Cells {
    let cells = join_thin(surface, cells);
    split_many_cornered(surface, cells)
}

/// A typical side of a cell, in the size of the cells at each place.
pub(crate) fn typical_side(surface: &Surface<'_>, cells: &Cells) -> f64 {
    let area: f64 = (0..surface.count()).map(|t| surface.relative_area(t)).sum();
    (area / cells.count().max(1) as f64).sqrt()
}

/// The cells of these labels, if they are all sound.
fn if_sound(surface: &Surface<'_>, labels: &[u32]) -> Option<Cells> {
    let (labels, count) = relabelled(surface, labels);
    let outlines = Outlines::new(surface, &labels, count, &[]);
    outlines.sound().then_some(Cells { labels, outlines })
}

/// Corners above the most, over all cells.
fn excess(polygons: &Polygons) -> usize {
    let corners = (0..index(polygons.sides.len())).map(|c| polygons.corners(c));
    corners.map(|k| k.saturating_sub(MOST_CORNERS)).sum()
}

/// The first triangle of each cell, by which it is known again.
fn firsts(cells: &Cells) -> Vec<u32> {
    let mut first = vec![NONE; cells.count()];
    for (t, &label) in cells.labels.iter().enumerate().rev() {
        first[label as usize] = index(t);
    }
    first
}

fn join_thin(surface: &Surface<'_>, mut cells: Cells) -> Cells {
    let least = THIN * typical_side(surface, &cells);
    let mut tried: Vec<u32> = Vec::new();
    for _ in 0..ATTEMPTS {
        let polygons = Polygons::new(surface, &cells);
        let first = firsts(&cells);
        let widths = widths(surface, &cells, &polygons);
        let thinnest = (0..cells.count())
            .filter(|&c| widths[c] < least && !tried.contains(&first[c]))
            .min_by(|&a, &b| widths[a].total_cmp(&widths[b]).then(a.cmp(&b)));
        let Some(cell) = thinnest else { break };
        tried.push(first[cell]);
        let before = excess(&polygons);
        let joined = neighbours(&polygons, cell).into_iter().find_map(|other| {
            let labels: Vec<u32> = cells
                .labels
                .iter()
                .map(|&l| if l as usize == cell { other } else { l })
                .collect();
            let joined = if_sound(surface, &labels)?;
            let after = excess(&Polygons::new(surface, &joined));
            (after <= before + 1).then_some(joined)
        });
        cells = joined.unwrap_or(cells);
    }
    cells
}

/// The width of each cell: its area over its longest side.
fn widths(surface: &Surface<'_>, cells: &Cells, polygons: &Polygons) -> Vec<f64> {
    let mut widths = vec![0.0; cells.count()];
    for (t, &label) in cells.labels.iter().enumerate() {
        widths[label as usize] += surface.relative_area(t);
    }
    for (width, sides) in widths.iter_mut().zip(&polygons.sides) {
        let lengths = sides.iter().map(|(a, _)| polygons.arcs[*a as usize].length);
        *width /= lengths.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    }
    widths
}

/// The cells that share most length of smooth arcs with a cell.
fn neighbours(polygons: &Polygons, cell: usize) -> Vec<u32> {
    let mut shared: Vec<(u32, f64)> = Vec::new();
    for &(arc, _) in &polygons.sides[cell] {
        let arc = &polygons.arcs[arc as usize];
        if arc.kind != EdgeKind::Smooth {
            continue;
        }
        let other = arc.cells[usize::from(arc.cells[0] as usize == cell)];
        match shared.iter_mut().find(|s| s.0 == other) {
            Some(s) => s.1 += arc.length,
            None => shared.push((other, arc.length)),
        }
    }
    shared.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shared.into_iter().take(OFFERS).map(|s| s.0).collect()
}

fn split_many_cornered(surface: &Surface<'_>, mut cells: Cells) -> Cells {
    let mut grower = Grower::new(surface.count());
    let mut tried: Vec<u32> = Vec::new();
    for _ in 0..ATTEMPTS {
        let mut polygons = Polygons::new(surface, &cells);
        collapse::by_score(&mut polygons, typical_side(surface, &cells));
        let first = firsts(&cells);
        let many = (0..cells.count())
            .find(|&c| polygons.corners(index(c)) > MOST_CORNERS && !tried.contains(&first[c]));
        let Some(cell) = many else { break };
        tried.push(first[cell]);
        let members: Vec<u32> = (0..index(cells.labels.len()))
            .filter(|&t| cells.labels[t as usize] as usize == cell)
            .collect();
        let mut labels = cells.labels.clone();
        split(
            surface,
            &mut labels,
            &members,
            index(cells.count()),
            &mut grower,
        );
        smooth(surface, &mut labels, SMOOTHINGS);
        cells = if_sound(surface, &labels).unwrap_or(cells);
    }
    cells
}
