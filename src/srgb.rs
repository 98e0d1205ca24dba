//! The sRGB transfer function, for textures read and images written.

/// Linear 0..1 to sRGB-encoded 0..1 (IEC 61966-2-1).
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// sRGB-encoded 0..1 to linear 0..1 (IEC 61966-2-1).
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_and_back() {
        for byte in 0..=255u8 {
            let value = f32::from(byte) / 255.0;
            assert_eq!((srgb_encode(srgb_decode(value)) * 255.0).round() as u8, byte);
        }
    }
}
