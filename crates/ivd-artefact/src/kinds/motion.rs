//! `motion`: a section `displacement/00000`, … of shape `[vertices, 3]` a frame; times and reach as JSON. Where there are inner points:
//! a section `inner` of their places, and one `inner/00000`, … a frame, of shape `[inner, 3]`. Where not all vertices are driven: a section
//! `roles` of shape `[vertices]`. From version 2 on space may move too: sections `space/00000/table` and `space/00000/vectors`, … a frame, as a
//! displacement's; what has none is written as version 1.

use ivd_core::{Ball, Frame, InteriorPoints, Motion};
use serde::{Deserialize, Serialize};

use super::displacement::{field, take_field};
use super::encoded::Encoded;
use super::real::GridContent;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 2;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    grid: GridContent,
    vertex_count: usize,
    times: Vec<f64>,
    reach: Vec<BallContent>,
    /// Number of inner points; left out where there is none.
    #[serde(default, skip_serializing_if = "is_none")]
    inner: usize,
    /// Whether there are roles; left out where all vertices are driven.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    roles: bool,
    /// Whether space moves too; left out where the lattice alone does.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    space: bool,
}

/// The version before motions of space.
const WITHOUT_SPACE: u16 = 1;

#[allow(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_none(count: &usize) -> bool {
    *count == 0
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BallContent {
    centre: [f64; 3],
    radius: f64,
}

fn frame_name(frame: usize) -> String {
    format!("displacement/{frame:05}")
}

fn inner_name(frame: usize) -> String {
    format!("inner/{frame:05}")
}

fn space_names(frame: usize) -> [String; 2] {
    ["table", "vectors"].map(|part| format!("space/{frame:05}/{part}"))
}

pub(super) fn encode(motion: &Motion) -> Result<Encoded<'_>, String> {
    if !motion.frames().iter().all(|f| f.time.is_finite()) {
        return Err("a frame's time is not finite".to_owned());
    }
    let ball = |b: &Ball| BallContent { centre: b.centre, radius: b.radius };
    let content = Content {
        grid: motion.grid().into(),
        vertex_count: motion.vertex_count(),
        times: motion.frames().iter().map(|f| f.time).collect(),
        reach: motion.reach().iter().map(ball).collect(),
        inner: motion.inner().places.len(),
        roles: !motion.roles().is_empty(),
        space: !motion.space().is_empty(),
    };
    let shape = vec![motion.vertex_count() as u64, 3];
    let frames = motion.frames().iter().enumerate();
    let mut sections: Vec<SectionBytes<'_>> = frames
        .map(|(i, frame)| SectionBytes::new(frame_name(i), Element::F64, shape.clone(), &frame.displacement))
        .collect();
    if content.inner > 0 {
        let shape = vec![content.inner as u64, 3];
        sections.push(SectionBytes::new("inner", Element::F64, shape.clone(), &motion.inner().places));
        for (i, frame) in motion.inner().frames.iter().enumerate() {
            sections.push(SectionBytes::new(inner_name(i), Element::F64, shape.clone(), frame));
        }
    }
    if content.roles {
        sections.push(SectionBytes::new(
            "roles",
            Element::U8,
            vec![motion.vertex_count() as u64],
            motion.roles(),
        ));
    }
    for (i, space) in motion.space().iter().enumerate() {
        let [table, vectors] = space_names(i);
        sections.extend(field(table, vectors, space));
    }
    let version = (!content.space).then_some(WITHOUT_SPACE);
    Ok(Encoded { version, ..Encoded::new(&content, sections)? })
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Motion, Problem> {
    let content: Content = decoder.content()?;
    let shape = [content.vertex_count as u64, 3];
    let mut frames = Vec::new();
    for (i, &time) in content.times.iter().enumerate() {
        let displacement = decoder.take(&frame_name(i), Element::F64, &shape)?;
        frames.push(Frame { time, displacement });
    }
    let mut inner = InteriorPoints::default();
    if content.inner > 0 {
        let shape = [content.inner as u64, 3];
        inner.places = decoder.take("inner", Element::F64, &shape)?;
        for i in 0..content.times.len() {
            inner.frames.push(decoder.take(&inner_name(i), Element::F64, &shape)?);
        }
    }
    let roles = if content.roles {
        decoder.take("roles", Element::U8, &[content.vertex_count as u64])?
    } else {
        Vec::new().into()
    };
    let grid = content.grid.grid()?;
    let mut space = Vec::new();
    for i in 0..if content.space { content.times.len() } else { 0 } {
        let [table, vectors] = space_names(i);
        space.push(take_field(decoder, &table, &vectors, grid.dims())?);
    }
    let reach = content.reach.into_iter().map(|b| Ball { centre: b.centre, radius: b.radius }).collect();
    let motion = Motion::new(grid, content.vertex_count, frames)?;
    Ok(motion.with_reach(reach)?.with_inner(inner)?.with_roles(roles)?.with_space(space)?)
}
