//! `LibLZF`'s compression, with which PCD packs its columns.

/// A back reference of three bytes stands for at most 264: more is not in the data.
pub(super) const MOST: usize = 88;

/// Unpacks `data` to `size` bytes; the place in `data` where it cannot be right, if there is one.
///
/// The caller has seen that `size` is at most [`MOST`] times the data.
pub(super) fn unpack(data: &[u8], size: usize) -> Result<Vec<u8>, usize> {
    let mut out: Vec<u8> = Vec::with_capacity(size);
    let mut at = 0;
    while let Some(&control) = data.get(at) {
        let begun = at;
        at += 1;
        let control = usize::from(control);
        if control < 32 {
            let literal = data.get(at..at + control + 1).ok_or(begun)?;
            out.extend_from_slice(literal);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(*data.get(at).ok_or(begun)?);
                at += 1;
            }
            let low = usize::from(*data.get(at).ok_or(begun)?);
            at += 1;
            let back = ((control & 31) << 8 | low) + 1;
            let start = out.len().checked_sub(back).ok_or(begun)?;
            // What is copied may overlap what is read.
            for k in start..start + length + 2 {
                let byte = *out.get(k).ok_or(begun)?;
                out.push(byte);
            }
        }
        if out.len() > size {
            return Err(begun);
        }
    }
    if out.len() == size { Ok(out) } else { Err(at) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_references() {
        // "abcabcabcabc" and ten times "x".
        let data = [2, b'a', b'b', b'c', 0xe0, 0, 2, 0, b'x', 0xe0, 0, 0];
        assert_eq!(unpack(&data, 22).unwrap(), b"abcabcabcabcxxxxxxxxxx");
        assert_eq!(unpack(&data, 23), Err(12));
        assert_eq!(unpack(&data, 21), Err(9));
        assert_eq!(unpack(&data[..3], 22), Err(0));
        assert_eq!(unpack(&[0x20, 0], 3), Err(0));
    }
}
