//! The pieces of a surface: Bezier patches, cut until each is nearly flat, each in a frame of its own.

use super::evaluate::{Jet, Powers, cubic_jet, cubic_point, general_jet, to_powers};
use super::extract::{bezier_net, grid, spans};
use super::interval::{Interval, Vector, hull};
use crate::nurbs::NurbsSurface;
use glam::{DVec2, DVec3, DVec4};

/// Most parts that a Bezier patch is cut into along one direction when a surface has few patches.
const MOST_PARTS: usize = 16;
/// Pieces that a surface may always have; beyond that at most four per Bezier patch, and never more than 2^17 (190 MB).
const ALWAYS_PIECES: usize = 4096;
const MOST_PIECES: usize = 1 << 17;

/// What the search knows of one piece, the image of `x, y` in `[-1, 1]`, in its own frame: the origin is its middle,
/// the first axis its x tangent there, the third its normal.
#[derive(Clone, Debug, Default)]
pub(super) struct Piece {
    pub(super) origin: DVec3,
    pub(super) axes: [DVec3; 3],
    /// Box in the frame.
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    /// First and second derivatives in the middle, in the frame.
    pub(super) middle: [DVec3; 5],
    /// Where it is regular: bounds that show the squared distance to be convex on it.
    pub(super) tube: Option<Tube>,
    /// `[u_0, u_1, v_0, v_1]`.
    pub(super) domain: [f64; 4],
}

/// Bounds over a piece in *whitened* parameters, in which the metric in the middle is the identity. With `e = p - S` the
/// Hessian of half the squared distance is `J^T J - e . S_ij`; its smallest eigenvalue is at least
/// `metric - max(e_z bend) - |e_xy| drift`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    /// Lower bound of the eigenvalues of `J^T J`.
    metric: f64,
    /// Bounds of the eigenvalues of the second derivatives' normal component.
    bend: [f64; 2],
    /// Bound of the norm of the second derivatives' tangential component.
    drift: f64,
    /// Inverse Cholesky factor of the metric in the middle: gradient to whitened gradient.
    pub(super) white: [f64; 3],
}

impl Tube {
    /// Squared norm of a gradient in whitened parameters.
    #[inline]
    pub(super) fn gradient_squared(&self, gx: f64, gy: f64) -> f64 {
        let [a, b, c] = self.white;
        let (p, q) = (a * gx, b * gx + c * gy);
        p * p + q * q
    }
}

impl Piece {
    /// The point in the frame.
    #[inline]
    pub(super) fn to_frame(&self, point: DVec3) -> DVec3 {
        let d = point - self.origin;
        DVec3::new(
            self.axes[0].dot(d),
            self.axes[1].dot(d),
            self.axes[2].dot(d),
        )
    }
    /// A vector of the frame in space.
    #[inline]
    pub(super) fn vector(&self, local: DVec3) -> DVec3 {
        self.axes[0] * local.x + self.axes[1] * local.y + self.axes[2] * local.z
    }
    /// A lower bound, in whitened parameters and over the whole piece, of the eigenvalues of the Hessian of half the
    /// squared distance to `p` (in the frame); not positive where nothing is known.
    #[inline]
    pub(super) fn convexity(&self, p: DVec3) -> f64 {
        let Some(tube) = &self.tube else { return 0.0 };
        let bent = |e: f64| e * if e >= 0.0 { tube.bend[1] } else { tube.bend[0] };
        let (a, b) = (bent(p.z - self.high.z), bent(p.z - self.low.z));
        let far = |p: f64, low: f64, high: f64| (p - low).abs().max((p - high).abs());
        let x = far(p.x, self.low.x, self.high.x);
        let y = far(p.y, self.low.y, self.high.y);
        tube.metric - a.max(b) - tube.drift * (x * x + y * y).sqrt()
    }
    /// Surface parameters of (x, y); exact at the ends.
    pub(super) fn parameters(&self, x: f64, y: f64) -> DVec2 {
        let [a, b, c, d] = self.domain;
        let along = |x: f64, a: f64, b: f64| {
            if x <= -1.0 {
                a
            } else if x >= 1.0 {
                b
            } else {
                (0.5 * ((1.0 - x) * a + (1.0 + x) * b)).clamp(a, b)
            }
        };
        DVec2::new(along(x, a, b), along(y, c, d))
    }
    /// (x, y) of surface parameters, brought into the piece.
    pub(super) fn local(&self, uv: DVec2) -> DVec2 {
        let [a, b, c, d] = self.domain;
        let along = |u: f64, a: f64, b: f64| ((u - a - (b - u)) / (b - a)).clamp(-1.0, 1.0);
        DVec2::new(along(uv.x, a, b), along(uv.y, c, d))
    }
}

