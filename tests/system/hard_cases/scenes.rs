//! The scenes that more than one test uses.

use glam::DVec3;
use gsii::scene::Material;

use crate::kit::*;

/// A cube whose walls shine and reflect half: radiosity 2 everywhere, without a tolerance for the shape of its triangles.
pub fn furnace() -> Model {
    closed_box(DVec3::ONE, [0.5; 6], [1.0; 6])
}

/// The same with one wall a fan of 1000 triangles from a corner, and another of strips down to a millionth of its width.
pub fn furnace_of_slivers() -> Model {
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, DVec3::ONE).iter().enumerate() {
        let [a, b, c, d] = *face;
        let wall = match i {
            4 => {
                let rim = (0..=500).map(|k| b.lerp(c, f64::from(k) / 500.0));
                let rim = rim.chain((1..=500).map(|k| c.lerp(d, f64::from(k) / 500.0)));
                polygon(&[a].into_iter().chain(rim).collect::<Vec<_>>())
            }
            5 => {
                let ends: Vec<f64> = [0.0].into_iter().chain((0..=20).map(|k| 0.5_f64.powi(20 - k))).collect();
                let strip = |w: &[f64]| polygon(&[a.lerp(b, w[0]), a.lerp(b, w[1]), d.lerp(c, w[1]), d.lerp(c, w[0])]);
                ends.windows(2).flat_map(strip).collect()
            }
            _ => polygon(face),
        };
        model.add(FACES[i], wall, glow(0.5, 1.0));
    }
    model
}

/// The furnace with white blocks in its middle.
pub fn furnace_with_blocks() -> Model {
    let mut model = furnace();
    let blocks = (0..1000).flat_map(|k| {
        let at = 0.4 + 0.02 * v(f64::from(k % 10), f64::from(k / 10 % 10), f64::from(k / 100));
        solid(at, at + 0.01)
    });
    model.add("clutter", blocks.collect(), grey(1.0));
    model
}

/// A room of 6 x 4 x 3 units with a lamp and some furniture, moved: by the node, or in the coordinates themselves.
pub fn furnished(unit: f64, by_node: DVec3, baked: DVec3) -> Model {
    let mut model = Model::new();
    let mut add = |name: &str, triangles: Triangles, material: Material| {
        let triangles = triangles.into_iter().map(|t| t.map(|p| unit * p + baked)).collect();
        model.place(name, triangles, material, by_node);
    };
    for (i, face) in box_faces(DVec3::ZERO, v(6., 4., 3.)).iter().enumerate() {
        add(FACES[i], polygon(face), grey(0.7));
    }
    add("lamp", solid(v(2., 1.5, 2.5), v(4., 2.5, 2.75)), glow(0.0, 10.0));
    add("table", solid(v(2., 1., 0.5), v(3.5, 2., 0.75)), grey(0.5));
    for i in 0..16 {
        let at = v(2.0 + 0.25 * f64::from(i % 4), 1.0 + 0.25 * f64::from(i / 4), 0.75);
        add("block", solid(at, at + 0.125), grey(0.3));
    }
    model
}

/// A millimetre, as a binary fraction: a scene and the same scene in a hall are then the same in f32.
pub const MILLIMETRE: f64 = 1.0 / 1024.0;

/// A pencil of a millimetre on a desk, by a lamp, in the open or in a black hall of a kilometre.
pub fn desk(hall: bool) -> Model {
    let mut model = Model::new();
    model.add("desk", level([-0.5, 0.5], [-0.5, 0.5], 0.0, true), grey(0.5));
    model.add("pencil", solid(v(-0.125, 0.0, 0.0), v(0.125, MILLIMETRE, MILLIMETRE)), grey(0.8));
    model.add("lamp", level([-0.125, 0.125], [0.25, 0.5], 0.5, false), glow(0.0, 10.0));
    if hall {
        let faces = box_faces(DVec3::splat(-512.0), DVec3::splat(512.0));
        model.add("hall", faces.iter().flat_map(|f| polygon(f)).collect(), grey(0.0));
    }
    model
}

/// A box in a box, a millimetre above the floor of a room; exitances of the room's faces and of the inner box.
pub fn nested_boxes(room: [f64; 6], lamp: f64) -> Model {
    let mut model = closed_box(DVec3::ONE, [0.5; 6], room);
    model.add("outer", solid(v(0.3, 0.3, 1e-3), v(0.7, 0.7, 0.4)), grey(0.5));
    model.add("inner", solid(v(0.4, 0.4, 0.1), v(0.6, 0.6, 0.3)), glow(0.5, lamp));
    model
}

/// Rods that stick through the wall between a lit and a dark room. Their box lies in both.
pub fn rods_through_a_wall() -> Model {
    let mut model = Model::new();
    for (i, face) in box_faces(DVec3::ZERO, v(4., 2., 2.)).iter().enumerate() {
        model.add(FACES[i], polygon(face), grey(0.7));
    }
    model.add("wall", polygon(&[v(2., 0., 0.), v(2., 2., 0.), v(2., 2., 2.), v(2., 0., 2.)]), grey(0.7));
    model.add("lamp", level([0.5, 1.5], [0.5, 1.5], 1.99, false), glow(0.0, 10.0));
    for k in 0..64 {
        let at = v(1.8, 0.8 + 0.05 * f64::from(k % 8), 0.8 + 0.05 * f64::from(k / 8));
        model.add("rod", solid(at, at + v(0.4, 0.02, 0.02)), grey(0.7));
    }
    model
}

/// Two sealed rooms beside each other, the second dark and beginning at the x returned. The wall between them is thin or has no
/// thickness; the lamp is the whole ceiling of the first, which touches the wall, or a point.
pub fn sealed_rooms(thickness: f64, ceiling: bool) -> (Model, f64) {
    let mut model = Model::new();
    let x = 5.0 + thickness;
    for (name, x0, x1) in [("lit", 0.0, 5.0), ("dark", x, 10.0)] {
        for (i, face) in box_faces(v(x0, 0., 0.), v(x1, 5., 3.)).iter().enumerate() {
            if thickness > 0.0 || (name, i) != ("dark", 0) {
                let e = if (name, i) == ("lit", 5) && ceiling { 1.0 } else { 0.0 };
                model.add(name, polygon(face), glow(0.9, e));
            }
        }
    }
    if !ceiling {
        model.point_light(10.0, v(2.0, 2.0, 2.0));
    }
    (model, x)
}

/// A room whose walls are covered with other surfaces in the same plane: a lamp in the ceiling, tiles in the floor.
pub fn coplanar() -> Model {
    let mut model = closed_box(v(4., 4., 3.), [0.5; 6], [0.0; 6]);
    model.add("lamp", level([1.5, 2.5], [1.5, 2.5], 3.0, false), glow(0.0, 1.0));
    for k in 0..64 {
        let (x, y) = (0.5 * f64::from(k % 8), 0.5 * f64::from(k / 8));
        model.add("tile", level([x + 0.1, x + 0.4], [y + 0.1, y + 0.4], 0.0, true), grey(0.3));
    }
    model
}
