//! Lists of numbers in the page: quantised, as differences, compressed.
//!
//! A value x is stored as the integer round(x / step). Of these come differences of order 0, 1 or 2 between neighbours,
//! whichever are smallest, so that smooth sequences become small numbers. Their zigzag form is split into four planes of
//! bytes, from the lowest to the highest, which DEFLATE (RFC 1951) compresses; base64 makes them text. `data.ts` reads
//! them.

use base64::display::Base64Display;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::io::Write;

/// Stands for a value that is no number.
const NONE: i32 = i32::MIN;
/// Largest magnitude of a stored integer. Guard: differences wrap around, and [`NONE`] stays free.
const MOST: f64 = (i32::MAX - 1) as f64;
/// Largest order of the differences.
const ORDERS: usize = 3;

/// Numbers in groups of one width, which serialisation compresses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Packed {
    /// Numbers per group.
    width: usize,
    /// What a stored integer is multiplied with; zero for integers.
    step: f64,
    /// The stored integers.
    values: Vec<i32>,
}

impl Packed {
    /// Groups of numbers to the nearest multiple of `step`; what is not finite comes back as NaN. Values beyond 2^31
    /// steps are limited to that.
    pub fn floats<const N: usize>(items: impl IntoIterator<Item = [f64; N]>, step: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "clamped first")]
        let whole = |x: f64| match (x / step).round() {
            x if x.is_finite() => x.clamp(-MOST, MOST) as i32,
            _ => NONE,
        };
        let values: Vec<i32> = items.into_iter().flat_map(|item| item.map(whole)).collect();
        Self::new(values, N, step)
    }

    /// Groups of integers.
    pub fn integers<const N: usize>(items: impl IntoIterator<Item = [u32; N]>) -> Self {
        let values: Vec<i32> = items
            .into_iter()
            .flat_map(|item| item.map(u32::cast_signed))
            .collect();
        Self::new(values, N, 0.0)
    }

    /// Unit vectors, as the octahedral projection of Meyer et al. (2010), "On floating-point normal vectors": two
    /// numbers each, to the nearest multiple of `step`. The zero vector comes back as a unit vector.
    pub fn directions(items: impl IntoIterator<Item = [f64; 3]>, step: f64) -> Self {
        let fold = |[x, y, z]: [f64; 3]| {
            let size = (x.abs() + y.abs() + z.abs()).max(f64::MIN_POSITIVE);
            let [a, b] = [x / size, y / size];
            if z >= 0.0 {
                [a, b]
            } else {
                [(1.0 - b.abs()).copysign(a), (1.0 - a.abs()).copysign(b)]
            }
        };
        Self::floats(items.into_iter().map(fold), step)
    }

    fn new(values: Vec<i32>, width: usize, step: f64) -> Self {
        Self {
            width,
            step,
            values,
        }
    }

    /// Number of groups.
    #[must_use]
    pub fn count(&self) -> usize {
        self.values.len() / self.width.max(1)
    }

    /// The numbers of [`Packed::floats`] as a reader finds them.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "as the page has them")]
    pub fn to_floats(&self) -> Vec<f32> {
        let of = |&x: &i32| match x {
            NONE => f32::NAN,
            x => (f64::from(x) * self.step) as f32,
        };
        self.values.iter().map(of).collect()
    }

    /// The numbers of [`Packed::integers`].
    #[must_use]
    pub fn to_integers(&self) -> Vec<u32> {
        self.values.iter().map(|x| x.cast_unsigned()).collect()
    }

    /// The unit vectors of [`Packed::directions`], as a reader finds them.
    #[must_use]
    pub fn to_directions(&self) -> Vec<[f32; 3]> {
        self.to_floats()
            .as_chunks()
            .0
            .iter()
            .map(|&pair| unfolded(pair))
            .collect()
    }

    /// The order of the differences, and their zigzag forms: those with the fewest bits.
    fn smallest(&self) -> (usize, Vec<u32>) {
        (0..ORDERS)
            .map(|order| (order, differences(&self.values, self.width, order)))
            .min_by_key(|(_, found)| found.iter().map(|&x| u64::from(bits(x))).sum::<u64>())
            .unwrap_or_default()
    }
}

