//! Stretch of a chart: how much it stretches the domain onto the surface.
//!
//! For a triangle with the singular values Γ and γ of the map from the domain, drawn to scale, to the surface:
//!
//! ```text
//! s² = (Γ² + γ²) / 2        whole² = sum A s² / sum A        mean = sum A s / sum A
//! ```
//!
//! Source: the L2 stretch of P. Sander, J. Snyder, S. Gortler and H. Hoppe 2001, DOI 10.1145/383259.383307; bounded
//! where triangles vanish in the domain.

use super::layout::{Piece, Surface};

/// Largest factor by which the stretch of a vertex or a triangle differs from the usual one. Guard: triangles that
/// vanish in the domain have infinite stretch.
const MAX_STRETCH_RATIO: f64 = 50.0;

/// Stretch of a layout: root mean square of the singular values of the map from the domain, drawn to scale, to the
/// surface.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// At each vertex, relative to the whole.
    pub(super) at: Vec<f64>,
    /// Root mean square over the surface, 1 for an isometry.
    pub(super) whole: f64,
    /// Mean over the surface: unlike the root mean square, it is not ruled by a narrow pocket with hardly any area.
    pub(super) mean: f64,
    /// At the worst triangle; 1 for an isometry.
    pub(super) worst: f64,
}

impl Stretch {
    /// The stretch with the domain drawn `size` large, then scaled to the area of the surface.
    ///
    /// Source: the L2 stretch of Sander et al. 2001, DOI 10.1145/383259.383307, bounded where triangles vanish.
    pub(super) fn measure(surface: &Surface<'_>, pieces: &[Piece], size: [f64; 2]) -> Self {
        let mut areas = [0.0, 0.0];
        let parts: Vec<(f64, f64)> = (pieces.iter().enumerate())
            .map(|(t, &Piece { du, dv, twice, .. })| {
                let p = surface.corners(t);
                let area = 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).length();
                areas[0] += area;
                areas[1] += 0.5 * twice.max(0.0) * size[0] * size[1];
                let squared = 0.5
                    * (du.length_squared() / (size[0] * size[0])
                        + dv.length_squared() / (size[1] * size[1]));
                let square = if twice > 0.0 {
                    squared / (twice * twice)
                } else {
                    f64::INFINITY
                };
                (area, square)
            })
            .collect();
        let usual = areas[0] / areas[1].max(f64::MIN_POSITIVE);
        let mut sums = vec![(0.0, 0.0); surface.points.len()];
        let (mut whole, mut mean, mut worst) = (0.0, 0.0, 0.0_f64);
        for (t, (area, square)) in surface.triangles.iter().zip(&parts) {
            let square = (square / usual).clamp(0.0, MAX_STRETCH_RATIO * MAX_STRETCH_RATIO);
            worst = worst.max(square);
            whole += area * square;
            mean += area * square.sqrt();
            for &k in t {
                sums[k as usize].0 += area * square;
                sums[k as usize].1 += area;
            }
        }
        let whole = (whole / areas[0].max(f64::MIN_POSITIVE)).sqrt();
        Self {
            at: sums
                .iter()
                .map(|&(sum, area)| {
                    let own = if area > 0.0 {
                        (sum / area).sqrt()
                    } else {
                        whole
                    };
                    (own / whole.max(f64::MIN_POSITIVE))
                        .clamp(1.0 / MAX_STRETCH_RATIO, MAX_STRETCH_RATIO)
                })
                .collect(),
            whole,
            mean: mean / areas[0].max(f64::MIN_POSITIVE),
            worst: worst.sqrt(),
        }
    }
}
