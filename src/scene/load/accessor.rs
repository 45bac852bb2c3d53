//! Typed reading of accessors: strided, sparse, normalised, quantised. Every bound is checked before data is read, and
//! memory is allocated only for elements that the file's bytes contain.

use gltf::json::Index;
use gltf::json::accessor::{Accessor as Definition, ComponentType, Type};
use gltf::json::validation::Checked;

use super::buffers::Buffers;
use super::document::Document;
use crate::scene::error::{RE_EXPORT, SceneError};

/// An accessor after its bounds have been checked: all its elements lie within their buffers.
pub(super) struct Accessor<'a> {
    pub count: usize,
    pub components: usize,
    pub component_type: ComponentType,
    normalized: bool,
    /// `None` means that all elements are zero.
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
    place: String,
}

/// Elements `stride` bytes apart.
#[derive(Clone, Copy)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Replacements: element `indices[i]` is `values[i]`.
struct Sparse<'a> {
    indices: Vec<u32>,
    values: Strided<'a>,
}

impl<'a> Accessor<'a> {
    /// Looks up the accessor and checks all its bounds. Error messages start with `place`, for example
    /// `mesh 3 primitive 0: POSITION`.
    pub fn resolve(
        document: &Document,
        buffers: &'a Buffers,
        index: Index<Definition>,
        place: &str,
    ) -> Result<Accessor<'a>, SceneError> {
        let definition = document.get(&document.accessors, "accessor", index, &place)?;
        let place = format!("{place} accessor {index}");
        let invalid = |what: String| document.invalid(place.clone(), what, RE_EXPORT);
        let (Checked::Valid(component), Checked::Valid(kind)) =
            (definition.component_type.as_ref(), definition.type_.as_ref())
        else {
            return Err(invalid("glTF does not define its type or componentType".to_owned()));
        };
        if matches!(kind, Type::Mat2 | Type::Mat3) {
            return Err(invalid("it holds 2×2 or 3×3 matrices, which no part of a scene uses".to_owned()));
        }
        let size = component.0.size() * kind.multiplicity();
        let count = definition.count.0;
        let base = match definition.buffer_view {
            Some(view) => {
                let (bytes, stride) = buffers.view(document, view, &place)?;
                let offset = definition.byte_offset.map_or(0, |offset| offset.0);
                Some(strided(bytes, offset, stride, count, size).map_err(invalid)?)
            }
            // Without data all elements are zero, so no buffer bounds their number. The size of the input does instead.
            None if count > buffers.input_bytes => {
                return Err(invalid(format!("it claims {count} elements without data, more than the file has bytes")));
            }
            None => None,
        };
        let sparse = match &definition.sparse {
            Some(sparse) => Some(replacements(document, buffers, sparse, count, size, &place)?),
            None => None,
        };
        Ok(Accessor {
            count: count as usize,
            components: kind.multiplicity(),
            component_type: component.0,
            normalized: definition.normalized,
            base,
            sparse,
            place,
        })
    }

    /// Refuses an accessor whose number of components is not one of `allowed`.
    pub fn expect_components(&self, document: &Document, allowed: &[usize]) -> Result<(), SceneError> {
        match allowed.contains(&self.components) {
            true => Ok(()),
            false => {
                let what = format!("it has {} components per element, not one of {allowed:?}", self.components);
                Err(document.invalid(self.place.clone(), what, RE_EXPORT))
            }
        }
    }

    /// Refuses an accessor whose number of elements is not `count`, which is that of `of`.
    pub fn expect_count(&self, document: &Document, count: usize, of: &str) -> Result<(), SceneError> {
        match self.count == count {
            true => Ok(()),
            false => {
                let what = format!("it has {} elements, but {of} has {count}", self.count);
                Err(document.invalid(self.place.clone(), what, RE_EXPORT))
            }
        }
    }

    /// All elements as floats. Missing components are taken from `fill`. `unsigned_is_normalized` is for attributes
    /// whose unsigned integers always mean fractions (colours, weights), even if the accessor lacks the flag
    /// `normalized`.
    pub fn floats<const N: usize>(&self, fill: [f32; N], unsigned_is_normalized: bool) -> Vec<[f32; N]> {
        use ComponentType::{U8, U16};
        let normalized = self.normalized || (unsigned_is_normalized && matches!(self.component_type, U8 | U16));
        let width = self.component_type.size();
        self.elements(fill, |bytes, element: &mut [f32; N]| {
            for (value, raw) in element.iter_mut().zip(bytes.chunks_exact(width)) {
                *value = float(raw, self.component_type, normalized);
            }
        })
    }

    /// All elements as unsigned integers. `None` if the accessor holds signed or floating-point numbers.
    pub fn integers<const N: usize>(&self) -> Option<Vec<[u32; N]>> {
        let component_type = self.component_type;
        if !matches!(component_type, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return None;
        }
        let width = component_type.size();
        Some(self.elements([0; N], |bytes, element: &mut [u32; N]| {
            for (value, raw) in element.iter_mut().zip(bytes.chunks_exact(width)) {
                *value = integer(raw, component_type);
            }
        }))
    }

    fn elements<E: Copy>(&self, fill: E, decode: impl Fn(&[u8], &mut E)) -> Vec<E> {
        let size = self.component_type.size() * self.components;
        let mut elements = vec![fill; self.count];
        match self.base {
            Some(base) => elements.iter_mut().enumerate().for_each(|(i, e)| decode(base.element(i, size), e)),
            None => elements.iter_mut().for_each(|e| decode(&[0; MAX_ELEMENT_BYTES][..size], e)),
        }
        if let Some(sparse) = &self.sparse {
            for (i, &target) in sparse.indices.iter().enumerate() {
                let element = &mut elements[target as usize];
                *element = fill;
                decode(sparse.values.element(i, size), element);
            }
        }
        elements
    }
}

