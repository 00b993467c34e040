//! The exchange structure of ISO 10303-21: sections, instances and the values in them.
//!
//! The text is indexed once; instances are parsed when they are asked for, so that no more than the index is kept.

/// Lists in lists deeper than this are refused.
const MAX_DEPTH: usize = 32;

/// A value of an instance; text is that of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Integer(i64),
    Real(f64),
    /// What stands between the quotes, with its escapes.
    Text(&'a [u8]),
    /// An enumeration, without its dots.
    Name(&'a str),
    Binary,
    Reference(u64),
    List(Vec<Value<'a>>),
    /// A value that says its type: `LENGTH_MEASURE(25.4)`.
    Typed(&'a str, Vec<Value<'a>>),
    /// `$`
    Omitted,
    /// `*`
    Derived,
}

/// One type of an instance with its own attributes; a simple instance has one, with those it inherits.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part<'a> {
    pub(super) name: &'a str,
    pub(super) values: Vec<Value<'a>>,
}

/// What is wrong, and at which byte.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Flaw {
    pub(super) at: usize,
    pub(super) what: String,
}

pub(super) type Parsed<T> = Result<T, Flaw>;

/// A place in the text.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    pub(super) fn flaw<T>(&self, what: impl Into<String>) -> Parsed<T> {
        Err(Flaw {
            at: self.at,
            what: what.into(),
        })
    }

    /// What is left of the text.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or(&[])
    }

    pub(super) fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    /// Skips white space, control characters and comments.
    pub(super) fn skip(&mut self) -> Parsed<()> {
        while let Some(byte) = self.peek() {
            if byte <= b' ' || byte >= 0x7f {
                self.at += 1;
            } else if byte == b'/' && self.bytes.get(self.at + 1) == Some(&b'*') {
                let rest = self.rest().get(2..).unwrap_or(&[]);
                match find(rest, b"*/") {
                    Some(end) => self.at += 2 + end + 2,
                    None => return self.flaw("a comment does not end; the file may be cut off"),
                }
            } else {
                break;
            }
        }
        Ok(())
    }

    /// Skips space and takes this text, if it comes next.
    pub(super) fn takes(&mut self, text: &[u8]) -> Parsed<bool> {
        self.skip()?;
        let found = self.rest().starts_with(text);
        if found {
            self.at += text.len();
        }
        Ok(found)
    }

    pub(super) fn needs(&mut self, text: &'static str) -> Parsed<()> {
        if self.takes(text.as_bytes())? {
            return Ok(());
        }
        match self.peek() {
            Some(byte) => self.flaw(format!(
                "\"{text}\" should come here, not {:?}",
                char::from(byte)
            )),
            None => self.flaw(format!(
                "the file ends before \"{text}\"; it may be cut off"
            )),
        }
    }

    pub(super) fn run(&mut self, is: impl Fn(u8) -> bool) -> &'a [u8] {
        let start = self.at;
        while self.peek().is_some_and(&is) {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    /// A keyword: letters, digits, underscores and hyphens, perhaps after an exclamation mark.
    pub(super) fn keyword(&mut self) -> Parsed<&'a str> {
        self.skip()?;
        let start = self.at;
        if self.peek() == Some(b'!') {
            self.at += 1;
        }
        self.run(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
        let word = std::str::from_utf8(&self.bytes[start..self.at]).unwrap_or("");
        if word.is_empty() {
            return self.flaw("the file should have a keyword here");
        }
        Ok(word)
    }

    /// The number of an instance, after its `#`.
    pub(super) fn number(&mut self) -> Parsed<u64> {
        self.skip()?;
        let digits = self.run(|b| b.is_ascii_digit());
        let text = std::str::from_utf8(digits).unwrap_or("");
        match text.parse() {
            Ok(number) => Ok(number),
            Err(_) => self.flaw("the file should have a number after \"#\""),
        }
    }

    /// A string without its quotes; quotes in it are doubled.
    pub(super) fn text(&mut self) -> Parsed<&'a [u8]> {
        let start = self.at + 1;
        let mut at = start;
        loop {
            let rest = self.bytes.get(at..).unwrap_or(&[]);
            match rest.iter().position(|&b| b == b'\'') {
                None => return self.flaw("a string does not end; the file may be cut off"),
                Some(k) if self.bytes.get(at + k + 1) == Some(&b'\'') => at += k + 2,
                Some(k) => {
                    self.at = at + k + 1;
                    return Ok(&self.bytes[start..at + k]);
                }
            }
        }
    }

    /// Goes behind the semicolon that ends a record.
    pub(super) fn skip_record(&mut self) -> Parsed<()> {
        loop {
            self.skip()?;
            match self.peek() {
                None => return self.flaw("the file ends inside an instance; it may be cut off"),
                Some(b';') => {
                    self.at += 1;
                    return Ok(());
                }
                Some(b'\'') => {
                    self.text()?;
                }
                // A new instance begins only after a semicolon.
                Some(b'=') => return self.flaw("a semicolon is missing before this instance"),
                Some(_) => self.at += 1,
            }
        }
    }

    /// The parts of an instance: one, or those of a complex instance in parentheses.
    pub(super) fn parts(&mut self) -> Parsed<Vec<Part<'a>>> {
        let mut parts = Vec::new();
        if self.takes(b"(")? {
            while !self.takes(b")")? {
                parts.push(self.part()?);
            }
        } else {
            parts.push(self.part()?);
        }
        Ok(parts)
    }

    pub(super) fn part(&mut self) -> Parsed<Part<'a>> {
        let name = self.keyword()?;
        self.needs("(")?;
        let values = self.values(0)?;
        Ok(Part { name, values })
    }

    /// Values up to the closing parenthesis, which is taken too.
    fn values(&mut self, depth: usize) -> Parsed<Vec<Value<'a>>> {
        if depth > MAX_DEPTH {
            return self.flaw(format!("lists are nested more than {MAX_DEPTH} deep"));
        }
        let mut values = Vec::new();
        if self.takes(b")")? {
            return Ok(values);
        }
        loop {
            values.push(self.value(depth)?);
            if self.takes(b")")? {
                return Ok(values);
            }
            self.needs(",")?;
        }
    }

    fn value(&mut self, depth: usize) -> Parsed<Value<'a>> {
        self.skip()?;
        let Some(byte) = self.peek() else {
            return self.flaw("the file ends inside an instance; it may be cut off");
        };
        match byte {
            b'$' | b'*' => {
                self.at += 1;
                Ok(if byte == b'$' {
                    Value::Omitted
                } else {
                    Value::Derived
                })
            }
            b'#' => {
                self.at += 1;
                Ok(Value::Reference(self.number()?))
            }
            b'\'' => Ok(Value::Text(self.text()?)),
            b'(' => {
                self.at += 1;
                Ok(Value::List(self.values(depth + 1)?))
            }
            b'.' if !self.bytes.get(self.at + 1).is_some_and(u8::is_ascii_digit) => {
                self.at += 1;
                let name = self.keyword()?;
                self.needs(".")?;
                Ok(Value::Name(name))
            }
            b'"' => {
                self.at += 1;
                self.run(|b| b.is_ascii_hexdigit());
                self.needs("\"")?;
                Ok(Value::Binary)
            }
            b'0'..=b'9' | b'+' | b'-' | b'.' => self.numeric(),
            _ => {
                let name = self.keyword()?;
                self.needs("(")?;
                Ok(Value::Typed(name, self.values(depth + 1)?))
            }
        }
    }

    fn numeric(&mut self) -> Parsed<Value<'a>> {
        let start = *self;
        let digits = self.run(|b| b.is_ascii_digit() || b"+-.eEdD".contains(&b));
        let text = std::str::from_utf8(digits).unwrap_or("");
        if let Ok(integer) = text.parse() {
            return Ok(Value::Integer(integer));
        }
        match text.replace(['d', 'D'], "E").parse::<f64>() {
            Ok(real) if real.is_finite() => Ok(Value::Real(real)),
            _ => start.flaw(format!(
                "{:?} is not a number",
                text.get(..40).unwrap_or(text)
            )),
        }
    }
}

