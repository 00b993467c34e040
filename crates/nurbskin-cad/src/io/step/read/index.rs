//! Where the instances of a STEP file are.

use super::parse::{Cursor, Flaw, Parsed, Part};

/// Where the instances of a file are, by number.
#[derive(Clone, Debug, Default)]
pub(super) struct Index<'a> {
    /// Number and the place behind its `=`, by rising number.
    pub(super) instances: Vec<(u64, usize)>,
    /// The records of the header.
    pub(super) header: Vec<Part<'a>>,
    /// Whether the file ends as it should.
    pub(super) complete: bool,
}

/// Reads the sections of a file.
pub(super) fn index(bytes: &[u8]) -> Parsed<Index<'_>> {
    let mut cursor = Cursor::new(bytes, 0);
    let mut index = Index::default();
    if !cursor.takes(b"ISO-10303-21")? {
        return cursor.flaw("a STEP file begins with ISO-10303-21;");
    }
    cursor.needs(";")?;
    loop {
        cursor.skip()?;
        if cursor.peek().is_none() {
            break;
        }
        match cursor.keyword()? {
            "END-ISO-10303-21" => {
                index.complete = true;
                break;
            }
            "HEADER" => {
                cursor.needs(";")?;
                while !cursor.takes(b"ENDSEC")? {
                    let part = cursor.part()?;
                    index.header.push(part);
                    cursor.needs(";")?;
                }
                cursor.needs(";")?;
            }
            "DATA" => {
                cursor.skip_record()?;
                data(&mut cursor, &mut index)?;
            }
            // Anchors, references and signatures of the third edition.
            _ => {
                cursor.skip_record()?;
                while !cursor.takes(b"ENDSEC")? {
                    cursor.skip()?;
                    if cursor.peek().is_none() {
                        return cursor.flaw("the file ends inside a section; it may be cut off");
                    }
                    cursor.run(|b| b != b';' && b != b'\'');
                    if cursor.peek() == Some(b'\'') {
                        cursor.text()?;
                    } else if cursor.peek().is_some() {
                        cursor.at += 1;
                    }
                }
                cursor.needs(";")?;
            }
        }
    }
    index.instances.sort_unstable();
    if let Some(w) = index.instances.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(Flaw {
            at: w[1].1,
            what: format!("#{} is defined twice", w[1].0),
        });
    }
    Ok(index)
}

fn data(cursor: &mut Cursor<'_>, index: &mut Index<'_>) -> Parsed<()> {
    while !cursor.takes(b"ENDSEC")? {
        cursor.needs("#")?;
        let number = cursor.number()?;
        cursor.needs("=")?;
        index.instances.push((number, cursor.at));
        cursor.skip_record()?;
    }
    cursor.needs(";")
}

/// Bytes per entry of [`Lines`].
const BLOCK: usize = 4096;

/// Line numbers of bytes.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    /// Line ends before each block.
    before: Vec<usize>,
}

impl Lines {
    pub(super) fn new(bytes: &[u8]) -> Self {
        let mut count = 0;
        let before = bytes.chunks(BLOCK).map(|block| {
            let so_far = count;
            count += ends(block);
            so_far
        });
        Self {
            before: before.collect(),
        }
    }

    /// The line of a byte, from 1.
    pub(super) fn of(&self, bytes: &[u8], at: usize) -> usize {
        let at = at.min(bytes.len().saturating_sub(1));
        let block = at / BLOCK;
        let before = self.before.get(block).copied().unwrap_or(0);
        1 + before + bytes.get(block * BLOCK..at).map_or(0, ends)
    }
}

fn ends(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == b'\n').count()
}
