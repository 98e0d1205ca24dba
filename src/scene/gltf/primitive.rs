//! Mesh primitives: from accessors to triangles.

use glam::{Vec2, Vec3};
use gltf::json::Root;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::Elements;
use super::buffers::Buffers;
use super::deform::Deformation;
use super::json::valid;
use crate::scene::builder::MeshData;

/// What became of a primitive.
pub(super) enum Outcome {
    /// Triangles, with at least one vertex.
    Triangles(MeshData),
    /// Nothing that can be rendered, and why.
    Skipped(&'static str),
}

const FLOAT: &[ComponentType] = &[ComponentType::F32];
const FRACTION: &[ComponentType] = &[ComponentType::F32, ComponentType::U8, ComponentType::U16];
/// `KHR_mesh_quantization` allows these for positions, normals and texture coordinates.
const QUANTIZED: &[ComponentType] =
    &[ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

/// Reads vertex attributes of one primitive.
pub(super) struct Attributes<'a, 'b> {
    root: &'a Root,
    buffers: &'a Buffers<'b>,
    primitive: &'a Primitive,
    vertices: usize,
}

impl<'a> Attributes<'a, '_> {
    /// The primitive's morph targets.
    pub(super) fn targets(&self) -> &'a [MorphTarget] {
        self.primitive.targets.as_deref().unwrap_or_default()
    }

    /// The attribute, where the primitive has it; one element a vertex.
    pub(super) fn get(
        &self,
        semantic: Semantic,
        kinds: &[Type],
        components: &[ComponentType],
    ) -> Result<Option<Elements<'a>>, String> {
        let name = semantic.to_string();
        match self.primitive.attributes.get(&Checked::Valid(semantic)) {
            Some(accessor) => self.accessor(accessor.value(), &name, kinds, components).map(Some),
            None => Ok(None),
        }
    }

    /// An accessor with one element a vertex.
    pub(super) fn accessor(
        &self,
        accessor: usize,
        name: &str,
        kinds: &[Type],
        components: &[ComponentType],
    ) -> Result<Elements<'a>, String> {
        let elements = Elements::new(self.root, self.buffers, accessor)?.expect(name, kinds, components)?;
        match elements.count == self.vertices {
            true => Ok(elements),
            false => Err(format!("{name} has {} elements for {} vertices", elements.count, self.vertices)),
        }
    }
}

/// Reads a primitive in the pose that `deformation` gives it.
pub(super) fn read(
    root: &Root,
    buffers: &Buffers<'_>,
    primitive: &Primitive,
    deformation: &Deformation<'_>,
) -> Result<Outcome, String> {
    let mode = valid(&primitive.mode).ok_or("unknown primitive mode")?;
    if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        return Ok(Outcome::Skipped("lines or points"));
    }
    let Some(accessor) = primitive.attributes.get(&Checked::Valid(Semantic::Positions)) else {
        return Ok(Outcome::Skipped("without POSITION"));
    };
    let positions = Elements::new(root, buffers, accessor.value())?.expect("POSITION", &[Type::Vec3], QUANTIZED)?;
    let mut triangles = triangles(root, buffers, primitive, mode, positions.count)?;
    let Some(vertices) = compact(&mut triangles) else {
        return Ok(Outcome::Skipped("without any triangle"));
    };

    let attributes = Attributes { root, buffers, primitive, vertices: positions.count };
    let normals = attributes.get(Semantic::Normals, &[Type::Vec3], QUANTIZED)?;
    let uv = |set| attributes.get(Semantic::TexCoords(set), &[Type::Vec2], QUANTIZED);
    let uvs = [uv(0)?, uv(1)?];
    let colors = attributes.get(Semantic::Colors(0), &[Type::Vec3, Type::Vec4], FRACTION)?;

    let vec3 = |e: &Elements<'_>| -> Vec<Vec3> { vertices.iter().map(|&v| e.floats::<3>(v as usize).into()).collect() };
    let mut data = MeshData { positions: vec3(&positions), triangles, ..MeshData::default() };
    data.normals = normals.as_ref().map(vec3).unwrap_or_default();
    data.uvs = uvs.map(|e| match e {
        Some(e) => vertices.iter().map(|&v| Vec2::from_array(e.floats(v as usize))).collect(),
        None => Vec::new(),
    });
    if let Some(e) = &colors {
        let alpha = e.kind == Type::Vec4;
        data.colors = vertices.iter().map(|&v| e.floats::<4>(v as usize)).collect();
        if !alpha {
            data.colors.iter_mut().for_each(|c| c[3] = 1.0);
        }
    }
    deformation.apply(&attributes, &vertices, &mut data)?;
    Ok(Outcome::Triangles(data))
}

