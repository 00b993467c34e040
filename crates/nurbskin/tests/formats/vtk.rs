//! VTK, legacy and XML, in all its encodings; and what is wrong with them.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use nurbskin::io::read_scan;
use nurbskin::io::scan::read_bytes;
use nurbskin::scan::{Organisation, Scan};
use nurbskin::{DVec3, Result};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A square, and a triangle beside it.
const POINTS: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.5],
    [1.0, 0.0, 0.5],
    [1.0, 1.0, -0.25],
    [0.0, 1.0, 0.001_953_125],
    [2.0, 0.5, 7.0],
];
const CELLS: [&[u32]; 2] = [&[0, 1, 2, 3], &[1, 4, 2]];
const TRIANGLES: [[u32; 3]; 3] = [[0, 1, 2], [0, 2, 3], [1, 4, 2]];

fn of(content: impl AsRef<[u8]>) -> Result<Scan> {
    read_bytes(content.as_ref().to_vec(), Path::new("a.dat"))
}

fn points() -> Vec<DVec3> {
    POINTS.map(|p| DVec3::from(p.map(f64::from))).to_vec()
}

fn is_the_mesh(content: impl AsRef<[u8]>, what: &str) {
    let scan = of(content).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert_eq!(scan.points, points(), "{what}");
    let Organisation::Mesh(triangles) = &scan.organisation else {
        panic!("{what}: {:?}", scan.organisation);
    };
    assert_eq!(triangles, &TRIANGLES, "{what}");
    assert!(scan.warnings.is_empty(), "{what}: {:?}", scan.warnings);
}

fn refused(content: impl AsRef<[u8]>) -> String {
    match of(content) {
        Err(error) => error.to_string(),
        Ok(scan) => panic!("{} points, {:?}", scan.points.len(), scan.warnings),
    }
}

/// Numbers of a legacy file.
enum Numbers {
    F32(Vec<f32>),
    I32(Vec<i32>),
    I64(Vec<i64>),
}

/// A legacy file under construction.
struct Legacy {
    bytes: Vec<u8>,
    binary: bool,
}

impl Legacy {
    fn new(version: &str, binary: bool, dataset: &str) -> Self {
        let encoding = if binary { "BINARY" } else { "ASCII" };
        let head =
            format!("# vtk DataFile Version {version}\ntitle\n{encoding}\nDATASET {dataset}\n");
        Self {
            bytes: head.into_bytes(),
            binary,
        }
    }

    fn line(mut self, text: &str) -> Self {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(b'\n');
        self
    }

    fn numbers(mut self, numbers: &Numbers) -> Self {
        if self.binary {
            match numbers {
                Numbers::F32(all) => all.iter().for_each(|x| self.bytes.extend(x.to_be_bytes())),
                Numbers::I32(all) => all.iter().for_each(|x| self.bytes.extend(x.to_be_bytes())),
                Numbers::I64(all) => all.iter().for_each(|x| self.bytes.extend(x.to_be_bytes())),
            }
        } else {
            let text: Vec<String> = match numbers {
                Numbers::F32(all) => all.iter().map(ToString::to_string).collect(),
                Numbers::I32(all) => all.iter().map(ToString::to_string).collect(),
                Numbers::I64(all) => all.iter().map(ToString::to_string).collect(),
            };
            for (k, word) in text.iter().enumerate() {
                let end = if k % 4 == 3 { "\n" } else { " " };
                self.bytes
                    .extend_from_slice(format!("{word}{end}").as_bytes());
            }
        }
        self.bytes.push(b'\n');
        self
    }

    fn points(self) -> Self {
        self.line("POINTS 5 float")
            .numbers(&Numbers::F32(POINTS.concat()))
    }

    /// The cells as lists with their lengths, or as offsets and corners.
    fn cells(self, keyword: &str, modern: bool) -> Self {
        let corners = CELLS.concat();
        if modern {
            let ends = Numbers::I64(vec![0, 4, 7]);
            let corners = corners.iter().map(|&k| i64::from(k)).collect();
            return self
                .line(&format!("{keyword} 3 7\nOFFSETS vtktypeint64"))
                .numbers(&ends)
                .line("CONNECTIVITY vtktypeint64")
                .numbers(&Numbers::I64(corners));
        }
        let mut list = Vec::new();
        for cell in CELLS {
            list.push(i32::try_from(cell.len()).unwrap());
            list.extend(cell.iter().map(|&k| i32::try_from(k).unwrap()));
        }
        self.line(&format!("{keyword} 2 9"))
            .numbers(&Numbers::I32(list))
    }
}

