//! Light on the faces as numbers and back: what takes long is kept, the rest follows.

use glam::DVec2;

use super::{Kind, Leaf, Lights, Lit, NODES, Off, Part, Shaded, casts, cut_out};

impl Lit {
    /// All that does not follow from the scene at once.
    pub(in crate::simulator::final_gather) fn numbers(&self) -> Vec<f64> {
        let mut all = vec![];
        for parts in &self.faces {
            all.push(parts.len() as f64);
            for Part { corner_m, size_m, kind, .. } in parts {
                all.extend([corner_m.x, corner_m.y, size_m.x, size_m.y]);
                match kind {
                    Kind::Quartered(first, middle_m) => all.extend([*first as f64, middle_m.x, middle_m.y]),
                    Kind::Leaf(leaf) => {
                        all.push(0.0);
                        all.extend(leaf.lux);
                        all.extend([
                            leaf.off.lux,
                            leaf.off.mean_lux,
                            f64::from(u8::from(leaf.is_covered)),
                            leaf.exitance,
                        ]);
                        all.push(leaf.asked.len() as f64);
                        all.extend(leaf.asked.iter().map(|k| f64::from(*k)));
                        all.push(leaf.shaded.len() as f64);
                        for Shaded { emitter, lux, off, shadows } in &leaf.shaded {
                            all.push(f64::from(*emitter));
                            all.extend(lux);
                            all.extend([off.lux, off.mean_lux, shadows.len() as f64]);
                            all.extend(shadows.iter().map(|k| f64::from(*k)));
                        }
                    }
                }
            }
        }
        all
    }

    /// What such numbers say; nothing where they cannot be those of this scene.
    pub(in crate::simulator::final_gather) fn of_numbers(lights: &Lights, numbers: &[f64]) -> Option<Self> {
        let occluders = cut_out(lights);
        let casts = casts(lights, occluders.as_deref());
        let mut numbers = Numbers(numbers.iter());
        let mut faces = vec![];
        for casts in &casts {
            let count = numbers.index(numbers.0.len())?;
            let mut parts = vec![];
            for k in 0..count {
                let (corner_m, size_m) = (numbers.pair()?, numbers.pair()?);
                let kind = match numbers.index(count)? {
                    0 => Kind::Leaf(Box::new(numbers.leaf(lights.emitters.len(), |emitter| {
                        casts.get(emitter)?.as_ref().map(super::Cast::shadows)
                    })?)),
                    // Quarters lie behind.
                    first if first > k && first + 4 <= count => Kind::Quartered(first, numbers.pair()?),
                    _ => return None,
                };
                parts.push(Part { corner_m, size_m, kind, joined: None });
            }
            faces.push(parts);
        }
        numbers.0.next().is_none().then(|| Self::of_parts(lights, occluders.is_some(), casts, faces))
    }
}

/// Numbers that are still to be read.
struct Numbers<'a>(std::slice::Iter<'a, f64>);

impl Numbers<'_> {
    fn next(&mut self) -> Option<f64> {
        self.0.next().copied().filter(|number| number.is_finite())
    }

    fn pair(&mut self) -> Option<DVec2> {
        Some(DVec2::new(self.next()?, self.next()?))
    }

    /// One that counts something, of which there are no more than this.
    fn index(&mut self, most: usize) -> Option<usize> {
        let number = self.next()?;
        (number >= 0.0 && number.fract() == 0.0 && number <= most as f64).then_some(number as usize)
    }

    fn lux(&mut self) -> Option<[f64; NODES]> {
        let mut lux = [0.0; NODES];
        for lux in &mut lux {
            *lux = self.next()?;
        }
        Some(lux)
    }

    fn off(&mut self) -> Option<Off> {
        Some(Off { lux: self.next()?, mean_lux: self.next()? })
    }

    /// Numbers of things of which there are so many.
    fn indices(&mut self, of: usize) -> Option<Vec<u32>> {
        let count = self.index(of)?;
        (0..count).map(|_| self.index(of.checked_sub(1)?).map(|k| k as u32)).collect()
    }

    /// A leaf; of a luminaire it is asked how many shadows its bodies cast on the face, nothing where it casts none.
    fn leaf(&mut self, emitters: usize, shadows: impl Fn(usize) -> Option<usize>) -> Option<Leaf> {
        let (lux, off) = (self.lux()?, self.off()?);
        let (is_covered, exitance) = (self.index(1)? == 1, self.next()?);
        let asked = self.indices(emitters)?;
        let mut shaded = vec![];
        for _ in 0..self.index(emitters)? {
            let emitter = self.index(emitters.checked_sub(1)?)?;
            let (lux, off) = (self.lux()?, self.off()?);
            shaded.push(Shaded { emitter: emitter as u32, lux, off, shadows: self.indices(shadows(emitter)?)? });
        }
        Some(Leaf { lux, off, shaded, is_covered, asked, exitance })
    }
}
