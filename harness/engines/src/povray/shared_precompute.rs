//! What blocks of one scene and one seed share however often light is reflected: what is reflected once and twice, term by term.
//!
//! All of it follows from the scene, its meters, the seed and the rays a sample, so that the result is the same, in whatever order jobs are read.

use super::pixels::PixelValue;
use super::work::Work;

/// What all reflections may read of a scale, which is 400 times what the first two do: forty times as much. Where hardly any of these two comes,
/// the next block may have a hundred times more.
const MOST: f64 = 0.1;

/// Terms of blocks but the one that follows all reflections, added up by meter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ground {
    /// Scales in lux of what is looked at first, by meter, and of all that follows.
    pub(super) first_scales: Vec<f64>,
    pub(super) scales: Vec<f64>,
    /// Of these terms of the first look.
    pub(super) work: Work,
    /// What the first look reads, where it is one of the blocks.
    pub(super) first: Option<Vec<f64>>,
    /// Rays a sample of the others, and what they read.
    pub(super) rays: u32,
    pub(super) blocks: Vec<Vec<f64>>,
}

impl Ground {
    /// The sum of a block by its place in the sequence of seeds, in which the first look's comes before all others.
    pub(super) fn block(&self, place: usize) -> Option<&[f64]> {
        self.blocks.get(place.checked_sub(1)?).map(Vec::as_slice)
    }

    /// Whether scales that follow from the first two reflections do for what all reflections show at first.
    pub(super) fn has_room_for(&self, seen: &[PixelValue]) -> bool {
        self.scales.iter().zip(seen).all(|(scale, seen)| match seen {
            PixelValue::Value { lx, .. } => *lx <= MOST * scale,
            PixelValue::Above => false,
            PixelValue::Below(_) | PixelValue::Missed => true,
        })
    }

    pub(super) fn numbers(&self) -> Vec<f64> {
        let Work { first_s, further_s } = self.work;
        let is_block = f64::from(u8::from(self.first.is_some()));
        let head = [first_s, further_s, f64::from(self.rays), is_block];
        let by_meter = [&self.first_scales, &self.scales].into_iter().chain(&self.first).chain(&self.blocks);
        head.into_iter().chain(by_meter.flatten().copied()).collect()
    }

    /// Nothing where numbers cannot be those of so many meters.
    pub(super) fn of_numbers(numbers: &[f64], meters: usize) -> Option<Self> {
        let (&[first_s, further_s, rays, is_block], rest) = numbers.split_first_chunk()?;
        if meters == 0 || rest.len() % meters != 0 || !numbers.iter().all(|number| number.is_finite()) {
            return None;
        }
        let mut rows = rest.chunks_exact(meters).map(<[f64]>::to_vec);
        let [first_scales, scales] = [rows.next()?, rows.next()?];
        let is_possible =
            first_scales.iter().chain(&scales).all(|scale| *scale > 0.0) && first_s >= 0.0 && further_s >= 0.0;
        let first = if is_block == 0.0 { None } else { Some(rows.next()?) };
        let (work, rays, blocks) = (Work { first_s, further_s }, rays as u32, rows.collect());
        is_possible.then_some(Self { first_scales, scales, work, first, rays, blocks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_tell_all_of_it_and_what_is_cut_or_cannot_be_is_refused() {
        let work = Work { first_s: 0.25, further_s: 1.5 };
        for first in [None, Some(vec![0.5, 1.5])] {
            let (first_scales, scales) = (vec![3.0, 4.0], vec![5.0, 6.0]);
            let ground =
                Ground { first_scales, scales, work, first, rays: 35, blocks: vec![vec![7.0, 14.0], vec![-0.5, -1.0]] };
            let numbers = ground.numbers();
            assert_eq!(Ground::of_numbers(&numbers, 2).as_ref(), Some(&ground));
            assert_eq!([0, 1, 2, 3].map(|k| ground.block(k).map(|b| b[1])), [None, Some(14.0), Some(-1.0), None]);
            assert_eq!(Ground::of_numbers(&numbers[..numbers.len() - 1], 2), None);
            assert_eq!(Ground::of_numbers(&numbers[..6], 2), None);
            assert_eq!(Ground::of_numbers(&numbers, 0), None);
            for (place, wrong) in [(0, f64::NAN), (0, -1.0), (4, 0.0), (7, -2.0), (9, f64::INFINITY)] {
                let mut numbers = numbers.clone();
                numbers[place] = wrong;
                assert_eq!(Ground::of_numbers(&numbers, 2), None, "{place}");
            }
        }
        assert_eq!(Ground::of_numbers(&[], 2), None);
    }
    #[test]
    fn light_that_hardly_comes_after_two_reflections_gets_scales_of_its_own() {
        let (first_scales, scales, work) = (vec![1.0; 2], vec![100.0, 1.0], Work::default());
        let ground = Ground { first_scales, scales, work, first: None, rays: 35, blocks: vec![] };
        let value = |lx| PixelValue::Value { lx, resolution_lx: 1e-6 };
        for (seen, fits) in [
            ([value(9.0), value(0.09)], true),
            ([value(9.0), value(0.11)], false),
            ([value(11.0), value(0.01)], false),
            ([PixelValue::Below(1e-6), value(0.01)], true),
            ([PixelValue::Below(1e-6), PixelValue::Above], false),
        ] {
            assert_eq!(ground.has_room_for(&seen), fits, "{seen:?}");
        }
    }
}
