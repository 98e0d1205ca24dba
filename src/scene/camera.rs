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
        self.lens(aspect).ray(film)
    }

    /// The same for many rays.
    pub fn lens(&self, aspect: f32) -> Lens {
        let (x, y, central) = match self.projection {
            Projection::Perspective { y_fov } => {
                let h = (0.5 * y_fov).tan();
                (h * aspect, h, true)
            }
            Projection::Orthographic { x_mag, y_mag } => (x_mag, y_mag, false),
        };
        let [right, up, back] = [self.axes.x_axis, self.axes.y_axis, self.axes.z_axis];
        Lens { position: self.position, forward: -back, right: x * right, up: y * up, central }
    }
}

/// A camera made ready for images of one shape.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    position: Vec3,
    forward: Vec3,
    /// From the centre of the film to its right edge.
    right: Vec3,
    /// From the centre of the film to its upper edge.
    up: Vec3,
    /// Whether rays leave one point.
    central: bool,
}

impl Lens {
    /// Width of the `rows`th part of the film's height as seen at `position`, scene units.
    pub fn footprint(&self, position: Vec3, rows: u32) -> f32 {
        let [start, growth] = self.cone(rows);
        start + growth * position.distance(self.position)
    }

    /// The same along a ray: at its start, and its growth over distance.
    pub fn cone(&self, rows: u32) -> [f32; 2] {
        let height = 2.0 * self.up.length() / rows as f32;
        if self.central { [0.0, height] } else { [height, 0.0] }
    }

    /// The ray through `film`, 0..1 in both axes, from the top left.
    pub fn ray(&self, film: Vec2) -> Ray {
        let offset = (2.0 * film.x - 1.0) * self.right + (1.0 - 2.0 * film.y) * self.up;
        if self.central {
            Ray::new(self.position, (self.forward + offset).normalize())
        } else {
            Ray::new(self.position + offset, self.forward)
        }
    }
}
