//! Fairness: the thin-plate energy of a spline surface, per cell of its knots.
//!
//! `E(S) = int |S_ss|^2 + 2 |S_st|^2 + |S_tt|^2`, averaged over the domain, with `s = u L_u` and `t = v L_v` in the
//! unit of the scan: a mean squared second derivative with respect to lengths on the surface. In a cell the integrand
//! is a sum of products of one integral along u and one along v, which Gauss quadrature gives exactly.
//!
//! Source: the thin-plate functional of bending; Gauss-Legendre rules (NIST DLMF 3.5).

use super::spline_space::filled_spans;
use nurbskin_geometry::numeric::quadrature::gauss_legendre;
use nurbskin_geometry::nurbs::KnotVector;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Multiple of the root mean square error that noise leaves in any surface, of which fairness may cost its share.
/// Dimensionless.
/// Trial: not recorded. With a share of 0.02 the bias is at most a thirtieth of that error.
const NOISE_ERROR_MULTIPLE: f64 = 3.0;

/// The reach of fairness for points with noise `sigma`: three times the root mean square error `sigma sqrt(N / M)` that
/// noise leaves in N unknowns from M points in any case. The bias of `lambda = (share reach)^2 / E(S)` is at most half
/// of `sqrt(lambda E(S))`, since the fit with it has no larger objective than S itself: with a share of 0.02, a
/// thirtieth of the error that noise leaves.
pub(crate) fn noise_reach(sigma: f64, unknowns: usize, points: usize) -> f64 {
    NOISE_ERROR_MULTIPLE * sigma * (unknowns as f64 / points.max(1) as f64).sqrt()
}

/// Integrals of products of derivatives of the basis functions over each span of one direction.
///
/// Products are symmetric and stored once: the pair (i, k), i <= k, of the p + 1 local functions comes i-th row first.
#[derive(Clone, Debug)]
struct Grams {
    /// `spans[s][d]`: the integrals of the d-th derivatives over span s.
    spans: Vec<[Vec<f64>; 4]>,
}

impl Grams {
    fn new(knots: &KnotVector) -> Self {
        let p = knots.degree();
        let rule = gauss_legendre(p + 1);
        let pairs = (p + 1) * (p + 2) / 2;
        let mut ders = vec![0.0; 4 * (p + 1)];
        let spans = filled_spans(knots)
            .into_iter()
            .map(|(first, w)| {
                let mut gram = [0; 4].map(|_| vec![0.0; pairs]);
                let half = 0.5 * (w[1] - w[0]);
                for &(x, weight) in &rule {
                    basis_derivatives(knots, first + p, w[0] + half * (1.0 + x), 3, &mut ders);
                    for (gram, b) in gram.iter_mut().zip(ders.chunks(p + 1)) {
                        let mut at = 0;
                        for i in 0..=p {
                            for k in i..=p {
                                gram[at] += weight * half * b[i] * b[k];
                                at += 1;
                            }
                        }
                    }
                }
                gram
            })
            .collect();
        Self { spans }
    }
}

/// The energies of the surfaces on given knots, cell by cell: of a thin plate (second derivatives), and of a membrane
/// (`|S_s|^2 + |S_t|^2`), which calms cells without points.
#[derive(Clone, Debug)]
pub(super) struct Energies {
    grams: [Grams; 2],
    /// L_u^-4, 2 L_u^-2 L_v^-2, L_v^-4, for lengths per unit of the parameters and an average over the domain.
    plate: [f64; 3],
    /// L_u^-2, L_v^-2, likewise.
    membrane: [f64; 2],
    /// L_u^-6, 3 L_u^-4 L_v^-2, 3 L_u^-2 L_v^-4, L_v^-6, likewise.
    jerk: [f64; 4],
}

impl Energies {
    /// For a domain that stands for `size[0]` x `size[1]` lengths.
    pub(super) fn new(knots: &[KnotVector; 2], size: [f64; 2]) -> Self {
        let widths = knots.each_ref().map(|k| k.domain().1 - k.domain().0);
        let [a, b] = [0, 1].map(|d| widths[d] * widths[d] / (size[d] * size[d]));
        let area = widths[0] * widths[1];
        Self {
            grams: knots.each_ref().map(Grams::new),
            plate: [a * a, 2.0 * a * b, b * b].map(|x| x / area),
            membrane: [a, b].map(|x| x / area),
            jerk: [a * a * a, 3.0 * a * a * b, 3.0 * a * b * b, b * b * b].map(|x| x / area),
        }
    }
    /// Adds `plate` times the thin-plate energy and `membrane` times the membrane energy of cell (a, b) to a block over
    /// pairs of local functions, u pairs slowest.
    pub(super) fn add_cell(
        &self,
        a: usize,
        b: usize,
        plate: f64,
        membrane: f64,
        block: &mut [f64],
    ) {
        let [u0, u1, u2, _] = &self.grams[0].spans[a];
        let [v0, v1, v2, _] = &self.grams[1].spans[b];
        let [p0, p1, p2] = self.plate.map(|s| plate * s);
        let [m0, m1] = self.membrane.map(|s| membrane * s);
        for (k, row) in block.chunks_mut(v0.len()).enumerate() {
            let (c0, c1, c2) = (p0 * u2[k] + m0 * u1[k], p1 * u1[k] + m1 * u0[k], p2 * u0[k]);
            for (l, target) in row.iter_mut().enumerate() {
                *target += c0 * v0[l] + c1 * v1[l] + c2 * v2[l];
            }
        }
    }
}

