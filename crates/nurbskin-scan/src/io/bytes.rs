//! Numbers in binary files, at checked places.

/// The `N` bytes at `at`, or `None` where the file has ended.
#[inline]
fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// A little-endian number of 16 bits.
pub(super) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    array(bytes, at).map(u16::from_le_bytes)
}

/// A little-endian number of 32 bits.
pub(super) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    array(bytes, at).map(u32::from_le_bytes)
}

/// A little-endian number of 64 bits.
pub(super) fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    array(bytes, at).map(u64::from_le_bytes)
}

/// A signed little-endian number of 32 bits.
#[inline]
pub(super) fn i32_at(bytes: &[u8], at: usize) -> Option<i32> {
    array(bytes, at).map(i32::from_le_bytes)
}

/// A little-endian floating-point number of 64 bits.
pub(super) fn f64_at(bytes: &[u8], at: usize) -> Option<f64> {
    array(bytes, at).map(f64::from_le_bytes)
}

/// The kinds of numbers that arrays and point clouds are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F32,
    F64,
}

impl Number {
    /// The number of this letter (`i`, `u` or `f`) and size in bytes.
    pub(super) fn of(letter: u8, size: usize) -> Option<Self> {
        Some(match (letter.to_ascii_lowercase(), size) {
            (b'i', 1) => Self::I8,
            (b'i', 2) => Self::I16,
            (b'i', 4) => Self::I32,
            (b'i', 8) => Self::I64,
            (b'u', 1) => Self::U8,
            (b'u', 2) => Self::U16,
            (b'u', 4) => Self::U32,
            (b'u', 8) => Self::U64,
            (b'f', 4) => Self::F32,
            (b'f', 8) => Self::F64,
            _ => return None,
        })
    }

    /// Its size in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at `at`; NaN where the file has ended, which the caller has excluded.
    #[inline]
    pub(super) fn read(self, bytes: &[u8], at: usize, big_endian: bool) -> f64 {
        macro_rules! number {
            ($kind:ty) => {
                array(bytes, at).map(|raw| {
                    if big_endian {
                        <$kind>::from_be_bytes(raw)
                    } else {
                        <$kind>::from_le_bytes(raw)
                    }
                })
            };
        }
        let value = match self {
            Self::I8 => number!(i8).map(f64::from),
            Self::I16 => number!(i16).map(f64::from),
            Self::I32 => number!(i32).map(f64::from),
            // Beyond 2^53 they are rounded: no coordinate needs more.
            Self::I64 => number!(i64).map(|value| value as f64),
            Self::U8 => number!(u8).map(f64::from),
            Self::U16 => number!(u16).map(f64::from),
            Self::U32 => number!(u32).map(f64::from),
            Self::U64 => number!(u64).map(|value| value as f64),
            Self::F32 => number!(f32).map(f64::from),
            Self::F64 => number!(f64),
        };
        value.unwrap_or(f64::NAN)
    }
}
