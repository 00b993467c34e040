//! Scans as bytes, for other processes.

use super::Scan;
use crate::binary as stored;
use nurbskin_geometry::Result;

/// What the bytes say they are.
const KIND: &str = "scan";

impl Scan {
    /// All of the scan, as bytes of `MessagePack` from which [`from_bytes`](Self::from_bytes) of the same version of the
    /// library makes an equal one; every float keeps its bits.
    ///
    /// # Errors
    /// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if `MessagePack` cannot hold it.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        stored::to_bytes(KIND, self)
    }

    /// The scan that [`to_bytes`](Self::to_bytes) stored.
    ///
    /// # Errors
    /// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the bytes are not a scan, were written by another version of the library, or are damaged so
    /// that they name points that do not exist.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let scan: Self = stored::from_bytes(KIND, bytes)?;
        scan.validate()?;
        Ok(scan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GridLayout, Organisation, Records, Viewpoint};
    use glam::DVec3;
    use nurbskin_geometry::Unit;
    use nurbskin_geometry::unit::UnitSource;

    fn scan(organisation: Organisation) -> Scan {
        let points: Vec<DVec3> = (0..6)
            .map(|k| DVec3::new(f64::from(k) / 3.0, -0.0, f64::INFINITY))
            .collect();
        Scan {
            normals: Some(vec![DVec3::X; 6]),
            points,
            records: Records::new(vec![0, 1, 2, 4, 5, 9], 11).unwrap(),
            origin: DVec3::splat(1e6 / 3.0),
            viewpoints: vec![Viewpoint {
                first: 2,
                place: DVec3::Y,
            }],
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
            assert!(Scan::from_bytes(&scan.to_bytes().unwrap()).is_err());
            scan.records = Records::default();
            let read = Scan::from_bytes(&scan.to_bytes().unwrap());
            assert_eq!(read.is_ok(), scan.organisation == Organisation::Unordered);
        }
    }
}
