//! `room.xml`: the room's six surfaces and the obstacles; meshes lie in OBJ files of their own.

use glam::DVec3;
use luxproof_scene::Shape;
use luxproof_scene::geometry::{Room, Surface};

use super::{header, placing};
use crate::frame::{Frame, plain};
use crate::{Job, meshes};

pub(super) fn room_xml(job: &Job, frame: &Frame) -> String {
    let mut xml = header(job, "The surfaces, included by the other files.");
    xml += &placing::comment(frame);
    if let Some(room) = &job.scene.room {
        for surface in Surface::ALL {
            xml += &rectangle(room, surface, frame);
        }
    }
    for (k, obstacle) in job.scene.obstacles.iter().enumerate() {
        let bsdf = diffuse(obstacle.reflectance);
        xml += &match &obstacle.shape {
            Shape::Box { min_m, max_m } => cube(k, *min_m, *max_m, &bsdf, frame),
            Shape::Mesh { .. } => mesh(k, &bsdf),
        };
    }
    xml + "</scene>\n"
}

/// Mitsuba's rectangle is the square from -1 to 1 in x and y, facing +z.
fn rectangle(room: &Room, surface: Surface, frame: &Frame) -> String {
    let normal = surface.inward_normal();
    let corners = room.corners(surface);
    let centre = frame.to_scene(0.5 * (corners[0] + corners[2]));
    let up = if surface.axis() == 2 { DVec3::Y } else { DVec3::Z };
    let half = 0.5 * frame.scale * room.size_m;
    let (half_x, half_y) = (half.dot(up.cross(normal).abs()), half.dot(up));
    let [origin, target, up] = [centre, centre + normal, up].map(list);
    let placed = [
        format!(r#"<scale x="{half_x}" y="{half_y}"/>"#),
        format!(r#"<lookat origin="{origin}" target="{target}" up="{up}"/>"#),
    ];
    shape(surface.name(), "rectangle", &placed, &diffuse(room.reflectance.of(surface)))
}

/// Mitsuba's cube reaches from -1 to 1 and faces outwards.
fn cube(k: usize, min_m: DVec3, max_m: DVec3, bsdf: &str, frame: &Frame) -> String {
    let half = 0.5 * frame.scale * (max_m - min_m);
    let centre = frame.to_scene(0.5 * (min_m + max_m));
    let placed = [format!(r#"<scale value="{}"/>"#, list(half)), format!(r#"<translate value="{}"/>"#, list(centre))];
    shape(&format!("obstacle {k}"), "cube", &placed, bsdf)
}

fn shape(name: &str, kind: &str, [first, second]: &[String; 2], bsdf: &str) -> String {
    format!(
        r#"
    <!-- {name} -->
    <shape type="{kind}">
        <transform name="to_world">
            {first}
            {second}
        </transform>
        {bsdf}
    </shape>
"#
    )
}

/// Both sides of a mesh reflect; shading normals would bend its facets.
fn mesh(k: usize, bsdf: &str) -> String {
    format!(
        r#"
    <!-- obstacle {k} -->
    <shape type="obj">
        <string name="filename" value="{name}"/>
        <boolean name="face_normals" value="true"/>
        <bsdf type="twosided">
            {bsdf}
        </bsdf>
    </shape>
"#,
        name = meshes::name(k, meshes::Mesh::Obj),
    )
}

/// A grey diffuse reflector; `rgb`, since a `spectrum` would be tinted.
fn diffuse(reflectance: f64) -> String {
    format!(r#"<bsdf type="diffuse"> <rgb name="reflectance" value="{reflectance}"/> </bsdf>"#)
}

pub(super) fn list(v: DVec3) -> String {
    format!("{}, {}, {}", plain(v.x), plain(v.y), plain(v.z))
}
