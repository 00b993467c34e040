//! Random numbers that are the same everywhere.

use nurbskin_geometry::math;

/// A small seeded generator: xoshiro256++ (Blackman & Vigna 2021, ACM TOMS 47(4), DOI 10.1145/3460772), its state
/// filled by splitmix64. Not for secrets.
///
/// ```
/// use nurbskin_scan::simulate::Random;
/// let mut random = Random::new(1);
/// let x = random.uniform();
/// assert!((0.0..1.0).contains(&x) && x == Random::new(1).uniform());
/// ```
#[derive(Clone, Debug)]
pub struct Random {
    state: [u64; 4],
    spare: Option<f64>,
}

impl Random {
    /// A generator; equal seeds give equal numbers.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut x = seed;
        let state = std::array::from_fn(|_| {
            x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = x;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        });
        Self { state, spare: None }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        let s = &mut self.state;
        let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// A number of [0, 1), all multiples of 2^-53 equally likely.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// An index below `end`; 0 for `end` = 0. The bias is below `end` / 2^64.
    pub fn index(&mut self, end: usize) -> usize {
        let product = u128::from(self.bits()) * (end as u128);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the upper half of the product is below end"
        )]
        {
            (product >> 64) as usize
        }
    }

    /// A number of the standard normal distribution (Marsaglia's polar method).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                let factor = (-2.0 * math::ln(square) / square).sqrt();
                self.spare = Some(y * factor);
                return x * factor;
            }
        }
    }

    /// Puts `items` into random order (Fisher & Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let other = self.index(last + 1);
            items.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Random;

    #[test]
    fn reference_sequence() {
        // splitmix64 of seed 0, from its published reference implementation's first outputs.
        let random = Random::new(0);
        assert_eq!(random.state[0], 0xe220_a839_7b1d_cdaf);
        assert_eq!(random.state[1], 0x6e78_9e6a_a1b9_65f4);
    }

    #[test]
    fn moments() {
        let mut random = Random::new(7);
        let n = 200_000;
        let (mut sum, mut square, mut fourth, mut inside) = (0.0, 0.0, 0.0, 0);
        for _ in 0..n {
            let x = random.normal();
            sum += x;
            square += x * x;
            fourth += x * x * x * x;
            inside += usize::from(random.uniform() < 0.25);
        }
        let n = f64::from(n);
        assert!((sum / n).abs() < 0.01);
        assert!((square / n - 1.0).abs() < 0.02);
        assert!((fourth / n - 3.0).abs() < 0.1);
        assert!((inside as f64 / n - 0.25).abs() < 0.005);
        let mut items: Vec<usize> = (0..100).collect();
        random.shuffle(&mut items);
        assert!(
            (0..100).all(|i| items.contains(&i)) && items[..10] != [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]
        );
    }
}
