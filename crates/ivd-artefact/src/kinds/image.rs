//! `image`: `rgba`, shape `[height, width, 4]`. From version 2 on there may be several frames, shape `[frames, height, width, 4]`, and `light`, `f32` of the same
//! shape; a single picture without light is written as version 1.

use ivd_core::{Buffer, Image};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

/// The newest version.
pub(crate) const VERSION: u16 = 2;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    width: usize,
    height: usize,
    #[serde(default = "one", skip_serializing_if = "is_one")]
    frames: usize,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    light: bool,
}

/// The version before frames and light.
const SINGLE: u16 = 1;

fn one() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde hands references")]
fn is_one(frames: &usize) -> bool {
    *frames == 1
}

impl Content {
    fn shape(&self) -> Vec<u64> {
        let sides = [self.frames, self.height, self.width, 4].map(|side| side as u64);
        sides[usize::from(self.frames == 1)..].to_vec()
    }
}

pub(super) fn encode(image: &Image) -> Result<Encoded<'_>, String> {
    let [width, height, frames] = [image.width(), image.height(), image.frames()];
    let content = Content { width, height, frames, light: image.light().is_some() };
    let shape = content.shape();
    let mut sections = vec![SectionBytes::new("rgba", Element::U8, shape.clone(), image.rgba())];
    sections.extend(image.light().map(|light| SectionBytes::new("light", Element::F32, shape, light)));
    let version = (frames == 1 && !content.light).then_some(SINGLE);
    Ok(Encoded { version, ..Encoded::new(&content, sections)? })
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Image, Problem> {
    let content: Content = decoder.content()?;
    let shape = content.shape();
    let rgba: Buffer<u8> = decoder.take("rgba", Element::U8, &shape)?;
    let image = Image::of_frames([content.width, content.height], content.frames, rgba.into_vec())?;
    if content.light {
        let light: Buffer<f32> = decoder.take("light", Element::F32, &shape)?;
        return Ok(image.with_light(light.into_vec())?);
    }
    Ok(image)
}