/// Which pieces a Bezier patch was cut into: `parts[0] x parts[1]` from `first` on, x fastest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    first: usize,
    parts: [usize; 2],
}

/// All pieces of a surface with what evaluates them.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    pub(super) all: Vec<Piece>,
    pub(super) degree: [usize; 2],
    pub(super) rational: bool,
    /// Homogeneous Bezier nets in the frames, u fastest; weights near 1.
    pub(super) nets: Vec<DVec4>,
    /// The same as powers where both degrees are 3 at most.
    pub(super) powers: Vec<Powers>,
    /// Boxes along the axes of space.
    pub(super) boxes: Vec<[DVec3; 2]>,
    pub(super) breaks: [Vec<f64>; 2],
    pub(super) patches: Vec<Patch>,
}

impl Pieces {
    pub(super) fn new(surface: &NurbsSurface) -> Self {
        let [u, v] = [spans(surface.knots_u()), spans(surface.knots_v())];
        let mut this = Self {
            degree: surface.degree(),
            rational: surface.is_rational(),
            breaks: [&u, &v].map(|s| s.iter().map(|s| s.ends.0).collect()),
            ..Self::default()
        };
        let patches = u.len() * v.len();
        for (j, sv) in v.iter().enumerate() {
            for (i, su) in u.iter().enumerate() {
                let net = bezier_net(surface, su, sv);
                let domain = [su.ends.0, su.ends.1, sv.ends.0, sv.ends.1];
                let remaining = patches - (j * u.len() + i);
                let most = ALWAYS_PIECES
                    .max((4 * patches).min(MOST_PIECES))
                    .saturating_sub(this.all.len());
                this.cut(&net, domain, most / remaining);
            }
        }
        this
    }

    /// Cuts a patch until its parts are nearly flat, into `most` pieces at most.
    fn cut(&mut self, net: &[DVec4], domain: [f64; 4], most: usize) {
        let mut parts = [1, 1];
        loop {
            let mut bad = [0usize; 2];
            let made: Vec<_> = grid(net, self.degree, domain, parts)
                .into_iter()
                .map(|(net, domain)| {
                    let (piece, net, boxed, flat) = make(&net, self.degree, domain, self.rational);
                    if let Some(direction) = flat {
                        bad[direction] += 1;
                    }
                    (piece, net, boxed)
                })
                .collect();
            let direction = usize::from(bad[1] > bad[0]);
            let next = 2 * parts[0] * parts[1];
            if bad == [0, 0] || next > most || parts[direction] >= MOST_PARTS {
                self.patches.push(Patch {
                    first: self.all.len(),
                    parts,
                });
                for (piece, net, boxed) in made {
                    if self.degree[0] <= 3 && self.degree[1] <= 3 {
                        self.powers.push(powers(&net, self.degree));
                    }
                    self.nets.extend(net);
                    self.boxes.push(boxed);
                    self.all.push(piece);
                }
                return;
            }
            parts[direction] *= 2;
        }
    }

    /// Number of control points of a piece.
    #[inline]
    pub(super) fn net_len(&self) -> usize {
        (self.degree[0] + 1) * (self.degree[1] + 1)
    }
    /// The homogeneous Bezier net of a piece.
    pub(super) fn net(&self, piece: usize) -> &[DVec4] {
        let n = self.net_len();
        &self.nets[piece * n..(piece + 1) * n]
    }
    /// The jet of a piece, in its frame.
    #[inline]
    pub(super) fn jet(&self, piece: usize, x: f64, y: f64) -> Jet {
        match self.powers.get(piece) {
            Some(powers) => cubic_jet(powers, self.rational, x, y),
            None => general_jet(self.net(piece), self.degree, x, y),
        }
    }
    /// The point of a piece, in its frame.
    #[inline]
    pub(super) fn point(&self, piece: usize, x: f64, y: f64) -> DVec3 {
        match self.powers.get(piece) {
            Some(powers) => cubic_point(powers, self.rational, x, y),
            None => general_jet(self.net(piece), self.degree, x, y).s,
        }
    }
    /// The piece that holds these parameters of the domain.
    pub(super) fn at(&self, uv: DVec2) -> usize {
        let find = |breaks: &[f64], u: f64| {
            breaks
                .partition_point(|&b| b <= u)
                .clamp(1, breaks.len().max(1))
                - 1
        };
        let (i, j) = (find(&self.breaks[0], uv.x), find(&self.breaks[1], uv.y));
        let index = j * self.breaks[0].len() + i;
        let Some(patch) = self.patches.get(index) else {
            return index;
        };
        let [a, _, c, _] = self.all[patch.first].domain;
        let last = &self.all[patch.first + patch.parts[0] * patch.parts[1] - 1];
        let [_, b, _, d] = last.domain;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to 0..parts"
        )]
        let part = |u: f64, a: f64, b: f64, n: usize| {
            (((u - a) / (b - a) * n as f64).max(0.0) as usize).min(n - 1)
        };
        patch.first
            + part(uv.y, c, d, patch.parts[1]) * patch.parts[0]
            + part(uv.x, a, b, patch.parts[0])
    }
}

