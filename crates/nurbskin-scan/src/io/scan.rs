//! Reading a scan from a file and writing one, whatever the format.

use super::{far, grid, npy, obj, off, pcd, ply, ptx, stl, text, vtk};
use crate::{Organisation, Scan};
use nurbskin_geometry::files::sniff;
use nurbskin_geometry::files::sniff::Format;
use nurbskin_geometry::files::{self, atomic, gzip};
use nurbskin_geometry::unit::{Unit, UnitSource};
use nurbskin_geometry::{Error, Result};
use std::io::Write;
use std::path::Path;

/// The format of scans that come from no file.
pub const ARRAY: &str = "array";

/// Reads a scan: PLY, STL, OBJ, OFF, PCD, PTX, E57, LAS, LAZ, NPY, VTK, VTP or text (XYZ, ASC, TXT, CSV, PTS), told apart by
/// content first and extension second; any of them compressed with gzip, too.
///
/// Points stay in the order of the file; non-finite ones are kept for cleaning to count. Cells of a grid that only
/// say that there is no point (an empty list, NaN in all coordinates, no entry, `0 0 0` where the format means it) are
/// empty cells, and no points; [`Scan::records`] knows the records of the others. Assumptions made on the way (ignored
/// columns, a unit that the format implies, faces left out) are in [`Scan::warnings`]. Coordinates that are large against the extent are shifted exactly, see
/// [`Scan::origin`]. Time is linear in the size of the file, memory a small multiple of it, whatever its header claims.
///
/// # Errors
/// [`Error::Read`] with the line or record and what to do for a missing, empty, truncated or damaged file and for
/// counts that lie; [`Error::Unsupported`] for a known format that has no reader.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::io;
/// use nurbskin_scan::Organisation;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("two_lines.xyz");
/// std::fs::write(&path, "# unit mm\n0 0 0\n1 0 0\n\n0 1 0.5\n1 1 0.5\n")?;
/// let scan = io::read_scan(&path)?;
/// assert_eq!(scan.points[3], DVec3::new(1.0, 1.0, 0.5));
/// assert_eq!(scan.organisation, Organisation::Rows(vec![2, 2]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_scan(path: impl AsRef<Path>) -> Result<Scan> {
    let path = path.as_ref();
    read_bytes(files::read_file(path)?, path)
}

/// Reads a scan from bytes that come from no file, such as standard input. `name` is for messages. `format` is what the
/// extension of a file would be (`ply`, `xyz`, ...; see [`SCAN_INPUTS`]): content goes first, as with files, and decides
/// alone where there is none.
///
/// # Errors
/// As [`read_scan`], and [`Error::Invalid`] for a format that no scan has.
///
/// ```
/// let scan = nurbskin_scan::io::read_scan_from("standard input", b"0 0 0\n1 0 0\n0 1 0\n".to_vec(), Some("xyz"))?;
/// assert_eq!(scan.points.len(), 3);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
pub fn read_scan_from(name: &str, bytes: Vec<u8>, format: Option<&str>) -> Result<Scan> {
    let format = format.map(str::to_ascii_lowercase).unwrap_or_default();
    if !format.is_empty() && !SCAN_INPUTS.contains(&format.as_str()) {
        return Err(Error::invalid(format!(
            "no scan has the format {format}: use one of {}",
            SCAN_INPUTS.join(", ")
        )));
    }
    read_as(bytes, Path::new(name), &format)
}

/// Extensions of scans that can be read.
pub const SCAN_INPUTS: [&str; 17] = [
    "ply", "stl", "obj", "off", "xyz", "asc", "txt", "csv", "pts", "pcd", "ptx", "e57", "las",
    "laz", "npy", "vtk", "vtp",
];

/// Reads a scan from the content of a file, which `path` only names.
///
/// # Errors
/// As [`read_scan`].
pub fn read_bytes(bytes: Vec<u8>, path: &Path) -> Result<Scan> {
    read_as(bytes, path, &sniff::extension_of_content(path))
}