/// The mesh as legacy files of all kinds.
fn legacy_files() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for (version, modern) in [
        ("2.0", false),
        ("3.0", false),
        ("4.2", false),
        ("5.1", true),
    ] {
        for binary in [false, true] {
            let name = format!("version {version}, binary {binary}");
            let poly = Legacy::new(version, binary, "POLYDATA").points();
            let poly = if modern {
                // As VTK 9 writes it.
                poly.line("METADATA\nINFORMATION 0\n")
            } else {
                poly
            };
            files.push((name.clone(), poly.cells("POLYGONS", modern).bytes));
            let cells = Legacy::new(version, binary, "UNSTRUCTURED_GRID")
                .points()
                .cells("CELLS", modern)
                .line("CELL_TYPES 2")
                .numbers(&Numbers::I32(vec![9, 5]));
            files.push((format!("unstructured, {name}"), cells.bytes));
        }
    }
    files
}

/// How a VTP file holds its arrays.
#[derive(Clone, Copy, Debug)]
enum Held {
    Text,
    Inline,
    AppendedRaw,
    AppendedBase64,
}

/// The mesh as a VTP file.
fn vtp(held: Held, wide: bool, compressed: bool, big_endian: bool) -> Vec<u8> {
    let put = |bytes: &mut Vec<u8>, x: u64| {
        let wide_bytes = if big_endian {
            x.to_be_bytes()
        } else {
            x.to_le_bytes()
        };
        match (wide, big_endian) {
            (true, _) => bytes.extend(wide_bytes),
            (false, true) => bytes.extend(&wide_bytes[4..]),
            (false, false) => bytes.extend(&wide_bytes[..4]),
        }
    };
    // The parts that are encoded one by one: the lengths, and the data.
    let parts = |raw: &[u8]| -> [Vec<u8>; 2] {
        let mut head = Vec::new();
        if !compressed {
            put(&mut head, raw.len() as u64);
            return [head, raw.to_vec()];
        }
        // Two blocks, of which the last is shorter.
        let full = raw.len() / 2 + 1;
        let blocks = raw.chunks(full).map(|block| {
            let mut packed = ZlibEncoder::new(Vec::new(), Compression::default());
            packed.write_all(block).unwrap();
            packed.finish().unwrap()
        });
        let blocks: Vec<Vec<u8>> = blocks.collect();
        put(&mut head, blocks.len() as u64);
        put(&mut head, full as u64);
        put(&mut head, (raw.len() % full) as u64);
        blocks.iter().for_each(|b| put(&mut head, b.len() as u64));
        [head, blocks.concat()]
    };
    let mut appended: Vec<u8> = Vec::new();
    let mut array = |name: &str, kind: &str, components: usize, raw: &[u8], text: &str| {
        let head = format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\""
        );
        let encoded = |parts: [Vec<u8>; 2]| {
            // VTK encodes the two apart where it compresses, other writers never.
            if compressed {
                parts.map(|part| STANDARD.encode(part)).concat()
            } else {
                STANDARD.encode(parts.concat())
            }
        };
        match held {
            Held::Text => format!("{head} format=\"ascii\">{text}</DataArray>\n"),
            Held::Inline => {
                format!(
                    "{head} format=\"binary\">\n  {}\n</DataArray>\n",
                    encoded(parts(raw))
                )
            }
            Held::AppendedRaw | Held::AppendedBase64 => {
                let offset = appended.len();
                match held {
                    Held::AppendedRaw => appended.extend(parts(raw).concat()),
                    _ => appended.extend(encoded(parts(raw)).as_bytes()),
                }
                format!("{head} format=\"appended\" offset=\"{offset}\"/>\n")
            }
        }
    };
    let listed = |list: &[String]| list.join(" ");
    let flat: Vec<f32> = POINTS.concat();
    let floats: Vec<u8> = flat
        .iter()
        .flat_map(|x| {
            if big_endian {
                x.to_be_bytes()
            } else {
                x.to_le_bytes()
            }
        })
        .collect();
    let whole = |list: &[i64]| -> (Vec<u8>, String) {
        let bytes = list.iter().flat_map(|x| {
            if big_endian {
                x.to_be_bytes()
            } else {
                x.to_le_bytes()
            }
        });
        let words: Vec<String> = list.iter().map(ToString::to_string).collect();
        (bytes.collect(), listed(&words))
    };
    let words: Vec<String> = flat.iter().map(ToString::to_string).collect();
    let points = array("Points", "Float32", 3, &floats, &listed(&words));
    let corners: Vec<i64> = CELLS.concat().iter().map(|&k| i64::from(k)).collect();
    let (bytes, text) = whole(&corners);
    let corners = array("connectivity", "Int64", 1, &bytes, &text);
    let (bytes, text) = whole(&[4, 7]);
    let ends = array("offsets", "Int64", 1, &bytes, &text);
    let mut file =
        String::from("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\"");
    let order = if big_endian {
        "BigEndian"
    } else {
        "LittleEndian"
    };
    let width = if wide { "UInt64" } else { "UInt32" };
    write!(file, " byte_order=\"{order}\" header_type=\"{width}\"").unwrap();
    if compressed {
        file.push_str(" compressor=\"vtkZLibDataCompressor\"");
    }
    write!(
        file,
        ">\n<PolyData>\n<Piece NumberOfPoints=\"5\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
         NumberOfPolys=\"2\">\n<PointData>\n</PointData>\n<Points>\n{points}</Points>\n<Polys>\n{corners}{ends}</Polys>\n\
         </Piece>\n</PolyData>\n"
    )
    .unwrap();
    let mut file = file.into_bytes();
    let encoding = match held {
        Held::AppendedRaw => "raw",
        Held::AppendedBase64 => "base64",
        _ => "",
    };
    if !encoding.is_empty() {
        file.extend(format!("<AppendedData encoding=\"{encoding}\">\n _").as_bytes());
        file.extend(&appended);
        file.extend(b"\n</AppendedData>\n");
    }
    file.extend(b"</VTKFile>\n");
    file
}

