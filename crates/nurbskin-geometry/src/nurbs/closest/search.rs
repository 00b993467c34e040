//! One search: best foot so far, what is proven, and what is done with a piece.

use super::curves::OnCurve;
use super::evaluate::Jet;
use super::piece::{Piece, Pieces};
use super::quadric::Quadric;
use super::trim::Part;
use crate::spatial::hierarchy::limit;
use glam::{DVec2, DVec3};

/// Smallest eigenvalue, in whitened parameters (where the metric is about 1), from which the convexity of the squared
/// distance on a piece is used.
const LEAST_CONVEXITY: f64 = 0.02;
/// Steps of Newton's method before a piece is cut instead.
const MOST_STEPS: usize = 16;

/// The state of a search for the foot of one point.
#[derive(Debug)]
pub(super) struct Search<'a> {
    pub(super) point: DVec3,
    /// The piece being visited, by its number in the whole surface.
    pub(super) current: usize,
    /// Squared distance of the best foot.
    pub(super) best: f64,
    /// Its piece (`usize::MAX` for none) and place there.
    pub(super) piece: usize,
    pub(super) place: DVec2,
    /// Tangents at the best foot, in the frame of its piece.
    pub(super) tangents: [DVec3; 2],
    /// The best foot, where it is on the border of the part of the surface that counts.
    pub(super) border: Option<OnCurve>,
    /// Whether the border has been searched.
    pub(super) bordered: bool,
    /// What counts of the piece being visited, where that is not all of it.
    pub(super) part: Option<&'a dyn Part>,
    /// Whether the surface has creases between its pieces.
    pub(super) creased: bool,
    /// How far the border curves may be from the border.
    pub(super) gap: f64,
    /// Every piece dropped so far is at least this far, squared, or farther than `best`.
    pub(super) proven: f64,
    /// What the bracket may be wide.
    pub(super) tolerance: f64,
    /// Squared distance in single precision from which a box can be dropped, and what is added for rounding.
    pub(super) limit: f32,
    pub(super) slack: f64,
    /// Nodes that may still be cut.
    pub(super) budget: usize,
}