/// Reads a scan of this extension; `path` is for messages.
fn read_as(mut bytes: Vec<u8>, path: &Path, extension: &str) -> Result<Scan> {
    if gzip::is_gzip(&bytes) {
        bytes = gzip::inflate(&bytes, path)?;
    }
    let mut scan = match sniff::sniff(&bytes, path, extension)? {
        Format::Ply => ply::read(bytes, path),
        Format::StlText => stl::read_text(&bytes, path),
        Format::StlBinary => stl::read_binary(bytes, path),
        Format::Obj => obj::read(&bytes, path),
        Format::Off => off::read(&bytes, path),
        Format::Pcd => pcd::read(&bytes, path),
        Format::Ptx => ptx::read(&bytes, path),
        Format::Npy => npy::read(&bytes, path),
        Format::E57 => super::e57::read(bytes, path),
        Format::Las => super::las::read(bytes, path),
        Format::Vtk => vtk::read_legacy(&bytes, path),
        Format::Vtp => vtk::read_xml(&bytes, path),
        Format::Text => text::read(&bytes, path),
    }?;
    if u32::try_from(scan.points.len()).is_err() {
        return Err(Error::read(
            path,
            "",
            "more than 4294967295 points; split the scan",
        ));
    }
    if scan.organisation == Organisation::Mesh(Vec::new()) {
        scan.organisation = Organisation::Unordered;
    }
    far::shift(&mut scan);
    Ok(scan)
}

/// A scan that was made in memory, as it would be if it had been read: the cells of a complete grid whose coordinates are
/// all NaN are empty ones, and coordinates that are large against the extent are shifted exactly.
///
/// ```
/// use nurbskin_scan::{GridLayout, Organisation, Scan};
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::io;
/// let mut points: Vec<DVec3> = (0..6).map(|k| DVec3::new((k % 3) as f64, (k / 3) as f64, 0.0)).collect();
/// points[4] = DVec3::NAN;
/// let organisation = Organisation::Grid(GridLayout::complete(3, 2).unwrap_or_else(|| unreachable!()));
/// let scan = io::in_memory(Scan { points, organisation, ..Scan::default() })?;
/// assert_eq!(scan.points.len(), 5);
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] if the scan contradicts itself, or has more than 2^32 points.
pub fn in_memory(mut scan: Scan) -> Result<Scan> {
    scan.validate()?;
    scan.format = ARRAY.into();
    if u32::try_from(scan.points.len()).is_err() {
        return Err(Error::invalid(
            "more than 4294967295 points; split the scan",
        ));
    }
    if let Organisation::Grid(layout) = &scan.organisation
        && layout.empty() == 0
    {
        let (count_u, count_v) = (layout.count_u, layout.count_v);
        grid::organise(&mut scan, count_u, count_v, grid::Zero::Point);
    }
    far::shift(&mut scan);
    Ok(scan)
}

/// Writes a scan in the format of the extension: `.ply`, `.stl`, `.obj`, or text as `.xyz`, `.asc`, `.txt`, `.pts`
/// and `.csv`. Returns what the format could not hold, for the user.
///
/// PLY holds everything; the other formats hold coordinates to the last bit, too, but STL, which has 32-bit numbers.
/// The file is written whole or not at all.
///
/// # Errors
/// [`Error::Unsupported`] for another extension and for points without triangles as STL, [`Error::Invalid`] for a
/// scan that contradicts itself, [`Error::Write`] if the disk refuses.
pub fn write_scan(path: impl AsRef<Path>, scan: &Scan) -> Result<Vec<String>> {
    let path = path.as_ref();
    let format = sniff::extension(path);
    // What cannot be written is no reason to touch the disk.
    check_writable(path, &format, scan)?;
    atomic::write_whole(path, |out| fill(out, path, &format, scan))
}

/// Writes a scan to any writer; `format` is the extension that a file would have, and `name` is for messages. Returns
/// what the format could not hold. What was written before an error stays.
///
/// # Errors
/// As [`write_scan`].
pub fn write_scan_to(
    out: &mut dyn Write,
    name: &str,
    format: &str,
    scan: &Scan,
) -> Result<Vec<String>> {
    let (path, format) = (Path::new(name), format.to_ascii_lowercase());
    check_writable(path, &format, scan)?;
    fill(out, path, &format, scan)
}

/// Refuses a scan that contradicts itself or cannot be written in the format.
fn check_writable(path: &Path, format: &str, scan: &Scan) -> Result<()> {
    scan.validate()?;
    match format {
        "ply" | "xyz" | "asc" | "txt" | "pts" | "csv" | "obj" => Ok(()),
        "stl" => stl::triangles(scan).map(drop),
        other => Err(Error::Unsupported(format!(
            "{}: a scan cannot be written as \"{other}\"; use .ply, .xyz, .txt, .csv, .stl or .obj",
            path.display()
        ))),
    }
}