fn vtp_files() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for held in [
        Held::Text,
        Held::Inline,
        Held::AppendedRaw,
        Held::AppendedBase64,
    ] {
        for k in 0..8 {
            let [wide, compressed, big] = [k & 1, k & 2, k & 4].map(|bit| bit > 0);
            let name = format!("{held:?}, wide {wide}, compressed {compressed}, big-endian {big}");
            files.push((name, vtp(held, wide, compressed, big)));
        }
    }
    files
}

#[test]
fn every_encoding_holds_the_same_mesh() {
    for (name, file) in legacy_files().into_iter().chain(vtp_files()) {
        is_the_mesh(&file, &name);
    }
    let crlf = Legacy::new("3.0", false, "POLYDATA")
        .points()
        .cells("POLYGONS", false);
    let crlf = String::from_utf8(crlf.bytes).unwrap().replace('\n', "\r\n");
    is_the_mesh(&crlf, "CR LF");
}

#[test]
fn strips_pixels_and_what_is_no_surface() {
    let head = "# vtk DataFile Version 3.0\nlengths, units: inch\nASCII\nDATASET ";
    let points = "POINTS 4 double\n0 0 0 1 0 0\n0 1 0 1 1 0\n";
    let strip =
        format!("{head}POLYDATA\n{points}LINES 1 3\n2 0 1\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\n");
    let grid = format!(
        "{head}UNSTRUCTURED_GRID\n{points}CELLS 4 15\n4 0 1 2 3\n4 0 1 2 3\n2 0 1\n1 3\nCELL_TYPES 4\n8 10 3 1\n"
    );
    let scan = of(&strip).unwrap();
    assert_eq!(
        scan.organisation,
        Organisation::Mesh(vec![[0, 1, 2], [2, 1, 3]])
    );
    assert_eq!(scan.warnings, ["ignored vertices and lines: 1"]);
    assert_eq!(
        (scan.unit, scan.format.as_ref()),
        (nurbskin::Unit::Inch, "vtk")
    );
    let scan = of(&grid).unwrap();
    assert_eq!(
        scan.organisation,
        Organisation::Mesh(vec![[0, 1, 2], [2, 1, 3]])
    );
    assert_eq!(
        scan.warnings,
        [
            "ignored vertices and lines: 2",
            "ignored solid or unknown cells: 1"
        ]
    );
}

