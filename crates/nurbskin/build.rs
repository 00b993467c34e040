//! Puts the built page of `web/` into the command, for `nurbskin app`, where the feature `app` is on; else does nothing.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "app")]
    if let Err(error) = page::pack() {
        println!("cargo::error={error}");
    }
}

#[cfg(feature = "app")]
mod page {
    use flate2::{Compression, write::GzEncoder};
    use std::fmt::Write as _;
    use std::io::Write as _;
    use std::path::{Path, PathBuf};
    use std::{env, fs};

    /// Compresses the files of the page and writes their list, which `verbs/app.rs` of the command includes.
    pub(crate) fn pack() -> Result<(), String> {
        let root = env::var("CARGO_MANIFEST_DIR").map_err(|e| e.to_string())?;
        let dist = Path::new(&root).join("../../web/dist");
        println!("cargo::rerun-if-changed={}", dist.display());
        let out = PathBuf::from(env::var("OUT_DIR").map_err(|e| e.to_string())?);
        let mut files = Vec::new();
        find(&dist, "", &mut files).map_err(|error| {
            format!("the feature `app` needs the built page: run `npm run wasm` and `npm run build` in web/ first ({error})")
        })?;
        files.sort();
        let mut list = String::from("&[\n");
        for (k, name) in files.iter().enumerate() {
            let packed = out.join(format!("{k}.gz"));
            let done = fs::read(dist.join(name)).and_then(|content| {
                let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
                encoder.write_all(&content)?;
                fs::write(&packed, encoder.finish()?)
            });
            done.map_err(|error| format!("{name}: {error}"))?;
            // Writing to a string cannot fail.
            let _ = writeln!(
                list,
                "({name:?}, include_bytes!({:?})),",
                packed.display().to_string()
            );
        }
        list.push(']');
        fs::write(out.join("page.rs"), list).map_err(|error| error.to_string())
    }

    /// The files below a folder, as names with `/`.
    fn find(folder: &Path, before: &str, files: &mut Vec<String>) -> std::io::Result<()> {
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = format!("{before}{}", entry.file_name().to_string_lossy());
            if entry.file_type()?.is_dir() {
                find(&entry.path(), &format!("{name}/"), files)?;
            } else {
                files.push(name);
            }
        }
        Ok(())
    }
}