/// The power form of a net with degrees of 3 at most.
pub(super) fn powers(net: &[DVec4], [p, q]: [usize; 2]) -> Powers {
    let rows: Vec<[DVec4; 4]> = net.chunks_exact(p + 1).map(to_powers).collect();
    let mut out = [[0.0; 4]; 16];
    for k in 0..4 {
        let column: Vec<DVec4> = rows.iter().take(q + 1).map(|row| row[k]).collect();
        for (j, c) in to_powers(&column).into_iter().enumerate() {
            out[4 * j + k] = c.to_array();
        }
    }
    out
}

/// One piece: the piece, its net in its frame, its box in space, and, where it is not nearly flat, the direction in
/// which it should be cut.
pub(super) fn make(
    net: &[DVec4],
    degree: [usize; 2],
    domain: [f64; 4],
    rational: bool,
) -> (Piece, Vec<DVec4>, [DVec3; 2], Option<usize>) {
    let boxed = hull(net.iter().map(|h| h.truncate() / h.w));
    let scale = net.iter().map(|h| h.w).sum::<f64>() / net.len() as f64;
    let middle = general_jet(net, degree, 0.0, 0.0);
    let (origin, axes) = frame(net, degree, &middle);
    let local: Vec<DVec4> = net
        .iter()
        .map(|h| {
            let w = if rational { h.w / scale } else { 1.0 };
            let d = h.truncate() / h.w - origin;
            (DVec3::new(axes[0].dot(d), axes[1].dot(d), axes[2].dot(d)) * w).extend(w)
        })
        .collect();
    let [low, high] = hull(local.iter().map(|h| h.truncate() / h.w));
    let middle = general_jet(&local, degree, 0.0, 0.0);
    let (tube, cut) = tube(&local, degree, &middle, [low, high], rational);
    let piece = Piece {
        origin,
        axes,
        low,
        high,
        middle: [middle.sx, middle.sy, middle.sxx, middle.sxy, middle.syy],
        tube,
        domain,
    };
    (piece, local, boxed, cut)
}

/// Origin and axes of a piece; where the middle is singular, axes from the net's corners.
fn frame(net: &[DVec4], [p, q]: [usize; 2], middle: &Jet) -> (DVec3, [DVec3; 3]) {
    let corner = |i: usize, j: usize| {
        let h = net[j * (p + 1) + i];
        h.truncate() / h.w
    };
    let along = corner(p, 0) - corner(0, 0) + corner(p, q) - corner(0, q);
    let across = corner(0, q) - corner(0, 0) + corner(p, q) - corner(p, 0);
    let x = [middle.sx, along, DVec3::X]
        .iter()
        .find_map(|d| d.try_normalize())
        .unwrap_or(DVec3::X);
    let y = [middle.sy, across, DVec3::Y, DVec3::Z]
        .iter()
        .find_map(|d| (d.try_normalize()? - x * x.dot(d.try_normalize()?)).try_normalize())
        .unwrap_or_else(|| x.any_orthonormal_vector());
    // Once more, so that the axes are orthogonal to rounding even where x and y were nearly parallel.
    let y = (y - x * x.dot(y)).normalize();
    (middle.s, [x, y, x.cross(y)])
}

