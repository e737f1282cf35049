//! Our part of `ci/benchmarks/bvh`: makes rooms and rays, and casts them on a command on its standard input.
//!
//! `bvh FOLDER TRIANGLES...` writes each room as `TRIANGLES.vertices` and `TRIANGLES.faces` and its rays as `TRIANGLES.coherent` and
//! `TRIANGLES.incoherent` (origin, direction, reach), all of 32 bits, so that Embree gets the very same. A line `closest 1000 coherent` or
//! `occluded 1000 coherent` casts all of them and answers with the seconds that it took; the answers lie in the file `ours`.

use std::f64::consts::{PI, TAU};
use std::io::Write as _;
use std::path::Path;

use glam::DVec3;
use luxproof_scene::geometry::bvh::{Ray, TriangleBvh};

const ROOM_M: DVec3 = DVec3::new(8.0, 6.0, 3.0);
const RAYS: u32 = 1 << 20;
/// Rays of a meter, side by side in a square.
const RAYS_A_METER: u32 = 1024;
/// A ray reaches this far of the way to the wall, so that the wall itself hides nothing.
const SHORT_OF_THE_WALL: f64 = 0.999;

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);
type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("bvh FOLDER TRIANGLES...")?;
    let folder = Path::new(&folder);
    let mut rooms = vec![];
    for name in arguments {
        let (vertices, faces) = furnished_room(name.parse()?);
        write(
            &folder.join(format!("{name}.vertices")),
            vertices.iter().flat_map(|v| v.as_vec3().to_array().map(f32::to_le_bytes)),
        )?;
        write(&folder.join(format!("{name}.faces")), faces.iter().flatten().map(|v| v.to_le_bytes()))?;
        let tree = TriangleBvh::new(&vertices, &faces)?;
        println!("{}", tree.len());
        rooms.push((name, tree));
    }
    let kinds = [("coherent", coherent_rays()), ("incoherent", incoherent_rays())];
    for (kind, rays) in &kinds {
        let numbers = |(ray, reach): &(Ray, f64)| {
            [ray.origin_m.to_array().as_slice(), &ray.direction.to_array(), &[*reach]].concat()
        };
        write(&folder.join(kind), rays.iter().flat_map(numbers).map(|n| (n as f32).to_le_bytes()))?;
    }
    println!("ready");
    for line in std::io::stdin().lines() {
        let line = line?;
        let words: Vec<&str> = line.split(' ').collect();
        let (Some((_, tree)), Some((_, rays))) =
            (rooms.iter().find(|r| words.get(1) == Some(&&*r.0)), kinds.iter().find(|k| words.get(2) == Some(&k.0)))
        else {
            return Err("there are no such rays".into());
        };
        let began = processor_seconds()?;
        let answers: Vec<f32> = if words[0] == "closest" {
            rays.iter()
                .map(|(ray, _)| tree.closest(ray, f64::INFINITY).map_or(f32::INFINITY, |h| h.distance as f32))
                .collect()
        } else {
            rays.iter().map(|(ray, reach)| f32::from(u8::from(tree.occluded(ray, *reach)))).collect()
        };
        let seconds = processor_seconds()? - began;
        write(&folder.join("ours"), answers.iter().map(|a| a.to_le_bytes()))?;
        println!("{seconds}");
    }
    Ok(())
}

/// Seconds that this thread has run, so that what runs beside it does not count.
fn processor_seconds() -> Result<f64, Failure> {
    let times = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    Ok(1e-9 * times.split(' ').next().ok_or("no times")?.parse::<f64>()?)
}

fn write(path: &Path, words: impl Iterator<Item = [u8; 4]>) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    words.into_iter().try_for_each(|word| file.write_all(&word))
}

