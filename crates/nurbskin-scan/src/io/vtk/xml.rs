//! XML polydata.

use super::super::bytes::Number;
use super::arrays::{Budget, Storage, Stream, from_bytes, from_text};
use super::{AGAIN, Kind, Mesh, points_of};
use crate::Scan;
use nurbskin_geometry::{Error, Result};
use roxmltree::{Document, Node, ParsingOptions};
use std::path::Path;

/// No polydata has more elements: each takes memory of its own.
const MOST_NODES: u32 = 100_000;

/// Where the XML of a file ends that has its numbers behind it.
const APPENDED: &[u8] = b"<AppendedData";

/// Reads the content of a VTP file: points, polygons and strips of all pieces, and normals where all points have them.
///
/// # Errors
/// [`Error::Read`] naming the line; [`Error::Unsupported`] for other datasets and other compressors than zlib.
pub(in super::super) fn read(bytes: &[u8], path: &Path) -> Result<Scan> {
    let parts = split(bytes);
    let Ok(text) = std::str::from_utf8(&parts.head) else {
        let what = "the XML of the file is not UTF-8 text; save it as UTF-8";
        return Err(Error::read(path, "", what));
    };
    let options = ParsingOptions {
        nodes_limit: MOST_NODES,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options).map_err(|e| {
        let what =
            format!("the XML cannot be parsed ({e}): the file is truncated or damaged; {AGAIN}");
        Error::read(path, "", what)
    })?;
    let root = document.root_element();
    let mut reader = Reader {
        storage: storage(root).map_err(|what| unsupported(path, &what))?,
        appended: parts.appended,
        budget: Budget::of(bytes.len()),
        mesh: Mesh::default(),
    };
    let found = reader.pieces(root);
    found.map_err(|(node, what)| {
        let line = document.text_pos_at(node.range().start).row;
        Error::read(path, format!("line {line}"), what)
    })?;
    let mut scan = reader.mesh.into_scan(None);
    scan.format = "vtp".into();
    Ok(scan)
}

fn unsupported(path: &Path, what: &str) -> Error {
    Error::Unsupported(format!("{}: {what}", path.display()))
}

/// The XML of a file, and the numbers behind it.
struct Parts<'a> {
    head: std::borrow::Cow<'a, [u8]>,
    appended: Option<Appended<'a>>,
}

/// Numbers behind the XML.
#[derive(Clone, Copy)]
struct Appended<'a> {
    bytes: &'a [u8],
    base64: bool,
}

fn split(bytes: &[u8]) -> Parts<'_> {
    let whole = Parts {
        head: bytes.into(),
        appended: None,
    };
    let Some(at) = bytes.windows(APPENDED.len()).position(|w| w == APPENDED) else {
        return whole;
    };
    let (head, rest) = bytes.split_at(at);
    let Some(end) = rest.iter().position(|&b| b == b'>') else {
        return whole;
    };
    // The numbers begin after an underscore.
    let (tag, content) = rest.split_at(end + 1);
    let Some(content) = content.trim_ascii_start().strip_prefix(b"_") else {
        return whole;
    };
    let base64 = tag.windows(6).any(|w| w.eq_ignore_ascii_case(b"base64"));
    let close = content.iter().position(|&b| b == b'<');
    Parts {
        head: [head, b"</VTKFile>"].concat().into(),
        appended: Some(Appended {
            bytes: match close {
                Some(close) if base64 => &content[..close],
                _ => content,
            },
            base64,
        }),
    }
}

/// What the root element says.
fn storage(root: Node<'_, '_>) -> std::result::Result<Storage, String> {
    let kind = root.attribute("type").unwrap_or("unknown");
    if root.tag_name().name() != "VTKFile" || kind != "PolyData" {
        return Err(format!(
            "an XML file of the type {} is not a surface mesh: export VTK polydata (.vtp)",
            short(kind)
        ));
    }
    let compressor = root.attribute("compressor").unwrap_or_default();
    if !matches!(compressor, "" | "vtkZLibDataCompressor") {
        return Err(format!(
            "data compressed with {} are not read: save the file with zlib or without compression",
            short(compressor)
        ));
    }
    Ok(Storage {
        big_endian: root.attribute("byte_order") == Some("BigEndian"),
        wide: root.attribute("header_type") == Some("UInt64"),
        compressed: !compressor.is_empty(),
    })
}

/// A word of the file as it may stand in a message.
fn short(word: &str) -> String {
    super::super::lines::shown(word.as_bytes())
}

/// What is wrong, and where.
type Found<'a, 'i, T> = std::result::Result<T, (Node<'a, 'i>, String)>;

struct Reader<'b> {
    storage: Storage,
    appended: Option<Appended<'b>>,
    budget: Budget,
    mesh: Mesh,
}

