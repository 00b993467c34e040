//! `app`: the page of the whole tool, served on the loopback address.
//!
//! The files of the page are inside the program, compressed, where it was built with the feature `app`, or in a folder. A
//! file is all that a request can get. The headers isolate the page, so that it may share memory with its workers: the
//! library then has threads.

use crate::DONE;
use crate::args::App;
use crate::failure::{Failure, Result};
use crate::show::{Show, Terminal};
use nurbskin::progress::Progress;
use serde_json::json;
use std::borrow::Cow;
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A file of the page: its name, and its content compressed with gzip.
type Packed = (&'static str, &'static [u8]);

#[cfg(feature = "app")]
static PACKED: &[Packed] = include!(concat!(env!("OUT_DIR"), "/page.rs"));
#[cfg(not(feature = "app"))]
static PACKED: &[Packed] = &[];

/// Time between two looks for a request or Ctrl-C.
const PAUSE: Duration = Duration::from_millis(50);
/// Guard: time for a request to arrive.
const PATIENCE: Duration = Duration::from_secs(5);
/// Guard: bytes of a request's head; browsers send less than 2 kB.
const LONGEST_HEAD: usize = 16 << 10;

/// Where the files of the page are.
enum Page {
    Inside,
    Folder(PathBuf),
}

impl Page {
    fn new(folder: Option<&Path>) -> Result<Self> {
        match folder {
            Some(folder) if folder.join("index.html").is_file() => Ok(Self::Folder(folder.into())),
            Some(folder) => Err(Failure::usage(format!(
                "{}: there is no index.html: name the folder that `npm run build` makes in web/",
                folder.display()
            ))),
            None if PACKED.is_empty() => Err(Failure::system(
                "the page is not inside this program: build it with `npm run build` in web/ and then name it with \
                 --folder web/dist, or build the program with `cargo build --release --features app`",
            )),
            None => Ok(Self::Inside),
        }
    }

    /// The content of a file, and whether it is compressed.
    fn file(&self, name: &str) -> Option<(Cow<'static, [u8]>, bool)> {
        match self {
            Self::Inside => {
                let found = PACKED.iter().find(|(known, _)| *known == name)?;
                Some((Cow::Borrowed(found.1), true))
            }
            Self::Folder(folder) => {
                let below = Path::new(name);
                let plain = |part: Component<'_>| matches!(part, Component::Normal(_));
                if !below.components().all(plain) {
                    return None;
                }
                let content = std::fs::read(folder.join(below)).ok()?;
                Some((Cow::Owned(content), false))
            }
        }
    }
}

pub(crate) fn app(app: &App, show: Show) -> Result<u8> {
    let page = Arc::new(Page::new(app.folder.as_deref())?);
    let port = app.port.unwrap_or(0);
    let taken = |error: std::io::Error| {
        Failure::system(format!(
            "port {port} of the loopback address cannot be used ({error}): name another with --port"
        ))
    };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(taken)?;
    listener.set_nonblocking(true).map_err(taken)?;
    let port = listener.local_addr().map_err(taken)?.port();
    let address = format!("http://127.0.0.1:{port}/");
    show.json(&json!({ "address": address }))?;
    show.opened(&address, app.no_open)?;
    let terminal = Terminal::new(show);
    while !terminal.cancelled() {
        match listener.accept() {
            Ok((stream, _)) => {
                let page = Arc::clone(&page);
                std::thread::spawn(move || {
                    // A closed connection needs no answer.
                    let _ = answer(stream, &page, port);
                });
            }
            // No request waits, or its connection is closed already.
            Err(_) => std::thread::sleep(PAUSE),
        }
    }
    terminal.finish();
    Ok(DONE)
}

/// Answers one request.
fn answer(mut stream: TcpStream, page: &Page, port: u16) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let head = head(&mut stream)?;
    let mut lines = head.lines();
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, target) = (
        words.next().unwrap_or_default(),
        words.next().unwrap_or_default(),
    );
    if !matches!(method, "GET" | "HEAD") {
        return refuse(&mut stream, "405 Method Not Allowed");
    }
    // A page of elsewhere whose name leads to this computer has that name here.
    let host = lines.find_map(|line| {
        line.split_once(':')
            .filter(|(key, _)| key.eq_ignore_ascii_case("host"))
    });
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !host.is_some_and(|(_, host)| own.iter().any(|own| own == host.trim())) {
        return refuse(&mut stream, "403 Forbidden");
    }
    let path = target.split(['?', '#']).next().unwrap_or_default();
    let name = match path.strip_prefix('/').unwrap_or(path) {
        "" => "index.html",
        name => name,
    };
    let Some((content, packed)) = page.file(name) else {
        return refuse(&mut stream, "404 Not Found");
    };
    let encoding = if packed {
        "content-encoding: gzip\r\n"
    } else {
        ""
    };
    write!(
        stream,
        "HTTP/1.1 200 OK\r\ncontent-type: {}\r\ncontent-length: {}\r\n{encoding}cache-control: no-cache\r\n\
         cross-origin-opener-policy: same-origin\r\ncross-origin-embedder-policy: require-corp\r\n\
         x-content-type-options: nosniff\r\nconnection: close\r\n\r\n",
        kind(name),
        content.len()
    )?;
    if method == "GET" {
        stream.write_all(&content)?;
    }
    stream.flush()
}

/// The head of a request.
fn head(stream: &mut TcpStream) -> std::io::Result<String> {
    let mut head = Vec::new();
    let mut block = [0; 1024];
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let count = stream.read(&mut block)?;
        if count == 0 || head.len() > LONGEST_HEAD {
            return Err(ErrorKind::InvalidData.into());
        }
        head.extend_from_slice(block.get(..count).unwrap_or_default());
    }
    Ok(String::from_utf8_lossy(&head).into_owned())
}

fn refuse(stream: &mut TcpStream, status: &str) -> std::io::Result<()> {
    write!(
        stream,
        "HTTP/1.1 {status}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n"
    )?;
    stream.flush()
}

/// The media type of a file of the page.
fn kind(name: &str) -> &'static str {
    let extension = Path::new(name).extension().and_then(|e| e.to_str());
    match extension.unwrap_or_default() {
        "html" => "text/html; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "svg" => "image/svg+xml",
        "wasm" => "application/wasm",
        _ => "application/octet-stream",
    }
}