impl Search<'_> {
    pub(super) fn new(
        point: DVec3,
        radius: f64,
        tolerance: f64,
        slack: f64,
        budget: usize,
    ) -> Self {
        let mut this = Self {
            point,
            current: usize::MAX,
            best: radius * radius,
            piece: usize::MAX,
            place: DVec2::ZERO,
            tangents: [DVec3::ZERO; 2],
            border: None,
            bordered: false,
            part: None,
            creased: false,
            gap: 0.0,
            proven: f64::INFINITY,
            tolerance,
            limit: f32::INFINITY,
            slack,
            budget,
        };
        this.set_limit();
        this
    }

    pub(super) fn set_limit(&mut self) {
        self.limit = limit(self.best, self.slack);
    }

    /// Whether the part that counts covers a place of a piece.
    #[inline]
    pub(super) fn covers(&self, pieces: &Pieces, id: usize, x: f64, y: f64) -> bool {
        let covers = |part: &dyn Part| part.contains(pieces.all[id].parameters(x, y));
        self.part.is_none_or(covers)
    }

    /// A foot on the current piece; kept if it is the best, and covered.
    #[inline]
    pub(super) fn offer(
        &mut self,
        pieces: &Pieces,
        id: usize,
        squared: f64,
        x: f64,
        y: f64,
        jet: &Jet,
    ) {
        if squared < self.best && self.covers(pieces, id, x, y) {
            self.best = squared;
            self.piece = self.current;
            self.place = DVec2::new(x, y);
            self.tangents = [jet.sx, jet.sy];
            self.border = None;
            self.set_limit();
        }
    }

    /// Squared distance beyond which nothing more needs to be known: a tolerance below the best.
    #[inline]
    pub(super) fn enough(&self) -> f64 {
        self.below(self.best)
    }

    /// A tolerance below a squared distance, squared.
    #[inline]
    pub(super) fn below(&self, squared: f64) -> f64 {
        let reach = squared.sqrt() - self.tolerance;
        if reach > 0.0 { reach * reach } else { 0.0 }
    }

    /// Proves that the piece has no point nearer than the best less the tolerance, improving the best on the way.
    #[inline]
    pub(super) fn visit(&mut self, pieces: &Pieces, quadric: &mut Quadric, id: usize) {
        let piece = &pieces.all[id];
        let p = piece.to_frame(self.point);
        let outside = (piece.low - p).max(p - piece.high).max(DVec3::ZERO);
        if outside.length_squared() >= self.best {
            return;
        }
        let convexity = piece.convexity(p);
        if convexity > LEAST_CONVEXITY {
            let start = from_middle(piece, p);
            if self.descend(pieces, id, p, convexity, start) {
                return;
            }
        }
        quadric.search(self, pieces, id, p);
    }

    /// As [`Search::visit`] for a piece on which the squared distance may be convex, from a known start; true if the piece
    /// is done with.
    pub(super) fn visit_from(&mut self, pieces: &Pieces, id: usize, start: DVec2) -> bool {
        let piece = &pieces.all[id];
        let p = piece.to_frame(self.point);
        let convexity = piece.convexity(p);
        if convexity > LEAST_CONVEXITY && self.descend(pieces, id, p, convexity, start) {
            return true;
        }
        let whole = [-1.0, 1.0, -1.0, 1.0];
        let low = minimize(pieces, id, p, whole, start, MOST_STEPS);
        self.offer(pieces, id, low.squared, low.x, low.y, &low.jet);
        false
    }

    /// Newton's method on a piece where half the squared distance has eigenvalues of `convexity` at least. As it is
    /// convex on a rectangle, every step gives a lower bound over the whole piece: for the gradient g, less its parts
    /// that press against the border of the rectangle, `|p - S|^2 >= |e|^2 - |g|^2 / convexity`.
    #[inline]
    fn descend(
        &mut self,
        pieces: &Pieces,
        id: usize,
        p: DVec3,
        convexity: f64,
        start: DVec2,
    ) -> bool {
        let Some(tube) = pieces.all[id].tube else {
            return false;
        };
        let (mut x, mut y) = (start.x, start.y);
        let mut last = (f64::INFINITY, x, y);
        for _ in 0..MOST_STEPS {
            let jet = pieces.jet(id, x, y);
            let e = jet.s - p;
            let squared = e.length_squared();
            if squared > last.0 * (1.0 + 1e-12) {
                // Overshot: back half of the way.
                (x, y) = (0.5 * (x + last.1), 0.5 * (y + last.2));
                continue;
            }
            last = (squared, x, y);
            let (gx, gy) = (e.dot(jet.sx), e.dot(jet.sy));
            let rx = if pressed(x, gx) { 0.0 } else { gx };
            let ry = if pressed(y, gy) { 0.0 } else { gy };
            let low = squared - tube.gradient_squared(rx, ry) / convexity;
            if low >= self.best {
                return true;
            }
            let (nx, ny) = box_step(
                [x, y],
                [gx, gy],
                [
                    jet.sx.length_squared() + e.dot(jet.sxx),
                    jet.sx.dot(jet.sy) + e.dot(jet.sxy),
                    jet.sy.length_squared() + e.dot(jet.syy),
                ],
                [-1.0, 1.0, -1.0, 1.0],
            );
            self.offer(pieces, id, squared, x, y, &jet);
            if squared < self.best && low >= self.below(squared) {
                // The minimum is not covered: the border is nearer than what is.
                return true;
            }
            if low >= self.enough() {
                // The step is known, the last bit of accuracy costs only a point.
                if squared <= self.best && (rx != 0.0 || ry != 0.0) {
                    let polished = (pieces.point(id, nx, ny) - p).length_squared();
                    self.offer(pieces, id, polished, nx, ny, &jet);
                }
                self.proven = self.proven.min(low);
                return true;
            }
            (x, y) = (nx, ny);
        }
        false
    }
}

/// Whether the gradient presses against the border at this coordinate.
#[inline]
fn pressed(x: f64, gradient: f64) -> bool {
    (x <= -1.0 && gradient >= 0.0) || (x >= 1.0 && gradient <= 0.0)
}

/// A Newton step from the middle of a piece, whose derivatives are known.
#[inline]
fn from_middle(piece: &Piece, p: DVec3) -> DVec2 {
    let [sx, sy, sxx, sxy, syy] = piece.middle;
    let (x, y) = box_step(
        [0.0, 0.0],
        [-p.dot(sx), -p.dot(sy)],
        [
            sx.length_squared() - p.dot(sxx),
            sx.dot(sy) - p.dot(sxy),
            sy.length_squared() - p.dot(syy),
        ],
        [-1.0, 1.0, -1.0, 1.0],
    );
    DVec2::new(x, y)
}

