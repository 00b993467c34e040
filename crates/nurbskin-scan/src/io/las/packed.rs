//! Points compressed with `LASzip`.

use super::super::bytes::{u16_at, u32_at, u64_at};
use super::coordinates;
use super::guard::quietly;
use super::header::Header;
use laz::laszip::ChunkTable;
use laz::{DecompressionSelection, LasZipDecompressor, LazVlr};
use nurbskin_geometry::{Error, Result};
use std::io::{Cursor, Seek, SeekFrom};
use std::path::Path;

/// No more points than this for a byte: the ones of a scanner take several bytes each.
const MOST: u64 = 8;
/// Chunks of any number of points.
const VARIABLE: u32 = u32::MAX;

/// The whole numbers of all points.
///
/// `laz` trusts the sizes of items, the number of chunks and the sizes of layers: they are compared with the file
/// before it sees them.
pub(super) fn unpack(bytes: Vec<u8>, header: &Header, path: &Path) -> Result<Vec<[i32; 3]>> {
    let damaged = |what: String| {
        let what = format!("{what}; copy or export the file again");
        Error::read(path, format!("byte {}", header.start), what)
    };
    let record = header
        .record(&bytes, b"laszip encoded", 22204)
        .ok_or_else(|| {
            damaged("the record that says how the points are compressed is missing".to_owned())
        })?;
    let layout = Layout::of(record, header)
        .map_err(|what| Error::Unsupported(format!("{}: {what}", path.display())))?;
    let vlr = LazVlr::read_from(record).map_err(|e| damaged(format!("{e}")))?;
    if header.count > MOST.saturating_mul(bytes.len() as u64) {
        return Err(damaged(format!(
            "{} points are announced in {} bytes: the count is wrong",
            header.count,
            bytes.len()
        )));
    }
    if header.count == 0 {
        return Ok(Vec::new());
    }
    let chunks = chunks(&bytes, header, &layout, &vlr).map_err(damaged)?;
    if layout.layered {
        check_layers(&bytes, header, &layout, &chunks).map_err(damaged)?;
    }
    let ended = |k: usize, e: &dyn std::fmt::Display| {
        let what = format!(
            "the compressed points end or are damaged here ({e}), but {} are announced; copy or export the file again",
            header.count
        );
        Error::read(path, format!("point {k}"), what)
    };
    let mut points = Vec::new();
    // Damage that it does not expect makes `laz` panic.
    let outcome = quietly(|| decompress(bytes, header, vlr, &mut points));
    match outcome {
        Some(Ok(())) => Ok(points),
        Some(Err(e)) => Err(ended(points.len(), &e)),
        None => Err(ended(points.len(), &"impossible codes")),
    }
}

/// Takes the whole numbers of all points.
fn decompress(
    bytes: Vec<u8>,
    header: &Header,
    vlr: LazVlr,
    points: &mut Vec<[i32; 3]>,
) -> laz::Result<()> {
    let mut source = Cursor::new(bytes);
    source.seek(SeekFrom::Start(header.start as u64))?;
    let coordinates_only = DecompressionSelection::base().decompress_z();
    let mut decompressor = LasZipDecompressor::selective(source, vlr, coordinates_only)?;
    let mut one = vec![0; header.record];
    for _ in 0..header.count {
        decompressor.decompress_one(&mut one)?;
        points.extend(coordinates(&one));
    }
    Ok(())
}

/// How the points are cut and compressed.
struct Layout {
    layered: bool,
    chunked: bool,
    chunk_size: u32,
    /// Layers of a chunk.
    layers: usize,
}

