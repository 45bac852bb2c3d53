//! Tensors by name: what is expected of one, and the message for when it is not there.

use std::collections::BTreeMap;

use safetensors::Dtype;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::safetensors::{Container, Tensor};

/// What the formats had to give up of the values.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct EncodingLosses {
    /// Per tensor: values outside the format's range.
    pub clamped: BTreeMap<String, u64>,
    /// Per tensor: values above 0 that are too small for the format, and stored as 0.
    pub underflowed: BTreeMap<String, u64>,
    /// Distance texels whose deviation rounds to zero, so that only the floor of the test is left.
    pub variance_floor_hits: u64,
}

impl Container {
    /// Adds a tensor of little-endian numbers.
    pub fn put<const N: usize>(
        &mut self,
        name: &str,
        dtype: Dtype,
        shape: &[usize],
        numbers: impl Iterator<Item = [u8; N]>,
    ) {
        self.put_bytes(name, dtype, shape, numbers.flatten().collect());
    }

    pub fn put_bytes(&mut self, name: &str, dtype: Dtype, shape: &[usize], bytes: Vec<u8>) {
        self.tensors.insert(name.to_owned(), Tensor { dtype, shape: shape.to_vec(), bytes });
    }

    /// Adds metadata as compact JSON with sorted keys.
    pub fn put_json(&mut self, key: &str, value: &impl Serialize) {
        // Plain records of numbers and strings: nothing in them can fail to serialise.
        let text = serde_json::to_value(value).unwrap_or_default().to_string();
        self.metadata.insert(key.to_owned(), text);
    }

    pub fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Metadata as text.
    ///
    /// # Errors
    /// It is missing.
    pub fn text(&self, key: &str) -> Result<&String, String> {
        self.metadata.get(key).ok_or_else(|| format!("metadata '{key}' is missing"))
    }

    /// Metadata as JSON.
    ///
    /// # Errors
    /// It is missing, or something else.
    pub fn json<T: DeserializeOwned>(&self, key: &str) -> Result<T, String> {
        serde_json::from_str(self.text(key)?).map_err(|e| format!("metadata '{key}': {e}"))
    }

    /// A tensor of one of these number types and of this shape; `None` stands for any length.
    ///
    /// # Errors
    /// It is missing, or of another type or shape.
    pub fn tensor(&self, name: &str, dtypes: &[Dtype], shape: &[Option<usize>]) -> Result<&Tensor, String> {
        let tensor = self.tensors.get(name).ok_or_else(|| format!("tensor '{name}' is missing"))?;
        let fits = tensor.shape.len() == shape.len()
            && tensor.shape.iter().zip(shape).all(|(n, wanted)| wanted.is_none_or(|w| w == *n));
        if !fits || !dtypes.contains(&tensor.dtype) {
            return Err(format!(
                "tensor '{name}' is {} {:?}, expected {dtypes:?} {shape:?}",
                tensor.dtype, tensor.shape
            ));
        }
        Ok(tensor)
    }
}

impl Tensor {
    pub fn f32s(&self) -> Vec<f32> {
        self.bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    }

    pub fn u16s(&self) -> impl Iterator<Item = u16> + '_ {
        self.bytes.as_chunks::<2>().0.iter().map(|b| u16::from_le_bytes(*b))
    }

    pub fn u32s(&self) -> impl Iterator<Item = u32> + '_ {
        self.bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b))
    }

    /// Interior resolution of square maps in the second and third dimension, with this border.
    ///
    /// # Errors
    /// They are not square, or nothing but border.
    pub fn map_resolution(&self, name: &str, border: usize) -> Result<usize, String> {
        let (rows, columns) = (self.shape[1], self.shape[2]);
        match columns.checked_sub(2 * border) {
            Some(r) if r > 0 && rows == columns => Ok(r),
            _ => Err(format!("tensor '{name}' has maps of {columns}×{rows} with border {border}")),
        }
    }
}
