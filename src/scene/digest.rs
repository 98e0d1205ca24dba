//! Names for what is in a scene.

use std::io::Write;

use blake3::Hasher;
use bytemuck::cast_slice;

use super::{Scene, Texels};

/// 256 bits that differ when contents differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest {
    /// Of triangles, materials and textures.
    pub surfaces: blake3::Hash,
    /// Of what shines without being a surface: punctual lights and the environment.
    pub lights: blake3::Hash,
}

impl Scene {
    /// Hashes everything but cameras, notes and the file's name: whatever way a scene came to be, the same contents have the same
    /// digest.
    pub fn digest(&self) -> Digest {
        Digest { surfaces: self.surfaces(), lights: self.other_lights() }
    }

    fn surfaces(&self) -> blake3::Hash {
        let mesh = &self.mesh;
        let mut hasher = Hasher::new();
        let mut add = |bytes: &[u8]| {
            // Lengths keep what follows each other apart.
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update_rayon(bytes);
        };
        add(cast_slice(&mesh.positions));
        add(cast_slice(&mesh.normals));
        mesh.uvs.iter().for_each(|set| add(cast_slice(set)));
        add(cast_slice(&mesh.colors));
        add(cast_slice(&mesh.triangles));
        for texture in &self.textures {
            match &texture.texels {
                Texels::Srgb8(texels) => add(texels),
                Texels::Linear8(texels) => add(texels),
                Texels::Float(texels) => add(cast_slice(texels)),
            }
            let kind = std::mem::discriminant(&texture.texels);
            add(format!("{kind:?} {} {} {:?}", texture.width, texture.height, texture.wrap).as_bytes());
        }
        // Debug output names every field and gives floats with all their digits: no field can be forgotten here.
        write_debug(&mut hasher, &mesh.objects);
        write_debug(&mut hasher, &mesh.shared);
        write_debug(&mut hasher, &self.materials);
        hasher.finalize()
    }

    fn other_lights(&self) -> blake3::Hash {
        let mut hasher = Hasher::new();
        write_debug(&mut hasher, &self.lights);
        if let Some(environment) = &self.environment {
            hasher.update_rayon(cast_slice(environment.texels()));
            write_debug(&mut hasher, &(environment.size(), environment.rotation(), environment.sun()));
        }
        hasher.finalize()
    }
}

fn write_debug(hasher: &mut Hasher, value: &impl std::fmt::Debug) {
    // A hasher takes everything: its writes cannot fail.
    let _ = writeln!(hasher, "{value:?}");
}
