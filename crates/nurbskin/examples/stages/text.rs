//! Labels in a font of 5 x 7 dots.

use super::canvas::{Canvas, Colour};

/// Rows of five dots, the leftmost in the highest bit.
const FONT: [(char, [u8; 7]); 46] = [
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 30, 17, 17, 17, 30]),
    ('c', [0, 0, 14, 16, 16, 17, 14]),
    ('d', [1, 1, 15, 17, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 9, 8, 28, 8, 8, 8]),
    ('g', [15, 17, 17, 17, 15, 1, 14]),
    ('h', [16, 16, 22, 25, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 21, 21]),
    ('n', [0, 0, 22, 25, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [30, 17, 17, 17, 30, 16, 16]),
    ('q', [15, 17, 17, 17, 15, 1, 1]),
    ('r', [0, 0, 22, 25, 16, 16, 16]),
    ('s', [0, 0, 14, 16, 14, 1, 30]),
    ('t', [8, 8, 28, 8, 8, 9, 6]),
    ('u', [0, 0, 17, 17, 17, 19, 13]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 17, 17, 21, 21, 10]),
    ('x', [0, 0, 17, 10, 4, 10, 17]),
    ('y', [17, 17, 17, 17, 15, 1, 14]),
    ('z', [0, 0, 31, 2, 4, 8, 31]),
    ('0', [14, 17, 19, 21, 25, 17, 14]),
    ('1', [4, 12, 4, 4, 4, 4, 14]),
    ('2', [14, 17, 1, 2, 4, 8, 31]),
    ('3', [31, 2, 4, 2, 1, 17, 14]),
    ('4', [2, 6, 10, 18, 31, 2, 2]),
    ('5', [31, 16, 30, 1, 1, 17, 14]),
    ('6', [6, 8, 16, 30, 17, 17, 14]),
    ('7', [31, 1, 2, 4, 8, 8, 8]),
    ('8', [14, 17, 17, 14, 17, 17, 14]),
    ('9', [14, 17, 17, 15, 1, 2, 12]),
    ('+', [0, 4, 4, 31, 4, 4, 0]),
    ('-', [0, 0, 0, 31, 0, 0, 0]),
    ('.', [0, 0, 0, 0, 0, 12, 12]),
    (',', [0, 0, 0, 12, 12, 4, 8]),
    ('%', [24, 25, 2, 4, 8, 19, 3]),
    ('(', [2, 4, 8, 8, 8, 4, 2]),
    (')', [8, 4, 2, 2, 2, 4, 8]),
    (':', [0, 12, 12, 0, 12, 12, 0]),
    ('/', [0, 1, 2, 4, 8, 16, 0]),
    ('=', [0, 0, 31, 0, 31, 0, 0]),
    (' ', [0; 7]),
];

/// Characters that hang two dots below the line.
const HANGING: &str = "gpqy,";
/// Pixels from one character to the next, at two pixels per dot.
pub(crate) const ADVANCE: usize = 12;

/// Writes lower-case text, 14 pixels high and 4 below its line, with its upper left corner here.
pub(crate) fn write(canvas: &mut Canvas, [x, y]: [usize; 2], text: &str, colour: Colour) {
    for (k, character) in text.chars().enumerate() {
        let glyph = FONT.iter().find(|(known, _)| *known == character);
        let rows = glyph.map_or([0; 7], |(_, rows)| *rows);
        let top = y + if HANGING.contains(character) { 4 } else { 0 };
        for (row, bits) in rows.into_iter().enumerate() {
            for column in (0..5).filter(|column| bits >> (4 - column) & 1 == 1) {
                let at = [x + k * ADVANCE + 2 * column, top + 2 * row];
                canvas.block(at, [2, 2], colour);
            }
        }
    }
}
