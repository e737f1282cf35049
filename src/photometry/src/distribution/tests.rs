//! Laws of a luminous intensity distribution: flux, symmetry, directions.

use super::*;
use approx::assert_relative_eq;

/// Case S1 of the engine tests: axial uplight, flux 1817.2814559 lm.
pub(crate) fn s1() -> LuminousIntensityDistribution {
    let gamma = vec![0.0, 89.0, 90.0, 95.0, 115.0, 135.0, 155.0, 175.0, 180.0];
    let candela = vec![0.0, 0.0, 4.5, 35.7, 218.3, 421.6, 576.4, 662.3, 664.4];
    LuminousIntensityDistribution::axial(gamma, candela).unwrap()
}

#[test]
fn isotropic_flux_is_four_pi() {
    let isotropic = LuminousIntensityDistribution::axial(vec![0.0, 180.0], vec![1.0, 1.0]).unwrap();
    assert_relative_eq!(isotropic.flux().value(), 4.0 * std::f64::consts::PI, max_relative = 1e-12);
}

#[test]
fn angles_next_to_each_other_have_no_flux_between_them() {
    for narrow in [1e-320, 1e-12, 2e-9, 1e-6] {
        let step = LuminousIntensityDistribution::axial(vec![0.0, narrow, 180.0], vec![9.0, 1.0, 1.0]).unwrap();
        assert_relative_eq!(step.flux().value(), 4.0 * std::f64::consts::PI, max_relative = 1e-9);
        // A step in the intensity lies at its angle, wherever `f64` separates the two angles.
        for at in [1.0, 37.0, 90.0, 179.0] {
            let begins =
                LuminousIntensityDistribution::axial(vec![0.0, at, at + narrow, 180.0], vec![0.0, 0.0, 8.0, 0.0]);
            let all = LuminousIntensityDistribution::axial(vec![0.0, at, 180.0], vec![0.0, 8.0, 0.0]).unwrap();
            if let Ok(begins) = begins {
                let right = all.flux_between(at, 180.0).value();
                assert_relative_eq!(begins.flux().value(), right, max_relative = 2e-6);
            }
        }
    }
    for half in [0.0099, 0.0101] {
        assert_relative_eq!(sinc_minus_cosine(half), half.sin() / half - half.cos(), max_relative = 1e-11);
    }
}

#[test]
fn s1_flux_is_the_converged_value() {
    assert_relative_eq!(s1().flux().value(), 1817.2814559, max_relative = 1e-9);
    assert_relative_eq!(s1().full_circle().flux().value(), s1().flux().value(), max_relative = 1e-13);
}

#[test]
fn many_intensities_at_once_are_those_of_each() {
    let gamma = vec![10.0, 30.0, 90.0];
    let angles: Vec<f64> = (0..=720).map(|k| 0.5 * f64::from(k)).collect();
    for c in
        [vec![0.0], vec![0.0, 45.0, 90.0], vec![0.0, 60.0, 180.0], vec![90.0, 180.0, 270.0], vec![0.0, 120.0, 360.0]]
    {
        let candela = c.iter().flat_map(|c| [7.0 + c % 360.0, 31.5, 2.0 + c % 360.0]).collect();
        let table = LuminousIntensityDistribution::new(c, gamma.clone(), candela).unwrap();
        let each = angles.iter().flat_map(|g| angles.iter().map(|c| table.intensity(*c, *g).value()));
        assert!(table.intensities(&angles, &angles).into_iter().eq(each));
    }
}

/// A table of these planes: the intensity of each is its C angle, plus 100 at the nadir and 200 at the zenith.
fn planes(c: Vec<f64>) -> LuminousIntensityDistribution {
    let candela = c.iter().flat_map(|c| [100.0 + c, 200.0 + c]).collect();
    LuminousIntensityDistribution::new(c, vec![0.0, 180.0], candela).unwrap()
}

#[test]
fn symmetry_folds_every_direction_onto_the_stored_planes() {
    let quadrant = planes(vec![0.0, 45.0, 90.0]);
    let c0 = planes(vec![0.0, 60.0, 180.0]);
    let c90 = planes(vec![90.0, 180.0, 270.0]);
    for (table, c, stored) in [
        (&quadrant, 135.0, 45.0),
        (&quadrant, 200.0, 20.0),
        (&quadrant, -30.0, 30.0),
        (&c0, 300.0, 60.0),
        (&c90, 0.0, 180.0),
        (&c90, 30.0, 150.0),
        (&c90, 330.0, 210.0),
    ] {
        assert_relative_eq!(table.intensity(c, 0.0).value(), 100.0 + stored, max_relative = 1e-14);
    }
    for table in [&quadrant, &c0, &c90] {
        let full = table.full_circle();
        assert_eq!(full.symmetry(), Symmetry::None);
        for c in (0..720).map(|c| 0.5 * f64::from(c)) {
            assert_relative_eq!(
                full.intensity(c, 77.0).value(),
                table.intensity(c, 77.0).value(),
                max_relative = 1e-13
            );
        }
    }
}

#[test]
fn outside_the_table_there_is_no_light_and_padding_says_so_too() {
    let up = LuminousIntensityDistribution::axial(vec![90.0, 180.0], vec![5.0, 10.0]).unwrap();
    assert_eq!(up.intensity(0.0, 89.999).value(), 0.0);
    let padded = up.padded(1e-4);
    assert_eq!(padded.gamma_deg(), [0.0, 90.0 - 1e-4, 90.0, 180.0]);
    assert_eq!(padded.intensity(0.0, 45.0).value(), 0.0);
    assert_eq!(padded.intensity(0.0, 135.0).value(), 7.5);
}

#[test]
fn directions_and_angles_are_inverse() {
    for (c, gamma) in [(0.0, 90.0), (90.0, 45.0), (213.0, 135.0), (359.0, 1e-7)] {
        let (c2, gamma2) = angles_deg(direction(c, gamma));
        assert_relative_eq!(c2, c, epsilon = 1e-6);
        assert_relative_eq!(gamma2, gamma, epsilon = 1e-12);
    }
    assert_eq!(angles_deg(DVec3::NEG_Z).1, 0.0);
    assert_eq!(angles_deg(DVec3::Z).1, 180.0);
}
