//! Typed arrays in buffers, checked before a single element is read.

use super::buffers::Buffers;
use super::json::{Accessor, Root, Whole};
use crate::Result;
use crate::io::input::Input;
use crate::math::DMat4;

/// Vertices and triangles that a file of no size may make out of repeated instances; a file may
/// have more in proportion to its bytes. With 24 bytes a vertex and 36 a triangle this stays below 200 MB and 40 times
/// the file.
const FREE_VERTICES: usize = 2_000_000;
const FREE_TRIANGLES: usize = 4_000_000;

/// Reads accessors of one file.
pub(crate) struct Accessors<'a> {
    pub input: Input<'a>,
    pub root: &'a Root,
    pub buffers: &'a Buffers<'a>,
}

/// glTF's number types, by their OpenGL codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: Whole) -> Option<Self> {
        Some(match code.0 {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value at the start of `bytes`; normalised integers stand for −1..1 or 0..1
    /// (glTF 2.0, section 3.6.2.2).
    fn decode(self, bytes: &[u8], normalized: bool) -> f64 {
        let full = if normalized { self.full() } else { 1.0 };
        let value = match self {
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            Self::U16 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            Self::U32 => f64::from(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
            Self::F32 => f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
        };
        (value / full).max(if normalized { -1.0 } else { f64::NEG_INFINITY })
    }

    fn full(self) -> f64 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32_767.0,
            Self::U16 => 65_535.0,
            Self::U32 | Self::F32 => 1.0,
        }
    }
}

/// Elements at equal distances in a buffer view that was found long enough for them.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Strided<'a> {
    fn element(&self, i: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

impl<'a> Accessors<'a> {
    /// Most vertices that instances may make out of the file.
    pub fn max_vertices(&self) -> usize {
        FREE_VERTICES + self.buffers.n_loaded() / 4
    }

    /// Most triangles that instances may make out of the file.
    pub fn max_triangles(&self) -> usize {
        FREE_TRIANGLES + self.buffers.n_loaded() / 2
    }

    /// The JSON of an accessor.
    pub fn get(&self, accessor: usize) -> Result<&'a Accessor> {
        self.root.accessors.get(accessor).ok_or_else(|| {
            let found = format!("{} of them", self.root.accessors.len());
            self.input.error(format!("accessor {accessor}"), "an accessor that exists", found)
        })
    }

    /// Vectors of N numbers, of one of the allowed component types.
    pub fn vectors<const N: usize>(
        &self,
        accessor: usize,
        allowed: &[Component],
    ) -> Result<Vec<[f64; N]>> {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let json = self.get(accessor)?;
        let component = self.component(accessor, json, kind, allowed)?;
        self.elements(accessor, json, N * component.size(), [0.0; N], |bytes: &[u8]| {
            std::array::from_fn(|c| {
                component.decode(&bytes[c * component.size()..], json.normalized)
            })
        })
    }

    /// 4 × 4 matrices of 32-bit numbers.
    pub fn matrices(&self, accessor: usize) -> Result<Vec<DMat4>> {
        let json = self.get(accessor)?;
        let component = self.component(accessor, json, "MAT4", &[Component::F32])?;
        let zero = [0.0; 16];
        let matrices =
            self.elements(accessor, json, 16 * component.size(), zero, |bytes: &[u8]| {
                std::array::from_fn(|c| component.decode(&bytes[c * component.size()..], false))
            })?;
        Ok(matrices.iter().map(DMat4::from_cols_array).collect())
    }

    /// Vertex indices.
    pub fn indices(&self, accessor: usize) -> Result<Vec<u32>> {
        let json = self.get(accessor)?;
        let allowed = [Component::U8, Component::U16, Component::U32];
        let component = self.component(accessor, json, "SCALAR", &allowed)?;
        self.elements(accessor, json, component.size(), 0, |bytes: &[u8]| {
            component.decode(bytes, false) as u32
        })
    }

    fn component(
        &self,
        accessor: usize,
        json: &Accessor,
        kind: &str,
        allowed: &[Component],
    ) -> Result<Component> {
        let component = Component::from_code(json.component_type).filter(|c| allowed.contains(c));
        component.filter(|_| json.kind == kind).ok_or_else(|| {
            let found = format!("{} of component type {}", json.kind, json.component_type.0);
            self.input.error(
                format!("accessor {accessor}"),
                format!("{kind} of {allowed:?}"),
                found,
            )
        })
    }

    /// All elements: those of the buffer view, or `zero` without one, with the sparse ones on top.
    fn elements<T: Clone>(
        &self,
        accessor: usize,
        json: &Accessor,
        size: usize,
        zero: T,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let place = format!("accessor {accessor}");
        let count = json.count.0;
        let mut elements = match json.buffer_view {
            None if count > self.max_vertices() => {
                let expected = format!("at most {} elements without bytes", self.max_vertices());
                return Err(self.input.error(place, expected, count.to_string()));
            }
            None => vec![zero; count],
            Some(view) => {
                let strided = self.strided(&place, view, json.byte_offset, count, size)?;
                (0..count).map(|i| decode(strided.element(i))).collect()
            }
        };
        let Some(sparse) = &json.sparse else { return Ok(elements) };
        let n_sparse = sparse.count.0;
        let allowed = [Component::U8, Component::U16, Component::U32];
        let Some(component) =
            Component::from_code(sparse.indices.component_type).filter(|c| allowed.contains(c))
        else {
            let found = format!("component type {}", sparse.indices.component_type.0);
            return Err(self.input.error(place, "sparse indices of U8, U16 or U32", found));
        };
        let indices = &sparse.indices;
        let ids = self.strided(
            &place,
            indices.buffer_view,
            indices.byte_offset,
            n_sparse,
            component.size(),
        )?;
        let values = self.strided(
            &place,
            sparse.values.buffer_view,
            sparse.values.byte_offset,
            n_sparse,
            size,
        )?;
        for i in 0..n_sparse {
            let id = component.decode(ids.element(i), false) as usize;
            let Some(element) = elements.get_mut(id) else {
                let found = format!("sparse element {id} of {count}");
                return Err(self.input.error(place, "sparse indices in range", found));
            };
            *element = decode(values.element(i));
        }
        Ok(elements)
    }

    /// `count` elements of `size` bytes in a buffer view, which must be long enough.
    fn strided(
        &self,
        place: &str,
        view: Whole,
        offset: Option<Whole>,
        count: usize,
        size: usize,
    ) -> Result<Strided<'a>> {
        let bytes = self.buffers.view(view.0)?;
        let offset = offset.map_or(0, |offset| offset.0);
        let stride = self.root.buffer_views[view.0].byte_stride.map_or(size, |stride| stride.0);
        let end = count
            .checked_sub(1)
            .and_then(|last| last.checked_mul(stride)?.checked_add(size)?.checked_add(offset));
        match end {
            Some(end) if end <= bytes.len() && stride >= size => {
                Ok(Strided { bytes: &bytes[offset..], stride, size })
            }
            _ => {
                let expected =
                    format!("{count} elements of {size} bytes, {stride} apart, from byte {offset}");
                Err(self.input.error(
                    place,
                    expected,
                    format!("a buffer view of {} bytes", bytes.len()),
                ))
            }
        }
    }
}
