//! Cameras.

use glam::{Mat3, Vec2, Vec3};

use crate::backend::Ray;

/// How a camera maps the scene to the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Central projection.
    Perspective {
        /// Full vertical field of view, radians.
        y_fov: f32,
    },
    /// Parallel projection.
    Orthographic {
        /// Half of the visible width, scene units.
        x_mag: f32,
        /// Half of the visible height, scene units.
        y_mag: f32,
    },
}

/// A pinhole or parallel camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name from the file.
    pub name: String,
    /// Position in recentred coordinates.
    pub position: Vec3,
    /// Columns: right, up, backward (the camera looks along minus the third), orthonormal.
    pub axes: Mat3,
    /// Projection.
    pub projection: Projection,
    /// Width over height as the file says, where it does.
    pub aspect: Option<f32>,
}

impl Camera {
    /// The ray through `film` (0..1 in both axes, from the top left) of an image with the given `aspect` ratio
    /// (width over height). Perspective keeps the vertical field of view whatever the aspect.
    pub fn ray(&self, film: Vec2, aspect: f32) -> Ray {
        let (x, y) = (2.0 * film.x - 1.0, 1.0 - 2.0 * film.y);
        match self.projection {
            Projection::Perspective { y_fov } => {
                let h = (0.5 * y_fov).tan();
                let local = Vec3::new(x * h * aspect, y * h, -1.0);
                Ray::new(self.position, (self.axes * local).normalize())
            }
            Projection::Orthographic { x_mag, y_mag } => {
                let offset = self.axes * Vec3::new(x * x_mag, y * y_mag, 0.0);
                Ray::new(self.position + offset, -self.axes.z_axis)
            }
        }
    }
}
