//! Small files as scanners write them.

use nurbskin::DVec3;
use std::io::{Cursor, Write};

/// Points of a wavy 5 x 4 grid, u fastest, far from each other's places.
pub(super) fn wave() -> Vec<DVec3> {
    (0..20)
        .map(|k| {
            let [i, j] = [f64::from(k % 5), f64::from(k / 5)];
            DVec3::new(10.0 + i, 20.0 + 0.5 * j, 300.0 + 0.25 * i * j)
        })
        .collect()
}

/// A PCD file with a field between, x in 64 bits, z as whole quarters, and normals.
pub(super) fn pcd(points: &[DVec3], width: usize, height: usize, data: &str) -> Vec<u8> {
    let count = points.len();
    let mut file = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS label x y z normal_x normal_y normal_z\n\
         SIZE 2 8 4 8 4 4 4\nTYPE U F F F F F F\nCOUNT 3 1 1 1 1 1 1\nWIDTH {width}\nHEIGHT {height}\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {data}\n"
    )
    .into_bytes();
    let record = |p: &DVec3| -> Vec<Vec<u8>> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the numbers of the tests fit"
        )]
        let y = p.y as f32;
        vec![
            vec![7; 6],
            p.x.to_le_bytes().to_vec(),
            y.to_le_bytes().to_vec(),
            p.z.to_le_bytes().to_vec(),
            0_f32.to_le_bytes().to_vec(),
            0_f32.to_le_bytes().to_vec(),
            1_f32.to_le_bytes().to_vec(),
        ]
    };
    match data {
        "ascii" => {
            for p in points {
                file.extend(format!("1 2 3 {} {} {} 0 0 1\n", p.x, p.y, p.z).bytes());
            }
        }
        "binary" => file.extend(points.iter().flat_map(record).flatten()),
        _ => {
            let records: Vec<_> = points.iter().map(record).collect();
            let columns: Vec<u8> = (0..7)
                .flat_map(|field| records.iter().flat_map(move |r| r[field].clone()))
                .collect();
            // Literal runs only, which every reader must take.
            let mut packed = Vec::new();
            for run in columns.chunks(32) {
                packed.push(u8::try_from(run.len() - 1).unwrap());
                packed.extend(run);
            }
            for size in [packed.len(), columns.len()] {
                file.extend(u32::try_from(size).unwrap().to_le_bytes());
            }
            file.extend(packed);
        }
    }
    file
}

/// A PTX scan: `points` are its cells, rows fastest, before the quarter turn about z and the move by `place`.
pub(super) fn ptx(points: &[DVec3], columns: usize, rows: usize, place: DVec3) -> String {
    let [x, y, z] = place.to_array();
    let mut text = format!(
        "{columns}\n{rows}\n{x} {y} {z}\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n{x} {y} {z} 1\n"
    );
    for p in points {
        text += &format!("{} {} {} 0.5 10 20 30\n", p.x, p.y, p.z);
    }
    text
}

/// A `NumPy` array of this type, order and shape from its numbers in the order of the file.
pub(super) fn npy(descr: &str, fortran: bool, shape: &str, numbers: &[f64]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 > 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\0".to_vec();
    file.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    file.extend(header.bytes());
    for &value in numbers {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the numbers of the tests fit"
        )]
        match descr {
            "<f8" => file.extend(value.to_le_bytes()),
            ">f8" => file.extend(value.to_be_bytes()),
            "<f4" => file.extend((value as f32).to_le_bytes()),
            ">f4" => file.extend((value as f32).to_be_bytes()),
            _ => file.extend((value as i16).to_be_bytes()),
        }
    }
    file
}

