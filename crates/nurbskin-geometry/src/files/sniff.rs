//! Which format a file has: by its content first, by its extension where the content leaves it open.

use super::gzip;
use crate::{Error, Result};
use std::path::Path;

/// The formats of scans that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Stanford PLY, text or binary.
    Ply,
    /// STL as text.
    StlText,
    /// Binary STL.
    StlBinary,
    /// Wavefront OBJ.
    Obj,
    /// OFF of Geomview.
    Off,
    /// PCD of the Point Cloud Library.
    Pcd,
    /// PTX of Leica: a grid of pixels.
    Ptx,
    /// An array of numpy.
    Npy,
    /// ASTM E2807.
    E57,
    /// LAS, or LAZ, which is compressed.
    Las,
    /// Legacy VTK.
    Vtk,
    /// VTK polygonal data in XML.
    Vtp,
    /// Columns of numbers.
    Text,
}

/// What can be read, for the ends of sentences.
const READABLE: &str = "PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, VTK, VTP and text (XYZ, ASC, TXT, CSV, PTS) \
 can be read";

/// The extension in lower case, without the dot.
pub fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default()
}

/// The extension of the content: `xyz` of both `a.xyz` and `a.xyz.gz`.
pub fn extension_of_content(path: &Path) -> String {
    match extension(path).as_str() {
        "gz" => extension(Path::new(path.file_stem().unwrap_or_default())),
        other => other.to_owned(),
    }
}

