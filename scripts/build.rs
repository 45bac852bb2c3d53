fn main() {
    let d = std::env::var("CARGO_MANIFEST_DIR").unwrap() + "/.deps/embree/lib";
    println!("cargo:rustc-link-search=native={d}");
    println!("cargo:rustc-link-arg=-Wl,-rpath,{d}");
}
