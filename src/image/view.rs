//! From scene-referred radiance to what a screen shows: exposure, tone curve, sRGB encoding.

use super::buffer::Image;
use crate::srgb::srgb_encode;

/// How radiance outside of the range of a screen is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ViewTransform {
    /// Clipped at 1, then sRGB-encoded: exact where the image is not overexposed.
    Srgb,
    /// AgX by Troy Sobotka (2022), with Benjamin Wrensch's polynomial for its sigmoid ("Minimal AgX Implementation",
    /// 2023): 16.5 stops from 2^-12.47 to 2^4.03, 10 below mid-grey and 6.5 above, colours bleached towards the top
    /// instead of turning to the primaries. Mid-grey, 0.18, is shown at half of the encoded range (0.21 linear).
    #[default]
    Filmic,
    /// The perceptual tone reproduction of Tumblin and Rushmeier (1993), as revised by Tumblin, Hodgins and Guenter, "Two methods
    /// for display of high contrast images" (1999): the image looks as bright, and as rich in contrast, to someone adapted to the
    /// screen as the scene to someone adapted to it. A dark scene stays dark.
    Perceptual {
        /// Luminance that the observer of the scene is adapted to, cd/m^2.
        adaptation: f64,
    },
}

/// Luminance of white light of 1 W/(sr m^2) in each band, cd/m^2: the mean efficacy over the visible spectrum, as Radiance takes
/// it.
pub const EFFICACY: f64 = 179.0;
/// Luminance of a screen's white, and what its observer is adapted to, cd/m^2.
const SCREEN: [f64; 2] = [100.0, 20.0];
/// Contrast of a screen.
const SCREEN_CONTRAST: f64 = 100.0;

/// Stevens' contrast sensitivity at a luminance of adaptation (cd/m^2), as Tumblin, Hodgins and Guenter fit it.
fn contrast_sensitivity(luminance: f64) -> f64 {
    if luminance > 100.0 { 2.655 } else { 1.855 + 0.4 * (luminance + 2.3e-5).log10() }
}

/// Factor from scene-referred colour to the screen's 0..1, for light of a luminance above 0.
fn perceptual_scale(luminance: f64, adaptation: f64) -> f64 {
    let [white, screen] = SCREEN;
    let [of_scene, of_screen] = [adaptation, screen].map(contrast_sensitivity);
    let overall = SCREEN_CONTRAST.sqrt().powf(of_scene / of_screen - 1.0);
    let shown = overall * screen * (EFFICACY * luminance / adaptation).powf(of_scene / of_screen);
    shown / white / luminance
}

/// AgX works with the logarithm of radiance between these.
const AGX_STOPS: [f32; 2] = [-12.473_93, 4.026_069];

/// Rows: AgX's inset of the Rec. 709 primaries, which keeps bright saturated light from clipping in one band.
const AGX_INSET: [[f32; 3]; 3] = [
    [0.842_479_1, 0.078_433_6, 0.079_223_75],
    [0.042_328_24, 0.878_468_64, 0.079_166_13],
    [0.042_375_655, 0.078_433_6, 0.879_143],
];

/// Rows: the inverse of [`AGX_INSET`].
const AGX_OUTSET: [[f32; 3]; 3] = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_635, -0.098_043_45, 1.151_073_7],
];

impl ViewTransform {
    /// [`ViewTransform::Perceptual`] for someone who looks at this image: adapted to its log-average luminance.
    pub fn perceptual(image: &Image) -> Self {
        let logarithm = log_average(image).unwrap_or(0.0);
        ViewTransform::Perceptual { adaptation: EFFICACY * logarithm.exp2() }
    }

    /// Linear Rec. 709 radiance to values of 0..1 encoded for an sRGB screen. Negative and undefined radiance is
    /// black, infinite radiance is white.
    pub fn encode(self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|value| value.max(0.0)); // max() also turns NaN into 0
        match self {
            ViewTransform::Srgb => rgb.map(|value| srgb_encode(value.min(1.0))),
            ViewTransform::Perceptual { adaptation } => {
                let rgb = rgb.map(|value| value.min(1e30));
                let luminance = luminance(rgb);
                let scale = if luminance > 0.0 { perceptual_scale(luminance, adaptation) } else { 0.0 };
                rgb.map(|value| srgb_encode((f64::from(value) * scale).min(1.0) as f32))
            }
            ViewTransform::Filmic => {
                // Infinity would meet the negative entries of the outset as NaN; the curve is flat long before.
                let inset = multiply(&AGX_INSET, rgb.map(|value| value.min(1e6)));
                multiply(&AGX_OUTSET, inset.map(agx_curve)).map(|value| value.clamp(0.0, 1.0))
            }
        }
    }
}

/// AgX's sigmoid over log2 of the radiance; the result is display-encoded.
fn agx_curve(value: f32) -> f32 {
    let [low, high] = AGX_STOPS;
    let x = ((value.max(f32::MIN_POSITIVE).log2() - low) / (high - low)).clamp(0.0, 1.0);
    let polynomial = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];
    polynomial.into_iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

/// Weighted means: the published rows sum to 1 only within 2e-4, which would tint greys.
fn multiply(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| (row[0] * v[0] + row[1] * v[1] + row[2] * v[2]) / (row[0] + row[1] + row[2]))
}

/// Luminance of linear Rec. 709 colour, in the unit of its bands.
pub fn luminance(rgb: [f32; 3]) -> f64 {
    0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2])
}

/// Share of the pixels that [`auto_exposure`] disregards: the darkest, and the brightest, among which are the light
/// sources.
const TAILS: [f64; 2] = [0.01, 0.05];