/// The minimum over a rectangle `[x0, x1, y0, y1]` of the quadratic model with this gradient and Hessian
/// `[xx, xy, yy]`; where the Hessian is not positive, a step down its diagonal.
#[inline]
fn box_step(
    [x, y]: [f64; 2],
    [gx, gy]: [f64; 2],
    [hxx, hxy, hyy]: [f64; 3],
    [x0, x1, y0, y1]: [f64; 4],
) -> (f64, f64) {
    let determinant = hxx * hyy - hxy * hxy;
    if !(hxx > 0.0 && determinant > 1e-14 * hxx * hyy) {
        let along = |x: f64, g: f64, h: f64, low: f64, high: f64| {
            if h > 0.0 {
                (x - g / h).clamp(low, high)
            } else if g > 0.0 {
                low
            } else if g < 0.0 {
                high
            } else {
                x
            }
        };
        return (along(x, gx, hxx, x0, x1), along(y, gy, hyy, y0, y1));
    }
    let r = 1.0 / determinant;
    let nx = x - (hyy * gx - hxy * gy) * r;
    let ny = y - (hxx * gy - hxy * gx) * r;
    let (cx, cy) = (nx.clamp(x0, x1), ny.clamp(y0, y1));
    let (out_x, out_y) = (!(x0..=x1).contains(&nx), !(y0..=y1).contains(&ny));
    if !out_x && !out_y {
        return (nx, ny);
    }
    // The minimum lies on a border that the free minimum is beyond: clamp one, minimize along it.
    let on_x = (cx, (y - (gy + hxy * (cx - x)) / hyy).clamp(y0, y1));
    let on_y = ((x - (gx + hxy * (cy - y)) / hxx).clamp(x0, x1), cy);
    let model = |(a, b): (f64, f64)| {
        let (dx, dy) = (a - x, b - y);
        gx * dx + gy * dy + 0.5 * (hxx * dx * dx + hyy * dy * dy) + hxy * dx * dy
    };
    if !out_y || (out_x && model(on_x) <= model(on_y)) {
        on_x
    } else {
        on_y
    }
}

/// A place on a piece, its jet there and the squared distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) jet: Jet,
    pub(super) squared: f64,
}

/// A local minimum of the distance over a rectangle of a piece, by damped Newton steps, Gauss-Newton where the Hessian
/// is not positive; never farther than the start.
pub(super) fn minimize(
    pieces: &Pieces,
    id: usize,
    p: DVec3,
    within: [f64; 4],
    start: DVec2,
    steps: usize,
) -> Place {
    let at = |x: f64, y: f64| {
        let jet = pieces.jet(id, x, y);
        let squared = (jet.s - p).length_squared();
        Place { x, y, jet, squared }
    };
    let mut best = at(start.x, start.y);
    for _ in 0..steps {
        let Place { x, y, jet, .. } = best;
        let e = jet.s - p;
        let (gx, gy) = (e.dot(jet.sx), e.dot(jet.sy));
        let (a, b, c) = (
            jet.sx.length_squared(),
            jet.sx.dot(jet.sy),
            jet.sy.length_squared(),
        );
        let (hxx, hxy, hyy) = (a + e.dot(jet.sxx), b + e.dot(jet.sxy), c + e.dot(jet.syy));
        let positive = hxx > 0.0 && hxx * hyy - hxy * hxy > 1e-6 * (a * c).abs();
        let hessian = if positive { [hxx, hxy, hyy] } else { [a, b, c] };
        let (mut nx, mut ny) = box_step([x, y], [gx, gy], hessian, within);
        let mut next = None;
        for _ in 0..8 {
            if (nx - x).abs() + (ny - y).abs() <= 0.0 {
                break;
            }
            let there = at(nx, ny);
            if there.squared < best.squared {
                next = Some(there);
                break;
            }
            (nx, ny) = (x + 0.25 * (nx - x), y + 0.25 * (ny - y));
        }
        let Some(next) = next else { break };
        let gain = best.squared - next.squared;
        best = next;
        if gain <= 1e-15 * best.squared {
            break;
        }
    }
    best
}
