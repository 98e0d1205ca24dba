//! What became of a scene, as a table with a row for each cluster.

use std::io::{self, Write};

use serde::Serialize;

use super::fit::flux::mean_reflectance;
use super::{Cluster, Simplified};

/// One cluster. Lengths in scene units, colours linear RGB.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClusterRow {
    /// Index of the cluster.
    pub cluster: usize,
    /// Number of surfaces.
    pub surfaces: usize,
    /// Number of triangles.
    pub triangles: u32,
    /// Diagonal of its bounds.
    pub diagonal: f32,
    /// The paper's `p`: share of uniform lines through the bounding box that hit the cluster.
    pub hit_share: f32,
    /// Centre of the box.
    pub centre: [f32; 3],
    /// Edges of the box, along its own axes.
    pub edges: [f32; 3],
    /// Mean reflectance of the box.
    pub albedo: [f32; 3],
    /// Intercepted flux, box over cluster, minus 1.
    pub intercepted: f32,
    /// Standard error of that.
    pub intercepted_error: f32,
    /// Misfit of intercepted flux by direction.
    pub directional: f32,
    /// Share of light leaving the cluster's surfaces that meets them again beyond `r_thresh`.
    pub hidden: f32,
    /// Mean reflected colour, box minus cluster.
    pub reflected: [f32; 3],
}

impl ClusterRow {
    fn new(index: usize, cluster: &Cluster) -> Self {
        let (b, r) = (&cluster.equivalent_box, &cluster.residual);
        ClusterRow {
            cluster: index,
            surfaces: cluster.surfaces.len(),
            triangles: cluster.triangles,
            diagonal: cluster.bounds.diagonal(),
            hit_share: r.hit_share,
            centre: b.centre.to_array(),
            edges: (2.0 * b.half).to_array(),
            albedo: mean_reflectance(&b.reflectance, 2.0 * b.half).to_array(),
            intercepted: r.intercepted,
            intercepted_error: r.intercepted_error,
            directional: r.directional,
            hidden: r.hidden,
            reflected: r.reflected.to_array(),
        }
    }
}

/// One row for each cluster.
pub fn rows(simplified: &Simplified) -> Vec<ClusterRow> {
    simplified.clusters.iter().enumerate().map(|(i, c)| ClusterRow::new(i, c)).collect()
}

/// Writes rows as JSON, numbers that are not finite as null.
///
/// # Errors
/// What the writer says.
pub fn write_json(rows: &[ClusterRow], out: &mut impl Write) -> io::Result<()> {
    Ok(serde_json::to_writer_pretty(out, rows)?)
}

/// Writes rows as comma-separated values with a header.
///
/// # Errors
/// What the writer says.
pub fn write_csv(rows: &[ClusterRow], out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "cluster,surfaces,triangles,diagonal,hit_share,centre_x,centre_y,centre_z,edge_x,edge_y,edge_z,albedo_r,albedo_g,\
         albedo_b,intercepted,intercepted_error,directional,hidden,reflected_r,reflected_g,reflected_b"
    )?;
    for r in rows {
        write!(out, "{},{},{},{},{}", r.cluster, r.surfaces, r.triangles, r.diagonal, r.hit_share)?;
        for x in [r.centre, r.edges, r.albedo].as_flattened() {
            write!(out, ",{x}")?;
        }
        for x in [r.intercepted, r.intercepted_error, r.directional, r.hidden].iter().chain(&r.reflected) {
            write!(out, ",{x}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