/// The format of `bytes`, the content of `path`, which has this extension in lower case (or should have, where it is
/// no file).
///
/// # Errors
/// [`Error::Read`] if the file is empty or of no known format, [`Error::Unsupported`] for a known one without reader.
pub fn sniff(bytes: &[u8], path: &Path, extension: &str) -> Result<Format> {
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
    if let Some(format) = marked(text, extension) {
        return Ok(format);
    }
    if text.trim_ascii_start().starts_with(b"ISO-10303-21") || is_iges(text) {
        return Err(Error::Unsupported(not_a_scan(path)));
    }
    if let Some(name) = foreign(text, extension) {
        return Err(Error::Unsupported(format!(
            "{}: this is {name}, which cannot be read as a scan; {READABLE}: export it as one of these",
            path.display()
        )));
    }
    let word = first_word(text);
    if word.eq_ignore_ascii_case(b"solid") && is_text_stl(text, extension) {
        return Ok(Format::StlText);
    }
    let binary = text.iter().take(4096).any(|&b| b == 0);
    match extension {
        "ply" => Err(Error::read(
            path,
            "line 1",
            "not a PLY file: it should begin with the line \"ply\"; export the scan again",
        )),
        "e57" | "las" | "laz" | "npy" | "pcd" | "vtk" | "vtp" => {
            let magic = match extension {
                "e57" => "ASTM-E57",
                "npy" => "\\x93NUMPY",
                "pcd" => "# .PCD",
                "vtk" => "# vtk DataFile",
                "vtp" => "<VTKFile",
                _ => "LASF",
            };
            let what = format!(
                "not a .{extension} file: it should begin with \"{magic}\"; copy or export the scan again"
            );
            Err(Error::read(path, "byte 0", what))
        }
        "stl" if binary => Ok(Format::StlBinary),
        _ if binary => Err(Error::read(
            path,
            "",
            format!("unknown binary format; {READABLE}"),
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

/// Whether this is the start section of an IGES file: column 73 of 80 is its letter.
pub fn is_iges(text: &[u8]) -> bool {
    text.get(72) == Some(&b'S') && text.get(73..80) == Some(b"      1".as_slice())
        || text.get(72..80) == Some(b"S0000001".as_slice())
}

/// The name of the format of a scan that these bytes cannot but be.
pub fn scan_format(bytes: &[u8], path: &Path) -> Option<&'static str> {
    Some(
        match sniff(bytes, path, &extension_of_content(path)).ok()? {
            Format::Ply => "PLY",
            Format::StlText | Format::StlBinary => "STL",
            Format::Obj => "OBJ",
            Format::Off => "OFF",
            Format::Pcd => "PCD",
            Format::Ptx => "PTX",
            Format::Npy => "NPY",
            Format::E57 => "E57",
            Format::Las => "LAS",
            Format::Vtk | Format::Vtp => "VTK",
            Format::Text => return None,
        },
    )
}

/// The name of a format that we know but do not read.
fn foreign(text: &[u8], extension: &str) -> Option<&'static str> {
    const MAGIC: [(&[u8], &str); 14] = [
        (b"\x1f\x8b", "gzip within gzip"),
        (b"PK\x03\x04", "a zip archive (3MF, NPZ, XLSX)"),
        (b"glTF", "GLB"),
        (b"<?xml", "XML (3MF, COLLADA)"),
        (b"<!DOCTYPE", "a web page"),
        (b"<html", "a web page"),
        (b"<", "XML"),
        (b"{", "JSON"),
        (b"[", "JSON"),
        (b"\x89PNG", "a picture"),
        (b"\xff\xd8\xff", "a picture"),
        (b"%PDF", "a PDF document"),
        (b"\xff\xfe", "UTF-16 text"),
        (b"\xfe\xff", "UTF-16 text"),
    ];
    let start = text.trim_ascii_start();
    if let Some((_, name)) = MAGIC.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Some(name);
    }
    match extension {
        "npz" => Some("a zip archive (3MF, NPZ, XLSX)"),
        _ => None,
    }
}

/// The format that the first bytes or lines of the content name, or the extension of a format that cannot be mistaken.
fn marked(text: &[u8], extension: &str) -> Option<Format> {
    for (magic, format) in [
        (b"ASTM-E57".as_slice(), Format::E57),
        (b"LASF", Format::Las),
        (b"\x93NUMPY", Format::Npy),
        (b"# .PCD", Format::Pcd),
        (b"# vtk DataFile", Format::Vtk),
        (b"<VTKFile", Format::Vtp),
    ] {
        if text.starts_with(magic) {
            return Some(format);
        }
    }
    let start = &text[..text.len().min(1 << 12)];
    if start.starts_with(b"<?xml") && start.windows(8).any(|window| window == b"<VTKFile") {
        return Some(Format::Vtp);
    }
    let word = first_word(text);
    if off_keyword(word).is_some() {
        return Some(Format::Off);
    }
    if word == b"VERSION" || extension == "pcd" && matches!(word, b"FIELDS" | b"COLUMNS") {
        return Some(Format::Pcd);
    }
    // Two counts, and four lines of three numbers.
    let mut words = text[..text.len().min(1 << 12)]
        .split(|&b| b == b'\n' || b == b'\r')
        .map(<[u8]>::trim_ascii)
        .filter(|line| !line.is_empty())
        .map(|line| {
            let words = line.split(u8::is_ascii_whitespace);
            words.filter(|w| !w.is_empty()).count()
        });
    let shape: [usize; 7] = std::array::from_fn(|_| words.next().unwrap_or(0));
    if is_numeric(word) && (shape == [1, 1, 3, 3, 3, 3, 4] || extension == "ptx") {
        return Some(Format::Ptx);
    }
    (extension == "off" && is_numeric(word)).then_some(Format::Off)
}

/// So many bytes tell what a file is.
pub const HEAD: usize = 1 << 12;

/// Whether the content begins as STEP does.
pub fn is_step(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    text.starts_with(b"ISO-10303-21") || text.starts_with(b"/*")
}

/// Whether a file that begins with these bytes is a CAD file.
pub fn begins_as_cad(head: &[u8]) -> bool {
    let head = &head[..head.len().min(HEAD)];
    if gzip::is_gzip(head) {
        let head = gzip::head(head);
        return is_step(&head) || is_iges(&head);
    }
    is_step(head) || is_iges(head)
}

/// What is said of a CAD file where a scan is needed.
pub fn not_a_scan(path: &Path) -> String {
    format!(
        "{} is a CAD file, not a scan: use `check`, `deviation` or `convert`",
        path.display()
    )
}

/// Whether this is a keyword of the format; the letters before `OFF`, and what is glued to it.
pub fn off_keyword(word: &[u8]) -> Option<(&[u8], &[u8])> {
    let at = word.windows(3).position(|w| w == b"OFF")?;
    let (before, after) = (&word[..at], &word[at + 3..]);
    let known = before.iter().all(|b| b"STCN4n".contains(b))
        && after
            .first()
            .is_none_or(|b| b.is_ascii_digit() || *b == b'#');
    known.then_some((before, after))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8], name: &str) -> Result<Format> {
        let path = Path::new(name);
        sniff(bytes, path, &extension_of_content(path))
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
    fn formats_of_scanners_are_told_by_their_first_bytes() {
        for (bytes, name, format) in [
            (b"OFF\n3 1 0\n".as_slice(), "a.txt", Format::Off),
            (b"\t OFF8 6 12", "a.off", Format::Off),
            (b"# c\nSTCN4OFF 3 1 0", "a", Format::Off),
            (b"3 1 0\n0 0 0", "a.off", Format::Off),
            (b"# .PCD v.7\nVERSION .7", "a", Format::Pcd),
            (b"VERSION .5\nFIELDS x y z", "a.txt", Format::Pcd),
            (b"ASTM-E57\0", "a.e57", Format::E57),
            (b"LASF", "a.las", Format::Las),
            (b"# vtk DataFile Version 3.0", "a.txt", Format::Vtk),
            (b"<?xml?>\n<VTKFile type", "a", Format::Vtp),
            (b"\xef\xbb\xbf<VTKFile type", "a", Format::Vtp),
            (b"\x93NUMPY", "a.npy", Format::Npy),
            (
                b"2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n",
                "a.txt",
                Format::Ptx,
            ),
            (b"2\n2\n0 0 0\n", "a.ptx", Format::Ptx),
            (b"1 2 3\n", "a.xyz.gz", Format::Text),
            (b"1 2 3\n", "a.off.gz", Format::Off),
        ] {
            assert_eq!(of(bytes, name).unwrap(), format, "{name}");
        }
    }

    #[test]
    fn what_is_not_read_is_named() {
        for (bytes, name, word) in [
            (b"\x1f\x8b\x08".as_slice(), "a.xyz.gz", "gzip"),
            (b"<?xml version", "a.3mf", "XML"),
        ] {
            let message = of(bytes, name).unwrap_err();
            assert!(matches!(message, Error::Unsupported(_)), "{message}");
            let message = message.to_string();
            assert!(
                message.contains(word) && message.contains("XYZ"),
                "{message}"
            );
        }
        for text in ["ISO-10303-21;".to_owned(), format!("{:72}S      1", "")] {
            let message = of(text.as_bytes(), "a.txt").unwrap_err().to_string();
            assert_eq!(
                message,
                "a.txt is a CAD file, not a scan: use `check`, `deviation` or `convert`"
            );
        }
        assert!(matches!(of(b"", "a.ply"), Err(Error::Read { .. })));
        for (bytes, name) in [
            (b"plx\n".as_slice(), "a.ply"),
            (b"LAZF", "a.laz"),
            (b"hello", "a.npy"),
        ] {
            assert!(matches!(of(bytes, name), Err(Error::Read { .. })));
        }
        assert!(matches!(
            of(b"ab\0\0\x01cd", "a.dat"),
            Err(Error::Read { .. })
        ));
    }
}