/// The bounds of a piece, if it is regular; and the direction to cut in, if they are too weak.
fn tube(
    net: &[DVec4],
    [p, q]: [usize; 2],
    middle: &Jet,
    [low, high]: [DVec3; 2],
    rational: bool,
) -> (Option<Tube>, Option<usize>) {
    let [sx, sy, sxx, sxy, syy] = derivative_bounds(net, [p, q], [low, high], rational);
    // Cut where the tangent turns or changes most over the piece.
    let change = |first: DVec3, second: &Vector| second.norm() / first.length().max(1e-300);
    let direction = usize::from(change(middle.sy, &syy) > change(middle.sx, &sxx));
    let (e, f, g) = (
        middle.sx.length_squared(),
        middle.sx.dot(middle.sy),
        middle.sy.length_squared(),
    );
    let rest = g - f * f / e;
    if !(e > 0.0 && rest > 1e-8 * g) {
        return (None, Some(direction));
    }
    // L L^T = [e f; f g]; the inverse of L is [a 0; b c].
    let (a, c) = (1.0 / e.sqrt(), 1.0 / rest.sqrt());
    let b = -f / e * c;
    let t1 = sx.scale(a);
    let t2 = sx.scale(b).add(&sy.scale(c));
    let cross = t1.dot(&t2).magnitude();
    let metric = smallest(t1.smallest_square(), cross, t2.smallest_square());
    let t11 = sxx.scale(a * a);
    let t12 = sxx.scale(a * b).add(&sxy.scale(a * c));
    let t22 = sxx
        .scale(b * b)
        .add(&sxy.scale(2.0 * b * c))
        .add(&syy.scale(c * c));
    let [z11, z12, z22] = [t11.0[2], t12.0[2], t22.0[2]];
    let bend = [
        smallest(z11.low, z12.magnitude(), z22.low),
        -smallest(-z11.high, z12.magnitude(), -z22.high),
    ];
    let flat = |t: &Vector| t.0[0].magnitude().powi(2) + t.0[1].magnitude().powi(2);
    let drift = (flat(&t11) + 2.0 * flat(&t12) + flat(&t22)).sqrt();
    let size = high - low;
    let own = metric - drift * size.truncate().length() - size.z * bend[0].abs().max(bend[1].abs());
    let tube = Tube {
        metric,
        bend,
        drift,
        white: [a, b, c],
    };
    // With half of the metric left, points as far away as half the smallest radius of curvature are still certain.
    (Some(tube), (own < 0.5).then_some(direction))
}

/// The smallest eigenvalue of a symmetric matrix `[a b; b c]`; a lower bound where a and c are lower bounds and b
/// bounds the magnitude.
pub(super) fn smallest(a: f64, b: f64, c: f64) -> f64 {
    let half = 0.5 * (a - c);
    0.5 * (a + c) - (half * half + b * b).sqrt()
}

/// Boxes around `[Sx, Sy, Sxx, Sxy, Syy]` over a piece.
fn derivative_bounds(
    net: &[DVec4],
    [p, q]: [usize; 2],
    [low, high]: [DVec3; 2],
    rational: bool,
) -> [Vector; 5] {
    let at = |i: usize, j: usize| net[j * (p + 1) + i];
    let (fp, fq) = (0.5 * p as f64, 0.5 * q as f64);
    let bounds = |order: [usize; 2]| -> (Vector, Interval) {
        let [r, s] = order;
        if r > p || s > q {
            return (Vector::default(), Interval::default());
        }
        let factor = match order {
            [1, 0] => fp,
            [0, 1] => fq,
            [2, 0] => fp * (fp - 0.5),
            [0, 2] => fq * (fq - 0.5),
            _ => fp * fq,
        };
        let difference = |i: usize, j: usize| match order {
            [1, 0] => at(i + 1, j) - at(i, j),
            [0, 1] => at(i, j + 1) - at(i, j),
            [2, 0] => at(i + 2, j) - 2.0 * at(i + 1, j) + at(i, j),
            [0, 2] => at(i, j + 2) - 2.0 * at(i, j + 1) + at(i, j),
            _ => at(i + 1, j + 1) - at(i + 1, j) - at(i, j + 1) + at(i, j),
        };
        let mut corners = [DVec4::INFINITY, DVec4::NEG_INFINITY];
        for j in 0..=q - s {
            for i in 0..=p - r {
                let d = difference(i, j) * factor;
                corners = [corners[0].min(d), corners[1].max(d)];
            }
        }
        (
            Vector::new(corners[0].truncate(), corners[1].truncate()),
            Interval {
                low: corners[0].w,
                high: corners[1].w,
            },
        )
    };
    let [(x, wx), (y, wy), (xx, wxx), (xy, wxy), (yy, wyy)] =
        [[1, 0], [0, 1], [2, 0], [1, 1], [0, 2]].map(bounds);
    if !rational {
        return [x, y, xx, xy, yy];
    }
    // A4.4 in interval arithmetic.
    let (w_low, w_high) = net.iter().fold((f64::INFINITY, 0.0f64), |(a, b), h| {
        (a.min(h.w), b.max(h.w))
    });
    let inverse = Interval {
        low: 1.0 / w_high,
        high: 1.0 / w_low,
    };
    let s = Vector::new(low, high);
    let sx = x.sub(&s.times(wx)).times(inverse);
    let sy = y.sub(&s.times(wy)).times(inverse);
    let two = |w: Interval| w.scale(2.0);
    let sxx = xx.sub(&sx.times(two(wx))).sub(&s.times(wxx)).times(inverse);
    let sxy = xy
        .sub(&sy.times(wx))
        .sub(&sx.times(wy))
        .sub(&s.times(wxy))
        .times(inverse);
    let syy = yy.sub(&sy.times(two(wy))).sub(&s.times(wyy)).times(inverse);
    [sx, sy, sxx, sxy, syy]
}
