//! Transmitting surfaces: panes, thin sheets and refracting solids.

use glam::Vec3;

use super::glass_albedo::{self, Parts};
use super::layered::{Local, Reflection};
use super::{fresnel, ggx};
use crate::backend::PartKind;
use crate::scene::Material;

/// Relative index of refraction closer to one than this bends nothing that f32 resolves.
const INDEX_MATCHED: f32 = 1e-3;

/// Quadrature points per axis for the albedo of rough sheets.
const ALBEDO_POINTS: u32 = 12;

/// How light goes on behind the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Geometry {
    /// One face of a flat slab that is modelled with both: straight, Fresnel's term of one interface. The angle
    /// outside of the slab serves for both faces, as a parallel face reflects the refracted ray as much.
    SlabFace,
    /// A whole slab modelled as one sheet: straight, Fresnel's term of two interfaces and all passes between them.
    Sheet,
    /// The boundary of a solid: bends, with total internal reflection.
    Solid {
        /// Index of refraction of the far side over that of the near side, where `outgoing` is.
        eta: f32,
    },
}

/// The transmitting share of a material.
#[derive(Clone, Copy, Debug)]
pub struct Glass {
    geometry: Geometry,
    /// Index of refraction of the material, at least 1.
    ior: f32,
    normal_reflectance: f32,
    specular: f32,
    specular_color: Vec3,
    /// Share of the material that is glass, times what makes up for masked facets.
    scale: f32,
    /// Where light goes that meets the rough boundary of a solid.
    parts: Parts,
    /// Transmitted light is multiplied with it. The base colour is that of light which went in and out, as in Cycles: each
    /// boundary of two has its root.
    tint: Vec3,
    /// Whether shadow rays pass through.
    pane: bool,
}

impl Glass {
    /// Glass that makes up `share` of the material.
    pub fn new(material: &Material, kind: PartKind, share: f32, at: &Local) -> Self {
        let ior = material.ior.max(1.0);
        let pane = kind == PartKind::Pane;
        let geometry = match (material.refracts, pane) {
            (false, _) => Geometry::Sheet,
            (true, true) => Geometry::SlabFace,
            (true, false) => Geometry::Solid { eta: if at.front { ior } else { 1.0 / ior } },
        };
        Glass {
            geometry,
            ior,
            normal_reflectance: fresnel::at_normal(ior),
            specular: at.specular,
            specular_color: at.specular_color,
            scale: share,
            parts: Parts::default(),
            tint: if material.refracts { at.base_color.map(f32::sqrt) } else { at.base_color },
            pane,
        }
    }

    /// Returns what masking takes from a rough surface that is seen at `cosine` (Turquin 2019). `mirror`: the lossless albedo of a
    /// reflecting lobe there, whose shape those of a sheet have on both sides.
    pub fn with_compensation(self, cosine: f32, roughness: f32, mirror: f32) -> Self {
        match self.geometry {
            Geometry::Solid { eta } => {
                let parts = glass_albedo::directional(eta, roughness, cosine);
                Glass { scale: self.scale / parts.total(), parts, ..self }
            }
            _ => Glass { scale: self.scale / mirror, ..self },
        }
    }

    /// Whether shadow rays pass through.
    pub fn is_pane(&self) -> bool {
        self.pane
    }

    /// Whether it bends light by definition, but not by its index.
    pub fn is_index_matched(&self) -> bool {
        matches!(self.geometry, Geometry::Solid { .. }) && self.ior - 1.0 < INDEX_MATCHED
    }

    /// Reflectance and tinted transmittance at a facet for the cosine `along` to its normal, times the glass's share.
    pub fn fresnel(&self, along: f32) -> (Vec3, Vec3) {
        let reflected = match self.geometry {
            Geometry::SlabFace => self.colored(fresnel::unpolarised(along, self.ior)),
            Geometry::Sheet => {
                let [s, p] = fresnel::polarised(along, self.ior).map(|f| self.colored(f));
                let slab = |r: Vec3| Vec3::new(fresnel::slab(r.x), fresnel::slab(r.y), fresnel::slab(r.z));
                0.5 * (slab(s) + slab(p))
            }
            // Total reflection is a matter of geometry: no strength or colour weakens it.
            Geometry::Solid { eta } => match fresnel::refracted_cosine(along, eta) {
                None => Vec3::ONE,
                Some(_) => self.colored(fresnel::unpolarised(along, eta)),
            },
        };
        (self.scale * reflected, self.scale * (Vec3::ONE - reflected) * self.tint)
    }

