//! Values as bytes of `MessagePack` that say what they are and which version of the library wrote them: an array of a name,
//! the version and the value. `MessagePack` because it keeps every bit of a float, NaN and infinities included.

use nurbskin_geometry::{Error, Result};
use rmp_serde::{Deserializer, decode, encode};
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};

/// The fields of a struct may change from one version to the next.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What the bytes of every `kind` begin with, up to the value.
fn head(kind: &str) -> std::result::Result<Vec<u8>, encode::Error> {
    let mut bytes = rmp_serde::to_vec(&(kind, VERSION, ()))?;
    bytes.pop();
    Ok(bytes)
}

/// The bytes of a value of this `kind`.
///
/// # Errors
/// [`Error::Invalid`] if `MessagePack` cannot hold it.
pub fn to_bytes(kind: &str, value: &impl Serialize) -> Result<Vec<u8>> {
    let bytes = head(kind).and_then(|mut bytes| {
        encode::write_named(&mut bytes, value)?;
        Ok(bytes)
    });
    bytes.map_err(|e| Error::invalid(format!("the {kind} cannot be stored: {e}")))
}

/// The value of this `kind` in `bytes`.
///
/// # Errors
/// [`Error::Invalid`] if it is none, was written by another version, or is damaged.
pub fn from_bytes<T: DeserializeOwned>(kind: &str, bytes: &[u8]) -> Result<T> {
    let damaged = |e: &dyn std::fmt::Display| {
        Error::invalid(format!("the bytes of the stored {kind} are damaged: {e}"))
    };
    let head = head(kind).map_err(|e| damaged(&e))?;
    let Some(mut rest) = bytes.strip_prefix(head.as_slice()) else {
        return Err(foreign(kind, bytes));
    };
    // A length that the bytes only claim to have takes no memory: buffers grow with what is there.
    let value = T::deserialize(&mut Deserializer::new(&mut rest)).map_err(|e| damaged(&e))?;
    if rest.is_empty() {
        Ok(value)
    } else {
        Err(damaged(&format!("{} bytes too many", rest.len())))
    }
}

/// Why bytes that do not begin as they should are not read.
fn foreign(kind: &str, bytes: &[u8]) -> Error {
    let named: std::result::Result<(String, String, IgnoredAny), decode::Error> =
        rmp_serde::from_slice(bytes);
    Error::invalid(match named {
        Ok((name, version, _)) if name == kind => format!(
            "the {kind} was stored by version {version} of nurbskin, and this is {VERSION}: store it again with this one"
        ),
        _ => format!("the bytes are not a stored {kind}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_a_float_comes_back() {
        let odd = [
            f64::NAN.to_bits() | 0xBEEF,
            f64::NAN.to_bits() | 1 << 63,
            f64::INFINITY.to_bits(),
            f64::NEG_INFINITY.to_bits(),
            (-0.0_f64).to_bits(),
            1,
            0.1_f64.to_bits(),
        ];
        let bytes = to_bytes("thing", &odd.map(f64::from_bits)).unwrap();
        let read: [f64; 7] = from_bytes("thing", &bytes).unwrap();
        assert_eq!(read.map(f64::to_bits), odd);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let bytes = to_bytes("thing", &vec![1_u8, 2]).unwrap();
        let said = |bytes: &[u8]| {
            from_bytes::<Vec<u8>>("thing", bytes)
                .unwrap_err()
                .to_string()
        };
        let other = rmp_serde::to_vec(&("thing", "0.0.9", ())).unwrap();
        assert!(said(&other).contains("stored by version 0.0.9 of nurbskin"));
        let other = to_bytes("scan", &vec![1_u8, 2]).unwrap();
        for strange in [&[][..], b"solid", &other, &[0xdd; 9], &bytes[..5]] {
            assert_eq!(said(strange), "the bytes are not a stored thing");
        }
        let more = [&bytes[..], &[0]].concat();
        assert!(said(&more).ends_with("are damaged: 1 bytes too many"));
        assert!(said(&bytes[..bytes.len() - 1]).contains("damaged"));
        // An array said to have 2^32 - 1 elements.
        let mut long = head("thing").unwrap();
        long.extend([0xdd, 0xff, 0xff, 0xff, 0xff, 1]);
        assert!(said(&long).contains("damaged"));
    }
}