/// Morph targets hold differences, which are floats unless quantised.
pub(super) const DIFFERENCE: &[ComponentType] = QUANTIZED;
/// Joint numbers.
pub(super) const JOINT: &[ComponentType] = &[ComponentType::U8, ComponentType::U16];
/// Joint weights.
pub(super) const WEIGHT: &[ComponentType] = FRACTION;
/// Matrices.
pub(super) const MATRIX: &[ComponentType] = FLOAT;

/// Triangles as triples of vertex numbers below `vertices`, all with the winding of the specification (3.7.2.1).
fn triangles(
    root: &Root,
    buffers: &Buffers<'_>,
    primitive: &Primitive,
    mode: Mode,
    vertices: usize,
) -> Result<Vec<[u32; 3]>, String> {
    u32::try_from(vertices).map_err(|_| format!("{vertices} vertices are too many"))?;
    let indices: Vec<u32> = match &primitive.indices {
        Some(accessor) => {
            let unsigned = &[ComponentType::U8, ComponentType::U16, ComponentType::U32];
            let e = Elements::new(root, buffers, accessor.value())?.expect("indices", &[Type::Scalar], unsigned)?;
            let restart = u32::MAX >> (32 - 8 * e.component.size() as u32);
            let indices: Vec<u32> = (0..e.count).map(|i| e.integers::<1>(i)[0]).collect();
            if let Some(at) = indices.iter().position(|&i| i == restart) {
                return Err(format!("index {at} is {restart}, the primitive restart value, which glTF forbids"));
            }
            if let Some(at) = indices.iter().position(|&i| i as usize >= vertices) {
                return Err(format!("index {at} is {}, but there are only {vertices} vertices", indices[at]));
            }
            indices
        }
        None => (0..vertices as u32).collect(),
    };
    Ok(match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        Mode::TriangleFan => {
            indices.get(1..).unwrap_or_default().windows(2).map(|w| [w[0], w[1], indices[0]]).collect()
        }
        _ => indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    })
}

/// Renumbers vertices so that only used ones remain, in their order; the old number of each. `None` without triangles.
/// Primitives often share one large vertex array.
fn compact(triangles: &mut [[u32; 3]]) -> Option<Vec<u32>> {
    let (lo, hi) = triangles.iter().flatten().fold((u32::MAX, 0), |(lo, hi), &i| (lo.min(i), hi.max(i)));
    if lo > hi {
        return None;
    }
    let mut number = vec![u32::MAX; (hi - lo) as usize + 1];
    triangles.iter().flatten().for_each(|&i| number[(i - lo) as usize] = 0);
    let used: Vec<u32> = (lo..=hi).filter(|i| number[(i - lo) as usize] == 0).collect();
    for (new, old) in used.iter().enumerate() {
        number[(old - lo) as usize] = new as u32;
    }
    triangles.iter_mut().flatten().for_each(|i| *i = number[(*i - lo) as usize]);
    Some(used)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_used_vertices_remain() {
        let mut triangles = vec![[5, 9, 7], [7, 9, 12]];
        assert_eq!(compact(&mut triangles), Some(vec![5, 7, 9, 12]));
        assert_eq!(triangles, [[0, 2, 1], [1, 2, 3]]);
        assert_eq!(compact(&mut []), None);
    }
}
