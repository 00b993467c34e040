//! Which format a file has: by its content first, by its extension where the content leaves it open.

use crate::{Error, Result};
use std::path::Path;

/// The formats of scans that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    Ply,
    StlText,
    StlBinary,
    Obj,
    Text,
}

/// What can be read, for the ends of sentences.
const READABLE: &str = "PLY, STL, OBJ and text (XYZ, ASC, TXT, CSV, PTS) can be read";

/// The extension in lower case, without the dot.
pub(crate) fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default()
}

/// The format of `bytes`, the content of `path`.
///
/// # Errors
/// [`Error::Read`] if the file is empty or of no known format, [`Error::Unsupported`] for a known one without reader.
pub(crate) fn sniff(bytes: &[u8], path: &Path) -> Result<Format> {
    let extension = extension(path);
    if bytes.is_empty() {
        return Err(Error::read(
            path,
            "",
            "the file is empty; export the scan again",
        ));
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if text.starts_with(b"ply") && text.get(3).is_none_or(u8::is_ascii_whitespace) {
        return Ok(Format::Ply);
    }
    // The count of triangles fits the size to the byte: no text does that by chance.
    if let Some(count) = binary_stl_count(bytes)
        && count.checked_mul(50) == Some(bytes.len() as u64 - 84)
    {
        return Ok(Format::StlBinary);
    }
    if let Some(name) = foreign(text, &extension) {
        return Err(Error::Unsupported(format!(
            "{}: this is {name}, which cannot be read as a scan; {READABLE}: export it as one of these",
            path.display()
        )));
    }
    let word = first_word(text);
    if word.eq_ignore_ascii_case(b"solid") && is_text_stl(text, &extension) {
        return Ok(Format::StlText);
    }
    let binary = text.iter().take(4096).any(|&b| b == 0);
    match extension.as_str() {
        "ply" => Err(Error::read(
            path,
            "line 1",
            "a PLY file begins with the line \"ply\", this one does not; export the scan again",
        )),
        "stl" if binary => Ok(Format::StlBinary),
        _ if binary => Err(Error::read(
            path,
            "",
            format!("binary data of no known format; {READABLE}"),
        )),
        _ if OBJ_KEYWORDS.contains(&word) => Ok(Format::Obj),
        "obj" if !is_numeric(word) => Ok(Format::Obj),
        "stl" if !is_numeric(word) => Ok(Format::StlText),
        _ => Ok(Format::Text),
    }
}

/// Statements with which the content of an OBJ file begins.
const OBJ_KEYWORDS: [&[u8]; 8] = [b"v", b"vn", b"vt", b"o", b"g", b"f", b"mtllib", b"usemtl"];

/// The number of triangles that the header of a binary STL file announces.
fn binary_stl_count(bytes: &[u8]) -> Option<u64> {
    let field: [u8; 4] = bytes.get(80..84)?.try_into().ok()?;
    Some(u64::from(u32::from_le_bytes(field)))
}

/// Whether a file that begins with `solid` is text; some binary files begin so, too.
fn is_text_stl(text: &[u8], extension: &str) -> bool {
    let start = &text[..text.len().min(1024)];
    let has = |word: &[u8]| {
        start
            .windows(word.len())
            .any(|window| window.eq_ignore_ascii_case(word))
    };
    !start.contains(&0) && (has(b"facet") || has(b"endsolid") || extension == "stl")
}

/// The first word of the first line that is neither blank nor a comment; empty if there is none near the start.
fn first_word(text: &[u8]) -> &[u8] {
    text[..text.len().min(1 << 16)]
        .split(|&b| b == b'\n' || b == b'\r')
        .map(<[u8]>::trim_ascii)
        .find(|line| !line.is_empty() && !line.starts_with(b"#") && !line.starts_with(b"//"))
        .and_then(|line| line.split(u8::is_ascii_whitespace).next())
        .unwrap_or_default()
}

fn is_numeric(word: &[u8]) -> bool {
    word.first()
        .is_some_and(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.'))
}

/// The name of a format that we know but do not read.
fn foreign(text: &[u8], extension: &str) -> Option<&'static str> {
    const MAGIC: [(&[u8], &str); 17] = [
        (b"ASTM-E57", "E57"),
        (b"LASF", "LAS / LAZ"),
        (b"\x1f\x8b", "gzip"),
        (b"\x93NUMPY", "a numpy array"),
        (b"PK\x03\x04", "a zip archive (3MF, NPZ, XLSX)"),
        (b"glTF", "GLB"),
        (b"# .PCD", "PCD"),
        (b"# vtk DataFile", "VTK"),
        (b"ISO-10303-21", "a STEP file"),
        (b"<?xml", "XML (VTP, 3MF, COLLADA)"),
        (b"<VTKFile", "VTP"),
        (b"{", "JSON"),
        (b"[", "JSON"),
        (b"\x89PNG", "a picture"),
        (b"\xff\xd8\xff", "a picture"),
        (b"\xff\xfe", "UTF-16 text"),
        (b"\xfe\xff", "UTF-16 text"),
    ];
    let start = text.trim_ascii_start();
    if let Some((_, name)) = MAGIC.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Some(name);
    }
    let word = first_word(text);
    if word.starts_with(b"OFF")
        || [
            b"COFF".as_slice(),
            b"NOFF",
            b"CNOFF",
            b"STOFF",
            b"4OFF",
            b"nOFF",
        ]
        .contains(&word)
    {
        return Some("OFF");
    }
    // The start section of an IGES file: column 73 of 80 is its letter.
    if text.get(72) == Some(&b'S') && text.get(73..80) == Some(b"      1".as_slice())
        || text.get(72..80) == Some(b"S0000001".as_slice())
    {
        return Some("an IGES file");
    }
    let mut lines = text
        .split(|&b| b == b'\n')
        .map(<[u8]>::trim_ascii)
        .take(4)
        .map(|line| {
            line.split(u8::is_ascii_whitespace)
                .filter(|w| !w.is_empty())
                .count()
        });
    let shape: [usize; 4] = std::array::from_fn(|_| lines.next().unwrap_or(0));
    let numbers = is_numeric(word);
    if numbers && shape == [1, 1, 3, 3] {
        return Some("PTX");
    }
    match (extension, word) {
        ("pcd", _) | (_, b"VERSION") => Some("PCD"),
        ("off", _) => Some("OFF"),
        ("ptx", _) => Some("PTX"),
        ("e57", _) => Some("E57"),
        ("las" | "laz", _) => Some("LAS / LAZ"),
        ("npy" | "npz", _) => Some("a numpy array"),
        ("gz", _) => Some("gzip"),
        ("vtk" | "vtp", _) => Some("VTK"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8], name: &str) -> Result<Format> {
        sniff(bytes, Path::new(name))
    }

    #[test]
    fn content_goes_before_the_extension() {
        assert_eq!(of(b"ply\nformat", "a.xyz").unwrap(), Format::Ply);
        assert_eq!(of(b"\n# c\nv 0 0 0\n", "a.txt").unwrap(), Format::Obj);
        assert_eq!(of(b"0 0 0\n1 1 1\n", "a.obj").unwrap(), Format::Text);
        assert_eq!(
            of(b"Solid\n facet normal 0 0 1", "a").unwrap(),
            Format::StlText
        );
        let mut binary = b"solid but binary".to_vec();
        binary.resize(84, b' ');
        binary[80..84].copy_from_slice(&1_u32.to_le_bytes());
        binary.resize(134, 0);
        assert_eq!(of(&binary, "a.stl").unwrap(), Format::StlBinary);
        assert_eq!(of(&binary, "a.dat").unwrap(), Format::StlBinary);
        assert_eq!(of(&binary[..120], "a.stl").unwrap(), Format::StlBinary);
        assert_eq!(of(b"facet normal", "a.stl").unwrap(), Format::StlText);
        assert_eq!(of(b"v 0 0 0", "a.stl").unwrap(), Format::Obj);
    }

    #[test]
    fn what_is_not_read_is_named() {
        for (bytes, name, word) in [
            (b"OFF\n3 1 0\n".as_slice(), "a.txt", "OFF"),
            (b"\t OFF8 6 12", "a.off", "OFF"),
            (b"# .PCD v.7\nVERSION .7", "a", "PCD"),
            (b"VERSION .5\nFIELDS x y z", "a.pcd", "PCD"),
            (b"ASTM-E57\0", "a.e57", "E57"),
            (b"LASF", "a.las", "LAS"),
            (b"\x1f\x8b\x08", "a.xyz.gz", "gzip"),
            (b"\x93NUMPY", "a.npy", "numpy"),
            (b"15\n71\n0 0 0\n1 0 0\n", "a.txt", "PTX"),
            (b"ISO-10303-21;", "a.txt", "STEP"),
        ] {
            let message = of(bytes, name).unwrap_err();
            assert!(matches!(message, Error::Unsupported(_)), "{message}");
            let message = message.to_string();
            assert!(
                message.contains(word) && message.contains("XYZ"),
                "{message}"
            );
        }
        assert!(matches!(of(b"", "a.ply"), Err(Error::Read { .. })));
        assert!(matches!(of(b"plx\n", "a.ply"), Err(Error::Read { .. })));
        assert!(matches!(
            of(b"ab\0\0\x01cd", "a.dat"),
            Err(Error::Read { .. })
        ));
    }
}