/// An E57 file with a scan for each list of points, whose pose is a quarter turn about z and the move by `place`. The
/// last two numbers of a point are its column and row; invalid is what has a negative z.
pub(super) fn e57(scans: &[Vec<(DVec3, [i64; 2])>], place: DVec3, spherical: bool) -> Vec<u8> {
    use e57::{
        E57Writer, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
        Translation,
    };
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file").unwrap();
    let double = || RecordDataType::Double {
        min: None,
        max: None,
    };
    let names = if spherical {
        [
            RecordName::SphericalRange,
            RecordName::SphericalAzimuth,
            RecordName::SphericalElevation,
            RecordName::SphericalInvalidState,
        ]
    } else {
        [
            RecordName::CartesianX,
            RecordName::CartesianY,
            RecordName::CartesianZ,
            RecordName::CartesianInvalidState,
        ]
    };
    let [a, b, c, state] = names;
    let record = |name, data_type| Record { name, data_type };
    for (k, points) in scans.iter().enumerate() {
        let prototype = vec![
            record(a.clone(), double()),
            record(b.clone(), double()),
            record(c.clone(), double()),
            record(state.clone(), RecordDataType::Integer { min: 0, max: 2 }),
            record(
                RecordName::ColumnIndex,
                RecordDataType::Integer { min: 0, max: 999 },
            ),
            record(
                RecordName::RowIndex,
                RecordDataType::Integer { min: 0, max: 999 },
            ),
        ];
        let mut cloud = writer
            .add_pointcloud(&format!("scan {k}"), prototype)
            .unwrap();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        cloud.set_transform(Some(Transform {
            rotation: Quaternion {
                w: half,
                x: 0.0,
                y: 0.0,
                z: half,
            },
            translation: Translation {
                x: place.x,
                y: place.y,
                z: place.z,
            },
        }));
        for &(p, [column, row]) in points {
            let [a, b, c] = if spherical {
                [p.length(), p.y.atan2(p.x), (p.z / p.length()).asin()]
            } else {
                p.to_array()
            };
            let invalid = if p.z < 0.0 { 2 } else { 0 };
            let mut values = vec![
                RecordValue::Double(a),
                RecordValue::Double(b),
                RecordValue::Double(c),
            ];
            values.extend([invalid, column, row].map(RecordValue::Integer));
            cloud.add_point(values).unwrap();
        }
        cloud.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

/// An E57 file of one scan with normals, turned by a quarter about z.
pub(super) fn e57_with_normals(points: &[DVec3], normal: DVec3) -> Vec<u8> {
    use e57::{
        E57Writer, Extension, Quaternion, Record, RecordDataType, RecordName, RecordValue,
        Transform, Translation,
    };
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file").unwrap();
    let url = "http://www.libe57.org/E57_NOR_surface_normals.txt";
    writer
        .register_extension(Extension::new("nor", url))
        .unwrap();
    let of_normal = |name: &str| RecordName::Unknown {
        namespace: "nor".into(),
        name: name.into(),
    };
    let names = [
        RecordName::CartesianX,
        RecordName::CartesianY,
        RecordName::CartesianZ,
        of_normal("normalX"),
        of_normal("normalY"),
        of_normal("normalZ"),
    ];
    let record = |name| Record {
        name,
        data_type: RecordDataType::Double {
            min: None,
            max: None,
        },
    };
    let prototype = names.map(record).to_vec();
    let mut cloud = writer.add_pointcloud("scan", prototype).unwrap();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    cloud.set_transform(Some(Transform {
        rotation: Quaternion {
            w: half,
            x: 0.0,
            y: 0.0,
            z: half,
        },
        translation: Translation {
            x: 1.0,
            y: 2.0,
            z: 3.0,
        },
    }));
    for p in points {
        let values = p.to_array().into_iter().chain(normal.to_array());
        cloud
            .add_point(values.map(RecordValue::Double).collect())
            .unwrap();
    }
    cloud.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

/// A LAS file, or LAZ, of this point format.
pub(super) fn las(points: &[DVec3], format: u8, compressed: bool, offset: DVec3) -> Vec<u8> {
    let minor = if format >= 6 { 4 } else { 2 };
    let mut builder = las::Builder::from((1, minor));
    builder.point_format = las::point::Format::new(format).unwrap();
    builder.point_format.is_compressed = compressed;
    let axis = |offset| las::Transform {
        scale: 0.001,
        offset,
    };
    builder.transforms = las::Vector {
        x: axis(offset.x),
        y: axis(offset.y),
        z: axis(offset.z),
    };
    let header = builder.into_header().unwrap();
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), header).unwrap();
    for p in points {
        let has_color = matches!(format, 2 | 3 | 5 | 7 | 8 | 10);
        let has_time = !matches!(format, 0 | 2);
        writer
            .write_point(las::Point {
                x: p.x,
                y: p.y,
                z: p.z,
                color: has_color.then(|| las::Color::new(1, 2, 3)),
                gps_time: has_time.then_some(7.0),
                nir: (format == 8).then_some(4),
                ..las::Point::default()
            })
            .unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

pub(super) fn gzip(content: &[u8]) -> Vec<u8> {
    let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    writer.write_all(content).unwrap();
    writer.finish().unwrap()
}
