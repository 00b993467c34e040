//! Tables in Markdown, aligned so that they read as plain text too.

/// Prints a title and a table: the first column to the left, the others to the right.
pub(crate) fn print(title: &str, head: &[&str], rows: &[Vec<String>]) {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        let longest = cells.map(|cell| cell.chars().count()).max().unwrap_or(0);
        longest.max(head[column].chars().count())
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    println!("\n{title}\n");
    print_row(&widths, head);
    let dashes = |(column, &width): (usize, &usize)| match column {
        0 => "-".repeat(width),
        _ => "-".repeat(width - 1) + ":",
    };
    print_row(
        &widths,
        &widths.iter().enumerate().map(dashes).collect::<Vec<_>>(),
    );
    for row in rows {
        print_row(&widths, row);
    }
}

fn print_row<S: AsRef<str>>(widths: &[usize], cells: &[S]) {
    let mut line = String::from("|");
    for (column, (&width, cell)) in widths.iter().zip(cells).enumerate() {
        let cell = cell.as_ref();
        line += &match column {
            0 => format!(" {cell:<width$} |"),
            _ => format!(" {cell:>width$} |"),
        };
    }
    println!("{line}");
}

/// The value as `f` writes it, or a dash where there is none.
pub(crate) fn or_dash<T>(value: Option<T>, f: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "-".into(), f)
}
