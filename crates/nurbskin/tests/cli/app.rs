//! `app`: the page on the loopback address.

use super::Bench;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};

/// The server, ended with the test.
struct Server {
    child: Child,
    host: String,
}

impl Server {
    fn new(bench: &Bench) -> Self {
        let mut child = bench
            .command("app --no-open --folder page")
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let out = child.stdout.take().unwrap();
        BufReader::new(out).read_line(&mut line).unwrap();
        let host = line.trim().strip_prefix("http://").unwrap();
        let host = host.strip_suffix('/').unwrap().to_owned();
        Self { child, host }
    }

    /// Head and body of the answer.
    fn ask(&self, line: &str, host: &str) -> (String, String) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        write!(stream, "{line} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.to_owned(), body.to_owned())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn the_page_is_served_and_nothing_else() {
    let bench = Bench::new();
    std::fs::create_dir_all(bench.path("page/assets")).unwrap();
    bench.write("page/index.html", "<p>page</p>");
    bench.write("page/assets/a.js", "1");
    bench.write("secret", "not of the page");
    let server = Server::new(&bench);
    let own = server.host.clone();
    assert!(own.starts_with("127.0.0.1:"), "{own}");
    for path in ["/", "/index.html", "/?date=0"] {
        let (head, body) = server.ask(&format!("GET {path}"), &own);
        assert!(head.starts_with("HTTP/1.1 200"), "{path}: {head}");
        assert!(head.contains("text/html") && head.contains("cross-origin-opener-policy"));
        assert_eq!(body, "<p>page</p>");
    }
    let (head, body) = server.ask("GET /assets/a.js", &own);
    assert!(head.contains("text/javascript"), "{head}");
    assert_eq!(body, "1");
    let (head, body) = server.ask("HEAD /", &own);
    assert!(head.contains("content-length: 11") && body.is_empty());
    for (line, host, status) in [
        ("GET /none", own.as_str(), "404"),
        ("GET /../secret", &own, "404"),
        ("GET /assets/../../secret", &own, "404"),
        ("GET //etc/passwd", &own, "404"),
        ("POST /", &own, "405"),
        ("GET /", "example.org", "403"),
    ] {
        let (head, body) = server.ask(line, host);
        assert!(
            head.starts_with(&format!("HTTP/1.1 {status}")),
            "{line}: {head}"
        );
        assert_eq!(body, "", "{line}");
    }
}

#[test]
fn a_folder_without_a_page_is_refused() {
    let bench = Bench::new();
    bench.refuses("app --no-open --folder .", 2, "there is no index.html");
}