/// The unit vector of an octahedral projection.
fn unfolded([a, b]: [f32; 2]) -> [f32; 3] {
    let z = 1.0 - a.abs() - b.abs();
    let [x, y] = if z >= 0.0 {
        [a, b]
    } else {
        [(1.0 - b.abs()).copysign(a), (1.0 - a.abs()).copysign(b)]
    };
    let size = (x * x + y * y + z * z).sqrt();
    [x / size, y / size, z / size]
}

/// The bytes of numbers, from the planes of the lowest to those of the highest, compressed.
fn planes(numbers: &[u32]) -> Vec<u8> {
    let mut planes = Vec::with_capacity(4 * numbers.len());
    for plane in 0..4 {
        let byte = |x: &u32| x.to_le_bytes()[plane];
        planes.extend(numbers.iter().map(byte));
    }
    deflated(&planes)
}

/// The number of bits of the zigzag form.
fn bits(zigzag: u32) -> u32 {
    u32::BITS - zigzag.leading_zeros()
}

/// The zigzag forms of the differences of an order, within each place of the groups.
fn differences(values: &[i32], width: usize, order: usize) -> Vec<u32> {
    let before = |k: usize, back: usize| {
        let at = k.checked_sub(back * width)?;
        values.get(at).copied()
    };
    let of = |(k, &x): (usize, &i32)| {
        let [one, two] = [1, 2].map(|back| before(k, back).unwrap_or(0));
        let expected = match order {
            0 => 0,
            1 => one,
            _ => one.wrapping_mul(2).wrapping_sub(two),
        };
        let rest = x.wrapping_sub(expected);
        ((rest << 1) ^ (rest >> 31)).cast_unsigned()
    };
    values.iter().enumerate().map(of).collect()
}

/// Compressed bytes; writing into memory does not fail.
fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::new(9));
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.unwrap_or_default()
}

fn base64(bytes: &[u8]) -> String {
    Base64Display::new(bytes, &STANDARD).to_string()
}

/// Bytes compressed with DEFLATE, as base64.
pub(super) fn deflated_text(bytes: &[u8]) -> String {
    base64(&deflated(bytes))
}

impl Serialize for Packed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (order, found) = self.smallest();
        let mut all = serializer.serialize_struct("Packed", 5)?;
        all.serialize_field("count", &self.count())?;
        all.serialize_field("width", &self.width)?;
        all.serialize_field("step", &self.step)?;
        all.serialize_field("order", &order)?;
        let text = base64(&planes(&found));
        all.serialize_field("deflate", &text)?;
        all.end()
    }
}

/// Reads packed lists again, as the page does.
#[cfg(test)]
pub(super) mod read {
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use serde_json::Value;
    use std::io::Read;

    /// The integers of a list, and its step.
    pub(in crate::report) fn whole(value: &Value) -> (Vec<i32>, f64) {
        let number = |key: &str| usize::try_from(value[key].as_u64().unwrap()).unwrap();
        let (count, width, order) = (number("count"), number("width"), number("order"));
        let packed = STANDARD.decode(value["deflate"].as_str().unwrap()).unwrap();
        let mut planes = Vec::new();
        let mut decoder = flate2::read::DeflateDecoder::new(packed.as_slice());
        decoder.read_to_end(&mut planes).unwrap();
        let n = count * width;
        assert_eq!(planes.len(), 4 * n);
        let mut found: Vec<i32> = Vec::with_capacity(n);
        for k in 0..n {
            let z = u32::from_le_bytes([0, 1, 2, 3].map(|plane| planes[plane * n + k]));
            let rest = (z >> 1).cast_signed() ^ -(z & 1).cast_signed();
            let before = |back: usize| k.checked_sub(back * width).map_or(0, |at| found[at]);
            let expected = match order {
                0 => 0,
                1 => before(1),
                _ => before(1).wrapping_mul(2).wrapping_sub(before(2)),
            };
            found.push(expected.wrapping_add(rest));
        }
        (found, value["step"].as_f64().unwrap())
    }

