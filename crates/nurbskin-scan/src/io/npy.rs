//! `NumPy` arrays, `.npy`.
//!
//! Read here: `npyz` overflows its stack on a header of nested tuples and takes minutes for one of nested lists.

use super::bytes::{Number, u16_at, u32_at};
use super::grid::{Zero, organise};
use super::lines::shown;
use crate::Scan;
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// What the header says.
#[derive(Debug, PartialEq)]
struct Header {
    number: Number,
    big_endian: bool,
    fortran: bool,
    shape: Vec<usize>,
}

/// Reads an array of numbers of shape (n, 3), the points in the order of the file, or (M, N, 3), an M x N grid with
/// M points along u. NaN in all coordinates and, where no neighbour is near, `0 0 0` are empty cells. Columns after
/// the third are ignored with a warning.
///
/// # Errors
/// [`Error::Read`] for a truncated or damaged file, [`Error::Unsupported`] for other shapes and types.
pub fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let (header, body) = Header::of(bytes, path)?;
    let mut scan = Scan {
        format: "npy".into(),
        ..Scan::default()
    };
    let unfit = |what: String| Error::Unsupported(format!("{}: {what}", path.display()));
    let (m, n, columns) = match *header.shape.as_slice() {
        [count, columns] => (count, 1, columns),
        [m, n, columns] => (m, n, columns),
        _ => {
            return Err(unfit(format!(
                "an array of shape {:?} holds no points: save one of shape (n, 3), or (M, N, 3) for a grid",
                header.shape
            )));
        }
    };
    if columns < 3 {
        return Err(unfit(format!(
            "an array of shape {:?} has fewer than 3 numbers in its last dimension: save one of shape (n, 3), or (M, \
             N, 3) for a grid",
            header.shape
        )));
    }
    if columns > 6 && m == 3 {
        return Err(unfit(format!(
            "an array of shape {:?} has x, y and z in its rows: save its transpose",
            header.shape
        )));
    }
    if columns > 3 {
        scan.warnings.push(format!(
            "the first three of {columns} columns were used as x, y, z"
        ));
    }
    let size = header.number.size();
    let needed = [n, columns, size]
        .into_iter()
        .try_fold(m, |product, factor| product.checked_mul(factor));
    match needed {
        Some(needed) if needed <= body.len() => {
            if needed < body.len() {
                scan.warnings.push(format!(
                    "ignored {} bytes after the array",
                    body.len() - needed
                ));
            }
        }
        _ => {
            let what = format!(
                "an array of shape {:?} needs more than the {} bytes of data that the file has: it is truncated; save \
                 it again",
                header.shape,
                body.len()
            );
            return Err(Error::read(path, "header", what));
        }
    }
    // The last index runs fastest, or the first.
    let strides = if header.fortran {
        [1, m, m * n]
    } else {
        [n * columns, columns, 1]
    };
    let number = |i: usize, j: usize, c: usize| {
        let at = (i * strides[0] + j * strides[1] + c * strides[2]) * size;
        header.number.read(body, at, header.big_endian)
    };
    scan.points.reserve_exact(m * n);
    for j in 0..n {
        for i in 0..m {
            let [x, y, z] = [0, 1, 2].map(|c| number(i, j, c));
            scan.points.push(DVec3::new(x, y, z));
        }
    }
    if header.shape.len() == 3 && m > 1 && n > 1 {
        organise(&mut scan, m, n, Zero::Judged);
    }
    Ok(scan)
}

