//! Link arguments for this crate's tests and examples.

include!("../learn/rpath.rs");

fn main() {
    println!("cargo:rerun-if-changed=../learn/rpath.rs");
    emit_link_arguments();
}
