//! Owen-scrambled Sobol points: the sample numbers of the sampled solvers and of the certifier, each dimension as it is asked for.
//!
//! Sequence: I. M. Sobol 1967; direction numbers of S. Joe and F. Y. Kuo, "Constructing Sobol sequences with better
//! two-dimensional projections", SIAM J. Sci. Comput. 30, 2008 (file new-joe-kuo-6.21201). Scrambling and padding by
//! shuffled blocks: B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020, with the permutation of
//! N. Vegdahl, "Building a better LK hash", 2021. Owen scrambling makes the mean of any number of points unbiased and
//! that of 2^m points far less scattered than that of random ones; independent seeds give independent means.

/// Dimensions of one Sobol block; further ones come from the same block, shuffled.
const BLOCK: usize = 16;
/// Dimensions beyond which low discrepancy gains nothing and plain hashing is cheaper.
const HASHED_FROM: usize = 4 * BLOCK;

/// The coordinates of one point of one scrambled sequence, dimension by dimension.
pub(crate) struct Sampler {
    seed: u64,
    index: u32,
    dimension: usize,
    /// The block whose index is shuffled.
    block: usize,
    /// The shuffled index of that block, bits reversed.
    shuffled: u32,
}

impl Sampler {
    /// Point `index` of the sequence that `seed` scrambles.
    ///
    /// The first 2^m points of every sequence are balanced, so that one may double their number at any time.
    pub(crate) fn new(seed: u64, index: u32) -> Self {
        Self { seed, index, dimension: 0, block: usize::MAX, shuffled: 0 }
    }

