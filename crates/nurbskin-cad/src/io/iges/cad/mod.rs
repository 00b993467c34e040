//! Reading the faces of an IGES file: every entity by the pointers that lead to it, once.
//!
//! | module | knows |
//! |---|---|
//! | `entity` | entities by pointer: each parsed once, circles and repetition refused |
//! | `curves`, `conic_arc`, `spline` | 100, 102, 104, 106, 110, 112, 126 |
//! | `surfaces` | 108, 114, 118, 120, 122, 128, 190, 192, 194, 196, 198 |
//! | `carrier` | surfaces without ends, cut to what lies on them |
//! | `trimmed`, `sheet` | 141, 142, 143, 144: faces that stand alone |
//! | `joints` | which of their curves meet or coincide |
//! | `brep` | 186, 502 to 514: faces that share edges |
//! | `structure` | what is a face of its own; 308, 408 subfigures, 402 groups |
//! | `attributes` | 314 colours, 406 names |

mod attributes;
mod brep;
mod carrier;
mod conic_arc;
mod curves;
mod entity;
mod joints;
mod lift;
mod sheet;
mod spline;
mod structure;
mod surfaces;
mod trimmed;

use super::store::Store;
use super::transform::Place;
use crate::io::file::{CadFile, CadHeader};
use crate::{Model, Shell, ShellKind};
use entity::Reader;
use nurbskin_geometry::unit::UnitSource;
use nurbskin_geometry::{Error, Result};
use std::path::Path;

/// Reads the faces of an IGES file in its fixed-length ASCII form, versions up to 5.3. `path` is for messages only.
///
/// Read are surfaces (128, 114, 118, 120, 122, 108, 190 to 198), alone, trimmed (144, 143) or in a boundary
/// representation (186, 514, 510), with the curves around them (126, 112, 110, 106, 104, 102, 100), transformations,
/// subfigures, colours and names. All surfaces become exact NURBS; a ruled surface by arc length (118 of form 0) is
/// ruled by parameters. Each face that stands alone has edges of its own. Time and memory are bound by the size of the
/// file, whatever it says.
///
/// # Errors
/// [`Error::Read`] that names the line and its card (as in `line 45 (P12)`), what is wrong and what to do: for a file
/// that is not IGES, compressed or binary, cut short, or whose counts, pointers or numbers contradict each other.
/// Entities that are sound but of another type, and faces that cannot be put together, are no error: they are counted
/// in [`CadFile::unread`], the latter with a warning.
pub fn read_cad(bytes: impl AsRef<[u8]>, path: impl AsRef<Path>) -> Result<CadFile> {
    let (bytes, path) = (bytes.as_ref(), path.as_ref());
    let mut file = CadFile {
        format: "iges",
        ..CadFile::default()
    };
    let store = Store::open(bytes, path, &mut file.warnings)?;
    file.model = Model::new(store.global.product.trim());
    file.model.unit = store.global.unit;
    if store.global.unit_given {
        file.unit_source = UnitSource::File;
    }
    file.header = CadHeader {
        author: store.global.author.clone(),
        organization: store.global.organization.clone(),
        system: store.global.system.clone(),
        date: iso_date(&store.global.date),
    };
    for entry in &store.entries {
        *file.entities.entry(entry.entity.to_string()).or_default() += 1;
    }
    Reader::new(store, file, bytes.len()).read()
}

/// A date of IGES, `YYMMDD.HHNNSS` or `YYYYMMDD.HHNNSS`, as STEP writes it; as it is where it is another.
fn iso_date(date: &str) -> String {
    let date = date.trim();
    let (day, time) = date.split_once('.').unwrap_or((date, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(day) || !digits(time) || !matches!(day.len(), 6 | 8) || !matches!(time.len(), 0 | 6)
    {
        return date.to_owned();
    }
    // IGES is of 1980: of two digits, as some systems still write them, small ones are of this century.
    let (year, rest) = day.split_at(day.len() - 4);
    let century = match year.len() {
        2 if year < "80" => "20",
        2 => "19",
        _ => "",
    };
    let (month, day) = rest.split_at(2);
    let mut iso = format!("{century}{year}-{month}-{day}");
    if time.len() == 6 {
        iso += &format!("T{}:{}:{}", &time[..2], &time[2..4], &time[4..]);
    }
    iso
}

#[cfg(test)]
mod date_tests {
    #[test]
    fn dates_are_those_of_iso_8601() {
        for (given, wanted) in [
            ("20260616.222820", "2026-06-16T22:28:20"),
            ("980305.114724", "1998-03-05T11:47:24"),
            ("070129.105434", "2007-01-29T10:54:34"),
            ("19991231", "1999-12-31"),
            (" Mar 31 2006 ", "Mar 31 2006"),
            ("", ""),
        ] {
            assert_eq!(super::iso_date(given), wanted);
        }
    }
}

/// Why something was not made.
#[derive(Debug)]
enum Miss {
    /// The file is damaged.
    Refuse(Error),
    /// This cannot be read, for a reason that ends a sentence.
    Leave(String),
}

impl From<Error> for Miss {
    fn from(error: Error) -> Self {
        match error {
            Error::Read { .. } => Miss::Refuse(error),
            other => Miss::Leave(other.to_string()),
        }
    }
}

type Got<T> = std::result::Result<T, Miss>;

fn leave<T>(what: impl Into<String>) -> Got<T> {
    Err(Miss::Leave(what.into()))
}

/// An open shell of the faces that stand alone, or a closed one where a single face closes.
fn shell_of_loose(model: &mut Model, loose: Vec<usize>) -> Result<()> {
    if loose.is_empty() {
        return Ok(());
    }
    let kind = match loose[..] {
        [one] if model.is_closed(&[one]) => ShellKind::Closed,
        _ => ShellKind::Open,
    };
    model.add_shell(Shell { faces: loose, kind }).map(drop)
}
