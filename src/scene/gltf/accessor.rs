//! Checked access to the elements of accessors.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Root};

use super::buffers::Buffers;

/// Elements that an accessor may have without a buffer view behind them (all zero), so that a few bytes of JSON cannot
/// ask for gigabytes.
const MAX_ZERO_ELEMENTS: usize = 1 << 24;

/// An accessor whose every element is known to lie inside its buffer.
pub(super) struct Elements<'a> {
    /// Number of elements.
    pub count: usize,
    /// Kind of element.
    pub kind: Type,
    /// Component type.
    pub component: ComponentType,
    normalized: bool,
    dense: Option<Strided<'a>>,
    /// Sorted element numbers and their values.
    sparse: Option<(Vec<u32>, Strided<'a>)>,
}

#[derive(Clone, Copy)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Strided<'a> {
    /// `count` elements of `size` bytes from `offset` on.
    fn new(view: (&'a [u8], Option<usize>), offset: u64, count: usize, size: usize) -> Result<Self, String> {
        let (bytes, stride) = view;
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(format!("a byteStride of {stride} is smaller than the element of {size} bytes"));
        }
        let offset = usize::try_from(offset).ok();
        let end = |offset: usize| match count {
            0 => Some(offset),
            n => (n - 1).checked_mul(stride)?.checked_add(size)?.checked_add(offset),
        };
        match offset.and_then(|o| Some((o, end(o)?))) {
            Some((o, e)) if e <= bytes.len() => Ok(Strided { bytes: &bytes[o..e], stride }),
            _ => Err(format!("{count} elements of {size} bytes do not fit into a bufferView of {} bytes", bytes.len())),
        }
    }

    fn at(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..]
    }
}

fn integer(component: ComponentType, bytes: &[u8], at: usize) -> u32 {
    match component {
        ComponentType::U8 => u32::from(bytes[at]),
        ComponentType::U16 => u32::from(u16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]])),
        _ => u32::from_le_bytes([bytes[4 * at], bytes[4 * at + 1], bytes[4 * at + 2], bytes[4 * at + 3]]),
    }
}

impl<'a> Elements<'a> {
    /// Checks accessor `index` against everything that it refers to.
    pub(super) fn new(root: &Root, buffers: &'a Buffers<'_>, index: usize) -> Result<Self, String> {
        let accessor = root.accessors.get(index).ok_or_else(|| format!("accessor {index} does not exist"))?;
        Self::checked(accessor, buffers).map_err(|e| format!("accessor {index}: {e}"))
    }

    fn checked(accessor: &Accessor, buffers: &'a Buffers<'_>) -> Result<Self, String> {
        let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
            return Err("unknown componentType or type".into());
        };
        let component = component.0;
        // Columns of matrices of small components are padded to four bytes; only MAT4 of floats is used.
        let size = component.size() * kind.multiplicity();
        let count = usize::try_from(accessor.count.0).map_err(|_| "too many elements".to_string())?;
        let offset = accessor.byte_offset.map_or(0, |o| o.0);
        let dense = match accessor.buffer_view {
            Some(view) => Some(Strided::new(buffers.view(view.value())?, offset, count, size)?),
            None if count > MAX_ZERO_ELEMENTS => return Err(format!("{count} elements without a bufferView")),
            None => None,
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => {
                let n = usize::try_from(sparse.count.0).ok().filter(|&n| n <= count);
                let n = n.ok_or_else(|| format!("more sparse elements than the {count} that there are"))?;
                let Checked::Valid(index_type) = sparse.indices.component_type else {
                    return Err("unknown component type of sparse indices".into());
                };
                let view = buffers.view(sparse.indices.buffer_view.value())?;
                let numbers = Strided::new(view, sparse.indices.byte_offset.0, n, index_type.0.size())?;
                let numbers: Vec<u32> = (0..n).map(|i| integer(index_type.0, numbers.at(i), 0)).collect();
                if numbers.windows(2).any(|w| w[0] >= w[1]) || numbers.last().is_some_and(|&l| l as usize >= count) {
                    return Err("sparse indices must increase and be less than the number of elements".into());
                }
                let view = buffers.view(sparse.values.buffer_view.value())?;
                Some((numbers, Strided::new(view, sparse.values.byte_offset.0, n, size)?))
            }
            None => None,
        };
        Ok(Elements { count, kind, component, normalized: accessor.normalized, dense, sparse })
    }

    fn bytes(&self, index: usize) -> Option<&'a [u8]> {
        if let Some((numbers, values)) = &self.sparse
            && let Ok(at) = u32::try_from(index).map_or(Err(0), |i| numbers.binary_search(&i))
        {
            return Some(values.at(at));
        }
        self.dense.as_ref().map(|d| d.at(index))
    }

    /// Element `index` as floats; normalised integers as the specification says (3.6.2.2), other integers as they are.
    /// Components that the element does not have are zero. `index` must be less than [`Elements::count`].
    pub(super) fn floats<const N: usize>(&self, index: usize) -> [f32; N] {
        let mut out = [0.0; N];
        let Some(bytes) = self.bytes(index) else { return out };
        for (c, value) in out.iter_mut().enumerate().take(self.kind.multiplicity()) {
            *value = match (self.component, self.normalized) {
                (ComponentType::F32, _) => f32::from_bits(integer(ComponentType::U32, bytes, c)),
                (ComponentType::I8, false) => f32::from(bytes[c] as i8),
                (ComponentType::I8, true) => (f32::from(bytes[c] as i8) / 127.0).max(-1.0),
                (ComponentType::I16, normalized) => {
                    let v = f32::from(i16::from_le_bytes([bytes[2 * c], bytes[2 * c + 1]]));
                    if normalized { (v / 32767.0).max(-1.0) } else { v }
                }
                (ComponentType::U8, true) => f32::from(bytes[c]) / 255.0,
                (ComponentType::U16, true) => integer(ComponentType::U16, bytes, c) as f32 / 65535.0,
                (t, _) => integer(t, bytes, c) as f32,
            };
        }
        out
    }

    /// Element `index` of unsigned integers, as they are; components that the element does not have are zero.
    pub(super) fn integers<const N: usize>(&self, index: usize) -> [u32; N] {
        let mut out = [0; N];
        let Some(bytes) = self.bytes(index) else { return out };
        for (c, value) in out.iter_mut().enumerate().take(self.kind.multiplicity()) {
            *value = integer(self.component, bytes, c);
        }
        out
    }

    /// This accessor, if its elements are of one of the `kinds` and have one of the `components`.
    pub(super) fn expect(self, what: &str, kinds: &[Type], components: &[ComponentType]) -> Result<Self, String> {
        if kinds.contains(&self.kind) && components.contains(&self.component) {
            return Ok(self);
        }
        Err(format!("{what} cannot be {:?} of {:?}", self.kind, self.component))
    }
}
