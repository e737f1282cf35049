//! Tests of the zonal cavity method: two derivations, independently computed tables, negative controls.

use super::*;
use approx::assert_relative_eq;

const LM57: ZonalMultipliers = ZonalMultipliers::LM57;

/// A deterministic stream of numbers in 0..1, enough to spread cases.
fn spread(k: u32, dimension: u32) -> f64 {
    let step = [0.754877666, 0.569840291, 0.430159709, 0.324717957][dimension as usize % 4];
    (0.5 + f64::from(k) * step + f64::from(dimension) * 0.317).fract()
}

fn batwing() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 30.0, 45.0, 60.0, 75.0, 90.0, 120.0, 150.0, 180.0];
    let candela = [
        [300.0, 340.0, 330.0, 240.0, 90.0, 10.0, 40.0, 80.0, 100.0],
        [300.0, 420.0, 480.0, 330.0, 100.0, 10.0, 60.0, 90.0, 100.0],
        [300.0, 520.0, 610.0, 400.0, 110.0, 10.0, 80.0, 95.0, 100.0],
    ];
    LuminousIntensityDistribution::new(vec![0.0, 45.0, 90.0], gamma, candela.concat()).unwrap()
}

fn asymmetric() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 20.0, 40.0, 60.0, 80.0, 90.0, 180.0];
    let candela = [
        [500.0, 800.0, 900.0, 500.0, 60.0, 0.0, 0.0],
        [500.0, 650.0, 600.0, 300.0, 40.0, 0.0, 0.0],
        [500.0, 400.0, 250.0, 120.0, 20.0, 0.0, 0.0],
        [500.0, 300.0, 150.0, 70.0, 10.0, 0.0, 0.0],
    ];
    LuminousIntensityDistribution::new(vec![0.0, 60.0, 120.0, 180.0], gamma, candela.concat()).unwrap()
}

fn downlight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];
    LuminousIntensityDistribution::axial(gamma, vec![1000.0, 950.0, 780.0, 420.0, 150.0, 30.0, 0.0]).unwrap()
}

fn uplight() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    LuminousIntensityDistribution::axial(gamma, vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4]).unwrap()
}

/// Largest difference of closed formulas with one set of reflectances and the balance with another, over many rooms.
fn disagreement(swap: impl Fn(CavityReflectances) -> CavityReflectances) -> f64 {
    (0..500)
        .map(|k| {
            let zonal = ZonalFlux(std::array::from_fn(|zone| spread(k, zone as u32)));
            let flux = zonal.down_lm() + zonal.up_lm();
            let cavity = Cavity::lm57(0.1 + 12.0 * spread(k, 1));
            let reflectance = CavityReflectances {
                ceiling_cavity: 0.95 * spread(k, 2),
                walls: 0.95 * spread(k, 3),
                floor_cavity: 0.95 * spread(k, 5),
            };
            let formulas = coefficients(&zonal, flux, &cavity, &reflectance, &LM57).unwrap();
            let solved = balance(&zonal, flux, &cavity, &swap(reflectance), &LM57).unwrap();
            (formulas.utilization - solved.utilization)
                .abs()
                .max((formulas.ceiling_cavity_exitance - solved.ceiling_cavity_exitance).abs())
                .max((formulas.wall_exitance - solved.wall_exitance).abs())
                .max((formulas.wall_direct - solved.wall_direct).abs())
        })
        .fold(0.0, f64::max)
}

#[test]
fn closed_formulas_and_balance_agree_and_a_swapped_reflectance_does_not() {
    let same = disagreement(|reflectance| reflectance);
    assert!(same < 1e-12, "{same:e}");
    let swapped =
        disagreement(|r| CavityReflectances { ceiling_cavity: r.floor_cavity, floor_cavity: r.ceiling_cavity, ..r });
    assert!(swapped > 0.1, "{swapped:e}");
}

