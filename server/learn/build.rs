//! Link arguments for this crate's tests and examples.

include!("rpath.rs");

fn main() {
    println!("cargo:rerun-if-changed=rpath.rs");
    emit_link_arguments();
}
