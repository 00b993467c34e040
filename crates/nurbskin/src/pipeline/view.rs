//! HTML page of a scan or a CAD file, without a fit or a comparison.
//!
//! The verb reads the file and writes a page with the view of the report in [`crate::report`]. Without an output it
//! writes to the folder for temporary files.

use super::info::{Information, information_of_cad, information_of_scan};
use super::output::{check_all, described, write_page};
use super::page::{json_of, name_of};
use super::{Output, Target, about, refuse_pointless};
use crate::deviation::measure::Unused;
use crate::report::{Kind, Measured, Source, Subject, document, page};
use glam::DVec3;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::{CleanScan, Organisation, Scan};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Digits of the hash in the name of a page.
const DIGITS: usize = 12;

/// A written page.
#[derive(Clone, Debug, Serialize)]
pub struct Viewed {
    /// The displayed file.
    pub input: Information,
    /// The page.
    pub output: Output,
}

/// Extensions of pages.
pub const PAGE_FORMATS: [&str; 2] = ["html", "htm"];

/// Writes a page of the scan or CAD file at `path` to `output`. Without an `output` the page goes to the system's
/// folder for temporary files, under a name formed from the file name and the hash of its content. The page shows
/// `command`.
///
/// # Errors
/// Errors of reader and writer; [`Error::Cancelled`].
pub fn view(
    path: &Path,
    output: Option<&Path>,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<Viewed> {
    view_from(&super::Source::file(path), output, command, progress)
}

/// As [`view`], for a file or for bytes.
///
/// # Errors
/// As [`view`].
pub fn view_from(
    source: &super::Source,
    output: Option<&Path>,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<Viewed> {
    let path = source.path();
    let page = Target::files(output.map(Path::to_owned).as_slice());
    check_all(&[source], &page, &PAGE_FORMATS)?;
    progress.stage("read", None);
    let (input, made) = if source.is_cad() {
        of_cad(source, command, progress)
    } else {
        of_scan(source, command, progress)
    }
    .map_err(|error| about(path, error))?;
    let Made { hash, page } = made;
    progress.stage("write", None);
    progress.check()?;
    let to = match output {
        Some(output) => output.to_owned(),
        None => temporary(path, &hash)?,
    };
    write_page(&to, &page, progress)?;
    Ok(Viewed {
        input,
        output: described(&to, "html")?,
    })
}

/// A page, and the hash of the content that it shows.
struct Made {
    hash: String,
    page: String,
}

impl Made {
    /// The hash of the file, or, where there is none, of the page itself.
    fn new(source: Option<Source>, page: String) -> Self {
        let path = Path::new("page");
        let source = source.unwrap_or_else(|| Source::of_bytes(path, page.as_bytes()));
        Self {
            hash: source.sha256,
            page,
        }
    }
}

fn of_cad(
    from: &super::Source,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<(Information, Made)> {
    let path = from.path();
    let file = from.read_cad()?;
    progress.check()?;
    let model = file.model.clone();
    let information = information_of_cad(file, path)?;
    progress.stage("page", None);
    let source = from.identity()?;
    let subject = Subject {
        kind: Kind::View,
        title: &name_of(path),
        command,
        heading: None,
        date: None,
        inputs: source.as_slice(),
        outcome: &json_of(&information)?,
        unit: model.unit,
        model: Some(&model),
        kinds: None,
        scan: None,
        triangles: None,
        origin: DVec3::ZERO,
    };
    let page = page(&document(&subject, progress)?)?;
    Ok((information, Made::new(source, page)))
}

fn of_scan(
    from: &super::Source,
    command: Option<&str>,
    progress: &dyn Progress,
) -> Result<(Information, Made)> {
    let path = from.path();
    let mut scan = from.read_scan()?;
    refuse_pointless(&scan)?;
    progress.check()?;
    let (information, cleaned) = information_of_scan(&mut scan, path, progress)?;
    progress.stage("page", None);
    let source = from.identity()?;
    let shown = Shown::new(&scan, cleaned);
    let subject = Subject {
        kind: Kind::View,
        title: &name_of(path),
        command,
        heading: None,
        date: None,
        inputs: source.as_slice(),
        outcome: &json_of(&information)?,
        unit: scan.unit,
        model: None,
        kinds: None,
        scan: Some(Measured {
            points: &shown.points,
            indices: &shown.indices,
            unused: &shown.unused,
            records: Some(&scan.records),
            spacing: shown.spacing,
            ..Measured::default()
        }),
        triangles: Some(&shown.triangles),
        origin: scan.origin,
    };
    let page = page(&document(&subject, progress)?)?;
    Ok((information, Made::new(source, page)))
}

/// The displayable points and triangles of a scan.
#[derive(Default)]
struct Shown {
    points: Vec<DVec3>,
    indices: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    unused: Vec<Unused>,
    spacing: f64,
}

impl Shown {
    /// The cleaned scan, or the original points if they form no surface.
    fn new(scan: &Scan, cleaned: Option<CleanScan>) -> Self {
        let Some(cleaned) = cleaned else {
            let triangles = match &scan.organisation {
                Organisation::Mesh(triangles) => triangles.clone(),
                _ => Vec::new(),
            };
            // Triangles refer to points by index, so all points stay.
            let shown = |p: &DVec3| p.is_finite() || !triangles.is_empty();
            let numbered = (0_u32..).zip(&scan.points).filter(|(_, p)| shown(p));
            let (indices, points) = numbered.map(|(k, &p)| (k, p)).unzip();
            return Self {
                points,
                indices,
                triangles,
                ..Self::default()
            };
        };
        let of = |rejected: &nurbskin_scan::Rejected| {
            Some(Unused {
                index: u32::try_from(rejected.index).ok()?,
                point: *scan.points.get(rejected.index)?,
                reason: rejected.reason,
                deviation: None,
            })
        };
        let mut unused: Vec<Unused> = cleaned.rejected.iter().filter_map(of).collect();
        unused.sort_by_key(|point| point.index);
        Self {
            unused,
            points: cleaned.points,
            indices: cleaned.used,
            triangles: cleaned.triangles,
            spacing: cleaned.spacing,
        }
    }
}

/// Default output for the page of a file.
fn temporary(path: &Path, hash: &str) -> Result<PathBuf> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    // A name that is valid on every system.
    let plain = |c: char| {
        if c.is_alphanumeric() || "-_.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let stem: String = stem.chars().take(60).map(plain).collect();
    let hash = hash.get(..DIGITS).unwrap_or_default();
    let to = std::env::temp_dir().join(format!("nurbskin-{stem}-{hash}.html"));
    // Other users may write to this folder, too.
    if to.is_symlink() {
        return Err(Error::write(
            &to,
            "there is a symbolic link of this name; say where the page shall go",
        ));
    }
    Ok(to)
}
