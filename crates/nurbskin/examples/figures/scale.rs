//! Colours for signed deviations, and their scale.

use super::canvas::{Canvas, Colour};
use glam::DVec3;

const INK: Colour = [0.15, 0.15, 0.15];
/// Blue, white and orange, which every kind of colour vision tells apart.
const ENDS: [Colour; 3] = [[0.02, 0.28, 0.62], [0.96, 0.96, 0.95], [0.78, 0.32, 0.0]];

/// Colour of a value from -1 (blue: below the truth) to 1 (orange: above it).
pub(crate) fn diverging(value: f64) -> Colour {
    let [below, none, above] = ENDS.map(DVec3::from_array);
    let end = if value < 0.0 { below } else { above };
    none.lerp(end, value.abs().min(1.0).powf(0.8)).to_array()
}

/// Draws the scale from -`largest` to `largest` mm, with its numbers.
pub(crate) fn draw(canvas: &mut Canvas, [left, top]: [usize; 2], height: usize, largest: f64) {
    for y in 0..height {
        let value = 1.0 - 2.0 * y as f64 / (height - 1) as f64;
        canvas.block([left, top + y], [18, 1], diverging(value));
    }
    for k in 0..=4_usize {
        let value = largest * (2.0 - k as f64) / 2.0;
        let sign = if value > 0.0 { "+" } else { "" };
        let y = top + k * (height - 1) / 4;
        canvas.block([left + 18, y], [5, 1], INK);
        let label = if value == 0.0 {
            "0 mm".into()
        } else {
            format!("{sign}{value:.1}")
        };
        write(canvas, [left + 27, y - 6], &label);
    }
}

/// Writes digits, signs and `m`, 12 pixels high.
fn write(canvas: &mut Canvas, [mut x, y]: [usize; 2], text: &str) {
    for glyph in text.chars().map(glyph) {
        for (row, bits) in glyph.into_iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                canvas.block([x + 2 * column, y + 2 * row], [2, 2], INK);
            }
        }
        x += 12;
    }
}

/// Rows of five pixels, the leftmost in the highest bit.
fn glyph(character: char) -> [u8; 7] {
    match character {
        '0' => [14, 17, 17, 17, 17, 17, 14],
        '1' => [4, 12, 4, 4, 4, 4, 14],
        '2' => [14, 17, 1, 2, 4, 8, 31],
        '5' => [31, 16, 30, 1, 1, 17, 14],
        '+' => [0, 4, 4, 31, 4, 4, 0],
        '-' => [0, 0, 0, 31, 0, 0, 0],
        '.' => [0, 0, 0, 0, 0, 12, 12],
        'm' => [0, 0, 26, 21, 21, 21, 21],
        _ => [0; 7],
    }
}