impl Layout {
    /// The layout, if `laz` can read it and its sizes are those of the header.
    fn of(record: &[u8], header: &Header) -> std::result::Result<Self, String> {
        let unknown = || "this compression of LAZ is not known; export the scan as LAS".to_owned();
        let field = |at: usize| u16_at(record, at).ok_or_else(unknown);
        let compressor = field(0)?;
        let items = usize::from(field(32)?);
        let mut total = 0;
        let mut layers = 0;
        let mut layered = false;
        for k in 0..items {
            let (kind, size, version) =
                (field(34 + 6 * k)?, field(36 + 6 * k)?, field(38 + 6 * k)?);
            // The size of the item and its layers; those of extra bytes have one for each byte.
            let (expected, layers_of_item) = match kind {
                0 => (size, 0),
                6 => (20, 0),
                7 => (8, 0),
                8 => (6, 0),
                9 => (29, 0),
                10 => (30, 9),
                11 => (6, 1),
                12 => (8, 2),
                13 => (29, 1),
                14 => (size, usize::from(size)),
                _ => return Err(unknown()),
            };
            let new = kind >= 10;
            let versions = if new { 3..=4 } else { 1..=2 };
            if k == 0 {
                layered = new;
            }
            let first = matches!(kind, 6 | 10);
            if size != expected
                || !versions.contains(&version)
                || first != (k == 0)
                || new != layered
            {
                return Err(unknown());
            }
            total += usize::from(size);
            layers += layers_of_item;
        }
        let fits = match compressor {
            1 | 2 => !layered,
            3 => layered,
            _ => false,
        };
        if !fits || total != header.record {
            return Err(unknown());
        }
        Ok(Self {
            layered,
            chunked: compressor != 1,
            chunk_size: u32_at(record, 12).map_or(VARIABLE, |n| if n == 0 { VARIABLE } else { n }),
            layers,
        })
    }
}

/// The points of each chunk where they are of different size; empty otherwise.
fn chunks(
    bytes: &[u8],
    header: &Header,
    layout: &Layout,
    vlr: &LazVlr,
) -> std::result::Result<Vec<u64>, String> {
    if !layout.chunked {
        return Ok(Vec::new());
    }
    // 1. The place of the table: at the start, or, where the writer could not go back, at the end.
    let start = header.start as u64;
    let place = |at: usize| u64_at(bytes, at).filter(|&at| at > start && at < 1 << 62);
    let table = place(header.start).or_else(|| place(bytes.len().checked_sub(8)?));
    let table = table.and_then(|at| usize::try_from(at).ok());
    // 2. Each chunk begins with a whole point.
    if let Some(count) = table.and_then(|at| u32_at(bytes, at.checked_add(4)?))
        && count as usize > bytes.len() / header.record + 1
    {
        return Err(format!(
            "{count} chunks are announced, which the file cannot hold"
        ));
    }
    if layout.chunk_size != VARIABLE {
        return Ok(Vec::new());
    }
    let mut source = Cursor::new(bytes);
    let read = source.seek(SeekFrom::Start(start)).ok();
    let table = read.and_then(|_| ChunkTable::read_from(&mut source, vlr).ok());
    let table = table.ok_or("the table of chunks is missing: the file is truncated")?;
    let counts: Vec<u64> = table
        .as_ref()
        .iter()
        .map(|chunk| chunk.point_count)
        .collect();
    let sum = counts.iter().try_fold(0_u64, |sum, &n| sum.checked_add(n));
    if sum.is_none_or(|sum| sum < header.count) || counts.contains(&0) {
        return Err(format!(
            "the table of chunks does not add up to the {} points announced",
            header.count
        ));
    }
    Ok(counts)
}

/// Whether the layers of all chunks lie within the file.
fn check_layers(
    bytes: &[u8],
    header: &Header,
    layout: &Layout,
    chunks: &[u64],
) -> std::result::Result<(), String> {
    let mut at = header.start + 8;
    let mut rest = header.count;
    let mut counts = chunks.iter();
    while rest > 0 {
        let points = match layout.chunk_size {
            VARIABLE => counts.next().copied().unwrap_or(rest),
            size => u64::from(size),
        };
        // A whole point, the number of points, the sizes of the layers, the layers.
        let sizes = at.saturating_add(header.record + 4);
        let mut end = sizes.saturating_add(4 * layout.layers);
        for k in 0..layout.layers {
            let size = u32_at(bytes, sizes.saturating_add(4 * k)).map(|n| n as usize);
            end = end.saturating_add(size.unwrap_or(usize::MAX));
        }
        if end > bytes.len() {
            return Err(format!(
                "the file ends within the chunk of points at byte {at}: it is truncated or damaged"
            ));
        }
        at = end;
        rest = rest.saturating_sub(points.max(1));
    }
    Ok(())
}