fn fill(out: &mut dyn Write, path: &Path, format: &str, scan: &Scan) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    let mut note = |what: &str| notes.push(format!("{}: {what}", path.display()));
    let mesh = matches!(scan.organisation, Organisation::Mesh(_));
    let ordered = matches!(
        scan.organisation,
        Organisation::Rows(_) | Organisation::Grid(_)
    );
    match format {
        "ply" => written(path, ply::write(out, scan))?,
        "obj" => {
            if ordered {
                note("OBJ files cannot hold rows: the order of the points is lost");
            }
            written(path, obj::write(out, scan))?;
        }
        "stl" => {
            if scan.normals.is_some() {
                note("STL files cannot hold normals of points: they are lost");
            }
            note("STL files hold 32-bit numbers: coordinates are rounded to about seven digits");
            written(path, stl::write(out, &stl::triangles(scan)?))?;
        }
        _ => {
            if mesh {
                note("text files hold points only: the triangles are lost");
            }
            let separator = if format == "csv" { ',' } else { ' ' };
            written(path, text::write(out, scan, separator))?;
        }
    }
    Ok(notes)
}

/// An input-output error in the user's words.
fn written(path: &Path, result: std::io::Result<()>) -> Result<()> {
    result.map_err(|e| Error::write(path, e.to_string()))
}

/// Takes the unit from a comment such as `unit mm` or `Units: millimeters`, unless one is known already.
pub(crate) fn take_unit(scan: &mut Scan, comment: &str) {
    if scan.unit_source == UnitSource::Assumed
        && let Some(unit) = unit_in(comment)
    {
        scan.unit = unit;
        scan.unit_source = UnitSource::File;
    }
}

/// The unit that a comment names after the word `unit` or `units`, at most three words later.
fn unit_in(comment: &str) -> Option<Unit> {
    let mut words = comment
        .split(|c: char| !c.is_alphanumeric())
        .filter(|word| !word.is_empty());
    words.find(|word| word.eq_ignore_ascii_case("unit") || word.eq_ignore_ascii_case("units"))?;
    let mut found = None;
    for word in words.take(3) {
        match unit_named(word) {
            // "units in mm": the inch was a preposition.
            Some(unit) if matches!(found, None | Some(Unit::Inch)) => found = Some(unit),
            _ if found.is_some() => break,
            _ => {}
        }
    }
    found
}

/// The unit of a symbol or an English name.
pub fn unit_named(word: &str) -> Option<Unit> {
    Unit::from_symbol(word).or_else(|| match word.to_ascii_lowercase().as_str() {
        "millimetre" | "millimetres" | "millimeter" | "millimeters" => Some(Unit::Millimetre),
        "centimetre" | "centimetres" | "centimeter" | "centimeters" => Some(Unit::Centimetre),
        "metre" | "metres" | "meter" | "meters" => Some(Unit::Metre),
        "micrometre" | "micrometres" | "micrometer" | "micrometers" | "micron" | "microns"
        | "µm" | "μm" => Some(Unit::Micrometre),
        "inch" | "inches" => Some(Unit::Inch),
        "foot" | "feet" => Some(Unit::Foot),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn units_are_found_in_comments() {
        for (comment, unit) in [
            ("unit mm", Some(Unit::Millimetre)),
            ("Units: Millimeters", Some(Unit::Millimetre)),
            ("units in mm", Some(Unit::Millimetre)),
            ("unit: in", Some(Unit::Inch)),
            ("File units = feet, right handed", Some(Unit::Foot)),
            ("lengths are in metres", None),
            ("a unit vector field of mine", None),
            ("unit", None),
        ] {
            assert_eq!(unit_in(comment), unit, "{comment}");
        }
    }

    #[test]
    fn contradictory_scans_are_not_written() {
        let folder = tempfile::tempdir().unwrap();
        let scan = Scan {
            points: vec![DVec3::ZERO; 3],
            organisation: Organisation::Rows(vec![2, 2]),
            ..Scan::default()
        };
        let path = folder.path().join("x.ply");
        assert!(matches!(write_scan(&path, &scan), Err(Error::Invalid(_))));
        assert!(!path.exists());
        let scan = Scan::default();
        let path = folder.path().join("x.doc");
        assert!(matches!(
            write_scan(path, &scan),
            Err(Error::Unsupported(_))
        ));
    }
}
