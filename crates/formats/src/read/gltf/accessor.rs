//! Accessors: elements are decoded one by one on demand, straight from the buffers; nothing is copied, and what is
//! claimed is checked against what is there before the first element is read.

use super::container::{Document, out_of_range};
use super::schema;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    /// From the number that OpenGL, and so glTF, gives it.
    fn from_number(number: u64) -> Result<Component, String> {
        Ok(match number {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            other => return Err(format!("component type {other} is unknown")),
        })
    }

    fn size(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The value at the start of `bytes`, which hold at least [`Component::size`].
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let (value, largest) = match self {
            Component::I8 => (f64::from(bytes[0] as i8), 127.0),
            Component::U8 => (f64::from(bytes[0]), 255.0),
            Component::I16 => (f64::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32_767.0),
            Component::U16 => (f64::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65_535.0),
            Component::U32 => (f64::from(self.index(bytes)), 4_294_967_295.0),
            Component::F32 => {
                return f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
            }
        };
        // glTF 2.0, 3.6.2.2: the most negative number is -1, too.
        if normalized { (value / largest).max(-1.0) } else { value }
    }

    /// The unsigned number at the start of `bytes`.
    fn index(self, bytes: &[u8]) -> u32 {
        bytes[..self.size()].iter().rev().fold(0, |index, &byte| index << 8 | u32::from(byte))
    }
}

/// A checked accessor: every element below `count` can be read.
#[derive(Clone, Debug)]
pub(super) struct Accessor<'a> {
    /// Bytes from the first element on; `None`: all zero.
    data: Option<&'a [u8]>,
    stride: usize,
    pub(super) count: usize,
    component: Component,
    /// Components per element.
    pub(super) width: usize,
    normalized: bool,
    /// Replaced elements, by number in rising order, and where their values start.
    replaced: Vec<(u32, usize)>,
    values: &'a [u8],
}

impl<'a> Accessor<'a> {
    /// Opens accessor `index`, which must have one of `widths` components per element.
    pub(super) fn open(document: &'a Document<'a>, index: usize, widths: &[usize]) -> Result<Accessor<'a>, String> {
        let accessors = &document.root.accessors;
        let json = accessors.get(index).ok_or_else(|| out_of_range("accessor", index, accessors.len()))?;
        let component = Component::from_number(json.component_type)?;
        let width = match json.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 0,
        };
        if !widths.contains(&width) {
            return Err(format!("type {} is not what is expected here", json.kind));
        }
        let size = width * component.size();
        let (data, stride) = match json.buffer_view {
            Some(view) => {
                let (view, bytes) = document.view(view)?;
                let stride = view.byte_stride.filter(|&stride| stride != 0).unwrap_or(size);
                if stride < size {
                    return Err(format!("a stride of {stride} bytes is less than an element's {size}"));
                }
                (Some(elements(bytes, json.byte_offset, json.count, stride, size)?), stride)
            }
            None if json.sparse.is_none() => return Err("it has no data (no buffer view)".to_owned()),
            None if json.count > document.total_bytes() => {
                return Err(format!("{} elements are more than the file has bytes for", json.count));
            }
            None => (None, size),
        };
        let mut accessor = Accessor {
            data,
            stride,
            count: json.count,
            component,
            width,
            normalized: json.normalized,
            replaced: Vec::new(),
            values: &[],
        };
        if let Some(sparse) = &json.sparse {
            accessor.replace(document, sparse, size)?;
        }
        Ok(accessor)
    }

    /// Takes the sparse elements in.
    fn replace(&mut self, document: &'a Document<'a>, json: &schema::Sparse, size: usize) -> Result<(), String> {
        let component = Component::from_number(json.indices.component_type)?;
        let (_, bytes) = document.view(json.indices.buffer_view)?;
        let step = component.size();
        let indices = elements(bytes, json.indices.byte_offset, json.count, step, step)?;
        let (_, bytes) = document.view(json.values.buffer_view)?;
        self.values = elements(bytes, json.values.byte_offset, json.count, size, size)?;
        for position in 0..json.count {
            let index = component.index(&indices[position * step..]);
            if index as usize >= self.count {
                return Err(out_of_range("sparse element", index as usize, self.count));
            }
            self.replaced.push((index, position * size));
        }
        self.replaced.sort_unstable();
        Ok(())
    }

    /// Bytes of an element; `None`: zero.
    fn bytes(&self, element: usize) -> Option<&'a [u8]> {
        if let Ok(found) = self.replaced.binary_search_by_key(&element, |&(index, _)| index as usize) {
            return Some(&self.values[self.replaced[found].1..]);
        }
        self.data.map(|data| &data[element * self.stride..])
    }

    /// The components of an element (`element < count`), the missing ones `fill`.
    pub(super) fn vector<const N: usize>(&self, element: usize, fill: f64) -> [f64; N] {
        let bytes = self.bytes(element);
        std::array::from_fn(|k| match bytes {
            _ if k >= self.width => fill,
            Some(bytes) => self.component.value(&bytes[k * self.component.size()..], self.normalized),
            None => 0.0,
        })
    }

    /// Are the elements unsigned whole numbers?
    pub(super) fn is_unsigned(&self) -> bool {
        matches!(self.component, Component::U8 | Component::U16 | Component::U32)
    }

    /// An element as an index (`element < count`).
    pub(super) fn index(&self, element: usize) -> u32 {
        self.bytes(element).map_or(0, |bytes| self.component.index(bytes))
    }
}

/// The bytes of `count` elements, from the first to the last's end.
fn elements(bytes: &[u8], offset: usize, count: usize, stride: usize, size: usize) -> Result<&[u8], String> {
    let Some(last) = count.checked_sub(1) else { return Ok(&[]) };
    let end = last.checked_mul(stride).and_then(|n| n.checked_add(size)).and_then(|n| n.checked_add(offset));
    end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
        format!(
            "{count} elements of {size} bytes every {stride} from {offset} do not fit a buffer view of {} bytes",
            bytes.len()
        )
    })
}
