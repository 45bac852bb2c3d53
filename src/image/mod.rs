//! Pictures: linear light in EXR files, display codes in PNG files, and the conversion from the first to the second.

mod any;
mod error;
mod exr_file;
mod exr_layers;
mod exr_read;
mod exr_window;
mod exr_write;
mod hdr;
mod jpeg;
mod layered;
mod light_map;
mod picture;
mod png;
mod tonemap;

pub use any::{AnyImage, ImageHeader};
pub use error::ImageError;
pub use exr_write::exr_bytes;
pub use layered::LayeredImage;
pub use picture::{Picture, Picture8};
pub use tonemap::{auto_exposure, tonemap};
