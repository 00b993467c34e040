//! GLB, the binary form of glTF 2.0: triangles with normals, for viewers.
//!
//! glTF counts in metres with y up, in single precision. The vertices are written in the model's own unit around the
//! middle of the mesh, where single precision is enough; one node turns z up, scales to metres and moves them back.

use gltf::binary::{Glb, Header};
use nurbskin_geometry::math;
use nurbskin_geometry::{DVec3, Error, Result, Unit};
use serde_json::json;
use std::borrow::Cow;
use std::io::Write;

/// What goes into a file.
#[derive(Clone, Copy, Debug)]
pub struct GlbMesh<'a> {
    /// Vertices.
    pub points: &'a [DVec3],
    /// Their unit normals, as many, or none at all.
    pub normals: &'a [DVec3],
    /// Vertices of each triangle, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Unit of the vertices.
    pub unit: Unit,
    /// Added to every vertex.
    pub origin: DVec3,
    /// Name of the part; may be empty.
    pub name: &'a str,
    /// Red, green and blue, 0 to 255 each.
    pub colour: Option<[u8; 3]>,
}

/// Component types of glTF: 32 bits, floating point or unsigned.
const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;

/// Writes a GLB file.
///
/// # Errors
/// [`Error::Invalid`] if there are no triangles, one names a vertex that does not exist, or the normals are not as many
/// as the vertices; [`Error::Write`] if `out` fails.
pub fn write(out: &mut (impl Write + ?Sized), mesh: &GlbMesh<'_>) -> Result<()> {
    let count = mesh.points.len();
    let sound = mesh
        .triangles
        .iter()
        .flatten()
        .all(|&k| (k as usize) < count);
    if mesh.triangles.is_empty() || !sound {
        return Err(Error::invalid(
            "a mesh without triangles, or with vertices that do not exist",
        ));
    }
    if !mesh.normals.is_empty() && mesh.normals.len() != count {
        return Err(Error::invalid(
            "a normal is needed for each vertex or for none",
        ));
    }
    // 1. The numbers: positions, normals, indices.
    let [low, high] = nurbskin_geometry::point_grid::bounding_box(mesh.points);
    let middle = 0.5 * (low + high);
    let mut bytes: Vec<u8> = Vec::with_capacity(24 * count + 12 * mesh.triangles.len());
    let mut corners = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for p in mesh.points {
        for (k, x) in (*p - middle).as_vec3().to_array().into_iter().enumerate() {
            corners[0][k] = corners[0][k].min(x);
            corners[1][k] = corners[1][k].max(x);
            bytes.extend(x.to_le_bytes());
        }
    }
    let positions = bytes.len();
    for n in mesh.normals {
        // glTF wants unit normals; where there is none any will do.
        let n = n.normalize_or(DVec3::Z).as_vec3();
        n.to_array()
            .iter()
            .for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    let normals = bytes.len() - positions;
    for k in mesh.triangles.iter().flatten() {
        bytes.extend(k.to_le_bytes());
    }
    let indices = bytes.len() - positions - normals;
    // 2. What they mean.
    let scale = mesh.unit.millimetres() / 1000.0;
    let moved = scale * (middle + mesh.origin);
    let mut views =
        vec![json!({ "buffer": 0, "byteOffset": 0, "byteLength": positions, "target": 34962 })];
    let mut accessors = vec![json!({
        "bufferView": 0, "componentType": FLOAT, "count": count, "type": "VEC3", "min": corners[0], "max": corners[1]
    })];
    let mut attributes = json!({ "POSITION": 0 });
    if normals > 0 {
        views.push(
            json!({ "buffer": 0, "byteOffset": positions, "byteLength": normals, "target": 34962 }),
        );
        accessors.push(
            json!({ "bufferView": 1, "componentType": FLOAT, "count": count, "type": "VEC3" }),
        );
        attributes["NORMAL"] = json!(1);
    }
    views.push(json!({
        "buffer": 0, "byteOffset": positions + normals, "byteLength": indices, "target": 34963
    }));
    accessors.push(json!({
        "bufferView": views.len() - 1, "componentType": UNSIGNED, "count": 3 * mesh.triangles.len(), "type": "SCALAR"
    }));
    let [r, g, b] = mesh.colour.unwrap_or([184, 190, 196]).map(linear);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let root = json!({
        "asset": { "version": "2.0", "generator": concat!("nurbskin ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        // A quarter turn about x takes z up to y up.
        "nodes": [{
            "mesh": 0, "name": mesh.name, "rotation": [-half, 0.0, 0.0, half], "scale": [scale, scale, scale],
            "translation": [moved.x, moved.z, -moved.y]
        }],
        "meshes": [{ "name": mesh.name, "primitives": [{
            "attributes": attributes, "indices": accessors.len() - 1, "material": 0
        }] }],
        "materials": [{
            "doubleSided": true,
            "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.6 }
        }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len() }]
    });
    let text = serde_json::to_vec(&root).map_err(|e| Error::invalid(e.to_string()))?;
    // 3. The container, which fills up chunks to whole words.
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0,
        },
        json: Cow::Owned(text),
        bin: Some(Cow::Owned(bytes)),
    };
    glb.to_writer(out)
        .map_err(|e| Error::write("the GLB file", e.to_string()))
}

/// A channel of an sRGB colour as the linear share that glTF wants.
fn linear(channel: u8) -> f64 {
    let c = f64::from(channel) / 255.0;
    if c <= 0.04045 {
        c / 12.92
    } else {
        math::powf((c + 0.055) / 1.055, 2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_finds_the_points_where_they_were() {
        let points = [
            DVec3::new(1000.0, 0.0, 5.0),
            DVec3::new(1002.0, 0.0, 5.0),
            DVec3::new(1000.0, 3.0, 6.0),
        ];
        let mesh = GlbMesh {
            points: &points,
            normals: &[DVec3::Z; 3],
            triangles: &[[0, 1, 2]],
            unit: Unit::Inch,
            origin: DVec3::new(0.0, 0.0, 100.0),
            name: "part",
            colour: None,
        };
        let mut file = Vec::new();
        write(&mut file, &mesh).unwrap();
        let read = gltf::Gltf::from_slice(&file).unwrap();
        let node = read.nodes().next().unwrap();
        let (_, rotation, _) = node.transform().decomposed();
        assert!((rotation[0] + 0.5_f32.sqrt()).abs() < 1e-6);
        let blob = read.blob.clone().unwrap();
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let position = primitive.get(&gltf::Semantic::Positions).unwrap();
        assert_eq!(position.count(), 3);
        let matrix = node.transform().matrix();
        let float = |k: usize| {
            let at: [u8; 4] = blob[4 * k..4 * k + 4].try_into().unwrap();
            f32::from_le_bytes(at)
        };
        for (k, p) in points.iter().enumerate() {
            let local = [float(3 * k), float(3 * k + 1), float(3 * k + 2), 1.0];
            let world: Vec<f64> = (0..3)
                .map(|r| (0..4).map(|c| f64::from(matrix[c][r] * local[c])).sum())
                .collect();
            let q = (*p + mesh.origin) * 0.0254;
            let expected = [q.x, q.z, -q.y];
            for (a, b) in world.iter().zip(expected) {
                assert!((a - b).abs() < 1e-5, "{world:?} {expected:?}");
            }
        }
        assert!(
            write(
                &mut file,
                &GlbMesh {
                    triangles: &[[0, 1, 3]],
                    ..mesh
                }
            )
            .is_err()
        );
    }
}
