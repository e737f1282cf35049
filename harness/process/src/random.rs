//! Random numbers that are not uniform, and seeds of independent sequences.

/// A normal number of mean 0 and deviation 1 (Box & Muller, Ann. Math. Statist. 29, 1958).
pub fn normal(random: &mut fastrand::Rng) -> f64 {
    let (u, v) = (1.0 - random.f64(), random.f64());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A seed that is about as good as any other for what is numbered so: 31 bits and never 0, as C's `srandom` takes them.
pub fn seed(numbers: &[u64]) -> u32 {
    let mixed = numbers.iter().fold(0, |mixed: u64, number| fastrand::Rng::with_seed(mixed ^ number).u64(..));
    (mixed >> 33).max(1) as u32
}