impl Header {
    /// The header of a file, and the data after it.
    fn of<'a>(bytes: &'a [u8], path: &Path) -> Result<(Self, &'a [u8])> {
        let damaged = |what: &str| {
            Error::read(
                path,
                "header",
                format!("{what}; save the array again with numpy.save"),
            )
        };
        let (start, length) = match bytes.get(6) {
            Some(1) => (10, u16_at(bytes, 8).map(usize::from)),
            Some(2 | 3) => (12, u32_at(bytes, 8).and_then(|n| usize::try_from(n).ok())),
            Some(other) => {
                return Err(Error::Unsupported(format!(
                    "{}: version {other} of the npy format is not known; save the array again with numpy.save",
                    path.display()
                )));
            }
            None => (0, None),
        };
        let text = length
            .and_then(|length| bytes.get(start..)?.get(..length))
            .ok_or_else(|| damaged("the file ends in its header: it is truncated"))?;
        let body = &bytes[start + text.len()..];
        let value = |key: &str| value_of(text, key);
        let descr = value("descr").ok_or_else(|| damaged("the header names no type of numbers"))?;
        let [quote @ (b'\'' | b'"'), order, letter, digits @ .., last] = descr else {
            return Err(Error::Unsupported(format!(
                "{}: the array has named fields ({}): save a plain array of shape (n, 3), as with \
                 numpy.stack([a['x'], a['y'], a['z']], -1)",
                path.display(),
                shown(descr)
            )));
        };
        let size = std::str::from_utf8(digits)
            .ok()
            .and_then(|digits| digits.parse().ok());
        let number = size
            .and_then(|size| Number::of(*letter, size))
            .filter(|_| last == quote);
        let Some(number) = number else {
            return Err(Error::Unsupported(format!(
                "{}: numbers of type {} are not read; save the array as float64 (a.astype(float))",
                path.display(),
                shown(descr)
            )));
        };
        let fortran = match value("fortran_order") {
            Some(b"True") => true,
            Some(b"False") => false,
            _ => return Err(damaged("the header does not say the order of the array")),
        };
        let shape = value("shape")
            .and_then(|value| value.strip_prefix(b"(")?.strip_suffix(b")"))
            .and_then(|value| std::str::from_utf8(value).ok())
            .and_then(|value| {
                let numbers = value.split(',').map(str::trim).filter(|n| !n.is_empty());
                let numbers = numbers.map(|n| n.trim_end_matches('L').parse().ok());
                // More dimensions than any array has would only be memory.
                numbers.take(65).collect::<Option<Vec<usize>>>()
            })
            .ok_or_else(|| damaged("the header does not say the shape of the array"))?;
        Ok((
            Header {
                number,
                big_endian: *order == b'>',
                fortran,
                shape,
            },
            body,
        ))
    }
}

/// What stands after `'key':` in the text of a Python dictionary: up to the closing bracket or quote, or the comma.
fn value_of<'a>(text: &'a [u8], key: &str) -> Option<&'a [u8]> {
    let named = |quote: char| format!("{quote}{key}{quote}").into_bytes();
    let find = |name: &[u8]| text.windows(name.len()).position(|w| w == name);
    let at = find(&named('\'')).or_else(|| find(&named('"')))?;
    let rest = text[at + key.len() + 2..].trim_ascii_start();
    let rest = rest.strip_prefix(b":")?.trim_ascii_start();
    let length = match rest.first()? {
        quote @ (b'\'' | b'"') => 2 + rest[1..].iter().position(|b| b == quote)?,
        b'(' => 1 + rest.iter().position(|&b| b == b')')?,
        b'[' => 1 + rest.iter().position(|&b| b == b']')?,
        _ => rest.iter().position(|b| b",}".contains(b))?,
    };
    Some(rest[..length].trim_ascii())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_all_programs() {
        for text in [
            "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }   \n",
            "{\"shape\":(2,3),\"fortran_order\":False,\"descr\":\"<f8\"}",
            "{'shape': (2L, 3L), 'fortran_order': False, 'descr': '<f8'}",
        ] {
            let mut bytes = b"\x93NUMPY\x01\0".to_vec();
            bytes.extend(u16::try_from(text.len()).unwrap().to_le_bytes());
            bytes.extend(text.bytes());
            let (header, body) = Header::of(&bytes, Path::new("a.npy")).unwrap();
            assert_eq!(header.shape, [2, 3]);
            assert_eq!(header.number, Number::F64);
            assert!(!header.big_endian && !header.fortran && body.is_empty());
        }
    }
}
