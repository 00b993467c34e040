//! Scans as bytes, for other processes.

use super::{GridLayout, Organisation, Scan};
use crate::{Error, Result, stored};

/// What the bytes say they are.
const KIND: &str = "scan";

impl Scan {
    /// All of the scan, as bytes of `MessagePack` from which [`from_bytes`](Self::from_bytes) of the same version of the
    /// library makes an equal one; every float keeps its bits.
    ///
    /// # Errors
    /// [`Error::Invalid`] if `MessagePack` cannot hold it.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        stored::to_bytes(KIND, self)
    }

    /// The scan that [`to_bytes`](Self::to_bytes) stored.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the bytes are not a scan, were written by another version of the library, or are damaged so
    /// that they name points that do not exist.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let scan: Self = stored::from_bytes(KIND, bytes)?;
        let count = scan.points.len();
        let sound =
            scan.organisation.fits(count) && scan.normals.as_ref().is_none_or(|n| n.len() == count);
        if sound {
            Ok(scan)
        } else {
            Err(Error::invalid(
                "the stored scan orders other points than it has, or has not one normal per point",
            ))
        }
    }
}

impl Organisation {
    /// Whether it orders `count` points and names no other.
    fn fits(&self, count: usize) -> bool {
        let exists = |&point: &u32| (point as usize) < count;
        match self {
            Organisation::Unordered => true,
            Organisation::Rows(lengths) => {
                lengths
                    .iter()
                    .try_fold(0_usize, |sum, &n| sum.checked_add(n))
                    == Some(count)
            }
            Organisation::Grid(GridLayout {
                count_u,
                count_v,
                cells,
            }) => {
                count_u.checked_mul(*count_v) == Some(cells.len())
                    && cells.iter().flatten().all(exists)
            }
            Organisation::Mesh(triangles) => triangles.iter().flatten().all(exists),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Unit;
    use crate::unit::UnitSource;
    use glam::DVec3;

    fn scan(organisation: Organisation) -> Scan {
        let points: Vec<DVec3> = (0..6)
            .map(|k| DVec3::new(f64::from(k) / 3.0, -0.0, f64::INFINITY))
            .collect();
        Scan {
            normals: Some(vec![DVec3::X; 6]),
            points,
            origin: DVec3::splat(1e6 / 3.0),
            organisation,
            unit: Unit::Foot,
            unit_source: UnitSource::Option,
            format: "ply".into(),
            warnings: vec!["a doubt".into()],
        }
    }

    fn orders() -> [Organisation; 4] {
        let mut grid = GridLayout::complete(2, 3).unwrap();
        grid.cells[1] = None;
        [
            Organisation::Unordered,
            Organisation::Rows(vec![1, 5]),
            Organisation::Grid(grid),
            Organisation::Mesh(vec![[0, 1, 5]]),
        ]
    }

    #[test]
    fn scans_come_back() {
        for order in orders() {
            let scan = scan(order);
            let bytes = scan.to_bytes().unwrap();
            assert_eq!(Scan::from_bytes(&bytes).unwrap(), scan);
            for end in 0..bytes.len() {
                assert!(Scan::from_bytes(&bytes[..end]).is_err());
            }
        }
    }

    #[test]
    fn nan_keeps_its_bits() {
        let mut scan = scan(Organisation::Unordered);
        scan.points[3].y = f64::from_bits(f64::NAN.to_bits() | 77);
        let read = Scan::from_bytes(&scan.to_bytes().unwrap()).unwrap();
        assert_eq!(read.points[3].y.to_bits(), scan.points[3].y.to_bits());
    }

    #[test]
    fn orders_of_other_points_are_refused() {
        for order in orders() {
            let mut scan = scan(order);
            scan.points.truncate(3);
            assert!(Scan::from_bytes(&scan.to_bytes().unwrap()).is_err());
            scan.normals = None;
            let read = Scan::from_bytes(&scan.to_bytes().unwrap());
            assert_eq!(read.is_ok(), scan.organisation == Organisation::Unordered);
        }
    }
}