    /// `KHR_materials_specular`: strength everywhere, colour at normal incidence and none at grazing.
    fn colored(&self, f: f32) -> Vec3 {
        if self.specular_color == Vec3::ONE {
            return Vec3::splat(self.specular * f);
        }
        let grazing = ((f - self.normal_reflectance) / (1.0 - self.normal_reflectance)).clamp(0.0, 1.0);
        (self.specular * f * self.specular_color.lerp(Vec3::ONE, grazing)).min(Vec3::ONE)
    }

    /// Factor on transmitted radiance, `1 / eta^2` (pbrt 4ed 9.5.2): a cone of light that enters the denser medium
    /// gets narrower.
    pub fn radiance_scale(&self) -> f32 {
        match self.geometry {
            Geometry::Solid { eta } => 1.0 / (eta * eta),
            _ => 1.0,
        }
    }

    /// Where light comes from that leaves to `outgoing` through a facet with normal `h`, in the surface's frame.
    pub fn transmit(&self, outgoing: Vec3, h: Vec3) -> Option<Vec3> {
        let along = outgoing.dot(h);
        match self.geometry {
            Geometry::Solid { eta } => {
                let refracted = fresnel::refracted_cosine(along, eta)?;
                Some(((along / eta - refracted) * h - outgoing / eta).normalize())
            }
            // As the specification has it: the reflected direction, mirrored to the other side.
            _ => Some((2.0 * along * h - outgoing) * Vec3::new(1.0, 1.0, -1.0)),
        }
    }

    /// The lobe behind a rough surface without its Fresnel term; `incoming` is below, in the surface's frame.
    pub fn transmission(&self, outgoing: Vec3, incoming: Vec3, alpha: f32) -> Option<Reflection> {
        let mirrored = incoming * Vec3::new(1.0, 1.0, -1.0);
        let Geometry::Solid { eta } = self.geometry else {
            return Some(Reflection::new(outgoing, mirrored, alpha));
        };
        // Walter et al. 2007, section 4.2 and equation 21.
        let sum = outgoing + eta * incoming;
        let h = sum.normalize() * if sum.z < 0.0 { -1.0 } else { 1.0 };
        let (along_out, along_in) = (outgoing.dot(h), incoming.dot(h));
        if along_out <= 0.0 || along_in >= 0.0 {
            return None;
        }
        let denominator = along_out + eta * along_in;
        let jacobian = eta * eta * -along_in / (denominator * denominator);
        let scale = ggx::distribution(h, alpha) * along_out * jacobian / outgoing.z;
        Some(Reflection {
            along: along_out,
            value: scale * ggx::masking_shadowing(outgoing, mirrored, alpha) * self.radiance_scale(),
            pdf: scale * ggx::masking(outgoing, alpha),
        })
    }

    /// Share of power that smooth glass passes on.
    pub fn smooth_albedo(&self, outgoing: Vec3) -> Vec3 {
        let (reflected, transmitted) = self.fresnel(outgoing.z);
        reflected + transmitted
    }

    /// Share of power that rough glass passes on: for a sheet by a midpoint rule over its visible facets, for a solid from the
    /// table, as if the colour at grazing angles were that at normal incidence.
    pub fn rough_albedo(&self, outgoing: Vec3, alpha: f32) -> Vec3 {
        if matches!(self.geometry, Geometry::Solid { .. }) {
            let colored = (self.specular * self.parts.reflected * self.specular_color).min(Vec3::ONE);
            let reflected = Vec3::splat(self.parts.totally) + colored;
            let transmitted = (Vec3::splat(self.parts.total()) - reflected).max(Vec3::ZERO);
            return self.scale * (reflected + transmitted * self.tint);
        }
        let mut sum = Vec3::ZERO;
        for i in 0..ALBEDO_POINTS * ALBEDO_POINTS {
            let [x, y] = [i % ALBEDO_POINTS, i / ALBEDO_POINTS].map(|k| (k as f32 + 0.5) / ALBEDO_POINTS as f32);
            let h = ggx::sample_visible(outgoing, alpha, [x, y]);
            let along = outgoing.dot(h);
            let (reflected, transmitted) = self.fresnel(along);
            let masked = |incoming: Vec3| {
                let lambda = ggx::lambda(outgoing, alpha);
                (1.0 + lambda) / (1.0 + lambda + ggx::lambda(incoming, alpha))
            };
            let mirror = 2.0 * along * h - outgoing;
            if mirror.z > 0.0 {
                sum += reflected * masked(mirror);
            }
            if let Some(through) = self.transmit(outgoing, h).filter(|through| through.z < 0.0) {
                sum += transmitted * masked(through);
            }
        }
        // The rule's error may exceed what little is lost.
        (sum / (ALBEDO_POINTS * ALBEDO_POINTS) as f32).min(Vec3::ONE)
    }
}
