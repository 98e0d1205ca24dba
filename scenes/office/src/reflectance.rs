//! The paper's second parameter of the environment: its average reflectance.

use crate::paint::WALL;
use crate::scene::Scene;
use crate::surfaces::cross;

/// Areas and area-weighted reflectances (mean of the bands) of all surfaces that do not emit, one side each.
#[derive(Clone, Copy, Debug, Default)]
pub struct Average {
    /// Area of walls and ceiling, m^2.
    pub wall_area: f64,
    /// Area of everything else, m^2.
    pub other_area: f64,
    /// Sum of reflectance times area over everything else, m^2.
    pub other_sum: f64,
    /// Mean reflectance of the wall paint.
    pub wall: f64,
}

impl Average {
    /// Measures a scene.
    pub fn of(scene: &Scene) -> Self {
        let mut average = Average::default();
        for (_, primitive, map) in scene.instances() {
            let paint = scene.materials[primitive.material];
            if paint.emission != [0.0; 3] {
                continue;
            }
            let world: Vec<_> = primitive.positions.iter().map(|p| map.transform_point3(*p)).collect();
            let area: f64 = primitive.triangles.iter().map(|&t| 0.5 * cross(&world, t).length()).sum();
            let mean = paint.color.iter().map(|&c| f64::from(c)).sum::<f64>() / 3.0;
            if paint.name == WALL.name {
                average.wall_area += area;
                average.wall = mean;
            } else {
                average.other_area += area;
                average.other_sum += mean * area;
            }
        }
        average
    }

    /// Area-weighted mean reflectance.
    pub fn rho(&self) -> f64 {
        (self.wall * self.wall_area + self.other_sum) / (self.wall_area + self.other_area)
    }
}

/// Paints walls and ceiling so that the average reflectance becomes `rho`. Fails when no paint of 0..=0.9 does.
pub fn paint_walls(scene: &mut Scene, rho: f64) -> Result<Average, String> {
    let before = Average::of(scene);
    let wall = (rho * (before.wall_area + before.other_area) - before.other_sum) / before.wall_area;
    let color = WALL.color.map(|hue| (f64::from(hue) * wall) as f32);
    if color.iter().any(|c| !(0.0..=0.9).contains(c)) {
        return Err(format!(
            "an average reflectance of {rho} needs walls of {wall:.3}, outside 0..0.9: the rest of the room has {:.3} on {:.1} m2 \
             against {:.1} m2 of wall",
            before.other_sum / before.other_area,
            before.other_area,
            before.wall_area
        ));
    }
    for paint in &mut scene.materials {
        if paint.name == WALL.name {
            paint.color = color;
        }
    }
    Ok(Average::of(scene))
}
