//! Draws the paper's figures again, from our own scans: `cargo run --release --example figures [FOLDER]`.

mod canvas;
mod object;
mod scale;

use canvas::{Canvas, save};
use nurbskin::fit::interpolate::parameters::Parameterization::{ChordLength, Uniform};
use nurbskin::scan::simulate::Shape;
use object::{Keep, Object, PALE, POINT, SKIN};
use std::error::Error;
use std::path::{Path, PathBuf};

type Outcome = Result<(), Box<dyn Error>>;

fn main() -> Outcome {
    let folder = std::env::args()
        .nth(1)
        .map_or_else(|| Path::new("docs/figures").to_owned(), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    draw_pot(&folder)?;
    draw_patch(&folder)?;
    draw_face(&folder)?;
    draw_handle(&folder)
}

fn shaded(object: &Object, size: [usize; 2], view: [f64; 2]) -> Canvas {
    let mut canvas = object.view(size, view, &[]);
    object.shade(&mut canvas, &|_| SKIN);
    canvas
}

/// Iso-curves on a pale surface, which hides those behind it.
fn wireframe(object: &Object, size: [usize; 2], view: [f64; 2], counts: [usize; 2]) -> Canvas {
    let mut canvas = object.view(size, view, &[]);
    object.shade(&mut canvas, &|_| PALE);
    object.wires(&mut canvas, counts[0], counts[1]);
    canvas
}

/// Figures 1 and 2, and where the paper's surface is off.
fn draw_pot(folder: &Path) -> Outcome {
    const SIZE: [usize; 2] = [390, 460];
    const VIEW: [f64; 2] = [20.0, 22.0];
    let pot = Object::new(Shape::Pot, &Keep::Paper([18, 18], ChordLength), false)?;
    let mut cloud = pot.view(SIZE, VIEW, &[]);
    pot.cloud(&mut cloud);
    let mut kept = pot.view(SIZE, VIEW, &[]);
    Object::dots(&mut kept, &pot.kept, 2.2, POINT);
    save(&[cloud, kept], &folder.join("fig01-pot-points.png"))?;

    let mut cloud = pot.view(SIZE, VIEW, &[]);
    pot.cloud(&mut cloud);
    let mut points = shaded(&pot, SIZE, VIEW);
    pot.pluses(&mut points, 4.0, POINT);
    let views = [cloud, shaded(&pot, SIZE, VIEW), points];
    save(&views, &folder.join("fig02-pot.png"))?;

    const LARGEST: f64 = 1.0;
    let uniform = Object::new(Shape::Pot, &Keep::Paper([18, 18], Uniform), false)?;
    let tolerant = Object::new(Shape::Pot, &Keep::Within(0.1), false)?;
    let mut views = Vec::new();
    for object in [&uniform, &pot, &tolerant] {
        let mut canvas = object.view([340, 420], VIEW, &[]);
        object.shade(&mut canvas, &|point| {
            [scale::diverging(object.truth.signed_distance(point) / LARGEST); 2]
        });
        object.pluses(&mut canvas, 4.0, [0.1; 3]);
        views.push(canvas);
    }
    let mut bar = pot.view([100, 420], VIEW, &[]);
    scale::draw(&mut bar, [10, 60], 300, LARGEST);
    views.push(bar);
    save(&views, &folder.join("pot-deviation.png"))
}

/// Figures 7 and 12: 4 x 4 points, the surface through them, and its control net.
fn draw_patch(folder: &Path) -> Outcome {
    const VIEW: [f64; 2] = [25.0, 55.0];
    let patch = Object::new(Shape::Patch, &Keep::Paper([4, 4], Uniform), false)?;
    let mut points = patch.view([460, 400], VIEW, &[]);
    Object::dots(&mut points, &patch.kept, 5.0, POINT);
    let mut through = shaded(&patch, [460, 400], VIEW);
    patch.wires(&mut through, 3, 3);
    Object::dots(&mut through, &patch.kept, 5.0, POINT);
    save(&[points, through], &folder.join("fig07-patch.png"))?;

    let net = patch.surface.control_points().points();
    let view = || patch.view([460, 480], VIEW, net);
    let mut solid = view();
    patch.shade(&mut solid, &|_| SKIN);
    patch.net(&mut solid);
    let mut wires = view();
    patch.wires(&mut wires, 9, 9);
    patch.net(&mut wires);
    patch.pluses(&mut wires, 7.0, [0.0, 0.35, 0.75]);
    save(&[solid, wires], &folder.join("fig12-net.png"))
}

/// Figures 14 to 16: the face from several sides, as wires, and with the rarefied points.
fn draw_face(folder: &Path) -> Outcome {
    const VIEW: [f64; 2] = [-25.0, 10.0];
    let face = Object::new(Shape::Face, &Keep::Paper([29, 13], ChordLength), false)?;
    let views = [[0.0, 0.0], [-40.0, 10.0], [75.0, 5.0], [30.0, -25.0]];
    let views = views.map(|view| shaded(&face, [290, 360], view));
    save(&views, &folder.join("fig14-face.png"))?;
    let wires = wireframe(&face, [420, 520], VIEW, [56, 36]);
    save(&[wires], &folder.join("fig15-face-wireframe.png"))?;
    let mut points = shaded(&face, [420, 520], VIEW);
    face.pluses(&mut points, 4.0, POINT);
    save(&[points], &folder.join("fig16-face-points.png"))
}

/// Figure 18: the handle as one surface with a longitudinal opening, which lies below.
fn draw_handle(folder: &Path) -> Outcome {
    const SIZE: [usize; 2] = [540, 300];
    const VIEW: [f64; 2] = [205.0, -58.0];
    let handle = Object::new(Shape::Handle, &Keep::Paper([25, 32], ChordLength), true)?;
    let wires = wireframe(&handle, SIZE, VIEW, [48, 31]);
    let views = [shaded(&handle, SIZE, VIEW), wires];
    save(&views, &folder.join("fig18-handle.png"))
}