/// A room with balls and boxes about it, cut up so finely that there are about so many triangles in all.
fn furnished_room(triangles: u32) -> Mesh {
    let mut mesh = Mesh::default();
    add_box(&mut mesh, 1, DVec3::ZERO, ROOM_M);
    let left = triangles.saturating_sub(12);
    let bodies = (left / 12).min((f64::from(triangles).sqrt() / 3.0) as u32 + 1);
    for body in 0..bodies {
        let each = f64::from(left / bodies);
        let place = DVec3::new(spread(body, 0.819_172_5), spread(body, 0.671_043_6), spread(body, 0.549_700_5));
        let half = (0.5 + 0.7 * DVec3::new(place.y, place.z, place.x)) / f64::from(bodies).cbrt();
        let centre = half + place * (ROOM_M - 2.0 * half);
        if body % 2 == 0 || each < 48.0 {
            add_box(&mut mesh, (each / 12.0).sqrt().round() as u32, centre - half, centre + half);
        } else {
            let rings = (each / 4.0).sqrt().round() as u32;
            add_patch(&mut mesh, [2 * rings, rings], |c, g| {
                let ((sin_c, cos_c), (sin_g, cos_g)) = ((TAU * c).sin_cos(), (PI * g).sin_cos());
                centre + half * DVec3::new(sin_g * cos_c, sin_g * sin_c, cos_g)
            });
        }
    }
    mesh
}

fn add_box(mesh: &mut Mesh, cuts: u32, low: DVec3, high: DVec3) {
    for axis in 0..3 {
        for end in [0.0, 1.0] {
            add_patch(mesh, [cuts, cuts], |u, v| {
                let mut at = [u, v, end];
                at.rotate_right(axis);
                low + (high - low) * DVec3::from(at)
            });
        }
    }
}

/// Vertices are rounded to 32 bits, so that the triangles are the same for both.
fn add_patch((vertices, faces): &mut Mesh, [across, down]: [u32; 2], at: impl Fn(f64, f64) -> DVec3) {
    let first = vertices.len() as u32;
    for j in 0..=down {
        for i in 0..=across {
            vertices.push(at(f64::from(i) / f64::from(across), f64::from(j) / f64::from(down)).as_vec3().as_dvec3());
        }
    }
    let corner = |i: u32, j: u32| first + j * (across + 1) + i;
    for (i, j) in (0..down).flat_map(|j| (0..across).map(move |i| (i, j))) {
        faces.push([corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)]);
        faces.push([corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)]);
    }
}

/// From meters at working height into cosine hemispheres, a square of neighbouring directions each.
fn coherent_rays() -> Vec<(Ray, f64)> {
    let ray = |k: u32| {
        let (meter, of_it) = (k / RAYS_A_METER, k % RAYS_A_METER);
        let origin_m = DVec3::new(spread(meter, 0.754_877_7), spread(meter, 0.569_840_3), 0.25) * ROOM_M;
        let side = f64::from(RAYS_A_METER).sqrt();
        let (u, v) =
            (f64::from(of_it) % side / side + 0.5 / side, (f64::from(of_it) / side).floor() / side + 0.5 / side);
        let (sin, cos) = (TAU * u).sin_cos();
        to_the_wall(origin_m, DVec3::new(v.sqrt() * cos, v.sqrt() * sin, (1.0 - v).sqrt()))
    };
    (0..RAYS).map(ray).collect()
}

/// From anywhere in the room to anywhere, each far from the one before.
fn incoherent_rays() -> Vec<(Ray, f64)> {
    let ray = |k: u32| {
        let origin_m =
            DVec3::new(spread(k, 0.819_172_513_4), spread(k, 0.671_043_606_7), spread(k, 0.549_700_477_9)) * ROOM_M;
        let (z, (sin, cos)) = (2.0 * spread(k, 0.754_877_666_2) - 1.0, (TAU * spread(k, 0.569_840_291_0)).sin_cos());
        let across = (1.0 - z * z).sqrt();
        to_the_wall(origin_m, DVec3::new(across * cos, across * sin, z))
    };
    (0..RAYS).map(ray).collect()
}

/// The ray, rounded to 32 bits, and its reach.
fn to_the_wall(origin_m: DVec3, direction: DVec3) -> (Ray, f64) {
    let (origin_m, direction) = (origin_m.as_vec3().as_dvec3(), direction.as_vec3().as_dvec3());
    let wall = ((ROOM_M * direction.signum().max(DVec3::ZERO) - origin_m) / direction).abs().min_element();
    (Ray { origin_m, direction }, f64::from((SHORT_OF_THE_WALL * wall) as f32))
}

/// Evenly spread numbers between zero and one.
fn spread(k: u32, step: f64) -> f64 {
    (0.5 + step * f64::from(k)).fract()
}
