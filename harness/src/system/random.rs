//! Random numbers that are not uniform.

/// A normal number of mean 0 and deviation 1 (Box & Muller, Ann. Math. Statist. 29, 1958).
pub(crate) fn normal(random: &mut fastrand::Rng) -> f64 {
    let (u, v) = (1.0 - random.f64(), random.f64());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