/// Bytes of the largest element, a 4×4 matrix of floats.
const MAX_ELEMENT_BYTES: usize = 64;

impl<'a> Strided<'a> {
    fn element(&self, index: usize, size: usize) -> &'a [u8] {
        let start = index * self.stride;
        &self.bytes[start..start + size]
    }
}

/// `count` elements of `size` bytes in `bytes`, starting at `offset`. The error describes the fault.
fn strided(bytes: &[u8], offset: u64, stride: Option<usize>, count: u64, size: usize) -> Result<Strided<'_>, String> {
    let stride = stride.unwrap_or(size);
    if stride < size {
        return Err(format!("byteStride {stride} is less than the {size} bytes of an element"));
    }
    let needed = match count.checked_sub(1) {
        None => Some(0),
        Some(gaps) => gaps.checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64)),
    };
    match needed.and_then(|n| n.checked_add(offset)) {
        Some(end) if end <= bytes.len() as u64 => Ok(Strided { bytes: &bytes[offset as usize..], stride }),
        _ if count == 0 => Ok(Strided { bytes: &[], stride }),
        _ => Err(format!("{count} elements from byte {offset} do not fit its buffer view of {} bytes", bytes.len())),
    }
}

fn replacements<'a>(
    document: &Document,
    buffers: &'a Buffers,
    sparse: &gltf::json::accessor::sparse::Sparse,
    count: u64,
    size: usize,
    place: &str,
) -> Result<Sparse<'a>, SceneError> {
    let place = format!("{place} sparse");
    let invalid = |what: String| document.invalid(place.clone(), what, RE_EXPORT);
    let Checked::Valid(index_type) = sparse.indices.component_type.as_ref() else {
        return Err(invalid("its indices are not unsigned integers".to_owned()));
    };
    let width = index_type.0.size();
    let (bytes, _) = buffers.view(document, sparse.indices.buffer_view, &place)?;
    let indices = strided(bytes, sparse.indices.byte_offset.0, None, sparse.count.0, width).map_err(&invalid)?;
    let (bytes, _) = buffers.view(document, sparse.values.buffer_view, &place)?;
    let values = strided(bytes, sparse.values.byte_offset.0, None, sparse.count.0, size).map_err(&invalid)?;
    let indices: Vec<u32> =
        (0..sparse.count.0 as usize).map(|i| integer(indices.element(i, width), index_type.0)).collect();
    match indices.iter().find(|&&index| u64::from(index) >= count) {
        Some(index) => Err(invalid(format!("index {index} is out of range of its {count} elements"))),
        None => Ok(Sparse { indices, values }),
    }
}

/// The unsigned integer of little-endian bytes. `raw` holds 1, 2 or 4 of them.
fn integer(raw: &[u8], component_type: ComponentType) -> u32 {
    match (component_type, raw) {
        (ComponentType::U8 | ComponentType::I8, [a, ..]) => u32::from(*a),
        (ComponentType::U16 | ComponentType::I16, [a, b, ..]) => u32::from(u16::from_le_bytes([*a, *b])),
        (_, [a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        _ => 0,
    }
}

/// The float value of a component. Normalised integers follow glTF 2.0, section 3.6.2.2: c/255, c/65535, max(c/127,
/// −1), max(c/32767, −1).
fn float(raw: &[u8], component_type: ComponentType, normalized: bool) -> f32 {
    let bits = integer(raw, component_type);
    let (value, one) = match component_type {
        ComponentType::F32 => return f32::from_bits(bits),
        ComponentType::U8 => (bits as f32, 255.0),
        ComponentType::U16 => (bits as f32, 65535.0),
        ComponentType::U32 => return bits as f32,
        ComponentType::I8 => (f32::from(bits as u8 as i8), 127.0),
        ComponentType::I16 => (f32::from(bits as u16 as i16), 32767.0),
    };
    if normalized { (value / one).max(-1.0) } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normalised_integers_reach_both_ends() {
        assert_eq!(float(&[255], ComponentType::U8, true), 1.0);
        assert_eq!(float(&[0x80], ComponentType::I8, true), -1.0);
        assert_eq!(float(&[0x81], ComponentType::I8, true), -1.0);
        assert_eq!(float(&[0x00, 0x80], ComponentType::I16, true), -1.0);
        assert_eq!(float(&[0xff, 0x7f], ComponentType::I16, true), 1.0);
        assert_eq!(float(&[0xff, 0xff], ComponentType::I16, false), -1.0);
    }

    #[test]
    fn bounds_are_checked_without_overflow() {
        let bytes = [0; 12];
        assert!(strided(&bytes, 0, None, 1, 12).is_ok());
        assert!(strided(&bytes, 1, None, 1, 12).is_err());
        assert!(strided(&bytes, u64::MAX, None, 1, 12).is_err());
        assert!(strided(&bytes, 0, None, u64::MAX, 12).is_err());
        assert!(strided(&bytes, 0, Some(usize::MAX), 3, 4).is_err());
        assert!(strided(&bytes, 0, Some(0), 1000, 4).is_err());
        assert!(strided(&bytes, 0, Some(8), 2, 4).is_ok());
        assert!(strided(&bytes, 0, None, 0, 4).is_ok());
    }
}
