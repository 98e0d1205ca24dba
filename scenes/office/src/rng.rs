//! Random numbers that depend on the seed and on what they are for, so that adding one thing does not move the others.

/// A counter hashed with a key: the same seed and purpose always give the same sequence.
#[derive(Clone, Debug)]
pub struct Rng {
    key: u32,
    counter: u32,
}

/// A 32-bit mixer (Ettinger's two-round constants).
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

impl Rng {
    /// The sequence for one purpose.
    pub fn new(seed: u32, purpose: &str) -> Self {
        let key = purpose.bytes().fold(hash(seed ^ 0x9e37_79b9), |key, byte| hash(key ^ u32::from(byte)));
        Rng { key, counter: 0 }
    }

    fn next(&mut self) -> u32 {
        self.counter = self.counter.wrapping_add(1);
        hash(self.key ^ hash(self.counter))
    }

    /// Uniform in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in `low..high`.
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `-spread..spread`.
    pub fn around(&mut self, spread: f32) -> f32 {
        self.range(-spread, spread)
    }

    /// Uniform in `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.next()) * n as u64) >> 32) as usize
    }
}
