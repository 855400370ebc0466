//! Vertex data: the `gltf` crate decodes them, and indexes unchecked; here every range is checked before it does.

use super::container::{Document, found};
use crate::read::MAX_FACES;
use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::json::accessor::sparse::Sparse;
use gltf::json::buffer::View;
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

/// Looks an element up: its components as numbers, normalised where the file says so.
pub(super) type Lookup<'a, const N: usize> = Box<dyn Fn(usize) -> [f64; N] + 'a>;

/// A checked accessor: every element below `count` can be read.
pub(super) struct Accessor<'a> {
    document: &'a Document<'a>,
    inner: gltf::Accessor<'a>,
    pub(super) count: usize,
    pub(super) dimensions: Dimensions,
    component: DataType,
}

impl<'a> Accessor<'a> {
    /// Opens an accessor, which must be of one of the types `expected`.
    pub(super) fn open(
        document: &'a Document<'a>,
        index: Index<json::Accessor>,
        expected: &[Dimensions],
    ) -> Result<Accessor<'a>, String> {
        let json = found(document.root(), "accessor", index)?;
        let (Checked::Valid(component), Checked::Valid(dimensions)) = (json.component_type, json.type_) else {
            return Err("its type or component type is none of glTF's".to_owned());
        };
        if !expected.contains(&dimensions) {
            return Err(format!("type {} is not what is expected here", format!("{dimensions:?}").to_uppercase()));
        }
        let size = dimensions.multiplicity() * component.0.size();
        match json.buffer_view {
            Some(view) => check(document, view, json.byte_offset.unwrap_or_default().0, json.count.0, size)?,
            None if json.sparse.is_none() => return Err("it has no data (no buffer view)".to_owned()),
            None if json.count.0 > document.total_bytes() as u64 => {
                return Err(format!("{} elements are more than the file has bytes for", json.count.0));
            }
            None => {}
        }
        if let Some(sparse) = &json.sparse {
            check_sparse(document, sparse, json.count.0, size)?;
        }
        let inner = document.gltf.accessors().nth(index.value()).ok_or("it is not there")?;
        Ok(Accessor { document, count: inner.count(), inner, dimensions, component: component.0 })
    }

    /// All elements as vectors of `N` components, which is what they must have.
    pub(super) fn vectors<const N: usize>(&self) -> Lookup<'a, N>
    where
        [i8; N]: Item,
        [u8; N]: Item,
        [i16; N]: Item,
        [u16; N]: Item,
        [u32; N]: Item,
        [f32; N]: Item,
    {
        // glTF 2.0, 3.6.2.2.
        match self.component {
            DataType::I8 => self.lookup::<i8, N>(127.0),
            DataType::U8 => self.lookup::<u8, N>(255.0),
            DataType::I16 => self.lookup::<i16, N>(32_767.0),
            DataType::U16 => self.lookup::<u16, N>(65_535.0),
            DataType::U32 => self.lookup::<u32, N>(4_294_967_295.0),
            DataType::F32 => self.lookup::<f32, N>(1.0),
        }
    }

    fn lookup<T: Copy + Into<f64> + 'a, const N: usize>(&self, largest: f64) -> Lookup<'a, N>
    where
        [T; N]: Item,
    {
        let is_normalized = self.inner.normalized() && self.component != DataType::F32;
        let convert = move |element: [T; N]| {
            // The most negative number is -1, too.
            element.map(|value| if is_normalized { (value.into() / largest).max(-1.0) } else { value.into() })
        };
        match self.elements::<[T; N]>() {
            None => Box::new(|_| [0.0; N]),
            // Plain elements are looked up where they lie: thousands of primitives may share one accessor.
            Some(Iter::Standard(items)) => {
                Box::new(move |element| items.clone().nth(element).map_or([0.0; N], convert))
            }
            Some(sparse) => {
                let items: Vec<[T; N]> = sparse.collect();
                Box::new(move |element| items.get(element).copied().map_or([0.0; N], convert))
            }
        }
    }

    /// All elements as indices.
    pub(super) fn indices(&self) -> Result<Vec<u32>, String> {
        match self.component {
            DataType::U8 => Ok(self.elements::<u8>().into_iter().flatten().map(u32::from).collect()),
            DataType::U16 => Ok(self.elements::<u16>().into_iter().flatten().map(u32::from).collect()),
            DataType::U32 => Ok(self.elements::<u32>().into_iter().flatten().collect()),
            _ => Err("indices must be unsigned".to_owned()),
        }
    }

    /// The crate's iterator, which must not be asked for an accessor without elements.
    fn elements<T: Item>(&self) -> Option<Iter<'a, T>> {
        let document = self.document;
        (self.count > 0).then(|| Iter::new(self.inner.clone(), |buffer| document.buffer(buffer.index()))).flatten()
    }
}

/// Do `count` elements of `size` bytes lie in a buffer view?
fn check(document: &Document<'_>, view: Index<View>, offset: u64, count: u64, size: usize) -> Result<(), String> {
    let (view, bytes) = document.view(view)?;
    let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride != 0).unwrap_or(size);
    if stride < size {
        return Err(format!("a stride of {stride} bytes is less than an element's {size}"));
    }
    let Some(last) = count.checked_sub(1) else { return Ok(()) };
    let end = last.checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64));
    match end.and_then(|end| end.checked_add(offset)) {
        Some(end) if end <= bytes.len() as u64 => Ok(()),
        _ => Err(format!(
            "{count} elements of {size} bytes every {stride} from {offset} do not fit a buffer view of {} bytes",
            bytes.len()
        )),
    }
}

/// Are the replaced elements there, and given in rising order, as glTF 2.0, 3.6.2.3 wants them and the crate relies
/// on?
fn check_sparse(document: &Document<'_>, sparse: &Sparse, count: u64, size: usize) -> Result<(), String> {
    let Checked::Valid(component) = sparse.indices.component_type else {
        return Err("the sparse indices' component type is not unsigned".to_owned());
    };
    let (step, offset) = (component.0.size(), sparse.indices.byte_offset.0);
    if sparse.count.0 == 0 {
        return Err("it has no sparse elements, but says it had".to_owned());
    }
    check(document, sparse.indices.buffer_view, offset, sparse.count.0, step)?;
    check(document, sparse.values.buffer_view, sparse.values.byte_offset.0, sparse.count.0, size)?;
    let (view, bytes) = document.view(sparse.indices.buffer_view)?;
    let stride = view.byte_stride.map(|stride| stride.0).filter(|&stride| stride != 0).unwrap_or(step);
    let mut last = None;
    for place in 0..sparse.count.0 as usize {
        let at = offset as usize + place * stride;
        let index = bytes[at..at + step].iter().rev().fold(0, |index, &byte| index << 8 | u64::from(byte));
        if index >= count {
            return Err(format!("sparse element {index} is out of range (there are {count})"));
        }
        if last >= Some(index) {
            return Err(format!("sparse element {index} is out of order"));
        }
        last = Some(index);
    }
    // Zeros that no byte of the file stands for: a bound on all of them together.
    let elements = document.sparse_elements.get().saturating_add(count as usize);
    document.sparse_elements.set(elements);
    if elements > 3 * MAX_FACES {
        return Err(format!("{elements} elements of sparse accessors are more than are read"));
    }
    Ok(())
}