fn find(bytes: &[u8], text: &[u8]) -> Option<usize> {
    bytes.windows(text.len()).position(|w| w == text)
}

/// A string of the file in plain characters: doubled quotes, `\S\`, `\X\`, `\X2\` and `\X4\` resolved.
pub(super) fn plain(text: &[u8]) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(&byte) = rest.first() {
        let hex = |digits: &[u8]| {
            let text = std::str::from_utf8(digits).ok()?;
            char::from_u32(u32::from_str_radix(text, 16).ok()?)
        };
        let mut used = 1;
        if rest.starts_with(b"''") || rest.starts_with(b"\\\\") {
            out.push(char::from(byte));
            used = 2;
        } else if rest.starts_with(b"\\S\\") && rest.len() > 3 {
            out.push(char::from(rest[3] | 0x80));
            used = 4;
        } else if rest.starts_with(b"\\X\\") && rest.len() >= 5 {
            out.extend(hex(&rest[3..5]));
            used = 5;
        } else if rest.starts_with(b"\\X2\\") || rest.starts_with(b"\\X4\\") {
            let end = find(rest, b"\\X0\\").unwrap_or(rest.len());
            let digits = &rest[4..end.max(4)];
            if rest[2] == b'2' {
                let units = digits
                    .chunks_exact(4)
                    .filter_map(|c| u16::from_str_radix(std::str::from_utf8(c).ok()?, 16).ok());
                out.extend(char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')));
            } else {
                out.extend(digits.chunks_exact(8).filter_map(hex));
            }
            used = (end + 4).min(rest.len());
        } else if byte >= 0x80 {
            // Not allowed, and common: UTF-8, or Latin-1.
            let length = rest.iter().take_while(|&&b| b >= 0x80).count();
            match std::str::from_utf8(&rest[..length]) {
                Ok(text) => out.push_str(text),
                Err(_) => out.extend(rest[..length].iter().map(|&b| char::from(b))),
            }
            used = length;
        } else if byte >= b' ' {
            out.push(char::from(byte));
        }
        rest = &rest[used..];
    }
    out
}
