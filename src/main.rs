use embree4_rs::Device;
fn main() {
    let d = Device::try_new(Some("threads=1\0")).unwrap();
    println!("{:?}", d.error());
}
