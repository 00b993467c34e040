//! The public header block and the records after it.

use super::super::bytes::{f64_at, u16_at, u32_at, u64_at};
use glam::DVec3;
use nurbskin_geometry::{Error, Result};
use std::ops::Range;
use std::path::Path;

/// What the header says.
#[derive(Debug)]
pub(super) struct Header {
    /// The first byte of the points.
    pub(super) start: usize,
    /// Bytes of a point.
    pub(super) record: usize,
    pub(super) count: u64,
    pub(super) compressed: bool,
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
    /// The variable length records: user, number, and where their data are.
    pub(super) records: Vec<(Vec<u8>, u16, Range<usize>)>,
}

/// Bytes of the header of a variable length record, and of an extended one.
const RECORD_HEADER: usize = 54;
const EXTENDED_HEADER: usize = 60;

impl Header {
    pub(super) fn of(bytes: &[u8], path: &Path) -> Result<Self> {
        let damaged = |at: usize, what: &str| {
            let what = format!("{what}; copy or export the file again");
            Error::read(path, format!("byte {at}"), what)
        };
        let ended = || damaged(bytes.len(), "the file ends in its header: it is truncated");
        let place = |at: usize| u32_at(bytes, at).and_then(|n| usize::try_from(n).ok());
        let size = usize::from(u16_at(bytes, 94).ok_or_else(ended)?);
        let start = place(96).ok_or_else(ended)?;
        let kind = *bytes.get(104).ok_or_else(ended)?;
        let record = usize::from(u16_at(bytes, 105).ok_or_else(ended)?);
        let minor = bytes.get(25).copied().unwrap_or(0);
        let vector = |at: usize| {
            let [x, y, z] = [
                f64_at(bytes, at)?,
                f64_at(bytes, at + 8)?,
                f64_at(bytes, at + 16)?,
            ];
            Some(DVec3::new(x, y, z))
        };
        let mut count = u64::from(u32_at(bytes, 107).ok_or_else(ended)?);
        let scale = vector(131).ok_or_else(ended)?;
        let offset = vector(155).ok_or_else(ended)?;
        if bytes.get(24) != Some(&1) || minor > 4 {
            let version = format!("{}.{minor}", bytes.get(24).copied().unwrap_or(0));
            return Err(damaged(24, &format!("LAS version {version} is unknown")));
        }
        // Version 1.4 counts in 64 bits, and often only there.
        if minor >= 4 && size >= 375 {
            count = u64_at(bytes, 247).ok_or_else(ended)?;
        }
        if start > bytes.len() || start < size || size < 227 {
            return Err(damaged(
                96,
                "the points should begin beyond the end of the file",
            ));
        }
        if record < 20 {
            return Err(damaged(
                105,
                "the size of a point is too small for its coordinates",
            ));
        }
        let good = |v: DVec3| v.is_finite() && v.x != 0.0 && v.y != 0.0 && v.z != 0.0;
        if !good(scale) || !offset.is_finite() {
            return Err(damaged(
                131,
                "the scale or the offset is not a usable number",
            ));
        }
        let mut header = Header {
            start,
            record,
            count,
            compressed: kind & 0xc0 != 0,
            scale,
            offset,
            records: Vec::new(),
        };
        header.find_records(bytes, size, minor);
        Ok(header)
    }

    /// Notes the records that are whole; the others say nothing of the points.
    fn find_records(&mut self, bytes: &[u8], size: usize, minor: u8) {
        let mut at = size;
        for _ in 0..u32_at(bytes, 100).unwrap_or(0) {
            let length = u16_at(bytes, at + 20).map(usize::from);
            let Some(next) = self.note(bytes, at, RECORD_HEADER, length) else {
                break;
            };
            at = next;
        }
        if minor >= 4 && size >= 375 {
            let place = |at: usize| u64_at(bytes, at).and_then(|n| usize::try_from(n).ok());
            let mut at = place(235).unwrap_or(0);
            for _ in 0..u32_at(bytes, 243).unwrap_or(0) {
                let length = at.checked_add(20).and_then(place);
                let Some(next) = self.note(bytes, at, EXTENDED_HEADER, length) else {
                    break;
                };
                at = next;
            }
        }
    }

    /// Notes the record at `at`; the place after it.
    fn note(
        &mut self,
        bytes: &[u8],
        at: usize,
        header: usize,
        length: Option<usize>,
    ) -> Option<usize> {
        let start = at.checked_add(header)?;
        let end = start.checked_add(length?)?;
        bytes.get(start..end)?;
        let user = bytes.get(at + 2..at + 18)?;
        let user = user.split(|&b| b == 0).next().unwrap_or_default().to_vec();
        self.records
            .push((user, u16_at(bytes, at + 18)?, start..end));
        Some(end)
    }

    /// The data of the record of this user and number.
    pub(super) fn record<'a>(&self, bytes: &'a [u8], user: &[u8], number: u16) -> Option<&'a [u8]> {
        let found = self
            .records
            .iter()
            .find(|(name, known, _)| name == user && *known == number);
        bytes.get(found?.2.clone())
    }
}
