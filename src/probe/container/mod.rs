//! Tensors and metadata in one file, with hashes.

mod safetensors;
mod tensors;

pub use self::safetensors::{Container, FileError, Tensor};
pub use self::tensors::EncodingLosses;
