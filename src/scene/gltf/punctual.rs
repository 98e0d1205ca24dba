//! Cameras and lights of nodes. Both look along their node's -z.

use glam::{Mat3, Vec3};
use gltf::json::Root;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};

use super::json::valid;
use crate::scene::{Camera, LightKind, Projection, PunctualLight};

/// Converts a camera, in its node's frame.
pub(super) fn camera(root: &Root, index: usize, node_name: Option<&String>) -> Result<Camera, String> {
    let camera = root.cameras.get(index).ok_or_else(|| format!("camera {index} does not exist"))?;
    let (projection, aspect) = match (&camera.perspective, &camera.orthographic) {
        (Some(p), _) => (Projection::Perspective { y_fov: p.yfov }, p.aspect_ratio),
        (None, Some(o)) => {
            // Negative magnifications occur; they would mirror the image, which nobody means.
            let (x_mag, y_mag) = (o.xmag.abs(), o.ymag.abs());
            (Projection::Orthographic { x_mag, y_mag }, Some(x_mag / y_mag))
        }
        (None, None) => return Err(format!("camera {index} has no projection")),
    };
    let name = node_name.or(camera.name.as_ref()).cloned().unwrap_or_else(|| format!("camera {index}"));
    let aspect = aspect.filter(|a| a.is_finite() && *a > 0.0);
    Ok(Camera { name, position: Vec3::ZERO, axes: Mat3::IDENTITY, projection, aspect })
}

/// Converts a light of `KHR_lights_punctual`, in its node's frame.
pub(super) fn light(light: &Light, label: &str) -> Result<PunctualLight, String> {
    let name = light.name.clone().unwrap_or_else(|| label.to_string());
    let (position, direction) = (Vec3::ZERO, Vec3::NEG_Z);
    let kind = match valid(&light.type_).ok_or_else(|| format!("light '{name}': unknown type"))? {
        Type::Point => LightKind::Point { position },
        Type::Directional => LightKind::Directional { direction },
        Type::Spot => {
            let spot = light.spot.as_ref().ok_or_else(|| format!("light '{name}': a spot without its cone"))?;
            let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
            LightKind::Spot { position, direction, cos_inner: inner.cos(), cos_outer: outer.cos() }
        }
    };
    Ok(PunctualLight { name, intensity: light.intensity * Vec3::from_array(light.color), kind })
}
