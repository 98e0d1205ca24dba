//! What moves in a file, without its triangles: cameras at any moment, and whether anything else has moved.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::animation::{Pose, Tracks};
use super::buffers::Buffers;
use super::container::Container;
use super::json::Document;
use super::nodes::Nodes;
use super::punctual;
use crate::error::{Error, Result};
use crate::scene::Camera;
use crate::scene::finish::place_camera;

/// The animations of a glTF file.
pub struct Motion {
    path: PathBuf,
    document: Document,
    tracks: Tracks,
}

/// Where everything but cameras stands; equal where nothing has moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrangement(Vec<u64>);

impl Motion {
    /// Reads the animations of a `.gltf` or `.glb` file.
    ///
    /// # Errors
    /// When the file cannot be read or an animation is broken.
    pub fn read(path: &Path) -> Result<Motion> {
        let fail = |reason: String| Error::Input { path: path.to_owned(), reason };
        let container = Container::open(path).map_err(fail)?;
        let document = Document::parse(&container.json).map_err(fail)?;
        let buffers = Buffers::new(&document.root, path, container.bin.as_deref());
        let (tracks, _) = Tracks::read(&document.root, &buffers).map_err(fail)?;
        drop(buffers);
        Ok(Motion { path: path.to_owned(), document, tracks })
    }

    /// First and last moment at which anything moves, seconds; `None` where nothing is animated.
    pub fn span(&self) -> Option<[f64; 2]> {
        self.tracks.span()
    }

    /// The cameras of the scene at a moment, in its order; `centre` is [`Scene::centre`](crate::scene::Scene::centre). Empty where the
    /// file has none.
    ///
    /// # Errors
    /// When a camera has impossible values, or a node stands nowhere.
    pub fn cameras(&self, seconds: f64, centre: DVec3) -> Result<Vec<Camera>> {
        let fail = |reason: String| Error::Input { path: self.path.clone(), reason };
        let (_, nodes) = self.stand(seconds).map_err(fail)?;
        let root = &self.document.root;
        let mut cameras = Vec::new();
        for &index in &nodes.visited {
            let node = &root.nodes[index];
            if let Some(camera) = &node.camera {
                let camera = punctual::camera(root, camera.value(), node.name.as_ref()).map_err(fail)?;
                cameras.push(place_camera(&camera, &nodes.world[index], centre).map_err(fail)?);
            }
        }
        Ok(cameras)
    }

    /// Where triangles and lights stand at a moment.
    ///
    /// # Errors
    /// When a node stands nowhere.
    pub fn arrangement(&self, seconds: f64) -> Result<Arrangement> {
        let fail = |reason: String| Error::Input { path: self.path.clone(), reason };
        let (pose, nodes) = self.stand(seconds).map_err(fail)?;
        let root = &self.document.root;
        let joints = root.skins.iter().flat_map(|skin| skin.joints.iter().map(|joint| joint.value()));
        let lit = |n: &usize| root.nodes[*n].extensions.as_ref().is_some_and(|e| e.khr_lights_punctual.is_some());
        let carriers = nodes.visited.iter().copied().filter(|n| root.nodes[*n].mesh.is_some() || lit(n));
        let places = carriers.chain(joints).flat_map(|n| nodes.world[n].to_cols_array()).map(f64::to_bits);
        let weights = pose.weights.values().flatten().map(|w| u64::from(w.to_bits()));
        Ok(Arrangement(places.chain(weights).collect()))
    }

    fn stand(&self, seconds: f64) -> std::result::Result<(Pose, Nodes), String> {
        let pose = self.tracks.pose(&self.document.transforms, seconds);
        let nodes = Nodes::walk(&self.document, &pose.transforms)?;
        Ok((pose, nodes))
    }
}
