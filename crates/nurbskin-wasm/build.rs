//! The stack of the module for browsers.

/// Bytes of the stack. Guard: the main thread of the command has 8 MiB, the linker's default of 1 MiB is an eighth of it.
const STACK: usize = 8 << 20;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_ARCH").as_deref() == Ok("wasm32") {
        println!("cargo:rustc-link-arg-cdylib=-zstack-size={STACK}");
    }
}
