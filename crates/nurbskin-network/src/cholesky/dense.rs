//! Dense parts of the factorisation, column by column.
//!
//! Each entry is a sum in the order of the columns, product by product, so the width of the vectors does not change a
//! digit. The functions are compiled for the vectors of several processors; the best ones are chosen when they run.

use pulp::{Arch, Simd, WithSimd};

/// Columns that are factored together, before the later ones take their products. Trial: 8 to 64 take the same time.
const BLOCK: usize = 32;
/// Vectors by columns of the part of a product that is kept in registers. With a vector of A, and one of B, they fill the
/// sixteen registers of x86-64.
const TILE: [usize; 2] = [3, 4];

/// Factors the first `width` rows of the matrix as L L^T and the rows below them with it, in place. Entries above the
/// diagonal mean nothing, before and after. False if a pivot is not positive.
pub(super) fn factor(a: &mut [f64], height: usize, width: usize) -> bool {
    (0..width).step_by(BLOCK).all(|from| {
        let to = (from + BLOCK).min(width);
        let (done, rest) = a.split_at_mut(from * height);
        if from > 0 {
            let (done, size) = (&done[from..], [height - from, to - from, from]);
            subtract_product(&mut rest[from..], height, done, height, size);
        }
        let block = Block {
            a: &mut rest[..(to - from) * height],
            height,
            from,
        };
        Arch::new().dispatch(block)
    })
}

/// Columns whose diagonal begins at row `from`, to be factored.
struct Block<'a> {
    a: &'a mut [f64],
    height: usize,
    from: usize,
}

impl WithSimd for Block<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { a, height, from } = self;
        for j in 0..a.len() / height {
            let (before, rest) = a.split_at_mut(j * height);
            let column = &mut rest[from + j..height];
            for l in 0..j {
                let earlier = &before[l * height + from + j..(l + 1) * height];
                subtract(simd, column, earlier, earlier[0]);
            }
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            let root = pivot.sqrt();
            column[0] = root;
            for x in &mut column[1..] {
                *x /= root;
            }
        }
        true
    }
}

/// Subtracts a weight times `b` from `a`, of the same length.
#[inline(always)]
fn subtract<S: Simd>(simd: S, a: &mut [f64], b: &[f64], weight: f64) {
    let wide = simd.splat_f64s(weight);
    let (a, a_end) = S::as_mut_simd_f64s(a);
    let (b, b_end) = S::as_simd_f64s(b);
    for k in 0..a.len() {
        a[k] = simd.sub_f64s(a[k], simd.mul_f64s(b[k], wide));
    }
    for k in 0..a_end.len() {
        a_end[k] -= b_end[k] * weight;
    }
}

/// Subtracts A B^T from C: A has m rows and k columns `stride` apart, B the first n rows of A; the columns of C are `to`
/// apart. The last column of each ends with its last row.
pub(super) fn subtract_product(
    c: &mut [f64],
    to: usize,
    a: &[f64],
    stride: usize,
    [m, n, k]: [usize; 3],
) {
    let product = Product {
        a,
        stride,
        size: [m, n, k],
        c,
        to,
    };
    Arch::new().dispatch(product);
}

struct Product<'a> {
    a: &'a [f64],
    stride: usize,
    size: [usize; 3],
    c: &'a mut [f64],
    to: usize,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n = self.size[1];
        let whole = n - n % TILE[1];
        for j in (0..whole).step_by(TILE[1]) {
            self.columns::<S, { TILE[1] }>(simd, j);
        }
        for j in whole..n {
            self.columns::<S, 1>(simd, j);
        }
    }
}

impl Product<'_> {
    /// N columns from column j, from the row of the diagonal on.
    #[inline(always)]
    fn columns<S: Simd, const N: usize>(&mut self, simd: S, j: usize) {
        let m = self.size[0];
        let mut i = j;
        while i + TILE[0] * S::F64_LANES <= m {
            self.tile::<S, { TILE[0] }, N>(simd, i, j);
            i += TILE[0] * S::F64_LANES;
        }
        while i + S::F64_LANES <= m {
            self.tile::<S, 1, N>(simd, i, j);
            i += S::F64_LANES;
        }
        while i < m {
            self.row::<N>(i, j);
            i += 1;
        }
    }

    /// M vectors from row i, N columns from column j.
    #[inline(always)]
    fn tile<S: Simd, const M: usize, const N: usize>(&mut self, simd: S, i: usize, j: usize) {
        let mut sums = [[simd.splat_f64s(0.0); M]; N];
        for l in 0..self.size[2] {
            let column = &self.a[l * self.stride..];
            let (a, _) = S::as_simd_f64s(&column[i..i + M * S::F64_LANES]);
            let b = &column[j..j + N];
            for (sums, &b) in sums.iter_mut().zip(b) {
                let b = simd.splat_f64s(b);
                for m in 0..M {
                    sums[m] = simd.add_f64s(sums[m], simd.mul_f64s(a[m], b));
                }
            }
        }
        for (n, sums) in sums.iter().enumerate() {
            let at = (j + n) * self.to + i;
            let (c, _) = S::as_mut_simd_f64s(&mut self.c[at..at + M * S::F64_LANES]);
            for m in 0..M {
                c[m] = simd.sub_f64s(c[m], sums[m]);
            }
        }
    }

    /// Row i, N columns from column j.
    #[inline(always)]
    fn row<const N: usize>(&mut self, i: usize, j: usize) {
        let mut sums = [0.0; N];
        for l in 0..self.size[2] {
            let column = &self.a[l * self.stride..];
            let (a, b) = (column[i], &column[j..j + N]);
            for (sum, b) in sums.iter_mut().zip(b) {
                *sum += a * b;
            }
        }
        for (n, sum) in sums.iter().enumerate() {
            self.c[(j + n) * self.to + i] -= sum;
        }
    }
}
