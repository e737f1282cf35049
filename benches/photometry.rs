//! Throughput of the photometric readers in MB/s and of what is asked of a distribution: `cargo bench -p luxproof-physics-tests --bench photometry`.

use divan::counter::BytesCount;
use divan::{Bencher, black_box};
use luxproof_photometry::{DirectionSampler, LuminousIntensityDistribution, Photometry, eulumdat, lm63, tm33};

/// C planes and gamma angles: an office luminaire, a street luminaire, a dense laboratory table.
const SIZES: [(u32, u32); 3] = [(5, 37), (73, 73), (361, 361)];

fn main() {
    divan::main();
}

/// A table over the whole sphere with four digits a value, as files have them.
fn photometry((planes, gammas): (u32, u32)) -> Photometry {
    let spaced = |count: u32, last: f64| (0..count).map(|k| last * f64::from(k) / f64::from(count - 1)).collect();
    let (c_deg, gamma_deg): (Vec<f64>, Vec<f64>) = (spaced(planes, 360.0), spaced(gammas, 180.0));
    let rough = |k: u32| (1000.0 * (0.5 + 0.618_034 * f64::from(k)).fract()).round() / 10.0;
    let mut candela: Vec<f64> = (0..planes * gammas).map(rough).collect();
    let (first, end) = (candela[..gammas as usize].to_vec(), candela.len() - gammas as usize);
    candela[end..].copy_from_slice(&first);
    let table = LuminousIntensityDistribution::new(c_deg, gamma_deg, candela);
    Photometry::of(table.unwrap_or_else(|error| unreachable!("the table is sound: {error}")))
}

/// The same table as TM-33.
fn as_tm33(photometry: &Photometry) -> String {
    let table = &photometry.distribution;
    let plane = |c: usize| {
        let values = table.gamma_deg().iter().zip(table.plane(c));
        values
            .map(|(v, i)| format!("<IntData h=\"{}\" v=\"{v}\">{i}</IntData>\n", table.c_deg()[c]))
            .collect::<Vec<String>>()
            .concat()
    };
    let data = (0..table.c_deg().len()).map(plane).collect::<Vec<String>>().concat();
    format!(
        "<IESTM33-22><Emitter><LuminousData><LuminousIntensity>{data}</LuminousIntensity></LuminousData></Emitter></IESTM33-22>"
    )
}

#[divan::bench(args = SIZES)]
fn read_lm63(bencher: Bencher, size: (u32, u32)) {
    let text = lm63::write_2019(&photometry(size)).text;
    bencher.counter(BytesCount::of_str(&text)).bench(|| lm63::parse(black_box(text.as_bytes())));
}

#[divan::bench(args = SIZES)]
fn read_eulumdat(bencher: Bencher, size: (u32, u32)) {
    let text = eulumdat::write(&photometry(size)).text;
    bencher.counter(BytesCount::of_str(&text)).bench(|| eulumdat::parse(black_box(text.as_bytes())));
}

#[divan::bench(args = SIZES)]
fn read_tm33(bencher: Bencher, size: (u32, u32)) {
    let text = as_tm33(&photometry(size));
    bencher.counter(BytesCount::of_str(&text)).bench(|| tm33::parse(black_box(text.as_bytes())));
}

#[divan::bench(args = SIZES)]
fn flux(bencher: Bencher, size: (u32, u32)) {
    let table = photometry(size).distribution;
    bencher.bench(|| black_box(&table).flux());
}

#[divan::bench(args = SIZES)]
fn intensity(bencher: Bencher, size: (u32, u32)) {
    let table = photometry(size).distribution;
    bencher.bench(|| black_box(&table).intensity(black_box(123.4), black_box(56.7)));
}

#[divan::bench(args = SIZES)]
fn sample(bencher: Bencher, size: (u32, u32)) {
    if let Some(sampler) = DirectionSampler::new(&photometry(size).distribution) {
        bencher.bench(|| sampler.sample(black_box([0.123, 0.789])));
    }
}