#[test]
fn black_walls_are_legal_and_perfect_reflectors_are_not() {
    let zonal = ZonalFlux::of(&batwing());
    let black = CavityReflectances { ceiling_cavity: 0.7, walls: 0.0, floor_cavity: 0.2 };
    let cavity = Cavity::lm57(3.0);
    let formulas = coefficients(&zonal, 1000.0, &cavity, &black, &LM57).unwrap();
    assert_eq!(formulas.wall_exitance, 0.0);
    for value in [1.0, -0.1, f64::NAN] {
        for wrong in [
            CavityReflectances { walls: value, ..black },
            CavityReflectances { ceiling_cavity: value, ..black },
            CavityReflectances { floor_cavity: value, ..black },
        ] {
            for solve in [coefficients, balance] {
                let refused = solve(&zonal, 1000.0, &cavity, &wrong, &LM57);
                assert!(matches!(refused, Err(ZonalCavityError::Reflectance { .. })), "{refused:?}");
            }
        }
    }
    assert!(matches!(coefficients(&zonal, 0.0, &cavity, &black, &LM57), Err(ZonalCavityError::Flux { .. })));
}

/// Zonal flux by brute force over directions, from the intensity function alone.
fn brute_force(distribution: &LuminousIntensityDistribution) -> ZonalFlux {
    let (planes, per_zone) = (144, 400);
    ZonalFlux(std::array::from_fn(|zone| {
        (0..per_zone)
            .map(|k| {
                let step = 10.0 / f64::from(per_zone);
                let low = 10.0 * zone as f64 + step * f64::from(k);
                let band = low.to_radians().cos() - (low + step).to_radians().cos();
                let mean = (0..planes)
                    .map(|c| distribution.intensity((f64::from(c) + 0.5) * 2.5, low + 0.5 * step).value())
                    .sum::<f64>()
                    / f64::from(planes);
                std::f64::consts::TAU * mean * band
            })
            .sum()
    }))
}

