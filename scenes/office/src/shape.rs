//! Triangles in the making: every primitive returns one, and things join them.

use glam::{Affine3A, Vec3};

/// A bag of triangles, counter-clockwise seen from outside. Vertices may repeat; they are welded when a mesh is finished.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Positions, metres.
    pub positions: Vec<Vec3>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Adds another shape's triangles.
    pub fn join(&mut self, other: Shape) {
        let base = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }

    /// Joins several shapes.
    pub fn of(shapes: impl IntoIterator<Item = Shape>) -> Shape {
        let mut all = Shape::default();
        for shape in shapes {
            all.join(shape);
        }
        all
    }

    /// The shape moved, turned or scaled by a map that keeps orientation.
    pub fn at(mut self, map: Affine3A) -> Shape {
        for p in &mut self.positions {
            *p = map.transform_point3(*p);
        }
        self
    }

    /// The shape moved.
    pub fn moved(self, x: f32, y: f32, z: f32) -> Shape {
        self.at(Affine3A::from_translation(Vec3::new(x, y, z)))
    }

    /// The same triangles seen from the other side.
    pub fn inside_out(mut self) -> Shape {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        self
    }

    /// Adds a vertex.
    pub fn vertex(&mut self, p: Vec3) -> u32 {
        self.positions.push(p);
        self.positions.len() as u32 - 1
    }

    /// Adds a convex polygon, counter-clockwise seen from the front.
    pub fn polygon(&mut self, corners: &[Vec3]) {
        let base = self.positions.len() as u32;
        self.positions.extend_from_slice(corners);
        self.triangles.extend((1..corners.len() as u32 - 1).map(|i| [base, base + i, base + i + 1]));
    }

    /// Adds a regular net of `rows` x `columns` vertices. With `closed` the last column joins the first.
    /// Rows that shrink to a point (all vertices equal) become fans.
    pub fn net(&mut self, rows: usize, columns: usize, closed: bool, point: impl Fn(usize, usize) -> Vec3) {
        let base = self.positions.len() as u32;
        for row in 0..rows {
            self.positions.extend((0..columns).map(|column| point(row, column)));
        }
        let index = |row: usize, column: usize| base + (row * columns + column % columns) as u32;
        let pointed = |row: usize| {
            let p = self.positions[index(row, 0) as usize];
            (1..columns).all(|column| self.positions[index(row, column) as usize] == p)
        };
        let strips = if closed { columns } else { columns - 1 };
        for row in 0..rows - 1 {
            let (low, high) = (pointed(row), pointed(row + 1));
            for column in 0..strips {
                let (a, b) = (index(row, column), index(row, column + 1));
                let (d, c) = (index(row + 1, column), index(row + 1, column + 1));
                if !low {
                    self.triangles.push([a, b, c]);
                }
                if !high {
                    self.triangles.push([a, c, d]);
                }
            }
        }
    }
}