#[test]
fn a_structured_layer_is_a_grid() {
    let file = |dimensions: &str, count: usize| {
        let points: String = (0..count).fold(String::new(), |mut text, k| {
            writeln!(text, "{} {} 0", k % 3, k / 3).unwrap();
            text
        });
        format!(
            "# vtk DataFile Version 2.0\nt\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS {dimensions}\nPOINTS {count} \
             float\n{points}"
        )
    };
    for dimensions in ["3 2 1", "3 1 2", "1 3 2"] {
        let scan = of(file(dimensions, 6)).unwrap();
        let Organisation::Grid(layout) = &scan.organisation else {
            panic!("{:?}", scan.organisation);
        };
        assert_eq!([layout.count_u, layout.count_v], [3, 2], "{dimensions}");
    }
    assert!(refused(file("3 2 2", 12)).contains("is a volume"));
    assert!(refused(file("3 3 1", 6)).contains("another number of points"));
}

#[test]
fn normals_of_points_are_kept() {
    let normals = Numbers::F32([0.0, 0.0, 1.0].repeat(5));
    for binary in [false, true] {
        let file = Legacy::new("3.0", binary, "POLYDATA")
            .points()
            .cells("POLYGONS", false)
            .line("POINT_DATA 5\nSCALARS height float 1\nLOOKUP_TABLE default")
            .numbers(&Numbers::F32(vec![1.5; 5]))
            .line("FIELD FieldData 1\nage 1 5 int")
            .numbers(&Numbers::I32(vec![7; 5]))
            .line("NORMALS n float")
            .numbers(&normals);
        let scan = of(&file.bytes).unwrap();
        assert_eq!(scan.normals, Some(vec![DVec3::Z; 5]), "binary {binary}");
        // Damaged data of points leave the geometry as it is.
        let scan = of(&file.bytes[..file.bytes.len() - 20]).unwrap();
        assert_eq!((scan.points.len(), scan.normals), (5, None));
    }
    let file = String::from_utf8(vtp(Held::Text, false, false, false)).unwrap();
    let array = format!(
        "<PointData Normals=\"n\"><DataArray type=\"Float32\" Name=\"n\" NumberOfComponents=\"3\" \
         format=\"ascii\">{}</DataArray>",
        "0 0 1 ".repeat(5)
    );
    let scan = of(file.replace("<PointData>", &array)).unwrap();
    assert_eq!(scan.normals, Some(vec![DVec3::Z; 5]));
}

#[test]
fn pieces_are_put_together() {
    let file = String::from_utf8(vtp(Held::Text, false, false, false)).unwrap();
    let (start, end) = (
        file.find("<Piece").unwrap(),
        file.find("</Piece>").unwrap() + 8,
    );
    let twice = format!("{}{}{}", &file[..end], &file[start..end], &file[end..]);
    let scan = of(twice).unwrap();
    let Organisation::Mesh(triangles) = &scan.organisation else {
        panic!("{:?}", scan.organisation);
    };
    assert_eq!((scan.points.len(), triangles.len()), (10, 6));
    assert_eq!(triangles[5], [6, 9, 7]);
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    let legacy = Legacy::new("3.0", false, "POLYDATA")
        .points()
        .cells("POLYGONS", false);
    let legacy = String::from_utf8(legacy.bytes).unwrap();
    let xml = String::from_utf8(vtp(Held::Text, false, false, false)).unwrap();
    let packed = String::from_utf8(vtp(Held::Inline, false, true, false)).unwrap();
    for (file, words) in [
        (
            legacy.replace("\n4 0", "\n4 9"),
            "vertex index 9 is out of range: there are 5 points",
        ),
        (
            legacy.replace("\n4 0", "\n4 x"),
            "line 11 (POLYGONS): \"x\" is not a number",
        ),
        (
            legacy.replace("POINTS 5", "POINTS 500000000000"),
            "line 6 (POINTS): 1500000000000 numbers",
        ),
        (
            legacy.replace("POLYDATA", "STRUCTURED_POINTS"),
            "export it as POLYDATA",
        ),
        (
            legacy.replace("ASCII", "EBCDIC"),
            "where ASCII or BINARY is expected",
        ),
        (
            legacy.replace("POLYGONS", "POLYGNS"),
            "unknown keyword \"POLYGNS\"",
        ),
        (
            legacy.replace("2 9", "3 9"),
            "the list of cells ends in cell 2 of 3",
        ),
        (
            xml.replace("PolyData\" ", "ImageData\" "),
            "ImageData is not a surface mesh",
        ),
        (
            xml.replace("<Points>", "<Points"),
            "the XML cannot be parsed",
        ),
        (
            xml.replace("NumberOfPoints=\"5\"", "NumberOfPoints=\"6\""),
            "6 points are announced, but there are 5",
        ),
        (
            xml.replace(">0 1 2 3", ">0 1 2 8"),
            "vertex index 8 is out of range",
        ),
        (
            packed.replace("vtkZLib", "vtkLZ4"),
            "vtkLZ4DataCompressor are not read",
        ),
    ] {
        let said = refused(&file);
        assert!(said.contains(words), "{said}\n  not {words}");
    }
    assert!(refused("<VTKFile").contains("truncated"));
    let said = read_bytes(b"0 0 0\n".to_vec(), Path::new("a.vtk")).unwrap_err();
    assert!(said.to_string().contains("not a .vtk file"), "{said}");
}

