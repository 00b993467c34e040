//! Fills the template of the page.
//!
//! Style, script and data are inserted into one HTML file, in the order of the template. The page loads nothing from
//! other files or from the network.

use super::document::Document;
use super::packed::deflated_text;
use nurbskin_geometry::{Error, Result};
use std::sync::LazyLock;

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
/// Made of `web/packages/report` by `npm run report` in `web/`.
const SCRIPT: &str = include_str!("page/page.js");
/// The script as the page unpacks it: DEFLATE, as base64. Each page has the same.
static PACKED: LazyLock<String> = LazyLock::new(|| deflated_text(SCRIPT.as_bytes()));

/// One self-contained HTML file: script, style and data are embedded, and nothing is loaded from elsewhere.
///
/// # Errors
/// [`Error::Invalid`] if the data cannot be serialised, which does not occur.
pub fn page(document: &Document) -> Result<String> {
    let data = serde_json::to_string(document)
        .map_err(|e| Error::invalid(format!("the data of the page cannot be written: {e}")))?;
    // No text in the data may close the enclosing element.
    let data = data.replace('<', "\\u003c");
    let title = escaped(&document.title);
    let parts = [
        ("/*TITLE*/", title.as_str()),
        ("/*STYLE*/", STYLE),
        ("/*DATA*/", &data),
        ("/*SCRIPT*/", PACKED.as_str()),
    ];
    // In the order of the template, so that no placeholder is searched for inside inserted text.
    let mut page = String::with_capacity(TEMPLATE.len() + data.len() + PACKED.len() + STYLE.len());
    let mut rest = TEMPLATE;
    while let Some((at, mark, part)) = parts
        .iter()
        .filter_map(|(mark, part)| Some((rest.find(mark)?, mark, part)))
        .min_by_key(|found| found.0)
    {
        page.push_str(rest.get(..at).unwrap_or_default());
        page.push_str(part);
        rest = rest.get(at + mark.len()..).unwrap_or_default();
    }
    page.push_str(rest);
    Ok(page)
}

/// Text with HTML escapes.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            other => escaped.push(other),
        }
    }
    escaped
}