/// Exposure in stops that brings the geometric mean of the luminance to mid-grey, 0.18 (the log-average of Reinhard et
/// al. 2002), between two percentiles and without black and undefined pixels. 0 if nothing is left.
pub fn auto_exposure(image: &Image) -> f32 {
    log_average(image).map_or(0.0, |mean| (0.18f64.log2() - mean) as f32)
}

/// Mean of the logarithm (base 2) of the luminance, between two percentiles and without black and undefined pixels; `None` if
/// nothing is left.
fn log_average(image: &Image) -> Option<f64> {
    let [r, g, b] = image.rgb_or_grey()?;
    let mut logarithms: Vec<f64> = (0..image.pixels())
        .map(|i| luminance([r[i], g[i], b[i]]))
        .filter(|luminance| luminance.is_finite() && *luminance > 0.0)
        .map(f64::log2)
        .collect();
    logarithms.sort_by(f64::total_cmp);
    let count = logarithms.len() as f64;
    let kept = &logarithms[(count * TAILS[0]) as usize..logarithms.len() - (count * TAILS[1]) as usize];
    (!kept.is_empty()).then(|| kept.iter().sum::<f64>() / kept.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::srgb::srgb_decode;

    const VIEWS: [ViewTransform; 3] =
        [ViewTransform::Srgb, ViewTransform::Filmic, ViewTransform::Perceptual { adaptation: 30.0 }];

    #[test]
    fn greys_rise_from_black_to_white_and_stay_grey() {
        for view in VIEWS {
            assert_eq!(view.encode([0.0; 3]), [0.0; 3]);
            let mut last = 0.0;
            // 2^-14 to 2^6 in steps of a hundredth of a stop.
            for step in 0..2000 {
                let encoded = view.encode([(step as f32 / 100.0 - 14.0).exp2(); 3]);
                // Greys meet equal weights, so only rounding tells the bands apart: some ten operations on values up
                // to 40 (the polynomial's coefficients), 6e-8 each.
                assert!(encoded.iter().all(|band| (band - encoded[0]).abs() < 2.4e-5), "{view:?} {encoded:?}");
                assert!(encoded[0] >= last - 1e-6, "{view:?} falls at step {step}: {last} to {}", encoded[0]);
                last = encoded[0];
            }
            assert!(last > 0.98, "{view:?} reaches only {last}");
        }
        // AgX puts mid-grey at half of the encoded range; the polynomial's root mean square error is published as 1.9e-3.
        let mid = ViewTransform::Filmic.encode([0.18; 3])[0];
        assert!((mid - 0.5).abs() < 3.0 * 1.9e-3, "0.18 becomes {mid}");
    }

    #[test]
    fn whatever_comes_in_stays_in_range() {
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e-40, 1e-3, 0.5, 20.0, f32::MAX];
        for view in VIEWS {
            for (r, g, b) in odd.iter().flat_map(|&r| odd.iter().flat_map(move |&g| odd.map(|b| (r, g, b)))) {
                let encoded = view.encode([r, g, b]);
                assert!(encoded.iter().all(|v| (0.0..=1.0).contains(v)), "{view:?} {r} {g} {b}: {encoded:?}");
            }
        }
    }

    #[test]
    fn exposure_brings_the_middle_to_grey_despite_lamps_and_black() {
        let mut image = Image::new(100, 1);
        let mut values = vec![glam::Vec3::splat(0.045); 100];
        (values[3], values[50], values[51], values[70]) =
            (glam::Vec3::splat(1e6), glam::Vec3::ZERO, glam::Vec3::splat(f32::NAN), glam::Vec3::splat(1e5));
        image.push_rgb("", &values);
        // Single precision of log2.
        assert!((auto_exposure(&image) - 2.0).abs() < 1e-5);
        let mut black = Image::new(2, 2);
        black.push_rgb("", &[glam::Vec3::ZERO; 4]);
        assert_eq!(auto_exposure(&black), 0.0);
    }

    /// What an observer is adapted to is shown at the screen's own adaptation, darker at night and brighter by day (the factor
    /// `sqrt(C)^(g - 1)`), and contrast between two greys is raised to the power `g`.
    #[test]
    fn perceptual_tones_follow_the_observer() {
        let shown = |value: f32, adaptation: f64| {
            let view = ViewTransform::Perceptual { adaptation };
            f64::from(srgb_decode(view.encode([value; 3])[0]))
        };
        let at = |adaptation: f64| (adaptation / EFFICACY) as f32;
        // Same adaptation as the screen's: nothing but a scale.
        for factor in [0.1f32, 0.5, 1.0, 3.0] {
            let got = shown(factor * at(20.0), 20.0);
            assert!((got - 0.2 * f64::from(factor)).abs() < 1e-5, "{factor}: {got}");
        }
        let screen = 1.855 + 0.4 * 20f64.log10();
        for (adaptation, sensitivity) in [(0.1, 1.455), (3000.0, 2.655)] {
            let g = sensitivity / screen;
            let middle = 0.2 * 10f64.powf(g - 1.0);
            let got = shown(at(adaptation), adaptation);
            assert!((got / middle - 1.0).abs() < 1e-3, "{adaptation}: {got} {middle}");
            let ratio = shown(0.5 * at(adaptation), adaptation) / got;
            assert!((ratio / 0.5f64.powf(g) - 1.0).abs() < 1e-3, "{adaptation}: {ratio}");
        }
        let mut grey = Image::new(10, 10);
        grey.push_rgb("", &[glam::Vec3::splat(at(500.0)); 100]);
        let ViewTransform::Perceptual { adaptation } = ViewTransform::perceptual(&grey) else { panic!() };
        assert!((adaptation / 500.0 - 1.0).abs() < 1e-5);
    }
}