impl Reader<'_> {
    fn pieces<'a, 'i>(&mut self, root: Node<'a, 'i>) -> Found<'a, 'i, ()> {
        let data = child(root, "PolyData")
            .ok_or_else(|| (root, format!("the element PolyData is missing; {AGAIN}")))?;
        let mut normals = Some(Vec::new());
        for piece in data.children().filter(|node| node.has_tag_name("Piece")) {
            let first = self.mesh.points.len();
            let points = child(piece, "Points").and_then(|points| child(points, "DataArray"));
            if let Some(points) = points {
                let values = self.array(points)?;
                if !values.len().is_multiple_of(3) {
                    let what = format!(
                        "{} numbers are no points: they come in threes",
                        values.len()
                    );
                    return Err((points, what));
                }
                self.mesh.points.extend(points_of(&values));
            }
            let count = self.mesh.points.len() - first;
            let announced = piece.attribute("NumberOfPoints").unwrap_or_default();
            if announced.trim().parse() != Ok(count) {
                let what = format!(
                    "{} points are announced, but there are {count}: the file is truncated or damaged; {AGAIN}",
                    short(announced)
                );
                return Err((piece, what));
            }
            for (name, kind) in [("Polys", Kind::Polygon), ("Strips", Kind::Strip)] {
                if let Some(cells) = child(piece, name) {
                    self.cells(cells, kind, first)?;
                }
            }
            for name in ["NumberOfVerts", "NumberOfLines"] {
                let thin = piece
                    .attribute(name)
                    .and_then(|n| n.trim().parse::<usize>().ok());
                self.mesh.thin = self.mesh.thin.saturating_add(thin.unwrap_or(0));
            }
            // A piece without points needs no normals.
            normals = match (normals, self.normals(piece)?) {
                (Some(mut all), Some(own)) if own.len() == count => {
                    all.extend(own);
                    Some(all)
                }
                (all, _) if count == 0 => all,
                _ => None,
            };
        }
        self.mesh.normals = normals.filter(|normals| !normals.is_empty());
        Ok(())
    }

    /// The normals of a piece's points, if it has them.
    fn normals<'a, 'i>(&mut self, piece: Node<'a, 'i>) -> Found<'a, 'i, Option<Vec<glam::DVec3>>> {
        let Some(data) = child(piece, "PointData") else {
            return Ok(None);
        };
        let name = data.attribute("Normals").unwrap_or("Normals");
        let named = |node: &Node<'_, '_>| {
            node.has_tag_name("DataArray")
                && node.attribute("Name") == Some(name)
                && node.attribute("NumberOfComponents") == Some("3")
        };
        match data.children().find(named) {
            Some(array) => Ok(Some(points_of(&self.array(array)?))),
            None => Ok(None),
        }
    }

    fn cells<'a, 'i>(
        &mut self,
        cells: Node<'a, 'i>,
        kind: Kind,
        first: usize,
    ) -> Found<'a, 'i, ()> {
        let named = |name: &str| {
            let mut arrays = cells
                .children()
                .filter(|node| node.has_tag_name("DataArray"));
            arrays.find(|node| node.attribute("Name") == Some(name))
        };
        let (Some(connectivity), Some(ends)) = (named("connectivity"), named("offsets")) else {
            return Ok(());
        };
        let corners = self.array(connectivity)?;
        // The file has the ends only.
        let mut offsets = vec![0.0];
        offsets.extend(self.array(ends)?);
        let added = self.mesh.cells(first, &offsets, &corners, |_| kind);
        added.map_err(|what| (cells, what))
    }

    /// The numbers of a `DataArray`.
    fn array<'a, 'i>(&mut self, node: Node<'a, 'i>) -> Found<'a, 'i, Vec<f64>> {
        self.values(node).map_err(|what| (node, what))
    }

    fn values(&mut self, node: Node<'_, '_>) -> std::result::Result<Vec<f64>, String> {
        let text = node.text().unwrap_or_default();
        let format = node.attribute("format").unwrap_or("ascii");
        if format == "ascii" {
            return from_text(text, &mut self.budget);
        }
        let kind = node.attribute("type").unwrap_or_default();
        let number = number_of(kind)
            .ok_or_else(|| format!("numbers of the type {} are not read", short(kind)))?;
        let mut stream = match (format, self.appended) {
            ("binary", _) if text.trim().is_empty() => return Ok(Vec::new()),
            ("binary", _) => Stream::Base64(text.as_bytes(), Vec::new()),
            ("appended", Some(appended)) => {
                let offset = node.attribute("offset").unwrap_or_default();
                let rest = offset.trim().parse().ok();
                let rest = rest.and_then(|at: usize| appended.bytes.get(at..));
                let Some(rest) = rest else {
                    return Err(format!(
                        "the offset {} is beyond the data of {} bytes: the file is truncated; {AGAIN}",
                        short(offset),
                        appended.bytes.len()
                    ));
                };
                if appended.base64 {
                    Stream::Base64(rest, Vec::new())
                } else {
                    Stream::Raw(rest)
                }
            }
            ("appended", None) => {
                return Err(format!(
                    "the appended data are missing: the file is truncated; {AGAIN}"
                ));
            }
            (other, _) => {
                return Err(format!(
                    "\"{}\" is not a format of an array: ascii, binary or appended is expected",
                    short(other)
                ));
            }
        };
        from_bytes(&mut stream, number, self.storage, &mut self.budget)
    }
}

/// The first child of this name.
fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The kind of numbers with a name such as `Float32`.
fn number_of(name: &str) -> Option<Number> {
    let digits = name.trim_start_matches(|c: char| c.is_ascii_alphabetic());
    let bits: usize = digits.parse().ok()?;
    let number = Number::of(*name.as_bytes().first()?, bits / 8);
    number.filter(|_| bits.is_multiple_of(8))
}