    /// The next coordinate, in 0..1, of 53 bits.
    pub(crate) fn next(&mut self) -> f64 {
        let dimension = self.dimension;
        self.dimension += 1;
        if dimension >= HASHED_FROM {
            let key = mix(self.seed ^ u64::from(self.index).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            return unit(mix(key.wrapping_add(dimension as u64)));
        }
        if dimension / BLOCK != self.block {
            self.block = dimension / BLOCK;
            let first = self.block * BLOCK;
            let seed = mix(self.seed ^ 0x5851_f42d_4c95_7f2d_u64.wrapping_mul(1 + first as u64));
            self.shuffled = laine_karras(self.index.reverse_bits(), seed as u32);
        }
        let digits = sobol_reversed(dimension % BLOCK, self.shuffled);
        let seed = mix(self.seed.wrapping_add(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(1 + dimension as u64)));
        let scrambled = laine_karras(digits, seed as u32);
        // Digits beyond the 32nd are as good as random: a hash of those before.
        let tail = mix(u64::from(scrambled) ^ seed) >> 43;
        unit((u64::from(scrambled.reverse_bits()) << 32) | (tail << 11))
    }

    /// The next two coordinates.
    pub(crate) fn next_pair(&mut self) -> [f64; 2] {
        [self.next(), self.next()]
    }

    /// Two coordinates moved on round the unit square and folded, all points of the sequence by the same random way.
    ///
    /// A jump of the integrand along a coordinate cuts one stratum of the points, and the mean over the sequence takes
    /// two values, one of them so rare perhaps that every sequence has the other. Moved, each sequence is cut elsewhere;
    /// folded, what is smooth stays continuous at the edge.
    pub(crate) fn moved(&self, pair: [f64; 2]) -> [f64; 2] {
        let kind = mix(self.seed ^ 0x2545_f491_4f6c_dd1d);
        let by = [unit(kind), unit(mix(kind))];
        std::array::from_fn(|k| 1.0 - (2.0 * (pair[k] + by[k]).fract() - 1.0).abs())
    }
}

/// A well mixed function of 64 bits (the finaliser of splitmix64, G. Steele et al. 2014).
pub(crate) fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Random bits as a number below 1.
pub(crate) fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// A random permutation of the 32 bits in which every bit is changed by lower bits only: Owen scrambling where the
/// lowest bit is the first digit.
fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

/// The first 32 binary digits of a Sobol coordinate, first digit lowest, of an index whose bits are reversed.
fn sobol_reversed(dimension: usize, reversed_index: u32) -> u32 {
    let table = &NIBBLES[dimension];
    (0..8).fold(0, |digits, k| digits ^ table[k][(reversed_index >> (4 * k)) as usize & 15])
}

/// Primitive polynomials and first direction numbers of dimensions 2 to 16: (degree, inner coefficients, m).
const JOE_KUO: [(usize, u32, [u32; 6]); BLOCK - 1] = [
    (1, 0, [1, 0, 0, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0, 0, 0]),
    (3, 1, [1, 3, 1, 0, 0, 0]),
    (3, 2, [1, 1, 1, 0, 0, 0]),
    (4, 1, [1, 1, 3, 3, 0, 0]),
    (4, 4, [1, 3, 5, 13, 0, 0]),
    (5, 2, [1, 1, 5, 5, 17, 0]),
    (5, 4, [1, 1, 5, 5, 5, 0]),
    (5, 7, [1, 1, 7, 11, 19, 0]),
    (5, 11, [1, 1, 5, 1, 1, 0]),
    (5, 13, [1, 1, 1, 3, 11, 0]),
    (5, 14, [1, 3, 5, 5, 31, 0]),
    (6, 1, [1, 3, 3, 9, 7, 49]),
    (6, 13, [1, 1, 1, 15, 21, 21]),
    (6, 16, [1, 3, 1, 13, 27, 49]),
];

/// XOR of direction numbers, digits reversed, for every value of every four bits of the reversed index.
static NIBBLES: [[[u32; 16]; 8]; BLOCK] = nibbles();

const fn nibbles() -> [[[u32; 16]; 8]; BLOCK] {
    let mut table = [[[0; 16]; 8]; BLOCK];
    let mut dimension = 0;
    while dimension < BLOCK {
        let columns = columns(dimension);
        let mut bit = 0;
        while bit < 32 {
            let mut value = 0;
            while value < 16 {
                if value >> (bit % 4) & 1 == 1 {
                    // Bit `bit` of the reversed index is bit 31 - bit of the index.
                    table[dimension][bit / 4][value] ^= columns[31 - bit].reverse_bits();
                }
                value += 1;
            }
            bit += 1;
        }
        dimension += 1;
    }
    table
}

/// The generator matrix of a dimension: direction numbers of index bits 0 to 31, as 32-bit fractions.
const fn columns(dimension: usize) -> [u32; 32] {
    let mut v = [0; 32];
    let mut i = 0;
    while i < 32 {
        if dimension == 0 {
            v[i] = 1 << (31 - i);
        } else {
            let (degree, inner, m) = JOE_KUO[dimension - 1];
            if i < degree {
                v[i] = m[i] << (31 - i);
            } else {
                v[i] = v[i - degree] ^ (v[i - degree] >> degree);
                let mut k = 1;
                while k < degree {
                    v[i] ^= ((inner >> (degree - 1 - k)) & 1) * v[i - k];
                    k += 1;
                }
            }
        }
        i += 1;
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coordinates(seed: u64, index: u32, count: usize) -> Vec<f64> {
        let mut sampler = Sampler::new(seed, index);
        (0..count).map(|_| sampler.next()).collect()
    }

    #[test]
    fn direction_numbers_come_from_primitive_polynomials() {
        for (degree, inner, m) in JOE_KUO {
            let polynomial = (1 << degree) | (inner << 1) | 1;
            let (mut state, mut period) = (1_u32, 0);
            loop {
                state <<= 1;
                if state >> degree == 1 {
                    state ^= polynomial;
                }
                period += 1;
                if state == 1 {
                    break;
                }
            }
            assert_eq!(period, (1 << degree) - 1, "degree {degree}, coefficients {inner}");
            for (k, m) in m.iter().enumerate() {
                assert!(if k < degree { m % 2 == 1 && *m < 2 << k } else { *m == 0 });
            }
        }
    }

    #[test]
    fn every_dimension_of_every_doubling_has_one_point_a_stratum() {
        for seed in [1, 99] {
            for m in [1, 4, 9] {
                let n = 1_u32 << m;
                let points: Vec<_> = (0..n).map(|i| coordinates(seed, i, HASHED_FROM)).collect();
                for dimension in 0..HASHED_FROM {
                    let mut seen = vec![false; n as usize];
                    for p in &points {
                        seen[(p[dimension] * f64::from(n)) as usize] = true;
                    }
                    assert!(seen.iter().all(|s| *s), "seed {seed}, {n} points, dimension {dimension}");
                }
            }
        }
    }

    #[test]
    fn the_first_two_dimensions_are_a_net_in_every_shape_of_stratum() {
        let m = 8;
        let points: Vec<_> = (0..1 << m).map(|i| coordinates(5, i, 2)).collect();
        for across in 0..=m {
            let (columns, rows) = (1 << across, 1 << (m - across));
            let mut seen = vec![false; 1 << m];
            for p in &points {
                seen[(p[0] * f64::from(columns)) as usize * rows + (p[1] * rows as f64) as usize] = true;
            }
            assert!(seen.iter().all(|s| *s), "{columns} x {rows}");
        }
    }

    #[test]
    fn a_point_is_uniform_over_seeds_in_every_dimension_and_dimensions_are_uncorrelated() {
        let (seeds, dimensions) = (4000, HASHED_FROM + 2);
        let points: Vec<_> = (0..seeds).map(|s| coordinates(mix(s + 1), 77, dimensions)).collect();
        let scatter = 1.0 / (12.0 * seeds as f64).sqrt();
        for d in 0..dimensions {
            let mean = points.iter().map(|p| p[d]).sum::<f64>() / seeds as f64;
            assert!((mean - 0.5).abs() < 4.5 * scatter, "dimension {d}: mean {mean}");
            let e = (d + 1) % dimensions;
            let product = points.iter().map(|p| (p[d] - 0.5) * (p[e] - 0.5)).sum::<f64>() / seeds as f64;
            assert!(product.abs() < 4.5 / 12.0 / (seeds as f64).sqrt(), "dimensions {d}, {e}: {product}");
        }
    }

    #[test]
    fn smooth_integrals_converge_far_faster_than_random() {
        // Product over 6 dimensions of 1 + (x - 1/2), whose integral is 1 and standard deviation .80.
        let f = |p: &[f64]| p.iter().map(|x| 0.5 + x).product::<f64>();
        let (n, seeds) = (1 << 12, 16);
        let random = 0.8 / f64::from(n).sqrt();
        let rms_error = |first: usize| {
            let mean =
                |seed| (0..n).map(|i| f(&coordinates(mix(seed), i, first + 6)[first..])).sum::<f64>() / f64::from(n);
            ((1..=seeds).map(|s| (mean(s) - 1.0_f64).powi(2)).sum::<f64>() / seeds as f64).sqrt()
        };
        assert!(rms_error(0) < 0.05 * random, "within a block: {} of random", rms_error(0) / random);
        // Where three dimensions belong to one block and three to the next, their interaction is as good as random.
        let across = rms_error(2 * BLOCK - 3);
        assert!(across < 0.6 * random, "across blocks: {} of random", across / random);
    }
}