impl Energies {
    /// Adds the energy `j0 |S_sss|^2 + 3 j1 |S_sst|^2 + 3 j2 |S_stt|^2 + j3 |S_ttt|^2` of the third derivatives in cell
    /// (a, b) to a block as in [`Self::add_cell`].
    pub(super) fn add_jerk(&self, a: usize, b: usize, jerk: [f64; 4], block: &mut [f64]) {
        let [u0, u1, u2, u3] = &self.grams[0].spans[a];
        let [v0, v1, v2, v3] = &self.grams[1].spans[b];
        let [j0, j1, j2, j3] = std::array::from_fn(|k| self.jerk[k] * jerk[k]);
        for (k, row) in block.chunks_mut(v0.len()).enumerate() {
            let (c0, c1, c2, c3) = (j0 * u3[k], j1 * u2[k], j2 * u1[k], j3 * u0[k]);
            for (l, target) in row.iter_mut().enumerate() {
                *target += c0 * v0[l] + c1 * v1[l] + c2 * v2[l] + c3 * v3[l];
            }
        }
    }
}

/// Value of a cell's quadratic form over pairs (as in [`Energies::add_cell`]) for the local control points `local`,
/// p + 1 along u (fastest) and q + 1 along v.
pub(super) fn quadratic_form(
    block: &[f64],
    local: &[nurbskin_geometry::DVec3],
    p: usize,
    q: usize,
) -> f64 {
    let mut sum = 0.0;
    let mut entries = block.iter();
    for i in 0..=p {
        for k in i..=p {
            for j in 0..=q {
                for l in j..=q {
                    let Some(&entry) = entries.next() else {
                        return sum;
                    };
                    let at = |i: usize, j: usize| local[j * (p + 1) + i];
                    // Each unordered pair of pairs stands for up to four products.
                    let mut product = at(i, j).dot(at(k, l));
                    if i != k && j != l {
                        product += at(i, l).dot(at(k, j));
                    }
                    if i != k || j != l {
                        product *= 2.0;
                    }
                    sum += entry * product;
                }
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::spline_space::SplineSpace;
    use super::*;
    use crate::chart::Topology;
    use nurbskin_geometry::DVec3;

    #[test]
    fn energy_of_a_known_surface() {
        // S = (s, t, s^2 + s t + t^2) on 2 x 3: S_ss = S_tt = 2, S_st = 1, mean energy 4 + 2 + 4.
        let breaks = [vec![0.0, 0.3, 1.0], vec![0.0, 0.5, 0.6, 1.0]];
        let space = SplineSpace::new([3, 2], breaks, Topology::Disk).unwrap();
        let plate = Energies::new(&space.knots, [2.0, 3.0]);
        let (gu, gv) = (space.knots[0].greville(), space.knots[1].greville());
        // Blossoms of s, s^2 at the knots give the control points exactly.
        let blossom = |knots: &KnotVector, i: usize| {
            let (p, k) = (knots.degree(), &knots.knots()[i + 1..]);
            let mut sum = 0.0;
            for a in 0..p {
                for b in 0..a {
                    sum += k[a] * k[b];
                }
            }
            sum * 2.0 / (p * (p - 1)) as f64
        };
        let net: Vec<DVec3> = (0..gv.len())
            .flat_map(|j| (0..gu.len()).map(move |i| (i, j)))
            .map(|(i, j)| {
                let (s, t) = (2.0 * gu[i], 3.0 * gv[j]);
                let (s2, t2) = (
                    4.0 * blossom(&space.knots[0], i),
                    9.0 * blossom(&space.knots[1], j),
                );
                DVec3::new(s, t, s2 + s * t + t2)
            })
            .collect();
        let mut energy = 0.0;
        for a in 0..2 {
            for b in 0..3 {
                let mut block = vec![0.0; 60];
                plate.add_cell(a, b, 1.0, 0.0, &mut block);
                let local: Vec<DVec3> = (0..12)
                    .map(|k| net[(b + k / 4) * gu.len() + a + k % 4])
                    .collect();
                energy += quadratic_form(&block, &local, 3, 2);
            }
        }
        assert!((energy - 10.0).abs() < 1e-11, "{energy}");
    }

    #[test]
    fn third_derivatives_of_a_cubic() {
        // S = (s, t, s^3 + s^2 t) on 2 x 3 as one Bezier patch: S_sss = 6, S_sst = 2, energy 36 + 2 * 3 * 4.
        let breaks = [vec![0.0, 1.0], vec![0.0, 1.0]];
        let space = SplineSpace::new([3, 3], breaks, Topology::Disk).unwrap();
        let energies = Energies::new(&space.knots, [2.0, 3.0]);
        let net: Vec<DVec3> = (0..16)
            .map(|k| {
                let (i, j) = ((k % 4) as f64, (k / 4) as f64);
                // Blossoms of s, s^2, s^3 and t at i ones and 3 - i zeros, times lengths.
                let (s, t) = (2.0 * i / 3.0, j);
                let s2 = 4.0 * i * (i - 1.0) / 6.0;
                let s3 = if k % 4 == 3 { 8.0 } else { 0.0 };
                DVec3::new(s, t, s3 + s2 * t)
            })
            .collect();
        let mut block = vec![0.0; 100];
        energies.add_jerk(0, 0, [1.0, 2.0, 5.0, 5.0], &mut block);
        let energy = quadratic_form(&block, &net, 3, 3);
        assert!((energy - 60.0).abs() < 1e-10, "{energy}");
    }
}
