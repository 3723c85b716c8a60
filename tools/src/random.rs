//! Random numbers that are the same on every machine: splitmix64 (Steele, Lea & Flood, OOPSLA 2014).

/// The increment of the state: 2^64 over the golden ratio, made odd.
const GAMMA: u64 = 0x9E37_79B9_7F4A_7C15;

/// The generator. Its state advances by a constant, so that the n-th number can be computed without those before it.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

impl Random {
    /// A generator with its own sequence for every pair of a seed and a stream.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { state: mix(seed.wrapping_add(GAMMA) ^ mix(stream.wrapping_add(1))) }
    }

    /// The `n`-th number from here in 0..1; the generator stays as it is.
    pub fn nth(&self, n: u64) -> f64 {
        let bits = mix(self.state.wrapping_add(GAMMA.wrapping_mul(n.wrapping_add(1))));
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The next number between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = self.nth(0);
        self.state = self.state.wrapping_add(GAMMA);
        low + (high - low) * unit
    }
}

/// The output function of splitmix64.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_the_published_one() {
        assert_eq!(mix(GAMMA), 0xE220_A839_7B1D_CDAF); // the first number for seed 0
        assert_eq!(mix(GAMMA.wrapping_mul(2)), 0x6E78_9E6A_A1B9_65F4);
    }

    #[test]
    fn nth_equals_the_numbers_that_follow() {
        let mut random = Random::new(7, 1);
        let ahead: Vec<f64> = (0..5).map(|n| random.nth(n)).collect();
        assert_eq!(ahead, [0; 5].map(|_| random.between(0.0, 1.0)));
    }

    #[test]
    fn numbers_fill_their_range_evenly() {
        let random = Random::new(1, 2);
        let mean = (0..10_000).map(|n| random.nth(n)).sum::<f64>() / 10_000.0;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        assert_ne!(random.nth(0), Random::new(1, 3).nth(0));
        assert_ne!(random.nth(0), Random::new(2, 2).nth(0));
    }
}