    #[expect(clippy::cast_possible_truncation, reason = "as the page has them")]
    pub(in crate::report) fn floats(value: &Value) -> Vec<f32> {
        let (found, step) = whole(value);
        let of = |x: i32| {
            if x == super::NONE {
                f32::NAN
            } else {
                (f64::from(x) * step) as f32
            }
        };
        found.into_iter().map(of).collect()
    }

    pub(in crate::report) fn integers(value: &Value) -> Vec<u32> {
        let found = whole(value).0;
        found.into_iter().map(i32::cast_unsigned).collect()
    }

    pub(in crate::report) fn directions(value: &Value) -> Vec<[f32; 3]> {
        let pairs = floats(value);
        let pairs = pairs.as_chunks().0.iter();
        pairs.map(|&pair| super::unfolded(pair)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back(packed: &Packed) -> Vec<f32> {
        read::floats(&serde_json::to_value(packed).unwrap())
    }

    #[test]
    fn values_come_back_within_half_a_step() {
        let wave = |k: u32| {
            let t = f64::from(k) * 0.01;
            [t.sin(), 3.0 * t.cos(), -1e3 * t]
        };
        let step = 1e-4;
        let packed = Packed::floats((0..5000).map(wave), step);
        let found = back(&packed);
        for (k, x) in (0..5000).flat_map(wave).enumerate() {
            // Half a step, and the rounding to 32 bits.
            assert!((f64::from(found[k]) - x).abs() <= 0.5 * step + 1e-7 * x.abs());
        }
        // A smooth sequence takes the differences of order 2, and less than a third of 32 bits.
        let (order, differences) = packed.smallest();
        assert_eq!(order, 2);
        let bytes = planes(&differences).len();
        assert!(bytes < 20_000, "{bytes}");
        assert_eq!(packed.to_floats(), found);
        let odd = Packed::floats([[f64::NAN], [1e300], [-1e300], [0.0], [f64::INFINITY]], 1.0);
        let found = back(&odd);
        assert!(found[0].is_nan() && found[4].is_nan());
        assert!(found[1] > 2e9 && found[2] < -2e9 && found[3].abs() < f32::EPSILON);
        assert!(back(&Packed::floats::<2>([], 1.0)).is_empty());
    }

    #[test]
    fn integers_come_back_exactly() {
        let all = [[0, u32::MAX], [7, 1 << 31], [u32::MAX, 3], [0, 0]];
        let packed = Packed::integers(all);
        assert_eq!(packed.count(), 4);
        let found = read::integers(&serde_json::to_value(&packed).unwrap());
        assert_eq!(found, all.concat());
        assert_eq!(packed.to_integers(), found);
    }

    #[test]
    fn directions_come_back_as_unit_vectors() {
        let at = |k: u32| {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 2000.0;
            let (sin, cos) = (f64::from(k) * 2.4).sin_cos();
            let r = (1.0 - z * z).sqrt();
            [r * cos, r * sin, z]
        };
        let axes = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        let all: Vec<[f64; 3]> = axes.into_iter().chain((0..2000).map(at)).collect();
        let packed = Packed::directions(all.iter().copied(), 1.0 / 32_768.0);
        let found = read::directions(&serde_json::to_value(&packed).unwrap());
        for (a, b) in all.iter().zip(&found) {
            let apart: f64 = a
                .iter()
                .zip(b)
                .map(|(x, y)| (x - f64::from(*y)).powi(2))
                .sum();
            assert!(apart.sqrt() < 1e-4, "{a:?} {b:?}");
        }
        // Without a direction it is some unit vector, not NaN.
        let none = Packed::directions([[0.0; 3]], 1.0 / 32_768.0);
        let found = read::directions(&serde_json::to_value(&none).unwrap());
        assert!(found[0].iter().all(|x| x.is_finite()));
    }
}
