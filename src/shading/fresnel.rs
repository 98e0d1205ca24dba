//! Fresnel reflectance of dielectric interfaces.

/// Reflectances for s- and p-polarised light at an interface with relative index `eta` (far side over near side), for
/// the cosine `cosine >= 0` to the normal on the near side. Both 1 under total internal reflection.
pub fn polarised(cosine: f32, eta: f32) -> [f32; 2] {
    let Some(transmitted) = refracted_cosine(cosine, eta) else { return [1.0, 1.0] };
    let s = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    let p = (eta * cosine - transmitted) / (eta * cosine + transmitted);
    [s * s, p * p]
}

/// Reflectance for unpolarised light; arguments as for [`polarised`].
pub fn unpolarised(cosine: f32, eta: f32) -> f32 {
    let [s, p] = polarised(cosine, eta);
    0.5 * (s + p)
}

/// Cosine of the refracted direction (Snell's law); `None` under total internal reflection.
pub fn refracted_cosine(cosine: f32, eta: f32) -> Option<f32> {
    // 1 - sin^2 / eta^2, arranged so that nothing cancels for eta near 1 at grazing angles.
    let squared = ((eta - 1.0) * (eta + 1.0) + cosine * cosine) / (eta * eta);
    (squared > 0.0).then(|| squared.sqrt())
}

/// Reflectance of a clear slab whose two faces each reflect `r`, all passes to and fro summed incoherently:
/// `r + (1 - r)^2 r / (1 - r^2)`. Its transmittance is one minus this.
pub fn slab(r: f32) -> f32 {
    2.0 * r / (1.0 + r)
}

/// Reflectance at normal incidence.
pub fn at_normal(eta: f32) -> f32 {
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}

/// Schlick's weight `(1 - cosine)^5`: reflectance is `f0 + (f90 - f0) weight`.
pub fn schlick_weight(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let squared = x * x;
    squared * squared * x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SPEC-001 and SPEC-012 of the reference cases: exact and Schlick's reflectance for glass and water.
    #[test]
    fn matches_reference_values() {
        let degrees = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 75.0, 80.0, 85.0, 89.0_f32];
        let exact = [
            0.04,
            0.040_080_767_152_867_39,
            0.041_522_625_975_821_54,
            0.050_239_911_012_235_94,
            0.089_186_712_802_212_78,
            0.171_042_535_367_464_58,
            0.253_060_562_990_319_65,
            0.387_704_354_691_472_7,
            0.612_799_645_264_827_3,
            0.904_184_949_780_189_2_f64,
        ];
        let schlick = [
            0.04,
            0.040_000_044_095_868_284,
            0.040_041_436_543_139_367,
            0.042_069_273_124_372_36,
            0.07,
            0.158_395_235_277_342_17,
            0.254_729_884_086_614_36,
            0.409_910_091_022_385_4,
            0.648_491_718_235_518_1,
            0.919_101_891_799_721_9,
        ];
        compare(1.5, &degrees, &exact, &schlick);
        let degrees = [0.0, 20.0, 40.0, 55.0, 65.0, 77.0, 88.0];
        let exact = [
            0.020_373_187_841_971_424,
            0.020_555_406_219_225_667,
            0.024_502_360_958_304_5,
            0.043_381_707_618_814_78,
            0.087_119_909_329_982_8,
            0.257_932_197_525_934_66,
            0.804_042_691_517_067_5,
        ];
        let schlick = [
            0.020_373_187_841_971_424,
            0.020_373_969_313_107_077,
            0.021_059_825_293_980_563,
            0.034_185_508_099_138_69,
            0.083_233_405_645_399_42,
            0.294_345_271_169_538_3,
            0.840_580_003_244_266_2,
        ];
        compare(1.333, &degrees, &exact, &schlick);
    }

    fn compare(ior: f32, degrees: &[f32], exact: &[f64], schlick: &[f64]) {
        // Ten f32 operations, each relative to values below 1; the cosine's rounding is amplified by at most 5
        // (the exponent of Schlick's weight) or the slope of the exact curve, below 15 near grazing.
        let bound = 25.0 * f64::from(f32::EPSILON);
        let f0 = at_normal(ior);
        for ((degrees, exact), schlick) in degrees.iter().zip(exact).zip(schlick) {
            let cosine = f64::from(*degrees).to_radians().cos() as f32;
            let f = f64::from(unpolarised(cosine, ior));
            assert!((f - exact).abs() < bound, "{ior} at {degrees}: {f}, expected {exact}");
            let f = f64::from(f0 + (1.0 - f0) * schlick_weight(cosine));
            assert!((f - schlick).abs() < bound, "Schlick, {ior} at {degrees}: {f}, expected {schlick}");
        }
    }

    /// SPEC-002: Brewster's and the critical angle.
    #[test]
    fn brewster_and_critical_angle() {
        let brewster = 56.309_932_474_020_215_f64.to_radians().cos() as f32;
        assert!(polarised(brewster, 1.5)[1] < 1e-12);
        let critical = 41.810_314_895_778_625_f64;
        let cosine = |degrees: f64| degrees.to_radians().cos() as f32;
        assert_eq!(unpolarised(cosine(critical + 0.001), 1.0 / 1.5), 1.0);
        assert!(unpolarised(cosine(critical - 0.001), 1.0 / 1.5) < 1.0);
        assert_eq!(refracted_cosine(0.0, 1.0 / 1.5), None);
    }

    /// SPEC-003: transmittance of a clear slab, each polarisation followed by itself.
    #[test]
    fn slab_matches_reference_values() {
        let expected = [
            0.923_076_923_076_923_1,
            0.920_734_443_869_001_5,
            0.907_344_329_801_628_9,
            0.848_128_409_728_800_2,
            0.618_148_516_254_708_7,
            0.246_930_580_386_571_17_f64,
        ];
        for (degrees, expected) in [0.0, 30.0, 45.0, 60.0, 75.0, 85.0_f64].into_iter().zip(expected) {
            let [s, p] = polarised(degrees.to_radians().cos() as f32, 1.5).map(slab);
            let transmittance = 1.0 - 0.5 * f64::from(s + p);
            // As above: rounding times the slope of the curve.
            assert!((transmittance - expected).abs() < 25.0 * f64::from(f32::EPSILON), "{degrees}: {transmittance}");
        }
    }
}
