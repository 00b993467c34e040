//! What every reader of scans must keep.

use nurbskin::io::scan::read_bytes;
use nurbskin::scan::Organisation;
use std::path::Path;

/// Reads the bytes as a file of this name.
pub fn read(bytes: &[u8], name: &str) {
    let Ok(scan) = read_bytes(bytes.to_vec(), Path::new(name)) else {
        return;
    };
    let count = scan.points.len();
    if let Some(normals) = &scan.normals {
        assert_eq!(normals.len(), count);
    }
    match &scan.organisation {
        Organisation::Unordered => {}
        Organisation::Rows(lengths) => assert_eq!(lengths.iter().sum::<usize>(), count),
        Organisation::Grid(layout) => {
            assert_eq!(layout.cells.len(), layout.count_u * layout.count_v);
            assert!(layout.cells.iter().flatten().all(|&k| (k as usize) < count));
        }
        Organisation::Mesh(triangles) => {
            assert!(triangles.iter().flatten().all(|&k| (k as usize) < count));
        }
    }
}
