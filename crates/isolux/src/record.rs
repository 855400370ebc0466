//! A solution as named flat arrays: what a solution file holds, whatever container it is put in.

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// Bytes.
    U8(Vec<u8>),
    /// 32-bit indices.
    U32(Vec<u32>),
    /// 64-bit names.
    U64(Vec<u64>),
    /// Single precision.
    F32(Vec<f32>),
    /// Double precision.
    F64(Vec<f64>),
}

/// A named array, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Name with slashes for groups: `links/source`.
    pub name: String,
    /// Lengths of the axes; their product is the number of entries.
    pub shape: Vec<usize>,
    /// The numbers.
    pub data: Data,
}

/// A solution as attributes and arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Settings, report, names and everything that is not an array, as a JSON object.
    pub attributes: String,
    /// The arrays, in a fixed order.
    pub arrays: Vec<Array>,
}