#[test]
fn hostile_files_take_neither_memory_nor_the_stack() {
    let deep = format!("<VTKFile type=\"PolyData\">{}", "<a>".repeat(200_000));
    assert!(refused(deep).contains("cannot be parsed"));
    // Two million zeros in two thousand bytes.
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&vec![0; 1 << 24]).unwrap();
    let packed = packed.finish().unwrap();
    let mut bytes = Vec::new();
    for x in [1, 1 << 24, 0, packed.len()] {
        bytes.extend(u32::try_from(x).unwrap().to_le_bytes());
    }
    let data = STANDARD.encode(&bytes) + &STANDARD.encode(&packed);
    let bomb = format!(
        "<VTKFile type=\"PolyData\" compressor=\"vtkZLibDataCompressor\"><PolyData><Piece NumberOfPoints=\"1\"><Points>\
         <DataArray type=\"Float32\" format=\"binary\">{data}</DataArray></Points></Piece></PolyData></VTKFile>"
    );
    assert!(refused(bomb).contains("times the size of the file"));
}

#[test]
fn mangled_files_never_panic() {
    let mut state = 1_u64;
    let mut next = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut read = 0;
    for (name, file) in legacy_files().into_iter().chain(vtp_files()) {
        for k in 0..120 {
            let mut file = file.clone();
            match k % 3 {
                0 => file.truncate(next(file.len())),
                1 => {
                    let at = next(file.len());
                    file[at] = u8::try_from(next(256)).unwrap();
                }
                _ => {
                    // A digit becomes another, or a piece is doubled.
                    let digits: Vec<usize> = (0..file.len())
                        .filter(|&k| file[k].is_ascii_digit())
                        .collect();
                    let at = digits[next(digits.len())];
                    file[at] = b'0' + u8::try_from(next(10)).unwrap();
                    let (from, to) = (next(file.len()), next(file.len()));
                    if k % 2 == 0 && from < to {
                        let piece = file[from..to].to_vec();
                        file.splice(from..from, piece);
                    }
                }
            }
            match of(&file) {
                Ok(scan) => {
                    read += 1;
                    scan.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
    assert!(read > 100, "{read}");
}

#[test]
fn real_files_are_the_same_as_their_ply_twins() {
    let Some(folder) = std::env::var_os("NURBSKIN_DATA").map(PathBuf::from) else {
        println!("skipped: NURBSKIN_DATA names no folder of scans");
        return;
    };
    for (vtk, ply) in [
        ("faces/fran_cut.vtk", "faces/fran_cut.ply"),
        ("pots/plastic_vase.vtp", "pots/plastic_vase.ply"),
        ("pots/sea_vase.vtp", "pots/sea_vase.ply"),
    ] {
        let [ours, theirs] = [vtk, ply].map(|name| read_scan(folder.join(name)).unwrap());
        assert_eq!(ours.points.len(), theirs.points.len(), "{vtk}");
        let far = ours
            .points
            .iter()
            .zip(&theirs.points)
            .map(|(a, b)| (*a + ours.origin).distance(*b + theirs.origin));
        let worst = far.fold(0.0, f64::max);
        let size = ours
            .points
            .iter()
            .fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
        assert!(worst <= 1e-6 * size, "{vtk}: {worst}");
        assert_eq!(ours.organisation, theirs.organisation, "{vtk}");
    }
}
