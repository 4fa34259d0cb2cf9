//! `image`: `rgba`, shape `[height, width, 4]`.

use ivd_core::{Buffer, Image};
use serde::{Deserialize, Serialize};

use super::encoded::Encoded;
use super::sections::{Decoder, SectionBytes};
use crate::Element;
use crate::error::Problem;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    width: usize,
    height: usize,
}

pub(super) fn encode(image: &Image) -> Result<Encoded<'_>, String> {
    let (width, height) = (image.width(), image.height());
    let shape = vec![height as u64, width as u64, 4];
    Encoded::new(
        &Content { width, height },
        vec![SectionBytes::new("rgba", Element::U8, shape, image.rgba())],
    )
}

pub(super) fn decode(decoder: &mut Decoder<'_>) -> Result<Image, Problem> {
    let Content { width, height } = decoder.content()?;
    let rgba: Buffer<u8> = decoder.take("rgba", Element::U8, &[height as u64, width as u64, 4])?;
    Ok(Image::new(width, height, rgba.into_vec())?)
}