fn worst(a: &ZonalFlux, b: &ZonalFlux) -> f64 {
    a.0.iter().zip(&b.0).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn zonal_flux_weighs_every_azimuth_and_a_plain_mean_of_planes_does_not() {
    for distribution in [batwing(), asymmetric(), downlight(), uplight()] {
        let (zonal, brute) = (ZonalFlux::of(&distribution), brute_force(&distribution));
        assert!(worst(&zonal, &brute) < 1e-3, "{zonal:?} {brute:?}");
        assert_relative_eq!(zonal.down_lm() + zonal.up_lm(), distribution.flux().value(), max_relative = 1e-12);
    }
    // The first and the last plane stand for half a step each; giving them a whole one shows.
    let asymmetric = asymmetric();
    let gammas = asymmetric.gamma_deg().len();
    let mean: Vec<f64> = (0..gammas).map(|g| (0..4).map(|c| asymmetric.plane(c)[g]).sum::<f64>() / 4.0).collect();
    let unweighted = LuminousIntensityDistribution::axial(asymmetric.gamma_deg().to_vec(), mean).unwrap();
    assert!(worst(&ZonalFlux::of(&unweighted), &brute_force(&asymmetric)) > 1.0);
}

#[test]
fn effective_reflectance_equals_the_balance_of_its_cavity() {
    for k in 0..300 {
        let (base, walls) = (spread(k, 0), spread(k, 1));
        let cavity = Cavity::rectangular(1.0 + 9.0 * spread(k, 2), 1.0 + 9.0 * spread(k, 3), 0.2 + 8.0 * spread(k, 5));
        // Unit diffuse flux through the opening; base and walls of areas 1 and A exchange what they reflect.
        let (area, f) = (cavity.ratio / 2.5, cavity.form_factor);
        let a = (1.0 - f) / area;
        let (e_base, e_wall) = (f, a);
        let (b_w, w_b, w_w) = (walls * (1.0 - f), base * a, walls * (1.0 - 2.0 * a));
        let wall = (e_wall + w_b * e_base) / (1.0 - w_w - w_b * b_w);
        let floor = e_base + b_w * wall;
        let leaving = f * base * floor + (1.0 - f) * walls * wall;
        assert_relative_eq!(cavity.effective_reflectance(base, walls), leaving, epsilon = 1e-12);
    }
    assert_eq!(Cavity::rectangular(3.0, 4.0, 0.0).effective_reflectance(0.8, 0.5), 0.8);
    assert_relative_eq!(Cavity::lm57(5.0).effective_reflectance(0.8, 0.5), 0.347602, epsilon = 1e-6);
    assert_relative_eq!(Cavity::lm57(1.0).effective_reflectance(0.2, 0.5), 0.191679, epsilon = 1e-6);
}

#[test]
fn the_fitted_form_factor_is_that_of_a_1_6_to_1_room() {
    for ratio in 1..=10 {
        let height = f64::from(ratio) * 1.6 / (5.0 * 2.6);
        let exact = Cavity::rectangular(1.0, 1.6, height);
        assert_relative_eq!(exact.ratio, f64::from(ratio), max_relative = 1e-14);
        assert_relative_eq!(Cavity::lm57(exact.ratio).form_factor, exact.form_factor, epsilon = 2e-3);
    }
    assert_relative_eq!(Cavity::rectangular(1.0, 1.0, 1.0).form_factor, 0.1998, epsilon = 5e-5);
}

#[test]
fn without_room_cavity_the_formulas_reach_their_limit() {
    let zonal = ZonalFlux::of(&batwing());
    let reflectance = CavityReflectances { ceiling_cavity: 0.8, walls: 0.5, floor_cavity: 0.2 };
    let flat = coefficients(&zonal, 2000.0, &Cavity::lm57(0.0), &reflectance, &LM57).unwrap();
    let shallow = Cavity::rectangular(1e6, 1e6, 1e-3);
    let near = coefficients(&zonal, 2000.0, &shallow, &reflectance, &LM57).unwrap();
    assert_relative_eq!(flat.utilization, near.utilization, epsilon = 1e-4);
    assert_relative_eq!(flat.ceiling_cavity_exitance, near.ceiling_cavity_exitance, epsilon = 1e-4);
}

#[test]
fn the_customary_table_has_every_column_and_falls_with_depth() {
    let distribution = batwing();
    let table = UtilizationTable::customary(&ZonalFlux::of(&distribution), distribution.flux().value()).unwrap();
    assert_eq!((table.rows.len(), table.columns.len()), (11, 18));
    for column in 0..table.columns.len() {
        assert!(table.rows.windows(2).all(|w| w[1][column].utilization < w[0][column].utilization));
    }
}

/// For room cavity ratio 0 to 10: (CU, CCEC, WEC) at each of [`GOLDEN_COLUMNS`], floor cavity .2, lamp flux 1.25 x the
/// luminaire's. Zonal flux by two-dimensional quadrature and the 3 x 3 balance, in a Python program apart.
type Golden = [[[f64; 3]; 4]; 11];

/// Ceiling cavity and wall reflectance of the golden columns.
const GOLDEN_COLUMNS: [(f64, f64); 4] = [(0.8, 0.7), (0.7, 0.3), (0.3, 0.5), (0.0, 0.0)];

/// Largest distance from the independent tables.
fn distance_from_golden(multipliers: &ZonalMultipliers) -> f64 {
    let cases =
        [(downlight(), AXIAL_DOWNLIGHT), (batwing(), BATWING), (asymmetric(), ASYMMETRIC), (uplight(), UPLIGHT)];
    let mut worst = 0.0_f64;
    for (distribution, golden) in cases {
        let zonal = ZonalFlux::of(&distribution);
        for (ratio, row) in golden.iter().enumerate() {
            for (&(ceiling_cavity, walls), expected) in GOLDEN_COLUMNS.iter().zip(row) {
                let reflectance = CavityReflectances { ceiling_cavity, walls, floor_cavity: 0.2 };
                let lamp = 1.25 * distribution.flux().value();
                let cavity = Cavity::lm57(ratio as f64);
                let c = coefficients(&zonal, lamp, &cavity, &reflectance, multipliers).unwrap();
                for (value, expected) in
                    [c.utilization, c.ceiling_cavity_exitance, c.wall_exitance].iter().zip(expected)
                {
                    worst = worst.max((value - expected).abs());
                }
            }
        }
    }
    worst
}

#[test]
fn utilization_tables_equal_independent_ones_and_a_wrong_zonal_constant_does_not() {
    let right = distance_from_golden(&LM57);
    assert!(right < 1.5e-5, "{right:e}");
    for zone in 1..9 {
        let (mut wrong_a, mut wrong_b) = (LM57, LM57);
        wrong_a.a[zone] *= 1.05;
        wrong_b.b[zone] *= 1.05;
        for wrong in [wrong_a, wrong_b] {
            assert!(distance_from_golden(&wrong) > 3e-5, "zone {}: {:e}", zone + 1, distance_from_golden(&wrong));
        }
    }
}

#[rustfmt::skip]
const AXIAL_DOWNLIGHT: Golden = [
    [[0.95238, 0.15238, 0.00000], [0.93023, 0.13023, 0.00000],
     [0.85106, 0.05106, 0.00000], [0.80000, 0.00000, 0.00000]],
    [[0.88885, 0.15758, 0.28892], [0.81627, 0.10760, 0.10807],
     [0.77706, 0.04736, 0.16961], [0.70858, 0.00000, 0.00000]],
    [[0.82406, 0.16330, 0.29146], [0.71515, 0.09103, 0.10118],
     [0.70342, 0.04461, 0.16648], [0.62098, 0.00000, 0.00000]],
    [[0.76347, 0.16730, 0.28662], [0.63079, 0.07866, 0.09345],
     [0.63754, 0.04229, 0.15942], [0.54590, 0.00000, 0.00000]],
    [[0.70810, 0.16939, 0.27879], [0.56067, 0.06921, 0.08620],
     [0.57984, 0.04023, 0.15141], [0.48278, 0.00000, 0.00000]],
    [[0.65799, 0.16983, 0.26968], [0.50207, 0.06181, 0.07968],
     [0.52957, 0.03835, 0.14343], [0.42981, 0.00000, 0.00000]],
    [[0.61285, 0.16892, 0.26006], [0.45270, 0.05588, 0.07391],
     [0.48574, 0.03662, 0.13582], [0.38521, 0.00000, 0.00000]],
    [[0.57226, 0.16699, 0.25037], [0.41079, 0.05102, 0.06880],
     [0.44744, 0.03501, 0.12870], [0.34744, 0.00000, 0.00000]],
    [[0.53577, 0.16429, 0.24085], [0.37493, 0.04698, 0.06428],
     [0.41384, 0.03350, 0.12211], [0.31524, 0.00000, 0.00000]],
    [[0.50294, 0.16106, 0.23164], [0.34402, 0.04356, 0.06025],
     [0.38424, 0.03209, 0.11604], [0.28763, 0.00000, 0.00000]],
    [[0.47334, 0.15746, 0.22281], [0.31719, 0.04062, 0.05666],
     [0.35807, 0.03077, 0.11044], [0.26378, 0.00000, 0.00000]],
];

#[rustfmt::skip]
const BATWING: Golden = [
    [[0.91951, 0.25755, 0.00000], [0.88208, 0.22012, 0.00000],
     [0.74827, 0.08631, 0.00000], [0.66196, 0.00000, 0.00000]],
    [[0.83360, 0.27306, 0.37835], [0.73047, 0.19816, 0.14003],
     [0.64854, 0.08449, 0.21007], [0.54235, 0.00000, 0.00000]],
    [[0.75243, 0.28525, 0.36967], [0.60632, 0.18271, 0.12677],
     [0.55973, 0.08302, 0.19813], [0.44097, 0.00000, 0.00000]],
    [[0.68058, 0.29293, 0.35448], [0.50900, 0.17150, 0.11404],
     [0.48637, 0.08154, 0.18387], [0.36172, 0.00000, 0.00000]],
    [[0.61803, 0.29677, 0.33744], [0.43274, 0.16304, 0.10284],
     [0.42651, 0.08000, 0.17007], [0.30047, 0.00000, 0.00000]],
    [[0.56375, 0.29768, 0.32035], [0.37232, 0.15643, 0.09324],
     [0.37746, 0.07844, 0.15750], [0.25282, 0.00000, 0.00000]],
    [[0.51662, 0.29648, 0.30390], [0.32388, 0.15110, 0.08502],
     [0.33695, 0.07688, 0.14628], [0.21536, 0.00000, 0.00000]],
    [[0.47560, 0.29379, 0.28840], [0.28458, 0.14670, 0.07798],
     [0.30318, 0.07535, 0.13630], [0.18555, 0.00000, 0.00000]],
    [[0.43977, 0.29008, 0.27392], [0.25233, 0.14298, 0.07190],
     [0.27478, 0.07387, 0.12744], [0.16156, 0.00000, 0.00000]],
    [[0.40835, 0.28573, 0.26048], [0.22557, 0.13978, 0.06662],
     [0.25068, 0.07246, 0.11955], [0.14203, 0.00000, 0.00000]],
    [[0.38067, 0.28098, 0.24804], [0.20316, 0.13700, 0.06201],
     [0.23006, 0.07112, 0.11250], [0.12595, 0.00000, 0.00000]],
];

#[rustfmt::skip]
const ASYMMETRIC: Golden = [
    [[0.95238, 0.15238, 0.00000], [0.93023, 0.13023, 0.00000],
     [0.85106, 0.05106, 0.00000], [0.80000, 0.00000, 0.00000]],
    [[0.87450, 0.16369, 0.34692], [0.79044, 0.10731, 0.13035],
     [0.75507, 0.04827, 0.20828], [0.67916, 0.00000, 0.00000]],
    [[0.79704, 0.17403, 0.34668], [0.66956, 0.09088, 0.12075],
     [0.66380, 0.04622, 0.20139], [0.56941, 0.00000, 0.00000]],
    [[0.72736, 0.18069, 0.33627], [0.57305, 0.07884, 0.10992],
     [0.58658, 0.04431, 0.18945], [0.48112, 0.00000, 0.00000]],
    [[0.66594, 0.18403, 0.32264], [0.49623, 0.06972, 0.09995],
     [0.52226, 0.04245, 0.17695], [0.41105, 0.00000, 0.00000]],
    [[0.61204, 0.18478, 0.30820], [0.43444, 0.06259, 0.09120],
     [0.46854, 0.04064, 0.16517], [0.35513, 0.00000, 0.00000]],
    [[0.56473, 0.18363, 0.29391], [0.38414, 0.05685, 0.08363],
     [0.42336, 0.03888, 0.15441], [0.31004, 0.00000, 0.00000]],
    [[0.52312, 0.18113, 0.28018], [0.34271, 0.05212, 0.07707],
     [0.38505, 0.03719, 0.14471], [0.27328, 0.00000, 0.00000]],
    [[0.48643, 0.17768, 0.26719], [0.30819, 0.04815, 0.07136],
     [0.35232, 0.03558, 0.13598], [0.24299, 0.00000, 0.00000]],
    [[0.45395, 0.17361, 0.25501], [0.27914, 0.04475, 0.06637],
     [0.32413, 0.03404, 0.12813], [0.21777, 0.00000, 0.00000]],
    [[0.42509, 0.16917, 0.24362], [0.25446, 0.04181, 0.06198],
     [0.29968, 0.03260, 0.12105], [0.19657, 0.00000, 0.00000]],
];

#[rustfmt::skip]
const UPLIGHT: Golden = [
    [[0.76193, 0.76182, 0.00000], [0.65120, 0.65109, 0.00000],
     [0.25540, 0.25529, 0.00000], [0.00011, 0.00000, 0.00000]],
    [[0.69282, 0.77378, 0.30508], [0.54261, 0.63492, 0.10050],
     [0.22264, 0.25462, 0.06945], [0.00001, 0.00000, 0.00000]],
    [[0.63017, 0.78211, 0.29264], [0.45767, 0.62351, 0.08927],
     [0.19506, 0.25401, 0.06409], [0.00000, 0.00000, 0.00000]],
    [[0.57376, 0.78749, 0.28023], [0.38975, 0.61515, 0.08020],
     [0.17169, 0.25344, 0.05941], [0.00000, 0.00000, 0.00000]],
    [[0.52333, 0.79042, 0.26794], [0.33475, 0.60883, 0.07266],
     [0.15187, 0.25290, 0.05526], [0.00000, 0.00000, 0.00000]],
    [[0.47848, 0.79138, 0.25593], [0.28974, 0.60390, 0.06630],
     [0.13502, 0.25237, 0.05156], [0.00000, 0.00000, 0.00000]],
    [[0.43872, 0.79082, 0.24434], [0.25261, 0.59995, 0.06086],
     [0.12067, 0.25187, 0.04824], [0.00000, 0.00000, 0.00000]],
    [[0.40352, 0.78913, 0.23325], [0.22173, 0.59670, 0.05616],
     [0.10840, 0.25138, 0.04526], [0.00000, 0.00000, 0.00000]],
    [[0.37238, 0.78661, 0.22272], [0.19589, 0.59397, 0.05206],
     [0.09787, 0.25091, 0.04258], [0.00000, 0.00000, 0.00000]],
    [[0.34481, 0.78352, 0.21277], [0.17412, 0.59164, 0.04847],
     [0.08880, 0.25046, 0.04015], [0.00000, 0.00000, 0.00000]],
    [[0.32035, 0.78004, 0.20342], [0.15568, 0.58962, 0.04530],
     [0.08096, 0.25003, 0.03796], [0.00000, 0.00000, 0.00000]],
];
