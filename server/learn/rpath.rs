// How an executable that links `learn` finds libtorch, and how it switches MKL to its fast path.
//
// Shared by every crate that makes an executable or a test on top of `learn`: a build script's
// link arguments do not reach dependents, so each such crate has a `build.rs` of
//
//     include!("../learn/rpath.rs");
//     fn main() { emit_link_arguments(); }

/// Run path to `$LIBTORCH/lib` (then to `lib` beside the executable, for a copied folder), and
/// the MKL switch of `learn::device` kept and exported although no Rust code calls it.
fn emit_link_arguments() {
    println!("cargo:rerun-if-env-changed=LIBTORCH");
    if let Ok(libtorch) = std::env::var("LIBTORCH") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{libtorch}/lib:$ORIGIN/lib");
    } else {
        println!("cargo:warning=LIBTORCH is not set; `cargo xtask setup` unpacks one");
    }
    println!("cargo:rustc-link-arg=-Wl,--undefined=mkl_serv_intel_cpu_true");
    println!("cargo:rustc-link-arg=-Wl,--export-dynamic-symbol=mkl_serv_intel_cpu_true");
}
